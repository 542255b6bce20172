"""Every rule by its name, a hundredth of u on either side of where it turns; the turning points are worked with SciPy here."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, strategies as st
from pydantic import ValidationError
from scipy import optimize, stats

from cmm_uq.analysis.conformity.decision import PriorKnowledge, decide
from cmm_uq.jobs.tables.conformity import (
    ConformityFacts,
    PosteriorProbability,
    Rule,
    UncertaintyRatio,
    UnconditionalRisk,
)

LIMIT, U = 10.0, 1.0
PRIOR = PriorKnowledge(0.0, 6.0)
STEP = 0.01 * U


def posterior_limit(probability: float, signed: bool) -> float:
    """Value whose posterior N(m, s) has so much within the limits."""

    def short(value: float) -> float:
        s = 1 / np.sqrt(1 / U**2 + 1 / PRIOR.sd**2)
        about = stats.norm(value * s**2 / U**2, s)
        within = about.cdf(LIMIT) - about.cdf(-LIMIT if signed else 0.0)
        return float(within / (1.0 if signed else about.sf(0.0)) - probability)

    return float(optimize.brentq(short, 5.0, LIMIT))


def accepted_limit(share: float, signed: bool) -> float:
    """Acceptance limit whose wrongly accepted share, by a bivariate normal distribution, is asked for."""
    both = stats.multivariate_normal([0, 0], [[PRIOR.sd**2, PRIOR.sd**2], [PRIOR.sd**2, PRIOR.sd**2 + U**2]])

    def excess(a: float) -> float:
        # true value above the limit and reading at most a, less those readings below −a
        above = stats.norm(0, np.hypot(PRIOR.sd, U)).cdf(a) - both.cdf([LIMIT, a])
        low = stats.norm(0, np.hypot(PRIOR.sd, U)).cdf(-a) - both.cdf([LIMIT, -a]) if signed else 0.0
        return float(2 * (above - low) - share)  # both sides of zero, or the half above it

    return float(optimize.brentq(excess, 5.0, LIMIT, xtol=1e-6))


@pytest.mark.parametrize(("signed", "largest"), [(True, 1.25), (False, 0.625)])
@pytest.mark.parametrize("rule", ["ASME B89.7.3.1", "ASME B89.7.3.1-2001", UncertaintyRatio(uncertainty_ratio=4.0)])
def test_the_ratio_of_four_to_one_is_met_or_nothing_is_decided(rule: Rule, signed: bool, largest: float) -> None:
    """A zone of −10 to 10 is four times −2u to 2u at u = 20/4/4; a zone of 0 to 10 at u = 10/4/4."""
    assert decide(LIMIT, largest, LIMIT, rule, signed=signed).outcome == "pass"
    assert decide(LIMIT + 0.001, largest, LIMIT, rule, signed=signed).outcome == "fail"
    for value in (0.0, LIMIT + 5.0):
        assert decide(value, 1.01 * largest, LIMIT, rule, signed=signed).outcome == "undecided"


@pytest.mark.parametrize("signed", [True, False])
@pytest.mark.parametrize("name", ["ILAC-G8 binary", "ILAC-G8:09/2019 binary"])
def test_the_binary_rule_of_ilac_rejects_from_its_acceptance_limit_on(name: Rule, signed: bool) -> None:
    """4.2.2: acceptance limit TL − w, w = U = 2u; above it the statement is Fail."""
    assert decide(8.0 - STEP, U, LIMIT, name, signed=signed).outcome == "pass"
    assert decide(8.0, U, LIMIT, name, signed=signed).outcome == "pass"
    assert decide(8.0 + STEP, U, LIMIT, name, signed=signed).outcome == "fail"
    assert decide(8.0, U, LIMIT, name, signed=signed).guard_band == 2.0


@pytest.mark.parametrize("signed", [True, False])
def test_the_non_binary_rule_of_ilac_has_four_outcomes(signed: bool) -> None:
    """4.2.3: pass to TL − w, conditional pass to TL, conditional fail to TL + w, fail beyond."""
    told = {
        8.0: ("pass", "conditional pass"),
        10.0: ("conditional pass", "conditional fail"),
        12.0: ("conditional fail", "fail"),
    }
    for turn, (before, after) in told.items():
        assert decide(turn - STEP, U, LIMIT, "ILAC-G8 non-binary", signed=signed).outcome == before
        assert decide(turn + STEP, U, LIMIT, "ILAC-G8:09/2019 non-binary", signed=signed).outcome == after
        if signed:
            assert decide(-turn - STEP, U, LIMIT, "ILAC-G8 non-binary", signed=True).outcome == after


@pytest.mark.parametrize("signed", [True, False])
@pytest.mark.parametrize(
    ("rule", "least"), [("JCGM 106", 0.95), (PosteriorProbability(posterior_probability=0.8), 0.8)]
)
def test_jcgm_106_turns_at_the_posterior_probability(rule: Rule, least: float, signed: bool) -> None:
    turn = posterior_limit(least, signed)
    found = decide(turn - STEP, U, LIMIT, rule, signed=signed, prior=PRIOR)
    assert found.outcome == "pass"
    assert found.guard_band == pytest.approx(LIMIT - turn, abs=1e-6)
    assert decide(turn + STEP, U, LIMIT, rule, signed=signed, prior=PRIOR).outcome == "undecided"
    far = LIMIT + 4 * U
    assert decide(far, U, LIMIT, rule, signed=signed, prior=PRIOR).outcome == "fail"


@pytest.mark.parametrize("signed", [True, False])
@pytest.mark.parametrize(("rule", "share"), [(UnconditionalRisk(max_unconditional_false_accept=0.005), 0.005)])
def test_z540_3_turns_at_the_share_of_wrongly_accepted_items(rule: Rule, share: float, signed: bool) -> None:
    turn = accepted_limit(share, signed)
    assert decide(turn - STEP, U, LIMIT, rule, signed=signed, prior=PRIOR).outcome == "pass"
    assert decide(turn + STEP, U, LIMIT, rule, signed=signed, prior=PRIOR).outcome == "undecided"
    assert decide(LIMIT + STEP, U, LIMIT, rule, signed=signed, prior=PRIOR).outcome == "fail"


def test_two_percent_of_all_items_is_not_two_percent_of_this_one() -> None:
    """With most items well inside, Z540.3 accepts at the limit itself, where this item's own risk is one half."""
    inside = PriorKnowledge(0.0, 4.0)
    assert decide(LIMIT, U, LIMIT, "Z540.3", signed=True, prior=inside).outcome == "pass"
    assert decide(LIMIT, U, LIMIT, "ANSI/NCSL Z540.3", signed=True, prior=inside).guard_band == 0.0


