"""The room and its reference sets; spheres fitted to the visible side of a ball of revolution (Harris 2004 appendix A)."""

from __future__ import annotations

import ast
import subprocess
import sys
from importlib import import_module
from inspect import getsource

import numpy as np
import pytest
from scipy.optimize import least_squares

from cmm_uq.base.errors import CmmUqError
from cmm_uq.maths import geometry
from cmm_uq.maths.geometry import BallForm, cap_directions, fit_sphere
from tests.maths.geometry.reference_sets import points_with_known_fit

TOLD = [(node.module, alias.name) for node in ast.walk(ast.parse(getsource(geometry)))
        if isinstance(node, ast.ImportFrom) and str(node.module).startswith("cmm_uq.") for alias in node.names]  # fmt: skip


@pytest.mark.parametrize(("module", "name"), TOLD)
def test_a_name_is_what_its_module_has(module: str, name: str) -> None:
    assert getattr(geometry, name) is getattr(import_module(module), name)


def test_the_room_has_these_names_and_no_others() -> None:
    assert sorted(name for _, name in TOLD) == sorted(geometry.__all__)
    with pytest.raises(AttributeError, match="no attribute 'fit_torus'"):
        _ = geometry.fit_torus


def test_a_rotation_loads_no_fit() -> None:
    code = "import sys, cmm_uq.maths.geometry.feature; sys.exit('cmm_uq.maths.geometry.axial' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_least_squares_of_scipy_finds_the_sphere_that_a_reference_set_was_built_about():
    n = cap_directions(1.2, 60)
    points = points_with_known_fit(20.0 * n, n[:, None, :], np.ones((60, 1, 1)), 0.05, seed=1)
    fitted = least_squares(
        lambda p: np.linalg.norm(points - p[:3], axis=1) - p[3],
        [0.1, -0.1, 0.1, 19.0],
        xtol=1e-15,
        ftol=1e-15,
        gtol=1e-15,
    )
    np.testing.assert_allclose(fitted.x, [0, 0, 0, 20.0], atol=1e-8)


def test_the_largest_deviation_is_the_form_asked_for():
    n = cap_directions(np.pi, 40)
    points = points_with_known_fit(5.0 * n, n[:, None, :], np.ones((40, 1, 1)), 0.02, seed=2)
    assert np.isclose(np.abs(np.linalg.norm(points, axis=1) - 5.0).max(), 0.02, rtol=1e-12)


EQUATOR = 38.125


def spheroid(polar_radius: float, polar_angle_degrees: float):
    """Points spread evenly over the cap of an ellipsoid of revolution about z."""
    n = cap_directions(np.radians(polar_angle_degrees), 20_000)
    return n / np.sqrt((n[:, :2] ** 2).sum(axis=1) / EQUATOR**2 + n[:, 2] ** 2 / polar_radius**2)[:, None]


@pytest.mark.parametrize(
    ("polar_radius", "polar_angle", "printed_radius", "printed_z"),
    [
        (38.1225, 5, 38.128, -0.005),
        (38.1225, 60, 38.126, -0.004),
        (38.1225, 85, 38.126, -0.003),
        (38.1275, 5, 38.122, 0.005),
        (38.1275, 85, 38.124, 0.003),
    ],
    ids=["oblate 5", "oblate 60", "oblate 85", "prolate 5", "prolate 85"],
)
def test_the_printed_centres_and_radii(polar_radius, polar_angle, printed_radius, printed_z):
    sphere = fit_sphere(spheroid(polar_radius, polar_angle))
    # printed to 1 µm, so half of that, and the source's own points lay on another grid
    assert sphere.centre[2] == pytest.approx(printed_z, abs=0.52e-3)
    assert sphere.radius == pytest.approx(printed_radius, abs=0.52e-3)
    assert np.abs(sphere.centre[:2]).max() < 1e-6


@pytest.mark.parametrize("polar_angle", [5, 60, 85, 120])
def test_the_first_order_shift_is_that_of_the_fitted_spheroid(polar_angle):
    n = cap_directions(np.radians(polar_angle), 20_000)
    shift = BallForm(5e-3).shift(n, np.array([0, 0, 1.0]))
    fitted = fit_sphere(spheroid(EQUATOR + 2.5e-3, polar_angle))
    np.testing.assert_allclose(shift, [*fitted.centre, fitted.radius - EQUATOR], atol=2e-6)


def test_on_a_hemisphere_the_centre_moves_by_half_the_sphericity():
    # least squares of c² on [0, 1] by 1 and c is c − 1/6
    shift = BallForm(5.08e-3).shift(cap_directions(np.pi / 2, 100_000), np.array([0, 0, 1.0]))
    np.testing.assert_allclose(shift, [0, 0, 2.54e-3, -2.54e-3 / 6], atol=1e-7)


def test_the_covariance_is_the_mean_over_every_way_that_the_ball_can_lie():
    n = cap_directions(np.radians(85), 400)
    ball = BallForm(5.08e-3)
    # equal weights over directions of the axis that integrate every polynomial of degree four exactly: an icosahedron's
    golden = (1 + np.sqrt(5)) / 2
    axes = np.array([[0, 1, golden], [0, -1, golden], [1, golden, 0], [-1, golden, 0], [golden, 0, 1], [golden, 0, -1]])
    shifts = np.array([ball.shift(n, k) for k in axes])
    np.testing.assert_allclose(ball.covariance(n), np.cov(shifts, rowvar=False, ddof=0), atol=1e-18)


def test_more_points_do_not_help():
    few, many = (BallForm(5.08e-3).covariance(cap_directions(np.pi / 2, n)) for n in (300, 17_000))
    np.testing.assert_allclose(np.diag(few), np.diag(many), rtol=0.02)


def test_a_ball_seen_all_round_shows_its_centre():
    assert np.abs(BallForm(5e-3).shift(cap_directions(np.pi, 50_000), np.array([0.3, 0.5, 0.8]))[:3]).max() < 1e-8


def test_what_cannot_be_a_ball_is_refused():
    with pytest.raises(CmmUqError, match="sphericity"):
        BallForm(-1.0)
    with pytest.raises(CmmUqError, match="do not determine a sphere"):
        BallForm(1e-3).shift(np.eye(3), np.array([0, 0, 1.0]))
