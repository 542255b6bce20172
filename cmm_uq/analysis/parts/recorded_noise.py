"""The noise of a machine's readings as its calibration's recording shows it: components by their names, draw by draw."""

from __future__ import annotations

import numpy as np

from cmm_uq.analysis.parts.machine import StatedNoise
from cmm_uq.base.points import Floats
from cmm_uq.machine.model.measurement import MeasurementModel
from cmm_uq.machine.model.noise import growing_lengths
from cmm_uq.maths.inference.noise import Components, Sizes


def stated_noise(model: MeasurementModel, components: Components, sizes: Sizes) -> StatedNoise:
    """Noise of a coordinate for each of N sizes; what the display rounds off is part of a reading.

    Parameters
    ----------
    model : of the calibration.
    components : of its noise.
    sizes : as sampled.
    """
    lengths = growing_lengths(model, model.placed(model.estimate().about))[model.used]
    duration = _duration(model)
    with np.errstate(divide="ignore"):
        time = duration / sizes.rate
    # of a length both ends are noisy, of a point of a part the distance from the first is, and that has none itself
    ends = np.sqrt(model.artefact.rows.shape[1])
    return StatedNoise(
        np.hypot(sizes.reading, components.display / np.sqrt(12)), sizes.placing, sizes.slow, time,
        growth_mm=ends * sizes.growth, longest_mm=float(lengths.max(initial=0.0)), walked_s=duration,
    )  # fmt: skip


def _duration(model: MeasurementModel) -> float:
    """Of the recording, s; one second where it has no times."""
    time = model.artefact.points.columns.get("time_s")
    if time is None:
        return 1.0
    seconds: Floats = time[model.artefact.rows].mean(axis=1)[model.used]
    return max(float(np.ptp(seconds)), 1e-9)
