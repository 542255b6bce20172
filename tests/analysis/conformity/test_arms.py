"""Tests of arms and robots: what a whole one is, that no row taken away makes one, and jobs as `cmm-uq new` begins them."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import minimize

from cmm_uq.analysis.conformity.standards import BUILT_IN
from cmm_uq.app.commands.jobs.new import write_new
from cmm_uq.app.commands.reading import read_job
from cmm_uq.artefacts import artefact_facts
from cmm_uq.base.arm import Arm
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Machine, Points
from cmm_uq.machine.model.artefact import Artefact
from cmm_uq.maths.geometry.fits import enclosing_diameter
from tests.analysis.conformity.arms_by_hand import ARMS, TETRAHEDRON
from tests.analysis.conformity.by_hand.deciding import data_of_job
from tests.jobs.test_reading import edit


@pytest.mark.parametrize("count", [1, 2, 3, 4, 5, 12, 40])
def test_the_smallest_sphere_holds_all_points_and_none_is_smaller(count: int) -> None:
    for seed in range(20):
        points = np.random.default_rng(seed).normal(0, [1.0, 3.0, 0.2], (count, 3)) + np.array([100.0, -50.0, 7.0])
        found = enclosing_diameter(points)
        another = 2 * np.linalg.norm(points - minimum(points), axis=1).max()
        assert found <= another * (1 + 1e-9) + 1e-9
        assert found == pytest.approx(another, rel=1e-4, abs=1e-6)
        assert found >= max((np.linalg.norm(a - b) for a, b in combinations(points, 2)), default=0.0) - 1e-9


def minimum(points: np.ndarray) -> np.ndarray:
    """Centre of the smallest sphere by another way: the least bound, by sequential quadratic programming."""
    middle, size = points.mean(axis=0), float(np.ptp(points, axis=0).max(initial=0.0)) or 1.0
    points = (points - middle) / size  # near the origin and of unit size, for steps of the search are
    start = np.append(np.zeros(3), 1.0)
    rows = {"type": "ineq", "fun": lambda x: x[3] - np.sum((points - x[:3]) ** 2, axis=1)}
    start[3] = float(np.sum((points - start[:3]) ** 2, axis=1).max())
    found = minimize(lambda x: x[3], start, constraints=[rows], method="SLSQP", options={"ftol": 1e-14, "maxiter": 500})
    return np.asarray(middle + size * found.x[:3])


def test_the_sphere_about_a_tetrahedron_goes_through_its_corners_and_one_about_two_points_is_as_wide_as_they_are() -> (
    None
):
    assert enclosing_diameter(TETRAHEDRON) == pytest.approx(2 * 3**0.5)
    assert enclosing_diameter(np.array([[0.0, 0, 0], [3.0, 0, 0], [1.5, 1.4, 0]])) == pytest.approx(3.0)


def of_points(artefact: Artefact, points: Points) -> Artefact:
    keys = {"sphere": {"length_mm": 25.0, "u_um": 0.1}, "step_gauge": {"length_mm": 1320.0, "u_um": 0.1}}
    facts = artefact_facts(
        kind=artefact.kind, **keys.get(artefact.kind, {} if artefact.kind == "seat" else {"u_um": 0.1})
    )
    return type(artefact)(facts, points)  # type: ignore[call-arg]


def lacks(name: tuple[str, str], artefact: Artefact) -> tuple[str, ...]:
    conditions = BUILT_IN[name[0]].characteristic(name[1]).conditions(artefact, recorded=True)
    return tuple(str(text) for one in conditions for text in one.missing)


def fewer(points: Points, random: np.random.Generator) -> Points:
    """Without a row, a repeat, or a measurement."""
    row = int(random.integers(len(points)))
    same = (
        points.measurement == points.measurement[row],
        points.repeat == points.repeat[row],
        np.arange(len(points)) == row,
    )
    gone = [same[0], same[0] & same[1], same[2]][int(random.integers(3))]
    return points.select(np.flatnonzero(~gone))


@pytest.mark.parametrize("name", ARMS)
def test_what_is_taken_away_never_makes_a_whole_test(name: tuple[str, str]) -> None:
    """Of (c): from whole and from incomplete tests on, nothing that lacks comes back."""
    whole = 0
    for seed in range(25):
        random = np.random.default_rng(seed)
        artefact = ARMS[name](("complete", "incomplete")[seed % 2])[0]
        complete = not lacks(name, artefact)
        whole += complete
        while len(artefact.points) > 8:
            points = fewer(artefact.points, random)
            if not len(points):
                break
            try:
                artefact = of_points(artefact, points)
            except CmmUqError:
                break
            now = not lacks(name, artefact)
            assert complete or not now
            complete = now
    assert whole == 13


@pytest.mark.parametrize("name", ARMS)
def test_without_the_reach_or_on_carriages_no_test_of_an_arm_is_whole(name: tuple[str, str]) -> None:
    if name[0] == "ISO 9283:1998" or name[1] == "effective diameter":
        pytest.skip("it goes by no place in the volume")
    artefact = ARMS[name]("complete")[0]
    there = lacks(name, of_points(artefact, dataclasses.replace(artefact.points, machine=Machine("m"))))
    assert "the reach of the arm, by which places and lengths go" in there


MISSING = {
    ("ISO 10360-12:2016", "L_Dia.5x5:Art:Tact.AArm"): (
        lambda p: ~((p.measurement == 2) & (p.repeat == 5)),
        "5 orientations",
    ),
    ("ISO 10360-12:2016", "E_Bi"): (lambda p: p.measurement != 3, "a vertical one"),
    ("ISO 10360-12:2016", "E_Uni"): (lambda p: p.columns["reference_mm"] < 1300.0, "66 % of the measuring range"),
    ("ISO 10360-12:2016", "P_Form.Sph.1x25::Tact.AArm"): (lambda p: p.measurement == 1, "two places of the sphere"),
    ("ASME B89.4.22-2004", "SPAT"): (lambda p: p.measurement != 1, "0 to 20 % of the reach"),
    ("ASME B89.4.22-2004", "SPAT maximum"): (
        lambda p: (p.measurement != 3) | (p.repeat < 10),
        "80 to 100 % of the reach",
    ),
    ("ASME B89.4.22-2004", "volumetric performance"): (lambda p: p.measurement % 2 == 1, "a bar of 120 to 150 %"),
    ("ASME B89.4.22-2004", "effective diameter"): (lambda p: p.repeat < 3, "3 measurements of one sphere"),
    ("ISO 9283:1998", "RP"): (lambda p: p.point != 4, "5 poses, each commanded 30 times"),
}


@pytest.mark.parametrize("name", MISSING)
def test_what_is_missing_is_named(name: tuple[str, str]) -> None:
    kept, words = MISSING[name]
    artefact = ARMS[name]("complete")[0]
    found = lacks(name, of_points(artefact, artefact.points.select(np.flatnonzero(kept(artefact.points)))))
    assert any(words in text for text in found), found


def test_poses_beside_a_plane_are_no_five_of_the_standard() -> None:
    artefact = ARMS["ISO 9283:1998", "RP"]("complete")[0]
    xyz = artefact.points.xyz.copy()
    off = artefact.points.point == 2
    xyz[off] += [0.0, 60.0, 0.0]
    seen = {"reference_y_mm": artefact.points.columns["reference_y_mm"] + 60.0 * off}
    points = dataclasses.replace(artefact.points, xyz=xyz, columns={**artefact.points.columns, **seen})
    assert lacks(("ISO 9283:1998", "RP"), of_points(artefact, points)) == (
        "a pose in the middle of four others, all in one plane, over a tenth of the reach",
    )


@pytest.mark.parametrize(
    "of", [lambda at: at * [1.0, 0.0, 0.0], lambda at: 0.05 * at], ids=["on a line", "side by side"]
)
def test_poses_on_a_line_or_side_by_side_are_none_of_a_cube(of: Callable[[np.ndarray], np.ndarray]) -> None:
    """A robot repeats well where it hardly moves; five poses within 14 mm of 1 m, or on a line, made a whole test."""
    artefact = ARMS["ISO 9283:1998", "RP"]("complete")[0]
    points = artefact.points
    middle = points.xyz[points.point == 1].mean(axis=0)
    moved = middle + of(points.xyz - middle) - points.xyz
    seen = {f"reference_{a}_mm": points.columns[f"reference_{a}_mm"] + moved[:, i] for i, a in enumerate("xyz")}
    other = dataclasses.replace(points, xyz=points.xyz + moved, columns={**points.columns, **seen})
    assert lacks(("ISO 9283:1998", "RP"), of_points(artefact, other)) == (
        "a pose in the middle of four others, all in one plane, over a tenth of the reach",
    )


def test_cycles_of_several_measurements_are_not_thirty_of_one() -> None:
    """Each station's own mean takes their scatter: 6 µm of pairs where thirty of one station are 10.3 µm."""
    artefact = ARMS["ISO 9283:1998", "RP"]("complete")[0]
    station, cycle = divmod(artefact.points.repeat - 1, 2)
    spread = dataclasses.replace(artefact.points, measurement=station + 1, repeat=cycle + 1)
    assert "5 poses, each commanded 30 times (0)" in lacks(("ISO 9283:1998", "RP"), of_points(artefact, spread))


