"""The distributions of JCGM 101:2008 table 1, and their shapes, against scipy and closed forms."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy import integrate, stats

from cmm_uq.base.errors import CmmUqError
from cmm_uq.maths.uncertainty import distributions, distributions as make
from cmm_uq.maths.uncertainty.distributions import Distribution, DistributionShape

N = 200_000
SEVERAL = [
    make.normal(3.0, 0.5),
    make.student_t(3.0, 0.5, 9.0),
    make.rectangular(1.0, 4.0),
    make.rectangular(1.0, 4.0, dof=8.0),
    make.rectangular_uncertain(-1.0, 1.0, 0.4),
    make.trapezoidal(0.0, 6.0, 0.3),
    make.triangular(0.0, 6.0),
    make.arcsine(-2.0, 2.0),
    make.exponential(0.7),
    make.gamma(4),
    make.gamma(9, 3),
    make.sampled(np.array([1.0, 2.0, 2.0, 7.0])),
]
SMOOTH = [d for d in SEVERAL if d.kind != "sampled"]


def name(d: Distribution) -> str:
    return d.kind


@pytest.mark.parametrize(
    ("given_", "mean", "u"),
    [
        (make.rectangular(1.0, 4.0), 2.5, 3 / np.sqrt(12)),  # 6.4.2.3
        (make.trapezoidal(0.0, 6.0, 0.5), 3.0, 6 * np.sqrt(1.25 / 24)),  # 6.4.4.3
        (make.triangular(0.0, 6.0), 3.0, 6 / np.sqrt(24)),  # 6.4.5.3
        (make.arcsine(-2.0, 2.0), 0.0, 2 / np.sqrt(2)),  # 6.4.6.3
        (make.exponential(0.7), 0.7, 0.7),  # 6.4.10.3
        (make.gamma(4), 5.0, np.sqrt(5)),  # 6.4.11.3
        (make.gamma(9, 3), 10 / 3, np.sqrt(10) / 3),  # 6.4.11, several intervals
    ],
    ids=lambda value: value.kind if isinstance(value, Distribution) else None,
)
def test_estimate_and_uncertainty_follow_the_clauses(given_: Distribution, mean: float, u: float) -> None:
    assert given_.mean == pytest.approx(mean, rel=1e-15)
    assert given_.u == pytest.approx(u, rel=1e-15)
    assert given_.standard_deviation == pytest.approx(u, rel=1e-15)


@pytest.mark.parametrize("given_", SEVERAL, ids=name)
def test_draws_have_the_stated_mean_and_spread(given_: Distribution) -> None:
    draws = given_.sample(np.random.default_rng(5), N)
    sd = float(given_.standard_deviation)
    # five standard errors; the fourth moment of these draws is at most about 9 times the squared variance
    assert abs(draws.mean() - given_.mean) < 5 * sd / np.sqrt(N) + (0.01 if given_.kind == "sampled" else 0)
    expected = sd * (np.sqrt(3 / 4) if given_.kind == "sampled" else 1.0)  # four draws: n against n − 1
    assert draws.std() == pytest.approx(expected, rel=5 * np.sqrt(8 / N) / 2)


@pytest.mark.parametrize("given_", SMOOTH, ids=name)
def test_quantiles_part_the_draws_in_proportion(given_: Distribution) -> None:
    p = np.array([0.001, 0.02, 0.2, 0.5, 0.7, 0.95, 0.999])
    ordered = np.sort(given_.sample(np.random.default_rng(6), N))
    below = np.searchsorted(ordered, given_.quantile(p)) / N
    assert np.all(np.abs(below - p) < 5 * np.sqrt(p * (1 - p) / N))


def test_uncertain_limits_widen_the_draws_and_leave_u_to_the_degrees_of_freedom() -> None:
    # JCGM 101 6.4.3.3: variance (b − a)²/12 + d²/9; JCGM 100 H.1.6: a relative doubt of 50 % is ν = 2, of 10 % ν = 50
    doubtful = make.rectangular_uncertain(-0.05, 0.05, 0.025)
    assert doubtful.standard_deviation == pytest.approx(np.sqrt(0.1**2 / 12 + 0.025**2 / 9), rel=1e-15)
    assert doubtful.u == pytest.approx(0.05 / np.sqrt(3), rel=1e-15)
    assert doubtful.dof == pytest.approx(2.0)
    assert make.rectangular_uncertain(-1e-6, 1e-6, 1e-7).dof == pytest.approx(50.0)
    same = make.rectangular(-0.05, 0.05, dof=2.0)
    assert same.kind == "rectangular_uncertain"
    assert same.stated["limit"] == pytest.approx(0.025)


def test_the_t_distribution_is_wider_than_its_u() -> None:
    # JCGM 101 6.4.9.4: variance (s²/n)(n − 1)/(n − 3)
    assert make.student_t(0.0, 2.0, 9.0).standard_deviation == pytest.approx(2.0 * np.sqrt(9 / 7))
    assert make.student_t(0.0, 2.0, 2.0).standard_deviation == np.inf
    assert make.normal(0.0, 2.0, 9.0).standard_deviation == make.student_t(0.0, 2.0, 9.0).standard_deviation


def test_parameters_may_be_arrays_where_only_moments_are_asked_for() -> None:
    u = np.array([1.0, 2.0])
    assert np.array_equal(np.asarray(make.normal(np.zeros(2), u).u), u)
    assert make.rectangular(np.zeros(2), u).u == pytest.approx(u / np.sqrt(12))
    with pytest.raises(CmmUqError, match="point to point"):
        make.student_t(0.0, 1.0, np.array([3.0, 4.0])).sample(np.random.default_rng(0), 3)


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: make.normal(0.0, 0.0),
        lambda: make.normal(0.0, -1.0),
        lambda: make.normal(np.nan, 1.0),
        lambda: make.normal(0.0, np.inf),
        lambda: make.student_t(0.0, 1.0, 0.5),
        lambda: make.rectangular(1.0, 1.0),
        lambda: make.rectangular(2.0, 1.0),
        lambda: make.trapezoidal(0.0, 1.0, 1.5),
        lambda: make.rectangular_uncertain(0.0, 1.0, 0.6),
        lambda: make.rectangular_uncertain(0.0, 1.0, 0.0),
        lambda: make.exponential(0.0),
        lambda: make.gamma(-1),
        lambda: make.sampled(np.array([1.0])),
        lambda: make.sampled(np.array([1.0, 1.0])),
    ],
)
def test_what_no_distribution_can_have_is_refused(wrong: Callable[[], Distribution]) -> None:
    with pytest.raises(CmmUqError):
        wrong()


@given(beta=st.floats(0.0, 1.0), p=st.floats(1e-6, 1 - 1e-6))
def test_a_trapezoid_lies_between_triangle_and_rectangle(beta: float, p: float) -> None:
    low, high = -1.0, 1.0
    q = abs(float(make.trapezoidal(low, high, beta).quantile(np.array(p))))
    triangle = abs(float(make.triangular(low, high).quantile(np.array(p))))
    rectangle = abs(float(make.rectangular(low, high).quantile(np.array(p))))
    assert triangle - 1e-9 <= q <= rectangle + 1e-9


N_SHAPES = 1_000_000
KS = 2.225 / np.sqrt(N_SHAPES)
"""Kolmogorov's distance that one sample of ten thousand exceeds: P = 2·exp(−2·2.225²)."""
P = np.array([1e-6, 0.01, 0.02625, 0.1, 0.125, 0.2686, 0.3, 0.4999, 0.5, 0.5001, 0.7, 0.875, 0.99, 1 - 1e-6])

