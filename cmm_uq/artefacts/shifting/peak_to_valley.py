"""Peak to valley of a curve that is known from draws, with an interval that can hold a straight curve too.

The largest difference of a drawn curve is never zero and grows with every uncertainty (JCGM 101:2008, 9.4 shows the
like), so an interval of such draws lies above the truth, and never holds a straight curve. Here the differences c_i − c_j
between all pairs of positions get one factor k, from the draws, that holds them all at once. Where every c_i − c_j lies within
d_ij ± k·u_ij, the largest lies between the largest d_ij − k·u_ij, no less than 0, and the largest d_ij + k·u_ij. This is done
twice: with 99.5 % it says which pairs can be the largest at all, and with 95.5 % of these alone (Bonferroni: together 95 %).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cmm_uq.base.points import Floats
from cmm_uq.base.units import MICROMETRE, unit
from cmm_uq.maths.uncertainty.quantity import Quantity

_DRAWS = 4000
"""For the factor: its quantile is then known to a percent."""

_CAN_BE, _HOLDS = 0.995, 0.955

_POSITIONS = 200
"""More are thinned out: a smooth curve has no more to say."""


def peak_to_valley(curve: Floats) -> Quantity:
    """Largest difference of a curve between two positions, µm.

    Parameters
    ----------
    curve : (N, m) draws, mm.

    Returns
    -------
    that of the mean curve, the standard deviation of that of the draws, and the interval of all pairs.
    """
    low, high = _ends(curve)
    sizes, value = np.ptp(curve, axis=1) / MICROMETRE, float(np.ptp(curve.mean(axis=0))) / MICROMETRE
    return Quantity(value, float(sizes.std(ddof=1)), (low / MICROMETRE, high / MICROMETRE), unit("µm"))


def _ends(curve: Floats) -> tuple[float, float]:
    """Ends of the interval, mm."""
    mean, covariance = curve.mean(axis=0), np.atleast_2d(np.cov(curve, rowvar=False))
    spread = np.linspace(0, len(mean) - 1, min(_POSITIONS, len(mean))).astype(int)
    chosen = np.union1d(spread, [mean.argmin(), mean.argmax()])
    mean, variance = mean[chosen], np.diag(covariance)[chosen]
    square = variance[:, None] + variance - 2 * covariance[np.ix_(chosen, chosen)]
    u = np.sqrt(np.where(square > 1e-12 * variance.max(initial=0.0), square, 0.0))
    draws = curve[np.linspace(0, len(curve) - 1, min(_DRAWS, len(curve))).astype(int)][:, chosen] - mean
    difference = mean[:, None] - mean
    within = _factor(draws, u, u > 0, _CAN_BE) * u
    among = difference + within >= np.max(difference - within)
    within = _factor(draws, u, among & (u > 0), _HOLDS) * u
    return float(np.max((difference - within)[among]).clip(0.0)), float(np.max((difference + within)[among]))


def _factor(draws: Floats, u: Floats, among: NDArray[np.bool_], level: float) -> float:
    """The k for which draws (N, m) about their mean keep the differences of some pairs (m, m) within k·u that often."""
    away = np.zeros(len(draws))
    for i in np.flatnonzero(among.any(axis=1)):
        away = np.maximum(away, np.max(np.abs(draws[:, [i]] - draws[:, among[i]]) / u[i, among[i]], axis=1))
    return float(np.quantile(away, level))
