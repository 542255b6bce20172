"""ISO 9283: orientations of poses by hand, readings that were copied, and the five poses in a plane."""

from __future__ import annotations

import csv
import itertools
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cmm_uq.analysis.conformity.robots import copied, counting, five_in_a_plane
from cmm_uq.app.commands.jobs.new import write_new
from cmm_uq.artefacts import artefact_facts
from cmm_uq.artefacts.optical.repeated_poses import poses_data
from cmm_uq.artefacts.optical.tracked import TrackedPoints
from cmm_uq.base.arm import Arm
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats, Points
from tests.analysis.conformity.by_hand.deciding import data_of_job
from tests.jobs.test_reading import edit

TIPS = np.array([[100.0, 0.0, 20.0], [-50.0, 80.0, 20.0], [-40.0, -90.0, 35.0], [10.0, 20.0, 90.0]])
ARCSEC_ON_A_METRE = np.pi / 180 / 3600 * 1000.0  # mm


def turned(angles_deg: Floats) -> Floats:
    """By SciPy: about x, then y, then z, of the base."""
    return np.asarray(Rotation.from_euler("xyz", angles_deg, degrees=True).as_matrix())


def reflectors(count: int) -> tuple[Points, Floats]:
    """Two poses four times by some reflectors; with the angles attained, (pose, cycle, 3) °. Nothing else is wrong."""
    random = np.random.default_rng(5)
    wanted, middle = np.array([[170.0, 30.0, -60.0], [-179.999, -45.0, 20.0]]), np.array([900.0, -200.0, 700.0])
    attained = wanted[:, None] + random.normal(0.0, 5.0 / 3600, (2, 4, 3)) + np.array([12.0, -20.0, 7.0]) / 3600
    rows: list[tuple[Any, ...]] = []
    for pose, cycle, tip in itertools.product(range(2), range(4), TIPS[:count]):
        at = middle + 300.0 * pose + turned(wanted[pose]) @ tip
        rows.append((pose + 1, cycle + 1, *tip, *at, *(middle + 300.0 * pose + turned(attained[pose, cycle]) @ tip)))
    table = np.array(rows)
    columns = {f"{of}_{a}_mm": table[:, i + k] for i, of in ((2, "tip"), (8, "reference")) for k, a in enumerate("xyz")}
    one = np.ones(len(table), dtype=np.int64)
    return Points(table[:, 5:8], one, table[:, 0].astype(int), table[:, 1].astype(int), Arm("r"), columns), attained


def figures(points: Points, frame: str = "base") -> dict[str, Floats]:
    every = np.ones(len(points), dtype=bool)
    artefact = TrackedPoints(artefact_facts(kind="tracked_points", frame=frame, u_um=1.0), points)
    return {name: one.values / ARCSEC_ON_A_METRE for name, one in artefact.figures(every).items() if "_" in name}


@pytest.mark.parametrize("count", [3, 4])
def test_angles_of_reflectors_are_those_put_in(count: int) -> None:
    """Also where a turns over ±180°."""
    points, attained = reflectors(count)
    found, wanted = figures(points), np.array([[170.0, 30.0, -60.0], [-179.999, -45.0, 20.0]])
    for k, angle in enumerate("abc"):
        off = 3600 * (attained[..., k] - wanted[:, None, k])
        assert found[f"AP_{angle}"] == pytest.approx(off.mean(axis=1), abs=1e-5)
        assert found[f"RP_{angle}"] == pytest.approx(3 * off.std(axis=1, ddof=1), abs=1e-5)


def test_measured_angles_are_compared_with_the_commanded_ones() -> None:
    points, attained = reflectors(3)
    one = points.select(np.flatnonzero(np.arange(len(points)) % 3 == 0))
    seen = {f"reference_{a}_deg": attained.reshape(-1, 3)[:, k] for k, a in enumerate("abc")}
    stated = {f"commanded_{a}_deg": np.repeat([(170.0, -179.999), (30.0, -45.0), (-60.0, 20.0)][k], 4)
              for k, a in enumerate("abc")}  # fmt: skip
    found = figures(replace(one, columns={**one.columns, **seen, **stated}))
    by_places = figures(points)
    assert {name: list(values) for name, values in found.items()} == {
        name: pytest.approx(list(values), abs=1e-5) for name, values in by_places.items()
    }
    assert set(figures(replace(one, columns={**one.columns, **seen}))) == {"RP_a", "RP_b", "RP_c"}


