"""Draws bent from a linear model, beside the exact posterior by summation on a grid."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cmm_uq.base.points import Floats
from cmm_uq.base.units import unit
from cmm_uq.maths.inference.curvature import FARTHEST, bend, bent
from cmm_uq.maths.inference.ensembles import ENSEMBLES
from cmm_uq.maths.inference.least_squares import likeliest
from cmm_uq.maths.inference.linear_model import LinearModel, Unknown
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
