"""The recording of every example, damaged: each time a clear error that names line and column, and how to mend it."""

from __future__ import annotations

import shutil
import tomllib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from cmm_uq.app.commands.diagnose import diagnose_job
from cmm_uq.app.commands.reading import read_job
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.limits import OBSERVATIONS

EXAMPLES = Path(__file__).parents[3] / "examples"
NO_POINTS = {"shift-simulated", "shift-plate-simulated", "iota-1102-maps"}
KINDS = sorted(
    {path.parent.name for path in EXAMPLES.glob("*/*.csv") if not path.parent.name.startswith("part-")} - NO_POINTS
)
Damage = Callable[[pd.DataFrame], pd.DataFrame]


def cell(column: str, value: object) -> Damage:
    def damaged(table: pd.DataFrame) -> pd.DataFrame:
        table = table.astype(object)
        table.loc[3, column] = value
        return table

    return damaged


def one_place(table: pd.DataFrame) -> pd.DataFrame:
    return table[table.measurement == table.measurement.iloc[0]]


def job_with(example: str, damage: Damage, folder: Path) -> Path:
    job = folder / "job"
    shutil.copytree(EXAMPLES / example, job)
    recording = job / tomllib.loads((job / "job.toml").read_text(encoding="utf-8"))["recording"]["file"]
    damage(pd.read_csv(recording, comment="#")).to_csv(recording, index=False)
    return job


@pytest.mark.parametrize("example", KINDS)
@pytest.mark.parametrize(
    ("damage", "says"),
    [
        (cell("x_mm", np.nan), "line 5, column x_mm: no value"),
        (cell("y_mm", "abc"), "line 5, column y_mm: 'abc' is not a number"),
        (cell("z_mm", "inf"), "line 5, column z_mm: 'inf' is not a finite number"),
        (lambda table: table.drop(columns=["x_mm"]), "no column 'x_mm'"),
        (lambda table: table.drop(columns=["point"]), "no column 'point'"),
        (lambda table: table.head(0), "has no rows"),
        (lambda table: pd.concat([table, table]), "is there twice"),
    ],
    ids=["no value", "text", "infinite", "no coordinate", "no point", "empty", "every row twice"],
)
def test_a_damaged_recording_is_refused_with_its_place(example: str, damage: Damage, says: str, tmp_path: Path) -> None:
    with pytest.raises(CmmUqError) as error:
        read_job(job_with(example, damage, tmp_path))
    assert says in str(error.value)
    assert error.value.fix


@pytest.mark.parametrize("example", KINDS)
def test_three_rows_are_too_few_for_any_artefact(example: str, tmp_path: Path) -> None:
    with pytest.raises(CmmUqError) as error:
        diagnose_job(job_with(example, lambda table: table.head(3), tmp_path))
    assert error.value.fix


@pytest.mark.parametrize("example", [name for name in KINDS if not name.startswith(("iota", "bryan", "digitizer"))])
def test_a_single_placing_is_diagnosed_by_its_points(example: str, tmp_path: Path) -> None:
    """No placing can be held out, so its points are, each with its repeats."""
    improvement = diagnose_job(job_with(example, one_place, tmp_path)).diagnosis.improvement
    assert np.isfinite([improvement.heldout_rms_before_um, improvement.heldout_rms_after_um]).all()


@pytest.mark.parametrize("example", ["iota-1102-20C", "bryan-simulated", "digitizer-simulated"])
def test_one_distance_or_attitude_determines_nothing(example: str, tmp_path: Path) -> None:
    job = job_with(example, one_place, tmp_path)
    with pytest.raises(CmmUqError):
        diagnose_job(job)


@pytest.mark.parametrize("row", [0, 4, 41])
def test_a_triangle_without_one_of_its_corners_is_refused(row: int, tmp_path: Path) -> None:
    job = job_with("triangle-simulated", lambda table: table.drop(index=row), tmp_path)
    with pytest.raises(CmmUqError, match="the triangle does not close"):
        diagnose_job(job)


def test_more_observations_than_memory_holds_are_refused_before_the_estimate(tmp_path: Path) -> None:
    """Each coordinate of a ball is an observation; a flat grid of them passes everything else."""
    balls = np.arange(OBSERVATIONS.most // 3 + 1)
    grid = {"reference_x_mm": balls % 400 * 2.0, "reference_y_mm": balls // 400 * 2.0, "reference_z_mm": 0.0}
    noise = np.random.default_rng(3).normal(0, 1e-3, (3, len(balls)))
    read = {f"{axis}_mm": grid[f"reference_{axis}_mm"] + noise[i] for i, axis in enumerate("xyz")}
    columns = {"measurement": 1, "point": balls + 1, "repeat": 1, **read, **grid}
    job = job_with("plate-simulated", lambda _: pd.DataFrame(columns), tmp_path)
    with pytest.raises(CmmUqError, match=f"{3 * len(balls)} observations are more than are estimated from at once"):
        diagnose_job(job)
