"""All errors of a machine given the recording of its calibration: what its model left out, parts do not.

What a recording shows of an error of each of its points.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import sici
from scipy.stats import binom

import cmm_uq
from benchmarks.parts.known_noise import joint_posterior
from cmm_uq.analysis.machine.conditional import (
    RecordedField,
    given_recording,
    shown,
    stated_noise,
)
from cmm_uq.analysis.machine.state import (
    MachineState,
    StatedNoise,
    Unmodelled,
    machine_stated,
    of_machine,
    with_bounds,
)
from cmm_uq.analysis.parts.plan import PartCharacteristic, PartPose, Plan
from cmm_uq.analysis.parts.virtual import AtPose, MeasurementConditions
from cmm_uq.app.commands.estimation import doubt_of
from cmm_uq.app.commands.model import recorded_model
from cmm_uq.artefacts.ballbar import Ballbar
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats
from cmm_uq.jobs.tables.conformity import Circumstances, TestUncertainty as Stated
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.model.artefact_doubt import causes_of
from cmm_uq.machine.model.field import TRIED, EveryPeriod, GivenPeriod, covariance
from cmm_uq.machine.model.noise import noise_of
from cmm_uq.machine.model.recorded import Noise
from cmm_uq.machine.physics.catalogue import effects
from cmm_uq.maths.inference.noise import Sizes
from cmm_uq.maths.inference.posterior import Doubt, sample_with_noise
from tests.conftest import ROOT
from tests.parts_drawn import MACHINE, spot

MODELLED = ["scale_x", "scale_y", "scale_z", "squareness_xy", "squareness_yz", "squareness_zx"]
SIGMA = 2e-3
CURVED = [f"straightness_{a}_{b}" for a, b in ("xy", "xz", "yx", "yz", "zx", "zy")]
JOB = cmm_uq.read(ROOT / "examples" / "iota-1102-20C")
BARS = JOB.points.select(JOB.points.measurement != 18)


def left_out(*names: str) -> tuple[Unmodelled, ...]:
    return tuple(Unmodelled(e, np.array([c.prior_sd for c in e.coefficients])) for e in effects(names))


def calibration(xyz: Floats | None = None) -> RecordingModel:
    points = BARS if xyz is None else BARS.at(xyz)
    return RecordingModel(Ballbar(JOB.facts.artefact, points), effects(MODELLED))


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
    further = left_out("hysteresis_x", "rotation_x_x", "periodic_scale_y")
    which, mean, _ = joint_posterior(calibration(), further, SIGMA)
    assert which == (1, 2)  # play needs directions of approach
    assert len(mean) == 6 + 1 + 2 * TRIED + RecordedField.of(calibration(), further, learned=False).field.into.shape[1]


def test_all_trial_periods_together_have_nearly_the_covariance_of_a_period_that_nobody_knows() -> None:
    """Of errors at two places d apart: that of any period λ, evenly in ln λ, is the mean of A²·cos(2πd/λ), a difference of
    cosine integrals, from which a finite sum is off by less than a tenth of A² in the root mean square."""
    (periodic,) = effects(["periodic_scale_x"])
    whole = EveryPeriod(periodic)
    shown = whole.basis(BARS)[:, 0] * [one.prior_sd for one in whole.coefficients]
    apart = np.abs(np.subtract.outer(BARS.readings["x"], BARS.readings["x"]))
    low, high = periodic.shape[0].low, periodic.shape[0].high
    far = 2 * np.pi * np.where(apart > 0, apart, 1.0)
    mean = (sici(far / low)[1] - sici(far / high)[1]) / np.log(high / low)
    off = shown @ shown.T / 0.01**2 - np.where(apart > 0, mean, 1.0)
    assert np.sqrt(np.mean(off**2)) < 0.1
    np.testing.assert_allclose(np.diagonal(off), 0.0, atol=1e-12)


def gauge() -> RecordingModel:
    """The example's step gauge: seven lines of 7 to 15 faces, three times."""
    model, _ = recorded_model(cmm_uq.read(ROOT / "examples" / "step-gauge-simulated"))
    return replace(model, effects=effects(MODELLED))


