"""When a machine is due, each date by hand; trends: the same line by another computation."""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from cmm_uq.laboratory.due.due import CalibrationRecord, DueItem, after_months, artefact_due, in_order, machine_due
from cmm_uq.laboratory.due.history import YEAR, epochs, machine_history, trend
from cmm_uq.laboratory.due.intervals import series_from
from cmm_uq.laboratory.due.rule import Rule
from cmm_uq.laboratory.records.facts import ArtefactRow, RecordedCertificate, RecordedMachine, RecordedValue
from tests.laboratory.due.histories import MACHINE, FIRST_of_made, certificate, series, value

ON = dt.date(2025, 1, 1)
BALLBAR = ArtefactRow("BB-7", "ballbar", "PTB 1", "PTB", dt.date(2024, 1, 1), dt.date(2026, 1, 1))


def due(
    *certificates: RecordedCertificate,
    rule: Mapping[str, Any] | None = None,
    machine: RecordedMachine = MACHINE,
    artefacts: Sequence[ArtefactRow] = (BALLBAR,),
    late: dt.date | None = None,
    limited: bool = True,
) -> DueItem:
    known = CalibrationRecord(machine, Rule.of(rule), certificates, limited, late)
    return machine_due(known, {one.serial: one for one in artefacts}, ON, list)


def check(day: dt.date, number: float, **further: Any) -> RecordedCertificate:
    return certificate(day, value(number), interim=True, **further)


@pytest.mark.parametrize(
    ("start", "months", "end"),
    [
        ("2024-03-01", 12, "2025-03-01"), ("2024-02-29", 12, "2025-02-28"), ("2024-01-31", 1, "2024-02-29"),
        ("9999-06-01", 12, "9999-12-31"),
        ("2024-12-15", 1, "2025-01-15"), ("2023-11-30", 3, "2024-02-29"), ("2026-03-31", 25, "2028-04-30"),
        ("2024-06-30", 24, "2026-06-30"),
    ],
)  # fmt: skip
def test_months_end_on_the_same_day_or_the_months_last(start: str, months: int, end: str) -> None:
    assert after_months(dt.date.fromisoformat(start), months).isoformat() == end


def test_without_a_rule_a_year_and_it_says_so() -> None:
    found = due(certificate(FIRST_of_made))
    assert (found.due, found.last, found.why) == (
        dt.date(2025, 3, 1),
        FIRST_of_made,
        "12 months, as its job does not say otherwise",
    )
    assert found.remarks == ()


def test_the_rule_of_the_job() -> None:
    found = due(certificate(FIRST_of_made), rule={"every_months": 6})
    assert (found.due, found.why) == (dt.date(2024, 9, 1), "fixed interval of 6 months")


def test_states_about_the_day() -> None:
    found = due(certificate(FIRST_of_made))
    week = dt.timedelta(days=7)
    assert [found.state(dt.date(2025, 3, 1) + dt.timedelta(days=i), week) for i in (-8, -7, 0, 1)] == [
        "later", "due", "due", "overdue",
    ]  # fmt: skip


def test_the_end_of_the_calendar_is_no_fault() -> None:
    last = dt.date.max
    assert due(certificate(last)).due == last
    assert due(certificate(last)).state(last, dt.timedelta(days=36_500)) == "due"


def test_a_machine_that_was_never_calibrated_has_no_date() -> None:
    found = due()
    assert (found.due, found.state(ON, dt.timedelta(0)), found.why) == (
        None,
        "unknown",
        "never calibrated up to 2025-01-01",
    )


def test_what_is_dated_later_is_said() -> None:
    assert (
        "A recording of 2031-05-06 is dated after 2025-01-01"
        in due(certificate(FIRST_of_made), late=dt.date(2031, 5, 6)).remarks[0]
    )


def test_what_is_to_be_known_is_said() -> None:
    assert "a draft that nobody has released" in due(certificate(FIRST_of_made, state="draft")).remarks[0]
    assert "has no limits" in due(certificate(FIRST_of_made), limited=False).remarks[0]


def test_a_machine_by_name_is_said_to_be_one() -> None:
    assert "no serial number" in due(certificate(FIRST_of_made), machine=replace(MACHINE, by_name=True)).remarks[0]


def test_an_adjustment_ends_the_interval_but_for_one_that_is_still_to_come() -> None:
    day = dt.date(2024, 8, 1)
    assert due(certificate(FIRST_of_made), machine=replace(MACHINE, adjusted=(day,))).due == day
    assert due(certificate(FIRST_of_made), machine=replace(MACHINE, adjusted=(FIRST_of_made,))).due == dt.date(
        2025, 3, 1
    )
    assert due(certificate(FIRST_of_made), machine=replace(MACHINE, adjusted=(dt.date(2025, 2, 1),))).due == dt.date(
        2025, 3, 1
    )


