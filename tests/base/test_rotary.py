"""A rotary table turns the place of what stands on it, and neither its coordinates nor the machine's errors."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats, Points
from cmm_uq.base.rotary import Turntable

ORIGIN, PIVOT = np.array([10.0, -20.0, 30.0]), np.array([350.0, 480.0, 55.0])
ON_TABLE = np.array([[100.0, 40.0, 5.0], [-30.0, 220.0, 60.0], [0.0, 0.0, 0.0]])
ANGLES = np.array([0.0, 77.0, -300.0])


def table(letter: str = "c", **more: object) -> Turntable:
    return Turntable("m", origin_mm=ORIGIN, letter=letter, axis_mm=PIVOT, **more)  # type: ignore[arg-type]


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
