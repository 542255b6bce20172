"""Least squares: agreement with a second method, exact null spaces, what a certificate's uncertainty does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats
from cmm_uq.maths.inference.least_squares import solve
from cmm_uq.maths.inference.linear_model import LinearModel, Unknown


def unknown(i: int, *, mean: float = 0.0, sd: float = 100.0, known: bool = False) -> Unknown:
    return Unknown(("effect", f"p{i}"), "µm", mean, sd, 1.0, known)


def model(
    design: Floats, observed: Floats, *, sigma: float | None = None, placing: Floats | None = None, **first: object
) -> LinearModel:
    m, k = design.shape
    unknowns = (unknown(0, **first), *(unknown(i) for i in range(1, k)))
    return LinearModel(observed, design, unknowns, np.zeros((m, 0)) if placing is None else placing, np.ones(m), sigma)


def test_it_agrees_with_numpy_on_a_well_posed_problem() -> None:
    random = np.random.default_rng(3)
    design, observed = random.standard_normal((30, 5)), random.standard_normal(30)
    found = solve(model(design, observed))
    expected, squares, _, _ = np.linalg.lstsq(design, observed, rcond=None)
    np.testing.assert_allclose(found.value, expected, rtol=1e-12)
    np.testing.assert_allclose(found.covariance, np.linalg.inv(design.T @ design) * squares[0] / 25, rtol=1e-10)
    assert found.degrees_of_freedom == 25
    assert found.residual_sd == pytest.approx(float(np.sqrt(squares[0] / 25)))


def test_a_projected_placing_gives_what_fitting_it_gives() -> None:
    random = np.random.default_rng(4)
    design, placing, observed = (random.standard_normal((20, k)) for k in (3, 2, 1))
    found = solve(model(design, observed[:, 0], placing=placing))
    together = np.linalg.lstsq(np.hstack([design, placing]), observed[:, 0], rcond=None)[0]
    np.testing.assert_allclose(found.value, together[:3], rtol=1e-11)
    assert found.degrees_of_freedom == 15


def test_the_certificate_of_nist_longley_is_reproduced() -> None:
    """NIST StRD Longley: condition number about 5·10⁹, certified to fifteen digits."""
    data = np.array([float(word) for word in LONGLEY.split()]).reshape(16, 7)
    design = np.hstack([np.ones((16, 1)), data[:, 1:]])
    unknowns = tuple(
        Unknown(("b", str(i)), "", 0.0, 1e9, s, False) for i, s in enumerate(1 / np.linalg.norm(design, axis=0))
    )
    found = solve(LinearModel(data[:, 0], design, unknowns, np.zeros((16, 0)), np.ones(16), None))
    np.testing.assert_allclose(found.value, CERTIFIED, rtol=1e-8)
    assert found.residual_sd == pytest.approx(304.854073561965, rel=1e-9)
    np.testing.assert_allclose(np.sqrt(np.diag(found.covariance)), CERTIFIED_SD, rtol=1e-8)


def test_columns_that_add_up_are_named_as_a_null_space() -> None:
    random = np.random.default_rng(5)
    three = random.random((12, 3))
    design = np.column_stack([three, three.sum(axis=1), random.standard_normal(12)])
    found = solve(model(design, random.standard_normal(12)))
    assert found.rank == 4
    np.testing.assert_allclose(found.null_space[:, 0], [1, 1, 1, -1, 0], atol=1e-10)
    assert found.determined.tolist() == [False, False, False, False, True]
    assert np.isinf(found.covariance[0, 0])


def test_an_undetermined_parameter_stays_near_its_prior() -> None:
    design = np.array([[1.0, 1.0], [1.0, 1.0], [1.0, 1.0]])
    found = solve(model(design, np.array([12.0, 12.0, 12.1]), mean=10.0))
    assert found.value.sum() == pytest.approx(12.0333333)
    assert found.value[0] - 10.0 == pytest.approx(found.value[1])


def test_a_certified_parameter_is_held_and_its_uncertainty_propagated() -> None:
    """Two parameters, y = a + b·x with a certified: u²(b) = σ²/Σx² + u²(a)·(Σx/Σx²)²."""
    x = np.array([1.0, 2.0, 3.0, 4.0])
    found = solve(model(np.column_stack([np.ones(4), x]), 5 + 2 * x, sigma=0.1, mean=5.0, sd=0.3, known=True))
    np.testing.assert_allclose(found.value, [5.0, 2.0], rtol=1e-12)
    variance = 0.1**2 / 30 + 0.3**2 * (10 / 30) ** 2
    assert found.covariance[1, 1] == pytest.approx(variance)
    assert found.covariance[0, 1] == pytest.approx(-(0.3**2) * 10 / 30)


@pytest.mark.parametrize(
    ("rows", "sigma", "message"), [(2, 0.1, "cannot determine"), (3, None, "nothing to estimate the noise")]
)
def test_too_few_observations_are_refused(rows: int, sigma: float | None, message: str) -> None:
    design = np.random.default_rng(6).standard_normal((rows, 3))
    with pytest.raises(CmmUqError, match=message):
        solve(model(design, np.zeros(rows), sigma=sigma))


def weighted(sigma: float | None = None, rows: int = 7) -> LinearModel:
    """Three columns, one of them the artefact's place, noise scales between 0.5 and 3."""
    random = np.random.default_rng(8)
    design, placing = random.standard_normal((rows, 2)), random.standard_normal((rows, 1))
    scale = np.linspace(0.5, 3.0, rows)
    return LinearModel(random.standard_normal(rows), design, (unknown(0), unknown(1)), placing, scale, sigma)


