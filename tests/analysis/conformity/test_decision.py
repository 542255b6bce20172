"""Decision rules at and about their limits, on both sides of zero and on one."""

from __future__ import annotations

from statistics import NormalDist

import numpy as np
import pytest
from hypothesis import given, strategies as st

from cmm_uq.analysis.conformity.decision import decide, rule_name
from cmm_uq.jobs.tables.conformity import FalseAccept, GuardBand, Rule

RULES: list[Rule] = ["simple", "ISO 14253-1", GuardBand(guard_band=1.0), FalseAccept(max_false_accept=0.02)]
GUARDED: list[Rule] = [rule for rule in RULES if rule != "simple"]


@pytest.mark.parametrize("signed", [True, False])
@pytest.mark.parametrize(
    ("value", "rule", "outcome"),
    [
        (9.99, "simple", "pass"),
        (10.0, "simple", "pass"),
        (10.01, "simple", "fail"),
        (8.35, "ISO 14253-1", "pass"),  # guard band 1.645 u; both sides of it 0.01 u apart
        (8.36, "ISO 14253-1", "undecided"),
        (9.99, "ISO 14253-1", "undecided"),
        (10.01, "ISO 14253-1", "undecided"),
        (11.64, "ISO 14253-1", "undecided"),
        (11.65, "ISO 14253-1", "fail"),
        (
            8.0,
            GuardBand(guard_band=1.0),
            "pass",
        ),  # w = U = 2 u, and the limit of acceptance belongs to what is accepted
        (8.001, GuardBand(guard_band=1.0), "undecided"),
        (11.999, GuardBand(guard_band=1.0), "undecided"),
        (12.0, GuardBand(guard_band=1.0), "fail"),
        (7.94, FalseAccept(max_false_accept=0.02), "pass"),  # 2.054 u
        (7.95, FalseAccept(max_false_accept=0.02), "undecided"),
        (12.05, FalseAccept(max_false_accept=0.02), "undecided"),
        (12.06, FalseAccept(max_false_accept=0.02), "fail"),
        (10.0, FalseAccept(max_false_accept=0.6), "pass"),
        (
            10.0,
            FalseAccept(max_false_accept=0.5),
            "pass",
        ),  # at the limit one half is accepted wrongly, and that is allowed
        (10.01, FalseAccept(max_false_accept=0.6), "fail"),  # a risk above one half accepts nothing beyond the limit
        (10.0, GuardBand(guard_band=0.0), "pass"),
        (10.01, GuardBand(guard_band=0.0), "fail"),
    ],
)
def test_a_limit_of_ten_with_an_uncertainty_of_one(value: float, rule: Rule, outcome: str, signed: bool) -> None:
    """Ten u from the limit on the other side, which adds less than 1e-23: the bands are those of one side."""
    assert decide(value, 1.0, 10.0, rule, signed=signed).outcome == outcome
    if signed:
        assert decide(-value, 1.0, 10.0, rule, signed=True).outcome == outcome


def test_an_error_at_zero_within_one_u_conforms_with_68_3_percent_and_not_with_84_1() -> None:
    """E = 0, u = 2, limit 2: the 68.27 % of one standard deviation; a range would have the one-sided 84.13 %."""
    assert decide(0.0, 2.0, 2.0, "simple", signed=True).probability_conforming == pytest.approx(0.682689492, abs=1e-9)
    assert decide(0.0, 2.0, 2.0, "simple", signed=False).probability_conforming == pytest.approx(0.841344746, abs=1e-9)


@pytest.mark.parametrize(("limit", "outcome"), [(3.3, "undecided"), (3.91, "undecided"), (3.93, "pass")])
def test_an_error_of_zero_is_accepted_from_a_limit_of_1_96_u_on(limit: float, outcome: str) -> None:
    """E = 0, u = 2: limit 3.3 holds 90.1 %, and 95 % takes 1.960 · 2 = 3.920."""
    found = decide(0.0, 2.0, limit, "ISO 14253-1", signed=True)
    assert found.outcome == outcome
    if limit == 3.3:
        assert found.probability_conforming == pytest.approx(0.9011, abs=5e-5)


