"""Posteriors of models that are not linear within their own uncertainty, and axes that lean."""

from __future__ import annotations

from dataclasses import replace

import emcee
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from cmm_uq.artefacts.ballbar import Ballbar
from cmm_uq.base.points import Floats, Machine, Points
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.model.measurement import with_curvature
from cmm_uq.machine.model.noise import noise_of
from cmm_uq.machine.physics.catalogue import effects
from cmm_uq.maths.inference.ensembles import ENSEMBLES
from cmm_uq.maths.inference.noise import Sizes
from cmm_uq.maths.inference.posterior import Density, NoisyPosterior
from tests.recordings import TRAVEL, bar_facts, bars

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


@pytest.mark.long
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


SIX = ("scale_x", "scale_y", "scale_z", "squareness_xy", "squareness_yz", "squareness_zx")
ARCSEC = np.pi / 180 / 3600
LENGTH = 400.0

MACHINES = {
    "600 arcsec each": [0.0, 0.0, 0.0, 600.0, 600.0, 600.0],
    "1500 arcsec each": [0.0, 0.0, 0.0, 1500.0, 1500.0, 1500.0],
    "1500 arcsec of one": [0.0, 0.0, 0.0, -1500.0, 0.0, 0.0],
    "all signs, and scales": [500.0, -500.0, 300.0, 1500.0, -1500.0, 900.0],
}


def vectors(truth: Floats) -> Floats:
    """Rows x, y, z: how far and where the probe goes for one millimetre of each scale."""
    xy, yz, zx = np.cos(np.pi / 2 + ARCSEC * truth[3:])
    unit = np.linalg.cholesky(np.array([[1, xy, zx], [xy, 1, yz], [zx, yz, 1]]))
    return (1 + 1e-6 * truth[:3])[:, None] * unit


def recorded(truth: Floats, sigma: float = 0.0, seed: int = 0, count: int = 60, length: float = LENGTH) -> Points:
    random = np.random.default_rng(seed)
    points = bars(random, count, length, Machine("m", "XYZ", TRAVEL))
    read = points.xyz @ np.linalg.inv(vectors(truth))
    return points.at(read + sigma * random.standard_normal(read.shape))


def model_of(points: Points, length: float | None = LENGTH, sigma: float = 1e-3) -> RecordingModel:
    return RecordingModel(Ballbar(bar_facts(length, 0.5), points), effects(SIX), sigma)


@pytest.mark.parametrize("truth", MACHINES.values(), ids=MACHINES.keys())
def test_exact_bars_give_back_the_machine(truth: list[float]) -> None:
    found = model_of(recorded(np.array(truth))).estimate().least_squares
    np.testing.assert_allclose(found.value[:6], truth, atol=1e-6)
    assert np.abs(found.residuals).max() < 1e-8


@pytest.mark.parametrize("truth", MACHINES.values(), ids=MACHINES.keys())
def test_the_linear_sum_of_the_effects_would_miss_it(truth: list[float]) -> None:
    """The scale of Z would be in error by half the squares of its two angles: 8.5 ppm at 600″, many times its uncertainty."""
    points = recorded(np.array(truth))
    ends = points.xyz.reshape(-1, 2, 3)
    difference = ends[:, 1] - ends[:, 0]
    _, y, z = difference.T
    unit = difference / np.linalg.norm(difference, axis=1, keepdims=True)
    design = np.column_stack([unit * difference, -unit[:, 0] * y, -unit[:, 1] * z, -unit[:, 0] * z])
    values = np.zeros(6)
    for _ in range(20):
        matrix = np.eye(3) + np.diag(values[:3])
        matrix[1, 0], matrix[2, 1], matrix[2, 0] = -values[3:]
        missing = LENGTH - np.linalg.norm(difference @ matrix, axis=1)
        values += np.linalg.lstsq(design, missing, rcond=None)[0]
    u = np.sqrt(np.diag(model_of(points).estimate().least_squares.covariance))
    off = (values / ([1e-6] * 3 + [ARCSEC] * 3) - truth) / u[:6]
    assert np.abs(off).max() > 2


@settings(max_examples=15, deadline=None)
@given(
    st.tuples(*[st.floats(-500, 500)] * 3), st.tuples(*[st.floats(-1500, 1500)] * 3), st.sampled_from(["yzx", "zxy"])
)
def test_axes_by_other_names_are_the_same_axes(scales, squareness, order: str) -> None:
    """What is found does not depend on which axis the frame is laid along: x, y, z renamed in turn."""
    truth = np.array([*scales, *squareness])
    points = recorded(truth, sigma=1e-3, seed=5)
    turn = ["xyz".index(axis) for axis in order]
    renamed = replace(points, xyz=points.xyz[:, turn], machine=Machine("m", "XYZ", TRAVEL[turn]))
    planes = {frozenset("xy"): 3, frozenset("yz"): 4, frozenset("zx"): 5}
    place = [*turn, *(planes[frozenset(order["xyz".index(a)] for a in pair)] for pair in ("xy", "yz", "zx"))]
    one, other = model_of(points).estimate().least_squares, model_of(renamed).estimate().least_squares
    u = np.sqrt(np.diag(one.covariance))[place]
    assert np.all(np.abs(other.value[:6] - one.value[place]) < 0.01 * u)
    np.testing.assert_allclose(np.sqrt(np.diag(other.covariance))[:6], u, rtol=0.01)


def test_an_uncalibrated_bar_leaves_one_common_scale_free_however_the_axes_lean() -> None:
    found = model_of(recorded(np.array(MACHINES["all signs, and scales"])), length=None).estimate().least_squares
    np.testing.assert_allclose(found.null_space[:6, 0], [1, 1, 1, 0, 0, 0], atol=1e-9)
    assert found.determined.tolist() == [False] * 3 + [True] * 3 + [False]
    np.testing.assert_allclose(found.value[3:6], [1500, -1500, 900], atol=1e-6)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10_000))
def test_estimates_of_a_leaning_machine_scatter_as_their_covariance_says(seed: int) -> None:
    """The squared deviation from the truth, weighted by the covariance, follows χ² with six degrees of freedom."""
    truth = np.array(MACHINES["all signs, and scales"])
    found = model_of(recorded(truth, sigma=1e-3, seed=seed)).estimate().least_squares
    deviation, covariance = found.value[:6] - truth, found.covariance[:6, :6]
    certificate = np.zeros(6)
    certificate[:3] = 0.5e-3 / LENGTH * 1e6
    squares = deviation @ np.linalg.solve(covariance - np.outer(certificate, certificate), deviation)
    assert squares < 45  # exceeded by 5 in 10⁸


def test_simulated_bars_have_their_length_in_the_machine_of_these_vectors() -> None:
    truth = np.array(MACHINES["all signs, and scales"])
    simulated = model_of(recorded(np.zeros(6))).predicted(np.array([*truth, LENGTH]))
    ends = (simulated @ vectors(truth)).reshape(-1, 2, 3)
    np.testing.assert_allclose(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1), LENGTH, atol=1e-8)
