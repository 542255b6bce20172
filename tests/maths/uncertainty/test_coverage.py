"""Coverage intervals and regions, and tails too heavy for a standard deviation."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy import stats

from cmm_uq.base.errors import CmmUqError
from cmm_uq.maths.uncertainty.coverage import (
    Tails,
    both_intervals,
    draws_in_tail,
    elliptical_factor,
    elliptical_region,
    inner_draws,
    pareto,
    rectangular_region,
    settled_shortest_interval,
    shortest_interval,
    smallest_region,
    symmetric_interval,
    tail_of,
)
from cmm_uq.maths.uncertainty.distributions import normal, rectangular, student_t
from cmm_uq.maths.uncertainty.evaluation import Request, evaluate, stability
from cmm_uq.maths.uncertainty.measurement_model import MeasurementModel
from cmm_uq.maths.uncertainty.propagation import draw_outputs, simulate_adaptively


def by_definition(draws: np.ndarray, p: float) -> list[float]:
    """7.7.1 to 7.7.4, numbering the draws from one."""
    y, M = np.concatenate([[np.nan], np.sort(draws)]), len(draws)
    q = int(p * M) if float(p * M).is_integer() else int(p * M + 0.5)
    lengths = [y[r + q] - y[r] for r in range(1, M - q + 1)]
    shortest = int(np.argmin(lengths)) + 1
    r = (M - q) // 2 if (M - q) % 2 == 0 else (M - q + 1) // 2
    return [y[shortest], y[shortest + q], y[r], y[r + q]]


@pytest.mark.long
@given(draws=st.lists(st.floats(-1e3, 1e3), min_size=100, max_size=150), p=st.sampled_from([0.5, 0.68, 0.8, 0.9, 0.95]))
def test_both_intervals_are_those_of_the_definition(draws: list[float], p: float) -> None:
    assert both_intervals(np.sort(draws), p).tolist() == by_definition(np.array(draws), p)


@pytest.mark.parametrize("p", [0.3, 0.6827, 0.95, 0.99])
def test_keeping_the_tails_only_changes_nothing(p: float) -> None:
    draws = np.random.default_rng(1).gamma(2.0, size=333_333)
    tails = Tails(p)
    for block in np.array_split(draws, 40):
        tails.add(np.sort(block))
    ordered = np.sort(draws)
    outer = len(draws) - inner_draws(len(draws), p)
    lowest, highest = ordered[:outer], ordered[-outer:]
    expected = [*settled_shortest_interval(lowest, highest), *symmetric_interval(lowest, highest)]
    assert tails.intervals().tolist() == expected


def test_q_is_rounded_to_the_nearest_integer() -> None:
    # 7.7.1: q = pM, or the integer part of pM + 1/2
    assert inner_draws(10_000, 0.95) == 9500
    assert inner_draws(101, 0.95) == 96
    assert inner_draws(110, 0.95) == 105
    assert inner_draws(10_000, 0.95004985) == 9500


@pytest.mark.parametrize(("outer", "first"), [(1, 0), (2, 0), (3, 1), (4, 1), (5, 2)])
def test_the_symmetric_interval_leaves_as_many_draws_on_either_side(outer: int, first: int) -> None:
    """7.7.2: r = (M − q)/2, or (M − q + 1)/2 where that is no integer, counted from one."""
    lowest = np.arange(float(outer))
    assert symmetric_interval(lowest, 100.0 + lowest) == (first, 100.0 + first)


def test_an_interval_that_holds_all_draws_runs_from_the_first_to_the_last() -> None:
    """95 % of five draws are five."""
    draws = np.array([1.0, 2.0, 4.0, 8.0, 16.0])
    assert both_intervals(draws, 0.95).tolist() == [1.0, 16.0] * 2
    tails = Tails(0.95)
    tails.add(draws)
    assert tails.intervals().tolist() == [1.0, 16.0] * 2


def test_draws_that_are_all_the_same_have_an_interval_of_no_length() -> None:
    assert both_intervals(np.full(200, 3.0), 0.95).tolist() == [3.0] * 4


def ends_of(draws: np.ndarray, p: float) -> tuple[np.ndarray, np.ndarray]:
    ordered, outer = np.sort(draws), len(draws) - inner_draws(len(draws), p)
    return ordered[:outer], ordered[-outer:]


@pytest.mark.parametrize("p", [0.95, 0.99])
def test_the_settled_interval_scatters_less_about_the_same_ends_and_is_hardly_longer(p: float) -> None:
    # a normal output: the shortest interval is the symmetric one, known exactly
    from scipy import special

    rng, k = np.random.default_rng(4), float(special.ndtri((1 + p) / 2))
    exact, settled = [], []
    for _ in range(100):
        lowest, highest = ends_of(rng.standard_normal(100_000), p)
        exact.append(shortest_interval(lowest, highest))
        settled.append(settled_shortest_interval(lowest, highest))
    by_definition, smooth = np.array(exact), np.array(settled)
    assert np.all(smooth.std(axis=0) < 0.75 * by_definition.std(axis=0))
    assert np.all(np.abs(smooth.mean(axis=0) - [-k, k]) < 5 * smooth.std(axis=0) / 10)
    lengths = np.diff(smooth)[:, 0] / np.diff(by_definition)[:, 0]
    assert np.all((lengths >= 1) & (lengths < 1.01))


def test_a_density_that_only_falls_has_its_shortest_interval_at_the_edge() -> None:
    lowest, highest = ends_of(np.random.default_rng(5).standard_exponential(200_000), 0.95)
    assert settled_shortest_interval(lowest, highest) == shortest_interval(lowest, highest)
    assert settled_shortest_interval(lowest, highest)[0] < 1e-3


def test_where_all_intervals_are_equally_short_it_is_the_symmetric_one() -> None:
    lowest, highest = ends_of(np.random.default_rng(6).random(300_000), 0.95)
    assert settled_shortest_interval(lowest, highest) == symmetric_interval(lowest, highest)
    skewed = ends_of(np.random.default_rng(6).gamma(4.0, size=300_000), 0.95)
    assert settled_shortest_interval(*skewed) != symmetric_interval(*skewed)


def bent(n: int, at: int, dip: int, depth: float = 1e-6) -> tuple[np.ndarray, np.ndarray]:
    """Lengths that are a parabola over ln((r + ½)/(n − r − ½)) with its least at one draw, and shorter still at another."""
    r = np.arange(n)
    odds = np.log((r + 0.5) / (n - r - 0.5))
    lengths = 1000.0 + 100.0 * (odds - odds[at]) ** 2
    lengths[dip] = 1000.0 / (1 + depth)
    lowest = 100.0 * r / n
    return lowest, lowest + lengths


def place(ends: tuple[np.ndarray, np.ndarray], n: int) -> int:
    """Which draw the settled interval begins with."""
    return round(settled_shortest_interval(*ends)[0] * n / 100.0)


@pytest.mark.parametrize(("n", "at", "dip"), [(1001, 500, 504), (1001, 300, 304), (1001, 700, 696)])
def test_a_single_short_length_does_not_move_the_place_where_the_curve_is_least(n: int, at: int, dip: int) -> None:
    ends = bent(n, at, dip)
    assert shortest_interval(*ends)[0] == pytest.approx(100.0 * dip / n)
    assert place(ends, n) == at
    low, high = settled_shortest_interval(*ends)
    assert high - low == pytest.approx(1000.0)


@pytest.mark.parametrize(
    ("n", "at", "dip", "depth", "settles"),
    [
        (500, 200, 303, 0.001, True),  # five hundred lengths are enough for a curve
        (499, 200, 303, 0.001, False),
        (10_000, 300, 101, 0.001, True),  # a hundredth from the edge there is something to follow on both sides
        (10_000, 300, 100, 0.001, False),
        (100_000, 3000, 1003, 0.001, True),
        (10_000, 9700, 9899, 0.001, True),
        (10_000, 9700, 9900, 0.001, False),
        (10_000, 3000, 4701, 0.00998, True),  # by a hundredth longer than the very shortest, and no more
        (10_000, 3000, 4701, 0.01002, False),
    ],
)
def test_where_the_shortest_interval_may_be_settled(n: int, at: int, dip: int, depth: float, settles: bool) -> None:
    # the curve is looked at in steps of 0.0015, which are up to four of ten thousand places
    assert place(bent(n, at, dip, depth), n) == (pytest.approx(at, abs=max(2, n // 20_000)) if settles else dip)


@pytest.mark.parametrize(
    ("n", "where", "longer", "alike"),
    [
        # between 1/20 and 19/20 of 5000 places, 4499 apart, single draws scatter 10·4499/√5000 = 636.3
        (5000, 2500, 636.0, True),
        (5000, 2500, 637.0, False),
        (5000, 249, 5000.0, True),
        (5000, 250, 5000.0, False),
        (5000, 4749, 5000.0, False),
        (5000, 4750, 5000.0, True),
        (4999, 2500, 1.0, False),  # too few to say
    ],
)
def test_lengths_that_differ_by_scatter_alone_are_all_alike(n: int, where: int, longer: float, alike: bool) -> None:
    lowest = np.arange(float(n))
    lengths = np.full(n, 9000.0)
    lengths[where] += longer
    lengths[10] -= 1e-6  # the very shortest is at the edge
    found = settled_shortest_interval(lowest, lowest + lengths)
    assert found == (symmetric_interval if alike else shortest_interval)(lowest, lowest + lengths)


N = 200_000


def pair(r: float) -> np.ndarray:
    inputs = {"a": normal(1.0, 2.0), "b": normal(-3.0, 0.5)}
    return draw_outputs(
        MeasurementModel(lambda a, b: {"a": a, "b": b}, inputs, ("a", "b"), {("a", "b"): r} if r else {}), N, seed=2
    )


def test_factors_of_normal_outputs() -> None:
    # JCGM 102 table 1: 1.96, 2.45, 2.80 for one, two and three outputs and 95 %
    assert [elliptical_factor(p) for p in (1, 2, 3)] == pytest.approx([1.95996, 2.44775, 2.79548], abs=5e-6)
    assert elliptical_factor(2, 0.99) == pytest.approx(np.sqrt(-2 * np.log(0.01)))


@pytest.mark.parametrize("r", [0.0, 0.9])
def test_the_ellipse_of_normal_draws_is_the_known_one(r: float) -> None:
    draws = pair(r)
    region = elliptical_region(draws)
    # standard error of the factor: √(p(1−p)/n) over the Rayleigh density at 2.4477
    error = np.sqrt(0.95 * 0.05 / N) / (2.4477 * 0.05)
    assert region.factor == pytest.approx(2.4477, abs=5 * error)
    away = draws - region.centre[:, None]
    inside = np.einsum("pn,pq,qn->n", away, np.linalg.inv(region.covariance), away) <= region.factor**2 * (1 + 1e-12)
    assert inside.mean() == pytest.approx(0.95, abs=1e-5)
    assert region.volume == pytest.approx(np.pi * 2.4477**2 * 2 * 0.5 * np.sqrt(1 - r * r), rel=0.02)


def test_the_smallest_region_of_normal_draws_is_that_ellipse() -> None:
    draws = pair(0.6)
    region = smallest_region(draws, cells=40)
    assert region.area == pytest.approx(elliptical_region(draws).volume, rel=0.05)


def test_the_smallest_region_of_a_uniform_square_is_most_of_the_square() -> None:
    inputs = {"a": rectangular(0.0, 1.0), "b": rectangular(0.0, 2.0)}
    draws = draw_outputs(MeasurementModel(lambda a, b: {"a": a, "b": b}, inputs, ("a", "b")), N, seed=3)
    assert smallest_region(draws, cells=20).area == pytest.approx(2 * 0.95, rel=0.02)
    assert elliptical_region(draws).volume > 2.0  # an ellipse wastes the corners


def test_the_rectangle_of_independent_normal_draws() -> None:
    # both within k u with probability 0.95: erf(k/√2)² = 0.95, k = 2.2365
    draws = pair(0.0)
    region = rectangular_region(draws)
    assert region.factor == pytest.approx(2.2365, abs=0.02)
    assert region.volume == pytest.approx(4 * region.factor**2 * 2 * 0.5, rel=0.02)


def test_impossible_regions_are_refused() -> None:
    a = np.random.default_rng(1).normal(size=1000)
    with pytest.raises(CmmUqError, match="depend on each other"):
        elliptical_region(np.array([a, 2 * a]))
    with pytest.raises(CmmUqError, match="more draws"):
        smallest_region(np.array([a, a**2]))
    with pytest.raises(CmmUqError, match="coverage probability"):
        elliptical_factor(2, 95)


def test_draws_are_those_of_the_simulation() -> None:
    from cmm_uq.maths.uncertainty.propagation import simulate

    model = MeasurementModel(lambda a: a**2, {"a": normal(1.0, 2.0)})
    assert draw_outputs(model, 25_000, seed=9).mean() == pytest.approx(
        simulate(model, 25_000, seed=9).value[0], rel=1e-12
    )


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
    assert found[0] == pytest.approx(1 / dof, abs=0.06)
    assert 0.8 * beyond < found[1] < 3 * beyond


def test_the_tail_is_that_of_the_excess_wherever_the_draws_lie() -> None:
    largest = stats.t.isf((np.arange(3001)[::-1] + 0.5) / 1e6, 4.0)
    here, there = tail_of(largest, 0.0, 1_000_000), tail_of(1e3 * largest + 7, 7.0, 1_000_000)
    assert there[0] == pytest.approx(here[0], rel=1e-9)
    assert there[1] == pytest.approx(1e6 * here[1], rel=1e-6)


def test_draws_that_are_all_one_have_no_tail() -> None:
    assert tail_of(np.full(100, 3.0), 3.0, 10_000)[1] == 0


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
