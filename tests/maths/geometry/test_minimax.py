"""Least of the largest: corners, optima held by curvature, saddles; distances and derivatives of every shape."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.maths.geometry.minimax import least_largest
from cmm_uq.maths.geometry.placed import CIRCLE, CONE, CYLINDER, LINE, LINE_IN_PLANE, PLANE, SPHERE


def distances(points):
    def rows(s):
        away = s - points
        d = np.linalg.norm(away, axis=1)
        return d, away / d[:, None]

    return rows


def test_two_points_far_apart_hold_the_smallest_circle_by_its_curvature():
    points = np.array([[0.0, 0], [2, 0], [1, 0.4], [0.8, -0.3]])
    found = least_largest(distances(points), np.array([0.7, 0.2]))
    assert found.proved
    np.testing.assert_allclose(found.state, [1, 0], atol=1e-11)
    assert found.value == pytest.approx(1, abs=1e-12)
    assert sorted(found.contacts) == [0, 1]
    np.testing.assert_allclose(found.multipliers, 0.5, atol=1e-11)


def test_three_points_hold_it_where_their_triangle_is_acute():
    points = np.array([[0.0, 0], [2, 0], [1, np.sqrt(3)], [1, 0.5]])
    found = least_largest(distances(points), np.array([0.5, 0.5]))
    assert found.proved
    np.testing.assert_allclose(found.state, [1, 1 / np.sqrt(3)], atol=1e-11)
    np.testing.assert_allclose(found.multipliers, 1 / 3, atol=1e-10)


def hills(s):
    """|y| − x² and x² − 2: a saddle at zero, the least, −1, at x = ±1."""
    x, y = s
    return np.array([y - x * x, -y - x * x, x * x - 2]), np.array([[-2 * x, 1], [-2 * x, -1], [2 * x, 0]])


def test_a_saddle_is_left():
    found = least_largest(hills, np.array([0.2, 0.1]))
    assert found.proved
    np.testing.assert_allclose(np.abs(found.state), [1, 0], atol=1e-11)
    assert found.value == pytest.approx(-1, abs=1e-11)


def test_where_a_descent_stays_on_a_saddle_it_is_not_proved():
    found = least_largest(hills, np.zeros(2))
    assert not found.proved or found.value == pytest.approx(-1, abs=1e-11)


def test_what_has_no_least_is_not_proved():
    points = np.array([[0.0, 0], [2, 0], [1, 0.1]])

    def inside(s):
        d, slopes = distances(points)(s)
        return -d, -slopes

    # away from points that do not surround it a circle grows without end
    assert not least_largest(inside, np.array([1.0, -0.5])).proved


STATES = {
    "line in a plane": (LINE_IN_PLANE, 2, [0.3, -0.2]),
    "plane": (PLANE, 3, [0.3, -0.2, 0.1]),
    "circle": (CIRCLE, 2, [0.4, -0.3, 5.0]),
    "sphere": (SPHERE, 3, [0.4, -0.3, 0.2, 5.0]),
    "line": (LINE, 3, [0.4, -0.3, 0.1, -0.2]),
    "cylinder": (CYLINDER, 3, [0.4, -0.3, 0.1, -0.2, 5.0]),
    "cone": (CONE, 3, [0.4, -0.3, 0.1, -0.2, 5.0, 0.3]),
}


def points(d: int) -> np.ndarray:
    return np.random.default_rng(2).uniform(-9, 9, (d, 3, 20))


@pytest.mark.parametrize(("shape", "d", "state"), STATES.values(), ids=STATES.keys())
def test_derivatives_are_what_differences_say(shape, d, state):
    states = np.array(state) + np.random.default_rng(1).normal(scale=0.01, size=(3, len(state)))
    local = points(d)
    J = shape.distances(states, local)[1]
    for j in range(len(state)):
        step = 1e-6 * np.eye(len(state))[j]
        up, down = shape.distances(states + step, local)[0], shape.distances(states - step, local)[0]
        np.testing.assert_allclose(J[j] + np.zeros_like(up), (up - down) / 2e-6, atol=1e-7)


def test_distances_are_those_of_school_geometry():
    p = points(3)[:, 0]
    w = np.array([0.1, -0.2, 1.0]) / np.sqrt(1.05)
    axis_point = np.array([0.4, -0.3, 0.0])
    across = np.linalg.norm(np.cross(p.T - axis_point, w), axis=1)
    along = (p.T - axis_point) @ w

    def found(name: str, local: np.ndarray) -> np.ndarray:
        shape, _, state = STATES[name]
        return shape.distances(np.array([state]), local[:, None])[0][0]

    np.testing.assert_allclose(found("line", p), across, atol=1e-12)
    np.testing.assert_allclose(found("cylinder", p), across - 5, atol=1e-12)
    # a point of a cone of half angle ψ at height g has the radius (s + g·sin ψ)/cos ψ
    np.testing.assert_allclose(
        found("cone", p), (across - (5 + along * np.sin(0.3)) / np.cos(0.3)) * np.cos(0.3), atol=1e-12
    )
    np.testing.assert_allclose(found("sphere", p), np.linalg.norm(p.T - [0.4, -0.3, 0.2], axis=1) - 5, atol=1e-12)
    normal = np.array([0.2, -0.1, 1.0]) / np.sqrt(1.05)
    np.testing.assert_allclose(found("plane", p), (p.T - [0, 0, 0.3]) @ normal, atol=1e-12)


def test_the_distance_from_a_line_is_smooth_to_least_squares_on_the_line_itself():
    d, J = LINE.distances(np.zeros((1, 4)), np.array([[[0.0, 1e-300]], [[0.0, 0.0]], [[1.0, 2.0]]]))
    assert np.isfinite(J).all()
    np.testing.assert_allclose(d, 0, atol=1e-299)
    z = np.array([-1.0, 0, 4])
    on_axis = np.array([0 * z, 0 * z, z])
    # per component: Σ1, Σz; Σz, Σz²
    np.testing.assert_allclose(LINE.normal_matrix(np.zeros(4), on_axis), np.kron([[3, 3], [3, 17]], np.eye(2)))
