"""Cylinders and cones."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.maths.geometry import fit_cone, fit_cylinder

SHAPES = {
    "long, all round": (20.0, 200.0, 2 * np.pi),
    "ring": (100.0, 5.0, 2 * np.pi),
    "half round": (20.0, 40.0, np.pi),
    "gutter of 30 degrees": (50.0, 60.0, np.pi / 6),
    "short patch": (500.0, 100.0, np.pi / 9),
}


@pytest.mark.parametrize("far", [0.0, 10_000.0])
@pytest.mark.parametrize(("radius", "length", "angle"), SHAPES.values(), ids=SHAPES.keys())
def test_a_reference_set_gives_its_cylinder_to_a_picometre(place, arc, radius, length, angle, far):
    radial, height = arc(angle, length, 120, seed=21)
    surface = radius * radial + height[:, None] * [0, 0, 1]
    placed = place(surface, radial[:, None, :], np.ones((120, 1, 1)), form=1e-3, seed=22, far=far)
    cylinder = fit_cylinder(placed.points)
    assert abs(cylinder.radius - radius) < 1e-9
    assert np.linalg.norm(np.cross(cylinder.direction, placed.axis)) * length < 1e-9
    assert np.linalg.norm(np.cross(cylinder.point - placed.origin, placed.axis)) < 1e-9


@pytest.mark.long
def test_the_covariance_is_that_of_repeated_measurement(arc):
    radial, height = arc(2.0, 30.0, 40, seed=1)
    rng = np.random.default_rng(2)
    exact = 10 * radial + height[:, None] * [0, 0, 1]
    fits = [fit_cylinder(exact + rng.normal(scale=1e-3, size=(40, 1)) * radial, u_point=1e-3) for _ in range(200)]
    spread = np.var([[*f.point[:2], *f.direction[:2], f.radius] for f in fits], axis=0)
    # a variance from 200 fits has a relative standard uncertainty of 10 %; four of them
    np.testing.assert_allclose(spread, np.diag(fits[0].covariance)[[0, 1, 3, 4, 6]], rtol=0.4)


def test_two_rings_determine_a_cylinder():
    turn = np.arange(8) * np.pi / 4
    ring = np.column_stack([5 * np.cos(turn), 5 * np.sin(turn), np.zeros(8)])
    cylinder = fit_cylinder(np.vstack([ring, ring + np.array([0, 0, 30.0])]), u_point=1e-3)
    assert cylinder.radius == pytest.approx(5, abs=1e-12)
    np.testing.assert_allclose(cylinder.direction, [0, 0, 1], atol=1e-12)


@pytest.mark.parametrize("height", [12.0, 16.0])
@pytest.mark.parametrize("count", [4, 8])
def test_points_in_regular_sections_are_no_trouble(count, height):
    """A plan's points: some lie on the axis of a direction that is tried."""
    angle, z = np.meshgrid(np.arange(count) * 2 * np.pi / count, np.linspace(-height / 2, height / 2, 3))
    about = np.array([60.0, 40.0, -10.0])
    points = about + np.column_stack([15 * np.cos(angle.ravel()), 15 * np.sin(angle.ravel()), z.ravel()])
    found = fit_cylinder(points, u_point=1e-3)
    assert found.radius == pytest.approx(15, abs=1e-9)
    assert abs(found.direction[2]) == pytest.approx(1, abs=1e-12)


SHAPES_CONE = {
    "countersink": (5.0, 4.0, 2 * np.pi, np.pi / 4),
    "slender taper": (20.0, 100.0, 2 * np.pi, 0.02),
    "small cone, half round": (1.5, 2.0, np.pi, 0.5),
    "flat cone": (30.0, 6.0, 2 * np.pi, 1.3),
    "third of a cone": (25.0, 30.0, 2 * np.pi / 3, 0.3),
}


def cone_surface(radial, height, radius, psi):
    """Surface, normals and growth (of the distance from the axis, of the half angle) of a cone that widens along +z."""
    f = radius + height * np.tan(psi)
    surface = f[:, None] * radial + height[:, None] * [0, 0, 1]
    normals = np.cos(psi) * radial - np.sin(psi) * np.array([0, 0, 1.0])
    growth = np.column_stack([np.ones_like(f), f * np.sin(psi) + height * np.cos(psi)])
    return surface, normals[:, None, :], growth[:, None, :]


@pytest.mark.parametrize("far", [0.0, 10_000.0])
@pytest.mark.parametrize(("radius", "length", "angle", "psi"), SHAPES_CONE.values(), ids=SHAPES_CONE.keys())
def test_a_reference_set_gives_its_cone_to_a_picometre(place, arc, radius, length, angle, psi, far):
    radial, height = arc(angle, length, 150, seed=31)
    placed = place(*cone_surface(radial, height, radius, psi), form=5e-4, seed=32, far=far)
    cone = fit_cone(placed.points)
    along = (cone.point - placed.origin) @ placed.axis
    # one way of the angle is one way of the radius over the length of the cone
    assert abs(cone.half_angle - psi) * length < 1e-9
    assert abs(cone.radius - (radius + along * np.tan(psi))) < 1e-9
    assert np.linalg.norm(cone.direction - placed.axis) * length < 1e-9
    assert np.linalg.norm(np.cross(cone.point - placed.origin, placed.axis)) < 1e-9


def test_the_apex_lies_where_the_surface_ends(arc):
    radial, height = arc(2 * np.pi, 10.0, 60, seed=2)
    cone = fit_cone(cone_surface(radial, height, 8.0, 0.5)[0], u_point=1e-3)
    np.testing.assert_allclose(cone.apex, [0, 0, -8.0 / np.tan(0.5)], atol=1e-10)


@pytest.mark.long
@pytest.mark.long
def test_the_covariance_is_that_of_repeated_measurement_of_cone(arc):
    radial, height = arc(2 * np.pi, 30.0, 40, seed=1)
    surface, normals, _ = cone_surface(radial, height, 20.0, 0.4)
    rng = np.random.default_rng(2)
    fits = [fit_cone(surface + rng.normal(scale=1e-3, size=(40, 1)) * normals[:, 0], u_point=1e-3) for _ in range(200)]
    # a variance from 200 fits has a relative standard uncertainty of 10 %; four of them. The point follows the
    # centroid of each set, so radii are compared at one height
    level = fits[0].point[2]
    values = [[*f.direction[:2], f.radius + (level - f.point[2]) * np.tan(f.half_angle), f.half_angle] for f in fits]
    np.testing.assert_allclose(np.var(values, axis=0), np.diag(fits[0].covariance)[[3, 4, 6, 7]], rtol=0.4)


def test_a_cylinder_is_no_cone(arc):
    radial, height = arc(2 * np.pi, 40.0, 80, seed=3)
    points = 10 * radial + height[:, None] * [0, 0, 1] + np.random.default_rng(1).normal(scale=1e-3, size=(80, 3))
    with pytest.raises(CmmUqError, match="within their scatter the points lie on a cylinder"):
        fit_cone(points, u_point=5e-2)
    assert fit_cylinder(points).radius == pytest.approx(10, abs=1e-3)
