"""A triangle of gauge blocks and cylinders, and where its parts are."""

from __future__ import annotations

from cmm_uq.kinds.triangle.facts import TriangleFacts
from cmm_uq.model.kind import Kind

KIND = Kind(
    name="triangle",
    table=TriangleFacts,
    observe="cmm_uq.kinds.triangle.observe:Triangle",
    screen="cmm_uq.kinds.triangle.screen:SCREENING",
    plan="cmm_uq.kinds.triangle.plan:PLANNING",
    page="cmm_uq.kinds.triangle.page:PAGE",
    begin="cmm_uq.kinds.triangle.begin:BEGINNING",
)