BEGUN = ("seat", "arm_sphere", "arm_orientations", "arm_lengths", "robot_poses")


@pytest.mark.parametrize("name", BEGUN)
def test_a_new_job_of_an_arm_or_a_robot_is_a_whole_test_that_passes(name: str, tmp_path: Path) -> None:
    job = tmp_path / "job"
    write_new(name, job, {})
    statement = data_of_job(job)  # as whole reports have it: tests/app/commands/test_new.py
    assert (statement["decision"], statement["missing"]) == ("pass", [])


def test_pose_accuracy_is_decided_in_the_frame_of_the_base_alone(tmp_path: Path) -> None:
    job = tmp_path / "job"
    write_new("robot_poses", job, {"conformity": {"characteristic": "AP", "rule": "simple"}})
    statement = data_of_job(job)
    assert statement["decision"] == "incomplete"  # nobody says how its frame was aligned
    assert any("alignment" in text for text in statement["missing"])
    edit(job, r'^frame = "base".*', 'frame = "own"')
    with pytest.raises(CmmUqError, match=re.escape('frame = "base"')):
        data_of_job(job)


@pytest.mark.parametrize(("keys", "said"), [
    ("arm = { tool_mm = [1, 2, 3] }", "give its rows"),
    ('arm = { reach_mm = 900.0 }\nchain = "YXZ"', "chain is of a machine of carriages"),
    ("arm = { reach_mm = 900.0, tool_mm = [1, 2, 3] }", "give its rows"),
])  # fmt: skip
def test_what_does_not_go_with_an_arm_without_joints_is_refused(keys: str, said: str, tmp_path: Path) -> None:
    job = tmp_path / "job"
    write_new("seat", job, {})
    edit(job, r"^arm = .*", keys)
    with pytest.raises(CmmUqError, match=said):
        read_job(job)


