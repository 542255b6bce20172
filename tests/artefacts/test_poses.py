"""Planned poses: nothing stands in their way, expected uncertainties are those of an own Jacobian, more go on from a station.

Kinematics are products of 4 × 4 matrices, and boxes are looked into at many places of each link.
"""

from __future__ import annotations

import csv
import io
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from cmm_uq.app.commands.jobs.new import new_job, write_new
from cmm_uq.app.commands.plan import plan_outcome, recording_to_be, write_plan
from cmm_uq.app.commands.planning import MeasurementPlan, make_plan
from cmm_uq.app.commands.reading import job_of
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats
from cmm_uq.jobs.job import Job
from cmm_uq.machine.physics.stated import physics_of

SECOND, NOISE = np.pi / 180 / 3600, 0.04
ROWS = (
    (150.0, -90.0, 475.0, 0.0), (600.0, 0.0, 0.0, -90.0), (120.0, -90.0, 0.0, 0.0), (0.0, 90.0, 720.0, 0.0),
    (0.0, -90.0, 0.0, 0.0), (0.0, 0.0, 85.0, 180.0),
)  # fmt: skip
TOOL, STATION = np.array([30.0, 0.0, 120.0]), np.array([2500.0, -1500.0, 600.0])
BOX = np.array([[500.0, -400.0, 0.0], [1200.0, 400.0, 500.0]])
OF_ROW = {"length": 0, "twist": 1, "offset": 2, "zero": 3, "parallelism": 4}
CELL = f"""
[plan.poses]
floor_mm = 100.0
clearance_mm = 40.0
station_mm = {STATION.tolist()}
opening = [0.0, 0.0, 1.0]
acceptance_deg = 70.0
[[plan.poses.obstacle]]
low_mm = {BOX[0].tolist()}
high_mm = {BOX[1].tolist()}
"""


def planned(plan: str, *, recorded: bool = False, change: tuple[str, str] = ("", "")) -> Job:
    files = new_job("tracked_points", {}, id="robot")
    text = files["job.toml"].decode().replace('u_um = "10 + 5·L/1000"', "u_um = 0.001").replace(*change)
    text = (
        text.replace("[recording]", f"[recording]\nu_coordinate_um = {1000 * NOISE}")
        + "\n[plan]\nrepeats = 1\nplacing_um = 0\n"
    )
    files = {"job.toml": (text + plan).encode(), **({"recording.csv": files["recording.csv"]} if recorded else {})}
    if recorded:
        files["recording.csv"] = files["recording.csv"].partition(b"\n")[2]
    return job_of(files, recorded=False)


def plan_of(job: Job) -> MeasurementPlan:
    with physics_of(job):
        return make_plan(job, power=False)


@cache
def in_the_cell() -> MeasurementPlan:
    return plan_of(planned(f'criterion = "D"\nnumber = 16\n{CELL}'))


def frames(q: Floats, rows: Floats, tool: Floats) -> list[Floats]:
    """Frames 4 × 4 after d and after a of each joint, and the tool's; ``rows`` (6, 5) mm and rad, ``q`` (6,) rad."""
    frame, found = np.eye(4), [np.eye(4)]
    for (a, alpha, d, theta, beta), reading in zip(rows, q, strict=True):
        t, (ca, sa), (cb, sb) = theta + reading, *((np.cos(x), np.sin(x)) for x in (alpha, beta))
        frame = frame @ np.array(
            [[np.cos(t), -np.sin(t), 0, 0], [np.sin(t), np.cos(t), 0, 0], [0, 0, 1, d], [0, 0, 0, 1]]
        )
        found.append(frame)
        frame = frame @ np.array([[1, 0, 0, a], [0, ca, -sa, 0], [0, sa, ca, 0], [0, 0, 0, 1]])
        frame = frame @ np.array([[cb, 0, sb, 0], [0, 1, 0, 0], [-sb, 0, cb, 0], [0, 0, 0, 1]])
        found.append(frame)
    end = frame.copy()
    end[:3, 3] += frame[:3, :3] @ tool
    return [*found, end]


