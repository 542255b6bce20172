"""Posteriors of models that are not linear within their own uncertainty, beside a full run of emcee on the exact density."""

from __future__ import annotations

from dataclasses import replace

import emcee
import numpy as np
import pytest

from cmm_uq.artefacts.ballbar import Ballbar
from cmm_uq.base.points import Floats, Machine, Points
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.model.measurement import with_curvature
from cmm_uq.machine.model.noise import noise_of
from cmm_uq.machine.physics.catalogue import effects
from cmm_uq.maths.inference.ensembles import ENSEMBLES
from cmm_uq.maths.inference.noise import Sizes
from cmm_uq.maths.inference.posterior import Density, NoisyPosterior
from tests.machine.model.test_leaning_axes import ARCSEC, LENGTH, SIX, recorded, vectors
from tests.recordings import TRAVEL, bar_facts

PLANE = ("scale_x", "scale_y", "squareness_xy")
PRIOR = np.array([300.0, 300.0, 500.0])
TRUTH = np.array([300.0, -300.0, 0.0, 1500.0, 0.0, 0.0])
SIGMA = 5e-5


@pytest.fixture(scope="module")
def parallel() -> Points:
    """Forty bars along one diagonal of X and Y: one combination of parameters is known to 0.03 ppm, the rest is prior."""
    random, count = np.random.default_rng(0), 40
    half = 0.5 * LENGTH * np.array([1, 1, 0]) / np.sqrt(2)
    middle = np.array([450, 270, -250]) + random.uniform(-50, 50, (count, 3))
    true = np.stack([middle - half, middle + half], axis=1).reshape(-1, 3)
    read = true @ np.linalg.inv(vectors(TRUTH))
    number = np.repeat(np.arange(1, count + 1), 2)
    return Points(
        read + SIGMA * random.standard_normal(read.shape), number, np.tile([1, 2], count), np.ones_like(number),
        Machine("m", "XYZ", TRAVEL), {}, np.arange(2, 2 * count + 2),
    )  # fmt: skip


def lengths(points: Points, values: Floats) -> Floats:
    """Of the bars (w, m) on machines of scales x, y (ppm) and squareness xy (″): the law of cosines."""
    ends = points.xyz.reshape(-1, 2, 3)
    x, y, z = (ends[:, 1] - ends[:, 0]).T
    sx, sy = 1 + 1e-6 * values[:, :1], 1 + 1e-6 * values[:, 1:2]
    return np.sqrt((sx * x) ** 2 + (sy * y) ** 2 - 2 * sx * sy * np.sin(ARCSEC * values[:, 2:3]) * x * y + z**2)


def linear_draws(model: RecordingModel, seed: int = 1, steps: int = 100, walkers: int = 60) -> NoisyPosterior:
    """Exact draws of the linear model about its estimate, the noise known."""
    sigma = model.sigma or SIGMA
    mean, covariance, _ = Density(model.estimate().linear).conditional(float(np.log(sigma)))
    count = ENSEMBLES * steps * walkers
    draws = np.random.default_rng(seed).multivariate_normal(mean, covariance, count, method="eigh")
    one = np.ones(count)
    sizes = Sizes(np.full((count, 3), sigma), 0 * one, 0 * one, 0 * one, one)
    return NoisyPosterior(
        unknowns=model.unknowns, draws=draws, sigma=sigma * one, seed=seed, sampler="", ess_min=count, rhat_max=1.0,
        steps=steps, autocorrelation_time=1.0, sizes=sizes,
    )  # fmt: skip


def by_emcee(points: Points) -> Floats:
    """Draws (N, 3) of scales and squareness by emcee on the exact density, the length known."""

    def log_density(values: Floats) -> Floats:
        misfit = (lengths(points, values) - LENGTH) / (np.sqrt(2) * SIGMA)
        return -0.5 * (np.sum(misfit**2, axis=1) + np.sum((values / PRIOR) ** 2, axis=1))

    # starting points on the surface that the bars leave open: the squareness that makes the mean length right
    random = np.random.default_rng(2)
    start = PRIOR * random.standard_normal((60, 3))
    for _ in range(20):
        off = lengths(points, start).mean(axis=1) - LENGTH
        start[:, 2] += off / (LENGTH / 2 * ARCSEC)
    start[:, 2] += 0.01 * random.standard_normal(60)
    moves = [(emcee.moves.DEMove(), 0.7), (emcee.moves.StretchMove(), 0.3)]
    sampler = emcee.EnsembleSampler(60, 3, log_density, vectorize=True, moves=moves)
    sampler.random_state = np.random.RandomState(3).get_state()
    sampler.run_mcmc(start, 12_000)
    return np.asarray(sampler.get_chain(discard=2000, thin=10, flat=True))


