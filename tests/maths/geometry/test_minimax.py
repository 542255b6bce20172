"""Least of the largest: corners, optima held by curvature, and saddles that only look like optima."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.maths.geometry.minimax import least_largest


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
