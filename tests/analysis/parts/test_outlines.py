"""Features as lines: every point of an outline lies on the feature, and edges are where a view shows them."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.analysis.parts.plan import Nominal, PartFeature
from cmm_uq.analysis.parts.setup import outline
from cmm_uq.base.points import Floats
from tests.parts_drawn import UP, bore, circle, plane, spot

CENTRE = np.array([60.0, 40.0, 0.0])
ALONG_X, ALONG_Y = np.array([1.0, 0, 0]), np.array([0.0, 1.0, 0])


def radii(points: Floats) -> Floats:
    return np.asarray(np.linalg.norm((points - CENTRE)[:, :2], axis=1))


def test_a_bore_is_two_circles_and_the_lines_at_its_edge() -> None:
    """Seen along y it reaches from 45 to 75 mm in x, from −20 to −3 mm in z."""
    lines = outline(bore("b", CENTRE, 15.0), ALONG_Y)
    assert len(lines) == 4
    for line in lines:
        np.testing.assert_allclose(radii(line), 15.0, atol=1e-9)
    assert [sorted(set(np.round(line[:, 2], 9))) for line in lines] == [[-20.0], [-3.0], [-20.0, -3.0], [-20.0, -3.0]]
    edges = sorted(line[0, 0] for line in lines[2:])
    np.testing.assert_allclose(edges, [45.0, 75.0])
    np.testing.assert_allclose([line[:, 1] for line in lines[2:]], 40.0)


def test_seen_end_on_a_bore_is_its_circles_alone() -> None:
    assert len(outline(bore("b", CENTRE, 15.0), UP)) == 2


def test_a_circle_is_one_line() -> None:
    (line,) = outline(circle("c", CENTRE, 8.0), ALONG_X)
    np.testing.assert_allclose(radii(line), 8.0)
    np.testing.assert_allclose(line[:, 2], 0.0, atol=1e-12)


def test_a_plane_is_the_border_of_its_points() -> None:
    feature = plane("A", UP, [5.0, 5.0, 0.0], [[110.0, 0, 0], [0, 70.0, 0]])
    (line,) = outline(feature, UP)
    np.testing.assert_allclose(line[0], line[-1])
    x, y = line[:, 0], line[:, 1]
    area = 0.5 * abs(np.sum(x[:-1] * y[1:] - x[1:] * y[:-1]))
    assert area == pytest.approx(110.0 * 70.0)


def test_a_cone_widens_by_the_tangent_of_half_its_angle() -> None:
    at = np.array([[10.0, 0, 0], [0, 10.0, 0], [-10.0, 0, 0], [0, -10.0, 0], [14.0, 0, 4.0], [0, 14.0, 4.0]])
    normals = np.tile(UP, (6, 1))
    feature = PartFeature("k", "cone", at, normals, "stylus", Nominal(np.zeros(3), UP, 20.0, np.pi / 4))
    low, high, *_ = outline(feature, ALONG_Y)
    np.testing.assert_allclose(np.linalg.norm(low[:, :2], axis=1), 10.0)
    np.testing.assert_allclose(np.linalg.norm(high[:, :2], axis=1), 14.0)
    np.testing.assert_allclose(high[:, 2], 4.0)


@pytest.mark.parametrize("view", [UP, ALONG_X, np.array([0.6, 0.0, 0.8])])
def test_a_sphere_is_the_circle_across_the_view(view: Floats) -> None:
    at = 12.0 * np.array([[1.0, 0, 0], [0, 1.0, 0], [-1.0, 0, 0], [0, 0, 1.0]])
    (line,) = outline(PartFeature("s", "sphere", at, at / 12, "stylus", Nominal(np.zeros(3), None, 24.0)), view)
    np.testing.assert_allclose(np.linalg.norm(line, axis=1), 12.0)
    np.testing.assert_allclose(line @ view, 0.0, atol=1e-12)


def test_a_line_goes_from_its_first_to_its_last_point_and_a_point_is_none() -> None:
    at = np.array([[30.0, 0, 0], [0.0, 0, 0], [90.0, 0, 0]])
    feature = PartFeature("l", "line", at, np.tile(UP, (3, 1)), "stylus", Nominal(np.zeros(3), ALONG_X))
    (line,) = outline(feature, UP)
    np.testing.assert_allclose(line, [[0, 0, 0], [90, 0, 0]])
    assert outline(spot("p", [0, 0, 0]), UP) == []


def test_a_plane_of_points_in_a_row_is_that_row() -> None:
    at = np.array([[0.0, 0, 0], [10.0, 0, 0], [20.0, 0, 0], [30.0, 0, 0]])
    feature = PartFeature("A", "plane", at, np.tile(UP, (4, 1)), "stylus", Nominal(np.zeros(3), UP))
    (line,) = outline(feature, UP)
    assert sorted(line[:, 0]) == [0.0, 30.0]
