"""An error with a period of which only bounds are known, as a linear one, before and after a recording.

A period that nobody knows is any within its bounds, evenly in its logarithm. A sum over many trial periods, each with its
share of the variance, has the same mean and nearly the same covariance between any two points; it is linear, so that it can be
drawn together with everything else (normal where the truth is a mixture). Few trials would pretend to know the period: two
points far apart would err alike.

What a recording says of such an error follows from its covariance itself, which is a difference of cosine integrals. Estimated
from the sum, amplitudes of trial periods would answer for periods between them: a recording of some hundred readings would
seem to determine them all. So a draw of the sum is a draw beforehand, and what the recording says is added to it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np
from scipy.special import sici

from cmm_uq.base.points import Floats, Points
from cmm_uq.base.units import MICROMETRE, unit
from cmm_uq.machine.physics.effect import Effect, Parameter
from cmm_uq.machine.physics.effects.drives import PeriodicScale

_SAME = 1e-6  # of the shortest period: a distance over which nothing changes
_LOOKED_AT = 61  # readings
TRIED = 64  # periods: correlations of errors at two places are then off by less than a tenth in the root mean square


class EveryPeriod(Effect):
    """All trial periods of an effect at once; without a shape of its own."""

    def __init__(self, effect: Effect) -> None:
        self.of = effect
        self.at = tuple(product(*(_evenly(shape.low, shape.high) for shape in effect.shape)))
        share = 1 / np.sqrt(len(self.at))
        self.name, self.title, self.formula = effect.name, effect.title, effect.formula
        self.mechanism, self.points_to = effect.mechanism, effect.points_to
        self.columns, self.tier, self.along_motion = effect.columns, effect.tier, effect.along_motion
        self.coefficients = tuple(
            replace(one, name=f"{one.name} {i}", prior_sd=float(one.prior_sd * share))
            for i in range(1, len(self.at) + 1)
            for one in effect.coefficients
        )

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        return np.concatenate([self.of.basis(points, each) for each in self.at], axis=2)


class GivenPeriod(Effect):
    """A periodic error with all its trial periods at once, and what a recording says of it, for each combination that it sees.

    A draw f of the sum beforehand is conditioned at any reading x by f(x) + k(x, X)·B·w, w what combinations were found to be
    less what they are by that draw and all others (conditioning by kriging: Chilès, Delfiner 2012, 7.3).

    ``effect``: periodic. ``readings``: (p,) X, where the scale stood at the points of the recording, mm. ``into``: (p, r) B,
    1/mm.
    """

    def __init__(self, effect: PeriodicScale, readings: Floats, into: Floats) -> None:
        self.of, self.sum, self.readings, self.into = effect, EveryPeriod(effect), readings, into
        self.name, self.title, self.formula = effect.name, effect.title, effect.formula
        self.mechanism, self.points_to = effect.mechanism, effect.points_to
        self.axis = self.along_motion = effect.axis
        said = (Parameter(f"said {j}", unit("1"), 0.0) for j in range(1, into.shape[1] + 1))
        self.coefficients = (*self.sum.coefficients, *said)

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        found = np.zeros((len(points), 3, len(self.coefficients)))
        found[:, "xyz".index(self.axis)] = self.at(points.readings[self.axis])
        return found

    def at(self, reading: Floats) -> Floats:
        """(n, j) mm of error at readings (n,): of the trials, then of the combinations."""
        angle = 2 * np.pi * reading[:, None] / np.ravel(self.sum.at)
        waves = MICROMETRE * np.stack([np.sin(angle), np.cos(angle)], axis=2).reshape(len(reading), -1)
        return np.hstack([waves, covariance(self.of, reading, self.readings) @ self.into])

    def beforehand(self, random: np.random.Generator, count: int) -> Floats:
        """Draws (N, j) of the coefficients over their standard deviations, without the recording: of one trial period each.

        Mean and covariance are those of all at once; errors of a linear estimate are then distributed as those of machines
        with one period.
        """
        trials, waves = len(self.sum.at), len(self.of.coefficients)
        found = np.zeros((count, trials, waves))
        found[np.arange(count), random.integers(trials, size=count)] = np.sqrt(trials) * random.standard_normal(
            (count, waves)
        )
        return np.hstack([found.reshape(count, -1), np.zeros((count, self.into.shape[1]))])

    def share(self, draws: Floats) -> float:
        """Standard deviation of errors by draws (N, j), between the readings of the recording, over that beforehand."""
        between = np.linspace(self.readings.min(), self.readings.max(), _LOOKED_AT)
        left = (draws @ self.at(between).T).var(axis=0).mean()
        return float(np.sqrt(left) / (MICROMETRE * self.of.coefficients[0].prior_sd))


def covariance(effect: PeriodicScale, one: Floats, other: Floats) -> Floats:
    """(n, p) mm², of an error whose period nobody knows, at readings (n,) and (p,), mm.

    The mean of σ²·cos(2πd/λ) over ln λ: σ²·(Ci(2πd/λ₀) − Ci(2πd/λ₁))/ln(λ₁/λ₀).
    """
    (shape,), sd = effect.shape, MICROMETRE * effect.coefficients[0].prior_sd
    apart = 2 * np.pi * np.abs(np.subtract.outer(one, other))
    same = apart < _SAME * shape.low
    apart[same] = 1.0
    found = sici(apart / shape.low)[1] - sici(apart / shape.high)[1]
    found /= np.log(shape.high / shape.low)
    found[same] = 1.0
    return np.asarray(sd**2 * found)


def _evenly(low: float, high: float) -> list[float]:
    """The middle of each of as many equal parts of the logarithm, which have the same share of the prior each."""
    each: list[float] = np.exp(np.log(low) + np.log(high / low) * (np.arange(TRIED) + 0.5) / TRIED).tolist()
    return each


def linear(effect: Effect) -> Effect:
    """The effect itself where it has no shape, else all of its trials at once."""
    return EveryPeriod(effect) if effect.shape else effect