def beside(model: RecordingModel, sigma: float, between: Floats) -> tuple[Floats, Floats]:
    """Mean (t,) and covariance (t, t), mm, of a periodic error of y at readings, in the space of observations with its
    covariance itself: K** − K*(K + D·P·Dᵀ + σ²)⁻¹K*ᵀ (Rasmussen, Williams 2006, eq. 2.24); each reading moved by 1 mm."""
    (periodic,), linear = effects(["periodic_scale_y"]), model.estimate().linear
    about, n = model.estimate().about, len(model.artefact.points)
    moved = np.zeros((n, 3, n))
    moved[np.arange(n), 1, np.arange(n)] = 1.0
    directions = model._about(about).points.directions
    moved = moved if directions is None else np.einsum("k,nm->nkm", directions[1], np.eye(n))
    impulse = linear.reduce(model.seen(moved, about))
    rows, given = linear.priors
    D, y = linear.reduced.design, linear.reduced.observed
    prior = np.linalg.inv(rows.T @ rows)
    start = prior @ rows.T @ given
    readings = model.artefact.points.at(model.where(about)).readings["y"]
    cross = covariance(periodic, between, readings) @ impulse.T
    whole = impulse @ covariance(periodic, readings, readings) @ impulse.T + D @ prior @ D.T + sigma**2 * np.eye(len(y))
    gain = np.linalg.solve(whole, cross.T).T
    return gain @ (y - D @ start), covariance(periodic, between, between) - gain @ cross.T


def test_what_a_recording_says_of_an_error_with_a_period_is_what_its_covariance_says() -> None:
    """Of a gauge with 282 readings: errors in between have the mean of the exact algebra and, over pairs 12 mm apart, its
    variance, but for what correlations of 64 trial periods are off by beforehand."""
    model, sigma = gauge(), 1e-3
    further, between = left_out("periodic_scale_y"), np.linspace(333.0, 800.0, 40)
    mean, variance = beside(model, sigma, between)
    _, found, spread = joint_posterior(model, further, sigma)
    (effect,) = RecordedField.of(model, further, learned=False).effects
    assert isinstance(effect, GivenPeriod)
    at = effect.at(between)
    np.testing.assert_allclose(at @ found[6:], mean, atol=0.02 * float(np.sqrt(np.diagonal(variance).mean())))
    said = at @ spread[6:, 6:] @ at.T
    apart = np.eye(40)[:-1] - np.eye(40)[1:]
    ratio = np.diagonal(apart @ said @ apart.T) / np.diagonal(apart @ variance @ apart.T)
    assert 0.7 < ratio.min() < ratio.max() < 1.4
    assert ratio.mean() == pytest.approx(1.0, abs=0.1)


def test_a_draw_of_an_error_with_a_period_has_one_beforehand_with_the_covariance_of_all() -> None:
    """Products of two coefficients scatter by √(3·64/100 000) at most, a mixture of 64 normals; six times that."""
    model, further = gauge(), left_out("periodic_scale_y")
    (effect,) = RecordedField.of(model, further).effects
    assert isinstance(effect, GivenPeriod)
    draws = effect.beforehand(np.random.default_rng(3), 100_000)
    waves, said = draws[:, : 2 * TRIED], draws[:, 2 * TRIED :]
    assert not said.any()
    assert (np.count_nonzero(waves.reshape(-1, TRIED, 2).any(axis=2), axis=1) == 1).all()
    np.testing.assert_allclose(
        waves.T @ waves / len(waves), np.eye(2 * TRIED), atol=6 * np.sqrt(3 * TRIED / len(waves))
    )


def repeated(times: int) -> RecordingModel:
    """The bars, each measured so many times in its set-up."""
    n = len(BARS)
    points = replace(
        BARS, xyz=np.tile(BARS.xyz, (times, 1)), measurement=np.tile(BARS.measurement, times),
        point=np.tile(BARS.point, times), repeat=np.repeat(np.arange(1, times + 1), n), lines=np.arange(n * times),
        columns={name: np.tile(values, times) for name, values in BARS.columns.items()},
    )  # fmt: skip
    return RecordingModel(Ballbar(JOB.facts.artefact, points), effects(MODELLED))


