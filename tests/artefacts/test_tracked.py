"""Points of a robot that a tracker saw: rows found again, what poses leave open, and coordinates that follow from joints."""

from __future__ import annotations

import csv
import datetime as dt
import io
import re
import shutil
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from cmm_uq.analysis.diagnosis.comparison.explanations import means_of_columns
from cmm_uq.app.commands.jobs.new import job_of_export, new_job
from cmm_uq.app.commands.jobs.simulate import simulated_job
from cmm_uq.app.commands.model import recorded_model
from cmm_uq.app.commands.parts.part import write_part
from cmm_uq.app.commands.reading import job_of
from cmm_uq.app.commands.report import REPORT, evaluate_job, report_outcome
from cmm_uq.artefacts import artefact_facts
from cmm_uq.artefacts.optical import tracked
from cmm_uq.artefacts.optical.tracked import TrackedPoints, predicted_poses
from cmm_uq.base.arm import THETA, Arm
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Machine, Points
from cmm_uq.certificate.result import Outcome, Result
from cmm_uq.jobs.job import Job
from cmm_uq.machine.physics.stated import physics_of
from tests.artefacts.simulated import outcome
from tests.conftest import ROOT, without_diagnosis

EXAMPLES = ROOT / "examples"
FILES = new_job("tracked_points", {}, id="robot")
TRUTH = {"seed": 5, "noise": {"coordinate_um": 30.0}, "effects": {
    "zero_q2": {"arcsec": 900.0}, "zero_q4": {"arcsec": -400.0}, "length_q2": {"um": 600.0}, "twist_q1": {"arcsec": 300.0},
    "offset_q4": {"um": -500.0}, "tool_offset": {"x_um": 2000.0, "y_um": -1000.0, "z_um": 500.0},
}}  # fmt: skip


def robot(effects: tuple[str, ...] = (), **toml: str) -> Job:
    text = FILES["job.toml"].decode()
    if effects:
        before, _, rest = text.partition("effects = [")
        text = f"{before}effects = {list(effects)!r}  #{rest}".replace("'", '"')
    for old, new in toml.items():
        assert old in text
        text = text.replace(old, new)
    return job_of({**FILES, "job.toml": text.encode()})


def test_errors_go_by_where_a_pose_was_commanded_and_not_by_the_noise_that_it_was_seen_with() -> None:
    """Five poses thirty times, seen with 30 µm: a function of places with that noise explains the noise itself."""
    files = new_job("robot_poses", {}, id="poses")
    model = recorded_model(job_of(files))[0]
    about, points = model.estimate().about, model.artefact.points
    seen, where = model.placed(about), model.where(about)
    for read, own, place in zip(points.xyz.T, seen.T, where.T, strict=True):
        for commanded in np.unique(read):
            rows = read == commanded
            assert np.std(own[rows]) > 0.02
            assert_allclose(place[rows], own[rows].mean(), rtol=0, atol=1e-12)
    assert {"reference_x_mm", "reference_y_mm", "reference_z_mm"}.isdisjoint(means_of_columns(model))


def test_places_of_a_scan_stand_each_for_itself() -> None:
    """Each within 0.1 mm of the next, over 50 mm: they are no place that was read again."""
    x = np.linspace(0.0, 50.0, 1001)
    xyz = np.column_stack([x, np.sqrt(2500.0 - x**2) + 1000.0, 10.0 * np.sin(x)])
    one, columns = np.ones(len(x), dtype=np.int64), {f"reference_{a}_mm": xyz[:, i] for i, a in enumerate("xyz")}
    points = Points(xyz, one, np.arange(1, len(x) + 1), one, Machine("m"), columns)
    artefact = TrackedPoints(artefact_facts(kind="tracked_points"), points)
    assert_allclose(artefact.without_noise(xyz)[:, 0], x, rtol=0, atol=0)


