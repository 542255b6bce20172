"""``compensate --poses``: files of a robot's poses, written with their corrections, or refused."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from cmm_uq.app.cli.commands import app
from cmm_uq.app.commands.jobs import compensate_poses
from cmm_uq.app.commands.jobs.compensate_poses import write_corrected_poses
from cmm_uq.base.errors import CmmUqError
from tests.artefacts.simulated import analysed
from tests.conftest import ROOT

ROBOT = ROOT / "examples" / "robot-simulated"
HEAD = ",".join(f"q{i}_deg" for i in range(1, 7))


def poses(folder: Path, *rows: str, head: str = HEAD + ",approach_q1") -> Path:
    file = folder / "poses.csv"
    file.write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")
    return file


def test_poses_are_written_with_places_uncertainties_and_corrected_readings(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(compensate_poses, "evaluate_job", lambda read, *, seed: analysed(read.facts.job.id))
    given = ["10,5,-5,30,40,20,1", "-40,-20,10,-60,-30,90,-1"]
    files, said = write_corrected_poses(ROBOT, poses(tmp_path, *given), tmp_path / "out")
    with files["poses-compensated.csv"].open(encoding="utf-8") as file:
        head = file.readline()
        rows = list(csv.DictReader(file))
    assert "compensated" in head  # simulated: no correction of a measured robot
    assert [row["point"] for row in rows] == ["1", "2"]
    for row, line in zip(rows, given, strict=True):
        changed = np.array([float(row[f"q{i}_deg"]) for i in range(1, 7)]) - np.array(line.split(","), dtype=float)[:6]
        assert 0 < np.abs(changed).max() < 2.0
        assert float(row["left_um"]) < 0.01 < float(row["uncorrected_um"])
        assert all(5.0 < float(row[f"u_{axis}_um"]) < 200.0 for axis in "xyz")
    told = json.loads(files["compensation.json"].read_text(encoding="utf-8"))
    assert (told["poses"], told["frame"], told["recording"]) == (2, "own", "simulated")
    assert "slack_q1" in told["effects"]
    assert "with corrected readings" in said[0]


@pytest.mark.parametrize(("head", "row", "problem"), [
    (HEAD, "10,5,-5,30,40,20", "no column 'approach_q1'"),
    ("q1_deg,approach_q1", "10,1", "column q2_deg is missing"),
    (HEAD + ",approach_q1", "10,5,-5,30,x,20,1", "is not a number|no number"),
    (HEAD + ",approach_q1,x_mm,y_mm,z_mm", "10,5,-5,30,40,20,1,0,0,0", "from where .* has the tool"),
])  # fmt: skip
def test_poses_that_cannot_be_corrected_are_refused(head: str, row: str, problem: str, tmp_path: Path) -> None:
    with pytest.raises(CmmUqError, match=problem):
        write_corrected_poses(ROBOT, poses(tmp_path, row, head=head), tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(("job", "more", "said"), [
    ("iota-1102-20C", [], "no joints, so no poses"), ("robot-simulated", ["--new-map"], "poses, and goes with nothing else"),
])  # fmt: skip
def test_other_machines_and_other_wishes_are_refused(job: str, more: list[str], said: str, tmp_path: Path) -> None:
    file, out = poses(tmp_path, "1,2,3,4,5,6,1"), str(tmp_path / "out")
    result = CliRunner().invoke(
        app, ["compensate", str(ROOT / "examples" / job), "--poses", str(file), "--out", out, *more]
    )
    assert result.exit_code != 0
    assert said in f"{result.output}{result.exception}"