def test_two_reflectors_show_no_angle() -> None:
    assert not figures(reflectors(2)[0])


def test_reflectors_in_a_line_and_poses_whose_angles_are_one_have_none() -> None:
    points, _ = reflectors(3)
    in_line = {f"tip_{a}_mm": points.columns["tip_x_mm"] * (a == "x") for a in "xyz"}
    assert not figures(replace(points, columns={**points.columns, **in_line}))
    one = points.select(np.flatnonzero(np.arange(len(points)) % 3 == 0))
    upright = {
        f"reference_{a}_deg": np.where(one.point == 1, 85.0 * (a == "b"), 10.0) + 0.001 * one.repeat for a in "abc"
    }
    assert len(figures(replace(one, columns={**one.columns, **upright}))["RP_a"]) == 1


def test_in_a_frame_of_its_own_repeatability_is_about_the_axes_of_the_base() -> None:
    """The tracker is turned by 90° and more: a about x of the base stays a; accuracy needs the base."""
    points, _ = reflectors(4)
    seen = np.column_stack([points.columns[f"reference_{a}_mm"] for a in "xyz"])
    away = seen @ turned(np.array([20.0, -30.0, 95.0])).T + [3000.0, 100.0, -500.0]
    there = replace(
        points, columns={**points.columns, **{f"reference_{a}_mm": away[:, k] for k, a in enumerate("xyz")}}
    )
    found, base = figures(there, "own"), figures(points)
    assert set(found) == {"RP_a", "RP_b", "RP_c"}
    for name, values in found.items():
        assert values == pytest.approx(base[name], rel=2e-3)


def job_with(
    tmp_path: Path, change: Callable[[list[dict[str, str]]], object], *edits: tuple[str, str]
) -> dict[str, Any]:
    """The only statement of a new job of thirty cycles, its rows changed."""
    job = tmp_path / "job"
    write_new("robot_poses", job, {})
    lines = (job / "recording.csv").read_text(encoding="utf-8").splitlines()
    rows = list(csv.DictReader(lines[1:]))
    change(rows)
    with (job / "recording.csv").open("w", encoding="utf-8", newline="") as file:
        file.write(lines[0] + "\n")
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    for old, new in edits:
        edit(job, old, new)
    return data_of_job(job)


def pasted(*poses: str, later: str = "30", first: str = "28") -> Callable[[list[dict[str, str]]], None]:
    def change(rows: list[dict[str, str]]) -> None:
        source = {row["point"]: row for row in rows if row["repeat"] == first}
        for row in rows:
            if row["repeat"] == later and row["point"] in poses:
                row |= {name: value for name, value in source[row["point"]].items() if name.startswith("reference_")}

    return change


@pytest.mark.parametrize(("poses", "whole"), [("3", 4), ("1245", 1), ("12345", 0)])
def test_cycles_that_were_copied_do_not_count_of_one_pose_or_of_several(poses: str, whole: int, tmp_path: Path) -> None:
    statement = job_with(tmp_path, pasted(*poses))
    assert statement["decision"] == "incomplete"
    assert f"5 poses, each commanded 30 times ({whole})" in statement["missing"]
    said = [
        text for text in statement["remarks"] if "cycle 30 of cycle 28" in text or "repeat 30 of measurement" in text
    ]
    assert len(said) == 1
    for pose in poses if len(poses) < 5 else "":
        assert f"pose {pose}, cycle 30 of cycle 28" in said[0]


def test_a_copied_reading_has_no_weight_in_its_figure(tmp_path: Path) -> None:
    """As large as without the cycle: here the worst pose is the one copied."""
    whole = cmm_uq_value(tmp_path / "a", lambda rows: rows.__delitem__(slice(29 * 5, None)))
    assert cmm_uq_value(tmp_path / "b", pasted("1", "2", "3", "4", "5")) == whole


def cmm_uq_value(tmp_path: Path, change: Callable[[list[dict[str, str]]], object]) -> float:
    tmp_path.mkdir()
    return float(job_with(tmp_path, change)["value_um"])


