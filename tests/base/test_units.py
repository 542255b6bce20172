"""Every unit that is printed stands in one table, with what D-SI and QIF call it and how large it is."""

from __future__ import annotations

import math
import pickle
import re

import pytest

from cmm_uq.analysis.conformity.accuracy import UNITS as OF_FIGURES
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.units import (
    ARCSECOND,
    MICROMETRE,
    PPM,
    PRINTED,
    UNITS,
    Unit,
    pint_units,
    printed_unit,
    unit,
    unit_as_written,
)
from cmm_uq.machine.physics.catalogue import EVERY
from cmm_uq.machine.physics.effect import Parameter
from tests.conftest import ROOT

SPELLED = {
    "1": "dimensionless", "10⁻⁶/K": "ppm/delta_degC", "1/K": "1/delta_degC", "°": "degree", "″": "arcsecond",
    "″/m": "arcsecond/m", "″/K": "arcsecond/delta_degC", "″/(m·K)": "arcsecond/m/delta_degC",
    "″/(m K)": "arcsecond/m/delta_degC", "K": "delta_degC", "°C": "delta_degC", "µm/°": "µm/degree",
    "″/(m·kg)": "arcsecond/m/kg",
}  # fmt: skip
"""As pint spells what it does not read as it is printed; a difference of temperatures."""


@pytest.mark.parametrize("symbol", UNITS)
def test_its_size_is_what_pint_says(symbol: str) -> None:
    found = pint_units().Quantity(1.0, SPELLED.get(symbol, symbol.replace("%", "percent"))).to_base_units().magnitude
    assert math.isclose(UNITS[symbol].si, found, rel_tol=1e-12)


@pytest.mark.filterwarnings("ignore")  # the parser warns of its own tables when it is loaded
@pytest.mark.parametrize("symbol", UNITS)
def test_its_d_si_is_valid_and_of_the_same_size(symbol: str) -> None:
    """By the parser of PTB, where it is installed."""
    dsi = pytest.importorskip("dsi_unit")
    found = dsi.DsiUnit(UNITS[symbol].dsi)
    assert found.valid
    assert not found.warnings
    assert math.isclose(found.to_base_unit_tree().scale_factor, UNITS[symbol].si, rel_tol=1e-9)


def test_the_factors_used_inside_are_the_same() -> None:
    assert math.isclose(unit("µm").si, MICROMETRE * unit("mm").si)
    assert unit("″").si == ARCSECOND
    assert unit("ppm").si == PPM


def test_no_two_units_are_called_the_same_but_for_the_two_ways_to_print_one() -> None:
    twice = {one for one in UNITS for other in UNITS if one != other and UNITS[one].dsi == UNITS[other].dsi}
    assert twice == {"″/(m·K)", "″/(m K)"}
    assert all(
        one.qif and (one.qif == other.qif) == (one.dsi == other.dsi)
        for one in UNITS.values()
        for other in UNITS.values()
    )


@pytest.mark.parametrize("name", EVERY)
def test_every_parameter_of_every_effect_has_one(name: str) -> None:
    assert all(
        isinstance(parameter.unit, Unit) and UNITS[parameter.unit] is parameter.unit
        for parameter in EVERY[name].reported
    )


def test_every_ending_of_a_name_and_every_figure_of_performance_has_one() -> None:
    assert all(isinstance(found, Unit) for found in (*PRINTED.values(), *OF_FIGURES.values()))
    assert (printed_unit("b89_range_um"), printed_unit("length_budget.count")) == ("µm", "")


def test_another_package_may_bring_a_unit_of_its_own() -> None:
    furlong = Unit("furlong", r"\metre", "furlong", 201.168)
    assert Parameter("length_furlong", furlong, 1.0).unit is furlong
    assert Parameter("length_mm", "mm", 1.0).unit is UNITS["mm"]  # type: ignore[arg-type]


def test_an_unknown_unit_is_refused_with_those_that_there_are() -> None:
    with pytest.raises(CmmUqError, match="'furlong' is no unit of the table"):
        unit("furlong")


def test_a_unit_of_the_user_s_choice_is_that_of_the_table_or_as_it_was_written() -> None:
    assert unit_as_written("mm") is UNITS["mm"]
    assert not isinstance(unit_as_written("furlong"), Unit)
    assert unit_as_written("") == ""


def test_a_unit_survives_pickling_with_all_that_it_says() -> None:
    again = pickle.loads(pickle.dumps(unit("µm")))
    assert (again, again.dsi, again.qif, again.si) == ("µm", r"\micro\metre", "micrometer", 1e-6)


def test_no_module_asks_for_a_unit_that_the_table_lacks() -> None:
    units = {
        unit
        for path in (ROOT / "cmm_uq").rglob("*.py")
        for unit in re.findall(r'\bunit\("([^"]*)"\)', path.read_text("utf-8"))
    }
    assert units <= set(UNITS)