def test_a_certificate_that_does_not_conform_begins_no_interval() -> None:
    found = due(certificate(FIRST_of_made, decision="fail"))
    assert (found.due, found.why) == (FIRST_of_made, "its last certificate finds it beyond its limits")


def test_an_artefact_out_of_date_blocks() -> None:
    found = due(certificate(FIRST_of_made), artefacts=[replace(BALLBAR, due=dt.date(2024, 12, 31))])
    assert found.blocked == "its artefact BB-7 is out of date since 2024-12-31: no certificate can be made with it"
    assert due(certificate(FIRST_of_made), artefacts=[replace(BALLBAR, due=ON)]).blocked is None


def test_an_artefact_that_is_due_first_is_said() -> None:
    found = due(certificate(FIRST_of_made), artefacts=[replace(BALLBAR, due=dt.date(2025, 2, 28))])
    assert (found.blocked, found.remarks) == (None, ("Its artefact BB-7 is itself due on 2025-02-28, before that.",))


def test_a_check_out_of_control_makes_the_machine_due_at_once() -> None:
    """3.1·√0.5 from the calibration, u = √0.5."""
    day = dt.date(2024, 6, 1)
    found = due(certificate(FIRST_of_made), check(day, 1 + 3.1 * 0.5**0.5))
    assert found.due == day
    assert due(certificate(FIRST_of_made), check(day, 7.0), rule={"every_months": 1}).due == dt.date(2024, 4, 1)
    assert "quantity scale_x.ppm: 3.1 standard uncertainties" in found.why


def test_a_check_that_warns_is_to_be_repeated() -> None:
    found = due(certificate(FIRST_of_made), check(dt.date(2024, 6, 1), 1 + 2.1 * 0.5**0.5))
    assert found.due == dt.date(2025, 3, 1)
    assert found.why.endswith("repeat it")


def test_checks_in_control_lengthen_only_where_the_rule_lets_them() -> None:
    """From the check on another interval of 12 months, 365 days here, but no more than 18 months after the calibration."""
    checked = certificate(FIRST_of_made), check(dt.date(2024, 6, 1), 1.2)
    assert due(*checked, rule={"every_months": 12}).due == dt.date(2025, 3, 1)
    assert due(*checked, rule={"every_months": 12, "longest_months": 24}).due == dt.date(2025, 6, 1)
    late = certificate(FIRST_of_made), check(dt.date(2024, 12, 1), 1.2)
    assert due(*late, rule={"every_months": 12, "longest_months": 18}).due == dt.date(2025, 9, 1)


@pytest.mark.parametrize(("calibrated", "checked", "lengthens"), [
    ([value(1.0, limit=10.0)], [value(1.2, limit=10.0)], True),
    ([value(1.0, limit=10.0)], [replace(value(1.2, limit=10.0), u=5.0)], False),  # 1.2 ± 10
    ([value(1.0, limit=10.0), value(1.0, name="scale_y.ppm", limit=10.0)], [value(1.2, limit=10.0)], False),
    ([value(1.0, limit=10.0), replace(value(1.0, name="scale_y.ppm"), limit=None)], [value(1.2, limit=10.0)], True),
    ([replace(value(1.0), limit=None)], [replace(value(1.2), limit=None)], True),
    ([replace(value(1.0), limit=None)], [replace(value(1.2), limit=None, u=5.0)], False),
])  # fmt: skip
def test_a_check_lengthens_by_what_it_shows_and_not_by_what_it_cannot_see(
    calibrated: list[RecordedValue], checked: list[RecordedValue], lengthens: bool
) -> None:
    one = certificate(FIRST_of_made, *calibrated), certificate(dt.date(2024, 6, 1), *checked, interim=True)
    found = due(*one, rule={"every_months": 12, "longest_months": 24})
    assert found.due == (dt.date(2025, 6, 1) if lengthens else dt.date(2025, 3, 1))
    assert ("shows too little to lengthen it" in found.why) != lengthens


def test_a_check_without_limits_is_held_to_those_of_the_calibration() -> None:
    """9.8 ± 2 against 10, then 10.5 ± 2, of which the check states no limit."""
    day = dt.date(2024, 6, 1)
    first, then = value(9.8, limit=10.0), replace(value(10.5), limit=None)
    assert due(certificate(FIRST_of_made, first), certificate(day, then, interim=True)).due == day


