from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.optimize import least_squares

from cmm_uq.base.errors import CmmUqError
from cmm_uq.maths.geometry import cap_directions, fit_sphere

COVERAGES = {"whole": np.pi, "hemisphere": np.pi / 2, "cap of 30 degrees": np.pi / 6, "cap of 5 degrees": np.pi / 36}


@pytest.mark.parametrize("far", [0.0, 500.0, 10_000.0])
@pytest.mark.parametrize("polar_angle", COVERAGES.values(), ids=COVERAGES.keys())
def test_a_reference_set_gives_its_sphere_to_a_picometre(place, polar_angle, far):
    n = cap_directions(polar_angle, 200)
    placed = place(38.125 * n, n[:, None, :], np.ones((200, 1, 1)), form=0.002, seed=7, far=far)
    sphere = fit_sphere(placed.points)
    np.testing.assert_allclose(sphere.centre, placed.origin, rtol=0, atol=1e-9)
    assert abs(sphere.radius - 38.125) < 1e-9


def test_the_uncertainty_of_a_hemisphere_of_17000_points_is_the_published_one():
    # R = 38.125 mm, 9 µm a point: u(centre) = 0.120, 0.120, 0.240 µm, u(R) = 0.138 µm, corr(z, R) = −0.866 = −√3/2
    sphere = fit_sphere(38.125 * cap_directions(np.pi / 2, 17_000), u_point=9e-3)
    assert [sphere.u(name) * 1e3 for name in "xyzr"] == pytest.approx([0.1196, 0.1196, 0.2391, 0.1380], rel=2e-3)
    assert sphere.correlation("z", "r") == pytest.approx(-np.sqrt(3) / 2, abs=1e-3)


def test_the_covariance_is_that_of_repeated_measurement():
    n, rng = cap_directions(1.0, 60), np.random.default_rng(11)
    fits = [fit_sphere((20 + rng.normal(scale=2e-3, size=(60, 1))) * n, u_point=2e-3) for _ in range(2000)]
    spread = np.cov([[*f.centre, f.radius] for f in fits], rowvar=False)
    # a variance from 2000 fits has a relative standard uncertainty of 3.2 %; five of them leave no doubt
    np.testing.assert_allclose(np.diag(spread), np.diag(fits[0].covariance), rtol=0.16)
    assert np.corrcoef([[f.centre[2], f.radius] for f in fits], rowvar=False)[0, 1] == pytest.approx(
        fits[0].correlation("z", "r"), abs=5e-3
    )


def test_the_scatter_of_the_points_is_estimated_when_it_is_not_given():
    n, rng = cap_directions(2.0, 4000), np.random.default_rng(3)
    sphere = fit_sphere((12 + rng.normal(scale=5e-3, size=(4000, 1))) * n)
    assert not sphere.u_point_given
    assert sphere.degrees_of_freedom == 3996
    assert sphere.u_point == pytest.approx(5e-3, rel=5 / np.sqrt(2 * 3996))


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**31), st.floats(0.3, np.pi), st.floats(1.0, 200.0), st.integers(12, 120))
def test_the_fit_is_the_least_of_all_sums_of_squares(seed, polar_angle, radius, n):
    points = radius * cap_directions(polar_angle, n) + np.random.default_rng(seed).normal(
        scale=1e-4 * radius, size=(n, 3)
    )
    sphere = fit_sphere(points)
    scipy = least_squares(lambda p: np.linalg.norm(points - p[:3], axis=1) - p[3], [0, 0, 0, radius], xtol=1e-15)
    assert np.sum(sphere.residuals**2) <= 2 * scipy.cost * (1 + 1e-9)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**31), st.floats(1e-3, 1e3))
def test_a_fit_moves_turns_and_grows_with_its_points(seed, size):
    rng = np.random.default_rng(seed)
    points = 10 * cap_directions(1.5, 50) + rng.normal(scale=1e-3, size=(50, 3))
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    shift = rng.normal(size=3) * 100
    here, there = fit_sphere(points), fit_sphere(size * points @ turn.T + shift)
    np.testing.assert_allclose(there.centre, size * turn @ here.centre + shift, atol=1e-10 * (1 + size))
    np.testing.assert_allclose(there.covariance[:3, :3], size**2 * turn @ here.covariance[:3, :3] @ turn.T, rtol=1e-6)


def test_four_points_determine_a_sphere_but_not_their_own_scatter():
    tetrahedron = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1.0]])
    sphere = fit_sphere(tetrahedron, u_point=1e-3)
    assert sphere.radius == pytest.approx(np.sqrt(3), abs=1e-12)
    with pytest.raises(CmmUqError, match="nothing to estimate their uncertainty"):
        fit_sphere(tetrahedron)


@pytest.mark.parametrize(
    ("points", "message"),
    [
        (np.eye(3), "3 points are too few. Measure at least 4"),
        (np.outer(np.arange(6.0), [1, 2, 3]), "lie on one line"),
        (np.column_stack([np.cos(np.arange(9)), np.sin(np.arange(9)), np.full(9, 4.0)]), "lie in one plane"),
        (np.full((5, 3), np.inf), "point 1 has a coordinate that is no finite number"),
        (np.zeros((5, 2)), r"shape \(5, 2\)"),
        (np.zeros((7, 3)), "lie on one line"),
    ],
)
def test_points_that_cannot_make_a_sphere_are_refused_with_what_is_missing(points, message):
    with pytest.raises(CmmUqError, match=message):
        fit_sphere(points)


def test_a_cap_flatter_than_its_noise_is_refused():
    rng = np.random.default_rng(4)
    flat = np.column_stack([rng.uniform(-1, 1, (200, 2)), rng.normal(scale=0.01, size=200)])
    with pytest.raises(CmmUqError, match=r"do not determine|does not settle"):
        fit_sphere(flat)