def test_observations_count_by_their_noise_and_residuals_are_in_millimetres() -> None:
    """Against weighted least squares with the place as a third parameter."""
    given = weighted()
    A, w = np.hstack([given.design, given.placing]), 1 / given.noise_scale
    expected = np.linalg.lstsq(w[:, None] * A, w * given.observed, rcond=None)[0]
    residuals = given.observed - A @ expected
    found = solve(given)
    np.testing.assert_allclose(found.value, expected[:2], rtol=1e-12)
    np.testing.assert_allclose(found.residuals, residuals, rtol=1e-10)
    assert found.degrees_of_freedom == 4
    assert found.residual_sd == pytest.approx(np.sqrt(residuals @ residuals / 4))
    assert found.sigma == found.sigma_of_residuals == pytest.approx(np.sqrt(np.sum((w * residuals) ** 2) / 4))
    covariance = np.linalg.inv((w[:, None] * A).T @ (w[:, None] * A))[:2, :2]
    np.testing.assert_allclose(found.covariance, found.sigma**2 * covariance, rtol=1e-10)


def test_a_place_that_is_given_twice_is_taken_once() -> None:
    given = weighted()
    twice = replace(given, placing=np.hstack([given.freedoms.dense(), -3.0 * given.freedoms.dense()]))
    assert solve(twice).degrees_of_freedom == solve(given).degrees_of_freedom == 4
    np.testing.assert_allclose(solve(twice).value, solve(given).value, rtol=1e-9)


def test_a_stated_noise_is_used_and_that_of_the_residuals_is_told() -> None:
    stated, free = solve(weighted(0.125)), solve(weighted())
    assert stated.sigma == 0.125
    assert stated.sigma_of_residuals == free.sigma_of_residuals != 0.125
    np.testing.assert_allclose(stated.covariance / 0.125**2, free.covariance / free.sigma**2, rtol=1e-12)


def test_as_many_observations_as_parameters_leave_a_stated_noise_alone() -> None:
    found = solve(weighted(0.125, rows=3))
    assert found.degrees_of_freedom == 0
    assert found.residual_sd is None
    assert (found.sigma, found.sigma_of_residuals) == (0.125, 0.125)
    with pytest.raises(CmmUqError, match="2 observations for 2 parameters leave nothing"):
        solve(weighted(rows=3))
    with pytest.raises(CmmUqError, match="1 observations cannot determine 2"):
        solve(weighted(0.125, rows=2))


