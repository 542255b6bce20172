"""The standard normal distribution from the standard library: ``due`` and ``history`` need not wait for scipy."""

from __future__ import annotations

import math
from statistics import NormalDist


def two_sided(z: float) -> float:
    """Probability of a deviate at least as far from zero as ``z``."""
    return math.erfc(abs(z) / math.sqrt(2))


def two_sided_limit(probability: float) -> float:
    """The deviate that is exceeded on either side with a probability."""
    return -NormalDist().inv_cdf(probability / 2)
