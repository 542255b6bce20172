"""Decision rules at and about their limits."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cmm_uq.conformity.decision import decide
from cmm_uq.jobs.job import FalseAccept, GuardBand, Rule

RULES: list[Rule] = ["simple", "ISO 14253-1", GuardBand(guard_band=1.0), FalseAccept(max_false_accept=0.02)]


@pytest.mark.parametrize(
    ("value", "rule", "outcome"),
    [
        (10.0, "simple", "pass"),
        (10.01, "simple", "fail"),
        (8.35, "ISO 14253-1", "pass"),  # guard band 1.645 u
        (8.36, "ISO 14253-1", "undecided"),
        (11.64, "ISO 14253-1", "undecided"),
        (11.65, "ISO 14253-1", "fail"),
        (7.99, GuardBand(guard_band=1.0), "pass"),  # w = U = 2 u
        (8.01, GuardBand(guard_band=1.0), "undecided"),
        (7.94, FalseAccept(max_false_accept=0.02), "pass"),  # 2.054 u
        (7.95, FalseAccept(max_false_accept=0.02), "undecided"),
    ],
)
def test_a_limit_of_ten_with_an_uncertainty_of_one(value: float, rule: Rule, outcome: str) -> None:
    assert decide(value, 1.0, 10.0, rule).outcome == outcome


def test_the_conformance_probability_is_that_of_a_normal_distribution() -> None:
    """JCGM 106:2012, 7.2: Φ((T − η)/u)."""
    assert decide(9.0, 1.0, 10.0, "simple").probability_conforming == pytest.approx(0.841344746)


def test_without_uncertainty_the_rules_agree() -> None:
    for rule in RULES:
        assert decide(10.0, 0.0, 10.0, rule).outcome == "pass"
        assert decide(10.1, 0.0, 10.0, rule).outcome == "fail"
        assert decide(10.1, 0.0, 10.0, rule).probability_conforming == 0.0


@given(st.floats(0, 30), st.floats(0.001, 5), st.sampled_from(RULES))
def test_a_guarded_pass_is_a_simple_pass_and_likely(value: float, u: float, rule: Rule) -> None:
    decision = decide(value, u, 10.0, rule)
    if decision.outcome == "pass":
        assert value <= 10.0
        assert decision.probability_conforming >= 0.5
    if decision.outcome == "pass" and rule == "ISO 14253-1":
        assert decision.probability_conforming >= 0.95 - 1e-9


@given(st.floats(0, 30), st.floats(0.001, 5))
def test_the_false_acceptance_rule_keeps_its_promise(value: float, u: float) -> None:
    decision = decide(value, u, 10.0, FalseAccept(max_false_accept=0.02))
    assert (decision.outcome == "pass") == (decision.probability_conforming >= 0.98 - 1e-12)
