"""A ball plate or hole plate: where its parts are, its keys, and what a new job begins with."""

from __future__ import annotations

from typing import ClassVar

from cmm_uq.jobs.beginning import Beginning
from cmm_uq.jobs.tables.artefact import ReferencedFacts
from cmm_uq.machine.model.kind import LENGTHS, Kind


class PlateFacts(ReferencedFacts):
    """Two recordings of a plate at two dates can be compared."""

    with_earlier: ClassVar[bool] = True


BEGINNING = Beginning(
    title="Ball plate in three attitudes, two places each",
    numbering="One measurement is one place of the plate; its points are the balls or holes.",
    artefact={"name": "Ball plate", "u_um": 0.5, "cte_per_k": 11.5e-6},
    plan={"pitch_mm": 80.0, "repeats": 1},
    columns=dict.fromkeys(("reference_x_mm", "reference_y_mm", "reference_z_mm"), ""),
)


KIND = Kind(
    name="plate",
    table=PlateFacts,
    observe="cmm_uq.artefacts.plate.observe:Plate",
    screen="cmm_uq.artefacts.plate.observe:SCREENING",
    plan="cmm_uq.artefacts.plate.observe:PLANNING",
    page="cmm_uq.artefacts.plate.page:PAGE",
    begin="cmm_uq.artefacts.plate.kind:BEGINNING",
    tested=(LENGTHS,),
)
