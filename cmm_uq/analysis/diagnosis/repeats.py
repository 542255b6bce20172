"""What a model leaves of a recording, held against what its repeats scatter by: the noise that is independent of any model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from cmm_uq.base.units import MICROMETRE
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.model.noise import repeated_quantity

_FEWEST = 4  # degrees of freedom of the repeats, and of what they share, from which on the two are compared


@dataclass(frozen=True)
class RepeatComparison:
    """Analysis of variance of the residuals, within repeats of one quantity and between quantities (lack of fit)."""

    repeatability_um: float  # standard deviation of a repeat, of one coordinate
    shared_um: float  # the same of what all repeats of a quantity share, as one reading shows it
    p_value: float  # that independent noise alone leaves as much between quantities


def against_repeats(model: RecordingModel) -> RepeatComparison | None:
    """Compare what a model leaves between quantities with the scatter within; nothing of a recording with few repeats.

    F test of lack of fit (Draper & Smith 1998, Applied Regression Analysis, 2.1): exact for normal noise that is independent
    from reading to reading.
    """
    fitted = model.estimate().least_squares
    left = fitted.residuals / model.artefact.noise_scale[model.used]
    _, block = np.unique(repeated_quantity(model, model.used), return_inverse=True)
    block = block.ravel()
    count = np.bincount(block)
    mean = np.bincount(block, left) / count
    within, own = float(np.sum((left - mean[block]) ** 2)), len(left) - len(count)
    between, other = max(float(left @ left) - within, 0.0), fitted.degrees_of_freedom - own
    if min(own, other) < _FEWEST or not within:
        return None
    sizes = np.sqrt([within / own, between / other]) / MICROMETRE
    p_value = float(scipy.special.fdtrc(other, own, (between / other) / (within / own)))
    return RepeatComparison(float(sizes[0]), float(sizes[1]), p_value)
