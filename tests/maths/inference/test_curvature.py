"""Posteriors that bend, and those of shaped columns."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cmm_uq.base.points import Floats
from cmm_uq.base.units import unit
from cmm_uq.maths.inference.curvature import FARTHEST, Shaped, bend, bent, sample_shaped
from cmm_uq.maths.inference.ensembles import ENSEMBLES
from cmm_uq.maths.inference.linear_model import LinearModel, Unknown, likeliest
from cmm_uq.maths.inference.noise import Sizes
from cmm_uq.maths.inference.posterior import Density, NoisyPosterior

SIGMA = 1e-3
GRID = np.linspace(-6.0, 6.0, 1201)


def model(prior_sd: float = 3.0) -> LinearModel:
    """Three observations of two parameters, mm; the first is known to about 0.7 of its unit, the second hardly."""
    unknowns = tuple(Unknown(("effect", name), unit("ppm"), 0.0, prior_sd, 1.0) for name in "ab")
    design = SIGMA * np.array([[1.0, 0.3], [1.0, -0.3], [0.2, 0.5]])
    observed = SIGMA * np.array([1.2, 0.9, 0.4])
    return LinearModel(observed, design, unknowns, np.zeros((3, 0)), np.ones(3), SIGMA)


def remainder(values: Floats) -> Floats:
    """Squares, a product, and a slope that the design has wrong by a tenth."""
    a, b = values
    return SIGMA * np.array([0.1 * a + 0.08 * a**2, 0.05 * a * b, 0.06 * b**2])


def exact(linear: LinearModel) -> tuple[Floats, Floats]:
    """Mean and standard deviation of the posterior of both parameters, summed over a grid."""
    a, b = (g.ravel() for g in np.meshgrid(GRID, GRID, indexing="ij"))
    values = np.column_stack([a, b])
    bends = SIGMA * np.column_stack([0.1 * a + 0.08 * a**2, 0.05 * a * b, 0.06 * b**2])
    missing = (linear.observed - values @ linear.design.T - bends) / SIGMA
    log = -0.5 * (np.sum(missing**2, axis=1) + np.sum(values**2, axis=1) / linear.prior_sd[0] ** 2)
    weight = np.exp(log - log.max())
    mean = weight @ values / weight.sum()
    return mean, np.sqrt(weight @ (values - mean) ** 2 / weight.sum())


def drawn(linear: LinearModel, seed: int) -> NoisyPosterior:
    mean, covariance, _ = Density(linear).conditional(float(np.log(SIGMA)))
    steps, walkers = 1000, 20
    count = ENSEMBLES * steps * walkers
    one = np.ones(count)
    return NoisyPosterior(
        unknowns=linear.unknowns, draws=np.random.default_rng(seed).multivariate_normal(mean, covariance, count),
        sigma=SIGMA * one, seed=seed, sampler="", ess_min=count, rhat_max=1.0, steps=steps, autocorrelation_time=1.0,
        sizes=Sizes(np.full((count, 3), SIGMA), 0 * one, 0 * one, 0 * one, one),
    )  # fmt: skip


def test_bent_draws_have_the_moments_of_the_exact_posterior() -> None:
    """80 000 draws: a mean is good to 0.01 of a standard deviation, and the linear model is off by many times that."""
    linear = model()
    straight = drawn(linear, seed=4)
    found = bent(straight, bend(linear, np.zeros(2), SIGMA, remainder))
    mean, sd = exact(linear)
    assert np.abs(straight.draws.mean(axis=0) - mean).max() > 0.1 * sd.max()
    np.testing.assert_allclose(found.draws.mean(axis=0), mean, atol=0.03 * sd.min())
    np.testing.assert_allclose(found.draws.std(axis=0), sd, rtol=0.03)


def test_draws_that_were_kept_of_every_third_step_are_bent_as_they_stand() -> None:
    linear = model()
    straight = drawn(linear, 1)
    bending = bend(linear, np.zeros(2), SIGMA, remainder)
    of_more = replace(straight, steps=3 * straight.steps + 1, every=3)
    np.testing.assert_array_equal(bent(of_more, bending).draws, bent(straight, bending).draws)


def test_bending_is_told_in_standard_deviations_of_what_it_moves() -> None:
    """One parameter known to 1 unit: ½·0.01·(4 units)² is 0.08 of its standard deviation, a slope of 0.01 another 0.04."""
    linear = LinearModel(
        np.zeros(1), np.array([[SIGMA]]), (Unknown(("effect", "a"), unit("ppm"), 0.0, 1e6, 1.0),),
        np.zeros((1, 0)), np.ones(1), SIGMA,
    )  # fmt: skip
    found = bend(linear, np.zeros(1), SIGMA, lambda v: SIGMA * (0.01 * v + 0.005 * v**2))
    assert found.largest == pytest.approx(0.5 * 0.01 * FARTHEST**2 + 0.01 * FARTHEST, rel=1e-6)


def test_the_likeliest_parameters_are_the_mean_of_the_normal_posterior() -> None:
    linear = model()
    mean, _, _ = Density(linear).conditional(float(np.log(SIGMA)))
    np.testing.assert_allclose(likeliest(linear, SIGMA), mean, rtol=1e-9)


M = 60


def wave(x: Floats, period: float) -> Floats:
    return np.column_stack([np.sin(2 * np.pi * x / period), np.cos(2 * np.pi * x / period)])


def model_shaped(
    x: Floats, noise: float, sigma: float | None, truth: tuple[float, float, float], seed: int
) -> LinearModel:
    """A line and a wave; lengths in mm as everywhere."""
    offset, amplitude, period = truth
    random = np.random.default_rng(seed)
    y = offset + amplitude * np.sin(2 * np.pi * x / period) + noise * random.standard_normal(len(x))
    design = np.column_stack([np.ones(len(x)), wave(x, 20.0)])
    unknowns = tuple(Unknown((name, "mm"), "mm", 0.0, 1.0, 1.0) for name in ("offset", "sine", "cosine"))
    return LinearModel(y, design, unknowns, np.zeros((len(x), 0)), np.ones(len(x)), sigma)


def shaped(x: Floats, nodes: Floats) -> Shaped:
    return Shaped((1, 2), nodes, np.stack([wave(x, period) for period in nodes]))


@pytest.mark.long
def test_the_marginal_of_a_period_is_that_of_direct_integration() -> None:
    """Mean and standard deviation against sums over the grid of exact Gaussian evidences, to 4 sampling errors."""
    random = np.random.default_rng(1)
    x = np.sort(random.uniform(0, 100, M))
    linear = model_shaped(x, 0.02, 0.02, (0.1, 0.03, 23.0), 2)
    nodes = 1 / np.linspace(1 / 40, 1 / 12, 800)[::-1]
    posterior = sample_shaped(linear, [shaped(x, nodes)], 3)
    log = []
    for period in nodes:
        A = np.column_stack([np.ones(M), wave(x, period)])
        covariance = 0.02**2 * np.eye(M) + A @ A.T
        log.append(
            -0.5 * linear.observed @ np.linalg.solve(covariance, linear.observed)
            - 0.5 * np.linalg.slogdet(covariance)[1]
        )
    p = np.exp(np.array(log) - max(log)) * np.gradient(np.log(nodes))
    p /= p.sum()
    mean = float(p @ nodes)
    sd = float(np.sqrt(p @ (nodes - mean) ** 2))
    draws = posterior.shapes[:, 0]
    error = sd / np.sqrt(posterior.ess_min)
    assert posterior.converged
    assert draws.mean() == pytest.approx(mean, abs=4 * error)
    assert draws.std() == pytest.approx(sd, rel=4 / np.sqrt(posterior.ess_min) + 0.02)


@pytest.mark.long
def test_a_size_of_half_a_metre_known_to_a_nanometre_does_not_blur_the_period() -> None:
    random = np.random.default_rng(7)
    x = np.sort(random.uniform(0, 100, M))
    plain = model_shaped(x, 1e-3, None, (0.0, 0.01, 23.0), 8)
    length = Unknown(("artefact", "length"), "mm", 500.0, 1e-6, 0.1)
    long = replace(plain, observed=plain.observed + 500.0, unknowns=(length, *plain.unknowns[1:]))
    columns = shaped(x, 1 / np.linspace(1 / 40, 1 / 12, 300)[::-1])
    mine, theirs = sample_shaped(long, [columns], 9), sample_shaped(replace(plain, unknowns=(
        Unknown(("artefact", "length"), "mm", 0.0, 1e-6, 0.1), *plain.unknowns[1:])), [columns], 9)  # fmt: skip
    assert mine.shapes.mean() == pytest.approx(theirs.shapes.mean(), abs=1e-3)
    assert mine.sigma.mean() == pytest.approx(theirs.sigma.mean(), rel=1e-3)


def test_two_modes_keep_their_probabilities() -> None:
    """Readings every 10 mm cannot tell a period of 30 mm from one of 15 mm: 1/15 = 1/10 − 1/30."""
    x = np.arange(M) * 10.0
    linear = model_shaped(x, 0.01, None, (0.0, 0.05, 30.0), 4)
    nodes = np.sort(np.concatenate([1 / np.linspace(1 / 33, 1 / 27, 300), 1 / np.linspace(1 / 16, 1 / 14, 300)]))
    posterior = sample_shaped(linear, [shaped(x, nodes)], 5)
    longer = posterior.shapes[:, 0] > 20
    assert posterior.converged
    # the aliases have equal likelihood; uniform in ln(period), their widths in ln(period) are as 30 to 15
    assert longer.mean() == pytest.approx(2 / 3, abs=0.05)
    amplitude = np.hypot(posterior.draws[:, 1], posterior.draws[:, 2])
    assert abs(amplitude.mean() - 0.05) < 4 * amplitude.std()


@pytest.mark.long
def test_intervals_of_period_amplitude_and_noise_hold_the_truth_as_often_as_they_say() -> None:
    """Twelve recordings, 95 % intervals: at least 9 of 12 (binomial, 0.2 %)."""
    random = np.random.default_rng(6)
    x = np.sort(random.uniform(0, 100, M))
    nodes = 1 / np.linspace(1 / 40, 1 / 12, 300)[::-1]
    columns = shaped(x, nodes)
    held = np.zeros(4, dtype=int)
    for seed in range(12):
        truth = (0.1, 0.02, float(random.uniform(16, 32)))
        posterior = sample_shaped(model_shaped(x, 0.01, None, truth, 100 + seed), [columns], seed)
        amplitude = np.hypot(posterior.draws[:, 1], posterior.draws[:, 2])
        for i, (draws, value) in enumerate(
            zip(
                (posterior.draws[:, 0], amplitude, posterior.shapes[:, 0], posterior.sigma), (*truth, 0.01), strict=True
            )
        ):
            low, high = np.quantile(draws, [0.025, 0.975])
            held[i] += low <= value <= high
    assert np.all(held >= 9)