def test_bent_draws_are_those_of_emcee_on_the_exact_density(parallel: Points) -> None:
    """Draws of the linear model would predict lengths with several times the spread that the bars allow."""
    model = RecordingModel(Ballbar(bar_facts(LENGTH, 0.0), parallel), effects(PLANE), SIGMA)
    straight = linear_draws(model)
    bent = with_curvature(model, noise_of(model), straight)
    exact = by_emcee(parallel)
    spread = [lengths(parallel, d[:, :3]).mean(axis=1).std() for d in (straight.draws, bent.draws, exact)]
    assert spread[0] > 3 * spread[2]
    assert spread[1] == pytest.approx(spread[2], rel=0.05)
    sd = exact.std(axis=0)
    np.testing.assert_allclose(bent.draws.std(axis=0)[:3], sd, rtol=0.05)
    assert np.all(np.abs(bent.draws.mean(axis=0)[:3] - exact.mean(axis=0)) < 0.1 * sd)


def test_where_a_model_is_straight_its_draws_are_left_alone() -> None:
    """Thirty bars in all directions, noise of 1 µm: even 1500″ bend it by less than a fiftieth of an uncertainty."""
    points = recorded(np.array([500.0, -500.0, 300.0, 1500.0, -1500.0, 900.0]), sigma=1e-3, count=30)
    model = RecordingModel(Ballbar(bar_facts(LENGTH, 0.5), points), effects(SIX), 1e-3)
    straight = linear_draws(model, steps=10, walkers=20)
    assert with_curvature(model, noise_of(model), straight) is straight


def test_small_angles_are_not_even_looked_at(monkeypatch: pytest.MonkeyPatch) -> None:
    points = recorded(np.array([500.0, -500.0, 300.0, 60.0, -60.0, 40.0]), sigma=SIGMA, count=30)
    model = RecordingModel(Ballbar(bar_facts(LENGTH, 0.5), points), effects(SIX), SIGMA)
    straight = linear_draws(model, steps=10, walkers=20)
    monkeypatch.setattr("cmm_uq.machine.model.measurement.bend", lambda *_: pytest.fail("looked"))
    assert with_curvature(model, noise_of(model), straight) is straight


def test_the_posterior_is_linear_where_priors_put_the_angle(parallel: Points) -> None:
    """Least squares splits one combination at will, and by tiny angles between the bars; priors leave 1456″, sd 85″, to XY.

    By hand: sx + sy − S = −1500″ of which S has 500²/(500² + 2·61.9²) = 0.970, 300 ppm being 61.9″.
    """
    model = RecordingModel(Ballbar(bar_facts(LENGTH, 0.5), parallel), effects(SIX), SIGMA)
    estimate = model.estimate()
    angle = estimate.about[SIX.index("squareness_xy")]
    assert angle == pytest.approx(0.970 * 1500, abs=3)
    mean, covariance, _ = Density(estimate.linear).conditional(float(np.log(SIGMA)))
    assert mean[3] == pytest.approx(angle, abs=10)
    assert np.sqrt(covariance[3, 3]) == pytest.approx(np.sqrt(1 - 0.970) * 500, rel=0.02)


def test_a_well_measured_machine_is_linear_about_its_estimate() -> None:
    points = recorded(np.array([0.0, 0, 0, 1500.0, -1500.0, 900.0]), sigma=1e-3)
    model = RecordingModel(Ballbar(bar_facts(LENGTH, 0.5), points), effects(SIX), 1e-3)
    estimate = model.estimate()
    assert estimate.about is estimate.least_squares.value or np.array_equal(
        estimate.about, estimate.least_squares.value
    )
    assert replace(model, used=model.used).estimate().about.tolist() == estimate.about.tolist()
