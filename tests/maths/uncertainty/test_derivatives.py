"""Derivatives against complex steps (which share no rule with the jets), exact polynomials and identities."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, strategies as st

from cmm_uq.base.errors import CmmUqError
from cmm_uq.maths.uncertainty.measurement_model import ONE, TWO, complex_step, derivatives, hessian_along

H = 1e-40
KINKED = {np.absolute, np.cbrt, np.deg2rad, np.rad2deg, np.radians, np.degrees}
BEYOND_ONE = {np.arccosh}


@pytest.mark.parametrize("function", [f for f in ONE if f not in KINKED], ids=lambda f: f.__name__)
def test_rules_of_one_argument_agree_with_complex_steps(function: np.ufunc) -> None:
    x = 1.7 if function in BEYOND_ONE else 0.3
    found = derivatives(lambda x: [function(x)], [x], order=2)
    assert found.jacobian[0, 0] == pytest.approx(np.imag(function(x + H * 1j)) / H, rel=1e-14)

    def slope(z: complex) -> complex:
        rule = ONE[function][0]
        return complex(rule(z, function(z)))

    assert found.hessian is not None
    assert found.hessian[0, 0, 0] == pytest.approx(np.imag(slope(x + H * 1j)) / H, rel=1e-13)


@pytest.mark.parametrize(
    ("function", "x", "value", "first", "second"),
    [
        (np.absolute, -0.3, 0.3, -1.0, 0.0),
        (np.cbrt, -8.0, -2.0, 1 / 12, 2 / (9 * 32)),
        (np.deg2rad, 180.0, np.pi, np.pi / 180, 0.0),
        (np.degrees, np.pi, 180.0, 180 / np.pi, 0.0),
    ],
)
def test_rules_where_complex_steps_do_not_reach(
    function: np.ufunc, x: float, value: float, first: float, second: float
) -> None:
    found = derivatives(lambda x: [function(x)], [x], order=2)
    assert found.hessian is not None
    assert (found.value[0], found.jacobian[0, 0], found.hessian[0, 0, 0]) == pytest.approx((value, first, second))


@pytest.mark.parametrize("function", list(TWO), ids=lambda f: f.__name__)
def test_rules_of_two_arguments_agree_with_the_same_function_written_in_one_argument_functions(
    function: np.ufunc,
) -> None:
    written = {
        np.add: lambda x, y: x + y,
        np.subtract: lambda x, y: x - y,
        np.multiply: lambda x, y: (np.square(x + y) - np.square(x - y)) / 4.0,
        np.divide: lambda x, y: np.exp(np.log(x) - np.log(y)),
        np.power: lambda x, y: np.exp(y * np.log(x)),
        np.arctan2: lambda x, y: np.arctan(x / y),
        np.hypot: lambda x, y: np.sqrt(np.square(x) + np.square(y)),
    }[function]
    direct = derivatives(lambda x, y: [function(x, y)], [0.7, 1.9], order=2)
    other = derivatives(lambda x, y: [written(x, y)], [0.7, 1.9], order=2)
    np.testing.assert_allclose(direct.jacobian, other.jacobian, rtol=1e-13)
    np.testing.assert_allclose(direct.hessian, other.hessian, rtol=1e-12, atol=1e-15)


def test_a_cubic_form_has_its_exact_derivatives() -> None:
    found = derivatives(lambda x, y, z: [x**3 + 2.0 * x * y * z + 5.0 * z, y * y], [2.0, 3.0, 5.0], order=2)
    np.testing.assert_array_equal(found.value, [8 + 60 + 25, 9])
    np.testing.assert_array_equal(found.jacobian, [[12 + 30, 20, 12 + 5], [0, 6, 0]])
    np.testing.assert_array_equal(
        found.hessian, [[[12, 10, 6], [10, 0, 4], [6, 4, 0]], [[0, 0, 0], [0, 2, 0], [0] * 3]]
    )


def test_third_derivatives_of_a_cubic_form_along_a_direction_are_exact() -> None:
    # d³(x³ + xyz) along (1, 2, 3): f_xxx = 6, f_xyz = 1
    found = hessian_along(lambda x, y, z: [x**3 + x * y * z], [2.0, 3.0, 5.0], [1.0, 2.0, 3.0])
    np.testing.assert_allclose(found[0], [[6, 3, 2], [3, 0, 1], [2, 1, 0]], rtol=1e-14)


def test_third_derivatives_reach_through_absolute_values_and_arc_tangents() -> None:
    # |x|³ for x < 0 is -x³, third derivative -6; atan2(x, 1) at 0 has third derivative -2
    found = hessian_along(lambda x, y: [np.abs(x) ** 3, np.arctan2(y, 1.0)], [-2.0, 0.0], [1.0, 1.0])
    assert found[0, 0, 0] == pytest.approx(-6.0)
    assert found[1, 1, 1] == pytest.approx(-2.0)


def test_many_points_are_differentiated_at_once_and_need_not_share_a_shape() -> None:
    x = np.linspace(0.1, 2.0, 7)
    found = derivatives(lambda x, a: [np.exp(a * x)], [x, 0.5], order=2)
    assert found.jacobian.shape == (1, 2, 7)
    np.testing.assert_allclose(found.jacobian[0, 1], x * np.exp(0.5 * x), rtol=1e-15)
    assert found.hessian is not None
    np.testing.assert_allclose(found.hessian[0, 0, 1], (1 + 0.5 * x) * np.exp(0.5 * x), rtol=1e-15)


def test_a_choice_by_comparison_takes_the_derivative_of_what_was_chosen() -> None:
    x = np.array([-2.0, 3.0])
    found = derivatives(lambda x: [np.where(x > 0, x * x, 5.0 * x), np.maximum(x, 0.0)], [x], order=2)
    np.testing.assert_array_equal(found.jacobian[:, 0], [[5, 6], [0, 1]])


@given(x=st.floats(0.2, 3.0), y=st.floats(-2.0, 2.0))
def test_identities_survive_differentiation(x: float, y: float) -> None:
    found = derivatives(
        lambda x, y: [np.sin(x * y) ** 2 + np.cos(x * y) ** 2, np.log(np.exp(y) ** x) - x * y], [x, y], 2
    )
    np.testing.assert_allclose(found.value, [1, 0], atol=1e-14)
    np.testing.assert_allclose(found.jacobian, 0, atol=1e-13)
    np.testing.assert_allclose(found.hessian, 0, atol=1e-11)


def test_a_power_of_zero_has_finite_derivatives_where_the_exponent_allows() -> None:
    found = derivatives(lambda x: [x**2, x**1, x**0], [0.0], order=2)
    np.testing.assert_array_equal(found.jacobian[:, 0], [0, 1, 0])
    assert found.hessian is not None
    np.testing.assert_array_equal(found.hessian[:, 0, 0], [2, 0, 0])


def test_complex_steps_follow_linear_algebra_that_jets_do_not() -> None:
    def model(a: complex, b: complex) -> list[complex]:
        return [np.linalg.solve(np.array([[a, 1.0], [b, 3.0]]), np.array([1.0, 2.0]))[0]]

    found = complex_step(model, [2.0, 1.0], [0.1, 0.1])
    np.testing.assert_allclose(found.value, [1 / 5])  # x = 1/(3a − b)
    np.testing.assert_allclose(found.jacobian, [[-3 / 25, 1 / 25]], rtol=1e-14)
    with pytest.raises((CmmUqError, TypeError)):
        derivatives(model, [2.0, 1.0])


def test_complex_steps_notice_a_model_that_is_not_analytic() -> None:
    with pytest.raises(CmmUqError, match="not analytic"):
        complex_step(lambda x: [np.abs(x) * x], [2.0], [0.1])


def test_an_unknown_function_is_named() -> None:
    with pytest.raises(CmmUqError, match=r"numpy\.floor"):
        derivatives(lambda x: [np.floor(x)], [1.5])
    with pytest.raises(CmmUqError, match=r"numpy.add.reduce|numpy.sum"):
        derivatives(lambda x: [np.sum(x)], [1.5])
