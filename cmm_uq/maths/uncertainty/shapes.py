"""Shapes of distributions without place and size: how each is drawn and inverted (JCGM 101:2008 6.4).

A bounded shape lies between −1 and 1. ``draw(rng, n)`` gives n values, ``inverse(p)`` the value below which the
probability is p.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import special

from cmm_uq.base.points import Floats

_BISECTIONS = 60


@dataclass(frozen=True, eq=False)
class DistributionShape:
    """How to draw and to invert a distribution, and its variance."""

    variance: float
    draw: Callable[[np.random.Generator, int], Floats]
    inverse: Callable[[Floats], Floats]


POINT = DistributionShape(0.0, lambda _, n: np.zeros(n), np.zeros_like)
NORMAL = DistributionShape(1.0, lambda rng, n: rng.standard_normal(n), special.ndtri)
RECTANGULAR = DistributionShape(1 / 3, lambda rng, n: 2 * rng.random(n) - 1, lambda p: 2 * p - 1)
TRIANGULAR = DistributionShape(
    1 / 6,
    lambda rng, n: rng.random(n) + rng.random(n) - 1,
    lambda p: np.where(p < 0.5, np.sqrt(2 * p) - 1, 1 - np.sqrt(2 * (1 - p))),
)
ARCSINE = DistributionShape(
    1 / 2, lambda rng, n: np.sin(2 * np.pi * rng.random(n)), lambda p: np.sin(np.pi * (p - 0.5))
)
EXPONENTIAL = DistributionShape(1.0, lambda rng, n: rng.standard_exponential(n), lambda p: -np.log1p(-p))


def student_t(dof: float) -> DistributionShape:
    """T distribution; of infinite variance with two degrees of freedom or fewer."""
    variance = dof / (dof - 2) if dof > 2 else np.inf
    return DistributionShape(
        variance, lambda rng, n: rng.standard_t(dof, n), lambda p: np.asarray(special.stdtrit(dof, p))
    )


def gamma(order: float) -> DistributionShape:

    return DistributionShape(
        order, lambda rng, n: rng.standard_gamma(order, n), lambda p: np.asarray(special.gammaincinv(order, p))
    )


def trapezoidal(beta: float) -> DistributionShape:
    """Trapezoid whose top is ``beta`` times its base."""

    def inverse(p: Floats) -> Floats:
        tail = np.minimum(p, 1 - p)
        slope = 1 - np.sqrt(2 * tail * (1 - beta**2))
        top = (1 + beta) * (0.5 - tail)
        return np.sign(p - 0.5) * np.where(tail < (1 - beta) / (2 * (1 + beta)), slope, top)

    def draw(rng: np.random.Generator, n: int) -> Floats:
        return (1 + beta) * rng.random(n) + (1 - beta) * rng.random(n) - 1

    return DistributionShape((1 + beta**2) / 6, draw, inverse)


def rectangular_uncertain(doubt: float) -> DistributionShape:
    """Rectangle whose half-width is itself rectangular between 1 − doubt and 1 + doubt (curvilinear trapezoid)."""

    def beyond(x: Floats) -> Floats:
        """Probability of more than x, 1 − doubt ≤ x: that of a rectangle, averaged over its half-width."""
        return np.asarray((1 + doubt - x - x * np.log((1 + doubt) / x)) / (4 * doubt))

    def inverse(p: Floats) -> Floats:
        tail = np.minimum(p, 1 - p)
        straight = (0.5 - tail) * 4 * doubt / np.log((1 + doubt) / (1 - doubt))
        low, high = np.full(np.shape(tail), 1 - doubt), np.full(np.shape(tail), 1 + doubt)
        for _ in range(_BISECTIONS):
            x = (low + high) / 2
            inside = beyond(x) > tail
            low, high = np.where(inside, x, low), np.where(inside, high, x)
        return np.asarray(np.sign(p - 0.5) * np.where(straight <= 1 - doubt, straight, low))

    def draw(rng: np.random.Generator, n: int) -> Floats:
        return (1 + doubt * (2 * rng.random(n) - 1)) * (2 * rng.random(n) - 1)

    return DistributionShape((1 + doubt**2 / 3) / 3, draw, inverse)


def empirical(draws: Floats) -> DistributionShape:
    return DistributionShape(
        float(np.var(draws, ddof=1)),
        lambda rng, n: draws[rng.integers(len(draws), size=n)],
        lambda p: np.quantile(draws, p, method="inverted_cdf"),
    )
