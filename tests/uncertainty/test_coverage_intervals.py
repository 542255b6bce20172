"""Coverage intervals of JCGM 101:2008 7.7: against brute force, whatever the number of draws."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cmm_uq.uncertainty.coverage_intervals import (
    Tails,
    both_intervals,
    inner_draws,
    settled_shortest_interval,
    shortest_interval,
    symmetric_interval,
)


def by_definition(draws: np.ndarray, p: float) -> list[float]:
    """7.7.1 to 7.7.4, numbering the draws from one."""
    y, M = np.concatenate([[np.nan], np.sort(draws)]), len(draws)
    q = int(p * M) if float(p * M).is_integer() else int(p * M + 0.5)
    lengths = [y[r + q] - y[r] for r in range(1, M - q + 1)]
    shortest = int(np.argmin(lengths)) + 1
    r = (M - q) // 2 if (M - q) % 2 == 0 else (M - q + 1) // 2
    return [y[shortest], y[shortest + q], y[r], y[r + q]]


@given(
    draws=st.lists(st.floats(-1e3, 1e3), min_size=100, max_size=150),
    p=st.sampled_from([0.5, 0.68, 0.8, 0.9, 0.95]),
)
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