def test_a_guard_band_of_both_sides_is_wider_where_the_limits_are_near() -> None:
    """Limit 4, u = 2: only from −0.3… on do 5 % lie outside; checked with the distribution of the standard library."""
    found = decide(0.0, 2.0, 4.0, "ISO 14253-1", signed=True)
    assert found.guard_band is not None
    accepted = NormalDist(4.0 - found.guard_band, 2.0)
    assert accepted.cdf(-4.0) + 1 - accepted.cdf(4.0) == pytest.approx(0.05, abs=1e-9)
    assert 1.645 * 2.0 < found.guard_band < 4.0
    assert decide(0.0, 2.0, 3.9, "ISO 14253-1", signed=True).guard_band is None
    assert decide(0.0, 2.0, 3.9, GuardBand(guard_band=1.0), signed=True).guard_band is None
    assert decide(0.0, 1.0, 10.0, "ISO 14253-1", signed=True).guard_band == pytest.approx(1.6448536, abs=1e-6)


@pytest.mark.parametrize(
    ("rule", "band"),
    [
        ("simple", 0.0),
        (GuardBand(guard_band=1.5), 6.0),  # 1.5 · 2 · 2
        (FalseAccept(max_false_accept=0.02), 4.107498),  # 2.053749 u, the 98 % quantile of the normal distribution
        (
            FalseAccept(max_false_accept=0.6),
            0.0,
        ),  # nothing beyond the limit is accepted, so that no band lies outside it
    ],
)
@pytest.mark.parametrize("signed", [True, False])
def test_the_guard_band_of_two_micrometres_uncertainty(rule: Rule, band: float, signed: bool) -> None:
    assert decide(0.0, 2.0, 40.0, rule, signed=signed).guard_band == pytest.approx(band, abs=1e-6)


def test_a_guard_band_as_wide_as_the_limit_leaves_zero_to_accept() -> None:
    found = decide(0.0, 2.0, 4.0, GuardBand(guard_band=1.0), signed=True)
    assert (found.guard_band, found.outcome) == (4.0, "pass")
    assert decide(0.0, 2.0, 3.999, GuardBand(guard_band=1.0), signed=True).outcome == "undecided"


@pytest.mark.parametrize(
    ("rule", "name", "words"),
    [
        ("simple", "simple", "simple acceptance (JCGM 106:2012, 8.2.1)"),
        ("ISO 14253-1", "ISO 14253-1", "ISO 14253-1:2017, guard band 1.64 u (95 %)"),
        (GuardBand(guard_band=1.5), "guard_band = 1.5", "guard band 1.5 U, k = 2 (ILAC-G8:09/2019)"),
        (FalseAccept(max_false_accept=0.02), "max_false_accept = 0.02",
         "probability of false acceptance at most 0.02 (JCGM 106:2012, 9.5)"),
    ],
)  # fmt: skip
def test_a_rule_in_the_words_of_the_job_and_of_the_certificate(rule: Rule, name: str, words: str) -> None:
    """Limit twenty times u: the band of 1.6449 u is a multiple of u, whatever u is."""
    assert rule_name(rule) == name
    assert decide(0.0, 2.0, 40.0, rule, signed=True).rule == words


def test_the_words_name_no_guard_band_where_no_value_is_accepted() -> None:
    assert decide(0.0, 2.0, 3.9, "ISO 14253-1", signed=True).rule == "ISO 14253-1:2017 (95 %)"


def test_a_value_inside_its_limits_never_proves_nonconformity() -> None:
    """u a hundred times the limit: 0.8 % lie inside, whatever is measured; that says nothing of the machine."""
    for rule in GUARDED:
        assert decide(0.5, 100.0, 1.0, rule, signed=True).outcome == "undecided"


def test_a_value_at_its_limit_does_not_prove_nonconformity_either() -> None:
    """Limit 1, u = 2, value 1: beyond are Φ(0) + Φ(−1) = 65.9 %, more than may be, and within no more than may be."""
    assert decide(1.0, 2.0, 1.0, FalseAccept(max_false_accept=0.6), signed=True).outcome == "undecided"


