"""How often U of the decided figures of self-calibration by shifting holds them, by noise: a table in docs/standards.md.

Run:  python -m benchmarks.selfcalibration.decided equal|unequal|plate [RECORDINGS]

Axes of 0, 3, 10 and 27 µm from peak to valley in turn, of the families of ``machines.py``, read at 23 points of 20 mm or at
twelve of 20 to 80 mm, shifted by 20 mm, ten readings; plates of ``plane_study.py``, their curves 0, ⅓ and 1 times as large.
Readings are worked out here and share no code with the package. Noise is white; half of it a walk along each run through the
points, or one walk from the first reading of a series to the last; with tails (t of three degrees of freedom); or as large
again by set-up, alike for all readings of a series. What shapes the curves is weighed by importance instead of sampled.

The truth is that of the curve put in, at the positions that the figure has. Beside U stands how often half of it would hold.
"""

from __future__ import annotations

import sys
from collections import defaultdict
from collections.abc import Callable

import numpy as np

from benchmarks.selfcalibration import plane_study
from benchmarks.selfcalibration.machines import (
    FULL,
    LENGTH,
    PEAK_TO_VALLEY,
    REPEATABILITY,
    REPEATS,
    SHIFT,
    UNEQUAL,
    machine,
)
from cmm_uq.artefacts.shift import axis as of_axis, plane as of_plane
from cmm_uq.artefacts.shift.integration import KnownSpan
from cmm_uq.artefacts.shift.placed_plate import placed_plate
from cmm_uq.artefacts.shift.result import figure_of, peak_to_valley
from cmm_uq.artefacts.shift.series import shifted_series
from cmm_uq.artefacts.shift.smooth import Coefficients, SmoothModel
from cmm_uq.base.messages import Verbatim
from cmm_uq.base.points import Floats, Points
from cmm_uq.base.units import ARCSECOND, MICROMETRE, unit
from cmm_uq.maths.inference.proposals import weighed, weights
from cmm_uq.maths.uncertainty.quantity import Quantity

NOISES = ("white", "walk of each run", "walk of each series", "heavy tails", "by set-up")
U_SHIFT, WORTH = 0.1, 300


def noise_of(kind: str, random: np.random.Generator, shape: tuple[int, ...]) -> Floats:
    """(series, points, repeats, coordinates) of one standard deviation; runs go forth and back in turn."""
    white = random.standard_normal(shape)
    s, n, k, c = shape
    if kind == "heavy tails":
        return np.asarray(random.standard_t(3, shape) / np.sqrt(3))
    if kind == "by set-up":
        return np.asarray(white + random.standard_normal((s, 1, 1, c)))
    if kind.startswith("walk"):
        walk = random.standard_normal((s, k, n, c))  # in the order of reading
        walk = (
            np.cumsum(walk, axis=2)
            if "run" in kind
            else np.cumsum(walk.reshape(s, k * n, c), axis=1).reshape(s, k, n, c)
        )
        walk /= np.sqrt(n if "run" in kind else k * n)
        walk[:, 1::2] = walk[:, 1::2, ::-1]
        return np.asarray(np.sqrt(0.5) * (white + walk.transpose(0, 2, 1, 3)))
    return white


def by_importance(model: SmoothModel, seed: int, _: object) -> tuple[Coefficients, None]:
    """Draws of everything linear, what shapes the functions weighed: what a report samples, for a twentieth of the time."""
    random = np.random.RandomState(seed)
    centre, factor = model.laplace()
    theta, log, _proposal = weighed(model.log_density, centre, 1.2 * factor, random, 400, WORTH, 4000)
    chosen = random.choice(len(theta), 1000, p=weights(log))
    return model.draw(theta[chosen], np.random.default_rng([seed, 1])), None


def straight(values: Floats, at: Floats, ends: Floats, of_ends: Floats) -> float:
    """Peak to valley about the line through the ends, µm."""
    slope = (of_ends[1] - of_ends[0]) / (ends[1] - ends[0])
    return float(np.ptp(values - slope * (at - ends[0]))) / MICROMETRE


def axis(kind: str, seed: int, places: Floats) -> dict[str, tuple[Quantity, float]]:
    random = np.random.default_rng([seed, NOISES.index(kind)])
    shape, _ = machine(random)
    size = (0.0, 3.0, 10.0, 27.0)[seed % 4] * MICROMETRE / PEAK_TO_VALLEY
    true = np.stack([places, places + SHIFT + random.normal(0, 0.02)])
    read = true
    for _ in range(8):  # reading + e(reading) = true
        read = true - size * shape(read)
    noise = REPEATABILITY * noise_of(kind, random, (*true.shape, REPEATS, 1))[..., 0]
    x = (read[:, :, None] + noise).ravel()
    s, p, k = np.indices((2, len(places), REPEATS)).reshape(3, -1)
    points = Points(np.column_stack([x, 0 * x, 0 * x]), s + 1, p + 1, k + 1)
    series = shifted_series(points, "x", np.array([0.0, SHIFT]), U_SHIFT)
    found = of_axis.estimate_curve(series, KnownSpan(0, len(places) - 1, LENGTH, 0.0), seed=seed)
    at, ends = found.curve.position, read[0, [0, -1]]
    return {"linearity": (peak_to_valley(found.about_the_ends),
                          straight(size * shape(at), at, ends, size * shape(ends)))}  # fmt: skip


