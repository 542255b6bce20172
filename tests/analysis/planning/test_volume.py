"""What does not fit is refused with the axis that is too short.

An artefact turned where it stands: the same body, and what parts its own errors from the machine's.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from scipy.spatial.distance import pdist

from cmm_uq.analysis.planning import suggestion
from cmm_uq.analysis.planning.candidates import ready_plan
from cmm_uq.analysis.planning.set_up import NextPlan, attitude_along
from cmm_uq.analysis.planning.setting import Planning, Volume, turned_set_ups
from cmm_uq.analysis.planning.suggestion import next_plan
from cmm_uq.artefacts import kind_named
from cmm_uq.artefacts.ballbar import ballbar
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import say
from cmm_uq.base.points import Floats, Machine, Points
from cmm_uq.base.units import ARCSECOND, unit
from cmm_uq.jobs.tables.plan import FixtureFacts, PlanFacts
from cmm_uq.machine.physics import catalogue
from cmm_uq.machine.physics.effect import Effect, Parameter
from tests.analysis.planning.plans import BALLBAR, EVERY_KIND, MACHINE, TRAVEL, setting
from tests.analysis.planning.test_suggestion import diagnosed


def test_the_chord_of_a_box_is_its_diagonal_and_its_edges() -> None:
    volume = Volume.of(MACHINE, PlanFacts(margin_mm=0.0))
    assert volume.chord(volume.size) == pytest.approx(np.linalg.norm([900, 800, 600]))
    assert volume.chord(np.array([0.0, 0.0, 1.0])) == pytest.approx(600.0)
    assert volume.chord(np.array([1.0, 1.0, 0.0])) == pytest.approx(800 * np.sqrt(2))


def test_the_volume_of_the_plan_goes_before_the_travel_and_loses_the_margin() -> None:
    volume = Volume.of(MACHINE, PlanFacts(volume_mm={"x": [100.0, 500.0]}, margin_mm=10.0))
    np.testing.assert_allclose(volume.box, [[110, 490], [10, 790], [-590, -10]])


def test_without_travel_the_recorded_points_say_where_there_is_room() -> None:
    volume = Volume.of(Machine(), PlanFacts(margin_mm=0.0), np.array([[0.0, 5.0, -3.0], [10.0, 6.0, 7.0]]))
    np.testing.assert_allclose(volume.box, [[0, 10], [5, 6], [-3, 7]])


def test_without_travel_and_recording_the_travel_is_asked_for() -> None:
    with pytest.raises(CmmUqError, match="travel of axis x"):
        Volume.of(Machine(), PlanFacts())


def test_a_bar_longer_than_the_volume_is_refused_with_its_axis() -> None:
    volume = Volume.of(MACHINE, PlanFacts(volume_mm={"z": [-300.0, 0.0]}))
    bar = ballbar(BALLBAR, PlanFacts())
    with pytest.raises(CmmUqError, match=r"400 mm long along Z .*, of which the volume has 280 mm"):
        volume.set_up(bar, attitude_along(np.array([0.0, 0.0, 1.0])), (0.5, 0.5, 0.5), "along Z")


def test_places_run_from_edge_to_edge() -> None:
    volume = Volume.of(MACHINE, PlanFacts(margin_mm=0.0))
    bar = ballbar(BALLBAR, PlanFacts(repeats=1))
    low = volume.set_up(bar, attitude_along(np.array([1.0, 0.0, 0.0])), (0.0, 0.0, 0.0), "low").points.machine_xyz
    high = volume.set_up(bar, attitude_along(np.array([1.0, 0.0, 0.0])), (1.0, 1.0, 1.0), "high").points.machine_xyz
    np.testing.assert_allclose(low.min(axis=0), TRAVEL[:, 0], atol=1e-9)
    np.testing.assert_allclose(high.max(axis=0), TRAVEL[:, 1], atol=1e-9)


def test_fixtures_hold_a_bar_either_way_along_their_directions() -> None:
    volume = Volume.of(MACHINE, PlanFacts.model_validate({"fixtures": {"directions": [[1.0, 0.0, 1.0]]}}))
    assert volume.allows(np.array([2.0, 0.0, 2.0]))
    assert volume.allows(np.array([-1.0, 0.0, -1.0]))
    assert not volume.allows(np.array([1.0, 0.0, -1.0]))


def test_heights_bound_the_middle_of_the_artefact() -> None:
    volume = Volume.of(MACHINE, PlanFacts.model_validate({"fixtures": {"heights_mm": [-500.0, -400.0]}}))
    bar = ballbar(BALLBAR, PlanFacts())
    level = attitude_along(np.array([1.0, 0.0, 0.0]))
    assert volume.set_up(bar, level, (0.5, 0.5, 1.0), "high").middle[2] == pytest.approx(-400.0)
    assert volume.set_up(bar, level, (0.5, 0.5, 0.0), "low").middle[2] == pytest.approx(-500.0)
    low = Volume.of(MACHINE, PlanFacts.model_validate({"fixtures": {"heights_mm": [-590.0, -580.0]}}))
    with pytest.raises(CmmUqError, match="heights_mm"):
        low.set_up(bar, attitude_along(np.array([0.0, 0.0, 1.0])), (0.5, 0.5, 0.5), "along Z")


def test_a_margin_that_leaves_nothing_is_refused() -> None:
    with pytest.raises(CmmUqError, match="margin of 300 mm leaves nothing"):
        Volume.of(MACHINE, PlanFacts(volume_mm={"z": [-500.0, 0.0]}, margin_mm=300.0))


def test_a_volume_beyond_the_travel_is_refused() -> None:
    with pytest.raises(CmmUqError, match=r"x = \[0, 1000\] mm goes beyond the travel of 0 to 900 mm"):
        Volume.of(MACHINE, PlanFacts(volume_mm={"x": [0.0, 1000.0]}))


PLATE = EVERY_KIND["plate"][0]


class OwnSquareness(Effect):
    """A plate's own axes are not square: along its x in proportion to its y, however it stands."""

    name = "own_squareness"
    title = say("Squareness of the plate's own axes")
    formula = "e = −S·y of the plate, along its x"
    mechanism = "artefact"
    points_to = say("the plate")
    coefficients = (Parameter("angle_arcsec", unit("″"), 500.0),)

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        own = np.column_stack([points.columns["reference_x_mm"], points.columns["reference_y_mm"]])
        found = np.zeros((len(points), 3, 1))
        for number in np.unique(points.measurement):
            rows = points.measurement == number
            here = own[rows] - own[rows].mean(axis=0)
            axes = np.linalg.lstsq(here, points.xyz[rows] - points.xyz[rows].mean(axis=0))[0]
            found[rows, :, 0] = -ARCSECOND * here[:, 1:] * axes[:1]
        return found


