"""What the statistics find off after the fit is set aside, and named as what it is: a coordinate, a point, a bar."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from cmm_uq.analysis.screening.columns import Finding
from cmm_uq.app.commands.diagnose import screened_model
from cmm_uq.app.commands.reading import read_job
from cmm_uq.machine.model import RecordingModel
from tests.conftest import ROOT

EXAMPLES = ROOT / "examples"


def moved(folder: Path, example: str, row: int, column: str, by_mm: float) -> tuple[RecordingModel, Finding]:
    """An example with one reading moved: its model, and the outlier that is found."""
    job = folder / example
    shutil.copytree(EXAMPLES / example, job)
    recording = pd.read_csv(job / "recording.csv")
    recording.loc[row, column] += by_mm
    recording.to_csv(job / "recording.csv", index=False)
    model, findings = screened_model(read_job(job))
    (outlier,) = [finding for finding in findings if finding.kind == "outlier"]
    return model, outlier


@pytest.mark.parametrize(
    ("row", "column", "named"),
    [
        (7, "x_mm", "the coordinate along the plate's x of point 8 of measurement 1, repeat 1"),
        (12, "z_mm", "the coordinate along the plate's z of point 13 of measurement 1, repeat 1"),
        (30, "z_mm", "the coordinate along the plate's y of point 6 of measurement 2, repeat 1"),
    ],
)
def test_of_a_plate_one_coordinate_is_set_aside_and_the_others_count(
    tmp_path: Path, row: int, column: str, named: str
) -> None:
    """The second placing stands upright: the machine's z is the plate's y."""
    model, outlier = moved(tmp_path, "plate-simulated", row, column, 0.02)
    assert outlier.why.startswith(f"{named} is ")
    assert (outlier.lines, outlier.set_aside) == ((row + 2,), True)
    (left_out,) = np.flatnonzero(~model.used).tolist()
    assert left_out // 3 == row


def test_of_a_gauge_a_sphere_and_a_plane_one_point_is_set_aside(tmp_path: Path) -> None:
    for example, column, named in (
        ("step-gauge-simulated", "x_mm", "point 5 of measurement 1, repeat 1"),
        ("sphere-simulated", "z_mm", "point 5 of measurement 1, repeat 1"),
        ("plane-simulated", "z_mm", "point 4 of measurement 1, repeat 1"),
    ):
        model, outlier = moved(tmp_path, example, 4, column, 0.02)
        assert outlier.why.startswith(f"{named} is ")
        assert outlier.lines == (6,)
        assert (~model.used).sum() == 1
        assert model.artefact.rows[~model.used].ravel().tolist() == [4]


def test_of_a_swept_bar_the_position_is_set_aside(tmp_path: Path) -> None:
    _, outlier = moved(tmp_path, "bryan-simulated", 44, "z_mm", 0.05)
    assert outlier.why.startswith("measurement 45, repeat 1 is ")
