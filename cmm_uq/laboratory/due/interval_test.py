"""Method A3 of NCSLI RP-1: whether the reliability observed at the end of an interval is the one that is wanted.

The numbers in and out of tolerance at the end of like intervals are binomial. The interval is changed where its reliability
differs from the target with enough confidence, and by no more than a factor either way.
"""

from __future__ import annotations

from dataclasses import dataclass

from scipy import special

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import say
from cmm_uq.laboratory.due.changing import USUAL, Changing


@dataclass(frozen=True)
class IntervalTest:
    """What the test of an interval found.

    Parameters
    ----------
    in_tolerance, tested : calibrations found in tolerance at the end of the interval, and all of them.
    observed : their ratio; ``low`` and ``high`` bound the true one (Clopper–Pearson) at the confidence asked for.
    rejection : confidence with which the interval is rejected, 0 to 1.
    calculated : interval that the method computes, days.
    recommended : the same where the rejection is confident enough, within its bounds; else the interval as it is.
    """

    in_tolerance: int
    tested: int
    observed: float
    low: float
    high: float
    rejection: float
    calculated: float
    recommended: float


def interval_test(
    in_tolerance: int, tested: int, interval: float, target: float, changing: Changing = USUAL
) -> IntervalTest:
    """Test an interval against a reliability target.

    Parameters
    ----------
    in_tolerance, tested : calibrations found in tolerance, of how many, all after about the same interval.
    interval : that interval, days.
    target : reliability wanted at its end, between 0 and 1.

    Raises
    ------
    CmmUqError : nothing was tested.

    Notes
    -----
    With the observed reliability R₀ of n calibrations, of which x were in tolerance, and the target R, the rejection
    confidence is that of the two-sided binomial test, Q = 1 − 2 P(X ≤ x) below the target and 1 − 2 P(X ≥ x) above it, and
    1 − P(X = x) where all or none were in tolerance. The new interval is I·10^((R₀ − R)·Q) below the target and
    I·10^((R₀ − R)/(1 − Q)) above it.
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
