"""Whatever form a DCC gives a value, its unit and its uncertainty in, the figures are the same; and what a person is shown."""

from __future__ import annotations

from decimal import Decimal
from pathlib import Path

import lxml.etree
import pytest

from cmm_uq.jobs.dcc import Certificate, certificate as dcc, read, written
from cmm_uq.jobs.dcc.certificate import DccQuantity, QuantityList, StatementMetadata
from cmm_uq.jobs.dcc.figures import (
    QuantityFigures,
    ValueUncertainty,
    _grid,
    _sentence,
    data,
    figures,
    shown,
    statements,
    unit_shown,
)  # fmt: skip
from cmm_uq.jobs.dcc.xml_file import checked_by_schema
from tests.conftest import ROOT
from tests.jobs.dcc.artefacts import BALL_BAR, MM, PLATE, SPHERE, STEP_GAUGE, TRIANGLE, issued, value
from tests.jobs.dcc.texts import rich, words

SCHEMAS = ROOT.parent / "shared" / "schemas"
D = Decimal
HALF = dcc.Expanded(uncertainty=D("0.010"), factor=D(2), probability=D("0.95"))


def of(given: object) -> tuple[QuantityFigures, ...]:
    """Figures of a quantity that is written and read again."""
    made = issued(DccQuantity(name=words("Q"), value=given))  # type: ignore[arg-type]
    return figures(read(written(made), "certificate.xml"))


ONE_VALUE = {
    "a value": dcc.Real(value=D("1.50"), unit=MM, uncertainty=HALF),
    "a value with an interval": dcc.Real(value=D("1.50"), unit=MM, uncertainty=dcc.Interval(
        standard=D("0.005"), low=D("1.49"), high=D("1.51"), probability=D("0.95"))),
    "a value of D-SI 2.2": dcc.Real(value=D("1.50"), unit=MM, uncertainty=dcc.Univariate(
        stated=dcc.StandardMU(standard=D("0.005")))),
    "a constant": dcc.Constant(value=D("1.50"), unit=MM, uncertainty=D("0.005")),
    "a list with one for all": dcc.RealList(values=(D("1.50"),), units=(MM,), uncertainty=dcc.IntervalList(
        standards=(D("0.005"),), lows=(D("1.49"),), highs=(D("1.51"),), probabilities=(D("0.95"),))),
    "a list of D-SI 2.2": dcc.RealList(values=(D("1.50"),), units=(MM,), uncertainty=dcc.UnivariateList(
        stated=dcc.StandardListMU(standards=(D("0.005"),)))),
    "the same expanded": dcc.RealList(values=(D("1.50"),), units=(MM,), uncertainty=dcc.UnivariateList(
        stated=dcc.ExpandedListMU(uncertainties=(D("0.010"),), factors=(D(2),), probabilities=(D("0.95"),)))),
    "the first of two units": dcc.Hybrid(values=(
        dcc.Real(value=D("1.50"), unit=MM, uncertainty=HALF), dcc.Real(value=D("0.0015"), unit=r"\metre"))),
    "a list one by one, with the list's unit and uncertainty": dcc.Lists(lists=(dcc.Reals(
        unit=MM, uncertainty=dcc.ListUncertainty(stated=HALF), values=(dcc.RealInList(value=D("1.50")),)),)),
}  # fmt: skip


@pytest.mark.parametrize("given", ONE_VALUE.values(), ids=list(ONE_VALUE))
def test_a_value_is_the_same_in_whichever_form_it_is_given(given: object) -> None:
    (found,) = of(given)
    assert (found.values, found.units, found.shown) == ((D("1.50"),), (MM,), "Calibration / Certified values / Q")
    assert str(found.values[0]) == "1.50"
    assert found.uncertainties[0].u == D("0.005")


def test_a_value_without_uncertainty_has_none() -> None:
    (found,) = of(dcc.Real(value=D(1), unit=MM))
    assert found.uncertainties[0].u is None


def test_one_uncertainty_and_one_unit_are_of_every_value_of_a_list() -> None:
    x = next(one for one in figures(PLATE) if one.name.startswith("X"))
    assert x.units == (MM,) * 4
    assert [stated.u for stated in x.uncertainties] == [D("0.0003")] * 4


def test_statements_of_lists_and_quantities_are_found_with_those_of_the_measurement() -> None:
    said = StatementMetadata(conformity="pass", norms=("ISO 10360-2:2009",), declaration=rich("within the limit"))
    inner = DccQuantity(name=words("Q"), value=dcc.Real(value=D(1), unit=MM), metadata=(said,))
    made = issued(QuantityList(parts=(inner,), metadata=(said,)))  # type: ignore[arg-type]
    (measurement,) = made.measurements
    assert [one.conformity for one in statements(measurement)] == ["pass", "pass"]
    assert data(made)["statements"][0]["rows"][0] == [
        "Statement",
        "ISO 10360-2:2009; conformity: pass; within the limit",
    ]


