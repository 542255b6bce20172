"""All of a part's job.toml."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from cmm_uq.base.files.limits import INPUTS
from cmm_uq.base.files.table import Table
from cmm_uq.jobs.laboratory import Laboratory
from cmm_uq.jobs.part.by_tables import CalibratedPartFacts, OrientationsFacts
from cmm_uq.jobs.part.characteristic import CharacteristicFacts
from cmm_uq.jobs.part.feature import FeatureFacts
from cmm_uq.jobs.part.form import FormFacts
from cmm_uq.jobs.part.tables import (
    AlignmentFacts,
    DecisionFacts,
    EnvironmentFacts,
    MachineStateFacts,
    MeasuredFacts,
    PartFacts,
    PartJobFacts,
    PlacingFacts,
    ProbingFacts,
    StylusFacts,
)


class PartFile(Table):
    """All of a part's job.toml."""

    job: PartJobFacts
    """Identification, and free text for the certificate."""
    laboratory: Laboratory = Laboratory()
    """Who answers for the certificate."""
    part: PartFacts
    """What is measured."""
    machine_state: MachineStateFacts
    """The machine as its certificate states it."""
    stylus: Annotated[list[StylusFacts], Field(min_length=1, max_length=INPUTS.most)]
    """Styli that probe it, and what their qualification left uncertain."""
    feature: Annotated[list[FeatureFacts], Field(min_length=1, max_length=INPUTS.most)]
    """Features: where they are meant to be, and where they are probed."""
    alignment: AlignmentFacts = AlignmentFacts()
    """How coordinates of the part follow from measured points."""
    placing: PlacingFacts = PlacingFacts()
    """Where the part lies in the machine."""
    probing: ProbingFacts = ProbingFacts()
    """In which order, how fast and how often the points are probed."""
    environment: EnvironmentFacts = EnvironmentFacts()
    """Temperatures while the part is measured, and what is known of them."""
    form: FormFacts = FormFacts()
    """The part's own form and roughness, between the points that are probed."""
    characteristic: Annotated[list[CharacteristicFacts], Field(min_length=1, max_length=INPUTS.most)]
    """What the drawing asks for."""
    decision: DecisionFacts = DecisionFacts()
    """By which rule conformity with the drawing is decided."""
    recording: MeasuredFacts | None = None
    """The points as they were measured; without them there are uncertainties alone."""
    by_calibrated_part: CalibratedPartFacts | None = None
    """A calibrated part like this one, measured again and again (ISO 15530-3): its uncertainty stands beside this one's."""
    by_orientations: OrientationsFacts | None = None
    """The part in several orientations with standards beside it (ISO/DTS 15530-2 as described): likewise."""
