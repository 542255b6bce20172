"""An artefact turned where it stands: the same body, and what parts its own errors from the machine's."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from scipy.spatial.distance import pdist

from cmm_uq.analysis.planning import suggestion
from cmm_uq.analysis.planning.advice import NextPlan
from cmm_uq.analysis.planning.candidates import ready_plan
from cmm_uq.analysis.planning.setting import Planning
from cmm_uq.analysis.planning.suggestion import next_plan
from cmm_uq.analysis.planning.volume import turned_set_ups
from cmm_uq.artefacts import kind_named
from cmm_uq.artefacts.ballbar.plan import ballbar
from cmm_uq.base.messages import say
from cmm_uq.base.points import Floats, Points
from cmm_uq.base.units import ARCSECOND, unit
from cmm_uq.jobs.tables.plan import FixtureFacts
from cmm_uq.machine.physics import catalogue
from cmm_uq.machine.physics.effect import Effect, Parameter
from tests.analysis.planning.plans import BALLBAR, EVERY_KIND, setting
from tests.analysis.planning.test_suggestion import diagnosed

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
    monkeypatch.setattr(suggestion, "turned_placings", lambda placings, volume: ())
    without = parted(monkeypatch)
    assert without is None or not without.reached
