"""What is known of an input: the distributions of JCGM 101:2008 table 1, and draws from an earlier analysis.

A :class:`Distribution` says its ``mean`` (the estimate), its ``u`` (the standard uncertainty that the law of propagation
takes), its ``dof`` (how well ``u`` itself is known) and its ``standard_deviation``, and can be drawn and inverted. ``u``
and the standard deviation differ where ``u`` is itself in doubt: there the law of propagation counts the doubt as
degrees of freedom (JCGM 100:2008 G.4.2) and Monte Carlo as width, each once. So a t distribution has u = s/√n and the
standard deviation u√(ν/(ν−2)), and a rectangular one with uncertain limits has the u of its mean width.

A shape is a distribution without place and size (JCGM 101:2008 6.4); a bounded one lies between −1 and 1.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import scipy

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats
from cmm_uq.base.values import dataclass, field

Number = float | Floats  # or an array (n,) with one entry a point, where only the law of propagation is asked for
_BISECTIONS = 60


@dataclass(frozen=True, eq=False)
class DistributionShape:
    variance: float
    draw: Callable[[np.random.Generator, int], Floats]  # n values
    inverse: Callable[[Floats], Floats]  # value below which the probability is p


POINT = DistributionShape(0.0, lambda _, n: np.zeros(n), np.zeros_like)
NORMAL = DistributionShape(1.0, lambda rng, n: rng.standard_normal(n), lambda p: scipy.special.ndtri(p))
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


def t_shape(dof: float) -> DistributionShape:
    """T distribution; of infinite variance with two degrees of freedom or fewer."""
    variance = dof / (dof - 2) if dof > 2 else np.inf
    return DistributionShape(
        variance, lambda rng, n: rng.standard_t(dof, n), lambda p: np.asarray(scipy.special.stdtrit(dof, p))
    )


def gamma_shape(order: float) -> DistributionShape:
    return DistributionShape(
        order, lambda rng, n: rng.standard_gamma(order, n), lambda p: np.asarray(scipy.special.gammaincinv(order, p))
    )


def trapezoid(beta: float) -> DistributionShape:
    """Trapezoid whose top is ``beta`` times its base."""

    def inverse(p: Floats) -> Floats:
        tail = np.minimum(p, 1 - p)
        slope = 1 - np.sqrt(2 * tail * (1 - beta**2))
        top = (1 + beta) * (0.5 - tail)
        return np.sign(p - 0.5) * np.where(tail < (1 - beta) / (2 * (1 + beta)), slope, top)

    def draw(rng: np.random.Generator, n: int) -> Floats:
        return (1 + beta) * rng.random(n) + (1 - beta) * rng.random(n) - 1

    return DistributionShape((1 + beta**2) / 6, draw, inverse)


def blurred_rectangle(doubt: float) -> DistributionShape:
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


@dataclass(frozen=True, eq=False)
class Distribution:
    """An input: location + scale × shape."""

    kind: str  # its name in JCGM 101 table 1, as budgets and model files write it
    mean: Number  # estimate
    u: Number  # standard uncertainty for the law of propagation
    location: Number
    scale: Number
    shape: DistributionShape | None  # how it is drawn
    dof: Number = np.inf  # degrees of freedom of ``u``; infinite when it is taken as known
    stated: Mapping[str, Number] = field(default_factory=dict)  # limits, beta, count, …, for the reader of a budget
    together: str = ""  # joint sample that ``draws`` are one column of; columns of one sample are drawn row by row
    draws: Floats | None = None  # (k,) the earlier draws of a sampled input

    @property
    def standard_deviation(self) -> Number:
        """Standard deviation of what Monte Carlo draws; infinite for t with ν ≤ 2."""
        return self.scale * float(np.sqrt(self._shape.variance))

    @property
    def _shape(self) -> DistributionShape:
        if self.shape is None:
            fix = "Ask for Monte Carlo at one point at a time"
            raise CmmUqError("degrees of freedom that differ from point to point cannot be drawn", fix=fix)
        return self.shape

    def sample(self, rng: np.random.Generator, n: int) -> Floats:
        return np.asarray(self.location + self.scale * self._shape.draw(rng, n))

    def quantile(self, p: Floats) -> Floats:
        """Value below which the probability is ``p``, 0 < p < 1."""
        return np.asarray(self.location + self.scale * self._shape.inverse(p))


def constant(value: Number) -> Distribution:
    _finite(value=value)
    return Distribution("constant", value, 0.0, value, 1.0, POINT)


def normal(value: Number, u: Number, dof: Number = np.inf, kind: str = "normal") -> Distribution:
    """Estimate and standard uncertainty (JCGM 101 6.4.7); with finite ``dof`` it is drawn as t (6.4.9.7)."""
    _finite(value=value, u=u)
    _positive(u=u)
    _known(dof)
    shape: DistributionShape | None = NORMAL
    if not np.all(np.isinf(dof)):
        shape = t_shape(float(dof)) if np.ndim(dof) == 0 else None
    return Distribution(kind, value, u, value, u, shape, dof)


def student_t(value: Number, u: Number, dof: Number) -> Distribution:
    """Scaled and shifted t, as for n indications (JCGM 101 6.4.9): value x̄, u = s/√n, dof = n − 1."""
    return normal(value, u, dof, "t")


def rectangular(low: Number, high: Number, dof: Number = np.inf) -> Distribution:
    """Every value between two limits equally probable (JCGM 101 6.4.2).

    Finite ``dof`` say that the limits are in doubt: it is then :func:`rectangular_uncertain` with the relative doubt
    1/√(2 dof) of JCGM 100 G.4.2.
    """
    if np.all(np.isinf(dof)):
        return _bounded("rectangular", low, high, dof, RECTANGULAR, 1 / 3)
    _limits(low, high, dof)
    return rectangular_uncertain(low, high, (np.asarray(high) - low) / 2 / np.sqrt(2 * np.asarray(dof)), dof)


def rectangular_uncertain(low: Number, high: Number, limit: Number, dof: Number | None = None) -> Distribution:
    """Rectangular between limits that are themselves known to ± ``limit`` only (JCGM 101 6.4.3).

    The degrees of freedom are those of JCGM 100 G.4.2 for a relative doubt of limit/half-width, as annex H.1 counts
    them, unless given.
    """
    _positive(limit=limit)
    half_width = (np.asarray(high) - low) / 2
    overlap = f"limits in doubt by {limit} overlap"
    _need(np.asarray(limit) < half_width, overlap, "The doubt must be below half the width")
    doubt = limit / half_width
    nu = np.maximum(1.0, 0.5 / doubt**2) if dof is None else dof
    shape = blurred_rectangle(float(doubt)) if np.ndim(doubt) == 0 else None
    return _bounded("rectangular_uncertain", low, high, nu, shape, 1 / 3, limit=limit)


def triangular(low: Number, high: Number, dof: Number = np.inf) -> Distribution:
    """Sum of two rectangular quantities of the same width (JCGM 101 6.4.5)."""
    return _bounded("triangular", low, high, dof, TRIANGULAR, 1 / 6)


def trapezoidal(low: Number, high: Number, beta: float, dof: Number = np.inf) -> Distribution:
    """Sum of two rectangular quantities; ``beta`` is the ratio of top to base (JCGM 101 6.4.4)."""
    _need(0 <= beta <= 1, f"beta is {beta}", "The ratio of top to base lies between 0 and 1")
    shape = trapezoid(beta)
    return _bounded("trapezoidal", low, high, dof, shape, shape.variance, beta=beta)


def arcsine(low: Number, high: Number, dof: Number = np.inf) -> Distribution:
    """A quantity that cycles sinusoidally between two limits, at an unknown phase (JCGM 101 6.4.6)."""
    return _bounded("arcsine", low, high, dof, ARCSINE, 1 / 2)


def exponential(value: Number) -> Distribution:
    """A quantity that cannot be negative, of which only the estimate is known (JCGM 101 6.4.10)."""
    _finite(value=value)
    _positive(value=value)
    return Distribution("exponential", value, value, 0.0, value, EXPONENTIAL)


def gamma(count: float, repetitions: int = 1) -> Distribution:
    """Mean number of events, of which ``count`` in all were seen in equal intervals (JCGM 101 6.4.11)."""
    _finite(count=count)
    _need(count >= 0, f"a count of {count}", "A count is not negative")
    _need(repetitions >= 1, f"{repetitions} counting intervals", "Count at least once")
    mean, u = (count + 1) / repetitions, np.sqrt(count + 1) / repetitions
    return Distribution("gamma", mean, u, 0.0, 1 / repetitions, gamma_shape(count + 1), stated={"count": count})


def sampled(draws: Floats, together: str = "") -> Distribution:
    """Draws (k,) from an earlier analysis, such as a posterior."""
    values = np.asarray(draws, dtype=np.float64)
    _need(values.ndim == 1 and len(values) >= 2, "fewer than two draws", "Give a list of draws")
    _finite(samples=values)
    shape = empirical(values)
    _need(shape.variance > 0, "all draws are the same", "Give the value as a constant")
    u = float(np.sqrt(shape.variance))
    return Distribution("sampled", float(values.mean()), u, 0.0, 1.0, shape, together=together, draws=values)


def _bounded(
    kind: str, low: Number, high: Number, dof: Number, shape: DistributionShape | None, variance: float,
    **stated: Number,
) -> Distribution:  # fmt: skip
    _limits(low, high, dof)
    mean, half_width = (np.asarray(low) + high) / 2, (np.asarray(high) - low) / 2
    u = half_width * np.sqrt(variance)
    return Distribution(kind, mean, u, mean, half_width, shape, dof, {"low": low, "high": high, **stated})


def _need(condition: Any, problem: str, fix: str | None = None) -> None:
    if not np.all(condition):
        raise CmmUqError(problem, fix=fix)


def _finite(**numbers: Number) -> None:
    for name, number in numbers.items():
        _need(np.isfinite(number), f"{name} is {number}", "Give finite numbers")


def _positive(**numbers: Number) -> None:
    for name, number in numbers.items():
        _need(np.asarray(number) > 0, f"{name} is {number}", f"{name} must be positive")


def _known(dof: Number) -> None:
    _need(np.asarray(dof) >= 1, f"{dof} degrees of freedom", "One is the least that an uncertainty can have")


def _limits(low: Number, high: Number, dof: Number) -> None:
    _finite(low=low, high=high)
    _need(np.asarray(low) < np.asarray(high), f"low = {low} is not below high = {high}", "Exchange or mend the limits")
    _known(dof)
