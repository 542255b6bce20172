"""The day of crossing against the inverse Gaussian distribution, and against paths walked day by day."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.special import ndtr

from cmm_uq.base.errors import CmmUqError
from cmm_uq.laboratory.due.crossing import DAYS, PATHS, Crossing, crossing, crossings
from cmm_uq.laboratory.due.drift import HORIZON, YEAR, history, side_by_side
from cmm_uq.laboratory.due.drift_filter import filtered
from tests.laboratory.due.histories import ALL, FIRST, machine, one_node, over_tales

EXACT = 1e-4
"""u of a certificate, sd of a rate: as good as nothing beside the walk."""


@pytest.mark.parametrize(("rate", "walk"), [(1.0, 0.5), (0.3, 1.5), (-0.5, 1.0), (0.0, 2.0)])
def test_from_a_known_state_the_day_is_that_of_a_wiener_process_with_drift(rate: float, walk: float) -> None:
    """Karatzas and Shreve, equation 3.5.12: Φ((bt − a)/(σ√t)) + exp(2ab/σ²)·Φ((−a − bt)/(σ√t)) at distance a."""
    prior = one_node(rate=rate, rate_sd=EXACT, walk=walk, first_sd=1e5, steps_per_year=1e-12)
    found = crossing(machine([0], [997.0], EXACT), 1000.0, prior)  # the other limit is out of reach
    t, a = found.days[1:] / YEAR, 3.0
    s = walk * np.sqrt(t)
    exact = ndtr((rate * t - a) / s) + np.exp(2 * a * rate / walk**2) * ndtr((-a - rate * t) / s)
    assert np.abs(found.probability[1:] - exact).max() < 3 * 0.5 / np.sqrt(PATHS)  # three standard errors


@pytest.mark.long
def test_between_two_limits_with_steps_and_an_uncertain_state_it_is_that_of_paths_walked_day_by_day() -> None:
    of, prior = machine([0, 1, 2], [0.0, 1.2, 1.9], 0.6, 0.3), one_node(rate=0.5, rate_sd=0.8)
    found = crossing(of, 5.0, prior)
    arrays = side_by_side([of])
    mean, covariance = over_tales(filtered(arrays, prior, kept=500))
    random, n = np.random.default_rng(7), 20_000
    level, rate = random.multivariate_normal(mean[:2, 0, 0], covariance[:2, :2, 0, 0], n).T
    inside, parts = np.abs(level) <= 5.0, {}
    for d in range(1, int(6 * YEAR)):
        level = level + rate / YEAR + 0.7 / np.sqrt(YEAR) * random.standard_normal(n)
        steps = random.random(n) < 0.2 / YEAR
        level[steps] += 2.5 * random.standard_normal(int(steps.sum()))
        inside &= np.abs(level) <= 5.0
        parts[d] = 1 - inside.mean()
    for d in (100, 400, 900, 1500, 2100):
        by = found.by(replace_day(found, d))
        assert by == pytest.approx(parts[d], abs=0.025)  # the walk's own 0.004, and limits watched by the day


def test_with_a_season_and_settling_too_and_where_the_season_is_above_the_limit_between_two_days_of_the_grid() -> None:
    """One node, and a coarse grid whose gaps are of half a year and more from the third year on."""
    of = machine([0, 0.4, 1, 1.6, 2], [0.0, 1.8, 1.2, 2.2, 2.3], 0.4, 0.2)
    prior = one_node(rate=0.5, rate_sd=0.3, walk=0.4, steps_per_year=0.05, **ALL)
    arrays = side_by_side([of])
    state = filtered(arrays, prior, kept=500)
    found = crossings(arrays, prior, state, 5.0).one(0)
    mean, covariance = over_tales(state)
    random, n = np.random.default_rng(7), 20_000
    level, rate, settle, cosine, sine = random.multivariate_normal(mean[:5, 0, 0], covariance[:5, :5, 0, 0], n).T
    inside, parts = np.abs(level) <= 5.0, {}
    for d in range(1, int(6 * YEAR)):
        t, before = 2 + d / YEAR, 2 + (d - 1) / YEAR
        level = level + rate * (1 + 0.3 * (t + before) / 2) / YEAR + 0.4 / np.sqrt(YEAR) * random.standard_normal(n)
        level += settle * (np.exp(-before / 0.8) - np.exp(-t / 0.8))
        year, year_before = (2 * np.pi * (FIRST / YEAR + when) for when in (t, before))
        level += cosine * (np.cos(year) - np.cos(year_before)) + sine * (np.sin(year) - np.sin(year_before))
        steps = random.random(n) < 0.05 / YEAR
        level[steps] += 2.5 * random.standard_normal(int(steps.sum()))
        inside &= np.abs(level) <= 5.0
        parts[d] = 1 - inside.mean()
    for d in (60, 200, 400, 900, 1500, 2100):
        assert found.by(replace_day(found, d)) == pytest.approx(parts[d], abs=0.025), d


def test_a_calibration_always_in_the_same_month_leaves_the_season_to_the_prior() -> None:
    state = filtered(side_by_side([machine([0, 1, 2, 3], [0.0, 0.3, 0.2, 0.6], 0.1)]), one_node(**ALL))
    mean, covariance = over_tales(state)
    assert mean[3:5, 0, 0] == pytest.approx(0.0, abs=1e-9)
    assert covariance[[3, 4], [3, 4], 0, 0] == pytest.approx(ALL["season_sd"] ** 2)


def replace_day(found: Crossing, days: int):  # type: ignore[no-untyped-def]
    return type(found.last).fromordinal(found.last.toordinal() + days)


def test_a_machine_that_hardly_moves_crosses_never_and_one_beyond_the_limit_has_already() -> None:
    still = one_node(rate_sd=EXACT, walk=EXACT, steps_per_year=1e-12, first_sd=100.0)
    inside, beyond = (crossing(machine([0], [value], 0.1), 5.0, still) for value in (1.0, -9.0))
    assert (inside.already, inside.quantile(0.5), inside.interval()) == (0.0, None, (None, None))
    assert beyond.already == 1.0
    assert beyond.quantile(0.05) == beyond.quantile(0.95) == beyond.last


def test_what_falls_crosses_the_lower_limit() -> None:
    falling = one_node(rate=-2.0, rate_sd=EXACT, walk=0.01, steps_per_year=1e-12)
    of = machine([0], [0.0], 0.1)
    two = crossing(of, 3.0, falling)
    median = two.quantile(0.5)
    assert median is not None
    assert (median - two.last).days == pytest.approx(1.5 * YEAR, rel=0.02)


def test_a_line_crosses_when_it_must_whatever_the_unit() -> None:
    """4 − 1 at one a year: three years; in thousandths too."""
    for unit in (1.0, 1000.0):
        sure = one_node(rate=unit, rate_sd=EXACT * unit, walk=0.01 * unit, steps_per_year=1e-12, first_sd=9 * unit)
        found = crossing(machine([0, 1], [0.0, unit], 0.01 * unit), 4.0 * unit, sure)
        median = found.quantile(0.5)
        assert median is not None
        assert (median - found.last).days == pytest.approx(3 * YEAR, rel=0.01)


def test_the_lower_limit_is_watched_between_the_days_as_the_upper_is() -> None:
    """A mirrored machine crosses at the other limit on the same days, on the coarse grid too, where the bridges count most."""
    found = []
    for sign in (1.0, -1.0):
        arrays, prior = side_by_side([machine([0], [sign], EXACT)]), one_node(rate=sign, rate_sd=EXACT, walk=1.5)
        found.append(crossings(arrays, prior, filtered(arrays, prior), 4.0).probability[0])
    assert np.abs(found[0] - found[1]).max() < 3 * np.sqrt(2) * 0.5 / np.sqrt(PATHS)


def test_quantiles_and_probabilities_are_each_other_s_inverse() -> None:
    found = crossing(machine([0, 1], [0.0, 1.0]), 4.0)
    for part in (0.05, 0.3, 0.6):
        day = found.quantile(part)
        assert day is not None
        assert found.by(day) == pytest.approx(part, abs=0.002)
    assert np.all(np.diff(found.probability) >= -1e-12)
    assert DAYS[-1] == pytest.approx(HORIZON * YEAR)


def test_many_machines_are_what_each_is_alone_and_looking_less_far_ahead_changes_nothing_before() -> None:
    prior, each = one_node(), [machine([0], [1.0]), machine([0, 1, 2], [0.0, 2.0, 3.5])]
    arrays = side_by_side(each)
    many = crossings(arrays, prior, filtered(arrays, prior), np.array([4.0, 6.0]))
    near = crossings(arrays, prior, filtered(arrays, prior), np.array([4.0, 6.0]), until=400.0)
    assert near.probability.shape == many.probability.shape
    for i, (of, limit) in enumerate(zip(each, (4.0, 6.0), strict=True)):
        alone = side_by_side([of])
        one = crossings(alone, prior, filtered(alone, prior), limit)
        assert many.probability[i] == pytest.approx(one.probability[0], abs=0.01)
        assert many.rate[i] == pytest.approx(one.rate[0])
    before = DAYS <= 400
    assert near.probability[:, before] == pytest.approx(many.probability[:, before])


@pytest.mark.parametrize("limit", [0.0, -1.0, np.nan, np.inf])
def test_a_limit_that_cannot_be_crossed_is_refused(limit: float) -> None:
    with pytest.raises(CmmUqError, match="cannot be crossed"):
        crossing(machine([0], [1.0]), limit)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"u": np.array([0.0, 0.5])}, "no uncertainty"),
        ({"value": np.array([np.nan, 0.5])}, "not a number"),
        ({"u_artefact": np.array([0.9, 0.1])}, "more than the whole"),
        ({"day": np.array([730_400.0, 730_000.0])}, "backwards"),
        ({"adjusted_since": np.array([np.nan, 740_000.0])}, "after its certificate"),
        ({"artefact": ("A",)}, "differ in length"),
    ],
)
def test_a_history_that_cannot_be_used_is_refused_in_words(change: dict[str, object], words: str) -> None:
    with pytest.raises(CmmUqError, match=words):
        replace(machine([0, 1], [0.0, 1.0]), **change)  # type: ignore[arg-type]


def test_certificates_by_unknown_artefacts_have_nothing_in_common() -> None:
    """An empty name is no artefact; a known one is."""

    @dataclass
    class Series:
        artefact: tuple[str, ...]
        day = np.array([730_000, 730_365])
        value, u, u_artefact = np.array([1.0, 2.0]), np.array([0.5, 0.5]), np.array([0.3, 0.3])
        adjusted_since = np.array([0, 730_100])

    known = history(Series(("BB-7", "")))
    assert known.u_artefact.tolist() == [0.3, 0.0]
    assert np.isnan(known.adjusted_since[0])
    assert (known.adjusted_since[1], np.isnan(known.adjusted_after)) == (730_100.0, True)
    assert history(Series(("", "")), 730_400).adjusted_after == 730_400
    assert np.isnan(history(Series(("", "")), 730_365).adjusted_after)


def test_certificates_whose_whole_uncertainty_is_their_artefact_s_can_be_followed() -> None:
    """Two of one day with one artefact tell one thing twice: the level is known to that artefact's u, no better."""
    found = crossing(machine([0, 0], [1.0, 1.0], 0.5, 0.5), 5.0, one_node(first_sd=100.0))
    assert (found.level, found.u_level) == (pytest.approx(1.0, abs=0.001), pytest.approx(0.5, rel=0.01))


def test_certificates_all_of_one_day_tell_a_level_and_leave_the_rate_to_the_prior() -> None:
    found = crossing(machine([0, 0, 0], [1.0, 1.2, 0.8]), 5.0, one_node(rate=0.4, rate_sd=0.9))
    assert (found.rate, found.u_rate) == (pytest.approx(0.4), pytest.approx(0.9))
    assert found.level == pytest.approx(1.0, abs=0.05)
