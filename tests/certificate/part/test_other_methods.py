"""The page on other methods: its figures are those that were found, and every text can be said in other languages."""

from __future__ import annotations

from dataclasses import replace
from math import degrees, sqrt

import numpy as np
import pytest

from cmm_uq.analysis.parts.methods.method import (
    ComparedCharacteristic,
    MethodComparison,
    MethodFigure,
    MethodResult,
    MethodStatement,
)
from cmm_uq.analysis.parts.methods.of_job import compare_methods, methods_of
from cmm_uq.base.messages import say
from cmm_uq.base.units import ARCSECOND, unit
from cmm_uq.certificate.document import Paragraph, Section, Table
from cmm_uq.certificate.part.measurement import methods_data
from cmm_uq.certificate.part.method import methods_section
from cmm_uq.certificate.part.page import part_document
from cmm_uq.maths.uncertainty.budget import REPEATS, Budget, BudgetLine
from tests.certificate.parts_found import found_of, measured_points
from tests.certificate.saying import leaves, said
from tests.jobs.part.other_methods import SIZE, with_methods

pytestmark = pytest.mark.long  # all need what takes long to make


@pytest.fixture(scope="module")
def comparison() -> MethodComparison:
    job = with_methods()
    found = found_of(job, points=measured_points(job), draws=1000)
    one = compare_methods(found.stated, found.budget, methods_of(found.job, found.plan, found.measured))
    assert one is not None
    return one


@pytest.fixture(scope="module")
def section(comparison: MethodComparison) -> Section:
    return methods_section(comparison)


def table(section: Section, caption: str) -> Table:
    return next(block for block in section.blocks if isinstance(block, Table) and caption in block.caption)


def test_a_job_without_other_methods_has_no_such_section() -> None:
    assert methods_section(None).blocks == ()
    assert methods_data(None) is None


def test_each_method_has_a_row_with_value_u_and_U(comparison: MethodComparison, section: Section) -> None:  # noqa: N802
    rows = [row for row in table(section, "Lengths by each method").rows if row[0] == SIZE]
    assert [row[1] for row in rows] == ["The virtual measurements", "The calibrated part", "Several orientations"]
    u = 1e3 * sqrt(0.4e-3**2 + 1e-3**2 * 20 / 19 + 0.3e-3**2)
    assert rows[1][3:5] == (f"{u:.1f}", f"{2 * u:.1f}")
    stated = comparison.characteristics[0].stated
    assert float(rows[2][2]) == pytest.approx(stated[2].value, abs=1e-3)
    assert rows[0][5] == "–"
    pairs = {pair.other: pair.normalised for pair in comparison.characteristics[0].pairs if pair.one == "virtual"}
    assert float(rows[2][5].replace("−", "-")) == pytest.approx(pairs["orientations"], abs=0.006)


def test_why_is_said_for_each_characteristic(comparison: MethodComparison, section: Section) -> None:
    told = [block.text for block in section.blocks if isinstance(block, Paragraph)]
    for one in comparison.characteristics:
        assert f"Characteristic {one.name}: {' '.join(one.why)}" in told


def test_conditions_and_what_is_seen(section: Section) -> None:
    assert {row[2] for row in table(section, "Conditions of the tests").rows} == {"met"}
    seen = {row[0]: row[1:] for row in table(section, "takes hold").rows}
    assert seen["Errors of the machine"] == ("as known of it", "as a systematic error", "as scatter")
    assert seen["Stylus"][2] == "corrected by a standard"


def test_budgets_add_up_and_say_what_was_taken_off(section: Section) -> None:
    budget = table(section, "Budgets by the calibrated part")
    parts = {row[1]: row for row in budget.rows}
    assert parts["calibration of the workpiece"][2] == "0.40 µm"
    assert parts["together, k = 2.00"][4] == "100.0"
    shares = [float(row[4]) for row in budget.rows if not row[1].startswith("together")]
    assert sum(shares) == pytest.approx(100.0, abs=0.1 * len(shares))
    assert any("systematic error 3.0 µm, taken off" in note for note in budget.notes)


def test_it_says_which_descriptions_it_follows(section: Section) -> None:
    told = " ".join(block.text for block in section.blocks if isinstance(block, Paragraph))
    assert "The text of the standard was not at hand" in told
    assert "public summary of ISO/DTS 15530-2" in told


def test_it_stands_on_the_part_s_page(comparison: MethodComparison) -> None:
    job = with_methods()
    found = replace(found_of(job, points=measured_points(job), draws=500), methods=comparison)
    assert any(one.title == "Other methods beside it" for one in part_document(found).sections)


def test_angles_are_in_degrees_and_seconds() -> None:
    budget = Budget(
        say("b"), [BudgetLine(say("all"), 2 * ARCSECOND, REPEATS, unit=unit("rad"))], 0.0, unit("rad"), factor=2.0
    )
    figure = MethodFigure("a", budget, float(np.radians(30.0)))
    stating = MethodStatement("orientations", figure.value, figure.u, figure.U)
    one = MethodComparison(
        (MethodResult("orientations", (figure,), (), {}),), (ComparedCharacteristic("a", (stating,), (), ()),)
    )
    (row,) = table(methods_section(one), "Angles by each method").rows
    assert row[2:5] == ("30.0000", "2.0", "4.0")
    (data,) = methods_data(one)["methods"][0]["characteristics"]  # type: ignore[index]
    assert data["value"] == pytest.approx(30.0)
    assert data["u"] == pytest.approx(degrees(2 * ARCSECOND))


def test_of_many_characteristics_those_are_explained_whose_methods_differ_most() -> None:
    """Eight, of which the first two agree: the other six are told of, in the order of the plan."""
    many = []
    for i in range(8):
        apart = 1.0 if i < 2 else 2.0 + i
        stated = (
            MethodStatement("virtual", None, 1e-3, 2e-3),
            MethodStatement("calibrated_part", None, apart * 1e-3, 3e-3),
        )
        many.append(ComparedCharacteristic(f"c{i}", stated, (), (say("Because."),)))
    section = methods_section(MethodComparison((MethodResult("calibrated_part", (), (), {}),), tuple(many)))
    told = [block.text for block in section.blocks if isinstance(block, Paragraph) and "Because" in block.text]
    assert told == [f"Characteristic c{i}: Because." for i in range(2, 8)]
    assert any("6 characteristics whose methods differ most" in getattr(block, "text", "") for block in section.blocks)


def test_results_have_every_figure(comparison: MethodComparison) -> None:
    data = methods_data(comparison)
    assert data is not None
    one = data["methods"][0]["characteristics"][0]
    assert one["name"] == SIZE
    assert one["systematic_error"] == pytest.approx(3e-3)
    assert one["k"] == 2.0
    assert sum(line["share"] for line in one["budget"] if line["depth"] == 0) == pytest.approx(1.0)
    pair = comparison.characteristics[0].pairs[0]
    assert data["compared"][0]["normalised_errors"][0] == {
        "one": "virtual",
        "other": pair.other,
        "E_n": pair.normalised,
    }
    assert pair.normalised != 0


def test_every_text_can_be_translated(section: Section) -> None:
    assert not [text for text in leaves(section) if not said(text, "down")]
