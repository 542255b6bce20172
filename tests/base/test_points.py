"""A point is what the axes of a machine read; where it lies follows by the machine's kinematics."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Machine, Points
from cmm_uq.base.rotary import RotaryMachine
from cmm_uq.machine.physics.effects.rigid_body import ROTATION, SCALE

ORIGIN = np.array([10.0, -20.0, 30.0])
XYZ = np.array([[1.0, 2.0, 3.0], [400.0, 250.0, -7.0]])
ONE = np.ones(2, dtype=np.int64)


READ = np.array([[110.0, -20.0, 35.0, 0.0], [110.0, -20.0, 35.0, 90.0]])
"""The carriages stand still, 100 mm along x from the table's axis, and the table turns by a quarter."""


def turned() -> Points:
    machine = RotaryMachine("turntable", origin_mm=ORIGIN)
    return Points(machine.coordinates(READ), ONE, np.array([1, 2]), ONE, machine, {"c_deg": READ[:, 3]})


def test_a_cartesian_machine_reads_coordinates_and_its_origin() -> None:
    points = Points(XYZ, ONE, np.array([1, 2]), ONE, Machine("m", origin_mm=ORIGIN))
    assert tuple(points.readings) == points.machine.axes == ("x", "y", "z")
    np.testing.assert_array_equal(points.readings["y"], [-18.0, 230.0])
    np.testing.assert_array_equal(points.carriages, [[11.0, -18.0, 33.0], [410.0, 230.0, 23.0]])
    np.testing.assert_array_equal(points.machine_xyz, points.carriages)
    np.testing.assert_array_equal(points.machine.coordinates(points.carriages), XYZ)


def test_a_machine_without_an_axis_of_this_name_has_no_travel_of_it() -> None:
    with pytest.raises(CmmUqError, match="the travel of axis y is needed"):
        Machine("m").travel("y")


def test_a_turning_table_moves_the_place_and_no_carriage() -> None:
    points = turned()
    np.testing.assert_allclose(points.xyz, [[100.0, 0.0, 5.0], [0.0, -100.0, 5.0]], atol=1e-12)
    np.testing.assert_allclose(np.column_stack(list(points.readings.values())), READ, atol=1e-12)
    np.testing.assert_allclose(points.select(np.array([1])).readings["c"], [90.0])
    moved = points.at(points.xyz + np.array([0.0, 0.0, 1.0]))
    np.testing.assert_allclose(moved.readings["z"], [36.0, 36.0])
    np.testing.assert_allclose(moved.readings["c"], points.readings["c"])


def test_an_error_of_a_scale_goes_by_what_the_axis_reads_and_not_by_the_place() -> None:
    scale = SCALE["x"].basis(turned())[:, 0, 0]
    np.testing.assert_allclose(scale, [110e-6, 110e-6])


def test_the_pitch_of_a_carriage_goes_by_what_it_reads_and_what_it_carries() -> None:
    """5 ″/m at 110 mm: 2.67 µrad, over the 35 mm that Z reads."""
    points = turned()
    travel = np.array([[0.0, 500.0]] * 3)
    points = replace(points, machine=RotaryMachine("turntable", travel_mm=travel, origin_mm=ORIGIN))
    pitch = ROTATION["x", "y"].basis(points)[:, 0, 0] * 5
    np.testing.assert_allclose(pitch, [5 * np.pi / 180 / 3600 * 0.110 * 35.0] * 2, rtol=1e-12)


def test_references_that_were_made_of_the_readings_are_counted() -> None:
    """Of a gauge read three times along two lines; those of its certificate are not, nor where digits hide the noise."""
    lines, faces, random = np.eye(3)[:2], np.arange(6) * 100.0, np.random.default_rng(1)
    number, repeat, face = (each.ravel() for each in np.meshgrid([0, 1], [1, 2, 3], np.arange(6), indexing="ij"))
    true = faces[face][:, None] * lines[number]
    read = np.round(true + random.normal(0, 1e-3, true.shape), 5)
    lengths = np.linalg.norm(read - read[face == 0][number * 3 + repeat - 1], axis=1)

    def counted(xyz: np.ndarray, reference: np.ndarray) -> int:
        of = {"reference_mm": reference}
        return Points(xyz, number + 1, face + 1, repeat, Machine("m"), of).read_as_certified

    assert counted(read, np.round(lengths, 5)) == 30
    assert counted(read, faces[face]) == 0
    assert counted(np.round(true, 2), np.round(faces[face], 2)) == 0
    some = np.where(random.random(len(face)) < 0.5, lengths, faces[face])
    assert counted(read, np.round(some, 5)) == 0
