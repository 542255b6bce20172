"""How many independent draws chains are worth.

The bulk effective sample size of Vehtari, Gelman, Simpson, Carpenter and Bürkner (2021), "Rank-normalization, folding, and
localization: an improved R-hat", Bayesian Analysis 16(2), sections 3.2 and 4.3.
"""

from __future__ import annotations

import numpy as np

from cmm_uq.base.points import Floats
from cmm_uq.maths.inference.ensembles import normal_scores, split


def bulk_ess(chains: Floats, scores: Floats | None = None) -> float:
    """Smallest bulk effective sample size of the parameters.

    Parameters
    ----------
    chains : (c, n, d) draws, n at least 8.
    scores : of the chains' halves, where they are known already.
    """
    scores = normal_scores(split(chains)) if scores is None else scores
    return min(_effective(scores[:, :, i]) for i in range(scores.shape[2]))


def _effective(values: Floats) -> float:
    """Of one quantity, (c, n): the draws over their integrated autocorrelation time (equations 10 and 11)."""
    c, n = values.shape
    if np.ptp(values) == 0:
        return float(c * n)  # what does not vary is known from any draw
    correlation = _autocorrelation(values)
    pairs = correlation[: (n - 1) // 2 * 2].reshape(-1, 2).sum(axis=1)
    ends = np.flatnonzero(pairs <= 0)  # Geyer's initial positive sequence: its sums of pairs are all positive
    last = int(ends[0]) if len(ends) else len(pairs) - 1
    monotone = np.minimum.accumulate(pairs[:last]) if last else pairs[:0]  # and, as they must be, never growing
    time = -1.0 + 2.0 * float(monotone.sum()) + max(float(correlation[2 * last]), 0.0)
    draws = c * n
    return float(draws / max(time, 1.0 / np.log10(draws)))


def _autocorrelation(values: Floats) -> Floats:
    """(n,) at every lag, of (c, n), from the variances within the chains and between them (equation 10)."""
    n = values.shape[1]
    about = values - values.mean(axis=1, keepdims=True)
    spectrum = np.fft.rfft(about, n=2 * n, axis=1)
    covariance = np.fft.irfft(np.abs(spectrum) ** 2, n=2 * n, axis=1)[:, :n].mean(axis=0) / n
    within = covariance[0] * n / (n - 1)
    whole = covariance[0] + values.mean(axis=1).var(ddof=1)
    found = 1.0 - (within - covariance) / whole
    found[0] = 1.0
    return np.asarray(found, dtype=np.float64)
