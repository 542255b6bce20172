"""What does not fit is refused with the axis that is too short."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.analysis.planning.set_up import attitude_along
from cmm_uq.analysis.planning.volume import Volume
from cmm_uq.artefacts.ballbar.plan import ballbar
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Machine
from cmm_uq.jobs.tables.plan import PlanFacts
from tests.analysis.planning.plans import BALLBAR, MACHINE, TRAVEL


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
