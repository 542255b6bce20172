"""A ball plate or hole plate, and where its parts are."""

from __future__ import annotations

from cmm_uq.kinds.plate.facts import PlateFacts
from cmm_uq.model.kind import LENGTHS, Kind

KIND = Kind(
    name="plate",
    table=PlateFacts,
    observe="cmm_uq.kinds.plate.observe:Plate",
    screen="cmm_uq.kinds.plate.screen:SCREENING",
    plan="cmm_uq.kinds.plate.plan:PLANNING",
    page="cmm_uq.kinds.plate.page:PAGE",
    begin="cmm_uq.kinds.plate.begin:BEGINNING",
    tested=(LENGTHS,),
)