def test_a_bar_changes_ends_and_stays_where_it_is() -> None:
    chosen = setting(BALLBAR)
    placing = ready_plan(chosen)[1][0]
    (turned,) = turned_set_ups([placing], chosen.volume)
    first, second = placing.points.xyz[:2]
    np.testing.assert_allclose(turned.points.xyz[:2], [second, first], atol=1e-9)
    assert turned.title.endswith("ends exchanged")


def test_a_plate_turns_by_quarters_about_its_normal_and_over() -> None:
    chosen = setting(PLATE, pitch_mm=90.0)
    placing = ready_plan(chosen)[1][0]
    found = list(turned_set_ups([placing], chosen.volume))
    assert len(found) == 4
    for turned in found:
        np.testing.assert_allclose(pdist(turned.points.xyz), pdist(placing.points.xyz), atol=1e-8)
        np.testing.assert_allclose(turned.points.xyz.mean(axis=0), placing.points.xyz.mean(axis=0), atol=1e-8)
    sides = [np.cross(*(p.points.xyz[[1, 5]] - p.points.xyz[0]))[2] for p in (placing, *found)]
    assert np.sign(sides).tolist() in ([1, 1, 1, 1, -1], [-1, -1, -1, -1, 1])


def test_a_turn_that_no_fixture_holds_or_no_room_allows_is_left_out() -> None:
    upright = setting(BALLBAR, fixtures=FixtureFacts(directions=[[0.0, 1.0, 0.0]]))
    along_x = upright.volume.set_up(ballbar(BALLBAR, upright.plan), np.eye(3), (0.5, 0.5, 0.5), say("along X"))
    assert not list(turned_set_ups([along_x], upright.volume))


def parted(monkeypatch: pytest.MonkeyPatch) -> NextPlan | None:
    """A plate that just fits, flat, in one set-up: it may be turned, and put nowhere else."""
    known = {**catalogue.every(), OwnSquareness.name: OwnSquareness()}
    monkeypatch.setattr(suggestion, "every", lambda: known)
    room = {"x": [0.0, 480.0], "y": [0.0, 480.0], "z": [-100.0, 0.0]}
    flat = setting(PLATE, pitch_mm=100.0, volume_mm=room)
    found = diagnosed(PLATE, ready_plan(setting(PLATE, pitch_mm=100.0))[1][:1], "squareness_xy", 20.0,
                      ("squareness_xy", OwnSquareness.name), ("scale_x",))  # fmt: skip
    kind = kind_named("plate")
    assert kind is not None
    return next_plan(found, PLATE, kind.observing("diagnosed"), kind.offers("plan", Planning), flat.plan)


def test_turning_parts_the_plates_own_squareness_from_the_machines(monkeypatch: pytest.MonkeyPatch) -> None:
    """Exactly alike in one set-up; a quarter of a turn changes the sign of one, and nothing else that fits does anything."""
    plan = parted(monkeypatch)
    assert plan is not None
    assert plan.reached
    assert len(plan.placings) == 1
    assert any(words in plan.placings[0].title for words in ("turned by 90°", "turned by 270°", "turned over"))
    monkeypatch.setattr(suggestion, "turned_set_ups", lambda placings, volume: ())
    without = parted(monkeypatch)
    assert without is None or not without.reached
