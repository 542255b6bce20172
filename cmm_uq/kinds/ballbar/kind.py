"""A ballbar, and where its parts are."""

from __future__ import annotations

from cmm_uq.model.kind import Kind

KIND = Kind(
    name="ballbar",
    observe="cmm_uq.kinds.ballbar.observe:Ballbar",
    screen="cmm_uq.kinds.ballbar.screen:SCREENING",
    plan="cmm_uq.kinds.ballbar.plan:PLANNING",
    page="cmm_uq.kinds.ballbar.page:PAGE",
    standards=("ASME B89.4.1-1997", "ISO 10360-2:2009", "VDI/VDE 2617"),
)