def along(chain: list[Floats]) -> tuple[Floats, Floats]:
    """Corners of the links that move, from the top of the base on, and many places along them."""
    corners = np.array([frame[:3, 3] for frame in chain[1:]])
    return corners, (corners[:-1] + np.linspace(0, 1, 400)[:, None, None] * np.diff(corners, axis=0)).reshape(-1, 3)


def nominal() -> Floats:
    return np.column_stack([np.array(ROWS) * [1, np.pi / 180, 1, np.pi / 180], np.zeros(6)])


def readings(plan: MeasurementPlan) -> Floats:
    points = plan.outlook.points
    return np.radians(np.column_stack([points.columns[f"q{i}_deg"] for i in range(1, 7)]))


def test_no_link_enters_a_box_or_the_floor_and_the_reflector_is_seen() -> None:
    poses = readings(in_the_cell())
    assert len(poses) == 16
    low, high = np.array([[-90, -40, -50, -120, -90, -150], [90, 60, 50, 120, 90, 150]]) * np.pi / 180
    assert np.all((poses >= low - 1e-9) & (poses <= high + 1e-9))
    for q in poses:
        chain = frames(q, nominal(), TOOL)
        corners, links = along(chain)
        assert links[:, 2].min() > 140.0 - 1e-6
        assert not np.any(np.all((links > BOX[0] - 39.99) & (links < BOX[1] + 39.99), axis=1))
        beam = STATION - corners[-1]
        assert beam @ chain[-1][:3, 2] > np.cos(np.radians(70.0)) * np.linalg.norm(beam)
        sight = corners[-1] + np.linspace(0, 1, 2000)[:, None] * beam
        assert not np.any(np.all((sight > BOX[0]) & (sight < BOX[1]), axis=1))
        others = along(chain[:-1])[1]
        others = others[(others - corners[-1]) @ beam > 45.0 * np.linalg.norm(beam)]
        if len(others):
            off = np.linalg.norm(np.cross(others - corners[-1], beam), axis=1) / np.linalg.norm(beam)
            assert off.min() > 35.0  # taken at 32 places of a link


@pytest.mark.long
def test_without_a_cell_such_poses_are_chosen() -> None:
    poses = readings(plan_of(planned('criterion = "D"\nnumber = 25\n')))
    links = np.concatenate([along(frames(q, nominal(), TOOL))[1] for q in poses])
    assert links[:, 2].min() < 140.0
    assert np.any(np.all((links > BOX[0]) & (links < BOX[1]), axis=1))


def jacobian(plan: MeasurementPlan, poses: Floats) -> Floats:
    """(3 n, p + 6) by central differences, in µm and ″, and the six freedoms of the tracker's frame."""
    found = plan.outlook.identifiability
    assert found is not None
    columns = []
    for parameter in found.parameters:
        name, part = parameter.unknown.key
        rows, tool = np.zeros((6, 5)), np.zeros(3)
        if name == "tool_offset":
            tool["xyz".index(part[0])] = 1e-3
        else:
            kind, joint = name.split("_q")
            rows[int(joint) - 1, OF_ROW[kind]] = 1e-3 if kind in ("length", "offset") else SECOND
        ends = ([frames(q, nominal() + s * rows, TOOL + s * tool)[-1][:3, 3] for q in poses] for s in (1.0, -1.0))
        plus, minus = map(np.array, ends)
        columns.append((0.5 * (plus - minus)).ravel())
    at = np.array([frames(q, nominal(), TOOL)[-1][:3, 3] for q in poses])
    columns += [np.tile(np.eye(3)[i], len(poses)) for i in range(3)]
    columns += [np.cross(np.eye(3)[i], at / 1000).ravel() for i in range(3)]
    return np.column_stack(columns)


def test_expected_uncertainties_are_those_of_an_own_jacobian() -> None:
    plan = in_the_cell()
    assert plan.outlook.identifiability is not None
    design = jacobian(plan, readings(plan)) / NOISE
    covariance = np.linalg.inv(design.T @ design)
    u = [parameter.u for parameter in plan.outlook.identifiability.parameters]
    assert len(u) == 21
    assert_allclose(u, np.sqrt(np.diag(covariance))[:21], rtol=2e-5)


