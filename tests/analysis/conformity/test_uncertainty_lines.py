"""A pass needs every line of the test uncertainty that applies, stated above zero or answered for by somebody."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from cmm_uq.analysis.conformity.standards import statement
from cmm_uq.analysis.conformity.statement import Statement
from cmm_uq.analysis.conformity.uncertainty import LENGTH_LINES, u_of_unstated
from cmm_uq.artefacts import artefact_facts
from cmm_uq.base.points import Points
from cmm_uq.jobs.tables.conformity import (
    Circumstances,
    ConformityFacts,
    NegligibleLines,
    RatedConditions,
    TestUncertainty,
)
from cmm_uq.machine.model.artefact import Artefact
from cmm_uq.machine.model.kind import BARS, FORMS, LENGTHS
from cmm_uq.maths.uncertainty.quantity import Quantity
from tests.analysis.conformity.recorded import bars, gauge, sphere

ISO, B89, ISO_5 = "ISO 10360-2:2009", "ASME B89.4.1-1997", "ISO 10360-5:2020"
ARTEFACT = artefact_facts(kind="step_gauge", length_mm=800.0, u_um=0.4)
BY = {"by": "A. Muster", "reason": "worked out by hand"}
RATED = RatedConditions.model_validate({"declared": BY})
WHOLE = {"u_cte_per_k": 1e-7, "u_temperature_k": 0.01, "u_alignment_um": 0.01, "u_fixturing_um": 0.01, "u_repeat_um": 0.05,
         "u_form_um": 0.02}  # fmt: skip
TESTS: Mapping[str, tuple[str, str, Any, tuple[str, ...]]] = {
    "E0": (ISO, "E0", gauge, ("u_cte_per_k", "u_temperature_k", "u_alignment_um", "u_fixturing_um")),
    "U1": ("VDI/VDE 2617-2.1", "U1", gauge, ("u_cte_per_k", "u_temperature_k", "u_alignment_um", "u_fixturing_um")),
    "size": (ISO_5, "P_Size", sphere, ("u_cte_per_k", "u_temperature_k")),
    "form": (ISO_5, "P_Form", sphere, ("u_form_um",)),
}


def decided(
    artefact: Artefact, under: Circumstances, standard: str = ISO, name: str | None = None, **wish: Any
) -> Statement:
    facts = ConformityFacts.model_validate({"standard": standard, "characteristic": name, "limit_um": 10.0} | wish)
    span = {"b89_range_um": Quantity(5.0, 3.0, (0.0, 9.0), "µm")}
    return statement(facts, artefact, span, "[[conformity]] 1", (BARS, FORMS, LENGTHS), None, under)


def under(**changed: Any) -> Circumstances:
    stated = {key: value for key, value in (WHOLE | changed).items() if value is not None}
    return Circumstances(TestUncertainty.model_validate(stated), RATED, cte_per_k=11.5e-6)


def without(artefact: Artefact, *columns: str) -> Artefact:
    points = artefact.points
    kept = {name: values for name, values in points.columns.items() if name not in columns}
    artefact.points = Points(points.xyz, points.measurement, points.point, points.repeat, points.machine, kept)
    return artefact


@pytest.mark.parametrize("test", TESTS)
def test_each_line_left_out_makes_the_test_incomplete_and_names_its_key(test: str) -> None:
    standard, name, artefact, lines = TESTS[test]
    whole = decided(artefact(), under(), standard, name)
    assert (whole.outcome if test == "E0" else whole.finding) == "pass"
    assert not any("uncertainty" in text for text in whole.missing)
    for line in lines:
        found = decided(artefact(), under(**{line: None}), standard, name)
        assert (found.finding, found.outcome) == ("pass", "incomplete")
        (lack,) = (text for text in found.missing if text.startswith("uncertainty: "))
        assert "[" not in lack  # a customer reads it
        (told,) = (text for text in found.missing_with_remedies if text.startswith("uncertainty: "))
        assert f"{line} in [test_uncertainty]" in told


def test_a_line_is_declared_negligible_or_the_machine_s_own_by_name_and_reason() -> None:
    declared = under(u_alignment_um=None, negligible={"alignment": BY})
    found = decided(gauge(), declared)
    assert (found.outcome, found.missing) == ("pass", ())
    assert "Alignment of the artefact: declared negligible by A. Muster: worked out by hand." in found.remarks
    assert found.budget is not None
    assert "alignment of the artefact (declared negligible)" in [line.name for line in found.budget.lines]
    own = under(u_temperature_k=None, u_cte_per_k=None, machine={"temperature": BY, "expansion": BY})
    found = decided(without(gauge(), "temp_artefact_c"), own)
    assert (found.outcome, found.missing) == ("pass", ())
    assert "Temperature of the artefact: declared the machine's own by A. Muster: worked out by hand." in found.remarks


def test_of_a_form_its_calibration_is_what_is_declared_and_not_the_form_itself() -> None:
    found = decided(sphere(), under(u_form_um=None, negligible={"form": BY}), ISO_5, "P_Form")
    assert found.budget is not None
    assert [line.name for line in found.budget.lines][:2] == [
        "form of the test sphere, F/2", "calibration of the form (declared negligible)",
    ]  # fmt: skip


@pytest.mark.parametrize(("columns", "lack"), [
    (("temp_artefact_c",), "temperature of the artefact during the test was not recorded"),
    (("approach_x", "approach_y", "approach_z"), "from which side each end was reached is not recorded"),
])  # fmt: skip
def test_what_was_not_recorded_is_missing(columns: tuple[str, ...], lack: str) -> None:
    found = decided(without(gauge(), *columns), under())
    assert (found.finding, found.outcome) == ("pass", "incomplete")
    assert len(found.missing) == 1
    assert lack in found.missing[0]


@pytest.mark.parametrize("cte", [None, 0.0])
def test_an_expansion_that_is_not_stated_is_not_that_of_steel(cte: float | None) -> None:
    found = decided(gauge(), replace(under(), cte_per_k=cte))
    assert found.outcome == "incomplete"
    assert found.missing == ("uncertainty: the expansion coefficient of the artefact is not stated",)


def test_rated_conditions_that_nobody_states_are_missing() -> None:
    found = decided(gauge(), replace(under(), rated=RatedConditions()))
    assert found.outcome == "incomplete"
    assert found.missing == ("rated conditions: the temperatures for which the limits hold are not stated",)


@pytest.mark.parametrize(("lengths", "spread"), [
    ((20.0, 30.0, 40.0, 50.0, 800.0), False),
    ((20.0, 21.5, 23.0, 24.5, 800.0), False),
    ((20.0, 215.0, 410.0, 605.0, 800.0), True),
    ((30.0, 100.0, 300.0, 500.0, 700.0), True),
    ((20.0, 30.0, 40.0, 50.0, 215.0, 410.0, 605.0, 800.0), True),
    ((20.0, 21.5, 23.0, 410.0, 800.0), False),
])  # fmt: skip
def test_lengths_are_spread_over_the_range(lengths: tuple[float, ...], spread: bool) -> None:
    """Equally spaced five of 20 to 800 mm lie 195 mm apart: each within 146 mm of its place."""
    found = decided(gauge([np.eye(3)[0]], [list(lengths)]), under(), "VDI/VDE 2617-2.1", "U1")
    assert any(text.startswith("lengths spread over the range") for text in found.missing) != spread


# --- ranges -----------------------------------------------------------------------------------------------------------


def test_a_range_is_uncertain_by_what_changes_between_readings() -> None:
    """Of 300 mm, 0.1 K and 0.2 µm: √2 · √(0.345² + 0.2²) = 0.564 µm; what is stated of the readings themselves is less."""
    lines = {"u_temperature_k": 0.1, "u_fixturing_um": 0.2}
    for repeat, u in ((None, 0.56396), (0.3, 0.3), (0.9, 0.56396)):
        found = decided(bars(), under(**lines, u_repeat_um=repeat), B89, limit_um=60.0)
        assert found.outcome == "pass"
        assert found.u_um == pytest.approx(u, rel=1e-4)


@pytest.mark.parametrize("left_out", ["u_temperature_k", "u_fixturing_um"])
def test_a_range_whose_bar_may_have_changed_is_incomplete(left_out: str) -> None:
    found = decided(bars(), under(u_repeat_um=None, **{left_out: None}), B89, limit_um=60.0)
    assert (found.finding, found.outcome) == ("pass", "incomplete")
    assert found.missing == (
        "uncertainty: what of the artefact changes between the readings is neither stated nor declared negligible",
    )


def test_a_range_that_somebody_answers_for_is_decided_without_an_uncertainty() -> None:
    nothing = replace(under(), uncertainty=TestUncertainty(negligible=NegligibleLines.model_validate({"repeat": BY})))
    for limit, outcome in ((5.1, "pass"), (4.9, "fail")):
        found = decided(bars(), nothing, B89, limit_um=limit)
        assert (found.outcome, found.u_um, found.missing) == (outcome, 0.0, ())


def test_a_length_with_one_repeat_has_no_range_and_is_named() -> None:
    artefact = gauge(repeats=3)
    points = artefact.points
    artefact = type(artefact)(
        ARTEFACT, points.select(~((points.measurement == 1) & (points.point == 6) & (points.repeat > 1)))
    )
    found = decided(artefact, under(), ISO, "R0")
    assert found.outcome == "incomplete"
    assert any(text.startswith("repeats of ") and text.endswith("in measurement 1") for text in found.missing)


# --- nothing left out improves the finding ------------------------------------------------------------------------------


@pytest.mark.long
@pytest.mark.parametrize(
    ("line", "most"),
    [("u_cte_per_k", 1e-6), ("u_temperature_k", 0.3), ("u_alignment_um", 1.0), ("u_fixturing_um", 1.0)],
)
def test_by_iso_14253_1_a_line_that_is_not_stated_makes_no_fail(line: str, most: float) -> None:
    """Stated up to 0.3 K, 10⁻⁶/K or 1 µm and then left out, it leaves no value failed that was not."""
    for error in np.arange(10.0, 14.0, 0.25):
        artefact = gauge(errors={(1, r, 20.0): error for r in (1, 2, 3)})
        if decided(artefact, under(**{line: most})).finding != "fail":
            assert decided(artefact, under(**{line: None})).finding != "fail", error


def test_what_is_not_stated_is_no_larger_than_a_laboratory_may_have_it() -> None:
    """Of 500 mm of steel at 22 °C: 0.3 K is 1.725 µm, 10⁻⁶/K over 2 K 1 µm; alignment and fixturing are 1 µm each."""
    warm = gauge()
    warm.points.columns["temp_artefact_c"][:] = 22.0
    alone = {"temperature": 500e3 * 11.5e-6 * 0.3, "expansion": 500e3 * 2 * 1e-6, "alignment": 1.0, "fixturing": 1.0}
    keys = {"temperature": "u_temperature_k", "expansion": "u_cte_per_k", "alignment": "u_alignment_um",
            "fixturing": "u_fixturing_um"}  # fmt: skip
    for line, u in alone.items():
        assert u_of_unstated(LENGTH_LINES, warm, under(**{keys[line]: None}), 500.0) == pytest.approx(u)
    none = under(**dict.fromkeys(keys.values()))
    assert u_of_unstated(LENGTH_LINES, warm, none, 500.0) == pytest.approx(np.sqrt(sum(u**2 for u in alone.values())))
    assert u_of_unstated(LENGTH_LINES, warm, under(), 500.0) == 0.0


def test_two_and_a_half_limits_fail_whatever_is_not_stated() -> None:
    none = under(**dict.fromkeys(("u_cte_per_k", "u_temperature_k", "u_alignment_um", "u_fixturing_um")))
    artefact = gauge(errors={(1, r, 20.0): 25.0 for r in (1, 2, 3)})
    assert decided(artefact, none).finding == "fail"


def test_a_line_is_not_stated_and_declared_at_once() -> None:
    for given in ({"negligible": {"alignment": BY}}, {"machine": {"fixturing": BY}}):
        with pytest.raises(ValueError, match="is stated more than once"):
            under(**given)
    with pytest.raises(ValueError, match="must not be empty"):
        under(u_alignment_um=None, negligible={"alignment": {"by": " ", "reason": "x"}})
