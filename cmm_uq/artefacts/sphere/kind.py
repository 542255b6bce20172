"""A test sphere, and where its parts are."""

from __future__ import annotations

from cmm_uq.artefacts.sphere.facts import SphereFacts
from cmm_uq.machine.model.kind import FORMS, Kind

KIND = Kind(
    name="sphere",
    table=SphereFacts,
    observe="cmm_uq.artefacts.sphere.observe:Sphere",
    screen="cmm_uq.artefacts.sphere.screen:SCREENING",
    plan="cmm_uq.artefacts.sphere.plan:PLANNING",
    page="cmm_uq.artefacts.sphere.page:PAGE",
    begin="cmm_uq.artefacts.sphere.begin:BEGINNING",
    tested=(FORMS,),
)
