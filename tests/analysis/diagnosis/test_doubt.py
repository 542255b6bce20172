"""Which effects that were found are not named: improbable ones, and those of another form than the readings show."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest

from cmm_uq.analysis.diagnosis.asserted import better_than_chance, doubted, least_supported
from cmm_uq.analysis.diagnosis.comparison.lack_of_fit import NOTHING
from cmm_uq.analysis.diagnosis.comparison.search import SearchResult, search, withhold
from cmm_uq.analysis.diagnosis.diagnosis import diagnose
from cmm_uq.analysis.diagnosis.empirical.model import empirical_model
from cmm_uq.analysis.diagnosis.joint import NAMED, WithheldEffect
from cmm_uq.artefacts.ballbar import Ballbar
from cmm_uq.base.points import Floats, Machine, Points
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
        patched.setattr("cmm_uq.analysis.diagnosis.asserted.effect_of", lambda _one: effects(("play_x_y",))[0])
        gone, forms = doubted(start)
    assert (set(gone), forms.beside) == (set() if named else {0}, False)


def test_play_that_is_one_is_named() -> None:
    found = search(model(recording(growing=False)), 1.5e-3, alpha=0.01, seed=0)
    assert found.effects == ("play_x_y",)
    gone, forms = doubted(found)
    assert (gone, forms.beside) == ({}, False)


def test_play_that_grows_across_is_told_as_a_function_of_the_sense_of_motion_and_not_as_play() -> None:
    """A good part of what shows is no play: a product of the sense and of Y stands beside it."""
    found = search(model(recording(growing=True)), 1.5e-3, alpha=0.01, seed=0)
    assert "play_x_y" in found.effects
    gone, forms = doubted(found)
    assert forms.beside
    (one,) = (each for each in gone.values() if each.effect == "play_x_y")
    assert "function of direction of travel along X and Y" in str(one.why)


@pytest.mark.long(but="False")
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


def test_a_beat_of_two_waves_is_no_period() -> None:
    random = np.random.default_rng(5)
    once = bars(random, 100, 400.0, Machine("m", "XYZ", TRAVEL))
    u = (once.xyz[:, 1] - once.xyz[:, 1].min()) / float(np.ptp(once.xyz[:, 1]))
    error = 1.2e-3 * (np.sin(2 * np.pi * 3 * u) + np.sin(2 * np.pi * 4.2 * u))
    noise = 1.5e-3 * random.standard_normal(once.xyz.shape)
    found = search(model(once.at(once.xyz - error[:, None] * [0, 1, 0] + noise)), 1.5e-3, alpha=0.01, seed=0)
    assert found.effects == ("periodic_scale_y",)
    assert not named(found)


@pytest.mark.parametrize(
    ("p_value", "odds"), [(0.1, 0.625), (0.05, 0.407), (0.01, 0.125), (0.005, 0.072), (0.001, 0.0188)]
)
def test_nothing_is_more_probable_than_chance_allows(p_value: float, odds: float) -> None:
    """Odds of nothing at least, of even ones: Sellke, Bayarri & Berger (2001), table 1."""
    even = NOTHING / (1 - NOTHING)
    assert 1 / better_than_chance(p_value) - 1 == pytest.approx(odds * even, rel=6e-3)


def shifted(random: np.random.Generator, axis: int, error: Callable[[Points], Floats]) -> RecordingModel:
    """A hundred bars, their balls in any order of time, in which one axis is off, in micrometres."""
    once = bars(random, 100, 400.0, Machine("m", "XYZ", TRAVEL))
    points = with_columns(once, time_s=40.0 * random.permutation(len(once)))
    off = 1e-3 * error(points)[:, None] * np.eye(3)[axis]
    return model(points.at(once.xyz - off + 1.5e-3 * random.standard_normal(once.xyz.shape)))


def named(found: SearchResult) -> set[str]:
    """Effects, less those that are doubted, until none is."""
    while gone := doubted(found)[0]:
        found = withhold(found, frozenset(gone))
    return set(found.effects)


def walk(seed: int, count: int) -> Floats:
    return np.cumsum(np.random.default_rng(seed).standard_normal(count))


@pytest.mark.long(but="an hour")
@pytest.mark.parametrize(
    ("of_hours", "said"),
    [
        (lambda t: 4 * t, {"drift_y"}),
        (lambda t: 12 * np.maximum(t - 1.3, 0), set()),
        (lambda t: 6 * (t - 1.1) ** 3, set()),
        (lambda t: 1.2 * walk(3, len(t))[np.argsort(np.argsort(t))], set()),
    ],
    ids=["even", "after an hour", "at both ends", "a random walk"],
)
def test_a_drift_goes_on_evenly(of_hours: Callable[[Floats], Floats], said: set[str]) -> None:
    """What begins late, or walks, is a function of time and no drift."""
    own = shifted(np.random.default_rng(11), 1, lambda p: of_hours(p.columns["time_s"] / 3600))
    assert named(search(own, 1.5e-3, alpha=0.01, seed=0)) == said


@pytest.mark.long(but="75")
@pytest.mark.parametrize(("width", "said"), [(75.0, {"wear_x_y"}), (30.0, set())])
def test_wear_has_its_width(width: float, said: set[str]) -> None:
    """A twelfth of the travel of 900 mm."""
    own = shifted(np.random.default_rng(12), 1, lambda p: 12 * np.exp(-0.5 * ((p.xyz[:, 0] - 480) / width) ** 2))
    assert named(search(own, 1.5e-3, alpha=0.01, seed=0)) == said


def test_what_else_is_unexplained_takes_no_effect_its_name() -> None:
    """A larger sawtooth of X along Z beside an even drift of Y: each is compared with what is left beside the other."""
    random = np.random.default_rng(13)
    own = shifted(random, 1, lambda p: 4 * p.columns["time_s"] / 3600)
    points = own.artefact.points
    teeth = 0.01 * np.mod(points.xyz[:, 0] / 170, 1)
    own = model(points.at(points.xyz - teeth[:, None] * [0, 0, 1]))
    found = search(own, 1.5e-3, alpha=0.01, seed=0)
    assert "drift_y" in named(found)


@pytest.mark.long(but="none")
@pytest.mark.parametrize(("axis", "form"), [(1, None), (2, "step")], ids=["a joint of the scale of Y", "none"])
def test_a_form_is_named_that_is_no_effect(axis: int, form: str | None) -> None:
    """A step of Y along Y is as well two pieces of a scale that do not meet: the function lists its form alone."""
    own = shifted(np.random.default_rng(14), axis, lambda p: 9.0 * (p.xyz[:, 1] > 300))
    found = search(own, 1.5e-3, alpha=0.01, seed=0)
    functions = empirical_model(withhold(found, found.chosen))
    assert functions is not None
    one = functions.functions[0]
    assert (one.forms[0][0], one.term.along) == ("step", "xyz"[axis])
    assert (one.form and one.form.name) == form


@pytest.mark.long
def test_what_is_withheld_so_is_modelled_as_a_function() -> None:
    found = diagnose(model(recording(growing=True)), stated_um=1.5, alpha=0.01, seed=0)
    assert found.verdict == "empirical"
    assert "play_x_y" in [each.effect for each in found.withheld]
    assert found.improvement.heldout_rms_after_um <= found.improvement.heldout_rms_before_um


@pytest.mark.long(but="1")
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
    while weak := least_supported(found):
        gone |= weak
        found = withhold(found, frozenset(weak))
    assert set(found.effects) == {"squareness_yz", "squareness_zx"}
    for i, one in gone.items():
        assert one.probability <= 20 / 21 < 1
        assert one.probability < probable.of(i)
        assert "20 to 1" in str(one.why)


def test_a_hill_over_two_readings_is_no_wear() -> None:
    """Of one reading, or twice: it is a function of both."""
    place = (450.0, 300.0)

    def hill(points: Points) -> Floats:
        away = (points.xyz[:, :2] - place) / (900.0, 600.0)
        return 14 * np.exp(-0.5 * np.sum(away**2, axis=1) / 0.15**2)

    found = search(shifted(np.random.default_rng(16), 2, hill), 1.5e-3, alpha=0.01, seed=0)
    assert not {name for name in named(found) if name.startswith(("wear", "straightness"))}
    told = empirical_model(withhold(found, found.chosen))
    assert told is not None
    assert (told.functions[0].term.of, told.functions[0].form) == ("x_mm,y_mm", None)


def test_what_turns_as_it_warms_is_a_product() -> None:
    random = np.random.default_rng(17)
    once = bars(random, 100, 400.0, Machine("m", "XYZ", TRAVEL))
    warm = random.uniform(19.0, 22.0, len(once))
    error = 8e-3 * (once.xyz[:, 1] / 300 - 1) * (warm - 20.5) / 1.5
    noise = 1.5e-3 * random.standard_normal(once.xyz.shape)
    own = model(with_columns(once, temp_x_c=warm).at(once.xyz - error[:, None] * [0, 0, 1] + noise))
    found = search(own, 1.5e-3, alpha=0.01, seed=0)
    told = empirical_model(withhold(found, found.chosen))
    assert told is not None
    assert told.functions[0].form is not None
    assert (told.functions[0].term.of, told.functions[0].form.name) == ("temp_x_c,y_mm", "product")


def test_a_form_beside_which_something_is_left_is_not_named() -> None:
    """A step with ripples: a step is most probable by far, and not what lies along X."""

    def both(points: Points) -> Floats:
        x = points.xyz[:, 0]
        return np.where(x > 450, 20.0, 0.0) + 3.5 * np.sin(2 * np.pi * x / 60)

    found = search(shifted(np.random.default_rng(18), 2, both), 1.5e-3, alpha=0.01, seed=0)
    told = empirical_model(withhold(found, found.chosen))
    assert told is not None
    first = told.functions[0]
    assert (first.term.of, first.forms[0][0], first.form) == ("x_mm", "step", None)
    assert first.forms[0][1] > 0.95
