"""What a machine's certificate means for a part, from Python: a plan, the machine's state, a virtual measurement."""

from cmm_uq.analysis.machine.state import MachineState, StatedNoise
from cmm_uq.analysis.parts.plan import Nominal, PartCharacteristic as Characteristic, PartFeature as Feature, Plan
from cmm_uq.analysis.parts.result import stated
from cmm_uq.analysis.parts.virtual import MeasurementConditions as Circumstances, Virtual
from cmm_uq.base.points import Machine
from cmm_uq.machine.physics.catalogue import effects

__all__ = [
    "Characteristic", "Circumstances", "Feature", "Machine", "MachineState", "Nominal", "Plan", "StatedNoise", "Virtual",
    "effects", "stated",
]  # fmt: skip
