"""Least squares, freedoms of placings, and studentised residuals."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy import linalg, sparse

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats
from cmm_uq.maths.inference.linear_model import Freedoms, LinearModel, Unknown, solve, studentised
from cmm_uq.maths.inference.marginal import Marginal
from cmm_uq.maths.inference.noise import AXES, GROWTH, PLACING, Components
from tests.maths.inference.test_noise import M, components, covariance


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


OWN = 3
"""Freedoms of a placing."""


@st.composite
def placings(draw: st.DrawFn) -> Freedoms:
    """Up to six placings of up to seven observations in any order, some with fewer observations than freedoms, or none."""
    index = np.array(draw(st.lists(st.integers(0, 5), min_size=1, max_size=40)))
    random = np.random.default_rng(draw(st.integers(0, 10_000)))
    columns = random.standard_normal((len(index), OWN))
    if draw(st.booleans()):
        columns[:, 2] = columns[:, 0] - 2 * columns[:, 1]
    return Freedoms(columns, index, 6)


def complement(columns: Floats) -> Floats:
    """(m, m) the projection onto what columns do not reach, by singular values."""
    basis = linalg.orth(columns, rcond=1e-9)
    return np.asarray(np.eye(len(columns)) - basis @ basis.T)


@given(placings())
def test_what_they_leave_of_columns_is_what_the_whole_matrix_leaves(freedoms: Freedoms) -> None:
    columns = np.random.default_rng(1).standard_normal((len(freedoms.index), 4))
    np.testing.assert_allclose(freedoms.without(columns), complement(freedoms.dense()) @ columns, atol=1e-12)


@given(placings(), st.booleans())
def test_observations_mixed_have_the_columns_of_the_whole_matrix_mixed(freedoms: Freedoms, within: bool) -> None:
    """Among those of one placing, which keeps its columns to itself, or of several."""
    m = len(freedoms.index)
    turn = np.random.default_rng(2).standard_normal((m, m))
    turn = np.where(freedoms.index[:, None] == freedoms.index, turn, 0.0 if within else turn)
    found = freedoms.turned(sparse.csr_array(turn))
    np.testing.assert_allclose(found.dense(), turn @ freedoms.dense(), atol=1e-12)
    assert found.blocks == (6 if within or np.all(freedoms.index == freedoms.index[0]) else 1)


@given(placings())
def test_their_rank_is_that_of_the_whole_matrix(freedoms: Freedoms) -> None:
    assert freedoms.rank == np.linalg.matrix_rank(freedoms.dense(), tol=1e-9)


@given(placings())
def test_those_of_some_observations_are_rows_of_the_whole_matrix(freedoms: Freedoms) -> None:
    some = np.arange(len(freedoms.index)) % 2 == 0
    assert np.array_equal(freedoms.at(some).dense(), freedoms.dense()[some])


def test_columns_without_placings_are_one_block_and_none_are_none() -> None:
    columns = np.arange(12.0).reshape(4, 3)
    assert np.array_equal(Freedoms.of(columns).dense(), columns)
    assert Freedoms.of(np.zeros((4, 0))).count == 0
    assert np.array_equal(Freedoms.of(np.zeros((4, 0))).without(columns), columns)


def model_freedoms(freedoms: Freedoms | Floats, m: int, seed: int) -> LinearModel:
    random = np.random.default_rng(seed)
    design = random.standard_normal((m, 2))
    unknowns = (Unknown(("a", "a"), "1", 0.0, 3.0, 3.0), Unknown(("b", "b"), "1", 1.0, 0.5, 0.1, known=True))
    return LinearModel(design @ [1.3, 0.8] + random.standard_normal(m), design, unknowns, freedoms, np.ones(m), None)


@pytest.mark.long
@settings(max_examples=25)
@given(placings(), st.integers(0, 100))
def test_the_density_of_the_noise_is_that_of_the_whole_matrix_in_its_covariance(freedoms: Freedoms, seed: int) -> None:
    """Differences of log N(Cᵀy; CᵀA·prior mean, Cᵀ(A·P·Aᵀ + Σ)C), C an orthonormal basis of what the placings leave."""
    m = len(freedoms.index)
    linear = model_freedoms(freedoms, m, seed)
    C = linalg.null_space(freedoms.dense().T, rcond=1e-9)
    if C.shape[1] < 4:
        return
    random = np.random.default_rng(seed)
    parts = random.dirichlet(np.ones(3), m)
    noise = Components(
        sparse.eye_array(m, format="csr"), np.column_stack([parts, parts[:, 0], np.zeros(m), np.ones(m)]),
        np.zeros((m, 0)), np.zeros(0), (AXES, PLACING),
    )  # fmt: skip
    latent = 0.8 * random.standard_normal((5, noise.dimension))
    wanted = []
    for row in latent:
        sizes = noise.sizes(row[None])
        variances = (noise.variances(sizes)[0] @ noise.shares.T)[0]
        whole = C.T @ (np.diag(variances) + (linear.design * linear.prior_sd**2) @ linear.design.T) @ C
        left = C.T @ (linear.observed - linear.design @ linear.prior_mean)
        squares = left @ np.linalg.solve(whole, left)
        wanted.append(-0.5 * (squares + np.linalg.slogdet(whole)[1] + np.sum(row[1:] ** 2)))
    found = Marginal(linear, noise, solve(linear)).log_density(latent)
    np.testing.assert_allclose(np.diff(found), np.diff(wanted), atol=1e-6)


@pytest.mark.long
def test_least_squares_of_many_placings_holds_no_more_than_some_columns() -> None:
    """20 000 observations in 4000 placings: the columns with all their zeros are 1.9 GB, a square matrix 3.2 GB."""
    m = 20_000
    freedoms = Freedoms(np.random.default_rng(2).standard_normal((m, OWN)), np.arange(m) // 5, m // 5)
    linear = model_freedoms(freedoms, m, 3)
    tracemalloc.start()
    found = solve(linear)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert found.degrees_of_freedom == m - OWN * m // 5 - 1  # one of the two parameters is certified
    assert peak < 60 * 8 * m


def test_what_is_free_is_told_apart_by_groups_as_far_as_that_goes() -> None:
    """Offsets along three axes and a turn about the third, mixed at random, in two placings, the second without the turn."""
    random, axis, place = np.random.default_rng(2), np.tile(np.arange(3), 8), np.repeat([0, 1], 12)
    x, y = np.repeat(random.standard_normal((2, 8)), 3, axis=1)
    offsets = np.eye(3)[axis]
    columns = np.column_stack([offsets, np.where(axis == 0, -y, np.where(axis == 1, x, 0.0))])
    columns[place == 1, 3] = 0.0
    freedoms = Freedoms(columns @ random.standard_normal((4, 4)), place, 2).reached
    apart = freedoms.apart(axis)
    assert apart.rank == freedoms.rank == 7
    for number, groups in ((0, [1, 1, 1, 2]), (1, [0, 1, 1, 1])):
        own = apart.columns[place == number]
        was = freedoms.columns[place == number]
        assert own @ own.T == pytest.approx(was @ was.T, abs=1e-12)
        assert own.T @ own == pytest.approx(np.diag(np.any(own, axis=0).astype(float)), abs=1e-12)
        seen = [len(np.unique(axis[place == number][np.abs(column) > 1e-12])) for column in own.T]
        assert sorted(seen) == groups


def model_studentised(placing: np.ndarray) -> LinearModel:
    """A slope that is fitted and a certified bow that is not."""
    design = np.column_stack([np.linspace(-1, 1, M), np.linspace(-1, 1, M) ** 2])
    unknowns = (Unknown(("a", "a"), "1", 0.0, 3.0, 3.0), Unknown(("b", "b"), "1", 1.0, 0.5, 0.1, known=True))
    return LinearModel(np.zeros(M), design, unknowns, placing, np.ones(M), None)


@pytest.mark.parametrize("blocks", [0, 1, 2])
def test_each_has_the_variance_of_a_reading_whatever_the_fit_takes_of_it(blocks: int) -> None:
    """The same factors for every recording: of the noise' covariance Σ the rows of the matrix A leave diag(A·Σ·Aᵀ) = σ²."""
    noise = components((AXES, PLACING, GROWTH))
    sizes = noise.sizes(np.full((1, noise.dimension), 0.7))
    half = (np.arange(M) < M // 2).astype(float)
    linear = model_studentised(np.column_stack([half, 1 - half])[:, :blocks])
    A = np.column_stack([studentised(linear, noise, sizes, each) for each in np.eye(M)])
    assert len(A) == M
    assert np.diag(A @ covariance(noise, sizes) @ A.T) == pytest.approx(np.full(M, sizes.coordinate[0] ** 2), rel=1e-9)
    fitted = np.column_stack([linear.design[:, 0], linear.placing])
    assert np.allclose(A @ fitted, 0, atol=1e-9)
    assert not np.allclose(A @ linear.design[:, 1], 0, atol=0.1)


def test_the_mean_of_repeats_that_are_a_placing_by_themselves_says_nothing() -> None:
    """Its placing takes all of it; what differs between the two repeats stays."""
    noise = components(())
    sizes = noise.sizes(np.zeros((1, noise.dimension)))
    placed = Freedoms(np.ones((M, 1)), (np.arange(M) > 1).astype(np.int64), 2)
    linear = replace(model_studentised(np.zeros((M, 0))), placing=placed)
    own = np.arange(M) == 0
    assert len(studentised(linear, noise, sizes, np.zeros(M))) == M - 1
    assert np.abs(studentised(linear, noise, sizes, own.astype(float))).max() > 0.5