def test_offsets_of_set_ups_widen_what_is_left_out_as_generalised_least_squares_says() -> None:
    """Variance of a length: 2σ² of each reading and 2τ² of its set-up, common to its three repeats; with all priors
    (XᵀV⁻¹X + P)⁻¹, V filled in by hand. Covariances of 40 000 draws scatter by 1 %."""
    model, further = repeated(3), left_out("rotation_x_x", "straightness_x_y")
    together, count = RecordedField.of(model, further, learned=False), 40_000
    whole = replace(model, effects=(*model.effects, *(one.effect for one in further)))
    about = model.estimate().about
    linear = whole.linearised(np.concatenate([about[:6], np.zeros(2), about[6:]]))
    one_set_up = model.artefact.measurement[:, None] == model.artefact.measurement
    prior = np.diag(1 / linear.prior_sd**2)
    widths = []
    for sigma, tau in ((5e-3, 0.0), (5e-3, 20e-3)):
        V = 2 * (sigma**2 * np.eye(len(one_set_up)) + tau**2 * one_set_up)
        every = np.linalg.inv(linear.design.T @ np.linalg.solve(V, linear.design) + prior)
        mean = (every @ (linear.design.T @ np.linalg.solve(V, linear.observed) + prior @ linear.prior_mean))[:8]
        covariance = every[:8, :8]
        none = np.zeros(count)
        sizes = Sizes(np.full((count, 3), sigma), np.full(count, tau), none, none, none + 1)
        drawn = together.coefficients(sizes, np.zeros((count, 0)), np.random.default_rng(4))
        scale = np.sqrt(np.diagonal(covariance))
        np.testing.assert_allclose(
            np.cov(drawn.T) / np.outer(scale, scale), covariance / np.outer(scale, scale), atol=0.03
        )
        np.testing.assert_allclose(drawn.mean(axis=0) / scale, mean / scale, atol=0.03)
        widths.append(drawn.std(axis=0))
    assert (widths[1] > widths[0]).all()
    assert widths[1][0] > 2.5 * widths[0][0]  # √(σ²/3 + τ²)/√(σ²/3) = 7, less where priors hold


def test_the_noise_is_found_together_with_what_was_left_out() -> None:
    """Bars measured three times with 2 µm, set-ups off by 6 µm, and a roll that the calibration left out."""
    model, (roll,) = repeated(3), left_out("rotation_x_x")
    designed = replace(model, effects=(*model.effects, roll.effect))
    truth, random = np.zeros(7), np.random.default_rng(11)
    truth[6] = 60.0
    length = designed.artefact.sizes[0].nominal
    xyz = designed.simulate(truth, np.array([length]), Noise(coordinate=2e-3, placing=6e-3), random)
    seen = replace(model, artefact=Ballbar(JOB.facts.artefact, model.artefact.points.at(xyz)))
    state = MachineState(BARS.machine, effects(MODELLED), np.zeros((2, 6)), unmodelled=(roll,))
    found = given_recording(state, seen)
    assert found.noise.usual_mm == pytest.approx(np.full(3, 2e-3), rel=0.4)
    assert np.quantile(found.noise.placing_mm, 0.05) < 6e-3 < np.quantile(found.noise.placing_mm, 0.95)
    low, high = np.quantile(found.draws[:, 6], [0.005, 0.995])
    assert low < 60.0 < high
    assert found.prior_share["rotation_x_x"] == pytest.approx(found.draws[:, 6].std() / 60.0)


