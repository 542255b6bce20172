"""Where a calibration shows an error along the motion of an axis: of each of its points."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cmm_uq.base.points import Floats, Points
from cmm_uq.machine.model.measurement import MeasurementModel
from cmm_uq.machine.physics.effect import Effect


class AtEach(Effect):
    """One millimetre of an error along the motion of an axis at each point by itself."""

    def __init__(self, effect: Effect) -> None:
        self.name, self.along_motion = effect.name, effect.along_motion

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        """See :meth:`Effect.basis`; (n, 3, n)."""
        found = np.zeros((len(points), 3, len(points)))
        each = np.arange(len(points))
        found[each, "xyz".index(str(self.along_motion)), each] = 1.0
        return found


def shown(model: MeasurementModel, effect: Effect) -> Floats:
    """(m, n) of the model's used observations, of a millimetre of error at each of its points."""
    about = model.estimate().about
    return model.seen(model.columns(AtEach(effect), (), about), about)
