"""Ranks of truths in posteriors whose law is known, and the tests of whether they are uniform."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from benchmarks.ranks.ranking import DRAWS, rank
from benchmarks.ranks.uniformity import RANKS, band, chi_squared, width

RECORDINGS = 2000


def normal_mean(narrower: float = 1.0, shifted: float = 0.0) -> list[list[int]]:
    """Ranks of three normal means, known beforehand as N(1, 2²), each from five readings with σ = 3 (conjugate)."""
    random = np.random.default_rng(1)
    precision = 1 / 2**2 + 5 / 3**2
    found = []
    for truth in random.normal(1, 2, (RECORDINGS, 3)):
        readings = truth[:, None] + 3 * random.standard_normal((3, 5))
        mean = (1 / 2**2 + readings.sum(axis=1) / 3**2) / precision + shifted / np.sqrt(precision)
        draws = mean + narrower / np.sqrt(precision) * random.standard_normal((DRAWS, 3))
        found.append([rank(truth[i], draws[:, i], random) for i in range(3)])
    return found


def first(recordings: list[list[int]]) -> list[int]:
    return [ranks[0] for ranks in recordings]


def test_ranks_in_the_conjugate_posterior_of_a_normal_mean_are_uniform() -> None:
    recordings = normal_mean()
    assert min(first(recordings)) >= 0
    assert max(first(recordings)) <= DRAWS
    assert chi_squared(first(recordings)) > 1e-3
    assert band(first(recordings)) > 1e-3
    value, low, high = width(recordings)
    assert low < 1 < high
    assert high - low < 0.06
    assert value == pytest.approx(1, abs=0.04)


def test_a_posterior_that_is_a_fifth_too_narrow_is_found_and_measured() -> None:
    recordings = normal_mean(narrower=0.8)
    assert chi_squared(first(recordings)) < 1e-6
    assert band(first(recordings)) < 1e-3
    value, low, high = width(recordings)
    assert low < 0.8 < high < 0.9
    assert value == pytest.approx(0.8, abs=0.03)


def test_a_posterior_that_is_shifted_by_a_fifth_of_its_width_leaves_the_band() -> None:
    ranks = first(normal_mean(shifted=0.2))
    assert chi_squared(ranks) < 1e-6
    assert band(ranks) < 1e-3


def test_a_component_that_is_absent_as_often_in_truth_as_in_the_draws_has_uniform_ranks() -> None:
    """Half of truths and draws are zero: a posterior that knows no more than its prior."""
    random = np.random.default_rng(2)

    def sizes(count: int) -> np.ndarray:
        return np.maximum(random.standard_normal(count), 0.0)

    ranks = [rank(sizes(1)[0], sizes(DRAWS), random) for _ in range(RECORDINGS)]
    assert chi_squared(ranks) > 1e-3
    assert band(ranks) > 1e-3


def test_a_rank_counts_the_draws_below_and_breaks_ties_over_all_places() -> None:
    random = np.random.default_rng(3)
    assert rank(2.5, np.array([1.0, 2.0, 3.0]), random) == 2
    assert {rank(0.0, np.array([-1.0, 0.0, 0.0, 1.0]), random) for _ in range(200)} == {1, 2, 3}


def test_chi_squared_is_that_of_scipy_in_ten_bins_and_takes_fewer_of_few_ranks() -> None:
    ranks = np.random.default_rng(4).integers(0, RANKS, 73).tolist()
    assert chi_squared(ranks) == pytest.approx(stats.chisquare(np.histogram(ranks, 10, (0, RANKS))[0]).pvalue)
    assert chi_squared(ranks[:30]) == pytest.approx(stats.chisquare(np.histogram(ranks[:30], 5, (0, RANKS))[0]).pvalue)
    assert np.isnan(chi_squared(ranks[:9]))


def test_uniform_ranks_leave_the_band_as_often_as_its_level_says() -> None:
    """Of 2000 sets of forty: 5 % ± 4 standard errors, and no more than that since the ranks are discrete."""
    sets = np.random.default_rng(5).integers(0, RANKS, (2000, 40))
    assert np.mean([band(each) <= 0.05 for each in sets]) == pytest.approx(0.05, abs=0.02)
