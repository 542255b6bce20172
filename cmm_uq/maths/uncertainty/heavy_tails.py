"""How heavy the tails of draws are, and how much of a standard deviation lies beyond the largest of them.

The scatter between blocks says how well the standard deviation of draws is known only while their fourth moment exists. With
heavier tails (t of few degrees of freedom, a ratio whose denominator comes near zero) every block lacks the same rare draws,
the blocks agree, and u is wrong or does not exist. So a generalised Pareto distribution is fitted to the largest draws of each
side, by the weighted means of Zhang & Stephens (Technometrics 51 (2009) 316), as many of them as Vehtari et al. take for
importance weights (J. Mach. Learn. Res. 25 (2024) 72). Its shape k is one over the tail's index: from k = ½ on there is no
variance. A tail that begins beyond all draws cannot be seen.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cmm_uq.base.points import Floats

NO_VARIANCE = 0.5
"""Shape from which on the second moment does not exist."""

_CANDIDATES = 30
_PRIOR_WEIGHT, _PRIOR_SHAPE = 10, 0.5
_ERRORS = 2.0
"""Standard errors of the shape by which it is taken for heavier than it was found, when what was not drawn is judged."""


@dataclass(frozen=True)
class Tail:
    """One tail of the draws of an output.

    Parameters
    ----------
    shape : k of the generalised Pareto distribution.
    unseen : what the draws beyond the largest one of so many would add to the mean square about the mean; infinite where there
        is none.
    """

    shape: float
    unseen: float


def draws_in_tail(trials: int) -> int:
    """How many of the largest draws are its tail."""
    return int(min(0.2 * trials, 3 * np.sqrt(trials)))


def tail_of(largest: Floats, mean: float, trials: int) -> Tail:
    """The upper tail of draws.

    Parameters
    ----------
    largest : the largest draws, ascending; the first is the threshold of the others.
    mean : of all draws.
    trials : number of all draws.
    """
    excess = largest[1:] - largest[0]
    if len(excess) < 5 or not excess[-1] > 0 or not np.isfinite(excess[-1]):
        return Tail(-np.inf, 0.0)
    shape, scale = pareto(excess)
    heavier = shape + _ERRORS * (1 + max(shape, 0.0)) / np.sqrt(len(excess))
    return Tail(shape, _unseen(float(largest[0]) - mean, heavier, scale, len(excess), trials))


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


def _unseen(threshold: float, shape: float, scale: float, count: int, trials: int) -> float:
    """∫ (y − mean)² over what is exceeded once in all trials; ``threshold`` is from the mean."""
    if shape >= NO_VARIANCE:
        return float("inf")
    further = scale * (np.log(count) if abs(shape) < 1e-9 else (count**shape - 1) / shape)
    start, spread = threshold + further, scale + shape * further
    beyond = start**2 + 2 * start * spread / (1 - shape) + 2 * spread**2 / ((1 - shape) * (1 - 2 * shape))
    return float(beyond) / trials
