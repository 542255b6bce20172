"""Intervals from what calibrations found: by the numbers in tolerance (method A3, staircase), and by how values drift.

A3 (NCSLI RP-1): the numbers in and out of tolerance at the end of like intervals are binomial. The interval is changed where
its reliability differs from the target with enough confidence, and by no more than a factor either way.

Staircase (ILAC-G24 / OIML D 10:2022, method 1): a calibration that finds the machine well within its limits (to 80 %)
lengthens the next interval by a step up; one that finds it beyond a limit shortens it by a step down; between, it stays.
The steps follow from the reliability R that is wanted: where R of the calibrations go up and 1 − R down, the logarithm of
the interval does not move, R·ln(1 + a) + (1 − R)·ln(1 − b) = 0. A step up is a tenth, or less where a step down would
then be more than an interval may shrink by at once.

Values (method V1 of NCSLI RP-1; control chart, ILAC-G24 / OIML D 10:2022, method 2): what a value changed by over each
interval is fitted by a polynomial through zero. The interval ends where the probability that the value still lies within its
limits falls to the target. Source: suncal 1.7.1 and its tests, which quote NASA-HDBK-8739.19-5, chapter 7.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scipy import optimize, special

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import say
from cmm_uq.base.points import Floats
from cmm_uq.laboratory.due.rule import USUAL, IntervalBounds


@dataclass(frozen=True)
class IntervalTest:
    """What the test of an interval found; ``low`` and ``high`` bound its true reliability (Clopper–Pearson)."""

    in_tolerance: int  # and tested: calibrations found in tolerance at the end of the interval, and all of them
    tested: int
    observed: float
    low: float
    high: float
    rejection: float  # confidence with which the interval is rejected, 0 to 1
    calculated: float  # interval that the method computes, days
    recommended: float


def interval_test(
    in_tolerance: int, tested: int, interval: float, target: float, changing: IntervalBounds = USUAL
) -> IntervalTest:
    """Test an interval, days, against the reliability wanted at its end.

    With the observed reliability R₀ of n calibrations, of which x were in tolerance, and the target R, the rejection
    confidence is that of the two-sided binomial test, Q = 1 − 2 P(X ≤ x) below the target and 1 − 2 P(X ≥ x) above
    it, and 1 − P(X = x) where all or none were in tolerance. The new interval is I·10^((R₀ − R)·Q) below the target
    and I·10^((R₀ − R)/(1 − Q)) above it.
    """
    if not 0 <= in_tolerance <= tested or tested == 0:
        raise CmmUqError(say("a test of an interval needs at least one calibration at its end"))
    observed = in_tolerance / tested
    rejection = _rejection(in_tolerance, tested, target)
    if observed > target:
        power = (observed - target) / (1 - rejection) if rejection < 1 else float("inf")
        ratio = min(10 ** min(power, 300.0), changing.factor)
    else:
        ratio = max(10 ** ((observed - target) * rejection), 1 / changing.factor)
    calculated = interval * ratio
    changed = rejection > changing.confidence and abs(calculated - interval) >= changing.least_days
    low, high = reliability_range(in_tolerance, tested, changing.confidence)
    return IntervalTest(
        in_tolerance, tested, observed, low, high, rejection, calculated,
        changing.bounded(calculated) if changed else interval,
    )  # fmt: skip


def _rejection(passed: int, tested: int, target: float) -> float:
    """Confidence with which the target is not the true reliability."""
    if passed == tested:
        return float(1 - target**tested)
    if passed == 0:
        return float(1 - (1 - target) ** tested)
    tail = (
        special.bdtr(passed, tested, target)
        if passed / tested <= target
        else 1 - special.bdtr(passed - 1, tested, target)
    )
    return max(float(1 - 2 * tail), 0.0)


def reliability_range(passed: int, tested: int, confidence: float) -> tuple[float, float]:
    """Bounds of the true reliability (Clopper–Pearson), one-sided where all or none were in tolerance."""
    if passed == 0:
        return 0.0, float(1 - (1 - confidence) ** (1 / tested))
    if passed == tested:
        return float((1 - confidence) ** (1 / tested)), 1.0
    low = special.betaincinv(passed, tested - passed + 1, (1 - confidence) / 2)
    high = special.betaincinv(passed + 1, tested - passed, (1 + confidence) / 2)
    return float(low), float(high)


WELL_WITHIN = 0.8
"""Part of the limit up to which the interval is lengthened; remembered of ILAC-G24 / OIML D 10, not checked against it."""

STEP_UP = 0.1  # part by which an interval is lengthened at most


@dataclass(frozen=True)
class Staircase:
    interval: float  # days
    up: int  # and kept, down: calibrations that lengthened it, left it, and shortened it
    kept: int
    down: int


def steps(reliability: float, factor: float = USUAL.factor) -> tuple[float, float]:
    """Factors of an interval after a calibration well within the limits, and after one beyond them, in balance."""
    odds = reliability / (1 - reliability)
    up = min(1 + STEP_UP, factor ** (1 / odds))
    return float(up), float(up**-odds)


def staircase(
    used: Iterable[float], interval: float, reliability: float, changing: IntervalBounds = USUAL
) -> Staircase:
    """Climb from a first interval, days, by the parts of the limits that calibrations found used up."""
    up_by, down_by = steps(reliability, changing.factor)
    counts = [0, 0, 0]
    for part in used:
        step = 0 if part <= WELL_WITHIN else 1 if part <= 1 else 2
        counts[step] += 1
        interval = changing.bounded(interval * (up_by, 1.0, down_by)[step])
    return Staircase(interval, *counts)


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
