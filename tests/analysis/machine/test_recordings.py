"""Several recordings of one machine, taken together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom

import cmm_uq
from cmm_uq.analysis.machine.conditional import RecordedField, further_recording, given_recording, own_noise, white
from cmm_uq.analysis.machine.recordings import (
    ALONE,
    NO_DOUBT,
    FurtherRecording,
    FurtherRecordings,
    mean_noise,
    model_of_machine,
)
from cmm_uq.analysis.machine.state import MachineState, Unmodelled
from cmm_uq.app.commands.model import recorded_model
from cmm_uq.artefacts.ballbar import Ballbar
from cmm_uq.base.messages import say
from cmm_uq.base.points import Floats
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.model.field import curves
from cmm_uq.machine.model.noise import noise_of
from cmm_uq.machine.model.recorded import Noise
from cmm_uq.machine.physics.catalogue import effects
from cmm_uq.maths.inference.noise import Sizes
from cmm_uq.maths.inference.posterior import Cause, Doubt
from tests.analysis.machine.test_conditional import BARS, JOB, MODELLED, left_out, repeated
from tests.conftest import ROOT

SIGMA = 5e-3  # mm
FIRST = BARS.measurement % 2 == 1  # every second bar
# of a length without doubt: half of the bars then know no less of it than all of them
EXACT = JOB.facts.artefact.model_copy(update={"u_um": 0.0})


def of(points: Floats, xyz: Floats = BARS.xyz) -> RecordingModel:
    return RecordingModel(Ballbar(EXACT, BARS.at(xyz).select(points)), effects(MODELLED))


def further() -> tuple[Unmodelled, ...]:
    drawn = [one for one in curves() if "long" in one.family] + list(effects(["periodic_scale_x"]))
    return tuple(Unmodelled(one, np.array([c.prior_sd for c in one.coefficients])) for one in drawn)


def test_two_halves_of_a_recording_together_say_what_all_of_it_says() -> None:
    """A second model for the same observations: one recording of all bars."""
    whole, first, second = of(np.ones(len(FIRST), dtype=bool)), of(FIRST), of(~FIRST)
    noise = SIGMA * np.diag(np.sqrt(2 * np.ones(int(second.used.sum()))))  # of a length, of two points
    together = RecordedField.of(first, further(), beside=(FurtherRecording(second, noise),)).field
    alone = RecordedField.of(whole, further()).field
    assert together.families == alone.families
    known, random = white(SIGMA), np.random.default_rng(3)
    scales = random.uniform(0.02, 0.5, (4, len(alone.families)))
    each = Sizes(*(np.repeat(part, 4, axis=0) for part in vars(known).values()))
    density = together.log_likelihood(each, scales) - alone.log_likelihood(each, scales)
    np.testing.assert_allclose(density - density[0], 0.0, atol=2e-3)
    own = len(MODELLED)
    (mean, covariance), (expected, spread) = (one.normal(known, scales[0]) for one in (together, alone))
    u = np.sqrt(np.diag(spread)[:own])
    np.testing.assert_allclose((mean[:own] - expected[:own]) / u, 0.0, atol=2e-3)  # each in its own unit
    np.testing.assert_allclose(covariance[:own, :own] / np.outer(u, u), spread[:own, :own] / np.outer(u, u), atol=2e-3)


def test_what_is_in_doubt_about_the_first_recording_is_weighed_as_its_certified_length_would_be() -> None:
    """5 µm of the bar's length: as uncertainty of its certificate in one model, in the other a cause of doubt beside it."""
    first, second, length_mm = of(FIRST), of(~FIRST), SIGMA
    beside = (FurtherRecording(second, SIGMA * np.sqrt(2) * np.eye(int(second.used.sum()))),)
    facts = EXACT.model_copy(update={"u_um": 1e3 * length_mm})
    certified = replace(first, artefact=Ballbar(facts, first.artefact.points))
    every = Cause(say("length"), np.full((len(first.used), 1), length_mm))
    taken = FurtherRecordings(beside, lambda artefact: [every])
    in_doubt, none = (one.doubted(first) for one in (taken, replace(taken, recordings=())))
    assert none is None
    doubted, expected, exact = (
        RecordedField.of(model, further(), beside=beside, in_doubt=columns).field
        for model, columns in ((first, in_doubt), (certified, None), (first, None))
    )
    scale, own = np.full(len(exact.families), 0.1), len(MODELLED)
    found = [one.normal(white(SIGMA), scale) for one in (doubted, expected, exact)]
    u, other, without = (np.sqrt(np.diag(spread)[:own]) for _, spread in found)
    np.testing.assert_allclose(u, other, rtol=1e-3)
    np.testing.assert_allclose(found[0][0][:own], found[1][0][:own], atol=1e-3 * u.min())
    assert np.max(u / without) > 1.01  # ten times what the two may differ by


def test_doubt_that_others_are_weighed_against_widens_nothing_again() -> None:
    doubt = Doubt(())  # one of its own
    taken = FurtherRecordings((known(of(~FIRST)),))
    assert taken.left_of(doubt) is NO_DOUBT
    assert ALONE.left_of(doubt) is doubt


def simulated(coefficients: Floats, seed: int) -> Floats:
    model = of(np.ones(len(FIRST), dtype=bool))
    exact = np.array([model.artefact.sizes[0].nominal])
    return model.simulate(coefficients, exact, Noise(coordinate=SIGMA), np.random.default_rng(seed))


def calibrated(xyz: Floats, draws: int = 4000) -> tuple[RecordingModel, MachineState]:
    first = of(FIRST, xyz)
    state = MachineState(BARS.machine, effects(MODELLED), np.zeros((2, 6)), unmodelled=left_out("straightness_x_y"))
    return first, given_recording(state, first, SIGMA, draws, seed=5)


