from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.maths.geometry import fit_cylinder

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


def test_one_ring_does_not():
    turn = np.arange(8) * np.pi / 4
    with pytest.raises(CmmUqError, match=r"in one plane\. Measure points out of that plane too"):
        fit_cylinder(np.column_stack([5 * np.cos(turn), 5 * np.sin(turn), np.zeros(8)]))


def test_five_points_are_the_least():
    with pytest.raises(CmmUqError, match=r"4 points are too few\. Measure at least 5"):
        fit_cylinder(np.eye(4, 3))


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
