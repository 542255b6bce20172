"""Coverage intervals from draws of an output (JCGM 101:2008 7.7), exact for any number of draws in little memory.

Of M draws in ascending order and q = pM, an interval of coverage p runs from draw r to draw r + q. Only the M − q lowest
and the M − q highest draws can be its ends, so only these are kept.

Near the shortest interval the length hardly changes with r, so that the r of the very shortest one is decided by noise
and settles as slowly as M^(−1/3). :func:`settled_shortest_interval` takes the r where a smooth curve through the
lengths is least: an interval of 7.7.1 like the others, as short as the shortest but for noise, whose ends scatter two to
three times less.
"""

from __future__ import annotations

import numpy as np

from cmm_uq.base.points import Floats

_PILOT = 100_000
_MARGIN = 6.0
_FEWEST_FOR_CURVE = 500
_SPAN = 1.5
_DEGREE = 4
_POINTS = 200
_EDGE = 0.01
_LONGER = 0.01
_FEWEST_FOR_FLATNESS = 5000
_FLAT = 10.0


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
    if _all_alike(lengths, lowest):
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


def _all_alike(lengths: Floats, lowest: Floats) -> bool:
    """Whether the lengths differ by no more than the places of single draws scatter."""
    n = len(lengths)
    inner = slice(n // 20, n - n // 20)
    return n >= _FEWEST_FOR_FLATNESS and bool(np.ptp(lengths[inner]) < _FLAT * np.ptp(lowest[inner]) / np.sqrt(n))


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

    All draws are kept until there are enough to say where the tails lie; from then on those in the tails, with a margin
    of six standard deviations of that estimate.
    """

    def __init__(self, coverage: float) -> None:
        self.coverage = coverage
        self.trials = 0
        self._below, self._above = np.inf, -np.inf
        self._low: list[Floats] = []
        self._high: list[Floats] = []

    def add(self, block: Floats) -> None:
        """Take in draws in ascending order."""
        self.trials += len(block)
        self._low.append(block[: np.searchsorted(block, self._below, "right")])
        self._high.append(block[np.searchsorted(block, self._above, "left") :])
        if self.trials >= _PILOT and np.isinf(self._below):
            self._choose_thresholds()

    def _choose_thresholds(self) -> None:
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
        outer = max(1, self.trials - inner_draws(self.trials, self.coverage))
        lowest = np.sort(np.concatenate(self._low))[:outer]
        highest = np.sort(np.concatenate(self._high))[-outer:]
        return np.array([*settled_shortest_interval(lowest, highest), *symmetric_interval(lowest, highest)])
