"""The budget of a test value as a certificate shows it, against figures worked by hand."""

from __future__ import annotations

import pytest

from cmm_uq.base.messages import say
from cmm_uq.base.units import unit
from cmm_uq.certificate.document import Table
from cmm_uq.certificate.sections.conformity import budget_table
from cmm_uq.maths.uncertainty.budget import JUDGEMENT, Budget, BudgetLine
from cmm_uq.maths.uncertainty.budgets.machine import length_test_uncertainty


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
