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
from scipy.interpolate import CubicSpline
from scipy.special import ndtr

from cmm_uq.points import Floats

NODES = 7
"""Deviations at which measurements are drawn; squares of their quantiles are nearly quadratic between them."""

_QUANTILES = ndtr(np.linspace(-3.1, 3.1, 63))
_FINE = 600
_ENDS = 6
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


def nodes_of(found: float, perfect: Floats, one: float) -> Floats:
    """(m,) multiples λ of deviations, between which everything lies that may have been measured as ``found``.

    A zone is a seminorm of the deviations: errors change it by no more than their own zone.

    Parameters
    ----------
    found : the width that was measured.
    perfect : (n,) what a perfect part would be measured as, g(0).
    one : θ(1).
    """
    beyond = float(np.abs(np.quantile(perfect, _QUANTILES[[0, -1]])).max())
    return np.linspace(max(0.0, found - beyond), found + beyond, NODES) / one


def mixed_in(shape: float, errors: float) -> float:
    """How much of a typical draw of errors a trial part has: all where the shape has no zone, none where its own is wider.

    Added with the sign that gives the wider zone, the zone is no narrower than the shape's or than this much of the errors',
    so that λ stays within some times of what errors make.

    Parameters
    ----------
    shape, errors : widths of their zones.
    """
    return max(0.0, 1 - shape / errors) if errors > 0 else 0.0


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
    curves = CubicSpline(true, _square(np.quantile(measured, _QUANTILES, axis=1).T))
    sizes = np.linspace(true[0], true[-1], _FINE)
    rising = np.maximum.accumulate(curves(sizes), axis=0)
    solved = np.array([np.interp(found**2, curve, sizes) for curve in rising.T])
    lacking = _square(np.quantile(perfect, _QUANTILES)) - found**2
    solved = np.where(lacking > 0, -np.sqrt(np.maximum(lacking, 0.0)), solved)
    return Inverse(np.quantile(again, _QUANTILES), np.minimum.accumulate(solved))


def _square(values: Floats) -> Floats:
    return np.asarray(values * np.abs(values))
