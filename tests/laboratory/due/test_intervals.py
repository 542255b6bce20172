"""Intervals from what calibrations found, against printed figures and suncal itself.

Method A3: the NCSLI tutorial on intervals (2019), as suncal's tests and manual print it. Values: NASA-HDBK-8739.19-5, tables
7-2 to 7-7, and suncal 1.7.1 on the same data.
"""

from __future__ import annotations

import itertools
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.stats import beta, binomtest, norm, t

from cmm_uq.base.errors import CmmUqError
from cmm_uq.laboratory.due.crossing import crossing
from cmm_uq.laboratory.due.intervals import (
    DriftPolynomial,
    LastValue,
    drift_interval,
    fitted_drift,
    interval_of_reliability,
    interval_test,
    reliability_range,
    series_from,
    staircase,
    steps,
)
from cmm_uq.laboratory.due.rule import IntervalBounds
from tests.laboratory.records.histories import made

PRINTED = [
    ((15, 20, 365, 0.95), 0.5, (231, 0.9949, 0.6516, 0.8286)),
    ((14, 20, 365, 0.95), 0.5, (205, 0.9993, 0.6000, 0.7843)),
    ((16, 20, 730, 0.95), 0.5, (523, 0.9682, 0.7041, 0.8716)),
    ((42, 50, 365, 0.90), 0.3, (329, 0.7557, 0.8067, 0.8664)),
]


@pytest.mark.parametrize(("asked", "confidence", "printed"), PRINTED)
def test_the_printed_figures(
    asked: tuple[int, int, float, float], confidence: float, printed: tuple[float, ...]
) -> None:
    found = interval_test(*asked, IntervalBounds(confidence=confidence))
    assert (
        round(found.recommended),
        *(round(x, 4) for x in (found.rejection, found.low, found.high)),
    ) == pytest.approx(printed, abs=5e-5)


@pytest.mark.parametrize(("passed", "tested"), [(15, 20), (3, 20), (0, 5), (20, 20), (42, 50), (8, 10)])
def test_suncal_finds_the_same_below_the_target_and_where_all_or_none_passed(passed: int, tested: int) -> None:
    suncal = pytest.importorskip("suncal.intervals")
    theirs = suncal.a3_testinterval(suncal.A3Params(intol=passed, n=tested, I0=365, target=0.95))
    found = interval_test(passed, tested, 365, 0.95)
    assert found.recommended == pytest.approx(theirs.interval, rel=1e-12)
    assert found.rejection == pytest.approx(theirs.rejection, rel=1e-12)


def test_the_rejection_is_that_of_the_two_sided_binomial_test() -> None:
    """Where both tails are as they are here, scipy's exact test of one tail doubled says the same."""
    below = binomtest(15, 20, 0.95, alternative="less").pvalue
    above = binomtest(49, 50, 0.9, alternative="greater").pvalue
    assert interval_test(15, 20, 365, 0.95).rejection == pytest.approx(1 - 2 * below)
    assert interval_test(49, 50, 365, 0.9).rejection == pytest.approx(1 - 2 * above)


def test_too_good_a_reliability_lengthens_the_interval_although_not_all_passed() -> None:
    """49 of 50 against 90 %: a chance of 3 % where the reliability is 90 %; suncal 1.7.1 leaves such an interval alone."""
    found = interval_test(49, 50, 365, 0.9)
    assert found.recommended == pytest.approx(2 * 365)
    assert found.rejection == pytest.approx(0.932, abs=5e-4)


def test_an_interval_that_is_not_surely_wrong_stays() -> None:
    assert interval_test(19, 20, 365, 0.95).recommended == 365


def test_small_changes_are_not_made_and_bounds_are_kept() -> None:
    assert interval_test(84, 100, 30, 0.9).recommended == 30  # 27.0 days: 3 days less
    assert interval_test(0, 5, 20, 0.9).recommended == 14


