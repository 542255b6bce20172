"""Intervals from whether calibrations found the machine in tolerance: method A3 of NCSLI RP-1, and the staircase.

A3: the numbers in and out of tolerance at the end of like intervals are binomial. The interval is changed where its
reliability differs from the target with enough confidence, and by no more than a factor either way.

Staircase (ILAC-G24 / OIML D 10:2022, method 1): a calibration that finds the machine well within its limits (to 80 %)
lengthens the next interval by a step up; one that finds it beyond a limit shortens it by a step down; between, it stays.
The steps follow from the reliability R that is wanted: where R of the calibrations go up and 1 − R down, the logarithm of
the interval does not move, R·ln(1 + a) + (1 − R)·ln(1 − b) = 0. A step up is a tenth, or less where a step down would
then be more than an interval may shrink by at once.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from scipy import special

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import say
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
