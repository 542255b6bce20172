"""A Bryan gauge, and where its parts are."""

from __future__ import annotations

from cmm_uq.model.kind import Kind

KIND = Kind(
    name="bryan",
    observe="cmm_uq.kinds.bryan.observe:Bryan",
    screen="cmm_uq.kinds.bryan.screen:SCREENING",
    plan="cmm_uq.kinds.bryan.plan:PLANNING",
    page="cmm_uq.kinds.bryan.page:PAGE",
    begin="cmm_uq.kinds.bryan.begin:BEGINNING",
)
