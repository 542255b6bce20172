"""The components of noise: what is known of them beforehand, and their covariance, written out a second time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import sparse

from cmm_uq.maths.inference.noise import (
    ABSENT,
    AXES,
    AXES_SPREAD,
    GROWTH,
    PLACING,
    SLOW,
    WALK,
    Components,
    Sizes,
    slow_variances,
)

M = 12


def components(possible: tuple[str, ...] = (AXES, PLACING, GROWTH, SLOW)) -> Components:
    """Six pairs of repeats, turned to mean and difference, along directions that differ, at twelve times."""
    half = np.sqrt(0.5)
    blocks = np.kron(np.eye(6), np.array([[half, half], [half, -half]]))
    parts = np.repeat(np.random.default_rng(1).dirichlet(np.ones(3), 6), 2, axis=0)
    length = np.repeat(np.linspace(0.0, 1.0, 6), 2)
    shares = np.column_stack([parts, np.tile([2.0, 0.0], 6), length**2, np.ones(M)])
    time = np.linspace(0, 1, M)
    frequency = np.arange(6.0)
    slow = np.where(frequency > 0, np.sqrt(2), 1.0) * np.cos(np.pi * frequency * time[:, None])
    return Components(sparse.csr_array(blocks), shares, slow, frequency, possible)


def covariances(noise: Components, sizes: Sizes) -> np.ndarray[tuple[int, int, int], np.dtype[np.float64]]:
    """(w, M, M) by the definition of each component, observation by observation."""
    parts, length, time = noise.shares[:, :3], np.repeat(np.linspace(0, 1, 6), 2), np.linspace(0, 1, M)
    slow, fast = slow_variances(sizes.slow, sizes.rate, noise.frequency)
    own = sizes.reading**2 @ parts.T + (length * sizes.growth[:, None]) ** 2 + fast[:, None]
    found = own[:, None] * np.eye(M) + sizes.placing[:, None, None] ** 2 * np.kron(np.eye(6), np.ones((2, 2)))
    for k, variance in zip(noise.frequency, slow.T, strict=True):
        wave = (np.sqrt(2) if k else 1.0) * np.cos(np.pi * k * time)
        walk = wave - wave[0] if k else wave  # it begins at zero
        outer = np.where((sizes.rate > 0)[:, None, None], np.outer(wave, wave), np.outer(walk, walk))
        found += variance[:, None, None] * outer
    return np.asarray(found)


def covariance(noise: Components, sizes: Sizes) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    """(M, M) of the first sizes."""
    return np.asarray(covariances(noise, sizes)[0])


SIZES = Sizes(np.array([[1.0, 2.0, 0.5]]), np.array([1.5]), np.array([0.7]), np.array([1.2]), np.array([4.0]))


WALKING = replace(SIZES, rate=np.zeros(1))
EITHER = pytest.mark.parametrize("sizes", [SIZES, WALKING], ids=["returning", "walking"])


@EITHER
def test_noise_made_anew_has_the_covariance_of_its_components(sizes: Sizes) -> None:
    noise = components()
    drawn = noise.repeated(sizes, 200_000, np.random.default_rng(2))[0]
    wanted = covariance(noise, sizes)
    scale = np.sqrt(np.diag(wanted))
    assert np.abs((np.cov(drawn, rowvar=False) - wanted) / np.outer(scale, scale)).max() < 0.015  # 6/√200 000


@EITHER
def test_what_whitens_the_noise_leaves_the_unit_covariance_of_one_reading(sizes: Sizes) -> None:
    noise = components()
    white = noise.white(sizes)
    turned = white(np.eye(M))
    sigma2 = np.mean(sizes.reading**2)
    assert np.allclose(turned @ covariance(noise, sizes) @ turned.T, sigma2 * np.eye(M), atol=1e-9)


@EITHER
def test_the_variance_of_a_weighted_sum_is_that_of_the_slow_part_of_the_covariance(sizes: Sizes) -> None:
    noise, weights = components(), np.random.default_rng(9).standard_normal(M)
    waves = noise.waves(sizes)
    assert noise.slow_along(weights, sizes)[0] == pytest.approx(weights @ waves @ waves.T @ weights)
    _, fast = slow_variances(sizes.slow, sizes.rate, noise.frequency)
    without = covariance(noise, replace(sizes, slow=np.zeros(1))) + fast[0] * np.eye(M)
    assert waves @ waves.T + without == pytest.approx(covariance(noise, sizes))


@pytest.mark.parametrize("name", [PLACING, GROWTH, SLOW])
def test_a_component_is_absent_as_often_as_its_prior_says(name: str) -> None:
    noise = components((name,))
    latent = np.random.default_rng(3).standard_normal((100_000, noise.dimension))
    sizes = noise.sizes(latent)
    ratio = getattr(sizes, name) / sizes.coordinate
    assert np.mean(ratio == 0) == pytest.approx(ABSENT[name], abs=0.006)  # four standard errors
    present = ratio[ratio > 0]
    assert np.median(present) == pytest.approx(1.0, abs=0.05)  # of a half-Cauchy distribution of scale one
    assert np.mean(present > 10) == pytest.approx(2 / np.pi * np.arctan(0.1), abs=0.006)


def test_axes_are_equal_as_often_as_the_prior_says_and_keep_their_root_mean_square() -> None:
    noise = components((AXES,))
    latent = np.random.default_rng(4).standard_normal((100_000, noise.dimension))
    reading = noise.sizes(latent).reading
    assert np.mean(np.ptp(np.log(reading), axis=1) < 1e-12) == pytest.approx(ABSENT[AXES], abs=0.006)
    assert np.allclose(0.5 * np.log(np.mean(reading**2, axis=1)), latent[:, 0])
    apart = np.log(reading) - np.log(reading).mean(axis=1, keepdims=True)
    present = apart[np.ptp(apart, axis=1) > 1e-12]
    # two contrasts, normal with a half-normal spread s: 2/3 of the sum of their variances E s² = 0.49 in each logarithm
    assert np.mean(present**2, axis=0) == pytest.approx(2 / 3 * AXES_SPREAD**2, rel=0.05)
    assert np.mean(present) == pytest.approx(0.0, abs=1e-12)


def test_the_first_number_says_how_far_neighbouring_readings_scatter_about_each_other() -> None:
    """Half the variance of their difference: σ² + mean growth + s²·(1 − exp(−rate·gap)), Ornstein–Uhlenbeck's process."""
    noise = replace(components((PLACING, GROWTH, SLOW)), gap=0.05)
    latent = np.random.default_rng(5).standard_normal((1000, noise.dimension))
    sizes = noise.sizes(latent)
    growth = np.mean(np.linspace(0.0, 1.0, 6) ** 2)
    changed = np.where(sizes.rate > 0, 1 - np.exp(-0.05 * sizes.rate), 0.05)  # of a walk, half of 2·s²·gap
    half = sizes.reading[:, 0] ** 2 + growth * sizes.growth**2 + sizes.slow**2 * changed
    assert np.any(sizes.slow > sizes.reading[:, 0])
    assert np.allclose(half, np.exp(2 * latent[:, 0]))