def recording(change: dict[str, float | None]) -> bytes:
    """That of the new job with one column of its first row changed, or all of a column left out."""
    lines = FILES["recording.csv"].decode().splitlines()
    rows = list(csv.DictReader(lines[1:]))
    for column, by in change.items():
        if by is None:
            rows = [{name: value for name, value in row.items() if name != column} for row in rows]
        else:
            rows[0][column] = str(float(rows[0][column]) + by)
    text = io.StringIO()
    writer = csv.DictWriter(text, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return f"{lines[0]}\n{text.getvalue()}".encode()


@pytest.fixture(scope="module")
def found() -> Result:
    with without_diagnosis():
        result = evaluate_job(simulated_job(robot(), TRUTH))
    assert isinstance(result, Result)
    return result


def test_errors_of_millimetres_are_found_again(found: Result) -> None:
    """What was put in lies within 4 u, and so does what was not, though the tool is 3 mm off before the fit."""
    assert isinstance(found.artefact, TrackedPoints)
    assert np.linalg.norm(found.artefact.deviations(), axis=1).mean() > 2.0
    put_in = TRUTH["effects"]
    assert isinstance(put_in, dict)
    for effect, parameters in found.parameters.items():
        for name, quantity in parameters.items():
            assert abs(quantity.value - put_in.get(effect, {}).get(name, 0.0)) < 4 * quantity.u, (effect, name)
    assert_allclose(found.noise.coordinate.value, 30.0, rtol=0.2)


def test_points_held_out_are_predicted_within_their_uncertainty(found: Result) -> None:
    predicted = predicted_poses(found.model)
    assert predicted is not None
    assert predicted.within.mean() > 0.9
    assert predicted.inside.mean() > 0.85
    assert predicted.off.mean() < 2 * np.linalg.norm(found.residuals.reshape(-1, 3), axis=1).mean()


@pytest.mark.parametrize(("also", "free"), [
    ("zero_q1", {"zero_q1"}), ("offset_q1", {"offset_q1"}), ("offset_q2", {"offset_q2", "offset_q3"}),
    ("zero_q6", {"zero_q6", "tool_offset"}), ("offset_q6", {"offset_q6", "tool_offset"}),
])  # fmt: skip
def test_what_no_pose_tells_apart_is_left_open_by_name(also: str, free: set[str]) -> None:
    """The base stands anywhere, axes 2 and 3 are parallel, and one point on the flange does not tell how that is turned."""
    job = robot(effects=("zero_q2", "zero_q3", "length_q2", "offset_q3", "tool_offset", also))
    with physics_of(job):
        model, _ = recorded_model(job)
        least_squares = model.estimate().least_squares
    open_ = {
        unknown.key[0] for unknown, known in zip(model.unknowns, least_squares.determined, strict=True) if not known
    }
    assert open_ == free


def test_coordinates_follow_from_the_joints() -> None:
    files = {**FILES, "recording.csv": recording({f"{axis}_mm": None for axis in "xyz"})}
    alone = job_of(files).points
    assert_allclose(alone.xyz, robot().points.xyz, atol=1e-9)


@pytest.mark.parametrize(("change", "problem"), [
    ({"x_mm": 0.5}, "lie 0.5 mm from where"), ({"q1_deg": 0.05}, "from where .* has the tool"),
    ({"q3_deg": 60.0}, "lies outside the travel of the joint, -50 to 50"), ({"q4_deg": None}, "no column 'q4_deg'"),
])  # fmt: skip
def test_other_coordinates_than_those_of_the_joints_are_refused(change: dict[str, float | None], problem: str) -> None:
    with pytest.raises(CmmUqError, match=problem):
        job_of({**FILES, "recording.csv": recording(change)})


@pytest.mark.parametrize(("old", "new", "problem"), [
    ('name = "Robot"', 'name = "Robot"\nchain = "XYZ"', "chain is of a machine of carriages"),
    ('name = "Robot"', 'name = "Robot"\ntravel_mm = { x = [0.0, 1.0] }', "travel_mm is of a machine of carriages"),
    ("travel = [-90.0, 90.0]", "travel = [90.0, -90.0]", "the first number must be the lower one"),
    ("tool_mm", "up = [0.0, 0.0, 0.0], tool_mm", "is no direction"),
])  # fmt: skip
def test_rows_that_do_not_go_together_are_refused(old: str, new: str, problem: str) -> None:
    with pytest.raises(CmmUqError, match=problem):
        robot(**{old: new})


def test_an_arm_has_no_effects_of_carriages() -> None:
    with pytest.raises(CmmUqError, match="the arm of this job has no effect 'scale_x'"):
        evaluate_job(robot(effects=("scale_x",)))


@pytest.mark.long
def test_play_that_the_model_leaves_out_is_named() -> None:
    """Joint 1 stands 80″ behind on either side; the diagnosis says so, and no row is blamed."""
    plain = robot()
    random = np.random.default_rng(2)
    side = random.choice([-1.0, 1.0], len(plain.points))
    lines = FILES["recording.csv"].decode().splitlines()
    sides = ["approach_q1", *(f"{value:g}" for value in side)]
    text = "\n".join([lines[0], *(f"{line},{value}" for line, value in zip(lines[1:], sides, strict=True))]) + "\n"
    job = job_of({**FILES, "recording.csv": text.encode()})
    truth = {"seed": 3, "noise": {"coordinate_um": 30.0}, "effects": {"slack_q1": {"gap_arcsec": 80.0}}}
    diagnosis = evaluate_job(simulated_job(job, truth)).diagnosed.diagnosis  # type: ignore[attr-defined]
    assert [one.effect for one in diagnosis.effects] == ["slack_q1"]


@cache
def reported() -> Outcome:
    with without_diagnosis():
        return report_outcome(robot())


def test_the_certificate_has_the_rows_as_found() -> None:
    results = reported().results
    rows = results["rows"]
    assert [row["d_mm"] for row in rows][::5] == [475.0, 85.0]  # what is not named, or open, stands as it was
    value = results["estimates"]["length_q2"]["um"]["value"]
    assert_allclose(rows[1]["a_mm"], 600.0 + value / 1000, atol=1e-9)


def test_a_job_of_an_export_names_effects_that_its_arm_has() -> None:
    """As a new job does, but for what needs a column that the export has not."""
    told = robot().facts.machine.model_dump(exclude_unset=True)
    given = {"job": {"date": dt.date(2026, 1, 1)}, "machine": {"name": "R", "arm": told["arm"], "joint": told["joint"]}}
    made = job_of_export("tracked_points", given, {"recording.csv": recording({}).partition(b"\n")[2]}, id="r")[
        "job.toml"
    ].decode()
    assert '"zero_q5", "length_q1"' in made
    assert "slack" not in made


def test_no_part_is_evaluated_by_the_certificate_of_an_arm(tmp_path: Path) -> None:
    shutil.copytree(EXAMPLES / "part-plate-simulated", tmp_path / "part")
    certificate = REPORT.contents(outcome("robot-simulated"))["certificate-simulated.pdf"]
    (tmp_path / "part" / "machine" / "certificate-simulated.pdf").write_bytes(certificate)
    with pytest.raises(CmmUqError, match="the machine's certificate is of an arm"):
        write_part(tmp_path / "part", tmp_path / "out")


@pytest.mark.usefixtures("no_diagnosis")
def test_a_robot_by_screw_axes_is_the_one_by_its_rows_and_its_axes_are_found() -> None:
    """The same robot stated either way leaves the same distances, and its screw axes are found."""
    by_rows, other = robot(), reported().found
    arm = by_rows.points.machine
    assert isinstance(arm, Arm)
    home = arm.at(np.zeros((1, 6)))
    text = re.sub(r"\njoint = .*\narm = .*", "", FILES["job.toml"].decode())
    axes = "".join(
        f"[[machine.joint]]\ndirection = {home.axes[0, i, THETA].tolist()}\npoint_mm = {home.origins[0, i, THETA].tolist()}\n"
        for i in range(6)
    )
    frame = np.column_stack([home.flange[0], home.tool[0] - home.flange[0] @ arm.tool_mm]).tolist()
    stated = f"[machine.arm]\nhome = {frame}\ntool_mm = {arm.tool_mm.tolist()}\n{axes}\n[artefact]"
    job = job_of({**FILES, "job.toml": text.replace("[artefact]", stated, 1).encode()})
    assert_allclose(job.points.xyz, by_rows.points.xyz, atol=1e-4)  # as recorded
    result = evaluate_job(job)
    assert isinstance(result, Result)
    assert isinstance(other, Result)
    positions, same = tracked.results(result)["positions"], tracked.results(other)["positions"]
    for when in ("before", "after"):
        assert positions[when]["rms_um"] == pytest.approx(same[when]["rms_um"], rel=1e-3)
    found = tracked.results(result)["screws"]
    rows = np.array([[row[key] for key in ("a_mm", "alpha_deg", "d_mm", "theta_deg", "beta_deg")]
                     for row in tracked.results(other)["rows"]])  # fmt: skip
    rows[:, [1, 3, 4]] = np.radians(rows[:, [1, 3, 4]])
    exact = replace(arm, rows=rows).at(np.zeros((1, 6)))
    for i, screw in enumerate(found[1:5], 1):  # the first and the last are in part the frame's and the tool's
        assert_allclose(screw["direction"], exact.axes[0, i, THETA], atol=3e-4)
        off = np.array(screw["point_mm"]) - exact.origins[0, i, THETA]
        assert np.linalg.norm(np.cross(off, screw["direction"])) < 0.3