def test_components_of_a_recording_act_on_a_part_as_they_did_there() -> None:
    """Variance of a bar as long as the longest: 2g², as of a distance from the first point; a wander that forgets after a
    part of the recording's duration; steps of a display."""
    model = repeated(3)
    points = replace(model.artefact.points, columns={"time_s": 7.0 * np.arange(len(model.artefact.points))})
    model = RecordingModel(Ballbar(JOB.facts.artefact, points), effects(MODELLED))
    one = np.ones(1)
    sizes = Sizes(2e-3 * np.ones((1, 3)), 3e-3 * one, 4e-3 * one, 5e-3 * one, 10 * one)
    components = replace(noise_of(model), display=1e-3)
    found = stated_noise(model, components, sizes)
    np.testing.assert_allclose(found.coordinate_mm, np.hypot(2e-3, 1e-3 / np.sqrt(12)))
    assert float(np.asarray(found.growth_mm)[0]) == pytest.approx(4e-3 * np.sqrt(2))
    ends = model.artefact.points.xyz[model.artefact.rows]
    assert found.longest_mm == pytest.approx(np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).max(), abs=0.5)
    duration = 7.0 * (len(points) - 2)  # between the middles of the first and of the last bar
    assert np.asarray(found.slow_time_s)[0] == pytest.approx(duration / 10)
    assert found.walked_s == pytest.approx(duration)
    assert (np.asarray(found.placing_mm)[0], np.asarray(found.slow_mm)[0]) == pytest.approx((3e-3, 5e-3))


