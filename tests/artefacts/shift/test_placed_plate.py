"""What a recording of a plate in several placings must be, and which placing mends it where it is not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, strategies as st

from cmm_uq.artefacts.shift.placed_plate import placed_plate, rigid_motion, rotations
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Points
from tests.artefacts.shift.placed import GRID, SHIFTED, TURNED, none, read


def recorded(*placings: tuple[float, float, float]) -> Points:
    return read(none, "xy", "XYZ", placings or SHIFTED)


def refused(points: Points) -> CmmUqError:
    with pytest.raises(CmmUqError) as caught:
        placed_plate(points, "xy", "recording.csv")
    assert caught.value.fix
    return caught.value


@given(angle=st.floats(-3.1, 3.1), first=st.floats(-500, 500), second=st.floats(-500, 500))
def test_a_rigid_motion_is_found_exactly(angle: float, first: float, second: float) -> None:
    onto = GRID @ rotations(np.array([angle]))[0].T + [first, second]
    found, moved = rigid_motion(GRID, onto)
    assert found == pytest.approx(angle, abs=1e-12)
    np.testing.assert_allclose(moved, [first, second], atol=1e-9)


def test_placings_are_found_without_being_told() -> None:
    plate = placed_plate(recorded(*TURNED), "xy")
    np.testing.assert_allclose(plate.turned_deg, [0, 0, 0, 0, 90, 180], atol=1e-9)
    np.testing.assert_allclose(plate.balls, GRID + 150.0, atol=1e-9)
    np.testing.assert_allclose(plate.middles[4], [510 - 150, 170 + 150])


def test_placings_join_through_balls_that_they_share() -> None:
    """The first placing has the left half, the last the right half, one between has all."""
    points = recorded((150.0, 150.0, 0.0), (190.0, 150.0, 0.0), (170.0, 190.0, 0.0))
    left = GRID[points.point - 1, 0] < 150
    some = points.select((points.measurement == 2) | ((points.measurement == 1) == left))
    np.testing.assert_allclose(placed_plate(some, "xy").balls, GRID + 150.0, atol=1e-9)


def test_one_placing_shows_nothing() -> None:
    error = refused(recorded(SHIFTED[0]))
    assert "one placing only" in error.problem
    assert "turn it by 90°" in str(error.fix)


def test_the_same_place_twice_is_a_repeat() -> None:
    error = refused(recorded(SHIFTED[0], SHIFTED[1], SHIFTED[1]))
    assert "placings 2 and 3 stand in the same place" in error.problem


def test_the_same_place_turned_is_another_placing() -> None:
    assert len(placed_plate(recorded(SHIFTED[0], (450.0, 150.0, 90.0)), "xy").placings) == 2


def test_a_shift_beyond_the_plates_size_reads_nothing_twice() -> None:
    error = refused(recorded(SHIFTED[0], (600.0, 150.0, 0.0)))
    assert "placing 1 covers no area that another placing covers" in error.problem


def test_a_ball_of_one_placing_only_is_named() -> None:
    points = recorded(*SHIFTED[:2])
    error = refused(points.select(np.arange(32) != 31))
    assert error.problem == "ball 16 is read in placing 1 only"
    assert error.fix == "Read ball 16 in another placing as well, or leave it out of placing 1"


def test_two_balls_are_too_few() -> None:
    points = recorded(*SHIFTED)
    assert "placing 3 has fewer than three balls" in refused(points.select(np.arange(48) < 34)).problem


def test_balls_on_a_line_calibrate_an_axis_instead() -> None:
    points = read(none, "xy", "XYZ", SHIFTED, balls=GRID[:4])
    assert "axis" in str(refused(points).fix)


def test_a_plate_that_stands_up_is_not_in_the_plane() -> None:
    points = read(none, "yz", "XYZ", SHIFTED)
    turned = replace(points, xyz=points.xyz + np.column_stack([0.2 * points.xyz[:, 1], 0 * points.xyz[:, :2]]))
    with pytest.raises(CmmUqError, match="does not lie in the plane yz"):
        placed_plate(turned, "yz")


def test_a_ball_numbered_wrongly_is_named_with_its_line() -> None:
    points = recorded()
    point = points.point.copy()
    point[[20, 21]] = point[[21, 20]]
    error = refused(replace(points, point=point))
    assert "of placing 2 lies" in error.problem
    assert error.where in ("recording.csv line 22", "recording.csv line 23")


def test_placings_without_shared_balls_cannot_be_joined() -> None:
    points = recorded((150.0, 150.0, 0.0), (190.0, 150.0, 0.0), (150.0, 190.0, 0.0), (190.0, 190.0, 0.0))
    half = (GRID[points.point - 1, 0] < 150) == (points.measurement < 3)
    assert "shares fewer than two balls" in refused(points.select(half)).problem
