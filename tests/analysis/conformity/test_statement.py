"""Which of several quantities is named: the least favourable against its own limit."""

from __future__ import annotations

from cmm_uq.analysis.conformity.decision import decide
from cmm_uq.analysis.conformity.statement import Decided, Statement
from cmm_uq.base.messages import Text, say
from cmm_uq.jobs.tables.conformity import ConformityFacts, Rule
from cmm_uq.jobs.tables.length_formula import MaximumPermissibleError

MPE = MaximumPermissibleError(a_um=2.5, k=300.0)
FACTS = ConformityFacts(standard="ISO 10360-2:2009", mpe=MPE)


def length(mm: float, error_um: float, u_um: float, rule: Rule = "simple") -> Decided:
    limit = 2.5 + mm / 300
    return Decided(error_um, u_um, limit, decide(error_um, u_um, limit, rule, signed=True), length_mm=mm)


def statement(*errors: Decided, missing: tuple[Text, ...] = ()) -> Statement:
    return Statement(FACTS, "E0", say("error"), say("lengths"), errors, missing, ())


def test_without_an_uncertainty_the_least_room_under_its_own_limit_is_named() -> None:
    """2.0 of 2.567 µm leave 0.567, −4.9 of 5.167 leave 0.267; 2.4 of 2.567 leave 0.167."""
    near, far = length(20.0, 2.4, 0.0), length(800.0, -4.9, 0.0)
    assert statement(length(20.0, 2.0, 0.0), far).named is far
    assert statement(far, near).named is near
    assert statement(near, far).named is near


def test_of_two_that_fail_for_certain_the_less_probable_one_is_named() -> None:
    """12 u beyond by 0.12 µm, and 10 u beyond by 4 µm: Φ(−12) = 1.8e-33, Φ(−10) = 7.6e-24."""
    twelve, ten = length(20.0, 2.5 + 20 / 300 + 0.12, 0.01), length(800.0, 2.5 + 800 / 300 + 4.0, 0.4)
    assert statement(ten, twelve).named is twelve


def test_of_two_that_pass_for_certain_the_one_more_probably_beyond_is_named() -> None:
    """12 u within by 0.12 µm, and 9 u within by 3.6 µm: both 1 to the last digit."""
    twelve, nine = length(20.0, 2.5 + 20 / 300 - 0.12, 0.01), length(800.0, 2.5 + 800 / 300 - 3.6, 0.4)
    assert statement(twelve, nine).named is nine


def test_the_gravest_outcome_is_named_before_the_least_probable_one() -> None:
    """Undecided at 60 %, failed at 3 % though more lengths are undecided; a pass does not count beside either."""
    undecided, failed = length(800.0, 5.1, 0.4, "ISO 14253-1"), length(20.0, 2.6, 0.01, "ISO 14253-1")
    passed = length(20.0, 0.0, 0.01, "ISO 14253-1")
    assert statement(passed, undecided, failed).outcome == "fail"
    assert statement(passed, undecided).outcome == "undecided"
    assert statement(passed).outcome == "pass"


def test_what_is_named_is_given_with_its_own_figures() -> None:
    found = statement(length(20.0, 1.0, 0.01), length(800.0, -5.1, 0.4), missing=(say("a length"),))
    assert (found.value_um, found.u_um, found.limit_um) == (5.1, 0.4, 2.5 + 800 / 300)
    assert found.decision is found.errors[1].decision
    assert (found.outcome, found.scope) == ("incomplete", "partial")
