"""A probed plane, and where its parts are."""

from __future__ import annotations

from cmm_uq.artefacts.plane.facts import PlaneFacts
from cmm_uq.machine.model.kind import Kind

KIND = Kind(
    name="plane",
    table=PlaneFacts,
    observe="cmm_uq.artefacts.plane.observe:PlaneSurface",
    screen="cmm_uq.artefacts.plane.screen:SCREENING",
    plan="cmm_uq.artefacts.plane.plan:PLANNING",
    page="cmm_uq.artefacts.plane.page:PAGE",
    begin="cmm_uq.artefacts.plane.begin:BEGINNING",
)
