"""Tails of an interval of what is never negative, such that it holds as often however small that is.

Equal tails of 2.5 % hold what is zero in 97.5 %: there is nothing below to fail. The unified interval of Feldman and Cousins
(Phys. Rev. D 57 (1998) 3873, section IV.B) begins at zero up to where the lower tail alone would be 5 %, and then takes so
much of both tails that 95 % of a normal quantity's measurements hold, whatever its mean. For a measurement below zero, better
than its errors, it would shrink to nothing. There the upper end leaves 5 % of what is possible (the ratio of both tails: Read,
J. Phys. G 28 (2002) 2693), which is where the unified one ends for a measurement of zero.
"""

from __future__ import annotations

from functools import lru_cache

from scipy.special import ndtr, ndtri

from cmm_uq.maths.inference.root import root


def tails(negative: float, coverage: float) -> tuple[float, float]:
    """Shares of all draws below the lower end and above the upper end; a lower end among the negative ones is zero.

    Parameters
    ----------
    negative : share of the draws that are negative: of a normal quantity, measured x standard deviations from zero, Φ(−x).
    coverage : of the interval, less than one.
    """
    missed = 1 - coverage
    upper = min(0.5 * missed, missed * (1 - negative))
    if negative >= missed:
        return missed, upper
    return _lower(round(-float(ndtri(max(negative, 1e-12))), 6), missed), upper


@lru_cache(maxsize=4096)
def _lower(at: float, missed: float) -> float:
    """Tail below the mean of which a measurement ``at`` (in standard deviations) is the largest that is accepted."""
    if at >= -2 * float(ndtri(0.5 * missed)):
        return 0.5 * missed

    def refused(mean: float) -> float:
        """Share of measurements that are less likely than this one, beside the best mean of each."""
        return float(ndtr(mean - at) + ndtr(_least(mean, at) - mean)) - missed

    return float(ndtr(root(refused, 1e-9, at - 1e-9, 2e-12) - at))


def _least(mean: float, most: float) -> float:
    """The smallest measurement that is accepted beside the largest: of the same ratio to the likelihood of the best mean."""
    symmetric = 2 * mean - most
    return symmetric if symmetric >= 0 else (mean**2 - (most - mean) ** 2) / (2 * mean)
