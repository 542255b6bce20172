"""Whether ranks are uniform: χ² of bins, the band of their distribution function, and how wide the posteriors are for them."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np
from scipy import stats

from benchmarks.ranks.ranking import DRAWS

RANKS = DRAWS + 1
_BINS, _LEAST = (10, 5, 4, 2), 5
"""Bins, as many as leave five expected ranks in each."""
_SIMULATED = 20_000


def chi_squared(ranks: Sequence[int]) -> float:
    """Probability of bins that differ as much or more; not a number of fewer than ten ranks."""
    bins = next((bins for bins in _BINS if len(ranks) >= _LEAST * bins), 0)
    if not bins:
        return float("nan")
    counts = np.bincount(np.asarray(ranks) * bins // RANKS, minlength=bins)
    expected = len(ranks) / bins
    return float(stats.chi2.sf(np.sum((counts - expected) ** 2) / expected, bins - 1))


def band(ranks: Sequence[int]) -> float:
    """The smallest level whose simultaneous band of the distribution function the ranks leave.

    The band is as probable at every rank by itself (binomial), and its level that of leaving it anywhere, by simulation
    (Säilynoja, Bürkner, Vehtari 2022, Statistics and Computing 32, 32, section 3).
    """
    counts = np.cumsum(np.bincount(ranks, minlength=RANKS))[:-1]
    least = _pointwise(len(ranks))[np.arange(RANKS - 1), counts].min()
    # simulated ones that are as extreme are so by the same binomial probabilities, but for rounding
    return float((1 + np.sum(_simulated(len(ranks)) <= least * (1 + 1e-9))) / (1 + _SIMULATED))


def width(recordings: Sequence[Sequence[int]]) -> tuple[float, float, float]:
    """Standard deviation of the posteriors over the right one, and its 95 % interval, from ranks recording by recording.

    Of normal posteriors that are f times as wide as they should be, and u the part of one that lies below the truth,
    E (2·u − 1)² = 2/π·arcsin(1/(1 + f²)), which is ⅓ where f is one. The ranks of one recording may depend on each other; the
    interval is from the differences between recordings.
    """
    squares = [(2 * (np.asarray(ranks) + 0.5) / RANKS - 1) ** 2 for ranks in recordings]
    sums, of = np.array([each.sum() for each in squares]), np.array([len(each) for each in squares])
    mean = float(sums.sum() / of.sum())
    n = len(sums)
    error = float(np.sqrt(n / (n - 1) * np.sum((sums - mean * of) ** 2))) / of.sum()
    value, low, high = (_times(mean + k * error) for k in (0.0, 1.96, -1.96))
    return value, low, high


def _times(mean: float) -> float:
    s = np.sin(np.pi / 2 * np.clip(mean, 1e-6, 1 - 1e-6))
    return float(np.sqrt((1 - s) / s))


@cache
def _pointwise(count: int) -> np.ndarray:
    """Two-sided binomial probability (RANKS − 1, count + 1) of so many ranks up to each."""
    part, hits = np.arange(1, RANKS)[:, None] / RANKS, np.arange(count + 1)
    return 2 * np.minimum(stats.binom.cdf(hits, count, part), stats.binom.sf(hits - 1, count, part))


@cache
def _simulated(count: int) -> np.ndarray:
    """The smallest of these probabilities of each of many sets of uniform ranks."""
    random = np.random.default_rng(count)
    drawn = random.multinomial(count, np.full(RANKS, 1 / RANKS), size=_SIMULATED).cumsum(axis=1)[:, :-1]
    return np.asarray(_pointwise(count)[np.arange(RANKS - 1), drawn].min(axis=1))
