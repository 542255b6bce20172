"""A ball plate or hole plate, and where its parts are."""

from __future__ import annotations

from cmm_uq.artefacts.plate.facts import PlateFacts
from cmm_uq.machine.model.kind import LENGTHS, Kind

KIND = Kind(
    name="plate",
    table=PlateFacts,
    observe="cmm_uq.artefacts.plate.observe:Plate",
    screen="cmm_uq.artefacts.plate.screen:SCREENING",
    plan="cmm_uq.artefacts.plate.plan:PLANNING",
    page="cmm_uq.artefacts.plate.page:PAGE",
    begin="cmm_uq.artefacts.plate.begin:BEGINNING",
    tested=(LENGTHS,),
)
