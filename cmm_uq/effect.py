"""What a package with an effect of its own imports: one class, its parameters, and how far it moves points."""

from cmm_uq.base.messages import say
from cmm_uq.base.points import Floats, Points
from cmm_uq.base.units import ARCSECOND, MICROMETRE, PPM, unit
from cmm_uq.machine.physics.effect import Effect, Parameter
from cmm_uq.machine.physics.effects.rigid_body import turned

__all__ = ["ARCSECOND", "MICROMETRE", "PPM", "Effect", "Floats", "Parameter", "Points", "say", "turned", "unit"]
