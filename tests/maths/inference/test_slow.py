"""Slow noise integrated out, and roots."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy import optimize, sparse, special

from cmm_uq.base.points import Floats
from cmm_uq.maths.inference import marginal as module
from cmm_uq.maths.inference.linear_model import LinearModel, Unknown, solve
from cmm_uq.maths.inference.marginal import Marginal
from cmm_uq.maths.inference.noise import AXES, GROWING, GROWTH, SLOW, Components, Sizes
from cmm_uq.maths.inference.slow import SlowFirst, root

M, TIMES = 36, 12
PART = np.repeat(np.linspace(0.0, 1.0, TIMES) ** 1.3, 3)
AXIS = np.tile(np.arange(3), TIMES)


def three_axes(cosines: int = 5) -> Components:
    """Twelve points, three coordinates each, whose slow noises are independent and of one kind."""
    frequency = np.arange(float(cosines))
    waves = np.where(frequency > 0, np.sqrt(2), 1.0) * np.cos(np.pi * frequency * PART[:, None])
    slow = (np.eye(3)[AXIS][:, :, None] * waves[:, None]).reshape(M, -1)
    shares = np.column_stack([np.eye(3)[AXIS], np.zeros(M), np.zeros(M), np.ones(M)])
    turn = sparse.csr_array(np.eye(M))
    return Components(turn, shares, slow, np.tile(frequency, 3), (AXES, SLOW), gap=1 / 11, time=PART)


def linear() -> LinearModel:
    random = np.random.default_rng(3)
    unknowns = tuple(Unknown((name, name), "1", 0.0, 3.0, 3.0) for name in "ab")
    placing = (PART < 0.5).astype(float)[:, None] * np.eye(3)[AXIS]
    return LinearModel(random.standard_normal(M), random.standard_normal((M, 2)), unknowns, placing, np.ones(M), None)


SIZES = Sizes(
    np.array([[1.0, 2.0, 0.5], [0.3, 0.4, 0.5], [1.0, 1.0, 1.0], [1.0, 2.0, 0.5]]), np.zeros(4), np.zeros(4),
    np.array([1.2, 3.0, 0.2, 1.2]), np.array([4.0, 30.0, 1.0, 0.0]),
)  # fmt: skip


def test_the_axes_are_eliminated_one_by_one() -> None:
    noise = three_axes()
    groups = SlowFirst(noise.slow, np.ones((M, 1)), np.zeros(M, dtype=np.int64), np.ones(1), np.eye(15)).groups
    assert [set(AXIS[rows]) for _, rows in groups] == [{0}, {1}, {2}]
    assert sorted(np.concatenate([columns for columns, _ in groups])) == list(range(15))


def test_cosines_that_meet_in_one_observation_are_eliminated_together() -> None:
    slow = three_axes().slow.copy()
    slow[0, 5] = 1e-3
    groups = SlowFirst(slow, np.ones((M, 1)), np.zeros(M, dtype=np.int64), np.ones(1), np.eye(15)).groups
    assert sorted(len(columns) for columns, _ in groups) == [5, 10]


@pytest.mark.parametrize("walks", [0.0, 0.7])
@pytest.mark.parametrize("alike", [False, True])
def test_what_is_left_is_the_schur_complement(walks: float, alike: bool) -> None:
    """Of the precision of cosines and other columns together, by dense algebra; a walk beside one noise is turned."""
    random, noise = np.random.default_rng(4), three_axes()
    others, classes = random.standard_normal((M, 4)), (AXIS + 3 * (PART > 0.5)).astype(np.int64)
    v = np.array([[1.0, 4.0, 0.25, 1.5, 6.0, 0.375], [2.0, 0.5, 3.0, 3.0, 0.75, 4.5]])
    base = np.array([2.0, 2.0, 2.0, 3.0, 3.0, 3.0]) if alike else np.ones(6)
    prior, own = np.diag([0.0, 0.1, 0.2, 0.3]), random.uniform(0.5, 2.0, (2, 15))
    walk = np.diag(random.uniform(0.5, 2.0, 15)) + noise.tied
    known = np.where(walks, 0.0, own)
    first = SlowFirst(noise.slow, others, classes, base, walk)
    left, logs = first.precision(v, prior.ravel(), known, np.array([walks, 2 * walks]))
    for i, times in enumerate([walks, 2 * walks]):
        weight = np.diag(1 / v[i, classes])
        S = noise.slow.T @ weight @ noise.slow + np.diag(known[i]) + times * walk
        across = noise.slow.T @ weight @ others
        wanted = others.T @ weight @ others + prior - across.T @ np.linalg.solve(S, across)
        assert left[i] == pytest.approx(wanted, rel=1e-10, abs=1e-10)
        assert logs[i] == pytest.approx(0.5 * np.linalg.slogdet(S)[1], rel=1e-12)


def test_density_and_draws_do_not_depend_on_what_is_eliminated_first(monkeypatch: pytest.MonkeyPatch) -> None:
    noise, model = three_axes(), linear()
    first = Marginal(model, noise, solve(model))
    monkeypatch.setattr(module, "_MOST_FREE", -1)
    last = Marginal(model, noise, solve(model))
    assert first.log_likelihood(SIZES)[0] - last.log_likelihood(SIZES)[0] == pytest.approx(np.zeros(4), abs=1e-7)
    assert first.log_likelihood(SIZES)[1] == pytest.approx(last.log_likelihood(SIZES)[1], rel=1e-8)
    draws = [each.draw(SIZES, np.random.default_rng(5)) for each in (first, last)]
    assert draws[0] == pytest.approx(draws[1], rel=1e-7)


def test_where_no_noise_grows_all_lengths_are_of_one_class_and_the_density_is_the_same(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """With and without growth in one call, beside the density that leaves slow noise among the other columns."""
    even, model = three_axes(), linear()
    shares = even.shares.copy()
    shares[:, GROWING] = (0.2 + PART) ** 2
    noise = replace(even, shares=shares, possible=(AXES, GROWTH, SLOW))
    sizes = replace(SIZES, growth=np.array([0.0, 0.8, 0.0, 1.5]))
    first = Marginal(model, noise, solve(model))
    assert first._slow_first is not None
    assert first._slow_first_even[0].count == 3 < first._slow_first.count
    monkeypatch.setattr(module, "_MOST_FREE", -1)
    last = Marginal(model, noise, solve(model))
    assert first.log_likelihood(sizes)[0] - last.log_likelihood(sizes)[0] == pytest.approx(np.zeros(4), abs=1e-7)
    assert first.log_likelihood(sizes)[1] == pytest.approx(last.log_likelihood(sizes)[1], rel=1e-8)


def test_sizes_that_come_again_are_drawn_for_as_if_alone() -> None:
    """Each of three, two of them mixed, by mean and standard deviation against draws of its own."""
    noise, model = three_axes(), linear()
    marginal, which = Marginal(model, noise, solve(model)), np.tile([0, 3, 1, 3], 5000)
    mixed = marginal.draw(SIZES.at(which), np.random.default_rng(5))
    for i in (0, 1, 3):
        own, alone = mixed[which == i], marginal.draw(SIZES.at(np.full(5000, i)), np.random.default_rng(6))
        u, count = alone.std(axis=0), len(own)
        assert len(np.unique(own[:, 0])) == count
        assert np.all(np.abs(own.mean(axis=0) - alone.mean(axis=0)) < 4.5 * u * np.sqrt(1 / count + 1 / 5000))
        assert own.std(axis=0) == pytest.approx(u, rel=4.5 * np.sqrt(0.5 / count + 0.5 / 5000))


def kernel(rate: float, sd: float) -> Floats:
    return np.asarray(sd**2 * np.exp(-rate * np.abs(PART[:, None] - PART)) * (AXIS[:, None] == AXIS))


def test_the_covariance_in_full_is_that_of_an_ornstein_uhlenbeck_process_along_each_axis() -> None:
    columns = three_axes().exact(SIZES.at([1]))
    assert columns @ columns.T == pytest.approx(kernel(30.0, 3.0), abs=1e-9)
    columns = three_axes().exact(SIZES.at([3]))
    walked = 2 * 1.2**2 * np.minimum(PART[:, None], PART) * (AXIS[:, None] == AXIS)
    assert columns @ columns.T == pytest.approx(walked, abs=1e-9)


def test_cosines_leave_out_as_much_as_they_say() -> None:
    """Variance of the process less that of the cosines, as a part of what no other reading shares."""
    noise = three_axes()
    _, slow = noise.variances(SIZES)
    walked = SIZES.slow**2 * np.where(SIZES.rate > 0, 1, 1 / 3)  # a walk's cosines without the constant
    left = walked - np.where(SIZES.rate > 0, slow[:, 0], 0) - slow[:, 1:5].sum(axis=1)
    assert noise.quick(SIZES) == pytest.approx(left / (left + SIZES.coordinate**2), rel=1e-12)
    assert noise.quick(replace(SIZES, slow=np.zeros(4))) == pytest.approx(np.zeros(4))


def test_the_slowest_cosines_are_those_of_every_axis() -> None:
    few = three_axes().slowest(2)
    assert few.slow.shape == (M, 9)
    assert list(few.frequency) == [0, 1, 2] * 3
    assert few.most == 2
    assert np.all(few.slow[AXIS == 1][:, [0, 1, 2, 6, 7, 8]] == 0)


FUNCTIONS = {
    "polynomial": lambda x: x**3 - 2 * x - 5,
    "normal quantile": lambda x: float(special.ndtr(x)) - 0.975,
    "flat": lambda x: (x - 1) ** 3 + 1e-3 * (x - 1),
    "steep": lambda x: math.atan(1e6 * (x - 0.3)),
}


@pytest.mark.parametrize("name", FUNCTIONS)
@given(st.floats(-9, 0), st.floats(2.2, 9), st.sampled_from([1e-3, 1e-9, 1e-12]))
def test_every_step_is_that_of_scipy(name: str, low: float, high: float, tolerance: float) -> None:
    """To the last bit, and at the same places."""
    places, own = [], []

    def noting(to: list[float]):
        return lambda x: (to.append(x), FUNCTIONS[name](x))[1]

    assert root(noting(own), low, high, tolerance) == optimize.brentq(noting(places), low, high, xtol=tolerance)
    assert own == places


def test_wallis_root() -> None:
    """x³ − 2x − 5 = 0, the equation on which Wallis showed Newton's method: 2.094 551 481 542 326 59…"""
    assert root(FUNCTIONS["polynomial"], 0, 4, 1e-15) == pytest.approx(2.09455148154232659, rel=1e-15)


def test_a_root_at_an_end_is_that_end() -> None:
    assert root(lambda x: x - 1, 1.0, 2.0, 1e-9) == 1.0
    assert root(lambda x: x - 2, 1.0, 2.0, 1e-9) == 2.0


def test_one_sign_at_both_ends_is_refused() -> None:
    with pytest.raises(ValueError, match="one sign"):
        root(lambda x: x * x + 1, -1.0, 1.0, 1e-9)


def test_a_function_that_is_no_number_is_refused() -> None:
    with pytest.raises(ValueError, match="not a number"):
        root(lambda x: x - 1 if x < 1.2 else math.nan, 0.0, 2.0, 1e-9)
