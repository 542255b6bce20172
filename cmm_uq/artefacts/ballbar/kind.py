"""A ballbar, and where its parts are."""

from __future__ import annotations

from cmm_uq.machine.model.kind import BARS, LENGTHS, Kind

KIND = Kind(
    name="ballbar",
    observe="cmm_uq.artefacts.ballbar.observe:Ballbar",
    screen="cmm_uq.artefacts.ballbar.screen:SCREENING",
    plan="cmm_uq.artefacts.ballbar.plan:PLANNING",
    page="cmm_uq.artefacts.ballbar.page:PAGE",
    begin="cmm_uq.artefacts.ballbar.begin:BEGINNING",
    tested=(BARS, LENGTHS),
)
