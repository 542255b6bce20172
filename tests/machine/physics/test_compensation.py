"""US 4,866,643 claim 1, step by step."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Machine, Points
from cmm_uq.base.units import ARCSECOND
from cmm_uq.machine.physics.compensation import (
    Compensation,
    PointConditions,
    compensate_points,
    machine_compensation,
    offset_plane,
)
from cmm_uq.machine.physics.error_map import AxisErrors, ErrorMap, read_error_map
from cmm_uq.machine.physics.map_interpolation import ErrorMaps

HARRIS = Path(__file__).parent / "harris2004"
TRAVEL = np.array([[0.0, 900], [0, 550], [-500, 0]])


def maps() -> ErrorMaps:
    return ErrorMaps([read_error_map(HARRIS / "error_map_20C.csv").with_squareness_arcsec(-173, -19, 21)])


def somewhere(n: int, seed: int = 1):
    rng = np.random.default_rng(seed)
    return np.column_stack([rng.uniform(5, 895, n), rng.uniform(5, 545, n), rng.uniform(-495, -5, n)])


def recording(columns: dict[str, np.ndarray] | None = None, n: int = 4) -> Points:
    one = np.ones(n, dtype=np.int64)
    machine = Machine("test", "XYZ", TRAVEL, np.array([800.0, 300, -250]))
    return Points(somewhere(n) - machine.origin_mm, one, np.arange(n), one, machine, columns or {}, np.arange(n) + 2)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**31), st.sampled_from(["XYZ", "YXZ", "XFYZ"]), st.booleans())
def test_there_and_back_again_is_closer_than_a_nanometre(seed, chain, rigid):
    compensation = Compensation(maps(), chain, (0.0, 0.0, 0.0), rigid)
    indicated = somewhere(50, seed)
    when = PointConditions(tip=np.array([20.0, -30, -150]))
    true, _ = compensation.compensate(indicated, when)
    again, _ = compensation.indicated_from_true(true, when)
    assert np.abs(again - indicated).max() < 1e-9
    assert np.abs(true - indicated).max() > 0.01


def test_the_inverse_holds_at_the_edge_of_the_map():
    compensation = Compensation(maps())
    corners = np.array([[900.0, 550, 0], [0, 0, -500], [900, 0, -500]])
    true, _ = compensation.compensate(corners)
    again, extrapolated = compensation.indicated_from_true(true)
    np.testing.assert_allclose(again, corners, atol=1e-9)
    assert not extrapolated.any()


def test_true_coordinates_that_no_reading_within_the_map_can_give_are_refused():
    with pytest.raises(CmmUqError, match="z reads"):
        Compensation(maps()).indicated_from_true(np.array([[100.0, 100, 30]]))


def test_a_map_too_steep_to_turn_round_is_refused():
    steep = AxisErrors(np.array([0.0, 10]), np.vstack([np.zeros(6), [20.0, 0, 0, 0, 0, 0]]))
    flat = AxisErrors(np.array([0.0, 10]), np.zeros((2, 6)))
    with pytest.raises(CmmUqError, match="no indicated coordinates"):
        Compensation(ErrorMaps([ErrorMap((steep, flat, flat))])).indicated_from_true(np.array([[5.0, 5, 5]]))


def test_products_of_rotations_are_all_that_the_default_neglects():
    """3 nm at most on the machine of the thesis: its squareness is exact in both forms."""
    indicated = somewhere(200)
    default, _ = Compensation(maps()).compensate(indicated)
    rigid, _ = Compensation(maps(), rigid=True).compensate(indicated)
    assert 1e-8 < np.abs(rigid - default).max() < 3e-6


def test_a_squareness_of_1500_seconds_is_compensated_exactly():
    """Straight carriages of a bad frame: the true place is the sum of unit vectors, by Cholesky, times the readings."""
    frame = ErrorMap(tuple(AxisErrors(np.array([-900.0, 900]), np.zeros((2, 6))) for _ in "xyz"))
    frame = frame.with_squareness_arcsec(1500, -1500, 900)
    xy, yz, zx = np.cos(np.pi / 2 + ARCSECOND * np.array([1500.0, -1500, 900]))
    unit = np.linalg.cholesky(np.array([[1, xy, zx], [xy, 1, yz], [zx, yz, 1]]))
    indicated = somewhere(200)
    true, _ = Compensation(ErrorMaps([frame])).compensate(indicated)
    np.testing.assert_allclose(true, indicated @ unit, atol=1e-10)


def test_recorded_coordinates_are_readings_less_the_origin():
    points = recording()
    compensated = compensate_points(points, machine_compensation(points, maps()))
    expected, _ = Compensation(maps()).compensate(points.carriages)
    np.testing.assert_allclose(compensated.carriages, expected, atol=1e-12)
    assert "extrapolated" not in compensated.columns
    again, _ = machine_compensation(points, maps()).indicated_from_true(compensated.xyz)
    np.testing.assert_allclose(again, points.xyz, atol=1e-9)


def test_the_recordings_own_tips_and_temperatures_count():
    tips = {f"tip_{a}_mm": np.array([0.0, 50, -50, 100]) for a in "xyz"}
    points = recording(tips)
    compensation = machine_compensation(points, maps())
    expected, _ = compensation.compensate(points.xyz, PointConditions(tip=np.tile(tips["tip_x_mm"], (3, 1)).T))
    np.testing.assert_array_equal(compensate_points(points, compensation).xyz, expected)
    hot = recording({f"temp_{a}_c": np.array([20.0, 20.2, 28, 20]) for a in "xyz"})
    with pytest.raises(CmmUqError, match="line 4: a scale is at"):
        compensate_points(hot, compensation)
    with pytest.raises(CmmUqError, match="has tip_x_mm but not tip_y_mm"):
        compensate_points(recording({"tip_x_mm": np.zeros(4)}), compensation)


def test_extrapolated_points_are_marked_in_the_recording():
    points = recording()
    far = points.at(points.xyz + np.array([[0.0, 0, 0], [0, 0, 0], [0, 400, 0], [0, 0, 0]]))
    with pytest.raises(CmmUqError, match="line 4: y reads"):
        compensate_points(far, machine_compensation(far, maps()))
    marked = compensate_points(far, machine_compensation(far, maps(), beyond="extrapolate"))
    assert marked.columns["extrapolated"].tolist() == [0, 0, 1, 0]


def test_maps_that_do_not_cover_the_travel_are_refused():
    points = recording()
    wide = replace(points, machine=replace(points.machine, travel_mm=TRAVEL + np.array([[-10, 0], [0, 0], [0, 0]])))
    with pytest.raises(CmmUqError, match="axis x is mapped from 0 to 900 mm, the travel is -10 to 900 mm"):
        machine_compensation(wide, maps())


def test_provenance_says_what_was_added():
    said = machine_compensation(recording(), maps()).provenance()
    assert json.loads(json.dumps(said)) == said
    assert said["chain"] == "XYZ"
    assert said["origin_mm"] == [800.0, 300.0, -250.0]
    [one] = said["error_maps"]
    assert one["squareness_arcsec"] == {"xy": -173.0, "yz": -19.0, "zx": 21.0}
    assert len(one["sha256"]) == 64


CONTACTS = np.array([[0.0, 0, 5], [40, 0, 5], [40, 30, 5], [0, 30, 5], [20, 15, 5]])


def test_the_plane_moves_by_the_probe_offset_away_from_the_direction_point():
    above = offset_plane(np.array([0.0, 0, 8]), CONTACTS, 2.0, u_point=1e-3)
    assert above.normal.tolist() == [0, 0, 1]
    assert above.point[2] == pytest.approx(3.0)
    assert not above.reversed


def test_a_normal_into_the_material_is_reversed():
    below = offset_plane(np.array([0.0, 0, 1]), CONTACTS, 2.0, u_point=1e-3)
    assert below.normal.tolist() == [0, 0, -1]
    assert below.point[2] == pytest.approx(7.0)
    assert below.reversed
    assert below.angle == pytest.approx(0)


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("tilt", [0.0, 30.0, 59.0])
def test_directions_within_the_range_of_acceptance_are_believed(tilt, side):
    approach = np.array([np.sin(np.radians(tilt)), 0, side * np.cos(np.radians(tilt))])
    found = offset_plane(CONTACTS[0] + 3 * approach, CONTACTS, 1.0, u_point=1e-3)
    assert np.degrees(found.angle) == pytest.approx(tilt, abs=1e-6)
    assert found.point[2] == pytest.approx(5 - side)


@pytest.mark.parametrize("tilt", [61.0, 80.0, 89.9, 90.1, 119.0])
def test_directions_between_the_range_of_acceptance_and_90_degrees_are_rejected(tilt):
    approach = np.array([np.sin(np.radians(tilt)), 0, np.cos(np.radians(tilt))])
    with pytest.raises(CmmUqError, match=r"direction point is rejected.*Measure the direction point again"):
        offset_plane(CONTACTS[0] + 3 * approach, CONTACTS, 1.0, u_point=1e-3)


def test_the_range_of_acceptance_can_be_narrowed():
    direction = CONTACTS[0] + np.array([np.sin(0.5), 0, np.cos(0.5)])
    offset_plane(direction, CONTACTS, 1.0, acceptance=0.51, u_point=1e-3)
    with pytest.raises(CmmUqError, match="rejected"):
        offset_plane(direction, CONTACTS, 1.0, acceptance=0.49, u_point=1e-3)


@pytest.mark.long
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_covariance_is_that_of_drawn_planes(side):
    rng = np.random.default_rng(6)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    contacts, direction = CONTACTS @ turn, (CONTACTS[0] + [0.3, 0.2, side * 3]) @ turn
    drawn = []
    for _ in range(3000):
        touched = contacts + rng.normal(scale=2e-3, size=(5, 1)) * turn[2]
        found = offset_plane(direction, touched, rng.normal(10.0, 3e-3), u_offset=3e-3, u_point=2e-3)
        drawn.append([*(found.point - found.contact.point.mean()), *found.normal])
        drawn[-1][:3] = found.point
    spread = np.cov(drawn, rowvar=False)
    # variances from 3000 draws have a relative standard uncertainty of 2.6 %
    np.testing.assert_allclose(np.diag(spread), np.diag(found.covariance), rtol=0.13)
    np.testing.assert_allclose(spread, found.covariance, atol=0.1 * np.abs(spread).max())


@pytest.mark.parametrize(
    ("direction", "contacts", "options", "message"),
    [
        ([0, 0, 8.0], CONTACTS[:2], {}, "2 points are too few. Measure at least 3"),
        ([0, 0, 8.0], np.outer(np.arange(4.0), [1, 1, 0]), {}, "lie on one line"),
        ([0, 0, 5.0], CONTACTS, {}, "the direction point is the first point of contact"),
        ([0, 0, 8.0], CONTACTS, {"offset": 0.0}, "a probe offset of 0.0 mm"),
        ([0, 0, 8.0], CONTACTS, {"acceptance": np.pi / 2}, "a range of acceptance of 90°"),
    ],
)
def test_what_cannot_be_compensated_is_refused(direction, contacts, options, message):
    with pytest.raises(CmmUqError, match=message):
        offset_plane(np.array(direction), contacts, **{"offset": 1.0, "u_point": 1e-3} | options)
