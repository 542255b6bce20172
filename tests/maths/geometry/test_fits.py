"""Lines, planes, circles and spheres; widths of bodies; rings and empty circles, and searches that cannot come to an end."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.optimize import least_squares

from cmm_uq.base.errors import CmmUqError
from cmm_uq.maths.geometry import cap_directions, fit_circle, fit_cone, fit_cylinder, fit_line, fit_plane, fit_sphere
from cmm_uq.maths.geometry.fits import largest_empty, narrower, narrowest, safe_radius


@pytest.mark.parametrize("far", [0.0, 10_000.0])
def test_a_reference_set_gives_its_line_to_a_picometre(place, far):
    z = np.linspace(-250, 250, 41) ** 3 / 250**2
    normals = np.tile(np.eye(3)[:2], (41, 1, 1))
    surface = np.column_stack([np.zeros((41, 2)), z])
    placed = place(surface, normals, np.zeros((41, 2, 0)), form=0.01, seed=5, far=far)
    line = fit_line(placed.points)
    assert np.linalg.norm(np.cross(line.direction, placed.axis)) * 250 < 1e-9
    assert np.linalg.norm(np.cross(line.point - placed.origin, placed.axis)) < 1e-9


def test_in_a_plane_it_is_the_total_least_squares_line_of_its_closed_form():
    rng = np.random.default_rng(2)
    x, y = rng.normal(size=(2, 50)) * [[30.0], [1.0]]
    line = fit_line(np.column_stack([x, y + 0.3 * x]))
    sxx, syy, sxy = np.var(x), np.var(y + 0.3 * x), np.cov(x, y + 0.3 * x, ddof=0)[0, 1]
    assert np.arctan2(line.direction[1], line.direction[0]) == pytest.approx(
        0.5 * np.arctan2(2 * sxy, sxx - syy), abs=1e-14
    )


def test_the_uncertainty_of_direction_and_place_follow_from_the_spread_of_the_points():
    z = np.linspace(-100, 100, 21)
    line = fit_line(np.column_stack([0 * z, 0 * z, z]), u_point=1e-3)
    assert line.u("dx") == pytest.approx(1e-3 / np.sqrt(np.sum(z**2)), rel=1e-12)
    assert line.u("x") == pytest.approx(1e-3 / np.sqrt(21), rel=1e-12)
    assert max(line.u("z"), line.u("dz")) < 1e-15


def test_straightness_in_space_is_the_diameter_that_holds_all_points():
    z = np.arange(8.0)
    turn = z * np.pi / 2
    line = fit_line(np.column_stack([0.01 * np.cos(turn), 0.01 * np.sin(turn), 100 * z]))
    assert line.form_deviation == pytest.approx(0.02, rel=0.3)
    assert line.form_deviation == pytest.approx(2 * np.linalg.norm(line.residuals, axis=1).max(), rel=1e-12)


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


def test_a_cap_flatter_than_its_noise_is_refused():
    rng = np.random.default_rng(4)
    flat = np.column_stack([rng.uniform(-1, 1, (200, 2)), rng.normal(scale=0.01, size=200)])
    with pytest.raises(CmmUqError, match=r"do not determine|does not settle"):
        fit_sphere(flat)


CUBE = np.array([[x, y, z] for x in (0.0, 1) for y in (0.0, 2) for z in (0.0, 3)])
TETRAHEDRON = np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
HEXAGON = np.column_stack([np.cos(np.arange(6) * np.pi / 3), np.sin(np.arange(6) * np.pi / 3)])


@pytest.mark.parametrize(
    ("points", "width"),
    [
        (CUBE, 1.0),
        (TETRAHEDRON, 2.0),  # two opposite edges, not a face and a corner: 4/√3 = 2.31
        (np.array([[5.0, 0], [0, 1], [-5, 0], [0, -1]]), 10 / np.sqrt(26)),  # a rhomb: its area over its side
        (HEXAGON, np.sqrt(3.0)),
        (np.array([[0.0, 0], [4, 0], [0, 3]]), 2.4),  # the height on the hypotenuse
    ],
)
def test_the_width_of_a_body(points, width):
    d = points.shape[1]
    turn = np.linalg.qr(np.random.default_rng(3).normal(size=(d, d)))[0]
    normal, found = narrowest(points @ turn.T + 7)
    assert found == pytest.approx(width, abs=1e-12)
    assert np.ptp(points @ turn.T @ normal) == pytest.approx(width, abs=1e-12)


def test_points_in_one_plane_have_no_width():
    points = np.random.default_rng(1).uniform(size=(20, 2)) @ np.array([[1.0, 0, 1], [0, 2, 1]])
    normal, width = narrowest(points)
    assert width < 1e-13
    assert np.abs(normal @ [1, 0, 1]) + np.abs(normal @ [0, 2, 1]) < 1e-12


TURN = np.arange(24) * np.pi / 12
CIRCLE = np.column_stack([np.cos(TURN), np.sin(TURN)])


def test_a_ring_that_is_not_the_narrowest_is_told():
    width = np.ptp(np.linalg.norm(10 * CIRCLE - [0.5, 0], axis=1))
    ended, better = narrower(10 * CIRCLE, width, np.array([0.5, 0]), 0.0)
    assert ended
    assert better is not None
    assert np.ptp(np.linalg.norm(10 * CIRCLE - better, axis=1)) < width


@pytest.mark.parametrize("seed", range(3))
def test_a_ring_hardly_narrower_far_from_the_middle_of_the_points_is_found(seed):
    # on two thirds of a circle the middle of the points lies 4 mm from the centre
    turn = np.linspace(0, 4, 40)
    radius = 10 + np.random.default_rng(seed).uniform(-0.01, 0.01, 40)
    points = radius[:, None] * np.column_stack([np.cos(turn), np.sin(turn)])
    width = 1.0001 * np.ptp(radius)
    ended, better = narrower(points, width, np.array([30.0, 0]), 0.0)
    assert ended
    assert better is not None
    assert np.ptp(np.linalg.norm(points - better, axis=1)) < width


def test_where_a_strip_is_as_narrow_as_the_ring_the_search_does_not_end():
    points = np.array([[0.0, 0], [1, 0.1], [2, 0], [3, 0.1]])
    assert narrower(points, 0.2, np.zeros(2), 0.0) == (False, None)


def test_beside_square_contacts_a_ring_is_safe_as_far_as_its_curvature_allows():
    # contacts outside at ±x and inside at ±y: a tetrahedron of gradients about zero, whose nearest face is κ away
    gradients = np.array([[-1.0, 0, -1], [1, 0, -1], [0, 1, 1], [0, -1, 1]])
    kappa = min(_face_distance(np.delete(gradients, i, axis=0)) for i in range(4))
    assert safe_radius(gradients, 10.0) == pytest.approx(20 * kappa / (1 + 2 * kappa))


def _face_distance(corners: np.ndarray) -> float:
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    return float(abs(corners[0] @ normal) / np.linalg.norm(normal))


def test_fewer_contacts_make_nothing_safe():
    assert safe_radius(np.eye(3)[:2], 10.0) == 0


def test_the_largest_empty_circle_lies_among_points_all_round():
    centre, radius = largest_empty(10 * CIRCLE + 1e-3 * np.cos(3 * TURN)[:, None] * CIRCLE)
    assert radius == pytest.approx(10 - 1e-3, abs=2e-5)  # three lobes inward at 60°, 180°, 300°
    np.testing.assert_allclose(centre, 0, atol=1e-9)


def test_points_on_less_than_half_a_circle_surround_none():
    found = largest_empty(10 * CIRCLE[:9])
    assert found is None or found[1] < 5


def test_points_on_a_line_surround_none():
    assert largest_empty(np.outer(np.arange(5.0), [1, 2])) is None


@pytest.mark.parametrize(
    ("fit", "points", "message"),
    [
        (fit_line, [[1.0, 2, 3]], "1 points are too few. Measure at least 2"),
        (fit_line, np.ones((4, 3)), "in one place"),
        (fit_plane, np.eye(3)[:2], "2 points are too few. Measure at least 3"),
        (fit_plane, np.outer(np.arange(5.0), [1, 1, 0]), "lie on one line"),
        (fit_circle, np.eye(2), "2 points are too few. Measure at least 3"),
        (fit_circle, np.outer(np.arange(5.0), [1, 2]), "lie on one line"),
        (fit_circle, np.outer(np.arange(5.0), [1, 2, 0]), "lie on one line"),
        (fit_sphere, np.eye(3), "3 points are too few. Measure at least 4"),
        (fit_sphere, np.outer(np.arange(6.0), [1, 2, 3]), "lie on one line"),
        (fit_sphere, np.column_stack([np.cos(np.arange(9)), np.sin(np.arange(9)), np.full(9, 4.0)]), "lie in one plane"),
        (fit_sphere, np.full((5, 3), np.inf), "point 1 has a coordinate that is no finite number"),
        (fit_sphere, np.zeros((5, 2)), r"shape \(5, 2\)"),
        (fit_sphere, np.zeros((7, 3)), "lie on one line"),
        (fit_cylinder, np.eye(4, 3), r"4 points are too few\. Measure at least 5"),
        (fit_cylinder, 5 * CIRCLE @ np.eye(2, 3), r"in one plane\. Measure points out of that plane too"),
        (fit_cone, np.eye(5, 3), r"5 points are too few\. Measure at least 6"),
    ],
)  # fmt: skip
def test_points_that_cannot_make_a_feature_are_refused_with_what_is_missing(fit, points, message):
    with pytest.raises(CmmUqError, match=message):
        fit(points)