def test_a_check_with_wider_limits_is_held_to_those_of_the_calibration() -> None:
    day, first = dt.date(2024, 6, 1), value(9.8, limit=10.0)
    assert due(certificate(FIRST_of_made, first), certificate(day, value(10.5, limit=10.0), interim=True)).due == day
    assert due(certificate(FIRST_of_made, first), certificate(day, value(10.5, limit=100.0), interim=True)).due == day


def test_a_check_that_nobody_released_lengthens_nothing_beside_a_released_calibration() -> None:
    rule = {"every_months": 12, "longest_months": 24}
    draft = check(dt.date(2024, 6, 1), 1.2, state="draft")
    assert due(certificate(FIRST_of_made), draft, rule=rule).due == dt.date(2025, 3, 1)
    assert due(certificate(FIRST_of_made, state="draft"), draft, rule=rule).due == dt.date(2025, 6, 1)
    assert due(certificate(FIRST_of_made), check(dt.date(2024, 6, 1), 7.0, state="draft")).due == dt.date(2024, 6, 1)


def test_a_check_of_other_values_lengthens_nothing() -> None:
    other = certificate(dt.date(2024, 6, 1), value(1.0, name="scale_y.ppm"), interim=True)
    found = due(certificate(FIRST_of_made), other, rule={"every_months": 12, "longest_months": 24})
    assert found.due == dt.date(2025, 3, 1)
    assert found.why.endswith("has no value in common with the calibration")


def test_what_a_method_came_to_is_not_lengthened() -> None:
    checked = certificate(FIRST_of_made), check(dt.date(2024, 6, 1), 1.2)
    rule = {"method": "staircase", "every_months": 12, "longest_months": 24}
    assert due(*checked, rule=rule).due == dt.date(2025, 3, 1)


def test_a_check_before_the_calibration_does_not_count() -> None:
    assert due(check(dt.date(2024, 2, 1), 7.0), certificate(FIRST_of_made)).due == dt.date(2025, 3, 1)


@pytest.mark.parametrize("method", ["A3", "S2", "staircase", "control chart"])
def test_a_method_without_a_history_says_so_and_takes_the_interval_it_begins_with(method: str) -> None:
    found = due(certificate(FIRST_of_made), rule={"method": method, "every_months": 9})
    assert found.due == dt.date(2024, 12, 1)
    assert found.why.startswith(f"9 months, as method {method} cannot say: ")


def test_a_reliability_alone_asks_for_a3() -> None:
    assert Rule.of({"reliability": 0.9}) == Rule("A3", reliability=0.9, stated=True)
    assert Rule.of({"every_months": 6}) == Rule("fixed", 6, stated=True)


def test_an_artefact_is_due_as_its_certificate_says() -> None:
    found = artefact_due(BALLBAR)
    assert (found.due, found.last, found.why) == (BALLBAR.due, BALLBAR.calibrated, "as its certificate PTB 1 says")
    assert artefact_due(replace(BALLBAR, due=None)).why == "no job says when its calibration ends"


def test_the_first_comes_first_and_what_has_no_date_last() -> None:
    first, later, never = due(certificate(FIRST_of_made)), artefact_due(BALLBAR), due()
    assert in_order([never, later, first]) == [first, later, never]


def test_by_the_drift_model_a_machine_is_due_when_its_history_says_that_its_limit_may_be_crossed() -> None:
    """The same day by both ways to it, to which an interim check after the calibration counts; a size in mm to neither."""
    numbers = ((0.0, 1.0), (1.5, 1.1), (3.2, 0.9), (3.9, 1.0))
    days = (
        FIRST_of_made - dt.timedelta(days=700),
        FIRST_of_made - dt.timedelta(days=350),
        FIRST_of_made,
        FIRST_of_made + dt.timedelta(days=120),
    )
    done = [
        certificate(
            day, value(a), value(b, name="scale_y.ppm"),
            replace(value(7.9, name="length"), unit="mm"), interim=i == 3, entry=i + 1,
        )
        for i, (day, (a, b)) in enumerate(zip(days, numbers, strict=True))
    ]  # fmt: skip
    found = due(*done, rule={"method": "drift", "reliability": 0.95})
    series = {name: series_from(done, name) for name in ("scale_x.ppm", "scale_y.ppm", "length")}
    history = machine_history(MACHINE, done, series, ON)
    crossed = {one.series.name: one.crossing.quantile(0.05) for one in history.values if one.crossing is not None}
    assert found.due == crossed["scale_x.ppm"]
    assert crossed.keys() == {"scale_x.ppm", "scale_y.ppm"}
    assert "drift model without a fleet: quantity scale_x.ppm has not crossed its limit with 95 %" in found.why
    assert found.due != due(*done[:3], rule={"method": "drift", "reliability": 0.95}).due