@pytest.mark.long
def test_a_noise_that_could_as_well_be_errors_left_out_is_that_of_the_certificate(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    state = MachineState(BARS.machine, effects(MODELLED), np.zeros((2, 6)), unmodelled=left_out(*CURVED))
    found = given_recording(state, calibration())
    monkeypatch.setattr("cmm_uq.analysis.machine.conditional._UNTOLD", 1.0)
    safe = given_recording(state, calibration())
    estimate = calibration().estimate()
    alone = sample_with_noise(estimate.linear, noise_of(calibration()), estimate.least_squares, 0).sizes.coordinate
    assert np.sqrt(np.mean(safe.noise.usual_mm**2)) == pytest.approx(np.sqrt(np.mean(alone**2)), rel=0.02)
    assert np.mean(safe.noise.usual_mm) > np.mean(found.noise.usual_mm)


@pytest.mark.long
def test_an_error_that_was_left_out_does_not_make_intervals_of_parts_too_narrow() -> None:
    """100 hidden machines with a roll of carriage x: 95 % intervals of a distance hold where the roll is reckoned with.

    Bounds of the number are those of a binomial distribution with 99.9 % of its probability.
    """
    roll, machines, random = left_out("rotation_x_x"), 100, np.random.default_rng(1)
    every = (*effects(MODELLED), roll[0].effect)
    sd = np.array([c.prior_sd for effect in every for c in effect.coefficients])
    designed = replace(calibration(), effects=every)
    # a diagonal of x and y close above the table: by x·z·roll it is another one than halfway up, which no squareness is
    noise, pose = StatedNoise(np.full(3, SIGMA)), PartPose(np.eye(3), np.array([-400.0, -200.0, -180.0]))
    pair = spot("one", [0, 0, 0]), spot("other", [300, 300, 0])
    plan = Plan(pair, (PartCharacteristic("", "distance", ("one", "other")),))
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


def _errors(plan: Plan, state: MachineState, pose: PartPose, random: np.random.Generator, n: int) -> Floats:
    at = AtPose(plan, MeasurementConditions(state), pose)
    return at.errors(at.drawn(random, n))[:, 0]


def test_faults_of_the_artefact_and_of_its_probe_stay_with_them() -> None:
    """Gauge blocks whose calibration has a probe's radius between scales and squarenesses: each error keeps its own draws."""
    job = cmm_uq.read(ROOT / "examples" / "gauge-blocks-simulated")
    model, _ = recorded_model(job)
    names = [effect.name for effect in model.effects]
    own = tuple(effect for effect in model.effects if of_machine(effect))
    assert "probe_radius" in names
    assert "probe_radius" not in [effect.name for effect in own]
    _, mean, covariance = joint_posterior(model, (), 3e-4)
    state = MachineState(job.points.machine, own, np.zeros((2, len(own))))
    found = given_recording(state, model, 3e-4, 20_000)
    at = [names.index(effect.name) for effect in own]
    sd = np.sqrt(np.diagonal(covariance))[at]
    np.testing.assert_allclose((found.draws.mean(axis=0) - mean[at]) / sd, 0, atol=0.03)
    np.testing.assert_allclose(found.draws.std(axis=0) / sd, 1, rtol=0.03)


def warm(kelvin: float) -> Doubt:
    """Of the step gauge's lengths by its temperature and what else is stated of it, steel."""
    model, stated = gauge(), Circumstances(cte_per_k=11.5e-6, uncertainty=Stated(u_temperature_k=kelvin))
    return doubt_of(model, model.estimate(), 1e-3, causes_of(model.artefact, stated))


def test_all_scales_are_in_doubt_by_what_the_gauge_expands() -> None:
    """0.5 K of steel: 5.75 ppm of all three alike, and nothing of a squareness if all set-ups were warm alike."""
    own, whole = warm(0.0).carried, warm(0.5).carried
    (common, _), scales = whole[-1], np.eye(6)[:3]
    assert len(whole) == len(own) + 1
    np.testing.assert_allclose(np.abs(scales @ common[:6]), 5.75, rtol=1e-4)
    assert len(set(np.sign(common[:3, 0]))) == 1
    np.testing.assert_allclose(common[3:6], 0.0, atol=1e-3)
    assert warm(0.5).covariance()[0, 0] - warm(0.0).covariance()[0, 0] == pytest.approx(5.75**2, rel=1e-4)


def test_a_length_of_a_part_is_in_doubt_by_what_the_gauge_expanded() -> None:
    """400 mm along each axis: L·α·u(t) = 2.3 µm in quadrature, about the same mean; 20 000 draws each.

    Across no less, and no more than if the set-ups, each warm by itself, put squarenesses in doubt besides.
    """
    ends = {"x": [400, 0, 0], "y": [0, 400, 0], "z": [0, 0, 400], "xy": [240, 320, 0]}
    plan = Plan(
        (spot("one", [0, 0, 0]), *(spot(name, place) for name, place in ends.items())),
        tuple(PartCharacteristic(name, "distance", ("one", name)) for name in ends),
    )
    pose, random = PartPose(np.eye(3), np.array([100.0, 100.0, -500.0])), np.random.default_rng(3)
    state, found = MachineState(gauge().artefact.points.machine, effects(MODELLED), np.zeros((1, 6))), []
    for doubt in (warm(0.0), warm(0.5)):
        machine = given_recording(state, gauge(), 1e-3, 20_000, doubt=doubt)
        at = AtPose(plan, MeasurementConditions(replace(machine, noise=StatedNoise())), pose)
        found.append(1e3 * at.errors(at.drawn(random, 20_000)))
    certain, doubted = found
    expected = np.hypot(certain.std(axis=0), 400 * 11.5e-6 * 0.5 * 1e3)
    np.testing.assert_allclose(doubted.std(axis=0)[:3], expected[:3], rtol=0.02)
    assert 0.98 < doubted.std(axis=0)[3] / expected[3] < 1.02 * np.sqrt(2)
    np.testing.assert_allclose(doubted.mean(axis=0), certain.mean(axis=0), atol=0.1)


@pytest.mark.parametrize("corrected", [True, False])
def test_a_machine_corrects_what_its_certificate_states_and_no_more(corrected: bool) -> None:
    draws = np.random.default_rng(0).normal([40.0, 90, 10, -170, -20, 20], 2.0, (500, 6))
    state = MachineState(
        BARS.machine, effects(MODELLED), draws, unmodelled=left_out("rotation_x_x"), corrected=corrected
    )
    found = given_recording(state, calibration(), SIGMA, 500)
    np.testing.assert_allclose(found.corrects, [*(draws.mean(axis=0) if corrected else np.zeros(6)), 0.0])


def test_a_bound_that_is_stated_holds_what_a_recording_does_not_show() -> None:
    """Bars show no play: it keeps what is stated. That the scale errs by so little they deny: nothing else explains them."""
    apart = left_out("hysteresis_x", "periodic_scale_y")
    state = MachineState(BARS.machine, effects(MODELLED), np.zeros((2, 6)), unmodelled=apart)
    found = with_bounds(state, {"hysteresis_x": 2.0, "periodic_scale_y": 0.5})
    assert found.unmodelled[0].sd == pytest.approx([2.0 / 1.959964])
    drawn = given_recording(found, calibration(), SIGMA, 4000)
    assert [one.effect.name for one in drawn.unmodelled] == ["hysteresis_x"]
    assert drawn.unmodelled[0].sd == found.unmodelled[0].sd
    play, periodic = drawn.statements
    assert np.isnan(play.ratio)
    assert (periodic.of, periodic.denied) == ("periodic_scale_y", True)
    assert list(drawn.scales) == ["periodic"]
    error = drawn.effects[-1]
    assert isinstance(error, GivenPeriod)
    at = error.at(np.linspace(300.0, 800.0, 50))
    assert 1e3 * float(np.sqrt(np.mean((drawn.draws[:, 6:] @ at.T) ** 2))) > 5
    with pytest.raises(CmmUqError, match="scale_x is neither play nor a periodic error"):
        with_bounds(state, {"scale_x": 1.0})
    with pytest.raises(CmmUqError, match="there is no error 'play_x'"):
        with_bounds(state, {"play_x": 1.0})
    with pytest.raises(CmmUqError, match="the calibration estimates hysteresis_x, which no bound says better"):
        with_bounds(replace(state, unmodelled=()), {"hysteresis_x": 1.0})


def test_a_certificate_says_what_it_left_free() -> None:
    results = {
        "estimates": {"scale_x": {}, "squareness_xy": {}},
        "identifiability": {
            "prior_share": {"scale_x.ppm": 0.98, "squareness_xy.angle_arcsec": 0.01, "artefact.length_mm": 0.99}
        },
        "diagnosis": {"unseen": [{"effect": "rotation_x_y", "detected": 6.58}]},
        "job": {"date": "2026-11-22"},
    }
    draws = {
        "squareness_xy.angle_arcsec": np.array([6.0, 4.0]), "scale_x.ppm": np.array([99.0, 101.0]),
        "noise.coordinate_um": np.array([2.0, 2.0]),
    }  # fmt: skip
    state = machine_stated(results, draws, MACHINE, corrected=False)
    np.testing.assert_allclose(state.draws, [[99.0, 6.0], [101.0, 4.0]])
    assert state.free == ("scale_x",)
    assert str(state.calibrated) == "2026-11-22"
    np.testing.assert_allclose(state.noise.usual_mm, 2e-3)
    assert {one.effect.name: one for one in state.unmodelled}["rotation_x_y"].sd == pytest.approx([4.0], rel=1e-3)
    with_sag = {**results, "estimates": {**results["estimates"], "artefact_sag": {}}}  # type: ignore[dict-item]
    assert [e.name for e in machine_stated(with_sag, draws, MACHINE, corrected=True).effects] == [
        "scale_x",
        "squareness_xy",
    ]
    with pytest.raises(CmmUqError, match="states no errors of a machine"):
        machine_stated({"schema": "cmm-uq/budget/1"}, draws, MACHINE, corrected=True)
    with pytest.raises(CmmUqError, match=r"has no draws of scale_y.ppm"):
        machine_stated({**results, "estimates": {"scale_y": {}}}, draws, MACHINE, corrected=True)


(PERIODIC,) = effects(["periodic_scale_y"])


def test_a_recording_shows_the_sum_of_what_it_shows_of_each_point() -> None:
    """Along the motion of Y, which leans by 170″ at most on this machine: by so much of itself the sum differs."""
    model = calibration()
    about = model.estimate().about
    e = PERIODIC.basis(BARS, (37.0,)) @ np.array([3.0, 4.0])
    expected = model.seen(e[:, :, None], about)[:, 0]
    np.testing.assert_allclose(shown(model, PERIODIC) @ e[:, 1], expected, atol=2 * 170 / 206265 * np.abs(e).max())
