"""What several models give, averaged over them by their probabilities: one quantity, or draws of several together.

The distribution is the mixture of theirs (Bayesian model averaging: Hoeting et al. 1999, *Statistical Science* 14, 382); its
variance is the mean of the variances and the variance of the means. Each is taken as normal on either side of its value,
as wide as its own interval there.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import special

from cmm_uq.base.points import Floats
from cmm_uq.maths.uncertainty.quantity import Quantity

_TAIL = 0.025
_HALVINGS = 80
_NO_WIDTH = 1e-200


def averaged(quantities: Sequence[Quantity], weights: Sequence[float]) -> Quantity:
    """The quantity over all models.

    Parameters
    ----------
    quantities : as each model gives it, in one unit.
    weights : probability of each, up to a factor.
    """
    p = np.array(weights) / np.sum(weights)
    value, u, low, high = (
        np.array(each) for each in zip(*((q.value, q.u, *q.interval95) for q in quantities), strict=True)
    )
    mean = float(p @ value)
    spread = float(np.sqrt(p @ (u**2 + (value - mean) ** 2)))
    ends = (_quantile(_TAIL, p, value, low, high), _quantile(1 - _TAIL, p, value, low, high))
    return Quantity(mean, spread, ends, quantities[0].unit)


def mixed(draws: Sequence[Floats], weights: Sequence[float], random: np.random.Generator) -> Floats:
    """Draws (N, k) of the mixture: row i is row i of one of the models, each as often as its probability has it.

    Parameters
    ----------
    draws : (N, k) under each model, of the same quantities in the same order; row after row independent.
    weights : probability of each, up to a factor.
    random : which row is of which model.
    """
    count = len(draws[0])
    wanted = count * np.array(weights) / np.sum(weights)
    times = np.floor(wanted).astype(np.int64)
    times[np.argsort(times - wanted, kind="stable")[: count - times.sum()]] += 1
    model = random.permutation(np.repeat(np.arange(len(draws)), times))
    return np.asarray(np.stack(draws)[model, np.arange(count)])


def _quantile(tail: float, p: Floats, value: Floats, low: Floats, high: Floats) -> float:
    """Where the mixture's distribution function reaches a probability, by halving between the outermost ends."""
    own = low if tail < 0.5 else high
    below, above = float(own.min()), float(own.max())
    factor = -float(special.ndtri(_TAIL))
    for _ in range(_HALVINGS):
        middle = 0.5 * (below + above)
        width = np.where(middle < value, value - low, high - value) / factor
        reached = float(p @ special.ndtr((middle - value) / np.maximum(width, _NO_WIDTH)))
        below, above = (middle, above) if reached < tail else (below, middle)
    return 0.5 * (below + above)
