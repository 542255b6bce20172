"""What to measure next parts what the recording could not, by as much as it says, with as few set-ups as that takes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cmm_uq.analysis.planning.candidates import ready_plan
from cmm_uq.analysis.planning.set_up import ODDS, DetectionGoal, NextPlan, SetUp, attitude_along, join, suggestions
from cmm_uq.analysis.planning.setting import Planning
from cmm_uq.analysis.planning.suggestion import next_plan
from cmm_uq.artefacts import artefact_of, kind_named
from cmm_uq.artefacts.ballbar import ballbar
from cmm_uq.base.points import Points
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.machine.model import Noise, RecordingModel
from cmm_uq.machine.physics.catalogue import effects
from tests.analysis.planning.plans import BALLBAR, EVERY_KIND, GAUGE, SIX, setting

SIGMA = 1e-3


def diagnosed(
    facts: ArtefactFacts, placings: tuple[SetUp, ...], true: str, size: float, group: tuple[str, ...],
    named: tuple[str, ...] = SIX, odds: Mapping[str, float] | None = None,
) -> Any:  # fmt: skip
    """What a plan reads of a diagnosis: a recording with one effect, the group that it could be, odds of the others to it."""
    points = join(placings)
    acting = RecordingModel(artefact_of(facts, points), effects((true,)))
    sizes = np.array([s.nominal for s in acting.artefact.sizes])
    xyz = acting.simulate(np.array([size]), sizes, Noise(SIGMA), np.random.default_rng(3))
    after = RecordingModel(artefact_of(facts, points.at(xyz)), effects((*named, true)), SIGMA)
    names = list(dict.fromkeys(group))
    explanations = [SimpleNamespace(name=name) for name in names]
    instead = {names.index(name): value for name, value in (odds or {}).items()}
    found = SimpleNamespace(
        chosen=frozenset({0}), first=SimpleNamespace(explanations=explanations),
        combinations=SimpleNamespace(instead=lambda chosen, index: instead),
    )  # fmt: skip
    noise = SimpleNamespace(placing=SimpleNamespace(value=0.0), coordinate=SimpleNamespace(value=1.0))
    return SimpleNamespace(after=after, indistinguishable=(group,) if group else (), search=found, noise=noise)


def planned(found: Any, facts: ArtefactFacts, wanted: tuple[DetectionGoal, ...] = ()) -> NextPlan | None:
    """By what the artefact's kind offers."""
    kind = kind_named(facts.kind)
    assert kind is not None
    return next_plan(found, facts, kind.observing("diagnosed"), kind.offers("plan", Planning), None, wanted)


def together(recorded: Points, more: Points | None) -> Points:
    """A recording and what is measured later."""
    if more is None:
        return recorded
    return Points(
        np.vstack([recorded.xyz, more.xyz]), np.append(recorded.measurement, more.measurement),
        np.append(recorded.point, more.point), np.append(recorded.repeat, more.repeat), recorded.machine,
    )  # fmt: skip


def log_odds(found: Any, facts: ArtefactFacts, more: Points | None, pair: tuple[str, str], true: str,
    shapes: dict[str, tuple[float, ...]] | None = None,
) -> float:  # fmt: skip
    """Half the χ² by which the false one of a pair fits worse, recording and further set-ups together, without noise."""
    points = together(found.after.artefact.points, more)
    formed = {name: shape for name, shape in (shapes or {}).items() if name == true}
    acting = RecordingModel(artefact_of(facts, points), effects((true,)), shapes=formed)
    others = tuple(e for e in found.after.effects if e.name not in pair)
    fitted = (
        RecordingModel(found.after.artefact, (*others, *effects((true,))), SIGMA, shapes=formed)
        .estimate()
        .least_squares
    )
    size = [v for u, v in zip(fitted.unknowns, fitted.value, strict=True) if u.key[0] == true]
    exact = points.at(acting.predicted(np.array([*size, facts.length_mm or 0.0])))
    other = pair[1] if pair[0] == true else pair[0]
    formed = {name: shape for name, shape in (shapes or {}).items() if name == other}
    model = RecordingModel(artefact_of(facts, exact), (*others, *effects((other,))), SIGMA, shapes=formed)
    linear, rest = model.estimate().linear, model.estimate().least_squares.residuals
    return float(0.5 * np.sum((rest / linear.noise_scale / SIGMA) ** 2))


def gained(found: Any, plan: NextPlan, true: str, repeats: int | None = None, shapes: Any = None) -> float:
    """Log odds for the true one of the pair that a plan adds to a recording."""
    more = replace(plan, repeats=repeats or plan.repeats).points
    pair = plan.partings[0].effects
    return log_odds(found, KNOWN, more, pair, true, shapes) - log_odds(found, KNOWN, None, pair, true, shapes)


