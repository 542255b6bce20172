"""Points on spheres, counted, and directions whose distance from the nearest point is known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from cmm_uq.analysis.conformity.plan_conditions import sphere_points
from cmm_uq.analysis.conformity.plans import SpherePlan
from cmm_uq.base.points import Points


def recorded(*spheres: Sequence[Sequence[float]], first: int = 3, repeat: int = 2) -> tuple[Points, np.ndarray]:
    """Spheres of 10 mm about the origin, numbered from ``first``, probed along the directions given."""
    directions = np.array([direction for sphere in spheres for direction in sphere], dtype=np.float64)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    number = np.concatenate([np.full(len(sphere), first + i) for i, sphere in enumerate(spheres)])
    point = np.concatenate([np.arange(1, len(sphere) + 1) for sphere in spheres])
    return Points(10.0 * directions, number, point, np.full(len(number), repeat)), directions


def missing(plan: SpherePlan, *spheres: Sequence[Sequence[float]], copies: Sequence[int] = ()) -> list[str]:
    points, directions = recorded(*spheres)
    found = sphere_points(plan, points, directions, dict.fromkeys(copies, 0))
    return [text for condition in found for text in condition.missing]


X, Y, Z = np.eye(3).tolist()


def test_every_sphere_is_counted_and_named_by_its_measurement() -> None:
    assert missing(SpherePlan(3, 90.0), [X, Y, Z], [X, Y], [X, Y, Z, Z]) == [
        "3 points on the sphere of measurement 4 (2 recorded, 2 different)"
    ]
    assert missing(SpherePlan(3, 90.0), [X, Y, Z], [X, Y], copies=[1]) == []


def test_a_zero_and_a_minus_zero_are_the_same_coordinate() -> None:
    assert missing(SpherePlan(3, 90.0), [X, Y, [-0.0, 1.0, -0.0]]) == [
        "3 points on the sphere of measurement 3 (3 recorded, 2 different)"
    ]


@pytest.mark.parametrize("pole", [X, Y, Z, [-1.0, 0.0, 0.0], [0.3, -0.5, -0.8]])
def test_one_point_alone_has_its_hemisphere_within_ninety_degrees_of_it(pole: list[float]) -> None:
    assert missing(SpherePlan(1, 90.0), [pole]) == []
    (text,) = missing(SpherePlan(1, 89.0), [pole])
    assert text == ("points over a hemisphere on the sphere of measurement 3 (part of it 90° from the nearest point)")


def test_three_axes_and_their_middle_leave_a_part_of_the_hemisphere_bare() -> None:
    """On the plane square to the middle, opposite to an axis: cos = −√(2/3)·cos 60°…; the nearest two axes are 65.9° away."""
    plane = np.degrees(np.arccos(np.sqrt(2 / 3) * np.cos(np.pi / 3)))
    spheres = [X, Y, Z, [1.0, 1.0, 1.0]]
    assert missing(SpherePlan(4, float(plane) + 0.1), spheres) == []
    assert missing(SpherePlan(4, float(plane) - 3.0), spheres) != []


def test_between_a_pole_and_a_dense_equator_the_hemisphere_is_bare_at_45_degrees() -> None:
    """Half-way between two of 36 points of the equator: tan of the height is cos 5°, 45.1° from the pole and from both."""
    equator = [[np.cos(t), np.sin(t), 0.0] for t in np.radians(np.arange(0.0, 360.0, 10.0))]
    assert missing(SpherePlan(37, 45.2), [Z, *equator]) == []
    assert missing(SpherePlan(37, 43.5), [Z, *equator]) != []


def test_points_round_the_equator_alone_leave_the_pole_bare() -> None:
    """Their mean is nothing at all; of 400 directions the highest is less than 3° from the pole."""
    equator = [X, Y, [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]
    assert missing(SpherePlan(4, 90.0), equator) == []
    assert missing(SpherePlan(4, 87.0), equator) != []


def test_points_that_balance_each_other_are_looked_at_about_the_vertical() -> None:
    """Two above, three at a height of −2/3: above, the farthest direction is at 12.6°, 77.4° from all; below, 68.1°."""
    low = [[np.sqrt(5) / 3 * np.cos(t), np.sqrt(5) / 3 * np.sin(t), -2 / 3] for t in np.radians([0.0, 120.0, 240.0])]
    points, directions = recorded([Z, [1e-12, 0.0, 1.0], *low])
    assert abs(directions.mean(axis=0)).max() < 1e-9
    reached = {reach: sphere_points(SpherePlan(5, reach), points, directions, {})[1].met for reach in (72.0, 77.5)}
    assert reached == {72.0: False, 77.5: True}


@pytest.mark.parametrize(("tip", "lack"), [(8.0, 0), (12.0, 1)])
def test_a_sphere_probed_by_several_styli_is_no_test_of_one(tip: float, lack: int) -> None:
    points, directions = recorded([X, Y, Z])
    mixed = replace(points, columns={"tip_x_mm": np.array([0.0, 0.0, tip])})
    found = [text for one in sphere_points(SpherePlan(3, 90.0), mixed, directions, {}) for text in one.missing]
    assert found == ["one stylus on the sphere of measurement 3: tips of several were recorded"] * lack
    same = replace(points, columns={"tip_x_mm": np.full(3, tip)})
    assert all(one.met for one in sphere_points(SpherePlan(3, 90.0), same, directions, {}))


def test_the_conditions_say_what_is_asked() -> None:
    points, directions = recorded([X])
    assert [c.what for c in sphere_points(SpherePlan(1, 90.0), points, directions, {})] == [
        "1 points over the sphere", "every direction of a hemisphere within 90° of a point",
    ]  # fmt: skip
