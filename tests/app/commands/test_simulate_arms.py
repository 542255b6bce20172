"""Simulated recordings of arms whose joints are read: the joints bring the tool to the simulated coordinates."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from benchmarks.artefacts.arm_coverage import SECOND, place
from cmm_uq.app.commands.jobs.simulate import simulated_job
from cmm_uq.app.commands.reading import job_of
from cmm_uq.app.commands.report import evaluate_job
from cmm_uq.base.arm import THETA, Arm
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats
from cmm_uq.certificate.result import Result
from cmm_uq.jobs.job import Job

ROWS = np.array([[0, -90, 300, 0], [500, 0, 0, -90], [80, -90, 0, 0], [0, 90, 450, 0], [0, -90, 0, 0], [0, 0, 90, 0.0]])
TOOL = np.array([0.0, 0.0, 150.0])
SEATS = ([650.0, -200.0, 150.0], [500.0, 350.0, 300.0], [300.0, -450.0, 550.0])
ARM = Arm("arm", rows=np.column_stack([ROWS * [1, np.pi / 180, 1, np.pi / 180], np.zeros(6)]), revolute=np.ones(6, dtype=bool),
          sense=np.ones(6), tool_mm=TOOL, limits=np.full((6, 2), np.nan))  # fmt: skip


def bent(centre: Floats, count: int, random: np.random.Generator) -> Floats:
    """(count, 6) readings, °, each otherwise, by which the rows have the tool at a place."""
    q = np.tile([0.0, 20.0, 20.0, 0.0, 40.0, 0.0], (count, 1)) + random.uniform(-35.0, 35.0, (count, 6))
    for _ in range(200):
        pose = ARM.at(q)
        off = centre - pose.tool
        if np.abs(off).max() < 1e-10:
            break
        step = np.einsum("nji,ni->nj", np.linalg.pinv(pose.jacobian[:, :, 5 * np.arange(6) + THETA]), off)
        q += np.degrees(np.clip(step, -0.2, 0.2))
    assert np.abs(off).max() < 1e-10
    return (q + 180.0) % 360.0 - 180.0


def job(kind: str, places: list[tuple[int, int, int, Floats]], **artefact: float) -> Job:
    """A job of an arm whose joints stand otherwise at every row: measurement, point, repeat and place."""
    random = np.random.default_rng(8)
    lines = ["measurement,point,repeat," + ",".join(f"q{i}_deg" for i in range(1, 7)) + ",nx,ny,nz"]
    for measurement, point, repeat, at in places:
        read = bent(np.asarray(at), 1, random)[0]
        out = np.asarray(at) - SEATS[measurement - 1]
        normal = out / (np.linalg.norm(out) or 1.0)
        lines.append(",".join([f"{measurement},{point},{repeat}", *(f"{value:.9f}" for value in (*read, *normal))]))
    joints = "".join(
        f"[[machine.joint]]\na_mm = {a}\nalpha_deg = {alpha}\nd_mm = {d}\ntheta_deg = {theta}\n"
        for a, alpha, d, theta in ROWS.tolist()
    )
    keys = "".join(f"{key} = {value}\n" for key, value in artefact.items())
    text = f"""[job]\nid = "arm"\ndate = 2026-01-01\n[machine]\nname = "arm"\narm = {{ tool_mm = {TOOL.tolist()} }}\n{joints}
[artefact]\nkind = "{kind}"\n{keys}[recording]\nfile = "recording.csv"\n[model]
effects = ["zero_q2", "zero_q3", "zero_q5"]
"""
    return job_of({"job.toml": text.encode(), "recording.csv": ("\n".join(lines) + "\n").encode()})


def seats() -> Job:
    return job("seat", [(i, 1, r, np.array(at)) for i, at in enumerate(SEATS, 1) for r in range(1, 13)])


def sphere() -> Job:
    random, rows = np.random.default_rng(3), []
    for i, at in enumerate(SEATS[:2], 1):
        for point in range(1, 16):
            out = random.normal(size=3)
            rows.append((i, point, 1, np.array(at) + 12.5 * out / np.linalg.norm(out)))
    return job("sphere", rows, length_mm=25.0, u_um=0.5)


TRUTH = {"zero_q2": 500.0, "zero_q3": -700.0, "zero_q5": 300.0}  # ″


def true_tool(points: Floats) -> Floats:
    """(n, 3) by products of 4 × 4 matrices."""
    rows = np.column_stack([ROWS * [1, np.pi / 180, 1, np.pi / 180], np.zeros(6)])
    for name, zero in TRUTH.items():
        rows[int(name[-1]) - 1, 3] += zero * SECOND
    return np.array([place(rows, np.radians(one), TOOL) for one in points])


@pytest.mark.parametrize("make", [seats, sphere])
def test_joints_bring_the_tool_to_what_is_simulated_and_the_true_arm_to_the_artefact(make: object) -> None:
    """Without noise the true arm, with the simulated readings, is at the seats, or on the spheres, to 0.1 µm and 1 µm."""
    made = make()  # type: ignore[operator]
    truth = {"seed": 1, "effects": {name: {"arcsec": zero} for name, zero in TRUTH.items()}}
    points = simulated_job(made, truth).points
    read = np.column_stack([points.columns[f"q{i}_deg"] for i in range(1, 7)])
    assert_allclose(ARM.at(read).tool, points.xyz, atol=2e-5)
    true = true_tool(read)
    away = np.linalg.norm(points.xyz - true, axis=1)
    assert away.max() > 1.0  # errors of millimetres
    for number in np.unique(points.measurement):
        own = true[points.measurement == number]
        if make is seats:
            assert np.linalg.norm(own - own.mean(axis=0), axis=1).max() < 1e-4
        else:
            centre = np.linalg.lstsq(np.column_stack([2 * own, np.ones(len(own))]), np.sum(own**2, axis=1), rcond=None)[
                0
            ][:3]
            assert np.ptp(np.linalg.norm(own - centre, axis=1)) < 1e-3


@pytest.mark.usefixtures("no_diagnosis")
def test_errors_put_into_an_arm_are_found_again_by_its_seats() -> None:
    truth = {"seed": 2, "noise": {"coordinate_um": 10.0}, "effects": {name: {"arcsec": v} for name, v in TRUTH.items()}}
    result = evaluate_job(simulated_job(seats(), truth))
    assert isinstance(result, Result)
    for name, zero in TRUTH.items():
        found = result.parameters[name]["arcsec"]
        assert abs(found.value - zero) < 4 * found.u, name
    assert "placing" not in result.noise.components  # one with where the seat stands
    assert 8.0 < result.noise.coordinate.value < 12.5


def test_coordinates_that_no_joints_reach_are_refused() -> None:
    far = replace(ARM, rows=ARM.rows)
    columns = {f"q{i}_deg": np.zeros(1) for i in range(1, 7)}
    with pytest.raises(CmmUqError, match="no readings of the joints bring the tool to 5000"):
        far.columns_at(np.array([[5000.0, 0.0, 0.0]]), columns)
