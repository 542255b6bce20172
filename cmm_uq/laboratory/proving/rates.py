"""Rates that were counted, with their exact intervals, and from which strength on an effect is found.

A hidden effect of strength s is found with the probability 1/(1 + exp(−b·(s − m))). Both numbers are averaged over, on
a grid, with flat priors for m and ln b: that has an answer where every effect is found, or none, and an interval that
says how little was measured. Effects are taken together, for their strength is what the noise lets anyone see of them.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import special

from cmm_uq.base.points import Floats

LEVEL = 0.95


@dataclass(frozen=True)
class Rate:
    """So many of so many, with the interval of Clopper and Pearson (Biometrika 26 (1934), 404–413)."""

    count: int  # count, of: how many of how many
    of: int
    # where those come in clusters, such as the intervals of one recording, (count, of) of each: what one cluster says
    # is then worth less than as many that know nothing of each other
    clusters: tuple[tuple[int, int], ...] = ()

    @classmethod
    def pooled(cls, clusters: Iterable[tuple[int, int]]) -> Rate:
        kept = tuple((k, n) for k, n in clusters if n)
        return cls(sum(k for k, _ in kept), sum(n for _, n in kept), kept)

    @property
    def value(self) -> float | None:
        return self.count / self.of if self.of else None

    @cached_property
    def interval(self) -> tuple[float, float]:
        """Lower and upper end, 95 %, each missed with half of the rest; all there is where nothing was counted."""
        n = self._effective
        return clopper_pearson(n * self.count / self.of if self.of else 0.0, n)

    @property
    def _effective(self) -> float:
        if not self.clusters:
            return float(self.of)
        each = np.array(self.clusters, dtype=np.float64)
        p = each[:, 0].sum() / each[:, 1].sum()
        clusters = len(each)
        if clusters < 2 or p in (0.0, 1.0):
            return float(self.of)
        off = each[:, 0] - p * each[:, 1]
        # variance of a ratio of sums over clusters (Cochran, Sampling Techniques, 1977, 6.3)
        variance = clusters / (clusters - 1) * float(off @ off) / each[:, 1].sum() ** 2
        return float(min(self.of, p * (1 - p) / variance)) if variance > 0 else float(self.of)


def clopper_pearson(count: float, of: float, level: float = LEVEL) -> tuple[float, float]:
    tail = 0.5 * (1 - level)
    low = float(special.betaincinv(count, of - count + 1, tail)) if count > 0 else 0.0
    high = float(special.betaincinv(count + 1, of - count, 1 - tail)) if count < of else 1.0
    return low, high


def cases_to_decide(limit: float, level: float = LEVEL) -> int:
    """Fewest cases after which a rate of zero is known to lie below a limit."""
    return int(np.ceil(np.log(0.5 * (1 - level)) / np.log1p(-limit)))


@dataclass(frozen=True)
class Tenth:
    """Probabilities said between two tenths: how many, their mean, and how many of these were right."""

    low: float
    high: float
    said: float
    right: Rate

    @property
    def agrees(self) -> bool:
        """Whether the mean that was said lies in the interval of what was right."""
        low, high = self.right.interval
        return low <= self.said <= high


def tenths(said: Sequence[tuple[float, bool]]) -> tuple[Tenth, ...]:
    """Probabilities that were said, and whether it was so, by tenths; without those in which nothing was said."""
    found = []
    for i in range(10):
        own = [(p, right) for p, right in said if min(int(10 * p), 9) == i]
        if own:
            right = Rate(sum(right for _, right in own), len(own))
            found.append(Tenth(i / 10, (i + 1) / 10, float(np.mean([p for p, _ in own])), right))
    return tuple(found)


OFTEN = 0.9
LARGEST = 30.0  # strength up to which the answer is looked for: twice the strongest that is drawn
FEWEST = 8  # hidden effects from which on there is an answer
_MIDDLE, _SLOPE, _CURVE = np.linspace(0.0, LARGEST, 241), np.geomspace(0.15, 6.0, 40), np.linspace(3.0, 15.0, 49)


@dataclass(frozen=True, eq=False)
class DetectionCurve:
    """How finding grows with strength."""

    # often, interval: strength found in nine of ten, median and 95 % interval; beyond LARGEST it is infinite
    often: float
    interval: tuple[float, float]
    # strengths, curve, low, high: (p,) strengths, and the probability to be found there, median and 95 % interval
    strengths: Floats
    curve: Floats
    low: Floats
    high: Floats


def detection_curve(strengths: Sequence[float], detected: Sequence[bool]) -> DetectionCurve | None:
    """How it grows with strength, from what was hidden and what was found; ``None`` of too few."""
    if len(strengths) < FEWEST:
        return None
    m, b = (grid.ravel() for grid in np.meshgrid(_MIDDLE, _SLOPE, indexing="ij"))
    z = b[:, None] * (np.asarray(strengths, dtype=np.float64) - m[:, None])
    log = np.where(np.asarray(detected, dtype=bool), -np.logaddexp(0, -z), -np.logaddexp(0, z)).sum(axis=1)
    weight = np.exp(log - log.max())
    weight /= weight.sum()
    often = m + np.log(OFTEN / (1 - OFTEN)) / b
    low, middle, high = (float(np.inf) if q > LARGEST else q for q in _quantiles(often, weight))
    curve = 1 / (1 + np.exp(-b[:, None] * (_CURVE - m[:, None])))
    ends = np.array([_quantiles(column, weight) for column in curve.T])
    return DetectionCurve(middle, (low, high), _CURVE, ends[:, 1], ends[:, 0], ends[:, 2])


def _quantiles(values: Floats, weight: Floats) -> tuple[float, float, float]:
    """Of 2.5 %, one half and 97.5 % of the weight."""
    order = np.argsort(values)
    total = np.cumsum(weight[order])
    low, middle, high = values[order][np.minimum(np.searchsorted(total, (0.025, 0.5, 0.975)), len(values) - 1)]
    return float(low), float(middle), float(high)
