"""One of three outside: what is to be measured again, what that decides, and where it is too late."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest

from cmm_uq.analysis.conformity.standards import statement
from cmm_uq.analysis.conformity.statement import GRAVEST, Statement
from cmm_uq.artefacts import artefact_facts
from cmm_uq.artefacts.gauge_lines import StepGauge
from cmm_uq.base.points import Points
from cmm_uq.jobs.tables.conformity import ConformityFacts
from cmm_uq.jobs.tables.length_formula import MaximumPermissibleError
from cmm_uq.machine.model.kind import LENGTHS
from tests.analysis.conformity.recorded import SEVEN, STATED, five, gauge

FACTS = ConformityFacts(standard="ISO 10360-2:2009", mpe=MaximumPermissibleError(a_um=2.5, k=300.0))
SHORT = {i + 1: five(line)[0] for i, line in enumerate(SEVEN)}
FAR = 9.0


def judged(errors: Mapping[tuple[int, int, float], float], standard: str = "ISO 10360-2:2009", further: int = 0,
           lines: int = 7, shuffled: int | None = None, rule: str = "ISO 14253-1") -> Statement:  # fmt: skip
    """Seven lines three times; with further repeats of the shortest length of the first line alone."""
    artefact = gauge(SEVEN[:lines], errors=errors)
    if further:
        points, first = artefact.points, gauge(SEVEN[:1], errors=errors, repeats=3 + further).points
        more = first.select((first.repeat > 3) & (first.point <= 2))
        both = Points(
            np.vstack([points.xyz, more.xyz]), np.concatenate([points.measurement, more.measurement]),
            np.concatenate([points.point, more.point]), np.concatenate([points.repeat, more.repeat]), points.machine,
            {name: np.concatenate([points.columns[name], more.columns[name]]) for name in points.columns},
        )  # fmt: skip
        artefact = StepGauge(artefact_facts(kind="step_gauge", length_mm=800.0, u_um="L/2000"), both)
    if shuffled is not None:
        rows = np.random.default_rng(shuffled).permutation(len(artefact.points))
        artefact = StepGauge(
            artefact_facts(kind="step_gauge", length_mm=800.0, u_um="L/2000"), artefact.points.select(rows)
        )
    facts = FACTS.model_copy(update={"standard": standard, "rule": rule})
    return statement(facts, artefact, {}, "[[conformity]] 1", [LENGTHS], None, STATED)


def outside(*where: tuple[int, int]) -> dict[tuple[int, int, float], float]:
    return {(line, repeat, SHORT[line]): FAR for line, repeat in where}


def test_one_of_three_is_to_be_measured_ten_times_more() -> None:
    found = judged(outside((1, 2)))
    assert (found.outcome, found.scope) == ("remeasure", "complete")
    assert (found.named.measurement, found.named.repeat, found.named.standing) == (1, 2, "again")
    assert any("measure 10 times more" in text and "measurement 1, 20 mm" in text for text in found.remarks)


def test_two_of_three_fail() -> None:
    assert judged(outside((1, 2), (1, 3))).outcome == "fail"


def test_five_lengths_may_be_measured_again_and_a_sixth_fails() -> None:
    assert judged(outside(*((line, 1) for line in range(1, 6)))).outcome == "remeasure"
    assert judged(outside(*((line, 1) for line in range(1, 7)))).outcome == "fail"


def test_a_length_that_fails_leaves_nothing_to_be_measured_again() -> None:
    found = judged(outside((1, 2), (2, 1), (2, 2)))
    assert found.outcome == "fail"
    assert not any("times more" in text for text in found.remarks)


@pytest.mark.parametrize(("further", "outcome"), [(9, "remeasure"), (10, "pass"), (11, "pass")])
def test_ten_more_that_lie_inside_decide_it(further: int, outcome: str) -> None:
    found = judged(outside((1, 2)), further=further)
    assert found.outcome == outcome
    assert len(found.errors) == 105 + further
    if outcome == "pass":
        assert [item.standing for item in found.errors].count("replaced") == 1
        assert any("was measured 10 times more, all inside: measurement 1, 20 mm" in text for text in found.remarks)
        assert found.named.error_um != pytest.approx(FAR)


@pytest.mark.parametrize("late", [4, 9, 13])
def test_one_of_the_ten_outside_fails(late: int) -> None:
    assert judged(outside((1, 2), (1, late)), further=10).outcome == "fail"


def test_one_of_the_ten_too_near_to_the_limit_is_undecided() -> None:
    """2.56 of 2.5667 µm with u = 0.01: 75 %."""
    errors = {**outside((1, 2)), (1, 7, SHORT[1]): 2.56}
    assert judged(errors, further=10).outcome == "undecided"


def test_an_incomplete_test_is_measured_again_too_and_says_what_it_lacks() -> None:
    found = judged(outside((1, 2)), lines=3)
    assert (found.outcome, found.scope) == ("remeasure", "partial")


@pytest.mark.parametrize(("standard", "outcome"), [
    ("ASME B89.4.10360.2-2008", "remeasure"), ("VDI/VDE 2617", "remeasure"), ("VDI/VDE 2617-2.1", "fail"),
])  # fmt: skip
def test_which_standards_measure_again(standard: str, outcome: str) -> None:
    assert judged(outside((1, 2)), standard).outcome == outcome


@pytest.mark.parametrize("further", [0, 10])
def test_the_order_of_the_rows_is_no_matter(further: int) -> None:
    errors = {**outside((1, 2)), (2, 1, five(SEVEN[1])[-1]): 4.0}
    plain, mixed = judged(errors, further=further), judged(errors, further=further, shuffled=1)
    assert (mixed.outcome, mixed.missing, mixed.remarks) == (plain.outcome, plain.missing, plain.remarks)
    assert mixed.joint == pytest.approx(plain.joint, abs=1e-9)
    assert sorted(item.error_um for item in mixed.errors) == pytest.approx(
        sorted(item.error_um for item in plain.errors), abs=1e-6
    )


def graded(first: float, second: float, further: int, rule: str) -> str:
    """Errors of two of the three repeats of 20 mm, limit 2.5667 µm, u = 0.01 µm."""
    errors = {(1, 1, SHORT[1]): first, (1, 2, SHORT[1]): second}
    return judged(errors, further=further, rule=rule).finding


INSIDE, NEAR, OVER = 2.0, 2.56, 2.575
"""0.567 µm inside the limit, and 0.007 and 0.008 µm on either side of it, where u is 0.01 µm."""


@pytest.mark.parametrize(("rule", "near", "over", "both_over"), [
    ("ISO 14253-1", "undecided", "undecided", "undecided"),
    ("ILAC-G8 non-binary", "conditional pass", "remeasure", "conditional fail"),
    ("simple", "pass", "remeasure", "fail"),
])  # fmt: skip
def test_what_lies_just_beyond_the_limit_is_measured_again_where_it_is_outside(
    rule: str, near: str, over: str, both_over: str
) -> None:
    assert graded(INSIDE, INSIDE, 0, rule) == "pass"
    assert graded(NEAR, INSIDE, 0, rule) == near
    assert graded(OVER, INSIDE, 0, rule) == over
    assert graded(OVER, OVER, 0, rule) == both_over


@pytest.mark.long(but="ISO 14253-1")
@pytest.mark.parametrize("rule", ["ISO 14253-1", "ILAC-G8 non-binary", "ILAC-G8 binary", "simple"])
@pytest.mark.parametrize("further", [0, 9, 10])
def test_a_larger_error_never_improves_the_finding(rule: str, further: int) -> None:
    sizes = (INSIDE, NEAR, OVER, FAR)
    for second in sizes:
        found = [GRAVEST.index(graded(first, second, further, rule)) for first in sizes]
        assert found == sorted(found, reverse=True), (second, found)


@pytest.mark.parametrize("rule", ["ISO 14253-1", "ILAC-G8 non-binary"])
def test_ten_more_that_lie_inside_stand_for_a_value_near_the_limit_too(rule: str) -> None:
    assert graded(NEAR, INSIDE, 10, rule) == "pass"
    assert graded(NEAR, NEAR, 10, rule) == graded(NEAR, NEAR, 0, rule)
