"""Posteriors and their densities, and what is in doubt beside them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import linalg, optimize, stats

from cmm_uq.base.messages import say
from cmm_uq.base.points import Floats
from cmm_uq.base.units import unit
from cmm_uq.maths.inference.linear_model import LinearModel, Unknown
from cmm_uq.maths.inference.marginal import SIGMA_BOUNDS
from cmm_uq.maths.inference.posterior import Cause, Density, Doubt, Posterior, gain, sample
from cmm_uq.maths.uncertainty.quantity import Quantity


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


@pytest.mark.long
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


LENGTHS = np.tile([100.0, 200.0, 300.0, 400.0, 500.0], 4)
SET_UP = np.repeat([1, 2, 3, 4], 5)


def cause(sd: float = 2e-6) -> Cause:
    return Cause.of_blocks(say("temperature of the artefact"), sd * LENGTHS, SET_UP)


def scale_model() -> LinearModel:
    """One scale in ppm of twenty lengths, of which nothing is known beforehand."""
    unknowns = (Unknown(("scale", "ppm"), unit("ppm"), 0.0, np.inf, 10.0),)
    return LinearModel(np.zeros(20), 1e-6 * LENGTHS[:, None], unknowns, np.zeros((20, 0)), np.ones(20), None)


def test_a_common_relative_error_is_the_scale_s_and_one_of_each_set_up_averages_out() -> None:
    weights = gain(scale_model(), 1e-3)
    common, apart = cause().carried(weights)
    assert common == pytest.approx(np.array([[2.0]]))
    assert np.sum(apart**2) == pytest.approx(2.0**2 / 4)
    assert Doubt.of([cause()], weights).variance(np.ones(1)) == pytest.approx(4.0)


def test_of_a_difference_of_two_set_ups_the_errors_of_each_stand() -> None:
    weights = np.zeros((2, 20))
    weights[0, 4], weights[1, 9] = 1e6 / 500, 1e6 / 500  # ppm, each of the longest length of a set-up
    doubt = Doubt.of([cause()], weights)
    assert doubt.covariance() == pytest.approx(np.full((2, 2), 4.0))
    assert doubt.variance(np.array([1.0, -1.0])) == pytest.approx(8.0)


def test_two_causes_add_the_larger_of_each() -> None:
    """Of a difference a temperature counts apart; a coefficient of expansion, which is one, cancels."""
    weights = np.zeros((1, 20))
    weights[0, 4], weights[0, 9] = 1.0, -1.0
    expansion = Cause(say("expansion coefficient of the artefact"), (3e-6 * LENGTHS)[:, None])
    assert Doubt.of([cause(), expansion], weights).variance(np.ones(1)) == pytest.approx(2 * (2e-6 * 500) ** 2)
    weights[0, 9] = 1.0
    sums = Doubt.of([cause(), expansion], weights).variance(np.ones(1))
    assert sums == pytest.approx((2e-6 * 1000) ** 2 + (3e-6 * 1000) ** 2)


def test_widened_draws_have_the_mean_they_had_and_the_variance_of_both() -> None:
    draws = np.random.default_rng(5).normal([1.0, -3.0], [0.5, 0.1], (40_000, 2))
    doubt = Doubt(((np.array([[2.0], [0.0]]), np.array([[1.0, 1.0], [0.3, -0.4]])),))
    wide = doubt.widened(draws, 0)
    assert wide.mean(axis=0) == pytest.approx(draws.mean(axis=0), abs=1e-12)
    assert wide.var(axis=0) == pytest.approx([0.25 + 4, 0.01 + 0.25], rel=0.03)


@pytest.mark.parametrize("apart", [False, True])
def test_errors_are_drawn_as_they_are_carried(apart: bool) -> None:
    weights = gain(scale_model(), 1e-3)
    drawn = cause().drawn((4000,), np.random.default_rng(1), apart=apart) @ weights[0]
    assert drawn.var() == pytest.approx(np.sum(cause().carried(weights)[apart] ** 2), rel=0.1)


def test_the_gain_is_that_of_least_squares_without_the_placing() -> None:
    """An offset of each set-up goes into its placing, and into no scale."""
    placing = (SET_UP[:, None] == np.array([1, 2, 3, 4])).astype(float)
    model = scale_model()
    model = LinearModel(model.observed, model.design, model.unknowns, placing, model.noise_scale, None)
    weights = gain(model, 1e-3)
    assert weights @ placing == pytest.approx(np.zeros((1, 4)), abs=1e-6)
    assert weights @ (1e-6 * LENGTHS) == pytest.approx(np.ones(1))


def test_a_combination_by_itself_is_no_less_in_doubt() -> None:
    doubt = Doubt(((np.array([[2.0], [2.0]]), np.array([[1.0, 0.0], [0.0, 1.0]])),))
    narrow = Quantity(0.0, 1.0, (-2.0, 2.0), unit("ppm"))
    wide = doubt.larger(narrow, np.array([1.0, -1.0]))
    assert wide.u == pytest.approx(np.sqrt(1 + 2))
    assert wide.interval95[1] == pytest.approx(2 * np.sqrt(3))
    assert doubt.larger(narrow, np.array([1.0, 0.0])) == narrow
