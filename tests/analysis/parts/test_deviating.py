"""Distances of measured points from their features where they are known; positive is out of the material."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cmm_uq.analysis.parts.deviating import deviations_of
from cmm_uq.analysis.parts.plan import Feature, Nominal, Plan
from tests.parts_drawn import UP, circle, plane, spot

X = np.array([1.0, 0, 0])


@pytest.mark.parametrize("hole", [True, False])
def test_lobes_of_a_circle(hole: bool) -> None:
    """Three lobes of 5 µm out of the material of a shaft, or of a hole, where that is towards the axis."""
    feature = circle("c", [10.0, 20.0, 0.0], 15.0, 24, hole=hole)
    lobes = 5e-3 * np.cos(3 * 2 * np.pi * np.arange(24) / 24)
    found = deviations_of(Plan((feature,), ()), feature.points + lobes[:, None] * feature.normals)
    np.testing.assert_allclose(found, lobes, atol=1e-8)


@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_a_plane_in_either_sense(sense: float) -> None:
    """A saddle, to which a plane through its middle is the least-squares one, on a plane that leans and is shifted."""
    feature = plane("A", sense * UP, [-30.0, -30.0, 0.0], [[60.0, 0, 0], [0, 60.0, 0]])
    x, y = feature.points[:, 0], feature.points[:, 1]
    saddle = 4e-3 * x * y / 900
    moved = feature.points + np.outer(saddle * sense + 1e-5 * x + 0.01, UP)
    np.testing.assert_allclose(deviations_of(Plan((feature,), ()), moved), saddle, atol=1e-9)


def test_a_line_on_a_surface() -> None:
    at = np.linspace(-40, 40, 9)
    points, normals = np.outer(at, X), np.tile([0.0, 1.0, 0.0], (9, 1))
    feature = Feature("l", "line", points, normals, "stylus", Nominal(np.zeros(3), X))
    bow = 3e-3 * ((at / 40) ** 2 - np.mean((at / 40) ** 2))
    moved = points + (bow + 2e-5 * at + 0.2)[:, None] * normals + np.outer(at, [0, 0, 1e-4])
    np.testing.assert_allclose(deviations_of(Plan((feature,), ()), moved), bow, atol=1e-8)


def test_features_that_their_points_just_determine_have_none() -> None:
    three = circle("c", [0.0, 0.0, 0.0], 10.0, 3)
    plan = Plan((spot("p", [1.0, 2.0, 3.0]), three, replace(circle("d", [0.0, 50.0, 0.0], 10.0, 8))), ())
    found = deviations_of(plan, plan.points)
    assert np.isnan(found[:4]).all()
    np.testing.assert_allclose(found[4:], 0, atol=1e-9)
