"""The recording of every example, damaged: each time a clear error that names line and column, and how to mend it."""

from __future__ import annotations

import shutil
import tomllib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from cmm_uq.commands.diagnosing import diagnose_job
from cmm_uq.commands.reading import read_job
from cmm_uq.errors import CmmUqError

EXAMPLES = Path(__file__).parents[2] / "examples"
NO_POINTS = {"shift-simulated", "shift-plate-simulated", "iota-1102-maps"}
KINDS = sorted({path.parent.name for path in EXAMPLES.glob("*/*.csv")} - NO_POINTS)
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


@pytest.mark.parametrize("example", [name for name in KINDS if not name.startswith(("iota", "bryan"))])
def test_a_single_placing_is_diagnosed_by_its_points(example: str, tmp_path: Path) -> None:
    """No placing can be held out, so its points are, each with its repeats."""
    improvement = diagnose_job(job_with(example, one_place, tmp_path)).diagnosis.improvement
    assert np.isfinite([improvement.heldout_rms_before_um, improvement.heldout_rms_after_um]).all()


@pytest.mark.parametrize("example", ["iota-1102-20C", "bryan-simulated"])
def test_one_distance_determines_nothing(example: str, tmp_path: Path) -> None:
    job = job_with(example, one_place, tmp_path)
    with pytest.raises(CmmUqError):
        diagnose_job(job)
