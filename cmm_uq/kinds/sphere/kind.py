"""A test sphere, and where its parts are."""

from __future__ import annotations

from cmm_uq.kinds.sphere.facts import SphereFacts
from cmm_uq.model.kind import FORMS, Kind

KIND = Kind(
    name="sphere",
    table=SphereFacts,
    observe="cmm_uq.kinds.sphere.observe:Sphere",
    screen="cmm_uq.kinds.sphere.screen:SCREENING",
    plan="cmm_uq.kinds.sphere.plan:PLANNING",
    page="cmm_uq.kinds.sphere.page:PAGE",
    begin="cmm_uq.kinds.sphere.begin:BEGINNING",
    tested=(FORMS,),
)