@settings(deadline=None)
@given(st.integers(1, 60).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n))), st.floats(0.5, 0.99))
def test_the_range_is_clopper_pearsons(counts: tuple[int, int], confidence: float) -> None:
    passed, tested = counts
    low, high = reliability_range(passed, tested, confidence)
    assert low <= passed / tested <= high
    if 0 < passed < tested:
        exact = binomtest(passed, tested).proportion_ci(confidence, method="exact")
        assert (low, high) == pytest.approx((exact.low, exact.high), rel=1e-6)
    if passed == tested:
        assert beta.cdf(low, tested, 1) == pytest.approx(1 - confidence)


@settings(deadline=None)
@given(st.integers(1, 40), st.floats(0.6, 0.99))
def test_more_in_tolerance_never_shortens(tested: int, target: float) -> None:
    days = [interval_test(passed, tested, 365, target).calculated for passed in range(tested + 1)]
    assert all(a <= b * (1 + 1e-12) for a, b in itertools.pairwise(days))


def test_nothing_tested_is_refused() -> None:
    with pytest.raises(CmmUqError, match="at least one calibration"):
        interval_test(0, 0, 365, 0.9)


WIDE = IntervalBounds(factor=1e9, shortest_days=1e-9, longest_days=1e12)


def test_up_kept_down_by_hand() -> None:
    """At a reliability of one half a step down undoes a step up: 100 · 1.1 · 1.1 · 1 / 1.1."""
    found = staircase([0.3, 0.8, 0.81, 1.01], 100.0, 0.5, WIDE)
    assert (found.interval, found.up, found.kept, found.down) == (pytest.approx(110), 2, 1, 1)


@settings(deadline=None)
@given(st.floats(0.5, 0.99), st.floats(1.2, 1e6))
def test_at_the_wanted_reliability_the_interval_stands_still(reliability: float, factor: float) -> None:
    up, down = steps(reliability, factor)
    assert reliability * math.log(up) + (1 - reliability) * math.log(down) == pytest.approx(0, abs=1e-12)
    assert 1 < up <= 1.1 + 1e-12
    assert 1 / factor - 1e-12 <= down < 1


def test_a_high_reliability_takes_smaller_steps_up() -> None:
    """At 95 % nineteen steps up must be undone by one to the half: 2^(1/19)."""
    assert steps(0.95) == pytest.approx((2 ** (1 / 19), 0.5))
    assert steps(0.8) == pytest.approx((1.1, 1.1**-4))


def test_one_failure_at_most_halves_and_bounds_are_kept() -> None:
    assert staircase([2.0], 365, 0.95).interval == pytest.approx(182.5)
    assert staircase([2.0] * 20, 365, 0.95).interval == 14
    assert staircase([0.1] * 50, 365, 0.95).interval == 1826


DAYS = np.array([70.0, 86, 104, 135, 167, 173])
CHANGES = np.array([0.1, 0.11, 0.251, 0.299, 0.403, 0.615])
START = LastValue(10.03, 0.28)


def test_the_fit_is_that_of_table_7_3() -> None:
    fit = fitted_drift(DAYS, CHANGES, 2)
    assert fit.coefficients == pytest.approx([0.00015741, 0.00001674], rel=1e-3)
    assert fit.covariance.ravel() == pytest.approx([1.01e-6, -6.607e-9, -6.607e-9, 4.549e-11], rel=1e-3)
    assert (round(fit.scatter, 4), fit.freedoms) == (0.0708, 4)


def test_the_predicted_values_are_those_of_tables_7_4_and_7_7() -> None:
    assert 10.03 + fitted_drift(DAYS, CHANGES, 2).change(np.array([140.1, 327.15])) == pytest.approx(
        [10.38, 11.87], abs=5e-3
    )


