"""A rotary table turns the place of what stands on it, and neither its coordinates nor the machine's errors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats, Points
from cmm_uq.base.rotary import RotaryAxis, RotaryMachine

ORIGIN, PIVOT = np.array([10.0, -20.0, 30.0]), np.array([350.0, 480.0, 55.0])
ON_TABLE = np.array([[100.0, 40.0, 5.0], [-30.0, 220.0, 60.0], [0.0, 0.0, 0.0]])
ANGLES = np.array([0.0, 77.0, -300.0])
RANDOM = np.random.default_rng(3)


def table(letter: str = "c", *, recorded_in_machine: bool = False, **more: object) -> RotaryMachine:
    own = RotaryAxis(letter, PIVOT, **more)  # type: ignore[arg-type]
    return RotaryMachine("m", origin_mm=ORIGIN, rotary=(own,), recorded_in_machine=recorded_in_machine)


def turned(letter: str, degrees: Floats) -> Floats:
    """By an outside package: rotation matrices (n, 3, 3) by the right hand."""
    return np.asarray(Rotation.from_euler("xyz"["abc".index(letter)], degrees[:, None], degrees=True).as_matrix())


@pytest.mark.parametrize("letter", ["a", "b", "c"])
@pytest.mark.parametrize("clockwise", [False, True])
def test_the_carriages_go_where_the_table_has_turned_what_stands_on_it(letter: str, clockwise: bool) -> None:
    machine, columns = table(letter, clockwise=clockwise), {f"{letter}_deg": ANGLES}
    turn = turned(letter, -ANGLES if clockwise else ANGLES)
    there = PIVOT + np.einsum("nij,nj->ni", turn, ON_TABLE + ORIGIN - PIVOT)
    points = Points(ON_TABLE, *(np.arange(3),) * 3, machine, columns)
    np.testing.assert_allclose(points.machine_xyz, there, atol=1e-9)
    np.testing.assert_allclose(
        np.column_stack(list(points.readings.values())), np.column_stack([there, ANGLES]), atol=1e-9
    )
    np.testing.assert_allclose(machine.coordinates(np.column_stack([there, ANGLES])), ON_TABLE, atol=1e-9)
    vectors = np.random.default_rng(1).normal(size=(3, 3, 2))
    np.testing.assert_allclose(points.on_artefact(vectors), np.einsum("nji,njk->nik", turn, vectors), atol=1e-12)
    np.testing.assert_allclose(machine.turned(points.on_artefact(vectors), columns), vectors, atol=1e-12)


def test_coordinates_recorded_in_the_machine_are_turned_back_about_the_stated_axis() -> None:
    machine, columns = table(recorded_in_machine=True), {"c_deg": ANGLES}
    recorded = table().place(ON_TABLE, columns) - ORIGIN
    np.testing.assert_allclose(machine.from_recorded(recorded, columns), ON_TABLE, atol=1e-9)
    np.testing.assert_allclose(machine.as_recorded(ON_TABLE, columns), recorded, atol=1e-9)
    assert table().from_recorded(recorded, columns) is recorded


def test_without_an_angle_nothing_turned() -> None:
    points = Points(ON_TABLE, *(np.arange(3),) * 3, table(recorded_in_machine=True))
    np.testing.assert_allclose(points.machine_xyz, ON_TABLE + ORIGIN, atol=1e-12)
    np.testing.assert_array_equal(points.readings["c"], np.zeros(3))
    np.testing.assert_array_equal(points.machine.coordinates(ON_TABLE + ORIGIN), ON_TABLE)


def test_the_travel_of_the_table_is_its_own() -> None:
    assert table(travel_deg=np.array([-10.0, 370.0])).travel("c") == (-10.0, 370.0)
    with pytest.raises(CmmUqError, match=r"\[machine.table\] travel_deg"):
        table().travel("c")


def rigid(axis: RotaryAxis, point: Floats, degrees: float) -> Floats:
    """(4, 4) by an outside package: the turn about an axis through a point."""
    found, turn = np.eye(4), turned(axis.letter, np.array([-degrees if axis.clockwise else degrees]))[0]
    found[:3, :3], found[:3, 3] = turn, point - turn @ point
    return found


A, C = RotaryAxis("a", PIVOT + np.array([5.0, -3.0, 80.0])), RotaryAxis("c", PIVOT, clockwise=True)
B, ROUND = (
    RotaryAxis("b", np.array([0.0, 4.0, -60.0]), head=True),
    RotaryAxis("c", np.array([1.0, 2.0, -9.0]), head=True),
)
STYLUS = np.array([3.0, -7.0, -210.0])


@pytest.mark.parametrize("rotary", [(A, C), (C, A), (ROUND, B), (A, B), (A, C, B)])
def test_chains_of_several_axes_are_products_of_rigid_motions(rotary: tuple[RotaryAxis, ...]) -> None:
    """Table upon table for the workpiece; axis upon axis, the stylus last, for the tip."""
    read = {axis.letter: RANDOM.uniform(-200, 200, 3) for axis in rotary}
    columns = {f"{letter}_deg": values for letter, values in read.items()}
    machine = RotaryMachine("m", origin_mm=ORIGIN, rotary=rotary, stylus_mm=STYLUS)
    for i, xyz in enumerate(ON_TABLE):
        workpiece, probe = np.append(xyz + ORIGIN, 1.0), np.append(STYLUS, 1.0)
        for axis in reversed(rotary):
            motion = rigid(axis, machine.pivot(axis) + (0.0 if axis.head else ORIGIN), read[axis.letter][i])
            workpiece, probe = (workpiece, motion @ probe) if axis.head else (motion @ workpiece, probe)
        np.testing.assert_allclose(machine.place(ON_TABLE, columns)[i], workpiece[:3], atol=1e-9)
        np.testing.assert_allclose(np.broadcast_to(machine.tip(columns), (3, 3))[i], probe[:3], atol=1e-9)
        carriages = workpiece[:3] - probe[:3] + STYLUS
        readings = machine.readings(ON_TABLE, columns)
        np.testing.assert_allclose(readings[i, :3], carriages, atol=1e-9)
    np.testing.assert_allclose(machine.coordinates(readings), ON_TABLE, atol=1e-9)
    raw = replace(machine, recorded_at_ram=True, recorded_in_machine=True)
    np.testing.assert_allclose(raw.as_recorded(ON_TABLE, columns) + ORIGIN, readings[:, :3], atol=1e-9)
    np.testing.assert_allclose(raw.from_recorded(readings[:, :3] - ORIGIN, columns), ON_TABLE, atol=1e-9)
    np.testing.assert_array_equal(machine.as_recorded(ON_TABLE, columns), ON_TABLE)
