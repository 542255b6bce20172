"""The marginal density of the noise's sizes, and exact draws given them, against dense algebra and a direct run of emcee."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cmm_uq.maths.inference.ensembles import run_ensembles
from cmm_uq.maths.inference.linear_model import LinearModel, Unknown, solve
from cmm_uq.maths.inference.marginal import Marginal
from cmm_uq.maths.inference.noise import PLACING, Components
from cmm_uq.maths.inference.posterior import sample_with_noise, start
from cmm_uq.maths.inference.proposals import Proposal
from tests.maths.inference.test_noise import M, components, covariance, covariances


def model(noise: Components, *, placing: bool = False, seed: int = 5) -> LinearModel:
    """Two parameters with priors, one of them certified; perhaps an offset of the first half without any."""
    random = np.random.default_rng(seed)
    design = np.column_stack([np.linspace(-1, 1, M), np.ones(M)])
    unknowns = (Unknown(("a", "a"), "1", 0.0, 3.0, 3.0), Unknown(("b", "b"), "1", 1.0, 0.5, 0.1, known=True))
    columns = (np.arange(M) < M // 2).astype(float)[:, None] if placing else np.zeros((M, 0))
    sizes = noise.sizes(np.zeros((1, noise.dimension)) + 0.4)
    observed = design @ [1.3, 0.8] + noise.repeated(sizes, 1, random)[0, 0] + 2.0 * columns.sum(axis=1)
    return LinearModel(observed, design, unknowns, columns, np.ones(M), None)


@pytest.mark.parametrize("placing", [False, True])
def test_the_density_is_that_of_a_normal_distribution_with_everything_linear_in_its_covariance(placing: bool) -> None:
    """Differences between sizes of log N(y; A·prior mean, A·P·Aᵀ + Σ); a free placing is a column of huge variance."""
    noise = components()
    linear = model(noise, placing=placing)
    marginal = Marginal(linear, noise, solve(linear))
    latent = 0.8 * np.random.default_rng(6).standard_normal((6, noise.dimension))
    latent[:3, noise.names.index("rate")] *= np.sign(latent[:3, noise.names.index("rate")]) * [1, -1, 1]
    walks = noise.sizes(latent).rate == 0
    assert set(walks) == {False, True}
    huge = 1e4
    wanted = []
    for row in latent:
        sizes = noise.sizes(row[None])
        whole = covariance(noise, sizes) + (linear.design * linear.prior_sd**2) @ linear.design.T
        whole = whole + huge**2 * linear.placing @ linear.placing.T
        left = linear.observed - linear.design @ linear.prior_mean
        squares = left @ np.linalg.solve(whole, left)
        wanted.append(-0.5 * (squares + np.linalg.slogdet(whole)[1] + np.sum(row[1:] ** 2)))
    found = marginal.log_density(latent)
    assert np.allclose(np.diff(found), np.diff(wanted), atol=2e-5)


def test_draws_given_the_sizes_have_the_mean_and_covariance_of_generalised_least_squares_with_priors() -> None:
    noise = components()
    linear = model(noise, placing=True)
    latent = np.full((1, noise.dimension), 0.5)
    sizes = noise.sizes(latent)
    inverse = np.linalg.inv(covariance(noise, sizes))
    A = np.hstack([linear.design, linear.placing])
    precision = A.T @ inverse @ A
    precision[:2, :2] += np.diag(linear.prior_sd**-2.0)
    right = A.T @ inverse @ linear.observed
    right[:2] += linear.prior_mean / linear.prior_sd**2
    mean, spread = np.linalg.solve(precision, right)[:2], np.linalg.inv(precision)[:2, :2]
    draws = Marginal(linear, noise, solve(linear)).draw(
        sizes.at(np.zeros(100_000, dtype=np.int64)), np.random.default_rng(7)
    )
    u = np.sqrt(np.diag(spread))
    assert np.all(np.abs(draws.mean(axis=0) - mean) < 4.5 * u / np.sqrt(100_000))
    assert np.allclose(np.cov(draws, rowvar=False) / np.outer(u, u), spread / np.outer(u, u), atol=0.02)


def test_a_direct_run_of_emcee_over_all_parameters_agrees() -> None:
    """Parameters and sizes sampled together, the density written out with the dense covariance."""
    noise = components((PLACING,))
    linear = model(noise)
    sampled = sample_with_noise(linear, noise, solve(linear), seed=1)

    def density(
        theta: np.ndarray[tuple[int, int], np.dtype[np.float64]],
    ) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        whole = covariances(noise, noise.sizes(theta[:, 2:]))
        left = linear.observed - theta[:, :2] @ linear.design.T
        squares = (left * np.linalg.solve(whole, left[:, :, None])[:, :, 0]).sum(axis=1)
        squares += (((theta[:, :2] - linear.prior_mean) / linear.prior_sd) ** 2).sum(axis=1) + theta[:, 3] ** 2
        inside = (theta[:, 2] > -13) & (theta[:, 2] < 2)
        return np.where(inside, -0.5 * (squares + np.linalg.slogdet(whole)[1]), -np.inf)

    centre, factor = start(Marginal(linear, noise, solve(linear)))
    spread = sampled.draws.std(axis=0)
    proposal = Proposal.single(np.append(sampled.draws.mean(axis=0), centre), np.diag([*spread, *np.diag(factor)]))
    direct = run_ensembles(density, proposal, 3, effective_samples=1000, walkers=16)
    for i in range(2):
        error = spread[i] * np.sqrt(2 / direct.ess_min)
        assert abs(direct.draws[:, i].mean() - sampled.draws[:, i].mean()) < 4.5 * error
        assert direct.draws[:, i].std() == pytest.approx(spread[i], rel=4.5 * np.sqrt(1 / direct.ess_min))
    absent = np.mean(noise.sizes(direct.draws[:, 2:]).placing == 0), np.mean(sampled.sizes.placing == 0)
    assert absent[0] == pytest.approx(absent[1], abs=0.09)


def test_a_recording_that_is_explained_to_the_last_digit_still_has_a_density() -> None:
    noise = components()
    linear = model(noise)
    exact = LinearModel(
        linear.design @ [1.0, 1.0], linear.design, linear.unknowns, linear.placing, linear.noise_scale, None
    )
    found = Marginal(exact, noise, solve(exact)).log_density(np.zeros((3, noise.dimension)) + np.log(1e-3))
    assert np.all(np.isfinite(found))


@pytest.mark.parametrize("times", [0.2, 5.0])
def test_the_noise_is_not_sampled_below_what_is_known_of_it(times: float) -> None:
    """Far below the residuals' scatter it changes nothing; far above, the noise is that, and the slope as uncertain: its
    variance is 1/(Σx²/σ² + 1/3²), for the other column is orthogonal to it."""
    noise = replace(components(), possible=())
    linear = model(noise)
    estimate = solve(linear)
    known = times * estimate.sigma
    drawn = sample_with_noise(linear, replace(noise, known=known), estimate, 0)
    assert drawn.sizes.coordinate.min() >= 0.999 * known
    if times < 1:
        assert np.array_equal(drawn.draws, sample_with_noise(linear, noise, estimate, 0).draws)
    else:
        assert drawn.converged
        assert np.median(drawn.sizes.coordinate) < 1.2 * known
        precision = np.sum(linear.design[:, 0] ** 2) / drawn.sizes.coordinate**2 + 1 / 9
        assert drawn.draws[:, 0].std() == pytest.approx(np.sqrt(np.mean(1 / precision)), rel=0.05)
