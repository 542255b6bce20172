"""All errors of a machine given the recording of its calibration: what its model left out, parts do not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom

import cmm_uq
from cmm_uq.errors import CmmUqError
from cmm_uq.kinds.ballbar.observe import Ballbar
from cmm_uq.model import MeasurementModel
from cmm_uq.model.drawn_noise import Noise
from cmm_uq.parts.conditional import given_recording, joint_posterior
from cmm_uq.parts.machine import MachineState, StatedNoise, Unmodelled
from cmm_uq.parts.placing import Pose
from cmm_uq.parts.plan import Characteristic, Plan
from cmm_uq.parts.stated import flat_draws, machine_stated
from cmm_uq.parts.virtual import AtPose, Circumstances
from cmm_uq.physics.catalogue import effects
from cmm_uq.points import Floats
from tests.conftest import ROOT
from tests.parts_drawn import MACHINE, spot

MODELLED = ["scale_x", "scale_y", "scale_z", "squareness_xy", "squareness_yz", "squareness_zx"]
SIGMA = 2e-3
JOB = cmm_uq.read(ROOT / "examples" / "iota-1102-20C")
BARS = JOB.points.select(JOB.points.measurement != 18)


def left_out(*names: str) -> tuple[Unmodelled, ...]:
    return tuple(Unmodelled(e, np.array([c.prior_sd for c in e.coefficients])) for e in effects(names))


def calibration(xyz: Floats | None = None) -> MeasurementModel:
    points = BARS if xyz is None else BARS.at(xyz)
    return MeasurementModel(Ballbar(JOB.facts.artefact, points), effects(MODELLED))


def test_the_joint_posterior_is_the_normal_distribution_of_parameters_given_observations() -> None:
    """By the other algebra: S·Xᵀ(X·S·Xᵀ + σ²)⁻¹y, in the space of observations (Tarantola 2005, eq. 3.38)."""
    model, sigma = calibration(), 10e-3
    further = left_out("rotation_x_x", "straightness_x_y")
    which, mean, covariance = joint_posterior(model, further, sigma)
    assert which == (0, 1)
    whole = replace(model, effects=(*model.effects, *(one.effect for one in further)))
    about = model.estimate().about
    linear = whole.linearised(np.concatenate([about[:6], np.zeros(2), about[6:]]))
    X, y = linear.design / linear.noise_scale[:, None], linear.observed / linear.noise_scale
    S, m = np.diag(linear.prior_sd**2), linear.prior_mean
    gain = S @ X.T @ np.linalg.inv(X @ S @ X.T + sigma**2 * np.eye(len(y)))
    np.testing.assert_allclose(mean, (m + gain @ (y - X @ m))[:8], rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(covariance, (S - gain @ X @ S)[:8, :8], rtol=1e-5, atol=1e-4)


def test_what_cannot_be_told_from_the_recording_stays_on_its_own() -> None:
    which, mean, _ = joint_posterior(calibration(), left_out("hysteresis_x", "rotation_x_x", "periodic_scale_y"), SIGMA)
    assert which == (1,)  # play needs directions of approach, a period is not linear
    assert len(mean) == 7


def test_an_error_that_was_left_out_does_not_make_intervals_of_parts_too_narrow() -> None:
    """100 hidden machines with a roll of carriage x: 95 % intervals of a distance hold where the roll is reckoned with.

    Bounds of the number are those of a binomial distribution with 99.9 % of its probability.
    """
    roll, machines, random = left_out("rotation_x_x"), 100, np.random.default_rng(1)
    every = (*effects(MODELLED), roll[0].effect)
    sd = np.array([c.prior_sd for effect in every for c in effect.coefficients])
    designed = replace(calibration(), effects=every)
    # a diagonal of x and y close above the table: by x·z·roll it is another one than halfway up, which no squareness is
    noise, pose = StatedNoise(np.full(3, SIGMA)), Pose(np.eye(3), np.array([-400.0, -200.0, -180.0]))
    pair = spot("one", [0, 0, 0]), spot("other", [300, 300, 0])
    plan = Plan(pair, (Characteristic("", "distance", ("one", "other")),))
    inside = np.zeros(2)
    for _ in range(machines):
        truth = sd * random.standard_normal(len(sd))
        length = designed.artefact.sizes[0]
        size = np.array([length.nominal + length.sd * random.standard_normal()])
        model = calibration(designed.simulate(truth, size, Noise(coordinate=SIGMA), random))
        _, mean, covariance = joint_posterior(model, (), SIGMA)
        draws = random.multivariate_normal(mean, covariance, 2000)
        stated = MachineState(BARS.machine, effects(MODELLED), draws, noise, corrections=mean)
        real = MachineState(BARS.machine, every, truth[None], noise, corrections=np.append(mean, 0.0))
        error = _errors(plan, real, pose, random, 1)[0]
        together = given_recording(replace(stated, unmodelled=roll), model, SIGMA, 2000)
        for i, state in enumerate((stated, together)):
            low, high = np.quantile(_errors(plan, state, pose, random, 2000), [0.025, 0.975])
            inside[i] += low <= error <= high
    fewest, most = (float(binom.ppf(p, machines, 0.95)) for p in (0.0005, 0.9995))
    assert inside[0] < fewest
    assert fewest <= inside[1] <= most


def _errors(plan: Plan, state: MachineState, pose: Pose, random: np.random.Generator, n: int) -> Floats:
    at = AtPose(plan, Circumstances(state), pose)
    return at.errors(at.drawn(random, n))[:, 0]


def test_a_certificate_says_what_it_left_free() -> None:
    results = {
        "estimates": {"scale_x": {}, "squareness_xy": {}},
        "identifiability": {
            "prior_share": {"scale_x.ppm": 0.98, "squareness_xy.angle_arcsec": 0.01, "artefact.length_mm": 0.99}
        },
        "diagnosis": {"unseen": [{"effect": "rotation_x_y", "detected": 6.58}]},
        "job": {"date": "2026-11-22"},
    }
    names = ["squareness_xy.angle_arcsec", "scale_x.ppm", "noise.coordinate_um"]
    draws = flat_draws(names, np.array([5.0, 100.0, 2.0]), np.array([[[1.0, -1.0, 0.0], [-1.0, 1.0, 0.0]]]))
    state = machine_stated(results, draws, MACHINE, corrected=False)
    np.testing.assert_allclose(state.draws, [[99.0, 6.0], [101.0, 4.0]])
    assert state.free == ("scale_x",)
    assert str(state.calibrated) == "2026-11-22"
    np.testing.assert_allclose(state.noise.usual_mm, 2e-3)
    assert {one.effect.name: one for one in state.unmodelled}["rotation_x_y"].sd == pytest.approx([4.0], rel=1e-3)
    with pytest.raises(CmmUqError, match="states no errors of a machine"):
        machine_stated({"schema": "cmm-uq/budget/1"}, draws, MACHINE, corrected=True)
    with pytest.raises(CmmUqError, match=r"has no draws of scale_y.ppm"):
        machine_stated({**results, "estimates": {"scale_y": {}}}, draws, MACHINE, corrected=True)
