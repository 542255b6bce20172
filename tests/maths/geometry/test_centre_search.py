"""Rings and empty circles that are known, and searches that cannot come to an end."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.maths.geometry.fits import largest_empty, narrower, safe_radius

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
