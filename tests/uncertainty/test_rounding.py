"""How a result is stated: JCGM 100:2008 7.2.6, ILAC-P14:09/2020 5.4, EA-4/02 M:2022 6.3."""

from __future__ import annotations

from decimal import Decimal

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cmm_uq.errors import CmmUqError
from cmm_uq.uncertainty.rounding import rounded, significant


@pytest.mark.parametrize(
    ("value", "u", "digits", "text"),
    [
        (10.05762, 0.02712, 2, ("10.058", "0.027")),  # the example of JCGM 100:2008 7.2.6: 10.058 Ω with 27 mΩ
        (
            100.021471,
            0.000349,
            2,
            ("100.02147", "0.00035"),
        ),  # the 100 g mass of JCGM 100:2008 7.2.2: 100.02147 g, 0.35 mg
        (100.021471, 0.00079, 2, ("100.02147", "0.00079")),  # its expanded uncertainty, 7.2.4
        (50.000838, 93e-6, 2, ("50.000838", "0.000093")),  # end gauge of annex H.1, mm
        (12345.6, 123.0, 2, ("12350", "120")),
        (-4.0049, 0.31, 2, ("−4.00", "0.31")),
        (-0.0004, 0.31, 2, ("0.00", "0.31")),  # no sign before nothing
        (7.0, 9.96, 2, ("7", "10")),  # the carry adds no digit
        (7.0, 0.996, 1, ("7", "1")),
        (2.5, 1.0, 1, ("3", "1")),  # ties away from zero
        (-2.5, 1.0, 1, ("−3", "1")),
        (1.0, 0.15, 1, ("1.0", "0.2")),
        (1.0, 0.14, 1, ("1.0", "0.2")),  # 0.1 would lose 29 %
        (1.0, 0.104, 1, ("1.0", "0.1")),  # 0.1 loses 4 %
    ],
)
def test_value_and_uncertainty_end_at_the_same_decimal_place(
    value: float, u: float, digits: int, text: tuple[str, str]
) -> None:
    assert rounded(value, u, digits) == text


def test_an_exact_value_stays_as_it_is() -> None:
    assert rounded(404.238, 0.0) == ("404.238", "0")
    assert rounded(-0.0, 0.0) == ("0", "0")


def test_of_a_value_with_infinite_uncertainty_little_is_shown() -> None:
    assert rounded(404.238, float("inf")) == ("400", "∞")


def test_unusual_magnitudes_share_a_power_of_ten() -> None:
    assert rounded(4.5e-17, 1.23e-18) == ("4.50×10⁻¹⁷", "0.12×10⁻¹⁷")
    assert rounded(-1.0, 2.5e20) == ("0.0×10²⁰", "2.5×10²⁰")


def test_binary_noise_does_not_decide_a_tie() -> None:
    assert significant(0.1 + 0.2, 1) == "0.3"
    assert significant(1.25 - 1e-15) == "1.3"


@pytest.mark.parametrize(("value", "u"), [(1.0, -0.1), (1.0, float("nan")), (float("nan"), 1.0), (float("inf"), 1.0)])
def test_what_cannot_be_stated_is_refused(value: float, u: float) -> None:
    with pytest.raises(CmmUqError, match="cannot be stated"):
        rounded(value, u)


@given(
    value=st.floats(-1e9, 1e9),
    u=st.floats(1e-9, 1e9),
    digits=st.integers(1, 2),
)
def test_rounding_moves_the_value_by_half_a_unit_and_never_lowers_u_by_more_than_five_percent(
    value: float, u: float, digits: int
) -> None:
    value_text, u_text = (Decimal(text.replace("−", "-")) for text in rounded(value, u, digits))
    unit = Decimal(1).scaleb(u_text.adjusted() - digits + 1)
    assert value_text % unit == 0
    assert abs(value_text - Decimal(value)) <= unit / 2 + abs(Decimal(value)) * Decimal("1e-12")
    assert u_text >= Decimal(u) * Decimal("0.95") * (1 - Decimal("1e-12"))
    assert u_text <= Decimal(u) * 2
