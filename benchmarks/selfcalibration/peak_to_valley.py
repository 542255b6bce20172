"""Does the interval of the peak to valley hold: ``python -m benchmarks.selfcalibration.peak_to_valley [--axes 200]``.

Axes of a straight scale and of curves of 1, 3, 10 and 27 µm from peak to valley, otherwise as in ``study.py``: 23 points,
20 mm of shift, a known length, ten readings of 1.1 µm. Beside the interval stands that of the draws, for comparison.
"""

from __future__ import annotations

import argparse
import json

import numpy as np

from benchmarks.selfcalibration.machines import FULL, LENGTH, PEAK_TO_VALLEY, SHIFT, machine, record
from benchmarks.selfcalibration.study import U_SHIFT
from cmm_uq.artefacts.shift.axis import estimate_curve
from cmm_uq.artefacts.shift.integration import KnownSpan
from cmm_uq.artefacts.shift.result import peak_to_valley
from cmm_uq.artefacts.shift.series import shifted_series
from cmm_uq.base.units import MICROMETRE

SIZES_UM = (0.0, 1.0, 3.0, 10.0, 27.0)


def one(size_um: float, seed: int, index: int) -> tuple[bool, bool, float, float]:
    """Whether the interval holds the truth, whether that of the draws does, and the ends of the first, µm."""
    random = np.random.default_rng([seed, index, round(size_um)])
    shape, _ = machine(random)
    factor = size_um * MICROMETRE / PEAK_TO_VALLEY
    recording = record(lambda x: factor * shape(x), FULL, random)
    series = shifted_series(recording.points, "x", np.array([0.0, SHIFT]), U_SHIFT)
    estimate = estimate_curve(series, KnownSpan(0, len(FULL) - 1, LENGTH, 0.0), seed=index)
    draws, position = estimate.about_the_ends, estimate.curve.position
    ends = series.reading[series.series == 0][[0, -1]]
    true = factor * shape(position)
    first, last = factor * shape(ends)
    truth = float(np.ptp(true - first - (last - first) * (position - ends[0]) / (ends[1] - ends[0]))) / MICROMETRE
    low, high = peak_to_valley(draws).interval95
    before = np.quantile(np.ptp(draws, axis=1) / MICROMETRE, [0.025, 0.975])
    return low <= truth <= high, bool(before[0] <= truth <= before[1]), low, high


def main() -> None:
    """Count, size by size."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--axes", type=int, default=200, help="of each size")
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    for size in SIZES_UM:
        found = [one(size, given.seed, index) for index in range(given.axes)]
        held, before, low, high = (np.array(each) for each in zip(*found, strict=True))
        told = {"peak_to_valley_um": size, "axes": given.axes, "hold": int(held.sum()), "of_the_draws": int(before.sum()),
                "median_interval_um": [round(float(np.median(low)), 2), round(float(np.median(high)), 2)]}  # fmt: skip
        print(json.dumps(told), flush=True)


if __name__ == "__main__":
    main()
