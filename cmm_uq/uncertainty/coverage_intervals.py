"""Coverage intervals from draws of an output (JCGM 101:2008 7.7), exact for any number of draws in little memory.

Of M draws in ascending order and q = pM, an interval of coverage p runs from draw r to draw r + q. Only the M − q lowest
and the M − q highest draws can be its ends, so only these are kept.
"""

from __future__ import annotations

import numpy as np

from cmm_uq.points import Floats

_PILOT = 100_000
_MARGIN = 6.0


def inner_draws(trials: int, coverage: float) -> int:
    """Q of JCGM 101 7.7.2: pM, rounded when it is no integer."""
    return int(coverage * trials + 0.5)


def shortest_interval(lowest: Floats, highest: Floats) -> tuple[float, float]:
    """Shortest coverage interval from the M − q lowest and the M − q highest draws, both ascending (7.7.4)."""
    first = int(np.argmin(highest - lowest))
    return float(lowest[first]), float(highest[first])


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

    def intervals(self) -> Floats:
        """Ends (4,) of the shortest and the symmetric interval of all draws so far."""
        outer = max(1, self.trials - inner_draws(self.trials, self.coverage))
        lowest = np.sort(np.concatenate(self._low))[:outer]
        highest = np.sort(np.concatenate(self._high))[-outer:]
        return np.array([*shortest_interval(lowest, highest), *symmetric_interval(lowest, highest)])