def test_a_place_beyond_the_stated_reach_is_refused(tmp_path: Path) -> None:
    """A smaller reach would make two thirds of the measuring range of any length, and far out of any seat."""
    job = tmp_path / "job"
    write_new("seat", job, {})
    edit(job, r"^arm = .*", "arm = { reach_mm = 500.0 }")
    with pytest.raises(CmmUqError, match="from the base, beyond the reach of the arm, 500 mm"):
        read_job(job)


@pytest.mark.parametrize(("degrees", "lack"), [(30.0, ()), (12.0, ()), (8.0, ("5 orientations",))])
def test_orientations_differ_where_joints_were_read(degrees: float, lack: tuple[str, ...]) -> None:
    name = ("ISO 10360-12:2016", "L_Dia.5x5:Art:Tact.AArm")
    artefact = ARMS[name]("complete")[0]
    points = artefact.points
    machine = Arm("a", rows=np.zeros((2, 5)), revolute=np.ones(2, dtype=bool), sense=np.ones(2), reach_mm=1000.0,
                  limits=np.full((2, 2), np.nan))  # fmt: skip
    columns = {**points.columns, "q1_deg": degrees * points.repeat, "q2_deg": np.zeros(len(points))}
    found = lacks(name, of_points(artefact, dataclasses.replace(points, machine=machine, columns=columns)))
    assert [any(words in text for text in found) for words in lack] == [True] * len(lack)
    assert lack or not found


@pytest.mark.parametrize(("degrees", "whole"), [(12.0, True), (4.0, False)])
def test_readings_of_a_seat_differ_where_joints_were_read(degrees: float, *, whole: bool) -> None:
    """Ten readings without a move of the elbow are no articulation."""
    name = ("ASME B89.4.22-2004", "SPAT")
    artefact = ARMS[name]("complete")[0]
    points = artefact.points
    machine = Arm("a", rows=np.zeros((1, 5)), revolute=np.ones(1, dtype=bool), sense=np.ones(1), reach_mm=1000.0,
                  limits=np.full((1, 2), np.nan))  # fmt: skip
    other = dataclasses.replace(points, machine=machine, columns={**points.columns, "q1_deg": degrees * points.repeat})
    assert (len(lacks(name, of_points(artefact, other))) == 0) == whole