def test_a_person_is_shown_particulars_and_tables_with_printed_units() -> None:
    found = shown(STEP_GAUGE)
    rows = dict(found.rows)
    assert (rows["Certificate"], rows["Laboratory"]) == ("D-K-4711", "Laboratory, Braunschweig")
    assert (rows["Calibrated"], rows["Issued"], rows["Statement"]) == (
        "2026-03-01 to 2026-03-02",
        "2026-03-05",
        "2028-03-02",
    )
    ((title, _, (grid,)),) = found.parts
    assert (title, grid.title) == ("Calibration", "Certified values")
    assert grid.headings == ("Face", "Certified length / mm", "U / mm", "k")
    assert grid.rows[1] == ("2", "20.00013", "0.0002", "2")
    assert (unit_shown(r"\micro\metre"), unit_shown(r"\one"), unit_shown(r"\volt")) == ("µm", "", r"\volt")


def test_quantities_of_one_value_each_stand_below_each_other() -> None:
    ((_, _, (grid,)),) = shown(SPHERE).parts
    assert grid.headings == ("Quantity", "Value", "Unit", "U", "k")
    assert grid.rows == (("Diameter", "25.0012", "mm", "0.0002", "2"), ("Form deviation", "0.10", "µm", "0.05", "2"))


def test_of_our_own_certificate_a_row_is_a_factor_rounded_by_its_uncertainty_with_its_interval() -> None:
    """A program's ten digits, and an interval as a quantity of its own, are read as the certificate prints them."""
    ppm, U, k = r"\\micro\\metre\\metre\\tothe{-1}", D("41.75428998"), D("2.045335189")
    quantities = (
        QuantityFigures(("Scale error of Y",), "Scale error of Y", values=(D("110.4455423"),), units=(ppm,),
                        uncertainties=(ValueUncertainty(U, k),)),
        QuantityFigures((), "Scale error of Y, 95 % coverage interval", values=(D("110.4455423"),), units=(ppm,),
                        uncertainties=(ValueUncertainty(standard=D("20.4"), low=D("72.06276601"), high=D("152.19983")),)),
        QuantityFigures((), "Length", values=(D("83.00012"),), units=(MM,),
                        uncertainties=(ValueUncertainty(D("0.0006"), D(2)),)),
    )  # fmt: skip
    grid = _grid("Factors", quantities)
    place = grid.headings.index
    scale, length = grid.rows
    assert (scale[place("Quantity")], scale[place("Value")], scale[place("U")]) == ("Scale error of Y", "110", "42")
    assert (scale[place("k")], scale[place("Interval")]) == ("2.05", "72 to 152")
    assert (length[place("Value")], length[place("U")], length[place("k")]) == ("83.00012", "0.0006", "2")


def test_a_statement_is_read_rounded_by_its_uncertainty_and_an_interval_as_its_ends() -> None:
    """U = 14.142135624 of 339.8819116 µm are 340 and 14; an interval is no value by itself."""
    low, high = D("314.7"), D("368.0")
    stated = (
        QuantityFigures((), "worst", values=(D("339.8819116"),), units=(r"\micro\metre",),
                        uncertainties=(ValueUncertainty(D("14.142135624"), D(2)),)),
        QuantityFigures((), "largest", values=(D("341.4482868"),), units=(r"\micro\metre",),
                        uncertainties=(ValueUncertainty(low=low, high=high),)),
    )  # fmt: skip
    assert _sentence(stated) == "worst 340 µm, U = 14 (k = 2); largest 314.7 to 368.0 µm"


def test_data_keeps_the_digits_of_the_certificate() -> None:
    (nominal, length) = data(BALL_BAR)["quantities"]
    assert (nominal["values"], nominal["U"], nominal["u"]) == (["404"], [None], [None])
    assert (length["values"], length["U"], length["k"], length["p"]) == (["404.2357"], ["0.0030"], ["2"], ["0.95"])
    assert length["u"] == [0.0015]


@pytest.mark.skipif(not SCHEMAS.exists(), reason="PTB's schemas are not at hand")
@pytest.mark.parametrize("made", [BALL_BAR, SPHERE, STEP_GAUGE, PLATE, TRIANGLE])
def test_the_certificates_of_these_tests_are_valid_by_the_schema_of_ptb(made: Certificate) -> None:
    checked_by_schema(written(made), SCHEMAS, "certificate.xml")
    lxml.etree.fromstring(written(made))


def test_the_sample_of_the_documentation_is_one_of_them() -> None:
    sample = Path(ROOT / "docs" / "import" / "samples" / "plate-certificate.xml")
    assert sample.read_bytes() == written(PLATE)


def test_a_length_without_a_name_is_called_by_its_reference_type() -> None:
    (found,) = figures(issued(value("", "1", ref_type="basic_nominalValue")))
    assert found.ref_types == ("basic_nominalValue",)
