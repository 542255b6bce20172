"""A plan says what the standards of a job still lack, and places it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from cmm_uq.app.commands.jobs.check import check_job
from cmm_uq.app.commands.jobs.simulate import simulate
from cmm_uq.app.commands.plans.planning import RECORDED, MeasurementPlan, make_plan
from cmm_uq.app.commands.reading import read_job
from cmm_uq.app.commands.report import evaluate_job as analyse_job
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Points
from cmm_uq.jobs.derived_job import Truth
from tests.analysis.conformity.recorded import SEVEN, gauge
from tests.app.commands.test_planning import planned

JOB = """
[job]
id = "partly-measured"
date = 2026-01-01
[machine]
name = "Bridge machine"
travel_mm = { x = [0, 900], y = [0, 550], z = [-500, 0] }
[artefact]
kind = "step_gauge"
u_um = 0.4
[recording]
file = "recording.csv"
u_coordinate_um = 1.0
[model]
effects = ["scale_x", "scale_y", "scale_z"]
[[conformity]]
standard = "ISO 10360-2:2009"
limit_um = 5.0
"""

DIRECTED = ("approach_x", "approach_y", "approach_z")


def after(folder: Path, points: Points, further: Sequence[str] = DIRECTED) -> MeasurementPlan:
    """The plan of a recording of nominal points, with these columns."""
    columns = np.column_stack([
        points.measurement, points.point, points.repeat, points.xyz, points.columns["reference_mm"],
        *(np.sign(points.columns[name]) for name in further),
    ])  # fmt: skip
    rows = [",".join(["measurement,point,repeat,x_mm,y_mm,z_mm,reference_mm", *further])]
    rows += [
        ",".join([f"{m:.0f},{p:.0f},{r:.0f},{x:.7f},{y:.7f},{z:.7f}", *map(str, others)])
        for m, p, r, x, y, z, *others in columns.tolist()
    ]
    (folder / "recording.csv").write_text("\n".join(rows), encoding="utf-8")
    (folder / "job.toml").write_text(JOB, encoding="utf-8")
    return make_plan(read_job(folder, recorded=False), power=False)


def test_two_lines_that_were_not_measured_are_placed_and_no_others(tmp_path: Path) -> None:
    points = gauge(SEVEN).points
    plan = after(tmp_path, points.select(~np.isin(points.measurement, [2, 5])))
    assert plan.name == RECORDED
    assert [placing.title for placing in plan.to_measure] == ["along +X −Y +Z, inclined 25°", "along X"]
    assert all(condition.met for condition in plan.conditions)
    assert plan.first == 8


def test_where_nothing_is_missing_nothing_is_placed(tmp_path: Path) -> None:
    plan = after(tmp_path, gauge(SEVEN).points)
    assert plan.to_measure == ()
    assert all(condition.met for condition in plan.conditions)


def test_without_directions_the_lengths_are_not_shown_to_be_bidirectional(tmp_path: Path) -> None:
    plan = after(tmp_path, gauge(SEVEN).points, ())
    assert [condition.missing for condition in plan.conditions if not condition.met] == [
        ("bidirectional lengths: from which side each end was reached is not recorded",)
    ]


def test_nominal_points_serve_for_a_plan_and_a_simulation_and_for_no_certificate(tmp_path: Path) -> None:
    after(tmp_path, gauge(SEVEN).points)
    job = read_job(tmp_path)
    drawn = simulate(job, Truth.model_validate({"seed": 1, "noise": {"coordinate_um": 1.0}}))
    assert np.std(drawn.xyz - job.points.xyz) == pytest.approx(1e-3, rel=0.1)
    (problem,) = check_job(tmp_path).problems
    assert "the readings have no scatter at all" in problem.problem
    with pytest.raises(CmmUqError, match="the readings have no scatter at all"):
        analyse_job(job)


def test_copies_of_a_line_are_placed_again(tmp_path: Path) -> None:
    points = gauge(SEVEN).points
    xyz = points.xyz.copy()
    for repeat in (2, 3):
        xyz[(points.measurement == 6) & (points.repeat == repeat)] = xyz[
            (points.measurement == 6) & (points.repeat == 1)
        ]
    plan = after(tmp_path, points.at(xyz))
    assert [placing.title for placing in plan.to_measure] == ["along Y"]


def test_a_plan_without_the_placings_of_b89_is_not_called_one(tmp_path: Path) -> None:
    """Six placings by the criterion D replace the twenty of the ready plan."""
    plan = planned(tmp_path, 'criterion = "D"\nnumber = 6')
    assert plan.name == "ASME B89.4.1"
    assert len(plan.to_measure) == 6
    lacking = [text for condition in plan.conditions for text in condition.missing]
    assert lacking[0] == "14 of 20 positions: 6 distinct"
