"""The rule of interim checks."""

from __future__ import annotations

import datetime as dt

import pytest
from scipy.stats import multivariate_normal, norm

from cmm_uq.laboratory.due.checks import check_standings, limit_for
from cmm_uq.laboratory.records.facts import RecordedCertificate
from tests.laboratory.due.histories import FIRST_of_made, certificate, value

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