PEERS: dict[str, tuple[Callable[[], DistributionShape], Any]] = {
    "normal": (lambda: distributions.NORMAL, stats.norm()),
    "rectangular": (lambda: distributions.RECTANGULAR, stats.uniform(-1, 2)),
    "triangular": (lambda: distributions.TRIANGULAR, stats.triang(0.5, -1, 2)),
    "arcsine": (lambda: distributions.ARCSINE, stats.arcsine(-1, 2)),
    "exponential": (lambda: distributions.EXPONENTIAL, stats.expon()),
    "t": (lambda: distributions.t_shape(5.0), stats.t(5)),
    "gamma": (lambda: distributions.gamma_shape(3.0), stats.gamma(3)),
    "trapezoidal": (lambda: distributions.trapezoid(0.3), stats.trapezoid(0.35, 0.65, -1, 2)),
    "narrow trapezoidal": (lambda: distributions.trapezoid(0.9), stats.trapezoid(0.05, 0.95, -1, 2)),
}


@pytest.mark.parametrize("name", PEERS)
def test_variance_and_quantiles_are_those_of_the_distribution(name: str) -> None:
    make, peer = PEERS[name]
    assert make().variance == pytest.approx(peer.var(), rel=1e-9)
    np.testing.assert_allclose(make().inverse(P), peer.ppf(P), rtol=1e-8, atol=1e-12)