def test_a_prior_changes_the_probability_and_not_what_iso_14253_decides() -> None:
    """Measured 8.5 ± 1 against 10: 93.3 %, undecided; with errors of 0 ± 3 beforehand 7.65 ± 0.949, 99.3 %."""
    alone, known = (
        decide(8.5, U, LIMIT, "ISO 14253-1:2017", signed=True, prior=p) for p in (None, PriorKnowledge(0.0, 3.0))
    )
    assert (alone.outcome, known.outcome) == ("undecided", "undecided")
    assert alone.probability_conforming == pytest.approx(stats.norm.cdf(1.5), abs=1e-9)
    assert known.probability_conforming == pytest.approx(stats.norm(7.65, np.sqrt(0.9)).cdf(10.0), abs=1e-9)


@pytest.mark.parametrize("rule", ["JCGM 106", "Z540.3", PosteriorProbability(posterior_probability=0.9)])
def test_a_rule_that_goes_by_a_prior_is_refused_without(rule: Rule) -> None:
    with pytest.raises(ValidationError, match="give prior ="):
        ConformityFacts(standard="ISO 10360-2:2009", limit_um=3.0, rule=rule)


def test_a_prior_has_one_width() -> None:
    for prior in ({}, {"sd_um": 1.0, "share_of_limit": 0.3}):
        with pytest.raises(ValidationError, match="either sd_um or share_of_limit"):
            ConformityFacts(standard="ISO 10360-2:2009", limit_um=3.0, prior=prior)


EVERY: list[Rule] = [
    "simple", "ASME B89.7.3.1", "ISO 14253-1:2017", "ILAC-G8 binary", "ILAC-G8 non-binary", "JCGM 106", "Z540.3",
    PosteriorProbability(posterior_probability=0.7), UnconditionalRisk(max_unconditional_false_accept=0.001),
]  # fmt: skip
RANK = ("pass", "conditional pass", "undecided", "conditional fail", "fail")


@given(
    st.floats(0, 30), st.floats(0, 30), st.floats(0.01, 8), st.floats(0.5, 40), st.sampled_from(EVERY), st.booleans()
)
def test_nearer_to_zero_is_never_judged_worse_and_nothing_beyond_the_limit_passes(
    one: float, other: float, u: float, sd: float, rule: Rule, signed: bool
) -> None:
    near, far = sorted((one, other))
    found = [
        decide(value, u, LIMIT, rule, signed=signed, prior=PriorKnowledge(0.0, sd)).outcome for value in (near, far)
    ]
    assert RANK.index(found[0]) <= RANK.index(found[1])
    for value, outcome in zip((near, far), found, strict=True):
        assert value <= LIMIT or outcome not in ("pass", "conditional pass")
