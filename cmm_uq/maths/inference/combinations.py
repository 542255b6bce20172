"""What noise leaves uncertain of a weighted sum of observations, its components being of uncertain size."""

from __future__ import annotations

import numpy as np
from scipy import special

from cmm_uq.base.points import Floats
from cmm_uq.maths.inference.noise import Components, Sizes
from cmm_uq.maths.inference.root import root

_COVERAGE = 0.975


def uncertainty_of_sum(
    components: Components, sizes: Sizes, weights: Floats, beside: float = 0.0
) -> tuple[float, float]:
    """Standard uncertainty, and half the 95 % interval, of a sum of observations.

    Given the sizes the sum is normal; over their draws it is a mixture of normal distributions about one value.

    Parameters
    ----------
    components : of the noise of the observations.
    sizes : in each of w draws.
    weights : (m,) of the observations.
    beside : standard uncertainty of a normal contribution that is no noise, in the unit of the sum.
    """
    variances, _ = components.variances(sizes)
    squares = components.shares.T @ np.asarray(components.turn @ weights) ** 2
    variance = variances @ squares + components.slow_along(weights, sizes) + beside**2
    u, sd = float(np.sqrt(variance.mean())), np.sqrt(variance)
    if not u:
        return 0.0, 0.0
    sd = np.maximum(sd, 1e-12 * u)
    half = root(lambda t: float(special.ndtr(t * u / sd).mean()) - _COVERAGE, 0.0, float(sd.max() / u) * 2.0, 1e-9)
    return u, half * u
