"""An error with a period of which only bounds are known, as a linear one: each of its trial periods with a part of its prior.

A period that nobody knows is one of the effect's trials, each as likely. The sum over all trials, each with its share of the
variance, has the same mean and the same covariance between any two points; it is linear, so that it can be estimated and drawn
together with everything else (a linear Bayes estimate: right in mean and covariance, normal where the truth is a mixture).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from cmm_uq.physics.effect import Effect
from cmm_uq.points import Floats, Points


class EveryPeriod(Effect):
    """All trial periods of an effect at once; without a shape of its own."""

    def __init__(self, effect: Effect) -> None:
        self.of, self.at = effect, tuple(effect.trials())
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