def poses_of(step_mm: float, sd_mm: float = 0.01) -> Points:
    """Five poses thirty times by readings rounded to ``step_mm``."""
    random = np.random.default_rng(7)
    point, cycle = (each.ravel() for each in np.meshgrid(np.arange(1, 6), np.arange(1, 31)))
    at = np.column_stack([100.0 * point, 50.0 * point**2, 10.0 * point])
    seen = np.round((at + random.normal(0.0, sd_mm, at.shape)) / step_mm) * step_mm
    columns = {f"reference_{a}_mm": seen[:, k] for k, a in enumerate("xyz")}
    return Points(at, np.ones_like(point), point, cycle, Arm("r"), columns)


def test_a_reflector_whose_reading_is_copied_leaves_no_orientation_of_that_cycle() -> None:
    """Two of three remain, and two show no angle."""
    points, _ = reflectors(3)
    columns = {name: values.copy() for name, values in points.columns.items()}
    (later,), (first,) = (np.flatnonzero((points.point == 2) & (points.repeat == n))[[1]] for n in (4, 2))
    for axis in "xyz":
        columns[f"reference_{axis}_mm"][later] = columns[f"reference_{axis}_mm"][first]
    made = replace(points, columns=columns)
    assert copied(made, angles=True) == {later: first}
    data = poses_data(made, TrackedPoints(artefact_facts(kind="tracked_points", frame="base", u_um=1.0), made).figures)
    assert [one["cycles"] for one in data["orientations"]] == [4, 3]
    assert [(one["point"], one["reflector"], one["cycles"]) for one in data["poses"]] == [
        (pose, tip, 4 - (pose == 2 and tip == 1)) for pose in (1, 2) for tip in (1, 2, 3)
    ]


def test_readings_that_are_equal_by_rounding_are_no_copies() -> None:
    points = poses_of(0.01)
    read = np.column_stack([points.point, *(points.columns[f"reference_{a}_mm"] for a in "xyz")])
    assert len(np.unique(read, axis=0)) < len(points), "some are equal"
    assert copied(points) == {}
    assert counting(points).all()


def test_a_reading_to_the_nanometre_that_another_repeats_is_a_copy() -> None:
    points = poses_of(1e-6)
    columns = {name: values.copy() for name, values in points.columns.items()}
    later, first = 27 * 5 + 2, 3 * 5 + 2
    for values in columns.values():
        values[later] = values[first]
    made = replace(points, columns=columns)
    assert copied(made) == {later: first}
    assert np.flatnonzero(~counting(made)).tolist() == [later]


REACH = 3000.0


def choices(at: Floats) -> bool:
    """Five of them in a plane about one in their middle, wide and large enough, each choice looked at (the definition)."""
    for five in itertools.combinations(at, 5):
        for i in range(5):
            own = np.array([five[i], *five[:i], *five[i + 1 :]])
            sides, extent = np.linalg.svd(own - own.mean(axis=0))[1], np.ptp(own, axis=0).max()
            off = max(np.linalg.norm(own[0] - own[1:].mean(axis=0)), sides[2])
            wide = sides[1] >= 0.3 * sides[0] and extent >= 0.1 * max(REACH, np.linalg.norm(own[0]))
            if wide and off <= 0.02 * extent:
                return True
    return False


def test_five_poses_are_found_as_by_looking_at_every_choice() -> None:
    """Of random places, with and without a pose in the middle of four others, near the tolerance either way."""
    random, found = np.random.default_rng(11), []
    for case in range(120):
        at = random.uniform(-300.0, 300.0, (int(random.integers(4, 10)), 3))
        if case % 2 and len(at) > 4:
            u, v = random.normal(size=(2, 3)) * 200.0
            at[:5] = at[0] + np.array([0 * u, u, -u, v, -v]) + random.normal(0.0, random.uniform(0.5, 8.0), (5, 3))
            random.shuffle(at)
        found.append(five_in_a_plane(at, REACH))
        assert found[-1] == choices(at), case
    assert 20 < sum(found) < 100


