"""Machines whose axes lean far, measured by bars: built with plain numpy, estimated by the model.

The machine is its three unit vectors, the Cholesky factor of the cosines between the axes; it indicates the oblique
coordinates of a true point over the true length of its scales' millimetres.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from cmm_uq.artefacts.ballbar import Ballbar
from cmm_uq.base.points import Floats, Machine, Points
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.physics.catalogue import effects
from tests.recordings import TRAVEL, bar_facts, bars

SIX = ("scale_x", "scale_y", "scale_z", "squareness_xy", "squareness_yz", "squareness_zx")
ARCSEC = np.pi / 180 / 3600
LENGTH = 400.0

MACHINES = {
    "600 arcsec each": [0.0, 0.0, 0.0, 600.0, 600.0, 600.0],
    "1500 arcsec each": [0.0, 0.0, 0.0, 1500.0, 1500.0, 1500.0],
    "1500 arcsec of one": [0.0, 0.0, 0.0, -1500.0, 0.0, 0.0],
    "all signs, and scales": [500.0, -500.0, 300.0, 1500.0, -1500.0, 900.0],
}


def vectors(truth: Floats) -> Floats:
    """Rows x, y, z: how far and where the probe goes for one millimetre of each scale."""
    xy, yz, zx = np.cos(np.pi / 2 + ARCSEC * truth[3:])
    unit = np.linalg.cholesky(np.array([[1, xy, zx], [xy, 1, yz], [zx, yz, 1]]))
    return (1 + 1e-6 * truth[:3])[:, None] * unit


def recorded(truth: Floats, sigma: float = 0.0, seed: int = 0, count: int = 60, length: float = LENGTH) -> Points:
    random = np.random.default_rng(seed)
    points = bars(random, count, length, Machine("m", "XYZ", TRAVEL))
    read = points.xyz @ np.linalg.inv(vectors(truth))
    return points.at(read + sigma * random.standard_normal(read.shape))


def model_of(points: Points, length: float | None = LENGTH, sigma: float = 1e-3) -> RecordingModel:
    return RecordingModel(Ballbar(bar_facts(length, 0.5), points), effects(SIX), sigma)


@pytest.mark.parametrize("truth", MACHINES.values(), ids=MACHINES.keys())
def test_exact_bars_give_back_the_machine(truth: list[float]) -> None:
    found = model_of(recorded(np.array(truth))).estimate().least_squares
    np.testing.assert_allclose(found.value[:6], truth, atol=1e-6)
    assert np.abs(found.residuals).max() < 1e-8


@pytest.mark.parametrize("truth", MACHINES.values(), ids=MACHINES.keys())
def test_the_linear_sum_of_the_effects_would_miss_it(truth: list[float]) -> None:
    """The scale of Z would be in error by half the squares of its two angles: 8.5 ppm at 600″, many times its uncertainty."""
    points = recorded(np.array(truth))
    ends = points.xyz.reshape(-1, 2, 3)
    difference = ends[:, 1] - ends[:, 0]
    _, y, z = difference.T
    unit = difference / np.linalg.norm(difference, axis=1, keepdims=True)
    design = np.column_stack([unit * difference, -unit[:, 0] * y, -unit[:, 1] * z, -unit[:, 0] * z])
    values = np.zeros(6)
    for _ in range(20):
        matrix = np.eye(3) + np.diag(values[:3])
        matrix[1, 0], matrix[2, 1], matrix[2, 0] = -values[3:]
        missing = LENGTH - np.linalg.norm(difference @ matrix, axis=1)
        values += np.linalg.lstsq(design, missing, rcond=None)[0]
    u = np.sqrt(np.diag(model_of(points).estimate().least_squares.covariance))
    off = (values / ([1e-6] * 3 + [ARCSEC] * 3) - truth) / u[:6]
    assert np.abs(off).max() > 2


@settings(max_examples=15, deadline=None)
@given(
    st.tuples(*[st.floats(-500, 500)] * 3), st.tuples(*[st.floats(-1500, 1500)] * 3), st.sampled_from(["yzx", "zxy"])
)
def test_axes_by_other_names_are_the_same_axes(scales, squareness, order: str) -> None:
    """What is found does not depend on which axis the frame is laid along: x, y, z renamed in turn."""
    truth = np.array([*scales, *squareness])
    points = recorded(truth, sigma=1e-3, seed=5)
    turn = ["xyz".index(axis) for axis in order]
    renamed = replace(points, xyz=points.xyz[:, turn], machine=Machine("m", "XYZ", TRAVEL[turn]))
    planes = {frozenset("xy"): 3, frozenset("yz"): 4, frozenset("zx"): 5}
    place = [*turn, *(planes[frozenset(order["xyz".index(a)] for a in pair)] for pair in ("xy", "yz", "zx"))]
    one, other = model_of(points).estimate().least_squares, model_of(renamed).estimate().least_squares
    u = np.sqrt(np.diag(one.covariance))[place]
    assert np.all(np.abs(other.value[:6] - one.value[place]) < 0.01 * u)
    np.testing.assert_allclose(np.sqrt(np.diag(other.covariance))[:6], u, rtol=0.01)


def test_an_uncalibrated_bar_leaves_one_common_scale_free_however_the_axes_lean() -> None:
    found = model_of(recorded(np.array(MACHINES["all signs, and scales"])), length=None).estimate().least_squares
    np.testing.assert_allclose(found.null_space[:6, 0], [1, 1, 1, 0, 0, 0], atol=1e-9)
    assert found.determined.tolist() == [False] * 3 + [True] * 3 + [False]
    np.testing.assert_allclose(found.value[3:6], [1500, -1500, 900], atol=1e-6)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10_000))
def test_estimates_of_a_leaning_machine_scatter_as_their_covariance_says(seed: int) -> None:
    """The squared deviation from the truth, weighted by the covariance, follows χ² with six degrees of freedom."""
    truth = np.array(MACHINES["all signs, and scales"])
    found = model_of(recorded(truth, sigma=1e-3, seed=seed)).estimate().least_squares
    deviation, covariance = found.value[:6] - truth, found.covariance[:6, :6]
    certificate = np.zeros(6)
    certificate[:3] = 0.5e-3 / LENGTH * 1e6
    squares = deviation @ np.linalg.solve(covariance - np.outer(certificate, certificate), deviation)
    assert squares < 45  # exceeded by 5 in 10⁸


def test_simulated_bars_have_their_length_in_the_machine_of_these_vectors() -> None:
    truth = np.array(MACHINES["all signs, and scales"])
    simulated = model_of(recorded(np.zeros(6))).predicted(np.array([*truth, LENGTH]))
    ends = (simulated @ vectors(truth)).reshape(-1, 2, 3)
    np.testing.assert_allclose(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1), LENGTH, atol=1e-8)
