"""What noise leaves uncertain of a weighted sum: the covariance written out, and a mixture of normal distributions."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from cmm_uq.maths.inference.draws import uncertainty_of_sum
from cmm_uq.maths.inference.noise import Sizes
from tests.maths.inference.test_noise import SIZES, M, components, covariance

WEIGHTS = np.random.default_rng(8).standard_normal(M)


def test_given_the_sizes_it_is_that_of_the_whole_covariance_and_normal() -> None:
    """u² = wᵀ·Σ·w + what comes beside; half the interval is 1.96 u."""
    noise = components()
    u, half = uncertainty_of_sum(noise, SIZES, WEIGHTS, beside=0.7)
    assert u == pytest.approx(np.sqrt(WEIGHTS @ covariance(noise, SIZES) @ WEIGHTS + 0.49))
    assert half == pytest.approx(stats.norm.ppf(0.975) * u)


def test_over_sizes_it_is_a_mixture_whose_interval_holds_95_percent() -> None:
    """Half of the draws with twice the noise: against the distribution function of the mixture."""
    both = Sizes(*(np.concatenate([part, f]) for part, f in (
        (SIZES.reading, 2 * SIZES.reading), (SIZES.placing, 2 * SIZES.placing), (SIZES.growth, 2 * SIZES.growth),
        (SIZES.slow, 2 * SIZES.slow), (SIZES.rate, SIZES.rate),
    )))  # fmt: skip
    small, _ = uncertainty_of_sum(components(), SIZES, WEIGHTS)
    u, half = uncertainty_of_sum(components(), both, WEIGHTS)
    assert u == pytest.approx(small * np.sqrt(2.5))
    assert np.mean(stats.norm.cdf(half, scale=[small, 2 * small])) == pytest.approx(0.975)


def test_without_weights_nothing_is_uncertain() -> None:
    assert uncertainty_of_sum(components(), SIZES, np.zeros(M)) == (0.0, 0.0)
