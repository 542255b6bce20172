"""Outliers of one repeat that follow one another, and of one point in many set-ups, are one finding; others stay several."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from cmm_uq.analysis.screening.columns import Finding
from cmm_uq.analysis.screening.screening import moved_stretches, point_words, recurring_points
from cmm_uq.app.commands.diagnose import screened_model
from cmm_uq.app.commands.estimation import without_outliers
from cmm_uq.app.commands.reading import read_job
from cmm_uq.artefacts import artefact_facts, artefact_of
from cmm_uq.machine.model import RecordingModel
from tests.artefacts.constructions import step_gauge
from tests.conftest import ROOT

FACE = 9
BY_MM = (0.03, -0.02, 0.025)
"""A shift along all axes: far more than the noise of any example, along whichever line a gauge lies."""


def outliers_after(folder: Path, example: str, rows: list[int], order: int = 1) -> tuple[list[Finding], int]:
    """What is told of an example with some rows moved, and how many observations are set aside."""
    job = folder / example
    shutil.copytree(ROOT / "examples" / example, job)
    recording = pd.read_csv(job / "recording.csv")
    recording.loc[rows, ["x_mm", "y_mm", "z_mm"]] += np.array(BY_MM)
    recording[::order].to_csv(job / "recording.csv", index=False)
    model, findings = screened_model(read_job(job))
    return [each for each in findings if each.kind == "outlier"], int((~model.used).sum())


@pytest.mark.parametrize("order", [1, -1])
def test_points_that_moved_one_after_the_other_are_told_once_whatever_the_order_of_rows(
    tmp_path: Path, order: int
) -> None:
    """The recording was moved here at these points, which is the truth that the sentence is held to."""
    (told,), set_aside = outliers_after(tmp_path, "step-gauge-simulated", [0, 1, 2, 3], order)
    assert told.why.startswith("points 1 to 4 of measurement 1, repeat 1 are ")
    assert "moved during this repeat" in told.why
    assert (len(told.lines), told.set_aside, set_aside) == (4, True, 4)


def test_points_far_from_one_another_are_told_one_by_one(tmp_path: Path) -> None:
    told, set_aside = outliers_after(tmp_path, "step-gauge-simulated", [0, 5, 9])
    assert all(each.why.startswith("point ") for each in told)
    assert len(told) == set_aside == 3


def test_a_whole_repeat_and_two_neighbours_are_no_stretch(tmp_path: Path) -> None:
    points = screened_model(read_job(ROOT / "examples" / "step-gauge-simulated"))[0].artefact.points
    whole = np.flatnonzero(points.group == points.group[0])
    assert not moved_stretches(points, whole)
    assert not moved_stretches(points, whole[:2])
    ((first, *_, last),) = moved_stretches(points, np.append(whole[:4], whole[5]))
    assert (points.point[first], points.point[last]) == (1, 6)


def test_a_point_is_told_once_where_it_is_off_in_most_readings_of_several_set_ups() -> None:
    points = screened_model(read_job(ROOT / "examples" / "step-gauge-simulated"))[0].artefact.points
    rows = np.flatnonzero(points.point == 3)
    ((*found,),) = recurring_points(points, np.append(rows[1:], np.flatnonzero(points.point == 5)[0]))
    assert found == rows[1:].tolist()
    told = point_words(points, rows[1:], [5.0, 9.0])
    assert told.startswith("point 3 is 5.0 to 9.0 of its standard deviations off")
    assert f"in {len(rows) - 1} of its {len(rows)} readings" in told


def test_a_face_that_is_off_on_every_line_is_told_once_and_stays_in_the_estimate() -> None:
    """Face 9 of 22 is 20 µm farther along the gauge wherever it lies: no gross error, but the artefact itself."""
    gauge = step_gauge()
    lines = [gauge.xyz[gauge.measurement == number] for number in np.unique(gauge.measurement)]
    along = np.concatenate(
        [np.tile((line[-1] - line[0]) / np.linalg.norm(line[-1] - line[0]), (22, 1)) for line in lines]
    )
    off = np.where(gauge.point == FACE, 0.02, 0.0) + np.random.default_rng(4).normal(0, 5e-4, len(gauge.xyz))
    facts = artefact_facts(kind="step_gauge", length_mm=420.0, u_um=0.1)
    model, (told,) = without_outliers(
        RecordingModel(artefact_of(facts, gauge.at(gauge.xyz + off[:, None] * along)), ())
    )
    assert told.why.startswith(f"point {FACE} is ")
    assert f"in {len(lines)} of its {len(lines)} readings" in told.why
    assert not told.set_aside
    assert model.used.all()


def test_a_point_that_is_off_in_one_set_up_or_in_few_readings_is_told_reading_by_reading() -> None:
    points = screened_model(read_job(ROOT / "examples" / "step-gauge-simulated"))[0].artefact.points
    rows = np.flatnonzero(points.point == 3)
    assert not recurring_points(points, rows[points.measurement[rows] == points.measurement[rows[0]]])
    assert not recurring_points(points, rows[::2])