def test_without_an_uncertainty_only_simple_acceptance_decides_and_has_no_probability() -> None:
    assert decide(10.0, 0.0, 10.0, "simple", signed=True).outcome == "pass"
    found = decide(10.1, 0.0, 10.0, "simple", signed=True)
    assert (found.outcome, found.probability_conforming) == ("fail", None)
    for rule in GUARDED:
        with pytest.raises(ValueError, match="needs an uncertainty"):
            decide(1.0, 0.0, 10.0, rule, signed=True)


def test_small_probabilities_keep_their_digits() -> None:
    """Φ(−12) = 1.7765e-33 (Abramowitz & Stegun have log10 Q(12) = −32.75044): 1 − P would be 0."""
    assert decide(22.0, 1.0, 10.0, "simple", signed=True).probability_conforming == pytest.approx(
        1.7765e-33, rel=1e-4, abs=0
    )
    assert decide(-2.0, 1.0, 10.0, "simple", signed=False).probability_beyond == pytest.approx(
        1.7765e-33, rel=1e-4, abs=0
    )


@given(st.floats(-30, 30), st.floats(0.001, 50), st.sampled_from(RULES), st.booleans())
def test_the_probability_is_that_of_the_standard_library(value: float, u: float, rule: Rule, signed: bool) -> None:
    found, about = decide(value, u, 10.0, rule, signed=signed), NormalDist(value, u)
    assert found.probability_conforming is not None
    assert found.probability_conforming == pytest.approx(
        about.cdf(10.0) - (about.cdf(-10.0) if signed else 0.0), abs=1e-12
    )


@given(st.floats(-30, 30), st.floats(0.001, 50), st.sampled_from(GUARDED), st.booleans())
def test_a_guarded_pass_is_a_simple_pass_and_a_guarded_fail_a_simple_fail(
    value: float, u: float, rule: Rule, signed: bool
) -> None:
    guarded, simple = (decide(value, u, 10.0, r, signed=signed).outcome for r in (rule, "simple"))
    assert guarded in (simple, "undecided")


@given(st.floats(-30, 30), st.floats(0.001, 50), st.booleans())
def test_rules_of_probability_keep_their_promise(value: float, u: float, signed: bool) -> None:
    for rule, risk in (("ISO 14253-1", 0.05), (FalseAccept(max_false_accept=0.02), 0.02)):
        found = decide(value, u, 10.0, rule, signed=signed)
        assert found.probability_conforming is not None
        assert (found.outcome == "pass") == (found.probability_conforming >= 1 - risk - 1e-12)


@pytest.mark.long
@pytest.mark.parametrize("signed", [True, False])
@pytest.mark.parametrize(
    ("rule", "risk"),
    [("ISO 14253-1", 0.05), (FalseAccept(max_false_accept=0.02), 0.02), (GuardBand(guard_band=1.0), 0.02275)],
)
def test_a_machine_at_its_limit_passes_as_often_as_the_rule_allows(rule: Rule, risk: float, signed: bool) -> None:
    """A hundred thousand measurements of a true value at the limit: 0.3 points are over four standard deviations (0.07)."""
    measured = 10.0 + np.random.default_rng(0).standard_normal(100_000)
    accepted = np.array([decide(value, 1.0, 10.0, rule, signed=signed).outcome == "pass" for value in measured])
    assert accepted.mean() == pytest.approx(risk, abs=0.003)


def test_an_uncertainty_however_large_proves_no_nonconformity() -> None:
    """11 ± 162 lies between −10 and 10 with 4.9 %, for it may lie anywhere; beyond 10 it is no farther than by chance."""
    for u in (0.7, 9.0, 162.0, 1e4):
        assert decide(11.0, u, 10.0, "ISO 14253-1", signed=True).outcome == "undecided"
    assert decide(11.0, 0.6, 10.0, "ISO 14253-1", signed=True).outcome == "fail"
