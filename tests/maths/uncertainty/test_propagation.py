"""Law of propagation: the annexes of JCGM 100:2008, and exact moments of polynomials of normal quantities."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, strategies as st

from cmm_uq.base.errors import CmmUqError
from cmm_uq.maths.uncertainty.distributions import constant, normal, student_t
from cmm_uq.maths.uncertainty.measurement_model import MeasurementModel
from cmm_uq.maths.uncertainty.propagation import first_order, second_order
from cmm_uq.maths.uncertainty.type_a import coverage_factor, multivariate_normal, simultaneous_readings


def test_end_gauge_by_first_order(end_gauge: MeasurementModel) -> None:
    # H.1.6: u = 32 nm, ν = 16, t99 = 2.92, U99 = 93 nm; components 25, 9.7, 2.9, 16.6 nm
    found = first_order(end_gauge)
    assert found.value[0] == 50000838.0
    assert found.u[0] == pytest.approx(31.66, abs=0.005)
    assert found.dof[0] == pytest.approx(16.75, abs=0.005)
    assert coverage_factor(found.dof, 0.99)[0] == pytest.approx(2.92, abs=0.005)
    assert coverage_factor(found.dof, 0.99)[0] * found.u[0] == pytest.approx(92.5, abs=0.05)
    contribution = dict(zip(found.inputs, np.abs(found.contribution[0]), strict=True))
    assert contribution["ls"] == pytest.approx(25)
    assert np.hypot(np.hypot(contribution["d"], contribution["d1"]), contribution["d2"]) == pytest.approx(9.7, abs=0.05)
    assert contribution["da"] == pytest.approx(2.887, abs=0.0005)
    assert contribution["dt"] == pytest.approx(16.599, abs=0.0005)
    assert contribution["a"] == contribution["t"] == 0


def test_end_gauge_by_second_order(end_gauge: MeasurementModel) -> None:
    # H.1.7: the terms of second order are 11.7 nm (δα with θ and Δ) and 1.7 nm (α with δθ); u = 34 nm
    found = second_order(end_gauge)
    names = list(found.inputs)
    bending = {(names[i], names[j]): found.bending[0, i, j] for i in range(9) for j in range(i, 9)}
    assert np.sqrt(bending["t", "da"] + bending["swing", "da"]) == pytest.approx(11.73, abs=0.01)
    assert np.sqrt(bending["a", "dt"]) == pytest.approx(1.67, abs=0.005)  # 1.73 with the rounded u(α) = 1.2e-6
    assert found.cubic[0] == pytest.approx(0, abs=1e-6)
    assert found.u[0] == pytest.approx(33.8, abs=0.05)


def test_resistance_reactance_and_impedance_from_simultaneous_readings(readings: dict[str, list[float]]) -> None:
    # annex H.2, table H.4; all outputs have the n − 1 = 4 degrees of freedom of the readings (H.2.4, approach 2)
    joint = simultaneous_readings(readings)
    model = MeasurementModel(
        lambda V, I, phi: {"R": V / I * np.cos(phi), "X": V / I * np.sin(phi), "Z": V / I},  # noqa: E741
        joint.inputs,
        ("R", "X", "Z"),
        joint.correlation,
    )
    found = first_order(model)
    assert found.value == pytest.approx([127.7322, 219.8465, 254.2597], abs=5e-5)
    assert found.u == pytest.approx([0.07107, 0.29558, 0.23634], abs=5e-6)
    r = found.covariance / np.outer(found.u, found.u)
    assert [r[0, 1], r[0, 2], r[1, 2]] == pytest.approx([-0.588, -0.485, 0.9925], abs=5e-4)
    assert found.dof == pytest.approx([4, 4, 4], rel=1e-12)
    low, high = found.interval(0.95)
    assert (high - low) / 2 == pytest.approx([0.197, 0.821, 0.656], abs=5e-4)
    # approach 2 itself: compute each output from each reading, then take mean and scatter (table H.4)
    V, current, phi = (np.array(readings[name]) for name in ("V", "I", "phi"))
    each = np.array([V / current * np.cos(phi), V / current * np.sin(phi), V / current])
    assert each.std(axis=1, ddof=1) / np.sqrt(5) == pytest.approx([0.071, 0.295, 0.236], abs=1e-3)


@pytest.mark.parametrize(
    ("x1", "r", "first_u", "second_value", "second_u"),
    [
        (0.0, 0.0, 0.0, 50e-6, 50e-6),
        (0.010, 0.0, 100e-6, 150e-6, 111.8e-6),
        (0.050, 0.0, 500e-6, 2550e-6, 502.5e-6),
        (0.0, 0.9, 0.0, 50e-6, 67.27e-6),  # 2u²√(1 + r²)
    ],
)
def test_power_loss_of_jcgm_101(
    loss: Callable[..., MeasurementModel], x1: float, r: float, first_u: float, second_value: float, second_u: float
) -> None:
    # a quadratic form of normal quantities: second order gives mean and variance exactly (Amd.1:2026 adds the mean)
    assert first_order(loss(x1, r)).u[0] == pytest.approx(first_u, abs=1e-15)
    found = second_order(loss(x1, r))
    assert found.value[0] == pytest.approx(second_value, rel=1e-12)
    assert found.u[0] == pytest.approx(second_u, rel=5e-4)


def test_mass_of_jcgm_101(mass: MeasurementModel) -> None:
    # 9.3.2: 1.2340 mg, u = 0.0539 by first, 0.0750 by higher order
    first, second = first_order(mass), second_order(mass)
    assert first.value[0] == pytest.approx(1.2340, abs=5e-9)
    assert first.u[0] == pytest.approx(0.0539, abs=5e-5)
    assert second.u[0] == pytest.approx(0.07496, abs=5e-6)
    assert np.array(first.interval(0.95)).ravel() == pytest.approx([1.1285, 1.3395], abs=1e-4)
    assert np.array(second.interval(0.95)).ravel() == pytest.approx([1.0871, 1.3809], abs=1e-4)


def test_second_order_of_a_cube_is_exact_to_the_fourth_power_of_u() -> None:
    # x³, x normal: mean m³ + 3mσ², variance 9m⁴σ² + 36m²σ⁴ + 15σ⁶; the last term is of third order
    m, s = 2.0, 0.1
    found = second_order(MeasurementModel(lambda x: x**3, {"x": normal(m, s)}))
    assert found.value[0] == pytest.approx(m**3 + 3 * m * s**2, rel=1e-14)
    assert found.u[0] ** 2 == pytest.approx(9 * m**4 * s**2 + 36 * m**2 * s**4, rel=1e-13)


def test_second_order_terms_of_jcgm_100_5_1_2_for_independent_inputs() -> None:
    # ΣΣ [½ f_ij² + f_i f_ijj] u_i² u_j², written out by hand for f = x²y
    x, y, u, v = 1.3, -0.7, 0.2, 0.3
    model = MeasurementModel(lambda x, y: x * x * y, {"x": normal(x, u), "y": normal(y, v)})
    by_hand = 0.5 * (2 * y) ** 2 * u**4 + (2 * x) ** 2 * u**2 * v**2 + x**2 * 2 * u**2 * v**2
    found, linear = second_order(model), first_order(model)
    assert found.u[0] ** 2 - linear.u[0] ** 2 == pytest.approx(by_hand, rel=1e-12)
    assert found.bending[0].sum() + found.cubic[0] == pytest.approx(by_hand, rel=1e-12)


def test_covariance_of_quadratic_forms_of_correlated_normal_quantities_is_exact() -> None:
    # cov(zᵀAz, zᵀBz) = 2 tr(AVBV) about zero mean
    A, B = np.array([[1.0, 0.5], [0.5, -2.0]]), np.array([[0.0, 1.0], [1.0, 3.0]])
    V = np.array([[0.04, 0.01], [0.01, 0.09]])
    joint = multivariate_normal(["x", "y"], np.zeros(2), V)
    model = MeasurementModel(
        lambda x, y: {"a": x * x + x * y - 2 * y * y, "b": 2 * x * y + 3 * y * y},
        joint.inputs,
        ("a", "b"),
        joint.correlation,
    )
    found = second_order(model)
    np.testing.assert_allclose(found.value, [np.trace(A @ V), np.trace(B @ V)], rtol=1e-12)
    expected = [[2 * np.trace(M @ V @ N @ V) for N in (A, B)] for M in (A, B)]
    np.testing.assert_allclose(found.covariance, expected, rtol=1e-12)


@given(r=st.floats(-1, 1), a=st.floats(-3, 3), b=st.floats(-3, 3))
def test_a_linear_model_has_the_variance_of_the_quadratic_form(r: float, a: float, b: float) -> None:
    inputs = {"x": normal(0.0, 2.0), "y": normal(1.0, 0.5)}
    correlation = {("x", "y"): r} if r else {}
    found = first_order(MeasurementModel(lambda x, y: a * x + b * y, inputs, correlation=correlation))
    assert found.u[0] ** 2 == pytest.approx(4 * a * a + 0.25 * b * b + 2 * r * a * b, rel=1e-12, abs=1e-12)


def test_many_points_are_propagated_as_they_would_be_one_by_one() -> None:
    x, u = np.linspace(1.0, 2.0, 5), np.linspace(0.01, 0.05, 5)

    def model(x: object, u: object) -> MeasurementModel:
        inputs = {"x": normal(x, u, 7.0), "a": normal(0.3, 0.1), "b": student_t(1.0, 0.2, 3.0)}
        return MeasurementModel(
            lambda x, a, b: {"y": np.exp(a * x) * b, "z": a + b}, inputs, ("y", "z"), {("a", "x"): 0.4}
        )

    for propagate in (first_order, second_order):
        together = propagate(model(x, u))
        for i in range(5):
            alone = propagate(model(float(x[i]), float(u[i])))
            for field in ("value", "covariance", "dof", "sensitivity", "bending", "cubic"):
                whole, single = getattr(together, field), getattr(alone, field)
                np.testing.assert_allclose(
                    whole[..., i] if whole.shape[-1] == 5 else whole[..., 0], single, rtol=1e-12, atol=1e-18
                )


def test_a_set_of_simultaneous_readings_counts_once_among_others() -> None:
    # two correlated means with ν = 4 and an independent one with ν = 10: ν = u⁴/(u₁₂⁴/4 + u₃⁴/10)
    inputs = {"a": student_t(0.0, 1.0, 4.0), "b": student_t(0.0, 2.0, 4.0), "c": normal(0.0, 1.5, 10.0)}
    model = MeasurementModel(lambda a, b, c: a + b + c, inputs, correlation={("a", "b"): -0.5})
    together, alone = 1 + 4 - 2.0, 2.25
    assert first_order(model).dof[0] == pytest.approx((together + alone) ** 2 / (together**2 / 4 + alone**2 / 10))


def test_correlation_with_a_quantity_known_beyond_doubt_leaves_the_others_their_degrees_of_freedom() -> None:
    inputs = {"a": normal(0.0, 1.0), "b": normal(0.0, 2.0, 5.0)}
    model = MeasurementModel(lambda a, b: a + b, inputs, correlation={("a", "b"): 0.5})
    assert first_order(model).dof[0] == pytest.approx((1 + 4 + 2) ** 2 / (16 / 5))


def test_the_coverage_factor_truncates_the_degrees_of_freedom() -> None:
    # JCGM 100 table G.2
    assert coverage_factor(np.array([1, 4, 16.9, 50, np.inf, 1e300]), 0.95) == pytest.approx(
        [12.71, 2.78, 2.12, 2.01, 1.960, 1.960], abs=5e-3
    )
    assert coverage_factor(3.9999999999, 0.95) == pytest.approx(2.776, abs=5e-4)
    with pytest.raises(CmmUqError, match="support no coverage interval"):
        coverage_factor(0.5, 0.95)
    with pytest.raises(CmmUqError, match="coverage probability of 95"):
        coverage_factor(10, 95)


def test_a_model_without_value_or_derivative_at_the_estimates_is_refused() -> None:
    with pytest.raises(CmmUqError, match="derivative of y by x is not finite"):
        first_order(MeasurementModel(lambda x: np.sqrt(x), {"x": normal(0.0, 1.0)}))
    with pytest.raises(CmmUqError, match="no finite value of y"):
        first_order(MeasurementModel(lambda x: np.log(x), {"x": normal(-1.0, 1.0)}))
    with pytest.raises(CmmUqError, match="1 of 3 points"):
        first_order(MeasurementModel(lambda x: np.log(x), {"x": normal(np.array([1.0, -1.0, 2.0]), 1.0)}))


def test_a_series_that_does_not_converge_is_refused() -> None:
    # log near zero with u ≫ x: the cubic term makes the variance negative
    model = MeasurementModel(lambda x: x - 2.0 * x**3, {"x": normal(0.1, 1.0)})
    with pytest.raises(CmmUqError, match="bends too strongly"):
        second_order(model)


def test_constants_contribute_nothing() -> None:
    found = first_order(MeasurementModel(lambda x, c: c * x, {"x": normal(1.0, 0.1), "c": constant(3.0)}))
    assert found.u[0] == pytest.approx(0.3)
    assert found.contribution[0].tolist() == [pytest.approx(0.3), 0.0]


def test_an_output_that_the_model_does_not_give_is_named() -> None:
    with pytest.raises(CmmUqError, match="no output 'z'"):
        first_order(MeasurementModel(lambda x: {"y": x}, {"x": normal(1.0, 0.1)}, ("y", "z")))


def test_a_model_of_linear_algebra_is_propagated_by_complex_steps() -> None:
    def model(a: complex, b: complex) -> complex:
        return np.linalg.det(np.array([[a, 1.0], [b, 3.0]]))

    inputs = {"a": normal(2.0, 0.1), "b": normal(1.0, 0.2)}
    found = first_order(MeasurementModel(model, inputs, differentiation="complex_step"))
    assert found.u[0] == pytest.approx(np.hypot(0.3, 0.2))
    with pytest.raises(CmmUqError, match="not exact"):
        second_order(MeasurementModel(model, inputs, differentiation="complex_step"))


def test_the_package_uncertainties_propagates_alike() -> None:
    peer, umath = pytest.importorskip("uncertainties"), pytest.importorskip("uncertainties.umath")
    mean, V = np.array([1.0, 2.0, 0.5]), np.array([[0.04, 0.01, 0.0], [0.01, 0.09, -0.02], [0.0, -0.02, 0.01]])
    x, y, z = peer.correlated_values(mean.tolist(), V.tolist())
    theirs = [umath.sqrt(x * y) + umath.sin(z), x / y - z**3]
    joint = multivariate_normal(["x", "y", "z"], mean, V)
    ours = first_order(
        MeasurementModel(
            lambda x, y, z: {"a": np.sqrt(x * y) + np.sin(z), "b": x / y - z**3}, joint.inputs, "ab", joint.correlation
        )
    )
    np.testing.assert_allclose(ours.value, [t.nominal_value for t in theirs], rtol=1e-14)
    np.testing.assert_allclose(ours.covariance, peer.covariance_matrix(theirs), rtol=1e-12)
