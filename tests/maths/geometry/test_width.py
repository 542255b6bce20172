"""Widths of bodies that are known from school, and of flat clouds."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.maths.geometry.fits import narrowest

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
