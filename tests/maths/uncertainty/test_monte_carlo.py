"""Propagation of distributions, joint draws included."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.maths.uncertainty import distributions as make
from cmm_uq.maths.uncertainty.distributions import Distribution, constant, normal, rectangular, student_t
from cmm_uq.maths.uncertainty.measurement_model import MeasurementModel
from cmm_uq.maths.uncertainty.propagation import (
    BLOCK,
    Simulated,
    first_order,
    numerical_tolerance,
    simulate,
    simulate_adaptively,
)
from cmm_uq.maths.uncertainty.type_a import correlation_matrix, joint_draws, square_root, tied

TRIALS = 400_000


def within_five_errors(found: Simulated, value: float, u: float, low: float, high: float) -> None:
    """Value, u and the ends of the shortest interval.

    The ends of the very shortest interval converge as n^(-1/3): over b blocks their error is b^(1/6) times that of a
    mean. The settled ones do better.
    """
    errors = found.standard_error[0]
    assert abs(found.value[0] - value) <= 5 * errors[0]
    assert abs(found.u[0] - u) <= 5 * errors[1]
    scatter = errors[2:4] * (found.trials / BLOCK) ** (1 / 6)
    assert abs(found.interval[0, 0] - low) <= 5 * scatter[0]
    assert abs(found.interval[0, 1] - high) <= 5 * scatter[1]


def four(kind: Callable[[], object], widest: Callable[[], object] | None = None) -> MeasurementModel:
    inputs = {name: kind() for name in "abc"} | {"d": (widest or kind)()}
    return MeasurementModel(lambda a, b, c, d: a + b + c + d, inputs)


def test_four_normal_inputs() -> None:
    found = simulate(four(lambda: normal(0, 1)), TRIALS, seed=11)  # 9.2.2
    np.testing.assert_allclose(found.symmetric_interval[0], [-3.91993, 3.91993], atol=5 * found.standard_error[0, 4])


def test_four_rectangular_inputs() -> None:
    side = np.sqrt(3)
    found = simulate(four(lambda: rectangular(-side, side)), TRIALS, seed=12)  # 9.2.3: ±3.88
    np.testing.assert_allclose(found.symmetric_interval[0], [-3.87941, 3.87941], atol=5 * found.standard_error[0, 4])


def test_one_rectangular_input_ten_times_wider() -> None:
    side = np.sqrt(3)
    wide = four(lambda: rectangular(-side, side), lambda: rectangular(-10 * side, 10 * side))
    found = simulate(wide, TRIALS, seed=13)  # 9.2.4: u = 10.1, ±17.0, while first order says ±19.9
    assert found.u[0] == pytest.approx(10.149, abs=5 * found.standard_error[0, 1])
    np.testing.assert_allclose(found.symmetric_interval[0], [-17.0158, 17.0158], atol=5 * found.standard_error[0, 4])
    assert first_order(wide).interval(0.95)[1][0] == pytest.approx(19.891, abs=5e-4)


def test_mass_calibration(mass: MeasurementModel) -> None:
    within_five_errors(simulate(mass, TRIALS, seed=14), 1.2340, 0.075480, 1.08443, 1.38357)  # 9.3


@pytest.mark.parametrize(
    ("x1", "r", "value", "u", "low", "high"),
    [
        (0.0, 0.0, 50e-6, 50e-6, 0.0, 149.8e-6),
        (0.010, 0.0, 150e-6, 111.8e-6, 0.0, 366.0e-6),
        (0.050, 0.0, 2550e-6, 502.5e-6, 1593.6e-6, 3548.6e-6),
    ],
)
def test_comparison_loss(
    loss: Callable[..., MeasurementModel], x1: float, r: float, value: float, u: float, low: float, high: float
) -> None:
    within_five_errors(simulate(loss(x1, r), TRIALS, seed=15), value, u, low, high)  # 9.4


def test_gauge_block(gauge_block: MeasurementModel) -> None:
    # 9.5: estimate 838 nm, u = 36 nm, shortest 99 % interval [745, 932] nm
    found = simulate_adaptively(gauge_block, coverage=0.99, digits=2, seed=16)
    assert found.stable
    within_five_errors(found, 838.0, 35.81, 744.4, 931.6)


def test_the_same_seed_gives_the_same_bytes_and_another_one_other_bytes(mass: MeasurementModel) -> None:
    first, again, other = (simulate(mass, 25_000, seed=seed) for seed in (1, 1, 2))
    assert first.interval.tobytes() == again.interval.tobytes()
    assert first.covariance.tobytes() == again.covariance.tobytes()
    assert first.interval.tobytes() != other.interval.tobytes()


def test_blocks_add_up_to_the_moments_of_all_trials() -> None:
    seen: list[np.ndarray] = []

    def model(x: np.ndarray, y: np.ndarray) -> dict[str, np.ndarray]:
        seen.append(np.array([1e6 + x, x * y]))
        return {"a": 1e6 + x, "b": x * y}

    found = simulate(MeasurementModel(model, {"x": normal(0, 1), "y": normal(1, 1)}, ("a", "b")), 37_001, seed=3)
    draws = np.concatenate(seen, axis=1)
    assert draws.shape == (2, 37_001)
    np.testing.assert_allclose(found.value, draws.mean(axis=1), rtol=1e-14)
    np.testing.assert_allclose(found.covariance, np.cov(draws), rtol=1e-9)
    ordered = np.sort(draws[1])
    assert ordered[0] <= found.interval[1, 0] < found.interval[1, 1] <= ordered[-1]
    assert np.sum(found.density[1] * np.diff(found.edges[1])) == pytest.approx(1.0, abs=5e-3)


def test_the_adaptive_procedure_stops_when_twice_the_error_is_below_the_tolerance() -> None:
    model = MeasurementModel(lambda x: x, {"x": normal(0.0, 95.0)})
    found = simulate_adaptively(model, digits=2, seed=5)
    tolerance = numerical_tolerance(found.u, 2)
    assert tolerance.tolist() == [0.5]
    assert found.stable
    assert found.trials > 1_000_000
    assert np.all(2 * found.standard_error[:, :4] <= tolerance)
    fewer = simulate(model, found.trials - 10_000, seed=5)  # one block less was not enough
    assert np.any(2 * fewer.standard_error[:, :4] > tolerance)


def test_the_adaptive_procedure_makes_a_million_trials_unless_told_otherwise() -> None:
    model = MeasurementModel(lambda x: x, {"x": normal(0.0, 11.0)})
    assert simulate_adaptively(model, digits=1).trials == 1_000_000
    assert simulate_adaptively(model, digits=1, largest=150_000).trials == 150_000


def test_the_adaptive_procedure_says_when_it_gave_up() -> None:
    found = simulate_adaptively(
        MeasurementModel(lambda x: x, {"x": student_t(0.0, 1.0, 3.0)}), digits=3, largest=200_000
    )
    assert found.stable is False
    assert found.trials == 200_000


@pytest.mark.parametrize(
    ("u", "digits", "tolerance"),
    [
        (35.8, 2, 0.5),  # 36 = 36·10⁰
        (0.00035, 2, 0.000005),  # the example of 7.9.2: 0.000 35 g is 35·10⁻⁵ g, δ = ½·10⁻⁵ g
        (0.0754, 1, 0.005),
        (99.7, 2, 5.0),  # rounds to 10·10¹
        (0.0, 2, 0.0),
    ],
)
def test_numerical_tolerance(u: float, digits: int, tolerance: float) -> None:
    assert numerical_tolerance(np.array([u]), digits)[0] == pytest.approx(tolerance, rel=1e-12)


def test_trials_without_a_value_are_counted_and_never_dropped() -> None:
    model = MeasurementModel(lambda x: np.sqrt(x), {"x": normal(1.0, 0.5)})
    with pytest.raises(CmmUqError, match=r"no finite y in \d+ of 10000 trials, such as x = -"):
        simulate(model, 20_000, seed=1)


def test_what_cannot_be_drawn_is_refused() -> None:
    with pytest.raises(CmmUqError, match="2 degrees of freedom"):
        simulate(MeasurementModel(lambda x: x, {"x": student_t(0.0, 1.0, 2.0)}), 10_000)
    with pytest.raises(CmmUqError, match="several values"):
        simulate(MeasurementModel(lambda x: x, {"x": normal(np.zeros(3), 1.0)}), 10_000)
    with pytest.raises(CmmUqError, match=r"cannot give a 0\.99 coverage interval"):
        simulate(MeasurementModel(lambda x: x, {"x": normal(0.0, 1.0)}), 100, coverage=0.99)


def test_a_constant_output_is_no_trouble() -> None:
    found = simulate(MeasurementModel(lambda c: c * 2.0, {"c": constant(3.0)}), 1000)
    assert (found.value[0], found.u[0], found.interval.tolist()) == (6.0, 0.0, [[6.0, 6.0]])


@pytest.mark.parametrize("scale", [1e300, 1e-300])
def test_numbers_too_large_or_too_small_for_a_variance_are_refused(scale: float) -> None:
    model = MeasurementModel(lambda x: x, {"x": normal(scale, 0.01 * scale)})
    with pytest.raises(CmmUqError, match="beyond what floating-point numbers hold"):
        simulate(model, 20_000)


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
