"""Features of many points: their derivative by the implicit function theorem is that of the association itself."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from cmm_uq.analysis.parts.association import ProbedFeature
from cmm_uq.analysis.parts.plan import Nominal, PartFeature
from cmm_uq.maths.geometry.repeated import MANY
from tests.parts_drawn import UP, ball, bore, circle, plane

COUNT = MANY + 4


def _cone() -> PartFeature:
    angles, heights = np.linspace(0, 40 * np.pi, COUNT), np.linspace(-15, 15, COUNT)
    out = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(COUNT)])
    points = (20 + heights[:, None] * np.tan(0.3)) * out + heights[:, None] * UP
    normals = np.cos(0.3) * out - np.sin(0.3) * UP
    return PartFeature("cone", "cone", points, normals, "stylus", Nominal(np.zeros(3), UP, 40.0, 0.3))


def _line() -> PartFeature:
    along = np.array([0.6, 0.8, 0.0])
    points = np.linspace(0, 90, COUNT)[:, None] * along
    return PartFeature("line", "line", points, np.tile(UP, (COUNT, 1)), "stylus", Nominal(points.mean(axis=0), along))


def _ball() -> PartFeature:
    toward = np.random.default_rng(5).standard_normal((COUNT, 3))
    return ball("ball", [1.0, 2.0, 3.0], 12.0, toward / np.linalg.norm(toward, axis=1, keepdims=True))


@pytest.mark.parametrize(
    "made",
    [
        lambda: plane("plane", UP, [0, 0, 0], [[120, 0, 0], [0, 80, 0]], (COUNT // 14, 14)),
        lambda: circle("circle", [10, 20, 0], 15.0, COUNT),
        lambda: bore("bore", [10, 20, 0], 8.0, count=COUNT // 3),
        _cone,
        _line,
        _ball,
    ],
)
def test_features_of_many_points_follow_each_coordinate_as_when_it_alone_is_moved(
    made: Callable[[], PartFeature],
) -> None:
    """Second method: each coordinate of some of the points moved by itself, the association settled each time."""
    feature, step = made(), 1e-3
    off = 0.02 * np.random.default_rng(3).standard_normal(feature.points.shape)
    for near in (None, ProbedFeature(feature, feature.points, "least_squares")):
        probed = ProbedFeature(feature, feature.points + off, "least_squares", near)
        assert probed.n > MANY
        for point in (0, 7, probed.n - 1):
            moved = np.zeros((3, probed.n, 3))
            moved[:, point] = step * np.eye(3)
            alone = (probed.of(moved).values - probed.of(-moved).values) / (2 * step)
            np.testing.assert_allclose(probed.derivative[:, point].T, alone, rtol=0, atol=2e-9)
