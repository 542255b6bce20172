from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.maths.geometry import fit_circle


@pytest.mark.parametrize("far", [0.0, 10_000.0])
@pytest.mark.parametrize("angle", [2 * np.pi, np.pi / 2, np.pi / 6])
def test_a_reference_set_gives_its_circle_in_space_to_a_picometre(place, arc, angle, far):
    radial, _ = arc(angle, 0.0, 80, seed=3)
    normals = np.stack([radial, np.tile([0.0, 0, 1], (80, 1))], axis=1)
    growth = np.tile([[1.0], [0.0]], (80, 1, 1))
    placed = place(25.0 * radial, normals, growth, form=0.002, seed=4, far=far)
    circle = fit_circle(placed.points)
    np.testing.assert_allclose(circle.centre, placed.origin, rtol=0, atol=1e-9)
    assert abs(circle.radius - 25.0) < 1e-9
    assert np.linalg.norm(np.cross(circle.normal, placed.axis)) * 25 < 1e-9


def test_in_a_plane_it_is_the_circle_in_space_that_lies_in_that_plane(arc):
    radial, _ = arc(1.0, 0.0, 40, seed=6)
    flat = (7 + np.random.default_rng(5).normal(scale=1e-3, size=(40, 1))) * radial
    plane, space = fit_circle(flat[:, :2], u_point=1e-3), fit_circle(flat, u_point=1e-3)
    np.testing.assert_allclose(plane.centre, space.centre[:2], atol=1e-9)
    assert plane.radius == pytest.approx(space.radius, abs=1e-9)
    assert plane.u("r") == pytest.approx(space.u("r"), rel=1e-9)
    assert plane.normal is None


def test_a_full_circle_of_equal_steps_has_the_textbook_uncertainty():
    turn = np.arange(100) * 2 * np.pi / 100
    circle = fit_circle(10 * np.column_stack([np.cos(turn), np.sin(turn)]), u_point=1e-3)
    # JᵀJ is diagonal: n/2, n/2, n
    assert [circle.u(a) for a in "xyr"] == pytest.approx([1e-3 * np.sqrt(2 / 100)] * 2 + [1e-4], rel=1e-12)


def test_roundness_is_peak_to_valley_of_the_radii():
    turn = np.arange(360) * 2 * np.pi / 360
    radius = 20 + 0.003 * np.cos(3 * turn)
    assert fit_circle(radius[:, None] * np.column_stack([np.cos(turn), np.sin(turn)])).form_deviation == pytest.approx(
        0.006, rel=1e-3
    )


@pytest.mark.parametrize(
    ("points", "message"),
    [
        (np.eye(2), "2 points are too few. Measure at least 3"),
        (np.outer(np.arange(5.0), [1, 2]), "lie on one line"),
        (np.outer(np.arange(5.0), [1, 2, 0]), "lie on one line"),
    ],
)
def test_points_that_cannot_make_a_circle_are_refused(points, message):
    with pytest.raises(CmmUqError, match=message):
        fit_circle(points)
