"""A triangle of gauge blocks and cylinders, and where its parts are."""

from __future__ import annotations

from cmm_uq.artefacts.triangle.facts import TriangleFacts
from cmm_uq.machine.model.kind import Kind

KIND = Kind(
    name="triangle",
    table=TriangleFacts,
    observe="cmm_uq.artefacts.triangle.observe:Triangle",
    screen="cmm_uq.artefacts.triangle.screen:SCREENING",
    plan="cmm_uq.artefacts.triangle.plan:PLANNING",
    page="cmm_uq.artefacts.triangle.page:PAGE",
    begin="cmm_uq.artefacts.triangle.begin:BEGINNING",
)
