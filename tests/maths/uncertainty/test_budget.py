"""Budgets, and the analysis of variance of readings in groups."""

from __future__ import annotations

from math import inf, sqrt

import numpy as np
import pytest
from scipy import stats

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import say
from cmm_uq.base.units import unit
from cmm_uq.maths.uncertainty.budget import (
    CERTIFICATE,
    HEADINGS,
    JUDGEMENT,
    REPEATS,
    Budget,
    BudgetLine,
    OneWay,
    budget_of,
    joint_line,
    one_way,
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


RESISTIVITY = np.array([
    [196.3052, 196.1240, 196.1890, 196.2569, 196.3403], [196.3042, 196.3825, 196.1669, 196.3257, 196.0422],
    [196.1303, 196.2005, 196.2889, 196.0343, 196.1811], [196.2795, 196.1748, 196.1494, 196.1485, 195.9885],
    [196.2119, 196.1051, 196.1850, 196.0052, 196.2090],
])  # fmt: skip
"""NIST Statistical Reference Datasets, analysis of variance, SiRstv: five instruments, five readings of each.

Compared number by number, with the certified values below, with the file ``SiRstv.dat`` as SciPy ships it.
"""

DAYS = 10.0 + 1e-6 * np.array([172, 116, 13, 144, 106, 31, 60, 125, 163, 41])
SCATTER = 1e-6 * np.array([60, 77, 111, 101, 67, 93, 80, 73, 88, 86])
"""JCGM 100:2008, table H.9: daily means of a Zener voltage and standard deviations of five readings each, V.

Compared number by number with what the tests of Sandia's Suncal have of that table; the GUM itself was not at hand. Both were
typed by hand, but grand mean, 57 µV, 85 µV and F = 2.25, which it prints, follow from these numbers.
"""


def of_table(table: np.ndarray) -> OneWay:
    return one_way(table.ravel(), np.repeat(np.arange(len(table)), table.shape[1]))


def test_mean_squares_are_those_that_nist_certifies() -> None:
    found = of_table(RESISTIVITY)
    assert found.between == pytest.approx(1.27865654000000e-02, rel=1e-9)
    assert found.within == pytest.approx(1.08318280000000e-02, rel=1e-9)
    assert pytest.approx(1.18046237440255, rel=1e-9) == found.F
    assert found.s_repeat == pytest.approx(1.04076068334656e-01, rel=1e-9)


def test_annex_h_5_of_the_gum() -> None:
    """Readings that have the printed means and standard deviations: F = 2.25, s_B = 43 µV, u = 18 µV."""
    shape = np.array([-2.0, -1, 0, 1, 2]) / np.std([-2.0, -1, 0, 1, 2], ddof=1)
    found = of_table(DAYS[:, None] + SCATTER[:, None] * shape)
    assert found.mean == pytest.approx(10.000097, abs=0.5e-6)
    assert found.s_repeat == pytest.approx(85e-6, abs=0.5e-6)
    assert np.std(DAYS, ddof=1) == pytest.approx(57e-6, abs=0.5e-6)
    assert sqrt(found.between) == pytest.approx(128e-6, abs=0.5e-6)
    assert pytest.approx(2.25, abs=0.05) == found.F  # of rounded figures, as it is printed
    assert found.s_group == pytest.approx(43e-6, abs=0.5e-6)
    assert found.u_mean == pytest.approx(18e-6, abs=0.5e-6)
    assert found.dof_mean == 9


def test_its_line_is_the_mean_s_uncertainty_with_both_parts() -> None:
    found = of_table(RESISTIVITY)
    line = found.line(say("all"), say("groups"), say("repeats"), unit("mm"), 3.0)
    assert line.u == pytest.approx(found.u_mean)
    assert line.dof == 4
    assert line.part == pytest.approx(9 * found.between / 25)
    budget = Budget(say("mean"), [line])
    assert [share for _, _, share in budget.flat()] == pytest.approx([1.0, 1 - 1 / found.F, 1 / found.F])


def test_groups_that_are_more_alike_than_their_readings_count_as_none() -> None:
    found = of_table(np.array([[0.0, 2.0], [0.5, 1.5]]))
    assert found.s_group == 0
    assert found.u_mean == pytest.approx(sqrt(found.within / 4))
    assert found.dof_mean == 2
    assert found.dof_single == 2
    assert found.u_single == pytest.approx(found.s_repeat)


def test_one_reading_in_a_group_of_its_own() -> None:
    """s² between and within add up; their degrees of freedom by Welch and Satterthwaite of the two mean squares."""
    found = of_table(RESISTIVITY)
    a, b = found.between / 5, 0.8 * found.within
    assert found.u_single == pytest.approx(sqrt(a + b))
    assert found.dof_single == pytest.approx((a + b) ** 2 / (a**2 / 4 + b**2 / 20))


@pytest.mark.parametrize("between", [0.0, 0.3, 1.0, 3.0])
def test_intervals_of_the_mean_hold_at_least_95_percent_where_groups_are_few(between: float) -> None:
    """Four groups of five readings, 20 000 times: the study of the module's rule, whose least was 94.7 %."""
    random, n = np.random.default_rng(5), 20_000
    x = between * random.standard_normal((n, 4, 1)) + random.standard_normal((n, 4, 5))
    means = x.mean(axis=2)
    squares = 5 * means.var(axis=1, ddof=1), np.sum((x - means[:, :, None]) ** 2, axis=(1, 2)) / 16
    found = [OneWay(4, 5, float(m.mean()), float(b), float(w)) for m, b, w in zip(means, *squares, strict=True)]
    k = {dof: stats.t.ppf(0.975, dof) for dof in (3.0, 16.0)}
    held = np.mean([abs(one.mean) <= k[one.dof_mean] * one.u_mean for one in found])
    assert held > 0.947 - 4 * sqrt(0.05 * 0.95 / n)


@pytest.mark.parametrize("group", [[1, 1, 1, 1], [1, 1, 1, 2], [1, 2, 3, 4], [1, 1, 1, 2, 2]])
def test_too_few_or_unequal_groups_are_refused(group: list[int]) -> None:
    with pytest.raises(CmmUqError, match="groups with"):
        one_way(np.arange(len(group), dtype=float), group)
