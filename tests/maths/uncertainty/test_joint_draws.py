"""Joint draws: every input keeps its own distribution, every pair its correlation coefficient."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.maths.uncertainty import distributions as make
from cmm_uq.maths.uncertainty.correlation import correlation_matrix, joint_draws, square_root, tied
from cmm_uq.maths.uncertainty.distributions import Distribution

N = 200_000


def draw(inputs: dict[str, Distribution], pairs: dict[tuple[str, str], float]) -> np.ndarray:
    matrix = correlation_matrix(list(inputs), pairs)
    return np.array(joint_draws(inputs, matrix)(np.random.default_rng(3), N))


def test_normal_inputs_are_drawn_as_a_multivariate_normal() -> None:
    x, y, z = draw(
        {"x": make.normal(1, 2), "y": make.normal(0, 1), "z": make.normal(5, 0.1)}, {("x", "y"): 0.8, ("y", "z"): -0.4}
    )
    assert np.corrcoef([x, y, z]) == pytest.approx(np.array([[1, 0.8, 0], [0.8, 1, -0.4], [0, -0.4, 1]]), abs=0.01)
    assert np.std(x - 2 * 0.8 * y) == pytest.approx(2 * 0.6, rel=0.01)  # what y leaves of x


def test_full_correlation_is_possible() -> None:
    x, y = draw({"x": make.normal(1, 2), "y": make.normal(0, 1)}, {("x", "y"): -1.0})
    np.testing.assert_allclose(x, 1 - 2 * y, atol=1e-7)


def test_means_of_simultaneous_readings_are_drawn_as_a_multivariate_t() -> None:
    # JCGM 102 5.3.2: every linear combination is t with the same degrees of freedom
    from scipy import stats

    x, y = draw({"x": make.student_t(0, 1, 4), "y": make.student_t(0, 1, 4)}, {("x", "y"): 0.6})
    for combination in ((x + y) / np.sqrt(3.2), (x - y) / np.sqrt(0.8), x):
        assert stats.kstest(combination[:20_000], "t", args=(4,)).pvalue > 1e-4


@pytest.mark.parametrize(
    ("a", "b", "r"),
    [
        (make.rectangular(0, 1), make.rectangular(0, 1), 0.7),
        (make.rectangular(0, 1), make.normal(0, 1), -0.5),
        (make.exponential(1.0), make.arcsine(-1, 1), 0.3),
        (make.student_t(0, 1, 6), make.triangular(0, 1), 0.9),
        (make.gamma(2), make.normal(0, 1, 5), 0.5),
    ],
    ids=lambda value: value.kind if isinstance(value, Distribution) else str(value),
)
def test_other_pairs_get_the_stated_coefficient_and_keep_their_distributions(
    a: Distribution, b: Distribution, r: float
) -> None:
    x, y = draw({"a": a, "b": b}, {("a", "b"): r})
    assert np.corrcoef(x, y)[0, 1] == pytest.approx(r, abs=0.012)
    p = np.array([0.05, 0.5, 0.95])
    for given, drawn in ((a, x), (b, y)):
        below = np.searchsorted(np.sort(drawn), given.quantile(p)) / N
        assert np.all(np.abs(below - p) < 5 * np.sqrt(p * (1 - p) / N))


def test_the_copula_of_two_rectangles_has_its_known_underlying_coefficient() -> None:
    # r = (6/π) asin(ρ/2) for a normal copula of uniform margins, hence sure ranks: P(both below the median) = 1/4 + asin(ρ)/2π
    r = 0.7
    x, y = draw({"a": make.rectangular(0, 1), "b": make.rectangular(0, 1)}, {("a", "b"): r})
    rho = 2 * np.sin(np.pi * r / 6)
    assert np.mean((x < 0.5) & (y < 0.5)) == pytest.approx(0.25 + np.arcsin(rho) / (2 * np.pi), abs=0.005)


def test_an_impossible_coefficient_of_two_distributions_is_refused() -> None:
    with pytest.raises(CmmUqError, match=r"from -0\.6\d\d to"):  # exponential: at worst 1 − π²/6 = −0.645
        draw({"a": make.exponential(1.0), "b": make.exponential(1.0)}, {("a", "b"): -0.9})
    with pytest.raises(CmmUqError, match="no standard deviation"):
        draw({"a": make.student_t(0, 1, 2), "b": make.normal(0, 1)}, {("a", "b"): 0.5})
    with pytest.raises(CmmUqError, match="constant"):
        draw({"a": make.constant(1.0), "b": make.normal(0, 1)}, {("a", "b"): 0.5})


def test_columns_of_an_earlier_sample_stay_together() -> None:
    first = np.random.default_rng(1).normal(size=1000)
    x, y, z = draw(
        {"x": make.sampled(first, "posterior"), "z": make.normal(0, 1), "y": make.sampled(first**2, "posterior")}, {}
    )[[0, 2, 1]]
    np.testing.assert_array_equal(y, x**2)
    assert abs(np.corrcoef(x, z)[0, 1]) < 0.02


@pytest.mark.parametrize(
    ("pairs", "problem"),
    [
        ({("x", "w"): 0.5}, "no input 'w'"),
        ({("x", "x"): 0.5}, "with itself"),
        ({("x", "y"): 1.2}, "coefficient of 1.2"),
        ({("x", "y"): float("nan")}, "coefficient of nan"),
        ({("x", "y"): 0.5, ("y", "x"): 0.4}, "given twice"),
        ({("x", "y"): 0.9, ("y", "z"): 0.9, ("x", "z"): -0.9}, "x, y, z contradict each other"),
    ],
)
def test_impossible_correlations_are_refused(pairs: dict[tuple[str, str], float], problem: str) -> None:
    with pytest.raises(CmmUqError, match=problem):
        correlation_matrix(["x", "y", "z"], pairs)


def test_groups_and_square_root() -> None:
    matrix = correlation_matrix(["a", "b", "c", "d"], {("a", "c"): 0.5, ("c", "d"): 0.5})
    assert tied(matrix) == [[0, 2, 3], [1]]
    singular = correlation_matrix(["a", "b"], {("a", "b"): 1.0})
    root = square_root(singular)
    np.testing.assert_allclose(root @ root.T, singular, atol=1e-15)
