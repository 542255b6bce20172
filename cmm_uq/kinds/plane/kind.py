"""A probed plane, and where its parts are."""

from __future__ import annotations

from cmm_uq.kinds.plane.facts import PlaneFacts
from cmm_uq.model.kind import Kind

KIND = Kind(
    name="plane",
    table=PlaneFacts,
    observe="cmm_uq.kinds.plane.observe:PlaneSurface",
    screen="cmm_uq.kinds.plane.screen:SCREENING",
    plan="cmm_uq.kinds.plane.plan:PLANNING",
    page="cmm_uq.kinds.plane.page:PAGE",
    begin="cmm_uq.kinds.plane.begin:BEGINNING",
)