def test_poses_about_the_base_s_origin_are_wide_by_the_reach_not_by_how_far_they_lie() -> None:
    at = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0]])
    assert five_in_a_plane(0.051 * REACH * at, REACH)
    assert not five_in_a_plane(0.049 * REACH * at, REACH)


def test_a_hundred_poses_are_searched_at_once() -> None:
    """Seventy-five million choices of five; on a sphere none lies in the middle of others, so that none may be left out."""
    way = np.random.default_rng(2).normal(size=(100, 3))
    assert not five_in_a_plane(500.0 * way / np.linalg.norm(way, axis=1, keepdims=True) * [1.0, 1.3, 0.7])


def with_angles(rows: list[dict[str, str]]) -> None:
    random = np.random.default_rng(3)
    for row in rows:
        for angle, wanted in (("a", 180.0), ("b", 30.0), ("c", 5.0)):
            row[f"commanded_{angle}_deg"] = str(wanted)
            row[f"reference_{angle}_deg"] = f"{wanted + random.normal(0.004, 0.002):.7f}"


ORIENTED = (r"u_repeat_um = .*", "u_repeat_um = 10.0\nu_orientation_arcsec = 3.0\nu_repeat_arcsec = 1.0")


@pytest.mark.parametrize(("name", "limit", "outcome"), [
    ("RP_a", "limit_deg = 0.012", "pass"), ("RP_a", "limit_arcsec = 20.0", "fail"), ("AP_b", "limit_deg = 0.01", "pass"),
    ("AP_b", "limit_arcsec = 15.2", "undecided"), ("AP_b", "limit_deg = 0.002", "fail"),
])  # fmt: skip
def test_angles_are_decided_by_limits_that_are_angles(name: str, limit: str, outcome: str, tmp_path: Path) -> None:
    statement = job_with(
        tmp_path,
        with_angles,
        ORIENTED,
        ('characteristic = "RP".*', f'characteristic = "{name}"'),
        ("limit_um = .*", limit),
    )
    assert (statement["decision"], statement["missing"]) == (outcome, [])
    assert statement["limit_um"] == pytest.approx(
        float(limit.split()[-1]) * (3600 if "deg" in limit else 1) * ARCSEC_ON_A_METRE * 1000
    )
    assert statement["u_um"] == pytest.approx((3.0 if name == "AP_b" else 1.0) * ARCSEC_ON_A_METRE * 1000)


def test_orientation_of_some_poses_alone_is_incomplete_and_of_none_is_refused(tmp_path: Path) -> None:
    """Not commanded: no accuracy. Measured angles copied of one pose: four poses are left."""

    def copied_angle(rows: list[dict[str, str]]) -> None:
        with_angles(rows)
        source = next(row for row in rows if row["repeat"] == "7" and row["point"] == "2")
        for row in rows:
            if row["repeat"] == "21" and row["point"] == "2":
                row |= {name: value for name, value in source.items() if re.fullmatch("reference_._deg", name)}

    of_a = (ORIENTED, ('characteristic = "RP".*', 'characteristic = "AP_a"'), ("limit_um = .*", "limit_deg = 0.05"))
    statement = job_with(tmp_path, copied_angle, *of_a)
    assert statement["decision"] == "incomplete"
    assert any("30 times (4)" in text for text in statement["missing"])
    assert any("pose 2, cycle 21 of cycle 7" in text for text in statement["remarks"])
    (tmp_path / "other").mkdir()
    with pytest.raises(CmmUqError, match=r"AP_a of ISO 9283:1998 is decided on .* and commanded"):
        job_with(tmp_path / "other", lambda rows: None, *of_a)


@pytest.mark.parametrize(("edits", "said"), [
    ((("limit_um = .*", "limit_deg = 0.05"),), "RP of ISO 9283:1998 is no angle"),
    ((("limit_um = .*", "limit_deg = 0.05\nlimit_arcsec = 180.0"),), "limit_arcsec or limit_deg"),
    ((("limit_um = .*", "limit_deg = 0.0"),), "limit_deg"),
])  # fmt: skip
def test_limits_of_angles_where_none_is_or_twice_are_refused(
    edits: tuple[tuple[str, str], ...], said: str, tmp_path: Path
) -> None:
    with pytest.raises(CmmUqError, match=said):
        job_with(tmp_path, with_angles, *edits)
