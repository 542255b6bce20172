"""Decisions between limits, of draws: normal ones decide as normal distributions do, others as their own quantiles say."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats

from cmm_uq.analysis.conformity.decision import PriorKnowledge, decide
from cmm_uq.analysis.conformity.limits import Limits, judge
from cmm_uq.base.points import Floats
from cmm_uq.jobs.tables.conformity import (
    FalseAccept,
    GuardBand,
    PosteriorProbability,
    Rule,
    UncertaintyRatio,
    UnconditionalRisk,
)

U = 0.01
NORMAL: Floats = U * stats.norm.ppf((np.arange(20_000) + 0.5) / 20_000)
"""Quantiles of a normal distribution: draws without any scatter of theirs."""

RULES: tuple[Rule, ...] = (
    "simple", "ISO 14253-1", "ILAC-G8 binary", "ILAC-G8 non-binary", GuardBand(guard_band=0.5),
    FalseAccept(max_false_accept=0.01),
    "ASME B89.7.3.1", UncertaintyRatio(uncertainty_ratio=2.0),
)  # fmt: skip
BY_PRIOR: tuple[Rule, ...] = (
    "JCGM 106", PosteriorProbability(posterior_probability=0.99), "Z540.3",
    UnconditionalRisk(max_unconditional_false_accept=0.001),
)  # fmt: skip
DEVIATIONS = (
    -0.13, -0.105, -0.095, -0.08, 0.0, 0.06, 0.079, 0.081, 0.0833, 0.0837, 0.09, 0.0999, 0.1001, 0.11, 0.1163, 0.1167,
    0.121, 0.14,
)  # fmt: skip


@pytest.mark.parametrize("rule", RULES, ids=str)
def test_between_two_limits_normal_errors_decide_as_the_rules_for_machines_do(rule: Rule) -> None:
    limits = Limits(29.9, 30.1, NORMAL)
    for deviation in DEVIATIONS:
        found, known = judge(limits, rule, 30 + deviation), decide(deviation, U, 0.1, rule, signed=True)
        assert found.outcome == known.outcome, deviation
        assert known.probability_beyond is not None
        assert found.beyond == pytest.approx(known.probability_beyond, rel=0.05, abs=2e-5)
        assert found.probability == pytest.approx(1 - known.probability_beyond, abs=2e-5)


@pytest.mark.parametrize("rule", RULES, ids=str)
def test_what_is_accepted_is_the_limits_less_the_guard_band(rule: Rule) -> None:
    band = decide(0.0, U, 0.1, rule, signed=True).guard_band
    accepted = judge(Limits(29.9, 30.1, NORMAL), rule, None).accepted
    assert band is not None
    assert accepted == (pytest.approx(29.9 + band, abs=2e-5), pytest.approx(30.1 - band, abs=2e-5))


@pytest.mark.parametrize("rule", RULES, ids=str)
def test_of_a_zone_the_upper_limit_alone_has_a_guard_band(rule: Rule) -> None:
    band = decide(0.0, U, 0.1, rule, signed=False).guard_band
    accepted = judge(Limits(None, 0.1, NORMAL, zone=True), rule, None).accepted
    assert accepted == (None if band is None else (None, pytest.approx(0.1 - band, abs=2e-5)))


@pytest.mark.parametrize("rule", [*RULES, *BY_PRIOR], ids=str)
@pytest.mark.parametrize("zone", [False, True])
def test_with_a_prior_too(rule: Rule, zone: bool) -> None:
    """Weighted draws and the normal posterior; the other method is an integral over panels, for Z540.3."""
    prior = PriorKnowledge(0.0, 0.05)
    limits = Limits(None, 0.1, NORMAL, zone, prior) if zone else Limits(-0.1, 0.1, NORMAL, zone, prior)
    for deviation in (d for d in DEVIATIONS if d >= 0 or not zone):
        found = judge(limits, rule, deviation)
        known = decide(deviation, U, 0.1, rule, signed=not zone, prior=prior)
        assert found.outcome == known.outcome, deviation
        assert found.probability == pytest.approx(known.probability_conforming, abs=5e-4)
    band = decide(0.0, U, 0.1, rule, signed=not zone, prior=prior).guard_band
    accepted = judge(limits, rule, None).accepted
    if band is None:
        assert accepted is None
        return
    assert accepted is not None
    assert accepted[1] == pytest.approx(0.1 - band, abs=2e-4 if zone and rule in ("Z540.3", BY_PRIOR[3]) else 1e-4)


@pytest.mark.parametrize("rule", ["JCGM 106", "Z540.3"])
@pytest.mark.parametrize("zone", [False, True])
@pytest.mark.parametrize("times", [3.0, 4.2, 7.0, 100.0])
def test_a_larger_uncertainty_accepts_no_more_and_at_last_nothing(rule: Rule, zone: bool, times: float) -> None:
    """As :func:`decide` has it; 7 times U is more than 0.1/1.645, by which alone no value is proved."""
    prior = PriorKnowledge(0.0, 0.04)
    errors = times * NORMAL
    limits = Limits(None, 0.1, errors, zone, prior) if zone else Limits(-0.1, 0.1, errors, zone, prior)
    band = decide(0.0, times * U, 0.1, rule, signed=not zone, prior=prior).guard_band
    accepted = judge(limits, rule, 0.095).accepted
    if times > 6:
        assert (band, accepted) == (None, None)
        assert judge(limits, rule, 0.0).outcome == "undecided"
        return
    assert band is not None
    assert accepted is not None
    assert accepted[1] == pytest.approx(0.1 - band, abs=1e-3)
    assert judge(limits, rule, 0.095).outcome == ("undecided" if rule == "JCGM 106" else "pass")


def test_a_limit_on_the_lower_side_mirrors_one_on_the_upper() -> None:
    skew = np.sort(np.random.default_rng(1).gamma(2.0, U, 50_000))
    skew = skew - skew.mean()
    below = judge(Limits(5.0, None, skew), "ISO 14253-1", 5.01)
    above = judge(Limits(None, -5.0, -skew), "ISO 14253-1", -5.01)
    assert below.accepted is not None
    assert above.accepted is not None
    assert below.beyond == pytest.approx(above.beyond)
    assert below.accepted[0] == pytest.approx(-float(above.accepted[1] or 0))
    assert (below.accepted[1], above.accepted[0]) == (None, None)


def test_errors_to_one_side_need_a_guard_band_on_one_side() -> None:
    """Exponential errors: P(true > upper | y) = P(e < y − upper), known in closed form."""
    errors = U * (stats.expon.ppf((np.arange(200_000) + 0.5) / 200_000) - 1)
    accepted = judge(Limits(0.0, 1.0, errors), "ISO 14253-1", None).accepted
    assert accepted is not None
    assert accepted[1] == pytest.approx(1 - U * (1 + math.log(0.95)), abs=1e-6)
    assert accepted[0] == pytest.approx(U * (-math.log(0.05) - 1), abs=1e-5)


def test_a_tail_that_was_not_drawn_is_that_of_a_normal_distribution() -> None:
    few = U * stats.norm.ppf((np.arange(1000) + 0.5) / 1000)
    found = judge(Limits(-1.0, 1.0, few), "ISO 14253-1", 1 - 4.5 * U)
    assert found.beyond == pytest.approx(stats.norm.sf(4.5), rel=0.03)
    assert found.outcome == "pass"


def test_where_u_is_too_large_nothing_is_accepted() -> None:
    assert judge(Limits(-0.005, 0.005, NORMAL), "ISO 14253-1", 0.0).outcome == "undecided"
    for rule in ("ISO 14253-1", "ASME B89.7.3.1", "ILAC-G8 binary"):
        assert judge(Limits(-0.005, 0.005, NORMAL), rule, None).accepted is None
        assert judge(Limits(None, 0.005, NORMAL, zone=True), rule, None).accepted is None


def test_without_any_spread_it_is_inside_or_outside() -> None:
    for value, outcome in ((0.99, "pass"), (1.01, "fail")):
        found = judge(Limits(0.0, 1.0, np.zeros(100)), "ISO 14253-1", value)
        assert (found.outcome, found.probability) == (outcome, float(outcome == "pass"))


@pytest.mark.parametrize(
    ("rule", "outcome"),
    [("ISO 14253-1", "undecided"), ("ILAC-G8 binary", "fail"), ("ILAC-G8 non-binary", "conditional pass"),
     (GuardBand(guard_band=1.0), "undecided"), (FalseAccept(max_false_accept=0.2), "pass"), ("simple", "pass")],
    ids=str,
)  # fmt: skip
def test_a_zone_that_was_measured_better_than_its_errors_is_accepted_by_its_probability(
    rule: Rule, outcome: str
) -> None:
    """Less than zero by 1.5 u: of what is left above zero 18 % lie above 0.75 u, and 4.5 % above 1.25 u."""
    limits = Limits(None, 0.75 * U, NORMAL, zone=True)
    found = judge(limits, rule, -1.5 * U)
    assert found.beyond == pytest.approx(stats.norm.sf(2.25) / stats.norm.sf(1.5), rel=0.05)
    assert found.outcome == outcome
    assert (found.accepted is None) == (outcome != "pass")
    known = judge(Limits(None, 1.25 * U, NORMAL, zone=True), FalseAccept(max_false_accept=0.05), -1.5 * U)
    assert (known.outcome, known.accepted) == ("pass", (None, 0.0))


@pytest.mark.parametrize("prior", [None, PriorKnowledge(0.0, 1e6 * U)], ids=["without a prior", "that says nothing"])
def test_a_zone_that_was_measured_much_better_than_its_errors_may_be_as_large_as_these(
    prior: PriorKnowledge | None,
) -> None:
    """Less than zero by 3 u, which one draw in 700 is: a normal distribution of mean 3 u on both sides of zero."""
    limits = Limits(None, 1.2 * U, NORMAL, zone=True, prior=prior)
    found = judge(limits, "ISO 14253-1", -3 * U)
    assert found.probability == pytest.approx(stats.norm.cdf(1.2, 3) - stats.norm.cdf(-1.2, 3), abs=1e-3)
    assert (found.probability or 0) + (found.beyond or 0) == pytest.approx(1)
    assert found.outcome == "undecided"
