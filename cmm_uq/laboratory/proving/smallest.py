"""From which strength on an effect is found in nine of ten recordings.

A hidden effect of strength s is found with the probability 1/(1 + exp(−b·(s − m))). Both numbers are averaged over, on
a grid, with flat priors for m and ln b: that has an answer where every effect is found, or none, and an interval that
says how little was measured. Effects are taken together, for their strength is what the noise lets anyone see of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cmm_uq.base.points import Floats

OFTEN = 0.9
LARGEST = 30.0
"""Strength up to which the answer is looked for: twice the strongest that is drawn."""

FEWEST = 8
"""Hidden effects from which on there is an answer."""

_MIDDLE = np.linspace(0.0, LARGEST, 241)
_SLOPE = np.geomspace(0.15, 6.0, 40)
_CURVE = np.linspace(3.0, 15.0, 49)


@dataclass(frozen=True, eq=False)
class Found:
    """How finding grows with strength.

    Parameters
    ----------
    often, interval : strength found in nine of ten, median and 95 % interval; beyond :data:`LARGEST` it is infinite.
    strengths, curve, low, high : (p,) strengths, and the probability to be found there, median and 95 % interval.
    """

    often: float
    interval: tuple[float, float]
    strengths: Floats
    curve: Floats
    low: Floats
    high: Floats


def found_by_strength(strengths: Sequence[float], found: Sequence[bool]) -> Found | None:
    """How it grows with strength, from what was hidden and what was found; ``None`` of too few."""
    if len(strengths) < FEWEST:
        return None
    m, b = (grid.ravel() for grid in np.meshgrid(_MIDDLE, _SLOPE, indexing="ij"))
    z = b[:, None] * (np.asarray(strengths, dtype=np.float64) - m[:, None])
    log = np.where(np.asarray(found, dtype=bool), -np.logaddexp(0, -z), -np.logaddexp(0, z)).sum(axis=1)
    weight = np.exp(log - log.max())
    weight /= weight.sum()
    often = m + np.log(OFTEN / (1 - OFTEN)) / b
    low, middle, high = (float(np.inf) if q > LARGEST else q for q in _quantiles(often, weight))
    curve = 1 / (1 + np.exp(-b[:, None] * (_CURVE - m[:, None])))
    ends = np.array([_quantiles(column, weight) for column in curve.T])
    return Found(middle, (low, high), _CURVE, ends[:, 1], ends[:, 0], ends[:, 2])


def _quantiles(values: Floats, weight: Floats) -> tuple[float, float, float]:
    """Of 2.5 %, one half and 97.5 % of the weight."""
    order = np.argsort(values)
    total = np.cumsum(weight[order])
    low, middle, high = values[order][np.minimum(np.searchsorted(total, (0.025, 0.5, 0.975)), len(values) - 1)]
    return float(low), float(middle), float(high)
