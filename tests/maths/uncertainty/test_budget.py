"""Budgets: sums, shares, nesting and what a page shows."""

from __future__ import annotations

from math import inf, sqrt

import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.maths.uncertainty.budget import (
    CERTIFICATE,
    HEADINGS,
    JUDGEMENT,
    REPEATS,
    Budget,
    BudgetLine,
    budget_of,
    joint_line,
)
from cmm_uq.maths.uncertainty.distributions import normal
from cmm_uq.maths.uncertainty.measurement_model import MeasurementModel
from cmm_uq.maths.uncertainty.propagation import first_order, second_order


def end_gauge() -> Budget:
    """JCGM 100:2008 table H.1, with the calibration of d as a budget of its own (H.1.3.2), nm."""
    d = Budget(
        "d",
        [
            BudgetLine("repeated observations", 5.8, REPEATS, dof=24),
            BudgetLine("random effects of the comparator", 3.9, CERTIFICATE, dof=5),
            BudgetLine("systematic effects of the comparator", 6.7, CERTIFICATE, dof=8),
        ],
        215.0,
    )
    return Budget(
        "l",
        [
            BudgetLine("standard", 25.0, CERTIFICATE, 50000623.0, "nm", dof=18),
            d.as_line("difference"),
            BudgetLine(
                "expansion", 1e-6 / sqrt(3), JUDGEMENT, 0.0, "1/°C", "rectangular", 50, sensitivity=50000623 * 0.1
            ),
            BudgetLine(
                "temperature", 0.05 / sqrt(3), JUDGEMENT, 0.0, "°C", "rectangular", 2, sensitivity=-50000623 * 11.5e-6
            ),
        ],
        50000838.0,
        "nm",
        coverage=0.99,
    )


def test_the_end_gauge_of_annex_h1() -> None:
    budget = end_gauge()
    assert budget.lines[1].u == pytest.approx(9.7, abs=0.05)
    assert budget.lines[1].dof == pytest.approx(25.6, abs=0.2)  # H.1.6, there from the rounded 9.7 nm
    assert budget.u == pytest.approx(32, abs=0.5)
    assert budget.dof == pytest.approx(16.75, abs=0.005)
    assert budget.k == pytest.approx(2.92, abs=5e-3)
    assert budget.expanded == pytest.approx(92.5, abs=0.05)  # 93 there, from the rounded u


def test_shares_add_up_to_one_and_nested_ones_to_their_line() -> None:
    rows = end_gauge().as_dataframe().to_dict("records")
    assert sum(row["share"] for row in rows if row["depth"] == 0) == pytest.approx(1)
    nested = [row["share"] for row in rows if row["depth"] == 1]
    assert len(nested) == 3
    assert sum(nested) == pytest.approx(rows[1]["share"])


def test_nesting_does_not_change_the_degrees_of_freedom() -> None:
    budget = end_gauge()
    flat = [line for line in budget.lines if line.parts is None] + list(budget.lines[1].parts.lines)
    assert Budget("l", flat).dof == pytest.approx(budget.dof)


def test_correlations_are_lines_that_may_take_away() -> None:
    model = MeasurementModel(
        lambda a, b: a - b, {"a": normal(1.0, 3.0), "b": normal(1.0, 4.0)}, correlation={("a", "b"): 0.5}
    )
    budget = budget_of(model, first_order(model))
    assert [line.name for line in budget.lines] == ["a", "b", "correlation of a, b"]
    assert budget.lines[2].part == pytest.approx(-12)
    assert budget.lines[2].contribution == pytest.approx(-sqrt(12))
    assert budget.u == pytest.approx(sqrt(13))
    assert sum(budget.shares) == pytest.approx(1)


def test_complete_cancellation_leaves_nothing() -> None:
    model = MeasurementModel(
        lambda a, b: a - b, {"a": normal(1.0, 0.3), "b": normal(1.0, 0.3)}, correlation={("a", "b"): 1.0}
    )
    budget = budget_of(model, first_order(model))
    assert budget.u == 0
    assert budget.shares == [0, 0, 0]


def test_terms_of_second_order_are_lines() -> None:
    model = MeasurementModel(lambda x, y: x * y + x**3, {"x": normal(0.0, 0.1), "y": normal(2.0, 0.2)})
    found = second_order(model)
    budget = budget_of(model, found)
    assert [line.name for line in budget.lines] == ["x", "y", "second order: x, y", "third derivatives"]
    assert budget.u == pytest.approx(found.u[0])


def test_a_dataframe_has_a_row_a_line() -> None:
    table = end_gauge().as_dataframe()
    assert list(table["quantity"]) == [
        "standard", "difference", "repeated observations", "random effects of the comparator",
        "systematic effects of the comparator", "expansion", "temperature",
    ]  # fmt: skip
    assert table["dof"].min() == 2


def test_rows_of_text() -> None:
    rows = end_gauge().as_text()
    assert all(len(row) == len(HEADINGS) for row in rows)
    assert rows[0] == ("standard", "50000623", "25", "nm", "normal", "18", "1", "25", "62.3 %", "certificate")
    assert rows[2][0] == "\u2003repeated observations"
    assert rows[-1] == (
        "temperature", "0.000", "0.029", "°C", "rectangular", "2", "−575", "17", "27.5 %", "judgement",
    )  # fmt: skip
    joint = Budget("y", [BudgetLine("x", 1.0, JUDGEMENT), joint_line("correlation of a, b", -0.25)]).as_text()[1]
    assert joint == ("correlation of a, b", "", "", "", "", "", "", "−0.50", "−33.3 %", "model")


def test_what_no_line_can_be_is_refused() -> None:
    with pytest.raises(CmmUqError, match="budget line 'x'"):
        BudgetLine("x", -1.0, JUDGEMENT)
    with pytest.raises(CmmUqError, match="degrees of freedom"):
        BudgetLine("x", 1.0, JUDGEMENT, dof=0.5)
    with pytest.raises(CmmUqError, match="standard uncertainty of inf"):
        BudgetLine("x", inf, JUDGEMENT)
