"""Statements of conformity, their budget, and the machine as found and as left."""

from __future__ import annotations

import re
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
import pytest

from cmm_uq.analysis.conformity.standards import statement
from cmm_uq.analysis.conformity.statement import NOT_DETERMINED, Statement
from cmm_uq.app.commands.report import outcome_of
from cmm_uq.base.messages import Text, say
from cmm_uq.base.units import unit
from cmm_uq.certificate.document import DecisionBlock, Document, Plot, Table
from cmm_uq.certificate.result import Outcome, Result
from cmm_uq.certificate.sections.conformity import budget_table, conformity_section, decision_block, formula
from cmm_uq.certificate.sections.results import overview_of
from cmm_uq.jobs.reports import AsFound
from cmm_uq.jobs.tables.conformity import ConformityFacts, Prior
from cmm_uq.jobs.tables.length_formula import MaximumPermissibleError
from cmm_uq.jobs.verdicts import Verdict, Verdicts
from cmm_uq.machine.model.kind import BARS, LENGTHS
from cmm_uq.maths.uncertainty.budget import JUDGEMENT, Budget, BudgetLine
from cmm_uq.maths.uncertainty.budgets.machine import length_test_uncertainty
from tests.analysis.conformity.recorded import STATED, gauge
from tests.artefacts.reading import tables
from tests.artefacts.simulated import analysed
from tests.jobs.test_reports import FOUND

MPE = MaximumPermissibleError(a_um=2.5, k=300.0)
ERRORS = {(1, 2, 20.0): 2.40, (1, 3, 800.0): -4.99, (2, 1, 400.0): 6.5}


def stated(u_um: float | None = 0.4, **wish: object) -> Statement:
    facts = ConformityFacts(standard="ISO 10360-2:2009", **({"mpe": MPE} | wish))
    artefact = gauge(list(np.eye(3)[:2]), [[20.0, 800.0], [20.0, 400.0]], errors=ERRORS, u_um=u_um)
    return statement(facts, artefact, {}, "[[conformity]] 1", (BARS, LENGTHS), None, STATED)


def blocks(found: Statement) -> tuple[DecisionBlock, Plot, Table]:
    section = conformity_section([found])
    decision, plot, table = section.blocks[:3]
    assert isinstance(decision, DecisionBlock)
    assert isinstance(plot, Plot)
    assert isinstance(table, Table)
    return decision, plot, table


@dataclass
class Stated:
    """Statements by themselves."""

    statements: tuple[Statement, ...]
    verdicts: Verdicts


def first_page(*verdicts: Verdict, statements: tuple[Statement, ...] = ()) -> tuple[str, list[str]]:
    overview = overview_of(Stated(statements, Verdicts(verdicts)))
    assert overview is not None
    return str(overview.verdict), [str(text) for _, text in overview.rows]


@pytest.mark.parametrize(("missing", "row"), [
    ((NOT_DETERMINED,), "undecided: not determined by this recording"),
    ((say("the length has no uncertainty"), say("a certificate from another machine")),
     "undecided: the length has no uncertainty; a certificate from another machine"),
])  # fmt: skip
def test_what_stands_in_the_way_of_a_tolerance_is_said_and_nothing_else(missing: tuple[Text, ...], row: str) -> None:
    """Of 79 ± 40 ppm within 150 the first page said that it was not determined, and nearer to its limit than that."""
    one = Verdict("scale_x.ppm", "undecided", None, None, 150.0, unit("ppm"), missing=missing)
    verdict, rows = first_page(one)
    assert verdict == "Not decided"
    assert rows[0] == row
    near = replace(one, value=120.0, U=40.0, missing=())
    assert first_page(near)[0] == "Not decided: the value is nearer to its limit than its uncertainty"
    assert first_page(near, one)[0].startswith(
        "Not decided: the value is nearer to its limit than its uncertainty: 2 of 2"
    )


def test_an_uncertainty_that_leaves_no_value_to_accept_is_said_so() -> None:
    """0.5 of 4 ± 4 µm lies far from its limit."""
    found = stated(u_um=40.0, rule="ASME B89.7.3.1")
    assert found.outcome == "undecided"
    verdict = Verdict("E0", found.outcome, found.value_um, 80.0, 4.0, unit("µm"), found.facts.standard)
    assert (
        first_page(verdict, statements=(found,))[0]
        == "Not decided: the uncertainty is too large for any value to be accepted"
    )


@pytest.mark.parametrize(("wish", "words"), [
    ({"limit_um": 4.5, "mpe": None}, "4.5 µm"), ({"limit_um": 1080.0012, "mpe": None}, "1080.0012 µm"),
    ({"mpe": MPE}, "(2.5 + L/300) µm, L in mm"),
    ({"mpe": MaximumPermissibleError(a_um=2.5, k=300.0, b_um=4.0)}, "the lesser of (2.5 + L/300) µm and 4 µm, L in mm"),
    ({"mpe": MaximumPermissibleError(b_um=4.0)}, "4 µm"),
])  # fmt: skip
def test_the_limit_is_given_by_its_formula(wish: dict[str, object], words: str) -> None:
    found = stated(**wish)
    assert formula(found.facts) == words
    assert words in decision_block(found).limit


