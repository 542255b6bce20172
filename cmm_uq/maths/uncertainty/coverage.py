"""Coverage intervals and joint regions from draws, and how heavy their tails are (JCGM 101:2008, JCGM 102:2011).

Of M draws in ascending order and q = pM, an interval of coverage p runs from draw r to draw r + q (JCGM 101:2008 7.7). Only
the M − q lowest and the M − q highest draws can be its ends, so only these are kept. Near the shortest interval the length
hardly changes with r, so that the r of the very shortest one is decided by noise and settles as slowly as M^(−1/3).
:func:`settled_shortest_interval` takes the r where a smooth curve through the lengths is least: its ends scatter two to
three times less.

The scatter between blocks says how well the standard deviation of draws is known only while their fourth moment exists. With
heavier tails (t of few degrees of freedom, a ratio whose denominator comes near zero) every block lacks the same rare draws,
the blocks agree, and u is wrong or does not exist. So a generalised Pareto distribution is fitted to the largest draws of each
side, by the weighted means of Zhang & Stephens (Technometrics 51 (2009) 316), as many of them as Vehtari et al. take for
importance weights (J. Mach. Learn. Res. 25 (2024) 72). Its shape k is one over the tail's index: from k = ½ on there is no
variance. A tail that begins beyond all draws cannot be seen.
"""

from __future__ import annotations

from math import gamma, pi

import numpy as np
import scipy
from numpy.typing import NDArray

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats
from cmm_uq.base.values import dataclass
from cmm_uq.maths.uncertainty.type_a import check_coverage

_PILOT, _MARGIN = 100_000, 6.0  # draws that say where the tails lie, and standard deviations of that estimate besides
_FEWEST_FOR_CURVE, _SPAN, _DEGREE, _POINTS = 500, 1.5, 4, 200
_EDGE = _LONGER = 0.01
_FEWEST_FOR_FLATNESS, _FLAT = 5000, 10.0
NO_VARIANCE = 0.5  # shape from which on the second moment does not exist
_CANDIDATES, _PRIOR_WEIGHT, _PRIOR_SHAPE = 30, 10, 0.5
_ERRORS = 2.0  # standard errors by which a shape is taken for heavier than it came out, to judge what was not drawn


def inner_draws(trials: int, coverage: float) -> int:
    """Q of JCGM 101 7.7.2: pM, rounded when it is no integer."""
    return int(coverage * trials + 0.5)


def shortest_interval(lowest: Floats, highest: Floats) -> tuple[float, float]:
    """Shortest coverage interval from the M − q lowest and the M − q highest draws, both ascending (7.7.4)."""
    first = int(np.argmin(highest - lowest))
    return float(lowest[first]), float(highest[first])


