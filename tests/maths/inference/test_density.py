"""The posterior density of a linear model against the normal distributions that it consists of."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import linalg, optimize, stats

from cmm_uq.base.points import Floats
from cmm_uq.maths.inference.linear_model import LinearModel, Unknown
from cmm_uq.maths.inference.posterior import SIGMA_BOUNDS, Density

MEAN, SD = np.array([1.0, -2.0]), np.array([0.5, 3.0])


def given(sigma: float | None = None, *, sd: Floats = SD, placing: bool = False, rows: int = 9) -> LinearModel:
    """Two parameters, noise scales between 0.5 and 2, and if wanted a place that is free."""
    random = np.random.default_rng(21)
    design, columns = random.standard_normal((rows, 2)), random.standard_normal((rows, 1))
    scale = np.linspace(0.5, 2.0, rows)
    observed = design @ MEAN + 0.3 * scale * random.standard_normal(rows)
    unknowns = tuple(Unknown(("e", str(i)), "", float(MEAN[i]), float(sd[i]), 1.0) for i in range(2))
    return LinearModel(observed, design, unknowns, columns if placing else np.zeros((rows, 0)), scale, sigma)


def marginal(model: LinearModel, sigma: float) -> float:
    """Log density of the observations: normal about the prior mean, A·P·Aᵀ + σ²N, in combinations that no place changes."""
    covariance = (model.design * model.prior_sd**2) @ model.design.T + np.diag((sigma * model.noise_scale) ** 2)
    Q = linalg.null_space(model.placing.T) if model.placing.size else np.eye(len(covariance))
    apart = Q.T @ (model.observed - model.design @ model.prior_mean)
    return float(stats.multivariate_normal.logpdf(apart, cov=Q.T @ covariance @ Q))


@pytest.mark.parametrize("placing", [False, True])
def test_with_the_noise_known_the_parameters_are_normal_about_the_textbook_mean(placing: bool) -> None:
    """Precision P⁻¹ + Aᵀ(σ²N)⁻¹A; a place adds a column of which nothing is known."""
    model, sigma = given(placing=placing), 0.25
    A = np.hstack([model.design, model.placing])
    weight = 1 / (sigma * model.noise_scale) ** 2
    prior = np.diag([*1 / SD**2, *[0.0] * model.placing.shape[1]])
    precision = prior + (A.T * weight) @ A
    right = prior @ [*MEAN, *[0.0] * model.placing.shape[1]] + A.T @ (weight * model.observed)
    mean, covariance, _ = Density(model).conditional(float(np.log(sigma)))
    np.testing.assert_allclose(mean, np.linalg.solve(precision, right)[:2], rtol=1e-10)
    np.testing.assert_allclose(covariance, np.linalg.inv(precision)[:2, :2], rtol=1e-10)


@pytest.mark.parametrize("placing", [False, True])
def test_the_evidence_changes_with_the_noise_as_that_of_the_observations_does(placing: bool) -> None:
    model = given(placing=placing)
    density, sigmas = Density(model), np.array([0.02, 0.1, 0.3, 1.0, 5.0])
    found = np.array([density.conditional(float(np.log(sigma)))[2] for sigma in sigmas])
    expected = np.array([marginal(model, float(sigma)) for sigma in sigmas])
    np.testing.assert_allclose(np.diff(found), np.diff(expected), rtol=1e-6)


def test_the_density_of_draws_under_a_stated_noise_is_that_of_prior_and_noise() -> None:
    theta = MEAN + np.random.default_rng(22).standard_normal((6, 2))
    model = given(0.25)
    expected = stats.norm.logpdf(theta, MEAN, SD).sum(axis=1)
    expected += stats.norm.logpdf(model.observed, theta @ model.design.T, 0.25 * model.noise_scale).sum(axis=1)
    assert (Density(model).dimension, Density(given()).dimension) == (2, 3)
    np.testing.assert_allclose(np.diff(Density(model)(theta)), np.diff(expected), rtol=1e-9)


def test_no_noise_lies_outside_its_bounds() -> None:
    assert SIGMA_BOUNDS == (1e-6, 10.0)
    inside, outside = np.log([1.001e-6, 9.99]), np.log([0.999e-6, 10.01])
    density = Density(given())
    theta = [np.column_stack([np.tile(MEAN, (2, 1)), log]) for log in (inside, outside)]
    assert np.isfinite(density(theta[0])).all()
    assert np.isneginf(density(theta[1])).all()


def test_the_chains_start_about_the_most_probable_noise_with_its_own_width() -> None:
    """Nothing known of two parameters from 40 observations: p(ln σ) ∝ σ^(−38)·exp(−S/2σ²), with its largest value at
    σ² = S/38 and a curvature of 2·38 there, which a difference over 0.1 takes for (cosh 0.2 − 1)/0.02 of it.
    """
    model = given(sd=np.full(2, 1e7), rows=40)
    white = model.design / model.noise_scale[:, None]
    value, squares = np.linalg.lstsq(white, model.observed / model.noise_scale, rcond=None)[:2]
    centre, factor = Density(model).laplace()
    np.testing.assert_allclose(centre[:2], value, rtol=1e-6)
    assert np.exp(2 * centre[2]) == pytest.approx(squares[0] / 38, rel=1e-4)
    covariance = factor @ factor.T
    np.testing.assert_allclose(covariance[:2, :2], np.linalg.inv(white.T @ white) * squares[0] / 38, rtol=1e-3)
    assert covariance[2, 2] == pytest.approx(1 / (2 * 38 * (np.cosh(0.2) - 1) / 0.02), rel=1e-3)
    assert np.count_nonzero(covariance[2, :2]) == 0


def test_with_priors_the_start_is_where_the_marginal_density_of_the_noise_is_largest() -> None:
    model = given(placing=True)
    best = optimize.minimize_scalar(lambda t: -marginal(model, float(np.exp(t))), bounds=(-6, 2), method="bounded")
    centre, _ = Density(model).laplace()
    assert centre[2] == pytest.approx(best.x, abs=1e-4)


def test_without_residuals_the_chains_start_at_the_least_noise() -> None:
    exact = replace(given(), observed=given().design @ MEAN)
    centre, factor = Density(exact).laplace()
    assert SIGMA_BOUNDS[0] <= np.exp(centre[2]) < 1.1 * SIGMA_BOUNDS[0]
    assert np.isfinite(factor).all()


def test_a_stated_noise_leaves_the_exact_distribution_to_start_from() -> None:
    density = Density(given(0.25))
    mean, covariance, _ = density.conditional(float(np.log(0.25)))
    centre, factor = density.laplace()
    assert centre.tolist() == mean.tolist()
    np.testing.assert_allclose(factor @ factor.T, covariance, rtol=1e-10)
    assert factor[0, 1] == 0.0


@pytest.mark.parametrize("scale", [1.0, 5.0])
def test_a_certificate_without_uncertainty_holds_to_a_millionth_of_a_typical_size(scale: float) -> None:
    exact = Unknown(("e", "0"), "", 1.0, 0.0, scale, known=True)
    model = replace(given(), unknowns=(exact, given().unknowns[1]))
    mean, covariance, _ = Density(model).conditional(0.0)
    assert mean[0] == pytest.approx(1.0, abs=1e-9)
    assert np.sqrt(covariance[0, 0]) == pytest.approx(1e-6 * scale, rel=1e-6)
