"""A ballbar, and where its parts are."""

from __future__ import annotations

from cmm_uq.model.kind import BARS, LENGTHS, Kind

KIND = Kind(
    name="ballbar",
    observe="cmm_uq.kinds.ballbar.observe:Ballbar",
    screen="cmm_uq.kinds.ballbar.screen:SCREENING",
    plan="cmm_uq.kinds.ballbar.plan:PLANNING",
    page="cmm_uq.kinds.ballbar.page:PAGE",
    begin="cmm_uq.kinds.ballbar.begin:BEGINNING",
    tested=(BARS, LENGTHS),
)