@pytest.mark.parametrize("rate", [1.0, 5.0, 20.0])
def test_slow_noise_is_an_ornstein_uhlenbeck_process(rate: float) -> None:
    """Its correlation exp(−rate·|t − t'|), away from the ends, where cosines of whole half turns hold it too flat."""
    frequency = np.arange(400.0)
    variances, fast = slow_variances(np.array([2.0]), np.array([rate]), frequency)
    t = np.linspace(0.3, 0.7, 9)
    waves = np.where(frequency > 0, np.sqrt(2), 1.0) * np.cos(np.pi * frequency * t[:, None])
    found = (waves * variances) @ waves.T + fast[0] * np.eye(9)
    apart = np.abs(t[:, None] - t)
    differences = found[np.diag_indices(9)][:, None] + found.diagonal() - 2 * found
    assert np.allclose(differences, 2 * 4 * (1 - np.exp(-rate * apart)), atol=0.12 * 4)
    assert variances.sum() + fast[0] == pytest.approx(4.0, rel=1e-3)


def test_a_walk_begins_at_zero_and_varies_in_proportion_to_time() -> None:
    """Brownian motion: covariance 2·s²·min(t, t'), whose mean square over the recording is s²."""
    frequency, t = np.arange(400.0), np.linspace(0.0, 1.0, 9)
    variances, fast = slow_variances(np.array([3.0]), np.zeros(1), frequency)
    waves = np.where(frequency > 0, np.sqrt(2) * (np.cos(np.pi * frequency * t[:, None]) - 1), 1.0)
    found = (waves * variances) @ waves.T + fast[0] * np.eye(9)
    assert np.allclose(found, 2 * 9 * np.minimum(t[:, None], t), atol=0.025)


def test_slow_noise_walks_as_often_as_it_returns() -> None:
    latent = np.random.default_rng(6).standard_normal((40_000, components((SLOW,)).dimension))
    rate = components((SLOW,)).sizes(latent).rate
    assert np.mean(rate == 0) == pytest.approx(WALK, abs=0.01)  # four standard errors
    returning = np.log(rate[rate > 0])
    assert np.quantile(returning, [0.25, 0.5, 0.75]) == pytest.approx(
        np.log(200) * np.array([0.25, 0.5, 0.75]), abs=0.1
    )


def test_a_stated_noise_is_good_to_a_fifth_or_now_and_then_wrong() -> None:
    """The prior of ln σ as a density: one in ten of standard deviation one, the rest of 0.2, about what is stated."""
    noise = Components(
        *[getattr(components(), name) for name in ("turn", "shares", "slow", "frequency")], (), stated=2e-3
    )
    off = np.linspace(-8, 8, 20_001)
    density = np.exp(noise.log_prior_of_sigma(np.log(2e-3) + off)) / np.sqrt(2 * np.pi)
    assert np.trapezoid(density, off) == pytest.approx(1.0, abs=1e-6)
    assert np.trapezoid(density * off**2, off) == pytest.approx(0.9 * 0.04 + 0.1, abs=1e-4)


def test_observations_of_one_variance_are_one_class() -> None:
    index, shares = components().classes
    assert len(shares) == M  # six directions, each with a mean and a difference
    assert np.allclose(shares[index], components().shares)