def in_one_plane(size: float, odds: Mapping[str, float] | None = None) -> Any:
    """Bars of known length in one plane of constant y, measured twice, where the yaw of X looks like its scale."""
    chosen = setting(KNOWN, repeats=2)
    bar = ballbar(KNOWN, chosen.plan)
    placings = tuple(
        chosen.volume.set_up(bar, attitude_along(np.array([np.cos(t), 0.0, np.sin(t)])), (x, 0.3, z), "in the plane")
        for t in (0.0, 0.5, 1.0, 1.5, 2.0, 2.6) for x in (0.2, 0.8) for z in (0.3, 0.6)
    )  # fmt: skip
    return diagnosed(KNOWN, placings, PAIR[0], size, PAIR, ("scale_z", "squareness_zx"), odds)


KNOWN = BALLBAR.model_copy(update={"u_um": 1e-3})
PAIR = ("rotation_x_z", "scale_x")


@pytest.mark.parametrize(("size", "odds"), [(4.0, 1.0), (2.0, 1.0), (2.0, 1 / 15), (2.0, 8.0)])
def test_the_odds_of_a_plan_are_those_of_a_fit_to_it(size: float, odds: float) -> None:
    """Independently of the plan, the true effect is put in without noise, and the false one fitted to the recording and the
    further bars together. What the recording itself says counts by the odds that the diagnosis found, either may be true, and
    with one repeat less the odds would not be reached.
    """
    found = in_one_plane(size, {"scale_x": odds})
    plan = planned(found, KNOWN)
    assert plan is not None
    (parting,) = plan.partings
    assert parting.effects == PAIR
    assert parting.before == pytest.approx(1 / odds)

    def expected(repeats: int) -> float:
        first, second = (gained(found, plan, true, repeats) for true in PAIR)
        return min(first - np.log(odds), second + np.log(odds))

    assert np.log(parting.after) == pytest.approx(expected(plan.repeats), rel=2e-3)
    assert parting.after >= ODDS
    assert plan.reached
    assert len(plan.placings) == (1 if odds >= 1 else 2)
    if plan.repeats > 1:
        assert np.exp(expected(plan.repeats - 1)) < ODDS


@pytest.mark.parametrize(("odds", "parted"), [(1 / 30, False), (1 / 19, True), (19.0, True), (1000.0, False)])
def test_a_pair_that_the_recording_parts_already_is_not_planned_for(odds: float, parted: bool) -> None:
    assert (planned(in_one_plane(2.0, {"scale_x": odds}), KNOWN) is not None) == parted


def test_what_the_recording_says_already_is_no_less_than_the_odds_it_could_not_tell() -> None:
    """Effects so large that a recording would tell them apart on average, though this one did not: the odds are its own."""
    found = in_one_plane(60.0, {"scale_x": 0.5})
    plan = planned(found, KNOWN)
    (suggestion,) = suggestions(plan, found.after.artefact.title)
    assert suggestion.odds == pytest.approx(np.exp(50.0))
    assert "odds of more than 1000 : 1 for the true one" in suggestion.what
    assert suggestion.what.endswith(
        "by this recording they are 2 : 1 for rotation of carriage X about Z over scale error of X."
    )


@pytest.mark.parametrize("period", [None, 400.0])
def test_a_period_is_the_one_found_or_the_longest(period: float | None) -> None:
    """The longest that is tried is 982.9 mm on these bars."""
    found, pair = in_one_plane(2.0), ("rotation_x_z", "periodic_scale_x")
    found.indistinguishable = (pair,)
    if period is not None:
        found.after = replace(found.after, shapes={"periodic_scale_x": (period,)})
    plan = planned(found, KNOWN)
    assert plan is not None
    shapes = {"periodic_scale_x": (period or 982.8630625641526,)}
    expected = min(gained(found, plan, true, shapes=shapes) for true in pair)
    assert np.log(plan.partings[0].after) == pytest.approx(expected, rel=3e-3)


def test_one_plan_parts_all_pairs_of_all_groups() -> None:
    """Of a gauge on seven lines: three pairs in one group, and one in another, by fewer set-ups than pairs."""
    placings = ready_plan(setting(GAUGE, length_mm=820.0))[1]
    found = diagnosed(GAUGE, placings, "rotation_x_y", 8.0, ("rotation_x_y", "rotation_y_x", "straightness_x_z"))
    found.indistinguishable = (*found.indistinguishable, ("straightness_z_x", "straightness_y_x"))
    plan = planned(found, GAUGE)
    assert plan is not None
    assert len(plan.partings) == 4
    assert len(plan.placings) <= 2
    assert plan.reached
    assert min(parting.after for parting in plan.partings) >= ODDS


