"""Heavy tails: the shape of a Pareto distribution, what lies beyond the largest draw, and what Monte Carlo says of u."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from cmm_uq.maths.uncertainty.coverage import draws_in_tail, pareto, tail_of
from cmm_uq.maths.uncertainty.distributions import normal, student_t
from cmm_uq.maths.uncertainty.evaluation import Request, evaluate, stability
from cmm_uq.maths.uncertainty.measurement_model import MeasurementModel
from cmm_uq.maths.uncertainty.monte_carlo import simulate_adaptively


@pytest.mark.parametrize("shape", [-0.5, 0.0, 0.25, 0.5, 1.0])
def test_the_shape_of_a_pareto_distribution_is_found(shape: float) -> None:
    """Draws at equal steps of probability leave only the estimator's own error: of (1 + k)/√n, and 10 draws' pull to ½."""
    n, scale = 3000, 2.0
    excess = stats.genpareto.ppf((np.arange(n) + 0.5) / n, shape, scale=scale)
    found, spread = pareto(excess)
    pull = 10 * (0.5 - shape) / (n + 10)
    assert found - pull == pytest.approx(shape, abs=0.5 * (1 + abs(shape)) / n**0.5)
    assert spread == pytest.approx(scale, rel=0.02)


@pytest.mark.parametrize("dof", [3.0, 4.0, 6.0])
def test_what_lies_beyond_the_largest_draw_is_that_of_the_distribution(dof: float) -> None:
    """Second way: ∫ y² f(y) dy beyond the quantile of 1/n by scipy. The tail is taken for heavier, not for lighter."""
    trials = 1_000_000
    p = (np.arange(draws_in_tail(trials) + 1)[::-1] + 0.5) / trials
    found = tail_of(stats.t.isf(p, dof), 0.0, trials)
    beyond = stats.t.expect(lambda y: y**2, (dof,), lb=stats.t.isf(1 / trials, dof), ub=np.inf, limit=200)
    assert found.shape == pytest.approx(1 / dof, abs=0.06)
    assert 0.8 * beyond < found.unseen < 3 * beyond


def test_the_tail_is_that_of_the_excess_wherever_the_draws_lie() -> None:
    largest = stats.t.isf((np.arange(3001)[::-1] + 0.5) / 1e6, 4.0)
    here, there = tail_of(largest, 0.0, 1_000_000), tail_of(1e3 * largest + 7, 7.0, 1_000_000)
    assert there.shape == pytest.approx(here.shape, rel=1e-9)
    assert there.unseen == pytest.approx(1e6 * here.unseen, rel=1e-6)


def test_draws_that_are_all_one_have_no_tail() -> None:
    assert tail_of(np.full(100, 3.0), 3.0, 10_000).unseen == 0


@pytest.mark.parametrize(("dof", "stable"), [(4.0, True), (3.0, True), (2.5, False), (2.1, False)])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_u_of_a_t_distribution_is_called_stable_only_where_it_is_right(dof: float, stable: bool, seed: int) -> None:
    """u = √(ν/(ν − 2)). With ν = 2.5 a million draws miss it by more than half of its second digit, ever so steadily."""
    found = simulate_adaptively(
        MeasurementModel(lambda x: x, {"x": student_t(0.0, 1.0, dof)}), digits=2, seed=seed, largest=2_000_000
    )
    assert found.stable is stable
    if stable:
        assert found.u[0] == pytest.approx((dof / (dof - 2)) ** 0.5, abs=0.05)
        assert found.unseen[0] < 0.05
    assert found.shape[0] == pytest.approx(1 / dof, abs=0.08)


def test_a_reciprocal_near_zero_has_no_standard_deviation_and_says_so() -> None:
    """1/x with x of 1 ± 0.25: P(|y| > t) falls as 1/t, so k is 1 and no variance exists; the interval does."""
    model = MeasurementModel(lambda x: 1 / x, {"x": normal(1.0, 0.25)})
    for seed in (1, 2, 3):
        stated = evaluate(model, Request(method="monte_carlo", seed=seed, largest=1_000_000))
        assert stated.ways.simulated is not None
        assert stated.ways.simulated.stable is False
        said = stated.stated["y"].reason
        assert "not stable to 2 digits" in said
        assert "from 0.5 on there is no standard deviation" in said
        assert "the coverage interval stands" in said


def test_of_a_normal_output_nothing_is_said_of_tails() -> None:
    found = evaluate(MeasurementModel(lambda x: x, {"x": normal(0.0, 1.1)}), Request(method="monte_carlo", digits=1))
    assert found.ways.simulated is not None
    assert found.ways.simulated.stable
    assert abs(found.ways.simulated.shape[0]) < 0.15
    assert stability(found.ways, 0, 1) == ""
