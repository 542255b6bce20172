"""The rule of interim checks, and what a value changed by: the artefact's part against a second computation and by hand."""

from __future__ import annotations

import datetime as dt
import math

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.stats import multivariate_normal, norm

from cmm_uq.laboratory.due.rule import ComparedValue, ValueChange, change, check_standings, each_of, limit_for
from cmm_uq.laboratory.records.facts import RecordedCertificate
from tests.laboratory.due.histories import FIRST_of_made, certificate, value

PART = st.floats(0, 0.999)
SIZE = st.floats(1e-3, 1e3)


def test_the_same_artefact_cancels_by_hand() -> None:
    """0.25 + 0.25 − 2·0.16 = 0.18."""
    found = change(ComparedValue(1.0, 0.5, 0.4, "BB-7"), ComparedValue(2.5, 0.5, 0.4, "BB-7"))
    assert (found.value, found.u) == (1.5, pytest.approx(math.sqrt(0.18)))


def test_another_artefact_does_not_nor_does_an_unknown_one() -> None:
    for one, other in (("BB-7", "BB-8"), ("", "")):
        found = change(ComparedValue(1.0, 0.5, 0.4, one), ComparedValue(2.5, 0.5, 0.4, other))
        assert found.u == pytest.approx(math.sqrt(0.5))


@settings(deadline=None)
@given(SIZE, SIZE, PART, PART)
def test_it_is_the_difference_of_two_sums_with_a_common_term(u1: float, u2: float, p1: float, p2: float) -> None:
    """x = r₁ + p₁u₁·a and y = r₂ + p₂u₂·a: the variance of y − x as a quadratic form of independent r₁, r₂, a."""
    own = u1 * math.sqrt(1 - p1**2), u2 * math.sqrt(1 - p2**2)
    weights = np.array([-own[0], own[1], p2 * u2 - p1 * u1])  # of r₁, r₂, a
    found = change(ComparedValue(0, u1, p1 * u1, "A"), ComparedValue(0, u2, p2 * u2, "A"))
    assert found.u == pytest.approx(float(np.linalg.norm(weights)), rel=1e-6, abs=1e-9 * max(u1, u2))


def test_an_uncertainty_that_is_all_the_artefacts_does_not_vanish() -> None:
    """As a test uncertainty: how the machine repeats is not stated, and a change by a thousandth means nothing."""
    found = change(ComparedValue(60.0, 7.0, 7.0, "BB-7"), ComparedValue(60.001, 7.0, 7.0, "BB-7"))
    assert found.u == pytest.approx(7 * math.sqrt(2))
    assert not found.significant(1)


def test_a_chance_is_two_sided() -> None:
    assert ValueChange(-1.96, 1.0).chance == pytest.approx(0.05, abs=1e-4)
    assert ValueChange(0.0, 0.0).chance == 1
    assert ValueChange(1e-9, 0.0).chance == 0


@pytest.mark.parametrize("count", [1, 2, 13, 200])
def test_of_many_changes_none_is_significant_with_a_probability_of_95_percent(count: int) -> None:
    assert (1 - each_of(count, 0.05)) ** count == pytest.approx(0.95)


def test_what_is_significant_alone_need_not_be_among_thirteen() -> None:
    found = ValueChange(2.5, 1.0)
    assert 2 * norm.sf(2.5) == pytest.approx(found.chance)
    assert found.significant(1)
    assert not found.significant(13)


CALIBRATION = certificate(FIRST_of_made, value(1.0, u=0.5, u_artefact=0.4))
U = 0.18**0.5
"""Of a difference from it: 0.25 + 0.25 − 2·0.4·0.4, with the same artefact."""


def check(month: int, ratio: float, **further: object) -> RecordedCertificate:
    day = FIRST_of_made + dt.timedelta(days=30 * month)
    return certificate(day, value(1.0 + ratio * U, u=0.5, u_artefact=0.4), interim=True, **further)


@pytest.mark.parametrize(
    ("ratios", "standings"),
    [
        ([1.9, -1.9, 1.9], ["in control"] * 3),
        ([2.1], ["warning"]),
        ([2.1, 1.0, 2.1], ["warning", "in control", "warning"]),
        ([2.1, -2.1], ["warning", "warning"]),
        ([2.1, 2.1], ["warning", "action"]),
        ([-3.1], ["action"]),
        ([2.9], ["warning"]),
    ],
)
def test_warning_and_action_of_one_value(ratios: list[float], standings: list[str]) -> None:
    checks = [check(i + 1, ratio) for i, ratio in enumerate(ratios)]
    found = check_standings(CALIBRATION, checks)
    assert [one.standing for one in found] == standings
    assert [one.ratio for one in found] == pytest.approx(ratios)


def test_a_check_that_is_reported_again_is_no_second_one() -> None:
    once = check(1, 2.1)
    assert [one.standing for one in check_standings(CALIBRATION, [once, once])] == ["warning", "warning"]
    assert [one.standing for one in check_standings(CALIBRATION, [once, once, check(2, 2.1)])][-1] == "action"


def test_with_another_artefact_the_whole_uncertainty_counts() -> None:
    """The same difference is 3.1·√0.18/√0.5 = 1.86 standard uncertainties."""
    assert [one.standing for one in check_standings(CALIBRATION, [check(1, 3.1, artefact="BB-8")])] == ["in control"]


def test_beyond_a_limit_of_tolerance_is_action_however_uncertain() -> None:
    wide = certificate(FIRST_of_made, value(7.5, u=5.0))
    beyond = certificate(FIRST_of_made + dt.timedelta(days=30), value(8.1, u=5.0), interim=True)
    assert check_standings(wide, [beyond])[0].standing == "action"


@pytest.mark.parametrize(("count", "single"), [(1, 2.0), (1, 3.0), (7, 3.0), (21, 2.0)])
def test_more_values_raise_no_more_false_alarms(count: int, single: float) -> None:
    """All within their limits as often as one value is within the limit of one, were they independent."""
    one = norm.cdf(single) - norm.cdf(-single)
    each = norm.cdf(limit_for(count, single)) - norm.cdf(-limit_for(count, single))
    assert each**count == pytest.approx(one)


@pytest.mark.parametrize(("count", "percent"), [(1, 0.81), (7, 0.39)])
def test_how_often_two_checks_warn_on_one_side_by_chance(count: int, percent: float) -> None:
    """docs/records/due.md: a correlation of ½ where calibration and checks are alike; the values independent of each other."""
    limit = limit_for(count, 2.0)
    both = multivariate_normal([0, 0], [[1, 0.5], [0.5, 1]]).cdf([-limit, -limit])
    assert 100 * (1 - (1 - 2 * both) ** count) == pytest.approx(percent, abs=0.005)


def test_what_the_calibration_does_not_state_is_not_compared() -> None:
    other = certificate(FIRST_of_made + dt.timedelta(days=30), value(100.0, name="new", limit=None), interim=True)
    found = check_standings(CALIBRATION, [other])[0]
    assert (found.worst, found.standing) == ("", "nothing compared")
