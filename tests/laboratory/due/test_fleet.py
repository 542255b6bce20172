"""A fleet: who does not belong, what is learnt for whom, and that little history is filled up from machines alike."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import false_discovery_control

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats
from cmm_uq.laboratory.due.drift import MEDIANS, NAMES, SPREADS, side_by_side
from cmm_uq.laboratory.due.drift_filter import usual_start
from cmm_uq.laboratory.due.fleet import Fleet, FleetMember, belonging, comparable, fit_fleet, judged
from cmm_uq.laboratory.due.fleet_model import log_posterior, messages, others, shared_by, together
from cmm_uq.maths.inference.ensembles import run_ensembles
from cmm_uq.maths.inference.proposals import tempered
from tests.certificate.fleets import alone, two
from tests.laboratory.due.histories import machine

YEARS = np.arange(5.0)
ODD, NEW, MODELS = 7, 10, ("slow", "fast")


def members() -> list[FleetMember]:
    random = np.random.default_rng(5)
    found = []
    for i in range(10):
        rate = 3.0 if i == ODD else (0.2, 1.2)[i % 2 == 0] + 0.1 * random.standard_normal()
        values = random.standard_normal() + rate * YEARS + 0.3 * random.standard_normal(5)
        found.append(
            FleetMember(str(i), MODELS[i % 2 == 0], "hall", machine(list(YEARS), list(values), 0.3, 0.1, "AABBB"), 10.0)
        )
    return [*found, FleetMember("new", "fast", "hall", machine([4], [0.5], 0.3, 0.1, "B"), 10.0)]


@pytest.fixture(scope="module")
def learnt() -> Fleet:
    return fit_fleet(members(), seed=1)


def test_the_draws_are_worth_enough_and_those_of_a_markov_chain(learnt: Fleet) -> None:
    """Medians within four of their standard errors, and all 95 % intervals nearly as wide; emcee knows nothing of weights."""
    assert learnt.worth >= 1000
    assert learnt.learnt_from == 11
    few = members()[:4]
    arrays = side_by_side([each.history for each in few])
    shared = shared_by(arrays, [each.model for each in few], [each.place for each in few])

    def density(theta: Floats) -> Floats:
        return log_posterior(arrays, shared, theta, 10.0)

    chains = run_ensembles(density, tempered(density, np.log(MEDIANS), np.diag(SPREADS), 1), 1, walkers=16)
    size = np.array([1.0 if name == "steps_per_year" else 10.0 for name in NAMES])[:, None]
    ours = np.array([[one.lower, one.median, one.upper] for one in fit_fleet(few, seed=1).spreads])
    low, middle, high = np.quantile(chains.draws, [0.025, 0.5, 0.975], axis=0)
    error = 1.25 * (high - low) / 3.92 * np.sqrt(1 / chains.ess_min + 1 / 1000)
    lower, median, upper = np.log(ours / size).T
    assert np.all(np.abs(median - middle) < 4 * error)
    np.testing.assert_allclose(upper - lower, high - low, rtol=0.15)


def test_only_the_machine_that_drifts_otherwise_does_not_belong(learnt: Fleet) -> None:
    assert np.flatnonzero(~belonging(learnt.estimates.p)).tolist() == [ODD]


def test_each_model_has_its_usual_rate(learnt: Fleet) -> None:
    usual = {each.name: each for each in learnt.usual if each.kind == "model"}
    assert usual["fast"].lower < 1.2 < usual["fast"].upper
    assert usual["slow"].lower < 0.2 < usual["slow"].upper
    assert usual["fast"].machines == 6


def test_a_machine_seen_once_is_expected_to_drift_as_its_model(learnt: Fleet) -> None:
    """One certificate says hardly anything of a rate: what is estimated is what the others let expect, with its spread."""
    e = learnt.estimates
    assert e.rate[NEW] == pytest.approx(e.expected[NEW], abs=0.1 * e.u_expected[NEW])
    assert e.u_rate[NEW] == pytest.approx(e.u_expected[NEW], rel=0.1)
    assert e.p[NEW] > 0.5
    assert abs(e.expected[NEW] - 1.2) < abs(e.expected[NEW] - 0.2)


def test_a_machine_s_own_certificates_do_not_count_among_what_the_others_say(learnt: Fleet) -> None:
    """What is expected of a machine stays as it is whatever its certificates say, at the same hyper-parameters."""

    def expected(all_members: list[FleetMember]) -> float:
        arrays = side_by_side([each.history for each in all_members])
        shared = shared_by(arrays, [each.model for each in all_members], [each.place for each in all_members])
        said = messages(arrays, shared, learnt.theta, learnt.unit)
        return float(others(said, together(said, shared, learnt.theta, learnt.unit), shared, learnt.theta, learnt.unit)
                     .mean[0, 3].mean())  # fmt: skip

    one = members()
    other = members()
    other[3] = FleetMember("3", one[3].model, "hall", machine([0, 4], [0.0, 9.0], 0.3, 0.1, "AB"), 10.0)
    assert expected(one) == pytest.approx(expected(other), rel=1e-9)


def test_the_prior_of_a_model_is_narrower_than_that_of_an_unknown_one(learnt: Fleet) -> None:
    known, unknown = learnt.prior("fast", "hall"), learnt.prior("other", "elsewhere")
    assert np.all(known.rate_sd < unknown.rate_sd)
    assert known.weight.sum() == pytest.approx(1.0)
    arrays = side_by_side([each.history for each in members()[:2]])
    _, start = learnt.start(arrays, ["fast", "slow"], ["hall", "hall"])
    np.testing.assert_allclose(start.mean[0, 0], usual_start(arrays, known).mean[0, 0])
    assert np.all(start.mean[0, 1] < start.mean[0, 0])


@pytest.mark.long
def test_the_same_seed_gives_the_same_figures() -> None:
    one, other = (fit_fleet(members()[:2], seed=3) for _ in range(2))
    np.testing.assert_array_equal(one.theta, other.theta)
    np.testing.assert_array_equal(one.estimates.rate, other.estimates.rate)


def test_false_discoveries_are_those_of_benjamini_and_hochberg() -> None:
    random = np.random.default_rng(0)
    for n in (1, 5, 200):
        p = random.random(n) ** 4
        np.testing.assert_array_equal(belonging(p), false_discovery_control(p) > 0.05)


def test_no_machine_is_no_fleet() -> None:
    with pytest.raises(CmmUqError, match="no machine"):
        fit_fleet([])


ONE_DAY, TWO_DAYS = ((0.0, 0.0), (0.0, 1.0))


def seen(*days: tuple[float, float]) -> tuple[FleetMember, ...]:
    return tuple(FleetMember(f"{i}", "", "", machine(list(each), [0.0, 0.0])) for i, each in enumerate(days))


@pytest.mark.parametrize(
    ("days", "compared"),
    [
        ((TWO_DAYS,), False),
        ((ONE_DAY, ONE_DAY), False),
        ((TWO_DAYS, ONE_DAY), False),
        ((TWO_DAYS, ONE_DAY, TWO_DAYS), True),
    ],
)
def test_machines_are_compared_where_two_have_certificates_of_two_days(
    days: tuple[tuple[float, float], ...], compared: bool
) -> None:
    assert comparable(seen(*days)) == compared


def with_p(fleet: Fleet, *p: float) -> Fleet:
    return replace(fleet, estimates=replace(fleet.estimates, p=np.array(p)))


def test_a_value_that_compares_nobody_neither_accuses_nor_counts() -> None:
    """Of two, p = 0.024 is below 5 %/2; of three, with the value that compares nobody, it were not below 5 %/3."""
    one, both = alone().values[0], two().values[0]
    found = judged(
        [
            ("a", "A", "ppm", one.members, with_p(one.fleet, 0.9), 0),
            ("b", "B", "ppm", both.members, with_p(both.fleet, 0.9, 0.024), 0),
        ],
        1,
    )
    assert [(of.name, i) for of, i in found.outsiders] == [("b", 1)]
    assert judged([("a", "A", "ppm", one.members, with_p(one.fleet, 1e-12), 0)], 1).outsiders == []
    assert (found.compared, [of.compared for of in found.values]) == (True, [False, True])
