"""Units of text: checked and converted by pint, derived where the expression determines them."""

from __future__ import annotations

import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.maths.uncertainty.models.expression import parse
from cmm_uq.maths.uncertainty.models.input_keys import derived_unit, number_in, unit_of

UNITS = {"L": "mm", "M": "mm", "d": "nm", "a": "1/K", "t": "degC", "V": "V", "I": "A", "phi": "rad", "n": "1", "q": ""}


@pytest.mark.parametrize(
    ("text", "unit"),
    [
        ("L + M", "mm"),
        ("L - 20", "mm"),
        ("L*(1 + a*(t - 20))", "mm"),
        ("V/I*cos(phi)", "V/A"),
        ("sqrt(L**2 + M**2)", "mm"),
        ("L**2", "mm²"),
        ("atan2(L, M)", "rad"),
        ("abs(-L)", "mm"),
        ("exp(n) * 2", "1"),
        ("2**n", "1"),
        ("L/M", "1"),
        ("3 + 4", "1"),
        ("L + d", None),  # numbers of different units are added: whoever wrote it must say what comes out
        ("exp(L)", None),
        ("L + q", None),
        ("n**L", None),
        ("atan2(L, d)", None),
    ],
)
def test_derived_units(text: str, unit: str | None) -> None:
    assert derived_unit(parse(text, UNITS), UNITS) == unit


@pytest.mark.parametrize(
    ("text", "unit", "difference", "number"),
    [
        ("25 nm", "mm", True, 25e-6),
        ("1.5e-3 mm", "µm", True, 1.5),
        ("-0.2", "1", False, -0.2),
        ("0.2 K", "degC", True, 0.2),
        ("0.2 °C", "K", True, 0.2),
        ("293.15 K", "degC", False, 20.0),
        ("5 percent", "1", True, 0.05),
    ],
)
def test_quantities_written_with_a_unit(text: str, unit: str, difference: bool, number: float) -> None:
    assert number_in(text, unit, difference=difference) == pytest.approx(number, rel=1e-12)


@pytest.mark.parametrize(
    "text", ["mm", "1", "µm/m", "kg/m^3", "kg m**-3", "1/K", "mm²", "V·s", "(m/s)**2", "percent", "%"]
)
def test_units_as_they_are_written(text: str) -> None:
    unit_of(text)


@pytest.mark.parametrize(
    "text",
    [
        "foo", "mm mmm", "10 mm", "__import__('os')", "'", "(" * 50, "m" * 100, "mm\n;x", "mm/0",
        "mm**9**9**9", "9**9**9**9 mm", "mm**(9**9**9)", "mm^999999999", "mm⁹⁹⁹⁹⁹⁹",  # would be computed for hours
    ],
)  # fmt: skip
def test_what_is_no_unit_is_refused(text: str) -> None:
    with pytest.raises(CmmUqError, match="no known unit"):
        unit_of(text, "model.toml")


@pytest.mark.parametrize(("text", "unit"), [("five mm", "mm"), ("25 nm", ""), ("25 kg", "mm"), ("", "mm")])
def test_what_is_no_quantity_is_refused(text: str, unit: str) -> None:
    with pytest.raises(CmmUqError):
        number_in(text, unit, difference=True)