def test_places_at_further_poses_are_as_uncertain_as_an_own_jacobian_says() -> None:
    plan = in_the_cell()
    further, found = plan.setting.planning.held_out, plan.outlook.predicted
    assert further is not None
    assert found is not None
    columns = [np.concatenate([one.points.columns[f"q{i}_deg"] for one in further(plan.setting)]) for i in range(1, 7)]
    design, there = jacobian(plan, readings(plan)) / NOISE, jacobian(plan, np.radians(np.column_stack(columns)))
    prior = [*(1 / p.unknown.prior_sd**2 for p in plan.outlook.identifiability.parameters), *[0.0] * 6]  # type: ignore[union-attr]
    covariance = np.linalg.inv(design.T @ design + np.diag(prior))
    assert_allclose(found.ravel(), np.sqrt(np.einsum("mi,ij,mj->m", there, covariance, there)), rtol=2e-4)


def test_the_best_poses_determine_more_than_even_ones() -> None:
    plan = in_the_cell()
    assert plan.better is not None
    assert plan.start.identifiability is not None
    assert plan.better.identifiability is not None
    pairs = zip(plan.better.identifiability.parameters, plan.start.identifiability.parameters, strict=True)
    ratios = [p.u / q.u for p, q in pairs if p.u and q.u]
    assert np.exp(np.mean(np.log(ratios))) < 0.85


def test_more_poses_go_on_from_the_recorded_station() -> None:
    job = planned('criterion = "D"\nmore = 4\n', recorded=True)
    plan = plan_of(job)
    rows = list(csv.DictReader(io.StringIO(recording_to_be(plan).decode().partition("\n")[2])))
    assert [(row["measurement"], row["point"]) for row in rows] == [("1", str(61 + i)) for i in range(4)]
    recorded, station = job.points, np.array([2000.0, -500.0, 300.0])  # of the first recording of a new job
    turn = np.array([[0.8, 0.6, 0.0], [-0.6, 0.8, 0.0], [0.0, 0.0, 1.0]])
    seen = np.array([[float(row[f"reference_{a}_mm"]) for a in "xyz"] for row in rows])
    xyz = np.array([[float(row[f"{a}_mm"]) for a in "xyz"] for row in rows])
    assert np.linalg.norm(seen - (xyz @ turn + station), axis=1).max() < 0.5  # of a recording with noise
    first, then = plan.start.identifiability, plan.outlook.identifiability
    assert first is not None
    assert then is not None
    assert all(q.u < p.u for p, q in zip(first.parameters, then.parameters, strict=True) if p.u and q.u)
    assert len(recorded) == 60


