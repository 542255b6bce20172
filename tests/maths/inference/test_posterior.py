"""The sampled posterior against the exact one, where the exact one is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from cmm_uq.base.points import Floats
from cmm_uq.maths.inference.linear_model import LinearModel, Unknown
from cmm_uq.maths.inference.posterior import Density, Posterior, sample


def linear(k: int, m: int, sigma: float | None, seed: int = 8) -> LinearModel:
    """A problem with correlated columns and priors of very different widths."""
    random = np.random.default_rng(seed)
    design = random.standard_normal((m, k)) @ (np.eye(k) + 0.5 * random.random((k, k)))
    observed = design @ random.standard_normal(k) + 0.2 * random.standard_normal(m)
    sds = np.geomspace(0.05, 50.0, k)
    unknowns = tuple(Unknown(("e", str(i)), "", 0.1 * i, float(sd), float(sd)) for i, sd in enumerate(sds))
    return LinearModel(observed, design, unknowns, np.zeros((m, 0)), np.full(m, 1.5), sigma)


def exact(model: LinearModel) -> tuple[Floats, Floats]:
    """Mean and covariance of the Gaussian posterior, from the textbook's normal equations."""
    weight = 1 / (model.sigma * model.noise_scale) ** 2
    precision = model.design.T @ (weight[:, None] * model.design) + np.diag(1 / model.prior_sd**2)
    right = model.design.T @ (weight * model.observed) + model.prior_mean / model.prior_sd**2
    return np.linalg.solve(precision, right), np.linalg.inv(precision)


@pytest.mark.parametrize("k", [2, 9, 21])
def test_the_sampled_posterior_is_the_exact_gaussian_in_every_dimension(k: int) -> None:
    """Also in many dimensions, where a wrong move shows and one dimension hides it."""
    model = linear(k, 40, 0.2)
    posterior = sample(model, seed=5)
    mean, covariance = exact(model)
    u = np.sqrt(np.diag(covariance))
    error = np.sqrt(1 / posterior.ess_min)
    assert posterior.converged
    assert np.abs((posterior.draws.mean(axis=0) - mean) / u).max() < 5 * error
    assert np.abs(posterior.draws.std(axis=0) / u - 1).max() < 5 * error
    correlation = np.corrcoef(posterior.draws.T) - covariance / np.outer(u, u)
    assert np.abs(correlation).max() < 6 * error


def test_an_unknown_noise_gives_student_t_posteriors() -> None:
    """With wide priors a parameter follows t with n − k degrees of freedom (JCGM 101:2008, 6.4.9), the noise 1/χ."""
    model = linear(3, 12, None)
    flat = tuple(replace(u, prior_mean=0.0, prior_sd=1e4) for u in model.unknowns)
    model = replace(model, unknowns=flat)
    posterior = sample(model, seed=6)
    design, observed = model.design / 1.5, model.observed / 1.5
    value, squares, _, _ = np.linalg.lstsq(design, observed, rcond=None)
    s2, dof = squares[0] / 9, 9
    scale = np.sqrt(s2 * np.diag(np.linalg.inv(design.T @ design)))
    independent = slice(None, None, int(np.ceil(2 * posterior.autocorrelation_time)))
    for i in range(3):
        t = (posterior.draws[:, i] - value[i]) / scale[i]
        assert stats.kstest(_thinned(posterior, t, independent), stats.t(dof).cdf).pvalue > 1e-3
    chi2 = dof * s2 / posterior.sigma**2
    assert stats.kstest(_thinned(posterior, chi2, independent), stats.chi2(dof).cdf).pvalue > 1e-3


def _thinned(posterior: Posterior, values: Floats, independent: slice) -> Floats:
    """One step in so many of every chain, so that a test for independent draws applies."""
    return values.reshape(4, posterior.steps, -1)[:, independent].ravel()


def test_the_density_is_that_of_the_model_written_out() -> None:
    model = linear(4, 15, None)
    random = np.random.default_rng(9)
    theta = random.standard_normal((6, 5))
    expected = [
        stats.norm(model.design @ t[:4], np.exp(t[4]) * model.noise_scale).logpdf(model.observed).sum()
        + stats.norm(model.prior_mean, model.prior_sd).logpdf(t[:4]).sum()
        for t in theta
    ]
    found = Density(model)(theta)
    np.testing.assert_allclose(found - found[0], np.array(expected) - expected[0], rtol=1e-10)


def test_the_same_seed_gives_the_same_draws_and_another_seed_others() -> None:
    model = linear(3, 12, None)
    first, again, other = (sample(model, seed) for seed in (1, 1, 2))
    assert np.array_equal(first.draws, again.draws)
    assert not np.array_equal(first.draws, other.draws)


def test_a_free_combination_keeps_its_prior() -> None:
    """Two equal columns: the sum is determined, the difference is what the priors say."""
    model = replace(linear(2, 20, 0.2), design=np.ones((20, 2)), observed=np.ones(20))
    model = replace(model, unknowns=tuple(replace(u, prior_mean=0.0, prior_sd=3.0) for u in model.unknowns))
    posterior = sample(model, seed=3)
    difference = posterior.draws[:, 0] - posterior.draws[:, 1]
    assert difference.std() == pytest.approx(np.sqrt(18), rel=5 / np.sqrt(posterior.ess_min))
    assert posterior.draws.sum(axis=1).std() == pytest.approx(0.3 / np.sqrt(20), rel=0.05)


def test_a_short_or_diverging_run_is_not_called_converged() -> None:
    posterior = sample(linear(2, 12, 0.2), seed=1)
    assert posterior.converged
    assert not replace(posterior, ess_min=999.0).converged
    assert not replace(posterior, rhat_max=1.011).converged
    assert not replace(posterior, autocorrelation_time=posterior.steps / 49).converged
