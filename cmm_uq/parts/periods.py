"""An error with a period of which only bounds are known, as a linear one: each of its trial periods with a part of its prior.

A period that nobody knows is any within its bounds, evenly in its logarithm. A sum over many trial periods, each with its
share of the variance, has the same mean and nearly the same covariance between any two points; it is linear, so that it can be
estimated and drawn together with everything else (a linear Bayes estimate: right in mean and covariance, normal where the
truth is a mixture). Few trials would pretend to know the period: two points far apart would err alike.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from cmm_uq.physics.effect import Effect
from cmm_uq.points import Floats, Points

TRIED = 64
"""Periods: correlations of errors at two places are then off by less than a tenth in the root mean square."""


class EveryPeriod(Effect):
    """All trial periods of an effect at once; without a shape of its own."""

    def __init__(self, effect: Effect) -> None:
        self.of = effect
        self.at = tuple(product(*(np.geomspace(shape.low, shape.high, TRIED).tolist() for shape in effect.shape)))
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
        """See :meth:`Effect.basis`: of one trial after the other."""
        return np.concatenate([self.of.basis(points, each) for each in self.at], axis=2)


def linear(effect: Effect) -> Effect:
    """The effect itself where it has no shape, else all of its trials at once."""
    return EveryPeriod(effect) if effect.shape else effect