def test_every_value_stands_in_the_table_with_the_row_of_its_length() -> None:
    found = stated()
    _, _, table = blocks(found)
    shown = {(row[0], row[1]): row for row in table.rows}
    assert set(shown) == {("1", "20"), ("1", "800"), ("2", "20"), ("2", "400")}
    values = sorted(float(text.replace("−", "-")) for row in table.rows for text in row[2].split(", "))
    assert values == pytest.approx(sorted(round(item.error_um, 2) + 0.0 for item in found.errors))
    assert "−4.99" in shown["1", "800"][2]
    assert shown["1", "800"][3:] == ("0.80", "67.1 %".replace(" ", "\u00a0"), "5.167", "undecided")


def test_the_value_to_be_measured_again_has_a_row_of_its_own() -> None:
    """6.5 of 3.833 µm at 400 mm."""
    _, _, table = blocks(stated())
    again = [row for row in table.rows if "to be measured again" in row[-1]]
    assert len(table.rows) == 5
    assert [row[2] for row in again] == ["+6.50"]
    assert again[0][-1] == "fail, to be measured again"


def test_without_an_uncertainty_the_table_has_no_columns_of_it() -> None:
    _, plot, table = blocks(stated(None, rule="simple"))
    assert [column.heading for column in table.columns] == ["Measurement", "Length", "Errors", "Limit", "Decision"]
    assert "bars: U" not in " ".join(plot.lettering)


def test_the_picture_counts_what_is_not_accepted_and_says_its_lines() -> None:
    _, plot, _ = blocks(stated())
    assert plot.alternative == "12 errors over length between the limits; 3 of them are not accepted."
    assert any("dashed: limits of acceptance" in text for text in plot.lettering)


def test_limits_open_with_length_like_a_trumpet() -> None:
    """The upper limit's line rises from 20 to 800 mm by 2.6 of its 2.567 µm: its ends, in the picture's own units."""
    _, plot, _ = blocks(stated())
    lines = [line for line in re.findall(r'<path d="(M [^"]*)"', plot.svg) if len(line.split("L")) == 3]
    ends = [[float(x) for x in re.findall(r"-?\d+\.?\d*", line)] for line in lines]
    rising = [p for p in ends if len(p) == 6 and p[5] < p[1] - 5]
    falling = [p for p in ends if len(p) == 6 and p[5] > p[1] + 5]
    assert rising
    assert falling
    assert rising[0][1] - rising[0][5] == pytest.approx(falling[0][5] - falling[0][1], abs=0.1)


def test_the_decision_says_how_probable_it_is_that_all_conform() -> None:
    text = decision_block(stated(rule="ISO 14253-1")).explanation
    assert "Probability that all 12 are, with what they share, by the measurement alone: " in text


def test_with_a_prior_the_decision_says_the_risks_of_all_machines() -> None:
    found = stated(prior=Prior(sd_um=2.0))
    assert found.risks is not None
    assert "Of all such machines, by the prior stated" in decision_block(found).explanation
    assert "without prior knowledge of such machines" not in decision_block(found).explanation


def test_values_of_one_length_have_no_picture() -> None:
    """Two of 20 mm: nothing opens with the length."""
    artefact = gauge(list(np.eye(3)[:2]), [[20.0]] * 2, errors={(1, 2, 20.0): 2.40})
    found = statement(
        ConformityFacts(standard="ISO 10360-2:2009", mpe=MPE), artefact, {}, "[[conformity]] 1", (LENGTHS,)
    )
    assert not any(isinstance(block, Plot) for block in conformity_section([found]).blocks)


def headings(table: Table) -> list[str]:
    return [column.heading for column in table.columns]


def test_a_calibration_alone_is_one_line_in_micrometres_and_nothing_else() -> None:
    table = budget_table(say("x"), length_test_uncertainty(800.0, 0.4e-3))
    assert headings(table) == ["Cause", "Contribution", "Origin"]
    assert table.columns[1].unit == unit("µm")
    assert table.rows == (("calibration of the artefact", "0.40", "certificate"),)
    assert [note for note in table.notes if "alignment of the artefact" in note]


