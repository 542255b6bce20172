"""Roots of functions of one number, against scipy's Brent method and roots that are known."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, strategies as st
from scipy import optimize, special

from cmm_uq.maths.inference.slow import root

FUNCTIONS = {
    "polynomial": lambda x: x**3 - 2 * x - 5,
    "normal quantile": lambda x: float(special.ndtr(x)) - 0.975,
    "flat": lambda x: (x - 1) ** 3 + 1e-3 * (x - 1),
    "steep": lambda x: math.atan(1e6 * (x - 0.3)),
}


@pytest.mark.parametrize("name", FUNCTIONS)
@given(st.floats(-9, 0), st.floats(2.2, 9), st.sampled_from([1e-3, 1e-9, 1e-12]))
def test_every_step_is_that_of_scipy(name: str, low: float, high: float, tolerance: float) -> None:
    """To the last bit, and at the same places."""
    places, own = [], []

    def noting(to: list[float]):
        return lambda x: (to.append(x), FUNCTIONS[name](x))[1]

    assert root(noting(own), low, high, tolerance) == optimize.brentq(noting(places), low, high, xtol=tolerance)
    assert own == places


def test_wallis_root() -> None:
    """x³ − 2x − 5 = 0, the equation on which Wallis showed Newton's method: 2.094 551 481 542 326 59…"""
    assert root(FUNCTIONS["polynomial"], 0, 4, 1e-15) == pytest.approx(2.09455148154232659, rel=1e-15)


def test_a_root_at_an_end_is_that_end() -> None:
    assert root(lambda x: x - 1, 1.0, 2.0, 1e-9) == 1.0
    assert root(lambda x: x - 2, 1.0, 2.0, 1e-9) == 2.0


def test_one_sign_at_both_ends_is_refused() -> None:
    with pytest.raises(ValueError, match="one sign"):
        root(lambda x: x * x + 1, -1.0, 1.0, 1e-9)


def test_a_function_that_is_no_number_is_refused() -> None:
    with pytest.raises(ValueError, match="not a number"):
        root(lambda x: x - 1 if x < 1.2 else math.nan, 0.0, 2.0, 1e-9)