@pytest.mark.parametrize("interim", [False, True])
def test_by_the_drift_model_no_draft_makes_a_day_later(interim: bool) -> None:
    """One that finds it nearer to zero; released, it does, and one that finds it farther makes the day sooner."""
    days = [FIRST_of_made - dt.timedelta(days=one) for one in (700, 350, 0)]
    done = [
        certificate(day, value(x), entry=i) for i, (day, x) in enumerate(zip(days, (0.0, 1.5, 3.2), strict=True), 1)
    ]

    def with_one(number: float, after: int, state: str) -> dt.date | None:
        one = certificate(days[-1] + dt.timedelta(days=after), value(number), entry=4, state=state, interim=interim)
        return due(*done, one, rule={"method": "drift", "reliability": 0.95}).due

    alone = due(*done, rule={"method": "drift", "reliability": 0.95}).due
    assert alone is not None
    assert with_one(3.2, 120, "draft") == alone
    assert (with_one(3.2, 120, "released") or alone) > alone
    assert (with_one(6.0, 60, "draft") or alone) < alone


DAYS, VALUES = [0, 360, 740, 1100], [1.0, 1.9, 3.4, 3.8]
U, COMMON, WITH = [0.5, 0.4, 0.6, 0.5], [0.3, 0.2, 0.4, 0.3], ["A", "A", "B", "A"]


def test_the_artefacts_errors_may_be_estimated_instead() -> None:
    """The same model with the error of each artefact as an unknown of its own, known to be 0 ± 1: least squares, augmented."""
    line = trend(series(DAYS, VALUES, U, COMMON, WITH))
    assert line is not None
    own = np.sqrt(np.array(U) ** 2 - np.array(COMMON) ** 2)
    years = (np.array(DAYS) - DAYS[-1]) / YEAR
    errors = np.array(COMMON)[:, None] * (np.array(WITH)[:, None] == np.array(["A", "B"])[None, :])
    rows = np.vstack([np.column_stack([np.ones(4), years, errors]) / own[:, None], np.eye(4)[2:]])
    wanted = np.concatenate([np.array(VALUES) / own, np.zeros(2)])
    spread = np.linalg.inv(rows.T @ rows)
    solved = spread @ rows.T @ wanted
    assert (line.value, line.slope) == pytest.approx(tuple(solved[:2]), rel=1e-9)
    assert line.covariance / line.excess**2 == pytest.approx(spread[:2, :2], rel=1e-7)


def test_a_common_error_does_not_tilt_the_line() -> None:
    alone, shared = trend(series(DAYS, VALUES, 0.5)), trend(series(DAYS, VALUES, float(np.hypot(0.5, 3.0)), 3.0))
    assert alone is not None
    assert shared is not None
    assert (shared.slope, shared.u_slope) == pytest.approx((alone.slope, alone.u_slope), rel=1e-6)
    assert shared.covariance[0, 0] == pytest.approx(alone.covariance[0, 0] + alone.excess**2 * 9.0, rel=1e-6)


def test_an_adjustment_begins_a_new_line() -> None:
    jumped = series([0, 360, 370, 730], [1.0, 2.0, 0.0, 0.5], adjusted_since=[0, 0, 365, 365])
    assert [(rows.start, rows.stop) for rows in epochs(jumped)] == [(0, 2), (2, 4)]
    line = trend(jumped)
    assert line is not None
    assert (line.count, line.slope) == (2, pytest.approx(0.5 * YEAR / 360))


@pytest.mark.parametrize("days", [[0], [100, 100]])
def test_one_day_has_no_trend(days: list[int]) -> None:
    assert trend(series(days, [1.0] * len(days))) is None


def test_more_scatter_than_the_uncertainties_allow_widens_the_line() -> None:
    """χ² = Σ (residual/u)² over n − 2, by numpy's own straight line; the Birge ratio is its root."""
    values = [0.0, 5.0, -4.0, 3.0]
    line = trend(series(DAYS, values, 0.5))
    assert line is not None
    left = np.polyfit(DAYS, values, 1, full=True)[1][0]
    assert line.excess == pytest.approx(np.sqrt(left / 0.25 / 2))
    assert line.u_slope == pytest.approx(
        line.excess * 0.5 * YEAR / np.sqrt(np.sum((np.array(DAYS) - np.mean(DAYS)) ** 2))
    )


def test_values_without_an_uncertainty_have_a_line_too() -> None:
    line = trend(series([0, 365, 730], [1.0, 2.0, 3.0], 0.0))
    assert line is not None
    assert line.slope == pytest.approx(YEAR / 365)
