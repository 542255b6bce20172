"""A placing is the artefact set up as a rigid body, and nothing else."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.spatial.transform import Rotation

from cmm_uq.analysis.planning.set_up import Pattern, append, attitude_along, join, split
from cmm_uq.artefacts.ballbar import ballbar
from cmm_uq.artefacts.gauge_lines import gauge
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats
from tests.analysis.planning.plans import BALLBAR, GAUGE, MACHINE, setting

directions = st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda d: np.linalg.norm(d) > 0.1)


def distances(xyz: Floats) -> Floats:
    return np.asarray(np.linalg.norm(xyz[:, None] - xyz[None], axis=2))


@given(direction=directions, seed=st.integers(0, 1000))
def test_setting_up_keeps_every_distance(direction: tuple[float, float, float], seed: int) -> None:
    body = np.random.default_rng(seed).normal(0, 100, (6, 3))
    pattern = Pattern(body, np.arange(1, 7), np.ones(6, dtype=np.int64))
    placing = pattern.placed(
        MACHINE, attitude_along(np.array(direction)), np.array([400.0, 300.0, -200.0]), "somewhere"
    )
    np.testing.assert_allclose(distances(placing.points.xyz), distances(body), atol=1e-9)


@given(direction=directions)
def test_an_attitude_is_a_rotation_with_its_first_axis_along_the_direction(
    direction: tuple[float, float, float],
) -> None:
    attitude = attitude_along(np.array(direction))
    np.testing.assert_allclose(attitude.T @ attitude, np.eye(3), atol=1e-12)
    assert np.linalg.det(attitude) == pytest.approx(1.0)
    np.testing.assert_allclose(attitude[:, 0], direction / np.linalg.norm(direction), atol=1e-12)


@given(seed=st.integers(0, 1000))
def test_a_recorded_placing_is_its_pattern_set_up_where_it_was_recorded(seed: int) -> None:
    random = np.random.default_rng(seed)
    chosen = setting(GAUGE, length_mm=400.0, both_ways=True, repeats=1)
    turned = Rotation.random(random_state=seed).as_matrix()
    placed = gauge(np.array([20.0, 100.0, 400.0]), chosen.plan).placed(
        MACHINE, turned, random.uniform(-100, 100, 3), "recorded"
    )
    pattern, attitude, middle = Pattern.of_recording(placed.points)
    again = pattern.placed(MACHINE, attitude, middle, "again").points
    np.testing.assert_allclose(again.xyz, placed.points.xyz, atol=1e-9)
    for axis in "xyz":
        np.testing.assert_array_equal(again.columns[f"approach_{axis}"], placed.points.columns[f"approach_{axis}"])


def test_faces_met_on_the_way_back_are_approached_from_the_other_side() -> None:
    """Travel along −X −X …: the sign of every axis that the line moves in turns round."""
    plan = setting(GAUGE, length_mm=400.0, both_ways=True, repeats=1).plan
    points = gauge(np.array([100.0, 400.0]), plan).placed(
        MACHINE, attitude_along(np.array([1.0, -1.0, 0.0])), np.zeros(3), "line"
    ).points  # fmt: skip
    assert points.columns["reference_mm"].tolist() == [0, 100, 400, 400, 100, 0]
    assert points.columns["approach_x"].tolist() == [1, 1, 1, -1, -1, -1]
    assert points.columns["approach_y"].tolist() == [-1, -1, -1, 1, 1, 1]
    assert points.columns["approach_z"].tolist() == [0] * 6


def test_placings_are_numbered_and_timed_in_the_order_of_measurement() -> None:
    chosen = setting(BALLBAR, repeats=2)
    pattern = ballbar(BALLBAR, chosen.plan)
    placings = [pattern.placed(MACHINE, attitude_along(np.eye(3)[i]), np.zeros(3), str(i)) for i in range(3)]
    points = join(placings, seconds_per_point=10, minutes_per_placing=5, columns={"temp_x_c": 21.0}, first=4)
    assert np.unique(points.measurement).tolist() == [4, 5, 6]
    # five minutes of setting up, then four points ten seconds apart, three times over
    assert points.columns["time_s"].tolist() == [300, 310, 320, 330, 640, 650, 660, 670, 980, 990, 1000, 1010]
    assert set(points.columns["temp_x_c"].tolist()) == {21.0}
    assert [len(placing.points) for placing in split(points)] == [4, 4, 4]
    later = append(points, placings[:1])
    assert np.unique(later.measurement).tolist() == [4, 5, 6, 7]


def test_a_plan_without_placings_is_refused() -> None:
    with pytest.raises(CmmUqError, match="without placings"):
        join([])