def test_what_acts_through_a_temperature_has_its_own_unit_and_sensitivity() -> None:
    """800 mm · 11.5e-6 /K · 0.05 K = 0.46 µm; 800 mm · 3 K · 0.6e-6 /K = 1.44 µm; with 0.4 and 0.3 µm: u = 1.592 µm."""
    budget = length_test_uncertainty(
        800.0,
        0.4e-3,
        temperature_c=23.0,
        cte_per_k=11.5e-6,
        u_cte_per_k=0.6e-6,
        u_temperature_k=0.05,
        u_alignment_mm=0.3e-3,
    )
    table = budget_table(say("x"), budget)
    assert headings(table) == ["Cause", "Standard uncertainty", "Sensitivity", "Contribution", "Share", "Origin"]
    shown = {row[0]: row[1:4] for row in table.rows}
    assert shown == {
        "calibration of the artefact": ("0.40 µm", "1", "0.40"),
        "expansion coefficient of the artefact": ("0.60 10⁻⁶ /K", "2.4 µm per 10⁻⁶ /K", "1.4"),
        "temperature of the artefact": ("0.050 K", "9.2 µm per K", "0.46"),
        "alignment of the artefact": ("0.30 µm", "1", "0.30"),
    }
    assert [row[4] for row in table.rows] == ["6.3 %", "81.8 %", "8.3 %", "3.6 %"]
    assert table.notes[0] == "Combined: u = 1.6 µm."


def test_a_budget_in_micrometres_stays_in_them() -> None:
    two = BudgetLine(say("alignment, twice"), 0.5, JUDGEMENT, unit=unit("µm"), sensitivity=2**0.5)
    table = budget_table(say("x"), Budget(say("x"), [two], unit=unit("µm")))
    assert (table.rows[0][1], table.rows[0][3]) == ("0.50 µm", "0.71")
    assert float(table.rows[0][2]) == pytest.approx(2**0.5, abs=1e-3)


def adjusted(found: Any, before: dict[str, Any]) -> Outcome:
    """The certificate of a machine that showed something else before."""
    values = {field.name: getattr(found, field.name) for field in fields(found)}
    return outcome_of(type(found)(**values | {"job": replace(found.job, as_found=AsFound.model_validate(before))}))


@pytest.fixture(scope="module")
def outcome() -> Outcome:
    found = analysed("iota-1102-20C")
    assert isinstance(found, Result)
    return adjusted(found, FOUND)


def titles(document: Document) -> list[str]:
    return [section.title for section in document.sections]


def test_what_was_found_stands_beside_what_is_left_each_with_its_uncertainty(outcome: Outcome) -> None:
    """U as found is the larger distance to an end of the interval: 141 − 120 = 21 and 540 − 500 = 40."""
    left = {row[0]: row[1:3] for name in ("Figures of performance", "Error factors of the machine")
            for row in tables(outcome.document)[name].rows}  # fmt: skip
    name = "Range of the lengths, on average over repeats"
    assert tables(outcome.document)["The machine as found and as left"].rows == (
        (name, "500", "40", *left[name], "µm"),
        ("Scale error of X", "120", "21", *left["Scale error of X"], "ppm"),
    )
    assert tables(outcome.document)["Statements of conformity as found and as left"].rows == (
        ("ASME B89.4.1-1997, volumetric performance", "fail", "fail"),
    )


def test_what_nothing_determined_before_is_not_set_beside_what_is_left() -> None:
    free = FOUND | {"identifiability": {"undetermined": [{"scale_x.ppm": 0.7, "scale_y.ppm": 0.7}]}}
    rows = tables(adjusted(analysed_iota(), free).document)["The machine as found and as left"].rows
    assert "Scale error of X" not in [row[0] for row in rows]
    assert len(rows) == 1


def test_its_figures_stand_in_results_json(outcome: Outcome) -> None:
    found = outcome.results["as_found"]
    assert found["job"]["id"] == "before"
    assert found["estimates"]["scale_x"]["ppm"]["value"] == 120.0
    assert found["accuracy_uncertainty"]["b89_range_um"]["interval95"] == [460.0, 540.0]


def test_it_comes_before_what_the_results_rest_on(outcome: Outcome) -> None:
    order = titles(outcome.document)
    assert (
        order.index("Statements of conformity")
        < order.index("As found and as left")
        < order.index("Artefact and traceability")
    )


def test_a_machine_found_after_it_was_left_is_told() -> None:
    """The key of the job stands beside it for the laboratory, not on the certificate."""
    late = FOUND | {"job": {**FOUND["job"], "date": "2004-09-02"}}
    outcome = adjusted(analysed_iota(), late)
    said = "Dates out of order: the machine was found as it was after it was left, 2004-09-01 against 2004-09-02"
    assert f"{said}." in outcome.document.warnings
    assert f"{said} ([job] as_found)." in outcome.warnings


def analysed_iota() -> Any:
    return analysed("iota-1102-20C")


@pytest.mark.parametrize(("job", "group", "title"), [
    ("shift-simulated", "scale_x", "Mean sensitivity error of axis x"), ("shift-plate-simulated", "scale_x", "Scale of X"),
])  # fmt: skip
def test_an_axis_calibrated_by_shifting_has_it_too(job: str, group: str, title: str) -> None:
    before = FOUND | {"job": {"id": "before", "origin": "simulated"}}
    (row,) = tables(adjusted(analysed(job), before).document)["The machine as found and as left"].rows
    assert row[:3] == (title, "120", "21")


def test_without_it_there_is_no_such_section() -> None:
    assert "As found and as left" not in titles(outcome_of(analysed_iota()).document)
