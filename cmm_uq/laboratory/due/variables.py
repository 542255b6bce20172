"""The interval from the values themselves (method V1 of NCSLI RP-1; control chart, ILAC-G24 / OIML D 10:2022, method 2).

What a value changed by over each interval is fitted by a polynomial through zero. The interval ends where the probability that
the value still lies within its limits falls to the target, or where its uncertainty grows to a target.
Source: suncal 1.7.1 and its tests, which quote NASA-HDBK-8739.19-5, chapter 7.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import optimize, special

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import say
from cmm_uq.base.points import Floats

_FAR, _STEPS = 100.0, 4000  # times, in units of the longest observed interval, within which an interval is sought


@dataclass(frozen=True)
class DriftPolynomial:
    """A polynomial through zero, fitted by least squares."""

    coefficients: Floats  # (m,) of t, t², …
    covariance: Floats  # (m, m) of them, from the scatter about the curve
    scatter: float  # standard deviation about the curve
    freedoms: int  # degrees of freedom of it
    longest: float  # interval that was observed, days

    def change(self, days: Floats) -> Floats:
        """Expected after times (n,)."""
        return np.asarray(_powers(days, len(self.coefficients)) @ self.coefficients)

    def u_change(self, days: Floats) -> Floats:
        """Standard uncertainty of the same (n,), from the fit."""
        powers = _powers(days, len(self.coefficients))
        return np.asarray(np.sqrt(np.einsum("ij,jk,ik->i", powers, self.covariance, powers)))


@dataclass(frozen=True)
class LastValue:
    """A value when it was last calibrated: the value, its standard uncertainty and that one's degrees of freedom."""

    value: float
    u: float
    freedoms: float = np.inf


def fitted_drift(days: Floats, changes: Floats, order: int = 1) -> DriftPolynomial:
    """Fit what a value changed by over each interval, days, both (n,)."""
    days, changes = np.asarray(days, dtype=np.float64), np.asarray(changes, dtype=np.float64)
    if len(days) <= order or not (days > 0).all():
        raise CmmUqError(
            say("a drift of order {order} needs more than {order} intervals, none of them of no length", order=order)
        )
    longest = float(days.max())
    powers = _powers(days / longest, order)  # of the order of one, whatever the unit
    inverse = np.linalg.pinv(powers.T @ powers)
    coefficients = inverse @ powers.T @ changes
    freedoms = len(days) - order
    variance = float(((changes - powers @ coefficients) ** 2).sum() / freedoms)
    unit = longest ** -np.arange(1, order + 1, dtype=np.float64)
    return DriftPolynomial(
        coefficients * unit, variance * inverse * np.outer(unit, unit), float(np.sqrt(variance)), freedoms, longest
    )


def reliability_after(
    drift: DriftPolynomial, start: LastValue, days: Floats, low: float | None, high: float | None
) -> Floats:
    """Probability (n,) of lying within the limits after times (n,): Student's t, Welch–Satterthwaite degrees of freedom."""
    grown = drift.u_change(days)
    u = np.sqrt(grown**2 + start.u**2)
    with np.errstate(divide="ignore", invalid="ignore"):
        freedoms = u**4 / (grown**4 / drift.freedoms + start.u**4 / start.freedoms)
        freedoms = np.where(np.isfinite(freedoms), np.minimum(freedoms, 1e9), 1e9)
        middle = start.value + drift.change(days)
        above = 1.0 if high is None else _t(freedoms, high - middle, u)
        below = 0.0 if low is None else _t(freedoms, low - middle, u)
    return np.asarray(above - below)


def interval_of_reliability(
    drift: DriftPolynomial, start: LastValue, target: float, low: float | None, high: float | None
) -> float:
    """Days until the probability of lying within the limits falls to the target; infinite where it hardly does."""

    def excess(days: Floats) -> Floats:
        return reliability_after(drift, start, days, low, high) - target

    times = np.concatenate([[0.0], np.geomspace(1e-4, _FAR, _STEPS) * drift.longest])
    short = excess(times) < 0
    i = int(np.argmax(short))
    if not i:
        return 0.0 if short[0] else float("inf")
    return float(optimize.brentq(lambda t: float(excess(np.array([t]))[0]), times[i - 1], times[i]))


def _powers(days: Floats, order: int) -> Floats:
    return np.asarray(np.asarray(days, dtype=np.float64)[:, None] ** np.arange(1, order + 1))


def _t(freedoms: Floats, distance: Floats, u: Floats) -> Floats:
    """Student's distribution function of ``distance/u``; a step where nothing is uncertain."""
    return np.asarray(np.where(u > 0, special.stdtr(freedoms, distance / np.where(u > 0, u, 1.0)), distance >= 0))