def known(model: RecordingModel) -> FurtherRecording:
    return FurtherRecording(model, own_noise(model, (), known=white(SIGMA)))


TRUE = np.array([30.0, -20.0, 10.0, 4.0, -3.0, 2.0])  # ppm, ″


@pytest.mark.long
def test_a_recording_of_the_same_machine_contradicts_it_no_more_often_than_is_said() -> None:
    """Of 60 chances 12 at most are below a tenth (binomial, 1 %), and they are spread."""
    found = []
    for seed in range(60):
        xyz = simulated(TRUE, seed)
        first, state = calibrated(xyz, 2000)
        second = further_recording(known(first), of(~FIRST, xyz), state.unmodelled, sigma_mm=SIGMA)
        found.append(second.contradiction(state))
    assert sum(chance < 0.1 for chance in found) <= binom.ppf(0.99, 60, 0.1)
    assert min(found) < 0.3 < 0.9 < max(found)


def test_a_change_of_one_error_is_seen_among_many_observations() -> None:
    """A scale that moved by some five of its standard uncertainties; χ² of all observations says it less clearly."""
    chances = []
    for seed in range(4):
        xyz, moved = simulated(TRUE, seed), simulated(TRUE + np.array([90.0, 0, 0, 0, 0, 0]), 100 + seed)
        first, state = calibrated(xyz, 2000)
        second = further_recording(known(first), of(~FIRST, moved), state.unmodelled, sigma_mm=SIGMA)
        chances.append(second.contradiction(state))
    assert np.median(chances) < 1e-3


def test_a_machine_that_is_another_is_contradicted_unless_so_much_change_is_expected() -> None:
    xyz, moved = simulated(TRUE, 1), simulated(TRUE + np.array([200.0, 0, 0, 0, 0, 0]), 2)
    first, state = calibrated(xyz)
    second = further_recording(known(first), of(~FIRST, moved), (), sigma_mm=SIGMA)
    assert second.contradiction(state) < 1e-6
    scale = first.unknowns[0].key
    assert replace(second, change={scale: 200.0}).contradiction(state) > 0.01
    assert replace(second, corrections={scale: -200.0}).contradiction(state) > 0.01
    assert replace(second, corrections={scale: 200.0}).contradiction(state) < 1e-6


def test_a_calibration_that_names_no_error_of_the_machine_is_contradicted_no_sooner() -> None:
    first = replace(of(FIRST), effects=())
    state = MachineState(BARS.machine, (), np.zeros((2, 0)), unmodelled=left_out(*MODELLED, "straightness_x_y"))
    alone = given_recording(state, first, SIGMA, 2000)
    same = further_recording(known(first), of(~FIRST), alone.unmodelled, sigma_mm=SIGMA)
    assert same.contradiction(alone) > 1e-3
    moved = simulated(TRUE + np.array([2000.0, 0, 0, 0, 0, 0]), 2)
    other = further_recording(known(first), of(~FIRST, moved), alone.unmodelled, sigma_mm=SIGMA)
    assert other.contradiction(alone) < 1e-6


def test_what_a_further_recording_says_goes_less_far_the_more_the_machine_may_have_changed() -> None:
    """Of a drift without bound nothing: as the first recording alone."""
    xyz = simulated(TRUE, 3)
    first, alone = calibrated(xyz)
    second = further_recording(known(first), of(~FIRST, xyz), (), sigma_mm=SIGMA)
    state = replace(alone, effects=alone.effects[:6], draws=alone.draws[:, :6], drift=np.zeros(6),
                    corrections=np.zeros(6), unmodelled=left_out("straightness_x_y"))  # fmt: skip
    u = []
    for change in (0.0, 20.0, 1e6):
        every = {one.key: change for one in first.unknowns[:6]}
        given = given_recording(
            state, first, SIGMA, 4000, 5, beside=FurtherRecordings((replace(second, change=every),))
        )
        u.append(given.draws[:, :6].std(axis=0))
    assert np.all(u[0] < 0.95 * u[2])
    assert np.all(u[0] < 1.02 * u[1])
    assert np.all(u[1] < 1.02 * u[2])
    np.testing.assert_allclose(u[2], alone.draws[:, :6].std(axis=0), rtol=0.05)


def test_the_mean_noise_of_a_recording_is_that_of_recordings_made_anew() -> None:
    """Their covariance, of noise by axis, of set-ups and of a slow wander; a second method for the same matrix."""
    components = noise_of(repeated(3))
    sizes = Sizes(np.full((2, 3), 2e-3), np.full(2, 3e-3), np.zeros(2), np.full(2, 4e-3), np.array([5.0, 0.0]))
    drawn = components.repeated(sizes, 20_000, np.random.default_rng(0)).reshape(-1, len(components.shares))
    expected = drawn.T @ drawn / len(drawn)
    factor = mean_noise(components, sizes)
    size = np.sqrt(np.diag(expected))
    np.testing.assert_allclose(factor @ factor.T / np.outer(size, size), expected / np.outer(size, size), atol=0.04)


def test_only_errors_of_the_machine_are_common_to_recordings() -> None:
    job = cmm_uq.read(ROOT / "examples" / "gauge-blocks-simulated")
    gauge, _ = recorded_model(job)
    bars = of(FIRST)
    names = [effect.name for effect in model_of_machine(bars, gauge).effects]
    assert names == [*MODELLED, "probe_radius"]
    back = [effect.name for effect in model_of_machine(gauge, bars).effects]
    assert "probe_radius" not in back
    assert not [name for name in back if name.startswith("hysteresis")]  # bars have no directions of approach
