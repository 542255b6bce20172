"""What a package with a kind of measurement of its own imports: how points become observations, and what the commands ask."""

from cmm_uq.analysis.planning.candidates import (
    MIDDLE,
    PatternFor,
    RelocatedCandidates,
    VolumeCandidates,
    along_lines,
    check_allowed,
)
from cmm_uq.analysis.planning.set_up import Pattern, SetUp, attitude_along, direction_words, planned_length
from cmm_uq.analysis.planning.setting import Planning, Setting
from cmm_uq.analysis.screening.shape import ArtefactShape, Screening, rows_by
from cmm_uq.base.files.table import Uncertainty
from cmm_uq.base.messages import number, say
from cmm_uq.base.points import Floats, Points
from cmm_uq.base.units import METRE, MICROMETRE, unit
from cmm_uq.certificate.document import Column, Section, Table
from cmm_uq.certificate.result import Page, Result
from cmm_uq.jobs.tables.artefact import ArtefactFacts, ReferencedFacts
from cmm_uq.machine.model.artefact import Artefact, Size
from cmm_uq.machine.model.kind import LENGTHS, Beginning, Kind
from cmm_uq.machine.model.recorded import columns_needed

__all__ = [
    "LENGTHS", "METRE", "MICROMETRE", "MIDDLE", "Artefact", "ArtefactFacts", "ArtefactShape", "Beginning", "Column", "Floats",
    "Kind", "Page", "Pattern", "PatternFor", "Planning", "Points", "ReferencedFacts", "RelocatedCandidates", "Result",
    "Screening", "Section", "SetUp", "Setting", "Size", "Table", "Uncertainty", "VolumeCandidates", "along_lines",
    "attitude_along", "check_allowed", "columns_needed", "direction_words", "number", "planned_length", "rows_by", "say",
    "unit",
]  # fmt: skip
