"""The true width of a zone from its measured one: the measurement turned round, by the distributions that it would have.

A part that deviates λ times as the measured one has a zone θ(λ) and would be measured as g(λ), with errors that are drawn.
Both grow with λ. What was measured, f, then says of the true zone (a confidence distribution: Schweder and Hjort, Scand. J.
Stat. 29 (2002) 309; Cox, Ann. Math. Stat. 29 (1958) 357)

    P(θ ≤ θ(λ)) = P(g(λ) ≥ f),

whose quantiles are limits that hold as often as they say, however large the zone truly is. Draws with which even a perfect
part would have been measured wider, g(0) > f, leave nothing for a zone: they are marked by a negative width.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from cmm_uq.base.points import Floats, Ints

NODES = 11
"""True widths at which measurements are drawn, closer together near the least one, where fewest draws are possible; squares of
their quantiles are nearly quadratic between them."""

_NEAR = 8
"""Of the trial parts, one in so many stands for each width: few enough to be as wide, enough for every direction of errors."""

_QUANTILES = ndtr(np.linspace(-3.1, 3.1, 249))
_FINE = 600
_ENDS = 24
"""Quantiles at each end by which the line is laid that goes on beyond it."""


@dataclass(frozen=True, eq=False)
class Inverse:
    """A decreasing map from what is measured of the part as it was measured, with errors once more, to true widths.

    Parameters
    ----------
    measured, true : (k,) mm or rad, along which it is linear, and beyond.
    """

    measured: Floats
    true: Floats

    def __call__(self, measured: Floats) -> Floats:
        """True widths of measured ones, negative where these leave none."""
        found = np.interp(measured, self.measured, self.true)
        for end, inner, beyond in (
            (0, _ENDS, measured < self.measured[0]),
            (-1, -1 - _ENDS, measured > self.measured[-1]),
        ):
            run = self.measured[end] - self.measured[inner]
            slope = (self.true[end] - self.true[inner]) / run if run else 0.0
            found = np.where(beyond, self.true[end] + slope * (measured - self.measured[end]), found)
        return np.asarray(found)


def nodes_of(found: float, perfect: Floats) -> Floats:
    """(m,) true widths between which everything lies that may have been measured as ``found``.

    A zone is a seminorm of the deviations: errors change it by no more than their own zone.

    Parameters
    ----------
    found : the width that was measured.
    perfect : (n,) what a perfect part would be measured as, g(0).
    """
    beyond = float(np.abs(np.quantile(perfect, _QUANTILES[[0, -1]])).max())
    least = max(0.0, found - beyond)
    return least + (found + beyond - least) * np.linspace(0, 1, NODES) ** 2


def alike(widths: Floats, width: float) -> Ints:
    """(n,) which of n trial parts stands for one of this width with each of n draws of errors: the next wider ones, in turn.

    They are made less of, and so stay parts; only the widest are made more of.

    Parameters
    ----------
    widths : (n,) of trial parts' zones.
    """
    order = np.argsort(widths)
    some = max(1, len(widths) // _NEAR)
    first = min(int(np.searchsorted(widths[order], width)), len(widths) - some)
    return np.resize(order[first : first + some], len(widths))


def inverse(found: float, again: Floats, perfect: Floats, true: Floats, measured: Floats) -> Inverse:
    """The map by which errors of a measurement become draws of what is true.

    Parameters
    ----------
    found : the width that was measured.
    again : (n,) what the part as measured would be measured as, with n draws of errors.
    perfect : (n,) the same of a perfect part.
    true : (m,) θ of :func:`nodes_of`.
    measured : (m, n) the same of these.
    """
    from scipy.interpolate import CubicSpline  # takes longer to import than parts without a zone have left to do

    curves = CubicSpline(true, _square(np.quantile(measured, _QUANTILES, axis=1).T))
    sizes = np.linspace(true[0], true[-1], _FINE)
    rising = np.maximum.accumulate(curves(sizes), axis=0)
    solved = _reaching(found**2, sizes, rising)
    lacking = _square(np.quantile(perfect, _QUANTILES)) - found**2
    solved = np.where(lacking > 0, -np.sqrt(np.maximum(lacking, 0.0)), solved)
    return Inverse(np.quantile(again, _QUANTILES), np.minimum.accumulate(solved))


def _reaching(value: float, at: Floats, rising: Floats) -> Floats:
    """(k,) where curves (m, k) over ``at`` (m,) reach a value; the first or last place of one that is above or below it."""
    left = np.clip(np.count_nonzero(rising <= value, axis=0) - 1, 0, len(at) - 2)
    low, high = (np.take_along_axis(rising, (left + i)[None], axis=0)[0] for i in (0, 1))
    share = np.clip((value - low) / np.where(high > low, high - low, 1.0), 0.0, 1.0)
    return np.asarray(at[left] + np.where(high <= value, 1.0, share) * (at[left + 1] - at[left]))


def _square(values: Floats) -> Floats:
    return np.asarray(values * np.abs(values))