REFUSED = {
    "floor": ("[plan.poses]\nfloor_mm = 5000", "go below the floor", "floor_mm"),
    "box": ("[[plan.poses.obstacle]]\nlow_mm = [-5e3, -5e3, -5e3]\nhigh_mm = [5e3, 5e3, 5e3]", "enter an obstacle",
            "obstacle"),
    "hidden": ("[plan.poses]\nstation_mm = [9000, 0, 0]\n[[plan.poses.obstacle]]\nlow_mm = [4e3, -9e3, -9e3]\n"
               "high_mm = [5e3, 9e3, 9e3]", "hide the reflector", "station_mm"),
    "turned": ("[plan.poses]\nstation_mm = [9000, 0, 0]\nopening = [0, 0, 1]\nacceptance_deg = 0.01",
               "turn the reflector away", "opening"),
    "volume": ("volume_mm = { x = [9000, 9500] }", "leave volume_mm", "volume_mm"),
    "inside out": ("[[plan.poses.obstacle]]\nlow_mm = [0, 0, 0]\nhigh_mm = [1, 0, 1]", "has no inside",
                   "low_mm below high_mm"),
    "opening": ("[plan.poses]\nopening = [0, 0, 1]", "needs a tracker", "station_mm"),
    "nowhere": ("[plan.poses]\nstation_mm = [9000, 0, 0]\nopening = [0, 0, 0]", "no direction", "opening"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_what_stands_in_the_way_of_every_pose_is_said(case: str) -> None:
    keys, said, fix = REFUSED[case]
    with pytest.raises(CmmUqError) as error:
        plan_of(planned(keys))
    assert said in str(error.value)
    assert fix in str(error.value)


def test_poses_of_a_joint_without_travel_and_of_two_stations_are_refused() -> None:
    with pytest.raises(CmmUqError, match=r"\[\[machine.joint\]\] travel: the travel of axis q1 is needed"):
        plan_of(
            planned(
                "",
                change=(
                    "theta_deg = 0.0, travel = [-90.0, 90.0] }, { a_mm = 600.0",
                    "theta_deg = 0.0 }, { a_mm = 600.0",
                ),
            )
        )
    job = planned("", recorded=True)
    twice = job.points.measurement.copy()
    twice[30:] = 2
    object.__setattr__(job.points, "measurement", twice)
    with pytest.raises(CmmUqError, match=r"several stations.*measurements_aside"):
        plan_of(job)


@pytest.mark.long
def test_the_sense_of_the_last_move_is_planned_where_play_is_looked_for() -> None:
    named = ('"zero_q2", ', '"zero_q2", "slack_q3", ')
    points = plan_of(planned('criterion = "D"\nnumber = 12\n', change=named)).outlook.points
    assert set(points.columns["approach_q3"]) == {-1.0, 1.0}
    assert "approach_q1" not in points.columns


MACHINES = {
    "three carriages": ("", ("scale_x", "squareness_xy"), ("x", "y", "z")),
    "with a table": ('chain = "XYZ|C"\ntable = { axis_mm = [250, 250, 0] }\n', ("rotary_location_c_x", "rotary_tilt_c_y"),
                     ("c",)),
}  # fmt: skip


@pytest.mark.parametrize("case", MACHINES)
def test_other_machines_are_planned_too(case: str) -> None:
    chain, effects, axes = MACHINES[case]
    text = f"""[job]\nid = "m"\ndate = 2026-01-01\n[machine]\nname = "M"\n{chain}
travel_mm = {{ x = [0, 500], y = [0, 500], z = [0, 300] }}\n[artefact]\nkind = "tracked_points"\nu_um = 0.5
[recording]\nfile = "recording.csv"\n[model]\neffects = {list(effects)}\n[plan]\ncriterion = "D"\nnumber = 12\n""".replace(
        "'", '"'
    )
    plan = plan_of(job_of({"job.toml": text.encode()}, recorded=False))
    found, read = plan.outlook.identifiability, plan.outlook.points.readings
    assert found is not None
    assert found.complete
    for axis in axes:
        low, high = (0.0, 360.0) if axis == "c" else (10.0, {"x": 490.0, "y": 490.0, "z": 290.0}[axis])
        assert low - 1e-6 <= read[axis].min() < read[axis].max() <= high + 1e-6


def test_a_new_plan_of_poses_is_written_and_its_recording_is_numbered_by_station(tmp_path: Path) -> None:
    write_new(
        "plan", tmp_path / "p", {"artefact": {"kind": "tracked_points"}, "plan": {"number": 12, "candidates": 40}}
    )
    written = write_plan(tmp_path / "p", power=False)
    rows = list(csv.DictReader(io.StringIO(written.files["plan.csv"].read_text().partition("\n")[2])))
    assert [(row["measurement"], row["point"]) for row in rows] == [("1", str(i)) for i in range(1, 13)]
    text = written.files[next(name for name in written.files if name.endswith("html"))].read_text(encoding="utf-8")
    assert "Looked at are poses alone" in text
    assert "At 100 further poses" in text


def test_results_tell_how_well_further_poses_are_predicted() -> None:
    outcome = plan_outcome(planned('criterion = "D"\nnumber = 8\n'), power=False)
    start, better = (outcome.results[name]["held_out"] for name in ("start", "better"))
    assert start["poses"] == better["poses"] == 100
    assert better["u_rms_um"] < start["u_rms_um"] < start["u_largest_um"]
