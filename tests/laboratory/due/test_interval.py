"""Intervals by the methods from certificates: which of them count, and the figures by hand or by the method's own function."""

from __future__ import annotations

import datetime as dt

import numpy as np
import pytest

from cmm_uq.laboratory.due.due import interval_by
from cmm_uq.laboratory.due.intervals import LastValue, fitted_drift, interval_of_reliability, interval_test
from cmm_uq.laboratory.due.rule import DAYS_A_MONTH, CompletedInterval, Rule, ended_intervals
from cmm_uq.laboratory.records.facts import RecordedCertificate
from tests.laboratory.due.histories import FIRST_of_made, certificate, value


def yearly(*numbers: float, adjusted: int | None = None) -> list[RecordedCertificate]:
    found = []
    for i, number in enumerate(numbers):
        since = None if adjusted is None or i < adjusted else FIRST_of_made + dt.timedelta(days=365 * adjusted - 3)
        found.append(
            certificate(FIRST_of_made + dt.timedelta(days=365 * i), value(number), entry=i + 1, adjusted_since=since)
        )
    return found


def test_each_calibration_ends_an_interval_with_what_it_found() -> None:
    assert ended_intervals(yearly(0.0, 4.0, -8.8)) == [CompletedInterval(365, 0.5), CompletedInterval(365, 1.1)]
    assert [one.in_tolerance for one in ended_intervals(yearly(0.0, 8.0, -8.8))] == [True, False]


def test_after_an_adjustment_nobody_knows_what_would_have_been_found() -> None:
    assert ended_intervals(yearly(0.0, 4.0, 0.0, 6.0, adjusted=2)) == [
        CompletedInterval(365, 0.5),
        CompletedInterval(365, 0.75),
    ]


def test_as_found_ends_an_interval_and_as_left_begins_the_next() -> None:
    day = FIRST_of_made + dt.timedelta(days=365)
    both = [
        certificate(FIRST_of_made, value(0.0)), certificate(day, value(9.0), entry=2),
        certificate(day, value(0.0), entry=3, adjusted_since=day),
        certificate(day + dt.timedelta(days=365), value(1.0), entry=4, adjusted_since=day),
    ]  # fmt: skip
    assert ended_intervals(both) == [CompletedInterval(365, 1.125), CompletedInterval(365, 0.125)]


def test_without_limits_the_decision_counts_and_without_either_nothing() -> None:
    decided = [certificate(FIRST_of_made + dt.timedelta(days=100 * i), value(1.0, limit=None), decision=word)
               for i, word in enumerate(["pass", "pass", "fail", "undecided"])]  # fmt: skip
    assert [one.in_tolerance for one in ended_intervals(decided)] == [True, False]


def test_interim_checks_end_no_interval() -> None:
    done = yearly(0.0, 4.0)
    between = certificate(FIRST_of_made + dt.timedelta(days=100), value(7.0), interim=True)
    assert ended_intervals([done[0], between, done[1]]) == [CompletedInterval(365, 0.5)]


def test_a3_takes_intervals_like_the_assigned_one() -> None:
    """Eight weeks about 365.2 days: 309.2 to 421.2."""
    like = [CompletedInterval(310, 0.1)] * 6 + [CompletedInterval(421, 2.0)] * 2
    unlike = [CompletedInterval(309, 2.0), CompletedInterval(422, 2.0), CompletedInterval(30, 2.0)]
    found = interval_by(Rule.of({"method": "A3", "reliability": 0.95}), yearly(0.0, 1.0), lambda: like + unlike)
    wanted = interval_test(6, 8, 12 * DAYS_A_MONTH, 0.95, Rule("A3").changing)
    assert found.days == wanted.recommended
    assert "6 of 8 intervals of about 12 months ended within the limits, 95 % wanted" in found.why


def test_the_staircase_climbs_over_its_own_history() -> None:
    found = interval_by(Rule.of({"method": "staircase", "reliability": 0.8}), yearly(0.0, 1.0, 7.0, 1.0), list)
    assert found.days == pytest.approx(12 * DAYS_A_MONTH * 1.1 * 1.1)
    assert found.why == "staircase from 12 months: 2 up, 1 kept, 0 down"


def test_the_control_chart_takes_the_first_value_to_leave_its_limit() -> None:
    rows = [(0.0, 0.0), (1.0, 0.3), (2.4, 0.5), (3.5, 0.9)]
    done = [
        certificate(
            FIRST_of_made + dt.timedelta(days=360 * i + 5 * i * i), value(a), value(b, name="scale_y.ppm"), entry=i + 1
        )
        for i, (a, b) in enumerate(rows)
    ]
    days = np.diff([one.day.toordinal() for one in done]).astype(float)
    drift = fitted_drift(days, np.array([1.0, 1.4, 1.1]))
    wanted = interval_of_reliability(drift, LastValue(3.5, 0.5), 0.9, -8, 8)
    found = interval_by(Rule.of({"method": "control chart", "reliability": 0.9}), done, list)
    assert found.days == pytest.approx(wanted)
    assert "quantity scale_x.ppm" in found.why


def test_the_control_chart_has_no_change_across_an_adjustment() -> None:
    found = interval_by(Rule.of({"method": "control chart"}), yearly(0.0, 5.0, 0.0, adjusted=2), list)
    assert (found.months, found.days) == (12, None)
    assert "three calibrations without an adjustment" in found.why


def test_s2_asks_all_machines_of_the_model() -> None:
    days = [60] * 20 + [150] * 20 + [300] * 20 + [500] * 20
    failed = [1] * 1 + [0] * 19 + [1] * 2 + [0] * 18 + [1] * 5 + [0] * 15 + [1] * 8 + [0] * 12
    pool = [CompletedInterval(day, 2.0 if bad else 0.5) for day, bad in zip(days, failed, strict=True)]
    found = interval_by(Rule.of({"method": "S2", "reliability": 0.9}), yearly(0.0), lambda: pool)
    assert found.days is not None
    assert 100 < found.days < 200  # 90 % lies between 95 % at 60 and 150 days of the observed numbers, and 75 % at 300
    assert "of 80 intervals" in found.why


@pytest.mark.parametrize(("longest", "wanted"), [(None, 60), (24, 24)])
def test_no_interval_is_longer_than_its_longest(longest: int | None, wanted: int) -> None:
    rule = Rule.of({"method": "control chart", "longest_months": longest})
    steady = [certificate(FIRST_of_made + dt.timedelta(days=360 * i + i), value(0.0), entry=i + 1) for i in range(4)]
    assert interval_by(rule, steady, list).days == pytest.approx(wanted * DAYS_A_MONTH)


def test_the_drift_model_gives_a_day() -> None:
    found = interval_by(Rule.of({"method": "drift", "reliability": 0.9}), yearly(0.0, 2.0, 4.1, 6.0), list)
    assert found.days is not None
    assert 14 <= found.days < 2 * 365
    assert "drift model without a fleet: quantity scale_x.ppm" in found.why
