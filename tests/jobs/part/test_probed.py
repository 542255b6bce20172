"""Contact points lie on their nominal surface, with normals out of the material, as many and where the pattern says.

Distances from the surface are by the implicit equation of each, written here again; sizes by the fits of the geometry room.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, strategies as st

from cmm_uq.base.points import Floats
from cmm_uq.maths.geometry.axial import fit_cylinder
from cmm_uq.maths.geometry.fits import fit_circle, fit_sphere
from tests.jobs.part.parts import feature

ROUND = {"diameter_mm": 30.0}
PATTERNS: list[tuple[str, dict[str, Any], dict[str, Any], int]] = [
    ("line", {"length_mm": 40.0, "normal": [0.1, 0.2, 1.0]}, {"pattern": "points", "points": 5}, 5),
    ("plane", {"length_mm": 40.0, "width_mm": 20.0}, {"pattern": "grid", "rows": 3, "columns": 4}, 12),
    ("plane", {"length_mm": 40.0, "width_mm": 20.0}, {"pattern": "points", "points": 11}, 11),
    ("plane", {"diameter_mm": 40.0}, {"pattern": "circles", "circles": 2, "points": 6}, 12),
    ("plane", {"diameter_mm": 40.0, "inner_diameter_mm": 20.0}, {"pattern": "points", "points": 9}, 9),
    ("plane", {"diameter_mm": 40.0}, {"pattern": "spiral", "turns": 2.5, "points": 20}, 20),
    ("circle", ROUND, {"pattern": "points", "points": 7}, 7),
    ("circle", ROUND, {"pattern": "points", "points": 7, "start_deg": 20.0, "sweep_deg": 90.0}, 7),
    ("sphere", ROUND, {"pattern": "points", "points": 25}, 25),
    ("sphere", ROUND, {"pattern": "sections", "sections": 3, "points": 8}, 25),
    ("sphere", ROUND, {"pattern": "spiral", "turns": 3.0, "points": 20, "cap_deg": 120.0}, 20),
    *(
        (kind, {**ROUND, "length_mm": 20.0, **({"angle_deg": 30.0} if kind == "cone" else {})}, strategy, count)
        for kind in ("cylinder", "cone")
        for strategy, count in (
            ({"pattern": "points", "points": 13}, 13),
            ({"pattern": "sections", "sections": 3, "points": 8, "margin_mm": 2.0}, 24),
            ({"pattern": "lines", "lines": 4, "points": 5, "sweep_deg": 180.0}, 20),
            ({"pattern": "spiral", "turns": 1.5, "points": 16}, 16),
        )
    ),
]

directions = st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda v: np.linalg.norm(v) > 0.1)
places = st.tuples(*[st.floats(-1000, 1000)] * 3)


def off_and_outward(
    kind: str, keys: dict[str, Any], w: Floats, local: Floats, normals: Floats
) -> tuple[Floats, Floats]:
    """(n,) distance from the nominal surface, and cosine between a normal and the way away from the axis, plane or centre."""
    height = local @ w
    radial = local - np.outer(height, w)
    if kind == "plane":
        return np.abs(height), normals @ w
    if kind == "line":
        return np.linalg.norm(radial, axis=1), normals @ np.array(keys["normal"]) / np.linalg.norm(keys["normal"])
    out = local if kind == "sphere" else radial
    radius = keys["diameter_mm"] / 2 + height * np.tan(np.radians(keys.get("angle_deg", 0.0) / 2))
    size = np.linalg.norm(out, axis=1)
    off = np.abs(size - (keys["diameter_mm"] / 2 if kind == "sphere" else radius))
    return off + (np.abs(height) if kind == "circle" else 0), np.einsum("ni,ni->n", normals, out) / size


@pytest.mark.long
@pytest.mark.parametrize(("kind", "keys", "strategy", "count"), PATTERNS)
@given(w=directions, place=places)
def test_points_lie_on_their_surface_wherever_it_is(
    kind: str,
    keys: dict[str, Any],
    strategy: dict[str, Any],
    count: int,
    w: tuple[float, ...],
    place: tuple[float, ...],
) -> None:
    unit = np.array(w) / np.linalg.norm(w)
    if kind == "line":  # a normal across the line
        keys = {**keys, "normal": np.cross(unit, np.eye(3)[np.argmin(np.abs(unit))]).tolist()}
    side = {"inner": False} if kind in ("circle", "sphere", "cylinder", "cone") else {}
    found = feature(kind, point_mm=list(place), direction=list(w), strategy=strategy, **keys, **side)
    off, outward = off_and_outward(kind, keys, unit, found.points - place, found.normals)
    assert len(found.points) == count
    assert off.max() < 1e-9
    np.testing.assert_allclose(np.linalg.norm(found.normals, axis=1), 1, atol=1e-12)
    expected = np.cos(np.radians(keys.get("angle_deg", 0.0) / 2))
    np.testing.assert_allclose(outward, expected, atol=1e-9)


@pytest.mark.parametrize("kind", ["circle", "sphere", "cylinder", "cone"])
def test_in_a_hole_normals_point_the_other_way(kind: str) -> None:
    keys: dict[str, Any] = {"point_mm": [0.0, 0.0, 0.0], "direction": [0.0, 0.0, 1.0], "diameter_mm": 20.0}
    keys |= {"length_mm": 8.0} if kind in ("cylinder", "cone") else {}
    keys |= {"angle_deg": 20.0} if kind == "cone" else {}
    strategy = {"pattern": "points", "points": 9}
    shaft = feature(kind, inner=False, strategy=strategy, **keys)
    hole = feature(kind, inner=True, strategy=strategy, **keys)
    np.testing.assert_array_equal(hole.points, shaft.points)
    np.testing.assert_array_equal(hole.normals, -shaft.normals)


def test_a_cone_widens_along_its_direction_and_its_normals_lean_back() -> None:
    found = feature("cone", point_mm=[0.0, 0.0, 0.0], direction=[0.0, 0.0, 1.0], diameter_mm=20.0, angle_deg=90.0, inner=False,
                    length_mm=10.0, strategy={"pattern": "sections", "sections": 2, "points": 4})  # fmt: skip
    radii = np.hypot(found.points[:, 0], found.points[:, 1])
    np.testing.assert_allclose(radii, [5] * 4 + [15] * 4, atol=1e-12)  # 45° a side: as much wider as higher
    np.testing.assert_allclose(found.normals[:, 2], -np.sqrt(0.5), atol=1e-12)


def test_fits_of_the_points_give_the_nominal_sizes() -> None:
    common: dict[str, Any] = {
        "point_mm": [5.0, -3.0, 8.0],
        "direction": [1.0, 2.0, -2.0],
        "diameter_mm": 12.0,
        "inner": True,
    }
    circle = feature("circle", strategy={"pattern": "points", "points": 6}, **common)
    sphere = feature("sphere", strategy={"pattern": "points", "points": 25}, **common)
    cylinder = feature("cylinder", length_mm=9.0, strategy={"pattern": "points", "points": 20}, **common)
    for found in (
        fit_circle(circle.points, u_point=1e-3), fit_sphere(sphere.points, u_point=1e-3),
        fit_cylinder(cylinder.points, u_point=1e-3),
    ):  # fmt: skip
        assert found.radius == pytest.approx(6, abs=1e-9)


def test_a_circle_begins_along_its_along_and_goes_by_the_right_hand() -> None:
    found = feature("circle", point_mm=[0.0, 0.0, 0.0], direction=[0.0, 0.0, 1.0], along=[0.0, 1.0, 0.0], diameter_mm=2.0,
                    inner=True, strategy={"pattern": "points", "points": 4, "start_deg": 90.0})  # fmt: skip
    np.testing.assert_allclose(found.points, [[-1, 0, 0], [0, -1, 0], [1, 0, 0], [0, 1, 0]], atol=1e-12)


def test_margins_stay_free() -> None:
    grid = feature("plane", point_mm=[0.0, 0.0, 0.0], direction=[0.0, 0.0, 1.0], length_mm=40.0, width_mm=20.0,
                   strategy={"pattern": "grid", "rows": 2, "columns": 2, "margin_mm": 3.0})  # fmt: skip
    np.testing.assert_allclose(np.abs(grid.points[:, :2]), [[17, 7]] * 4)
    line = feature("line", point_mm=[0.0, 0.0, 0.0], direction=[1.0, 0.0, 0.0], normal=[0.0, 0.0, 1.0], length_mm=40.0,
                   strategy={"pattern": "points", "points": 2, "margin_mm": 5.0})  # fmt: skip
    np.testing.assert_allclose(line.points[:, 0], [-15, 15])


def test_points_spread_over_a_ring_are_even_over_its_area() -> None:
    """Half of them lie inside the radius that halves the area, √((r² + R²)/2)."""
    found = feature("plane", point_mm=[0.0, 0.0, 0.0], direction=[0.0, 0.0, 1.0], diameter_mm=40.0, inner_diameter_mm=20.0,
                    strategy={"pattern": "points", "points": 100})  # fmt: skip
    radii = np.hypot(found.points[:, 0], found.points[:, 1])
    assert np.count_nonzero(radii < np.sqrt((10**2 + 20**2) / 2)) == 50
    assert radii.min() > 10
    assert radii.max() < 20


def test_points_that_are_given_get_their_normals_from_the_nominal() -> None:
    points = [[5.0, 0.0, 0.0], [0.0, 5.0, 1.0], [-5.0, 0.0, 2.0], [0.0, -5.0, 3.0], [3.0, 4.0, 4.0]]
    found = feature(
        "cylinder", point_mm=[0.0, 0.0, 0.0], direction=[0.0, 0.0, 1.0], diameter_mm=10.0, inner=True, points_mm=points
    )
    np.testing.assert_array_equal(found.points, points)
    np.testing.assert_allclose(found.normals[4], [-0.6, -0.8, 0])
