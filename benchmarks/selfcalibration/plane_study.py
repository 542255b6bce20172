"""What a plate in seven placings leaves of two axes' errors, and how often the bands hold them.

Run:  python -m benchmarks.selfcalibration.plane_study [--machines 100] [--seed 1]

Linearity 27 µm, straightness 8 µm and yaw 4″ from peak to valley, of the four families of ``machines.py``, which the
estimator does not know; scales of 20 ppm and a squareness of 20″ (standard deviations). 25 balls at 100 mm, each 20 µm off
its nominal, three readings of 0.7 µm; the diagonal is known within 0.5 µm.
"""

from __future__ import annotations

import argparse
import json
import time
from collections import defaultdict
from collections.abc import Callable

import numpy as np

from benchmarks.examples.shift_plate_job import PLACINGS
from benchmarks.selfcalibration.machines import RANGE, machine
from cmm_uq.artefacts.shift.integration import KnownSpan
from cmm_uq.artefacts.shift.placed_plate import placed_plate
from cmm_uq.artefacts.shift.plane import PlaneEstimate, estimate_plane
from cmm_uq.artefacts.shift.result import Curve
from cmm_uq.base.points import Floats, Points
from cmm_uq.base.units import ARCSECOND, PPM

NOISE, REPEATS, U_LENGTH = 0.7e-3, 3, 0.5e-3
START = 145.0
"""Lowest reading of any placing, mm."""
SIZES = {"linearity_x": 1.0, "linearity_y": 1.0, "straightness_x_y": 8 / 27, "straightness_y_x": 8 / 27,
         "rotation_x_z": 4 * ARCSECOND / 27e-3}  # fmt: skip
Error = Callable[[Floats], Floats]


class TwoAxes:
    """A machine drawn at random."""

    def __init__(self, random: np.random.Generator) -> None:
        def drawn(size: float) -> Error:
            raw, _ = machine(random)
            return lambda r: size * raw((r - START) * RANGE / 520.0)

        self.functions = {name: drawn(size) for name, size in SIZES.items()}
        self.scales = random.normal(0, 20 * PPM, 2)
        self.squareness = random.normal(0, 20 * ARCSECOND)

    def error(self, x: Floats, y: Floats) -> Floats:
        f = self.functions
        ex = f["linearity_x"](x) + self.scales[0] * x + f["straightness_y_x"](y) - self.squareness * y
        ey = f["linearity_y"](y) + self.scales[1] * y + f["straightness_x_y"](x)
        return np.column_stack([ex - y * f["rotation_x_z"](x), ey])

    def record(self, random: np.random.Generator) -> tuple[Points, float]:
        """A recording, and the diagonal as its certificate has it."""
        grid = 100.0 * np.arange(5)
        balls = np.column_stack([part.ravel() for part in np.meshgrid(grid, grid)]) + random.normal(0, 0.02, (25, 2))
        rows = []
        for s, (dx, dy, degrees) in enumerate(PLACINGS, 1):
            c, t = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
            true = balls @ np.array([[c, t], [-t, c]]) + [dx, dy]
            ideal = true
            for _ in range(8):
                ideal = true - self.error(*ideal.T)
            for repeat in range(1, REPEATS + 1):
                noisy = ideal + random.normal(0, NOISE, ideal.shape)
                rows += [(*r, 0.0, s, p, repeat) for p, r in enumerate(noisy, 1)]
        table = np.array(rows)
        length = float(np.linalg.norm(balls[24] - balls[0])) + random.normal(0, U_LENGTH)
        return Points(table[:, :3], *(table[:, k].astype(np.int64) for k in (3, 4, 5))), length


def compared(made: TwoAxes, found: PlaneEstimate) -> dict[str, tuple[Curve, Floats]]:
    """Each curve with the true one under the same conventions."""
    (x, y), middle = found.positions, found.plate.middle
    along_x, along_y = made.error(x, middle[1] + 0 * x), made.error(middle[0] + 0 * y, y)
    yaw = made.functions["rotation_x_z"](x)

    def straight(values: Floats) -> Floats:
        return np.asarray(values - values[0] - (values[-1] - values[0]) * np.linspace(0, 1, len(values)))

    return {
        "linearity_x": (found.linearity[0], along_x[:, 0] - along_x[0, 0]),
        "linearity_y": (found.linearity[1], along_y[:, 1] - along_y[0, 1]),
        "straightness_x_y": (found.straightness[0], straight(along_x[:, 1])),
        "straightness_y_x": (found.straightness[1], straight(along_y[:, 0])),
        "rotation_x_z": (found.rotations[0], yaw - yaw.mean()),
    }


def study(machines: int, seed: int) -> dict[str, object]:
    random = np.random.default_rng(seed)
    left: dict[str, list[float]] = defaultdict(list)
    inside: dict[str, list[float]] = defaultdict(list)
    whole: dict[str, list[bool]] = defaultdict(list)
    seconds = []
    for index in range(machines):
        made = TwoAxes(random)
        points, length = made.record(random)
        begin = time.perf_counter()
        found = estimate_plane(placed_plate(points, "xy"), KnownSpan(0, 24, length, U_LENGTH), seed=index)
        seconds.append(time.perf_counter() - begin)
        for name, (curve, true) in compared(made, found).items():
            moving = curve.u > 1e-9 * curve.u.max()
            away = (np.abs(true - curve.error) / np.where(moving, curve.u, 1.0))[moving]
            unit = ARCSECOND if name.startswith("rotation") else 1e-3
            left[name].append(float(np.ptp(curve.error - true)) / unit)
            low, high = curve.interval95
            inside[name].append(float(np.mean(((low <= true) & (true <= high))[moving])))
            whole[name].append(bool(away.max() <= curve.simultaneous_factor))
    return {
        "machines": machines, "seed": seed,
        "median_residual_um_or_arcsec": {name: round(float(np.median(values)), 2) for name, values in left.items()},
        "coverage": {
            name: {"pointwise": round(float(np.mean(inside[name])), 3), "whole": round(float(np.mean(whole[name])), 3)}
            for name in left
        },
        "median_seconds": round(float(np.median(seconds)), 1),
    }  # fmt: skip


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--machines", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    print(json.dumps(study(given.machines, given.seed), indent=2))
