"""Distances and derivatives of every shape, by geometry written out another way and by differences."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.maths.geometry.minimax import CIRCLE, CONE, CYLINDER, LINE, LINE_IN_PLANE, PLANE, SPHERE

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