def test_the_condition_is_that_of_the_design_in_the_parameters_units() -> None:
    """Columns of length 8 and 2 in units of 0.5 and 1: lengths 4 and 2."""
    design = np.zeros((6, 3))
    design[0, 0], design[1, 1] = 8.0, 2.0
    unknowns = (Unknown(("e", "a"), "", 0.0, 1.0, 0.5), unknown(1), unknown(2))
    found = solve(LinearModel(np.zeros(6), design, unknowns, np.zeros((6, 0)), np.ones(6), 0.1))
    assert (found.rank, found.condition) == (2, pytest.approx(2.0))
    assert found.determined.tolist() == [True, True, False]
    assert found.covariance[0, 0] == pytest.approx((0.1 / 8) ** 2)
    assert found.covariance[1, 1] == pytest.approx((0.1 / 2) ** 2)
    assert np.isinf(found.covariance[2, 2])


def test_a_design_of_nothing_determines_nothing() -> None:
    found = solve(model(np.zeros((4, 2)), np.ones(4), sigma=0.1, mean=3.0))
    assert (found.rank, found.condition, found.degrees_of_freedom) == (0, float("inf"), 4)
    assert found.value.tolist() == [3.0, 0.0]
    np.testing.assert_allclose(found.null_space, np.eye(2), atol=1e-15)
    assert not found.determined.any()


def test_without_an_unknown_the_residuals_are_the_observations() -> None:
    found = solve(model(np.ones((4, 1)), np.array([3.0, 4.0, 5.0, 4.0]), mean=4.0, sd=0.5, known=True))
    assert found.residuals.tolist() == [-1.0, 0.0, 1.0, 0.0]
    assert (found.rank, found.condition, found.degrees_of_freedom) == (0, float("inf"), 4)
    assert found.covariance.tolist() == [[0.25]]
    assert found.determined.tolist() == [True]


@pytest.mark.parametrize(("part", "rank"), [(1.002e-7, 2), (0.998e-7, 1)])
def test_a_ten_millionth_of_the_largest_singular_value_is_none(part: float, rank: int) -> None:
    design = np.zeros((5, 2))
    design[0, 0], design[1, 1] = 3.0, 3.0 * part
    assert solve(model(design, np.zeros(5), sigma=1.0)).rank == rank


def test_each_combination_of_a_null_space_begins_with_a_one_and_names_as_few_as_possible() -> None:
    """Two pairs of parallel columns, in units of 1 and 2 to 1 and −4."""
    random = np.random.default_rng(9)
    a, b, c = random.standard_normal((3, 10))
    found = solve(model(np.column_stack([a, c, 2 * a, b, -4 * b]), np.zeros(10), sigma=1.0))
    columns = {tuple(np.round(column, 9) + 0.0) for column in found.null_space.T}
    assert columns == {(1.0, 0.0, -0.5, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0, 0.25)}
    assert found.determined.tolist() == [False, True, False, False, False]
    assert found.condition < 1e3


LONGLEY = """
60323 83.0 234289 2356 1590 107608 1947   61122 88.5 259426 2325 1456 108632 1948
60171 88.2 258054 3682 1616 109773 1949   61187 89.5 284599 3351 1650 110929 1950
63221 96.2 328975 2099 3099 112075 1951   63639 98.1 346999 1932 3594 113270 1952
64989 99.0 365385 1870 3547 115094 1953   63761 100.0 363112 3578 3350 116219 1954
66019 101.2 397469 2904 3048 117388 1955  67857 104.6 419180 2822 2857 118734 1956
68169 108.4 442769 2936 2798 120445 1957  66513 110.8 444546 4681 2637 121950 1958
68655 112.6 482704 3813 2552 123366 1959  69564 114.2 502601 3931 2514 125368 1960
69331 115.7 518173 4806 2572 127852 1961  70551 116.9 554894 4007 2827 130081 1962
"""
CERTIFIED = [
    -3482258.63459582, 15.0618722713733, -0.358191792925910e-01, -2.02022980381683, -1.03322686717359,
    -0.511041056535807e-01, 1829.15146461355,
]  # fmt: skip
CERTIFIED_SD = [
    890420.383607373, 84.9149257747669, 0.334910077722432e-01, 0.488399681651699, 0.214274163161675, 0.226073200069370,
    455.478499142212,
]  # fmt: skip
