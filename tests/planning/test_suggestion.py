"""A suggested placing parts what the recording could not, by as much as it says."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cmm_uq.jobs.artefact import ArtefactFacts
from cmm_uq.kinds import artefact_of, kind_named
from cmm_uq.kinds.ballbar.plan import ballbar
from cmm_uq.model import MeasurementModel, Noise
from cmm_uq.physics.catalogue import effects
from cmm_uq.planning.placing import Placing, along, joined
from cmm_uq.planning.ready import ready_plan
from cmm_uq.planning.suggestion import ODDS, suggestions
from cmm_uq.points import Points
from tests.planning.plans import BALLBAR, EVERY_KIND, GAUGE, SIX, setting
from tests.recordings import suggested

SIGMA = 1e-3


def diagnosed(
    facts: ArtefactFacts, placings: tuple[Placing, ...], true: str, size: float, group: tuple[str, ...],
    named: tuple[str, ...] = SIX,
) -> Any:  # fmt: skip
    """What suggestions read of a diagnosis: a recording with one effect, and the group that it could be."""
    points = joined(placings)
    acting = MeasurementModel(artefact_of(facts, points), effects((true,)))
    sizes = np.array([s.nominal for s in acting.artefact.sizes])
    xyz = acting.simulate(np.array([size]), sizes, Noise(SIGMA), np.random.default_rng(3))
    after = MeasurementModel(artefact_of(facts, points.at(xyz)), effects((*named, true)), SIGMA)
    return SimpleNamespace(after=after, indistinguishable=(group,))


def log_odds(
    found: Any, facts: ArtefactFacts, what: str, repetitions: int, pair: tuple[str, str], true: str,
    shapes: dict[str, tuple[float, ...]] | None = None,
) -> float:  # fmt: skip
    """Half the χ² by which the false one of a pair fits worse, recording and further bars together, without noise."""
    ends = [
        np.array([float(v.replace("−", "-")) for v in part.split(")")[0].split(", ")]) for part in what.split("(")[1:3]
    ]
    points = found.after.artefact.points
    bar = np.array(ends) - points.machine.origin_mm
    number = int(points.measurement.max()) + 1
    n = 2 * repetitions
    more = Points(
        np.vstack([points.xyz, np.tile(bar, (repetitions, 1))]), np.append(points.measurement, np.full(n, number)),
        np.append(points.point, np.tile([1, 2], repetitions)),
        np.append(points.repeat, np.repeat(np.arange(1, repetitions + 1), 2)), points.machine,
    )  # fmt: skip
    formed = {name: shape for name, shape in (shapes or {}).items() if name == true}
    acting = MeasurementModel(artefact_of(facts, more), effects((true,)), shapes=formed)
    others = tuple(e for e in found.after.effects if e.name not in pair)
    fitted = (
        MeasurementModel(found.after.artefact, (*others, *effects((true,))), SIGMA, shapes=formed)
        .estimate()
        .least_squares
    )
    size = [v for u, v in zip(fitted.unknowns, fitted.value, strict=True) if u.key[0] == true]
    exact = more.at(acting.predicted(np.array([*size, facts.length_mm or 0.0])))
    other = pair[1] if pair[0] == true else pair[0]
    formed = {name: shape for name, shape in (shapes or {}).items() if name == other}
    model = MeasurementModel(artefact_of(facts, exact), (*others, *effects((other,))), SIGMA, shapes=formed)
    linear, rest = model.estimate().linear, model.estimate().least_squares.residuals
    return float(0.5 * np.sum((rest / linear.noise_scale / SIGMA) ** 2))


def in_one_plane(size: float) -> Any:
    """Bars of known length in one plane of constant y, where the yaw of X looks like its scale."""
    chosen = setting(KNOWN, repeats=1)
    bar = ballbar(KNOWN, chosen.plan)
    placings = tuple(
        chosen.volume.set_up(bar, along(np.array([np.cos(t), 0.0, np.sin(t)])), (x, 0.3, z), "in the plane")
        for t in (0.0, 0.5, 1.0, 1.5, 2.0, 2.6) for x in (0.2, 0.8) for z in (0.3, 0.6)
    )  # fmt: skip
    return diagnosed(KNOWN, placings, PAIR[0], size, PAIR, ("scale_z", "squareness_zx"))


KNOWN = BALLBAR.model_copy(update={"u_um": 1e-3})
PAIR = ("rotation_x_z", "scale_x")


@pytest.mark.parametrize(
    ("size", "repetitions", "said"),
    [
        (4.0, 1, "measure it once: odds of 49 : 1 for the true one are to be expected, 1 : 1 without it."),
        (2.0, 6, "measure it 6 times: odds of 25 : 1 for the true one are to be expected, 1 : 1 without it."),
    ],
)
def test_the_odds_of_a_further_bar_are_those_of_a_fit_to_it(size: float, repetitions: int, said: str) -> None:
    """Independently of the suggestion, the true effect is put in without noise, and the false one fitted to the recording and
    the further bars together; either may be true. With one bar less the odds would not be reached.
    """
    found = in_one_plane(size)
    (suggestion,) = suggested(found, KNOWN)
    assert suggestion.separates == PAIR
    assert suggestion.repetitions == repetitions
    assert suggestion.what.endswith(said)
    expected = min(log_odds(found, KNOWN, suggestion.what, repetitions, PAIR, true) for true in PAIR)
    assert np.log(suggestion.odds) == pytest.approx(expected, rel=1e-3)
    assert suggestion.odds >= ODDS
    if repetitions > 1:
        fewer = min(log_odds(found, KNOWN, suggestion.what, repetitions - 1, PAIR, true) for true in PAIR)
        assert np.exp(fewer) < ODDS


def test_odds_beyond_all_doubt_are_not_counted() -> None:
    (suggestion,) = suggested(in_one_plane(60.0), KNOWN)
    assert suggestion.odds == pytest.approx(np.exp(50.0))
    assert "odds of more than 1000 : 1 for the true one" in suggestion.what


@pytest.mark.parametrize("period", [None, 400.0])
def test_a_period_is_the_one_found_or_the_longest(period: float | None) -> None:
    """The longest that is tried is 982.9 mm on these bars."""
    found, pair = in_one_plane(2.0), ("rotation_x_z", "periodic_scale_x")
    found.indistinguishable = (pair,)
    if period is not None:
        found.after = replace(found.after, shapes={"periodic_scale_x": (period,)})
    (suggestion,) = suggested(found, KNOWN)
    shapes = {"periodic_scale_x": (period or 982.8630625641526,)}
    expected = min(log_odds(found, KNOWN, suggestion.what, suggestion.repetitions, pair, true, shapes) for true in pair)
    assert np.log(suggestion.odds) == pytest.approx(expected, rel=2e-3)


def test_of_a_large_group_the_pairs_of_its_first_three_are_parted() -> None:
    found = in_one_plane(60.0)
    found.indistinguishable = ((*PAIR, "periodic_scale_x", "squareness_xy"),)
    pairs = {suggestion.separates for suggestion in suggested(found, KNOWN)}
    assert {PAIR, ("rotation_x_z", "periodic_scale_x")} <= pairs
    assert not any("squareness_xy" in pair for pair in pairs)


def test_the_order_of_a_pair_changes_nothing() -> None:
    found = in_one_plane(2.0)
    (one,) = suggested(found, KNOWN)
    found.indistinguishable = (PAIR[::-1],)
    (two,) = suggested(found, KNOWN)
    assert (two.what, two.odds) == (one.what, pytest.approx(one.odds))


def test_a_placing_may_reach_to_the_ends_of_travel() -> None:
    """Travel 900 by 800 mm."""
    (suggestion,) = suggested(in_one_plane(4.0), KNOWN)
    assert "→ (900, 800, −300) mm" in suggestion.what


def test_a_kind_that_offers_no_other_places_gets_no_suggestion() -> None:
    kind = kind_named("ballbar")
    assert kind is not None
    assert suggestions(in_one_plane(4.0), KNOWN, kind.observing("diagnosed"), None) == ()


def test_a_gauge_on_seven_lines_is_told_where_to_lay_an_eighth() -> None:
    placings = ready_plan(setting(GAUGE, length_mm=820.0))[1]
    pair = ("rotation_x_y", "rotation_y_x")
    found = diagnosed(GAUGE, placings, "rotation_x_y", 8.0, pair)
    (suggestion,) = suggested(found, GAUGE)
    assert suggestion.what.startswith("Place the step gauge at (")
    assert "1 : 1 without it" in suggestion.what
    assert suggestion.odds >= ODDS


@pytest.mark.parametrize(("kind", "true", "rival"), [
    ("plate", "rotation_y_z", "rotation_z_z"),
    ("bryan", "straightness_x_z", "rotation_x_y"),
    ("triangle", "straightness_x_z", "straightness_y_z"),
])  # fmt: skip
def test_every_artefact_is_asked_for_a_placing_or_has_none(kind: str, true: str, rival: str) -> None:
    facts, wishes = EVERY_KIND[kind]
    facts = facts.model_copy(update={"length_mm": 300.0, "u_um": 0.5}) if kind == "bryan" else facts
    placings = ready_plan(setting(facts, **wishes))[1]
    found = diagnosed(facts, placings, true, 20.0, (true, rival))
    for suggestion in suggested(found, facts):
        assert suggestion.odds >= ODDS
        assert 1 <= suggestion.repetitions <= 30


def test_what_is_told_apart_needs_no_further_placing() -> None:
    placings = ready_plan(setting(BALLBAR))[1]
    found = diagnosed(BALLBAR, placings, "rotation_y_x", 12.0, ())
    found.indistinguishable = ()
    assert suggested(found, BALLBAR) == ()
