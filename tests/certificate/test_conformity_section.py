"""What a certificate shows of statements of conformity: the formula of the limit, every value, the picture, the risks."""

from __future__ import annotations

import re

import numpy as np
import pytest

from cmm_uq.analysis.conformity.standards import statement
from cmm_uq.analysis.conformity.statement import Statement
from cmm_uq.certificate.document import DecisionBlock, Plot, Table
from cmm_uq.certificate.sections.conformity import conformity_section, decision_block, formula
from cmm_uq.jobs.tables.conformity import ConformityFacts, MaximumPermissibleError, Prior
from cmm_uq.machine.model.kind import BARS, LENGTHS
from tests.analysis.conformity.recorded import STATED, gauge

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
    assert "with nothing known of such machines" not in decision_block(found).explanation


def test_values_of_one_length_have_no_picture() -> None:
    """Two of 20 mm: nothing opens with the length."""
    artefact = gauge(list(np.eye(3)[:2]), [[20.0]] * 2, errors={(1, 2, 20.0): 2.40})
    found = statement(
        ConformityFacts(standard="ISO 10360-2:2009", mpe=MPE), artefact, {}, "[[conformity]] 1", (LENGTHS,)
    )
    assert not any(isinstance(block, Plot) for block in conformity_section([found]).blocks)
