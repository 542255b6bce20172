from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.maths.geometry import fit_plane


@pytest.mark.parametrize("far", [0.0, 10_000.0])
@pytest.mark.parametrize("width", [100.0, 0.5], ids=["square", "narrow strip"])
def test_a_reference_set_gives_its_plane_to_a_picometre(place, width, far):
    rng = np.random.default_rng(8)
    surface = np.column_stack([rng.uniform(-100, 100, 60), rng.uniform(-width, width, 60), np.zeros(60)])
    normals = np.tile([0.0, 0, 1], (60, 1, 1))
    placed = place(surface, normals, np.zeros((60, 1, 0)), form=0.003, seed=9, far=far)
    plane = fit_plane(placed.points)
    # over a strip of half a millimetre the rounding of coordinates of 10 m, 2e-12 mm, allows no better than 1e-11 rad
    tilt = np.linalg.norm(np.cross(plane.normal, placed.axis))
    assert tilt * width < 1e-9
    assert abs((plane.point - placed.origin) @ placed.axis) < 1e-9


def test_it_is_least_squares_of_heights_when_the_plane_is_level():
    rng = np.random.default_rng(1)
    xy, z = rng.uniform(-50, 50, (30, 2)), rng.normal(scale=1e-6, size=30)
    plane = fit_plane(np.column_stack([xy, z]))
    A = np.column_stack([xy, np.ones(30)])
    slopes = np.linalg.lstsq(A, z, rcond=None)[0][:2]
    np.testing.assert_allclose(-plane.normal[:2] / plane.normal[2], slopes, atol=1e-13)
    covariance = np.linalg.inv(A.T @ A) * plane.u_point**2
    np.testing.assert_allclose(plane.covariance[3:5, 3:5], covariance[:2, :2], rtol=1e-6)


def test_flatness_is_peak_to_valley_from_the_plane():
    corners = np.array([[0, 0, 0.002], [10, 0, -0.002], [0, 10, -0.002], [10, 10, 0.002]])
    plane = fit_plane(corners)
    assert plane.form_deviation == pytest.approx(0.004, rel=1e-12)
    assert plane.rms == pytest.approx(0.002, rel=1e-12)


@pytest.mark.parametrize(
    ("points", "message"),
    [
        (np.eye(3)[:2], "2 points are too few. Measure at least 3"),
        (np.outer(np.arange(5.0), [1, 1, 0]), "lie on one line"),
    ],
)
def test_points_that_cannot_make_a_plane_are_refused(points, message):
    with pytest.raises(CmmUqError, match=message):
        fit_plane(points)
