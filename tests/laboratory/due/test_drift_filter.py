"""The filter against the same model written with dense matrices, every tale one by one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from cmm_uq.base.points import Floats
from cmm_uq.laboratory.due.drift import YEAR, DriftHistory, DriftPrior, default_prior, side_by_side
from cmm_uq.laboratory.due.drift_filter import change_since, filtered
from tests.laboratory.due.histories import ALL, USUAL, dense, machine, one_node, over_tales

HISTORIES = {
    "one certificate": machine([0], [2.0]),
    "two of a day": machine([0, 0], [2.0, 1.0]),
    "one artefact": machine([0, 1, 2.5], [0.4, 1.9, 2.2], [0.5, 0.6, 0.4], [0.4, 0.3, 0.35]),
    "two artefacts": machine([0, 1, 2.5], [0.4, 1.9, 2.2], 0.6, 0.5, "ABA"),
    "a jump": machine([0, 1, 2], [0.1, 0.2, 9.0]),
    "adjusted between": machine([0, 1, 1.8], [3.0, 6.5, 0.9], 0.5, 0.3, "AAB", [np.nan, np.nan, 1.1]),
    "adjusted before the first": machine([0, 1.2], [0.6, 1.4], 0.5, 0.2, "AB", [-0.7, -0.7]),
    "adjusted twice": machine([0, 1, 2], [0.6, 1.4, -0.3], 0.5, 0.2, "AAA", [-0.7, 0.1, 1.9]),
    "an adjustment told late": machine([0, 1], [0.6, 1.4], 0.5, 0.2, "AA", [np.nan, -0.3]),
}


def found(of: DriftHistory, prior: DriftPrior) -> tuple[float, Floats, Floats]:
    state = filtered(side_by_side([of]), prior, kept=10**6)
    mean, covariance = over_tales(state)
    moving = 2 + len(prior.components)
    return float(state.log_evidence[0, 0]), mean[:moving, 0, 0], covariance[:moving, :moving, 0, 0]


@pytest.mark.parametrize("name", HISTORIES)
@pytest.mark.parametrize("components", [{}, ALL], ids=["plain", "all"])
def test_evidence_and_state_are_those_of_dense_matrices_over_every_tale(
    name: str, components: dict[str, float]
) -> None:
    prior = one_node(rate=0.6, **components)
    evidence, mean, covariance = found(HISTORIES[name], prior)
    moving = len(mean)
    assert moving == (5 if components else 2)
    dense_evidence, dense_mean, dense_covariance = dense(HISTORIES[name], prior)
    assert evidence == pytest.approx(dense_evidence, rel=1e-9)
    np.testing.assert_allclose(mean, dense_mean[:moving], rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(covariance, dense_covariance[:moving, :moving], rtol=1e-9, atol=1e-9)


def test_machines_side_by_side_are_what_they_are_alone() -> None:
    prior = default_prior(10.0, 4)
    one = HISTORIES["one artefact"]
    every = [replace(one, adjusted_after=one.day[-1] + 9), *HISTORIES.values()]
    together = filtered(side_by_side(every), prior)
    for i, of in enumerate(every):
        alone = filtered(side_by_side([of]), prior)
        np.testing.assert_allclose(together.log_evidence[i], alone.log_evidence[0], rtol=1e-12)
        np.testing.assert_allclose(over_tales(together)[0][:2, i], over_tales(alone)[0][:2, 0], rtol=1e-9, atol=1e-12)


def test_the_likeliest_tales_carry_nearly_all_of_the_evidence() -> None:
    """Of 65 536 tales of eight certificates, a step among them, twelve kept give the rate to a fiftieth of its u."""
    of = machine(list(range(8)), [0.1, 0.4, 0.7, 1.3, 6.2, 6.6, 6.8, 7.3], 0.4, 0.2, "AAABBBBB")
    few, many = (over_tales(filtered(side_by_side([of]), one_node(), kept=kept)) for kept in (12, 2000))
    u = np.sqrt(many[1][[0, 1], [0, 1], 0, 0])
    assert np.all(np.abs(few[0] - many[0])[:2, 0, 0] < u / 50)


def test_a_shared_artefact_leaves_the_rate_and_blurs_the_level() -> None:
    """An error common to both certificates cancels in their difference; with nothing known before, variances just add."""
    prior = one_node(rate_sd=100.0, first_sd=1000.0, walk=1e-6, steps_per_year=1e-12)
    own, common = (found(machine([0, 1], [0.0, 1.0], 0.5, part), prior)[2] for part in (0.0, 0.4))
    wrong = 0.01 * 24 * 0.25
    assert own[1, 1] == pytest.approx(2 * (0.25 + wrong), rel=1e-3)
    assert common[1, 1] == pytest.approx(2 * (0.25 - 0.16 + wrong), rel=1e-3)
    assert common[0, 0] == pytest.approx(own[0, 0], rel=1e-3) == pytest.approx(0.25 + wrong, rel=1e-3)


def test_an_adjustment_after_the_last_certificate_sets_the_level_back_and_leaves_the_rate() -> None:
    """The level then is what adjustments leave, N(0, as_left_sd²), whatever was certified before."""
    before = machine([0, 1, 2], [0.0, 3.0, 6.0], 0.3)
    after = replace(before, adjusted_after=before.day[-1] + 30)
    (one, mean, covariance), (other, mean_after, covariance_after) = found(before, one_node()), found(after, one_node())
    assert one == other
    assert (mean_after[0], covariance_after[0, 1]) == (0.0, 0.0)
    assert covariance_after[0, 0] == pytest.approx(1.0)
    assert (mean_after[1], covariance_after[1, 1]) == (mean[1], covariance[1, 1])
    assert side_by_side([before, after]).last.tolist() == [before.day[-1], before.day[-1] + 30]


@given(
    st.lists(st.tuples(st.floats(0, 3), st.floats(-20, 20)), min_size=1, max_size=4),
    st.sampled_from([-1.0, 1e-3, 250.0]),
)
@settings(max_examples=25, deadline=None)
def test_sign_and_unit_of_the_values_are_a_matter_of_words(
    given_values: list[tuple[float, float]], factor: float
) -> None:
    """Level and rate go with the values; a density of n values by the n-th power of the unit."""
    years, values = np.cumsum([gap for gap, _ in given_values]), np.array([value for _, value in given_values])
    of = machine(list(years), list(values), 0.5, 0.3)
    scale = abs(factor)
    other = machine(list(years), list(values * factor), 0.5 * scale, 0.3 * scale)
    prior = default_prior(10.0, 1)
    one, mean, covariance = found(of, prior)
    same, moved, spread = found(other, default_prior(10.0 * scale, 1))
    assert same == pytest.approx(one - len(values) * np.log(scale), abs=1e-6)
    np.testing.assert_allclose(moved, factor * mean, rtol=1e-6, atol=1e-8 * scale)
    np.testing.assert_allclose(spread, scale**2 * covariance, rtol=1e-6, atol=1e-10 * scale**2)


def test_nodes_of_a_group_are_weighed_by_the_data_and_groups_are_not() -> None:
    prior = DriftPrior(*(np.repeat(getattr(one_node(), name), 4) for name in
                    USUAL),
                  weight=np.array([0.1, 0.4, 0.2, 0.3]), group=np.array([0, 0, 1, 1]))  # fmt: skip
    prior.walk[:] = [0.01, 1.0, 0.01, 3.0]
    state = filtered(side_by_side([machine([0, 1, 2, 3], [0, 3.0, -1.0, 2.0], 0.1)]), prior)
    weights, evidence = state.weights(prior).sum(axis=2)[0], state.log_evidence[0]
    assert weights[:2].sum() == pytest.approx(0.5)
    assert weights[0] / weights[1] == pytest.approx(0.25 * np.exp(evidence[0] - evidence[1]))


STILL = {"rate_sd": 1e-9, "walk": 1e-9, "steps_per_year": 1e-9}


@pytest.mark.parametrize(("moves", "years", "change"), [
    ({"walk": 0.7}, 4.0, 0.7 * 2),  # a Wiener process
    ({"rate": -0.6}, 2.0, 0.6 * 2),  # a rate that is known; its sign is no matter
    ({"steps_per_year": 0.5, "step_sd": 2.0}, 2.0, 2.0),  # one step on average
    ({"walk": 0.6, "rate": 0.4}, 4.0, np.hypot(1.2, 1.6)),
])  # fmt: skip
def test_by_hand(moves: dict[str, float], years: float, change: float) -> None:
    prior = one_node(**(STILL | moves))
    for days in (years * YEAR, -years * YEAR):
        assert change_since(machine([0, 1], [0.2, 0.2]), days, prior=prior) == pytest.approx(change, rel=1e-6)


def test_a_rate_that_certificates_show_is_carried_on() -> None:
    """Four certificates on a line of 2 a year, each known to 0.01: after half a year it has moved by one."""
    prior = one_node(**(STILL | {"rate_sd": 5.0}))
    found = change_since(machine([0, 1, 2, 3], [0.0, 2, 4, 6], 0.01), 0.5 * YEAR, prior=prior)
    assert found == pytest.approx(1.0, rel=0.01)


@pytest.mark.parametrize("limit", [None, 8.0])
@pytest.mark.parametrize("rate", [0.5, 2.0, 8.0, 20.0, 60.0, -20.0])
def test_a_steady_line_is_carried_on_however_steep_it_is(rate: float, limit: float | None) -> None:
    """Six certificates in all seasons, each known to 0.4; in a year it moves by the rate, and is known to what is usual."""
    years = [1.18 * i for i in range(6)]
    usual = change_since(machine(years, [0.0] * 6, 0.4), YEAR, limit=limit)
    found = change_since(machine(years, [rate * year for year in years], 0.4), YEAR, limit=limit)
    assert usual is not None
    assert found is not None
    assert 0.8 * abs(rate) < found < 1.2 * np.hypot(rate, usual)


def test_what_nobody_can_know() -> None:
    two = machine([0, 1], [0.2, 0.3])
    assert change_since(machine([0], [0.2]), 100.0) is None
    assert change_since(replace(two, adjusted_after=two.day[-1] + 1), 100.0) is None
    found = change_since(two, 100.0)
    assert found is not None
    assert found > 0
