"""What a package with a standard of its own imports: its characteristics, what each is decided on, and how."""

from cmm_uq.analysis.conformity.decision import decide
from cmm_uq.analysis.conformity.plans import Condition
from cmm_uq.analysis.conformity.standard import Characteristic, Standard, Test
from cmm_uq.analysis.conformity.statement import Decided, Statement
from cmm_uq.base.messages import say
from cmm_uq.base.units import MICROMETRE
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.machine.model.artefact import Artefact
from cmm_uq.machine.model.kind import LENGTHS

__all__ = [
    "LENGTHS", "MICROMETRE", "Artefact", "ArtefactFacts", "Characteristic", "Condition", "Decided", "Standard", "Statement",
    "Test", "decide", "say",
]  # fmt: skip
