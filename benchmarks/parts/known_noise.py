"""The normal posterior of a machine's errors where the noise is known and white, and errors are as large as physics allows."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cmm_uq.analysis.machine.conditional import RecordedField, white
from cmm_uq.analysis.machine.state import Unmodelled
from cmm_uq.base.points import Floats
from cmm_uq.machine.model.measurement import RecordingModel


def joint_posterior(
    model: RecordingModel, further: Sequence[Unmodelled], sigma_mm: float
) -> tuple[tuple[int, ...], Floats, Floats]:
    """Of a calibration's errors and of errors that it did not model; what needs columns that were not recorded is left out.

    Returns ``which``: places in ``further`` of those that take part. ``mean, covariance``: (k,) and (k, k) of the
    coefficients of the model's effects, then of those.
    """
    whole = RecordedField.of(model, further, learned=False)
    mean, spread = whole.field.normal(white(sigma_mm), np.zeros(0))
    at = np.r_[: whole.modelled, len(mean) - len(whole.sd) : len(mean)]
    unit = np.append(np.ones(whole.modelled), whole.sd)
    return whole.which, mean[at] * unit, spread[np.ix_(at, at)] * np.outer(unit, unit)