def settled_shortest_interval(lowest: Floats, highest: Floats) -> tuple[float, float]:
    """Shortest coverage interval whose place is not decided by noise, from the same draws.

    The lengths are followed over the log-odds of r/(M − q), in which they bend evenly. Where the shortest interval is at
    the edge (a density that only falls), or there are few draws, it is the very shortest one; where all are equally
    short (a rectangular density), it is the symmetric one.
    """
    lengths = highest - lowest
    n, first = len(lengths), int(np.argmin(lengths))
    inner = slice(n // 20, n - n // 20)
    # the lengths differ by no more than the places of single draws scatter
    if n >= _FEWEST_FOR_FLATNESS and np.ptp(lengths[inner]) < _FLAT * np.ptp(lowest[inner]) / np.sqrt(n):
        return symmetric_interval(lowest, highest)
    if n < _FEWEST_FOR_CURVE or not _EDGE * n < first < (1 - _EDGE) * n:
        return shortest_interval(lowest, highest)
    middle = np.log((first + 0.5) / (n - first - 0.5))
    ends = n / (1 + np.exp(-middle + np.array([_SPAN, -_SPAN]))) - 0.5
    r = np.unique(np.linspace(max(0.0, ends[0]), min(n - 1.0, ends[1]), _POINTS).astype(np.int64))
    place = (np.log((r + 0.5) / (n - r - 0.5)) - middle) / _SPAN
    curve = np.polynomial.polynomial.polyfit(place, lengths[r] - lengths[first], _DEGREE)
    fine = np.linspace(-1.0, 1.0, 10 * _POINTS + 1)
    least = fine[np.argmin(np.polynomial.polynomial.polyval(fine, curve))]
    settled = int(np.clip(n / (1 + np.exp(-middle - _SPAN * least)), 0, n - 1))
    if lengths[settled] > (1 + _LONGER) * lengths[first]:
        return shortest_interval(lowest, highest)
    return float(lowest[settled]), float(highest[settled])


def symmetric_interval(lowest: Floats, highest: Floats) -> tuple[float, float]:
    """Probabilistically symmetric coverage interval from the same draws (7.7.2)."""
    first = (len(lowest) + 1) // 2 - 1
    return float(lowest[first]), float(highest[first])


def both_intervals(draws: Floats, coverage: float) -> Floats:
    """Ends (4,) of the shortest and the symmetric interval of draws in ascending order."""
    outer = max(1, len(draws) - inner_draws(len(draws), coverage))
    lowest, highest = draws[:outer], draws[-outer:]
    return np.array([*shortest_interval(lowest, highest), *symmetric_interval(lowest, highest)])


class Tails:
    """The draws of one output that can be ends of a coverage interval, collected block by block.

    All draws are kept until there are enough to say where the tails lie; from then on those in the tails, with a margin.
    """

    def __init__(self, coverage: float) -> None:
        self.coverage, self.trials = coverage, 0
        self._below, self._above = np.inf, -np.inf
        self._low: list[Floats] = []
        self._high: list[Floats] = []

    def add(self, block: Floats) -> None:
        self.trials += len(block)
        self._low.append(block[: np.searchsorted(block, self._below, "right")])
        self._high.append(block[np.searchsorted(block, self._above, "left") :])
        if self.trials < _PILOT or np.isfinite(self._below):
            return
        draws = np.sort(np.concatenate(self._low))
        outside = 1 - self.coverage
        kept = int(len(draws) * outside * 1.05 + _MARGIN * np.sqrt(len(draws) * outside)) + 1
        if 2 * kept < len(draws):
            self._below, self._above = draws[kept], draws[-kept - 1]
            self._low, self._high = [draws[: kept + 1].copy()], [draws[-kept - 1 :].copy()]
        else:
            self._below, self._above = np.finfo(float).max, -np.finfo(float).max

    def extremes(self, count: int) -> tuple[Floats, Floats]:
        """The lowest and the highest ``count`` draws so far, ascending; fewer where fewer are kept."""
        low, high = np.sort(np.concatenate(self._low)), np.sort(np.concatenate(self._high))
        return low[:count], high[-count:]

    def intervals(self) -> Floats:
        """Ends (4,) of the shortest (settled) and the symmetric interval of all draws so far."""
        lowest, highest = self.extremes(max(1, self.trials - inner_draws(self.trials, self.coverage)))
        return np.array([*settled_shortest_interval(lowest, highest), *symmetric_interval(lowest, highest)])


@dataclass(frozen=True, eq=False)
class Ellipsoid:
    """All η with (η − y)ᵀ V⁻¹ (η − y) ≤ factor²; centre (p,), covariance (p, p)."""

    centre: Floats
    covariance: Floats
    factor: float

    @property
    def volume(self) -> float:
        """Area in two dimensions, volume in three."""
        p = len(self.centre)
        ball = pi ** (p / 2) / gamma(p / 2 + 1)
        return float(ball * self.factor**p * np.sqrt(np.linalg.det(self.covariance)))


@dataclass(frozen=True, eq=False)
class Rectangle:
    """All η with |ηⱼ − yⱼ| ≤ factor · uⱼ for every output."""

    centre: Floats
    u: Floats
    factor: float

    @property
    def volume(self) -> float:
        """Area in two dimensions, volume in three."""
        return float(np.prod(2 * self.factor * self.u))


@dataclass(frozen=True, eq=False)
class SmallestRegion:
    """Cells of a mesh that hold the coverage probability in the smallest area."""

    inside: NDArray[np.bool_]  # (k, l) which cells belong to it
    x: Floats  # (k + 1,) edges of the cells
    y: Floats  # (l + 1,)

    @property
    def area(self) -> float:
        return float(np.sum(self.inside * np.outer(np.diff(self.x), np.diff(self.y))))


def elliptical_factor(outputs: int, coverage: float = 0.95) -> float:
    """Factor of the ellipsoid for normal outputs, √χ²: 2.4477 for two and 95 % (JCGM 102 table 1)."""
    check_coverage(coverage)
    return float(np.sqrt(scipy.special.chdtri(outputs, 1 - coverage)))


def elliptical_region(draws: Floats, coverage: float = 0.95) -> Ellipsoid:
    """Ellipsoid about the mean that holds the coverage probability of draws (p, n) (7.7.2)."""
    check_coverage(coverage)
    centre, covariance = draws.mean(axis=1), np.atleast_2d(np.cov(draws))
    if np.linalg.matrix_rank(covariance / np.sqrt(np.outer(np.diag(covariance), np.diag(covariance)))) < len(draws):
        raise CmmUqError("the outputs depend on each other completely", fix="Leave out those that follow from others")
    whitened = np.linalg.solve(np.linalg.cholesky(covariance), draws - centre[:, None])
    return Ellipsoid(centre, covariance, _quantile(np.sqrt(np.sum(whitened**2, axis=0)), coverage))


def rectangular_region(draws: Floats, coverage: float = 0.95) -> Rectangle:
    """Rectangle about the mean, proportional to the uncertainties, that holds the coverage probability (7.7.3)."""
    check_coverage(coverage)
    centre, u = draws.mean(axis=1), draws.std(axis=1, ddof=1)
    largest = np.max(np.abs(draws - centre[:, None]) / u[:, None], axis=0)
    return Rectangle(centre, u, _quantile(largest, coverage))


def smallest_region(draws: Floats, coverage: float = 0.95, cells: int = 60) -> SmallestRegion:
    """Smallest region of two outputs, on a mesh (7.7.4): the fullest cells first, until they hold the probability.

    ``draws``: (2, n); a hundred times as many as there are cells, or more.
    """
    check_coverage(coverage)
    if len(draws) != 2 or draws.shape[1] < 100 * cells:
        problem = f"{draws.shape[1]} draws of {len(draws)} outputs for a mesh of {cells} × {cells} cells"
        raise CmmUqError(problem, fix="It takes two outputs and more draws, or fewer cells")
    counts, x, y = np.histogram2d(draws[0], draws[1], bins=cells)
    fullest = np.argsort(-counts, axis=None, kind="stable")
    held = np.cumsum(counts.ravel()[fullest])
    needed = int(np.searchsorted(held, coverage * draws.shape[1])) + 1
    inside = np.zeros(counts.size, dtype=bool)
    inside[fullest[:needed]] = True
    return SmallestRegion(inside.reshape(counts.shape), x, y)


def _quantile(distances: Floats, coverage: float) -> float:
    """Distance that the fraction ``coverage`` of the draws does not exceed."""
    return float(np.sort(distances)[int(np.ceil(coverage * len(distances))) - 1])


def draws_in_tail(trials: int) -> int:
    """How many of the largest draws are its tail."""
    return int(min(0.2 * trials, 3 * np.sqrt(trials)))


def tail_of(largest: Floats, mean: float, trials: int) -> tuple[float, float]:
    """Shape k, and what draws beyond the largest would add to the mean square about the mean; it may be infinite."""
    excess = largest[1:] - largest[0]
    if len(excess) < 5 or not excess[-1] > 0 or not np.isfinite(excess[-1]):
        return -np.inf, 0.0
    (shape, scale), count = pareto(excess), len(excess)
    heavier = shape + _ERRORS * (1 + max(shape, 0.0)) / np.sqrt(count)
    if heavier >= NO_VARIANCE:
        return shape, float("inf")
    # ∫ (y − mean)² over what is exceeded once in all trials
    further = scale * (np.log(count) if abs(heavier) < 1e-9 else (count**heavier - 1) / heavier)
    start, spread = float(largest[0]) - mean + further, scale + heavier * further
    beyond = start**2 + 2 * start * spread / (1 - heavier) + 2 * spread**2 / ((1 - heavier) * (1 - 2 * heavier))
    return shape, float(beyond) / trials


def pareto(excess: Floats) -> tuple[float, float]:
    """Shape and scale of the generalised Pareto distribution of excesses (n,), ascending and positive.

    The shape is drawn a little towards ½, by ten draws' worth, so that few draws do not make it wild.
    """
    n = len(excess)
    count = _CANDIDATES + int(np.sqrt(n))
    quartile = excess[int(n / 4 + 0.5) - 1] or excess[-1]
    rate = 1 / excess[-1] + (1 - np.sqrt(count / (np.arange(1, count + 1) - 0.5))) / (3 * quartile)
    shapes = np.mean(np.log1p(-rate[:, None] * excess), axis=1)
    likelihood = n * (np.log(-rate / shapes) - shapes - 1)
    weight = np.exp(likelihood - likelihood.max())
    found = float(rate @ weight / weight.sum())
    shape = float(np.mean(np.log1p(-found * excess)))
    return (n * shape + _PRIOR_WEIGHT * _PRIOR_SHAPE) / (n + _PRIOR_WEIGHT), -shape / found
