"""Distributions of JCGM 101:2008 table 1: moments by its clauses, draws and quantiles by their own statistics."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, strategies as st

from cmm_uq.base.errors import CmmUqError
from cmm_uq.maths.uncertainty import distributions as make
from cmm_uq.maths.uncertainty.distributions import Distribution

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