class Plate(plane_study.TwoAxes):
    """With curves of a part of their size."""

    def __init__(self, random: np.random.Generator, part: float) -> None:
        super().__init__(random)
        self.functions = {name: lambda r, f=f: part * f(r) for name, f in self.functions.items()}  # type: ignore[misc]

    def recorded(self, kind: str, random: np.random.Generator) -> tuple[Points, float]:
        grid = 100.0 * np.arange(5)
        balls = np.column_stack([each.ravel() for each in np.meshgrid(grid, grid)]) + random.normal(0, 0.02, (25, 2))
        read = []
        for dx, dy, degrees in plane_study.PLACINGS:
            c, t = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
            true = balls @ np.array([[c, t], [-t, c]]) + [dx, dy]
            ideal = true
            for _ in range(8):
                ideal = true - self.error(*ideal.T)
            read.append(ideal)
        noise = plane_study.NOISE * noise_of(kind, random, (len(read), 25, plane_study.REPEATS, 2))
        xy = (np.array(read)[:, :, None] + noise).reshape(-1, 2)
        s, p, k = np.indices((len(read), 25, plane_study.REPEATS)).reshape(3, -1)
        length = float(np.linalg.norm(balls[24] - balls[0])) + random.normal(0, plane_study.U_LENGTH)
        return Points(np.column_stack([xy, 0 * s]), s + 1, p + 1, k + 1), length


def plate(kind: str, seed: int) -> dict[str, tuple[Quantity, float]]:
    random = np.random.default_rng([seed, NOISES.index(kind)])
    made = Plate(random, (0.0, 1 / 3, 1.0)[seed % 3])
    points, length = made.recorded(kind, random)
    found = of_plane.estimate_plane(
        placed_plate(points, "xy"), KnownSpan(0, 24, length, plane_study.U_LENGTH), seed=seed
    )
    (x, y), middle = found.positions, found.plate.middle
    along = [np.column_stack([x, middle[1] + 0 * x]), np.column_stack([middle[0] + 0 * y, y])]
    e = [made.error(*each.T) for each in along]
    yaw = made.functions["rotation_x_z"]  # from its mean along X: squareness is that of Y where X is turned by so much
    e[1][:, 0] += y * (float(yaw(middle[:1])[0]) - yaw(x).mean())
    ways = [(each[-1] + off[-1]) - (each[0] + off[0]) for each, off in zip(along, e, strict=True)]
    i, j = (way / np.linalg.norm(way) for way in ways)
    told = {"squareness": (Quantity.of_draws(found.squareness / ARCSECOND, unit("″")),
                           float(-np.arcsin(i @ j)) / ARCSECOND)}  # fmt: skip
    for k, at in enumerate((x, y)):
        for name, curve, off in (
            ("linearity", found.linearity[k], e[k][:, k]),
            ("straightness", found.straightness[k], e[k][:, 1 - k]),
        ):
            line = curve.draws[:, -1:] * (at - at[0]) / (at[-1] - at[0])
            told[f"{name} {'xy'[k]}"] = peak_to_valley(curve.draws - line), straight(off, at, at[[0, -1]], off[[0, -1]])
    return told


Study = Callable[[str, int], dict[str, tuple[Quantity, float]]]
STUDIES: dict[str, Study] = {
    "equal": lambda kind, seed: axis(kind, seed, FULL),
    "unequal": lambda kind, seed: axis(kind, seed, UNEQUAL),
    "plate": plate,
}


def main(name: str, recordings: int, noises: tuple[str, ...] = NOISES) -> None:
    of_axis.sampled = of_plane.sampled = by_importance  # type: ignore[assignment]
    point = Points(np.zeros((1, 3)), *np.ones((3, 1), dtype=np.int64))
    for kind in noises:
        held, half, inside = (defaultdict[str, list[bool]](list) for _ in range(3))
        for seed in range(recordings):
            for figure, (quantity, true) in STUDIES[name](kind, seed).items():
                u = float(figure_of(point, [(quantity, 1.0, Verbatim(figure))], [1.0]).u[0])
                off, (low, high) = abs(quantity.value - true), quantity.interval95
                for own in (figure.split()[0], f"{figure.split()[0]}, part {seed % (3 if name == 'plate' else 4)}"):
                    held[own].append(off <= 2 * u)
                    half[own].append(off <= u)
                    inside[own].append(
                        low - 1e-9 <= true <= high
                    )  # of a straight axis the lower end is 0 but for rounding
            if seed + 1 == recordings or (seed + 1) % 250 == 0:
                for own in held:
                    rate = [f"{100 * np.mean(each[own]):.1f}" for each in (held, inside, half)]
                    print(f"{name}, {kind}, {own}: U holds {rate[0]} %, the interval {rate[1]} %, half of U {rate[2]} % "
                          f"of {len(held[own])}", flush=True)  # fmt: skip


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 1000, tuple(sys.argv[3:]) or NOISES)