def test_the_order_of_a_pair_changes_nothing() -> None:
    found = in_one_plane(2.0)
    one = planned(found, KNOWN)
    found.indistinguishable = (PAIR[::-1],)
    two = planned(found, KNOWN)
    assert one is not None
    assert two is not None
    np.testing.assert_array_equal(one.points.xyz, two.points.xyz)
    assert two.partings[0].after == pytest.approx(one.partings[0].after)


def test_what_is_to_be_shown_is_as_uncertain_as_a_fit_to_all_of_it_says() -> None:
    """Detected from a visible length on, so many times the standard uncertainty that least squares has of the effect."""
    found = in_one_plane(2.0)
    found.indistinguishable = ()
    found.after = RecordingModel(found.after.artefact, effects(("scale_z", "squareness_zx", "scale_x")), SIGMA)
    plan = planned(found, KNOWN, (DetectionGoal("rotation_x_z", 0.02, 5.0),))
    assert plan is not None
    (shown,) = plan.shown
    assert plan.reached
    assert shown.after <= 0.02 < shown.before
    points = together(found.after.artefact.points, plan.points)
    model = RecordingModel(artefact_of(KNOWN, points), (*found.after.effects, *effects(("rotation_x_z",))), SIGMA)
    linear = model.linearised(np.array([unknown.prior_mean for unknown in model.unknowns]))
    white, held = linear.reduced.design / SIGMA, [u.known for u in linear.unknowns]
    information = white.T @ white + np.diag(np.where(held, 1e12, 0.0))
    at = [u.key[0] for u in linear.unknowns].index("rotation_x_z")
    u = float(np.sqrt(np.linalg.inv(information)[at, at]))
    assert shown.after * linear.unknowns[at].scale == pytest.approx(5.0 * u, rel=1e-3)


def test_repeats_that_share_an_offset_tell_less() -> None:
    """With an offset as large as the noise of a reading, no number of repeats is worth more than one without it."""
    found = in_one_plane(2.0)
    plan = planned(found, KNOWN)
    found.noise.placing.value = 1.0
    offset = planned(found, KNOWN)
    assert plan is not None
    assert offset is not None
    assert (len(offset.placings), offset.repeats) > (len(plan.placings), plan.repeats)
    found.noise.placing.value = 0.0
    once = found.after.artefact.points
    found.after = RecordingModel(artefact_of(KNOWN, once.select(once.repeat == 1)), found.after.effects, SIGMA)
    unknown = planned(found, KNOWN)
    assert unknown is not None
    assert (len(unknown.placings), unknown.repeats) > (len(plan.placings), plan.repeats)


def test_it_is_numbered_on_and_keeps_to_the_travel() -> None:
    """Travel 900 by 800 mm by 500 mm."""
    found = in_one_plane(4.0)
    plan = planned(found, KNOWN)
    assert plan is not None
    points = plan.points
    assert plan.first == points.measurement.min() == found.after.artefact.points.measurement.max() + 1
    assert points.repeat.max() == plan.repeats
    low, high = points.machine.travel_mm.T
    assert np.all(points.machine_xyz >= low - 1e-6)
    assert np.all(points.machine_xyz <= high + 1e-6)


def test_a_kind_that_offers_no_other_places_gets_no_plan() -> None:
    kind = kind_named("ballbar")
    assert kind is not None
    assert next_plan(in_one_plane(4.0), KNOWN, kind.observing("diagnosed"), None) is None
    assert suggestions(None, in_one_plane(4.0).after.artefact.title) == ()


@pytest.mark.parametrize(("kind", "true", "rival"), [
    ("plate", "rotation_y_z", "rotation_z_z"),
    ("bryan", "straightness_x_z", "rotation_x_y"),
    ("triangle", "straightness_x_z", "straightness_y_z"),
])  # fmt: skip
def test_every_artefact_has_a_plan_that_says_what_it_reaches(kind: str, true: str, rival: str) -> None:
    facts, wishes = EVERY_KIND[kind]
    facts = facts.model_copy(update={"length_mm": 300.0, "u_um": 0.5}) if kind == "bryan" else facts
    placings = ready_plan(setting(facts, **wishes))[1]
    plan = planned(diagnosed(facts, placings, true, 20.0, (true, rival)), facts)
    if plan is not None and plan.reached:
        assert min(parting.after for parting in plan.partings) >= ODDS
        assert 1 <= plan.repeats <= 30


def test_what_is_told_apart_needs_no_further_set_up() -> None:
    placings = ready_plan(setting(BALLBAR))[1]
    assert planned(diagnosed(BALLBAR, placings, "rotation_y_x", 12.0, ()), BALLBAR) is None
