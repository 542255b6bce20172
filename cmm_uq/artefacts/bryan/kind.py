"""A Bryan gauge, and where its parts are."""

from __future__ import annotations

from cmm_uq.machine.model.kind import Kind

KIND = Kind(
    name="bryan",
    observe="cmm_uq.artefacts.bryan.observe:Bryan",
    screen="cmm_uq.artefacts.bryan.screen:SCREENING",
    plan="cmm_uq.artefacts.bryan.plan:PLANNING",
    page="cmm_uq.artefacts.bryan.page:PAGE",
    begin="cmm_uq.artefacts.bryan.begin:BEGINNING",
)