@pytest.mark.parametrize("name", PEERS)
def test_draws_have_the_distribution(name: str) -> None:
    make, peer = PEERS[name]
    draws = make().draw(np.random.default_rng(1), N_SHAPES)
    assert draws.shape == (N_SHAPES,)
    assert stats.kstest(draws, peer.cdf).statistic < KS


def test_a_point_is_drawn_and_inverted_to_itself() -> None:
    assert distributions.POINT.variance == 0.0
    assert distributions.POINT.draw(np.random.default_rng(0), 3).tolist() == [0.0, 0.0, 0.0]
    assert distributions.POINT.inverse(P).tolist() == [0.0] * len(P)


@pytest.mark.parametrize(("dof", "variance"), [(1.0, np.inf), (2.0, np.inf), (2.5, 5.0), (4.0, 2.0)])
def test_the_variance_of_t_is_infinite_up_to_two_degrees_of_freedom(dof: float, variance: float) -> None:
    assert distributions.t_shape(dof).variance == pytest.approx(variance)


def below(x: float, doubt: float) -> float:
    """Probability of less than x of a rectangle whose half-width lies evenly between 1 − doubt and 1 + doubt."""

    def part(width: float) -> float:
        return float(np.clip((1 + x / width) / 2, 0.0, 1.0))

    kink = [abs(x)] if 1 - doubt < abs(x) < 1 + doubt else None
    return integrate.quad(part, 1 - doubt, 1 + doubt, points=kink, epsabs=1e-13)[0] / (2 * doubt)


@pytest.mark.parametrize("doubt", [0.05, 0.3, 0.5])
def test_a_rectangle_of_uncertain_width_is_the_mean_of_rectangles(doubt: float) -> None:
    """Its variance is the mean of w²/3, and so (1 + doubt²/3)/3."""
    shape = distributions.blurred_rectangle(doubt)
    assert shape.variance == pytest.approx((1 + doubt**2 / 3) / 3, rel=1e-15)
    found = [below(float(x), doubt) for x in shape.inverse(P)]
    np.testing.assert_allclose(found, P, rtol=1e-7, atol=1e-12)
    draws = shape.draw(np.random.default_rng(2), N_SHAPES)
    places = np.linspace(-1 - doubt, 1 + doubt, 61)
    expected = [below(float(x), doubt) for x in places]
    assert np.abs(np.searchsorted(np.sort(draws), places) / N_SHAPES - expected).max() < KS
    assert 1 + 0.98 * doubt < np.abs(draws).max() <= 1 + doubt


@pytest.mark.parametrize(
    "shape", [distributions.RECTANGULAR, distributions.TRIANGULAR, distributions.ARCSINE, distributions.trapezoid(0.4)]
)
def test_a_bounded_shape_reaches_from_minus_one_to_one(shape: DistributionShape) -> None:
    ends = shape.inverse(np.array([0.0, 1.0]))
    np.testing.assert_allclose(ends, [-1.0, 1.0], atol=1e-15)
    draws = shape.draw(np.random.default_rng(3), N_SHAPES)
    assert -1 <= draws.min() < -0.995
    assert 0.995 < draws.max() <= 1


def test_earlier_draws_are_drawn_again_and_inverted_as_steps() -> None:
    """1, 2, 4 and 9: variance 38/3 about the mean of 4 with n − 1 = 3."""
    shape = distributions.empirical(np.array([4.0, 1.0, 9.0, 2.0]))
    assert shape.variance == pytest.approx(38 / 3)
    assert shape.inverse(np.array([0.1, 0.25, 0.26, 0.5, 0.51, 0.76])).tolist() == [1.0, 1.0, 2.0, 2.0, 4.0, 9.0]
    draws, counts = np.unique(shape.draw(np.random.default_rng(4), 40_000), return_counts=True)
    assert draws.tolist() == [1.0, 2.0, 4.0, 9.0]
    assert np.all(np.abs(counts - 10_000) < 5 * np.sqrt(40_000 * 0.25 * 0.75))