def test_with_the_scatter_in_it_the_uncertainty_reaches_its_target_as_in_table_7_7() -> None:
    """The handbook adds the scatter about the curve to the uncertainty; suncal 1.7.1 does not (328.93 days)."""
    fit = fitted_drift(DAYS, CHANGES, 2)
    single = LastValue(10.03, float(np.hypot(0.28, fit.scatter)))
    before, after = np.hypot(single.u, fit.u_change(np.array([327.145, 327.155])))
    assert before < 0.5 < after


def test_the_handbooks_one_sided_interval_has_four_degrees_of_freedom() -> None:
    """Table 7-5, 171.75 days: value + t(90 %, 4)·u meets the limit, u with the scatter; here u has those of all its parts."""
    fit = fitted_drift(DAYS, CHANGES, 2)
    then = np.array([171.75])
    u = np.sqrt(0.28**2 + fit.scatter**2 + fit.u_change(then) ** 2)
    assert (10.03 + fit.change(then) + t.ppf(0.9, 4) * u)[0] == pytest.approx(11, abs=5e-4)


def test_suncals_intervals() -> None:
    """Figures that suncal 1.7.1 gives: 184.9343 and 328.9317 days."""
    fit = fitted_drift(DAYS, CHANGES, 2)
    assert interval_of_reliability(fit, START, 0.9, 9, 11) == pytest.approx(184.934255, abs=1e-5)
    assert interval_of_reliability(fit, START, 0.9, None, 11) == pytest.approx(184.934257, abs=1e-5)
    before, after = np.hypot(START.u, fit.u_change(np.array([328.93169, 328.93171])))
    assert before < 0.5 < after


def test_suncal_itself() -> None:
    suncal = pytest.importorskip("suncal.intervals")
    theirs = suncal.VariablesReliabilityTarget(DAYS, CHANGES, u0=0.28, y0=10.03).calculate(9, 11, 0.9, order=1)
    assert interval_of_reliability(fitted_drift(DAYS, CHANGES), START, 0.9, 9, 11) == pytest.approx(
        theirs.interval, rel=1e-8
    )


def test_a_value_beyond_what_is_wanted_from_the_beginning_has_no_interval() -> None:
    """Handbook, table 7-6, prints 153.04 and suncal 136.03: where the probability rises again through the target."""
    fit = fitted_drift(DAYS, CHANGES, 2)
    assert interval_of_reliability(fit, LastValue(9.03, 0.28), 0.9, 9, None) == 0


def test_without_a_drift_there_is_no_end() -> None:
    assert interval_of_reliability(fitted_drift(DAYS, 0 * DAYS), START, 0.9, 9, 11) == np.inf


def test_a_known_drift_by_hand() -> None:
    """0.001 a day, u = 0.1, limit 1 one-sided at 97.5 %: (1 − 1.96·0.1)/0.001 days."""
    known = DriftPolynomial(np.array([1e-3]), np.zeros((1, 1)), 0.0, 100, 1000.0)
    assert interval_of_reliability(known, LastValue(0, 0.1), 0.975, None, 1) == pytest.approx(
        1000 - 100 * norm.ppf(0.975), rel=1e-6
    )


def test_one_interval_is_too_few() -> None:
    with pytest.raises(CmmUqError, match="more than 1 intervals"):
        fitted_drift(DAYS[:1], CHANGES[:1])


def test_the_drift_s_interval_is_that_of_the_value_that_crosses_first(tmp_path: Path) -> None:
    """Values that are looked at only as far as another crosses say the same as all of them looked at to the horizon."""
    with made(tmp_path / "records.db", 6, 4) as records:
        for machine in records.machines():
            certificates = records.certificates(machine.serial)
            last = certificates[-1]
            days = [
                (float("inf") if at is None else (at - last.day).days, one.quantity, False)
                for one in (series_from(certificates, value.name) for value in last.values)
                for at in (crossing(one, one.limit or 0.0).quantile(0.05),)
            ]
            assert drift_interval(certificates, 0.95, {}) == min(days)
