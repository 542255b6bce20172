"""Simulated axes whose errors come from four families that no estimator here knows, and their shifted readings."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from cmm_uq.base.points import Floats, Points

LENGTH, SHIFT, RANGE = 440.0, 20.0, 460.0
PEAK_TO_VALLEY = 27e-3
REPEATABILITY, REPEATS = 1.1e-3, 10
FULL = np.arange(0.0, LENGTH + 1, 20.0)
EQUAL_40 = np.arange(0.0, LENGTH + 1, 40.0)
UNEQUAL = np.array([0, 40, 60, 120, 140, 180, 220, 240, 320, 340, 400, 440.0])

Error = Callable[[Floats], Floats]


def _polynomial(random: np.random.Generator) -> Error:
    weights = random.standard_normal(5) / np.arange(1, 6)
    return lambda x: np.polynomial.legendre.legval(2 * x / RANGE - 1, [0, 0, *weights])


def _waves(random: np.random.Generator) -> Error:
    periods, phases = random.uniform(120, 500, 3), random.uniform(0, 2 * np.pi, 3)
    sizes = random.uniform(0.2, 1.0, 3)
    return lambda x: sum(
        (a * np.sin(2 * np.pi * x / p + f) for a, p, f in zip(sizes, periods, phases, strict=True)), np.zeros_like(x)
    )


def _ballscrew(random: np.random.Generator) -> Error:
    """Lead that changes along the screw, and wear that grows towards both ends."""
    knots = np.linspace(0, RANGE, 6)
    lead = CubicSpline(knots, np.cumsum(random.normal(0, 0.6, 6))).antiderivative()
    low, high = random.exponential(0.7, 2)
    return lambda x: lead(x) / 150 + low * np.exp(-x / 60) + high * np.exp((x - RANGE) / 60)


def _wandering(random: np.random.Generator) -> Error:
    knots = np.linspace(-10, RANGE + 10, random.integers(6, 11))
    return CubicSpline(knots, random.standard_normal(len(knots)))


FAMILIES = (_polynomial, _waves, _ballscrew, _wandering)


def machine(random: np.random.Generator) -> tuple[Error, frozenset[int]]:
    """e of one axis, zero at 0 and 440 mm, 27 µm from peak to valley at the 20 mm positions between; and its families."""
    chosen = random.permutation(4)[: random.integers(1, 3)]
    parts = [(FAMILIES[i](random), random.uniform(0.3, 1.0)) for i in chosen]
    scaled = [(part, weight / np.ptp(part(FULL))) for part, weight in parts]

    def raw(x: Floats) -> Floats:
        return np.asarray(sum((weight * part(x) for part, weight in scaled), np.zeros_like(x)))

    ends = raw(np.array([0.0, LENGTH]))

    def level(x: Floats) -> Floats:
        return raw(x) - ends[0] - (ends[1] - ends[0]) * x / LENGTH

    size = PEAK_TO_VALLEY / np.ptp(level(FULL))
    return lambda x: size * level(x), frozenset(chosen.tolist())


@dataclass(frozen=True)
class Recording:
    """(2, n, repeats) readings of a workpiece in two placings, and its points' true places."""

    readings: NDArray[np.float64]
    true: Floats

    @property
    def points(self) -> Points:
        s, p, k = np.indices(self.readings.shape).reshape(3, -1)
        x = self.readings.ravel()
        return Points(np.column_stack([x, 0 * x, 0 * x]), s + 1, p + 1, k + 1)


def record(error: Error, places: Floats, random: np.random.Generator) -> Recording:
    """Readings r for which r + e(r) is the true place; the shift comes out a little off its nominal, unknown to all."""
    shift = SHIFT + random.normal(0, 0.02)
    true = np.stack([places, places + shift])
    ideal = true.copy()
    for _ in range(6):
        ideal = true - error(ideal)
    noise = random.normal(0, REPEATABILITY, (*true.shape, REPEATS))
    return Recording(ideal[:, :, None] + noise, places)
