"""Which effects that were found are not named: improbable ones, and those of another form than the readings show."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from cmm_uq.analysis.diagnosis.asserted import NAMED, doubted, unseen
from cmm_uq.analysis.diagnosis.comparison.search import search, withhold
from cmm_uq.analysis.diagnosis.diagnosis import diagnose
from cmm_uq.analysis.diagnosis.joint import WithheldEffect
from cmm_uq.artefacts.ballbar import Ballbar
from cmm_uq.base.points import Machine, Points
from cmm_uq.machine.model import Noise, RecordingModel
from cmm_uq.machine.physics.catalogue import effects
from tests.analysis.diagnosis.test_assertion import found_with
from tests.analysis.diagnosis.test_invariance import NAMED as SIX
from tests.recordings import TRAVEL, bar_facts, bars, with_columns


@cache
def recording(*, growing: bool) -> Points:
    """Eighty bars whose Y stands off by the sense of X: evenly, or also in proportion to Y, which no play does."""
    random = np.random.default_rng(4)
    once = bars(random, 80, 400.0, Machine("m", "XYZ", TRAVEL))
    points = with_columns(once, approach_x=random.choice([-1.0, 1.0], len(once)))
    way, arm = points.columns["approach_x"], (once.xyz[:, 1] - once.xyz[:, 1].mean()) / 150
    error = 0.012 * way * (1 + (0.6 * arm if growing else 0))
    noise = 1.5e-3 * random.standard_normal(once.xyz.shape)
    return points.at(once.xyz - error[:, None] * [0, 1, 0] + noise)


def model(points: Points) -> RecordingModel:
    return RecordingModel(Ballbar(bar_facts(), points), effects(SIX))


@pytest.mark.parametrize(("probability", "named"), [(NAMED + 0.01, True), (NAMED - 0.01, False)])
def test_an_effect_is_named_from_four_in_five_with_what_could_stand_in_its_place(
    probability: float, *, named: bool
) -> None:
    part = 0.6 * probability
    start = found_with(((0,), part), ((1,), probability - part), ((), 1 - probability), chosen=frozenset({0}))
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("cmm_uq.analysis.diagnosis.asserted._as_well", lambda _found, _one, others: frozenset(others))
        patched.setattr("cmm_uq.analysis.diagnosis.asserted.FunctionFit.of", lambda *_: None)
        patched.setattr("cmm_uq.analysis.diagnosis.joint.effect_of", lambda _one: effects(("play_x_y",))[0])
        gone, beside = doubted(start)
    assert (set(gone), beside) == (set() if named else {0}, False)


def test_play_that_is_one_is_named() -> None:
    found = search(model(recording(growing=False)), 1.5e-3, alpha=0.01, seed=0)
    assert found.effects == ("play_x_y",)
    assert doubted(found) == ({}, False)


def test_play_that_grows_across_is_told_as_a_function_of_the_sense_of_motion_and_not_as_play() -> None:
    """A good part of what shows is no play: a product of the sense and of Y stands beside it."""
    found = search(model(recording(growing=True)), 1.5e-3, alpha=0.01, seed=0)
    assert "play_x_y" in found.effects
    gone, beside = doubted(found)
    assert beside
    (one,) = (each for each in gone.values() if each.effect == "play_x_y")
    assert "function of direction of travel along X and Y" in str(one.why)


@pytest.mark.parametrize(("shorter", "named"), [(0.0, True), (4.0, False)])
def test_waves_that_grow_shorter_are_no_period(shorter: float, *, named: bool) -> None:
    random = np.random.default_rng(5)
    once = bars(random, 200, 400.0, Machine("m", "XYZ", TRAVEL))
    u = (once.xyz[:, 1] - once.xyz[:, 1].min()) / float(np.ptp(once.xyz[:, 1]))
    error = 6e-3 * np.sin(2 * np.pi * (3 * u + shorter * u**2))
    noise = 1.5e-3 * random.standard_normal(once.xyz.shape)
    found = search(model(once.at(once.xyz - error[:, None] * [0, 1, 0] + noise)), 1.5e-3, alpha=0.01, seed=0)
    assert "periodic_scale_y" in found.effects
    assert ("periodic_scale_y" in {one.effect for one in doubted(found)[0].values()}) is not named


@pytest.mark.long
def test_what_is_withheld_so_is_modelled_as_a_function() -> None:
    found = diagnose(model(recording(growing=True)), stated_um=1.5, alpha=0.01, seed=0)
    assert found.verdict == "empirical"
    assert "play_x_y" in [each.effect for each in found.withheld]
    assert found.improvement.heldout_rms_after_um <= found.improvement.heldout_rms_before_um


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_errors_that_only_others_of_their_kind_make_probable_are_not_named(seed: int) -> None:
    """Two squarenesses as 1 : 2 of a machine of which the job says nothing: four of the six are none."""
    random = np.random.default_rng(seed)
    points = bars(random, 40, 400.0, Machine("m", "XYZ", TRAVEL))
    truth = RecordingModel(Ballbar(bar_facts(), points), effects(("squareness_yz", "squareness_zx")))
    read = points.at(truth.simulate(np.array([10.0, 20.0]), np.array([400.0]), Noise(1.5e-3), random))
    found = search(RecordingModel(Ballbar(bar_facts(), read), ()), None, alpha=0.01, seed=1)
    probable, gone = found.combinations, dict[int, WithheldEffect]()
    assert probable is not None
    while weak := unseen(found):
        gone |= weak
        found = withhold(found, frozenset(weak))
    assert set(found.effects) == {"squareness_yz", "squareness_zx"}
    for i, one in gone.items():
        assert one.probability <= 20 / 21 < 1
        assert one.probability < probable.of(i)
        assert "20 to 1" in str(one.why)
