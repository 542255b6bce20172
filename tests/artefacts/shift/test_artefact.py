"""Shift jobs that are simulated and searched for effects, and the source's experiments side by side."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.examples.shift_source_job import EQUAL, UNEQUAL, error
from cmm_uq.app.commands.diagnose import write_diagnosis
from cmm_uq.app.commands.jobs.simulate import write_simulation
from cmm_uq.app.commands.reading import read_job
from cmm_uq.app.commands.report import write_report
from cmm_uq.artefacts.kinds import ShiftFacts
from cmm_uq.artefacts.shift.artefact import ShiftedArtefact
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats
from cmm_uq.jobs.job import Job
from tests.app.cli.process import run
from tests.conftest import ROOT

AXIS, PLANE, SOURCE = (ROOT / "examples" / f"shift-{name}simulated" for name in ("", "plate-", "source-"))
WAVE = """
seed = 4
[effects.periodic_scale_x]
amplitude_um = 6.0
period_mm = 130.0
phase_rad = 0.4
[noise]
coordinate_um = {noise}
"""


def simulated(job: Path, truth: str, folder: Path) -> Path:
    (folder / "truth.toml").write_text(truth, encoding="utf-8")
    return write_simulation(job, folder / "truth.toml", folder / "drawn")["job.toml"].parent


def artefact_of(job: Job) -> ShiftedArtefact:
    assert isinstance(job.facts.artefact, ShiftFacts)
    return ShiftedArtefact(job.facts.artefact, job.points)


def wave(x: Floats) -> Floats:
    return np.asarray(6e-3 * np.sin(2 * np.pi * x / 130 + 0.4))


def test_a_simulated_gauge_is_as_long_in_every_series_once_its_readings_are_corrected(tmp_path: Path) -> None:
    """By the wave itself, true = indicated + e: without noise every point lies where the same shift puts it in all series."""
    points = read_job(simulated(AXIS, WAVE.format(noise=0.0), tmp_path)).points
    true = points.readings["x"] + wave(points.readings["x"])
    places = np.array([true[(points.measurement == s) & (points.repeat == 1)] for s in (1, 2, 3)])
    steps = places - places[0]
    np.testing.assert_allclose(steps, np.broadcast_to(steps[:, :1], steps.shape), atol=2e-6)
    np.testing.assert_allclose(places[0, -1] - places[0, 0], 440.0, atol=2e-6)  # its known length
    reversed_sign = points.readings["x"] - wave(points.readings["x"])
    other = np.array([reversed_sign[(points.measurement == s) & (points.repeat == 1)] for s in (1, 2, 3)])
    assert np.ptp(other - other[0], axis=1).max() > 5e-3


def test_a_simulated_plate_has_one_shape_in_every_placing(tmp_path: Path) -> None:
    points = read_job(simulated(PLANE, WAVE.format(noise=0.0), tmp_path)).points
    true = points.xyz[:, :2] + np.column_stack([wave(points.readings["x"]), np.zeros(len(points))])

    def distances(measurement: int) -> Floats:
        own = (points.measurement == measurement) & (points.repeat == 1)
        plate = true[own][np.argsort(points.point[own])]
        return np.asarray(np.linalg.norm(plate[:, None] - plate[None], axis=2))

    for measurement in np.unique(points.measurement)[1:].tolist():
        np.testing.assert_allclose(distances(measurement), distances(1), atol=2e-6)
    np.testing.assert_allclose(distances(1)[0, 24], 565.6883, atol=1e-4)


@pytest.mark.parametrize("job", [AXIS, PLANE])
def test_what_dimensions_and_placings_take_up_is_no_observation(job: Path) -> None:
    """Moved in one placing, or with a dimension changed in all, the readings are fitted as before; a bend is not."""
    read = read_job(job)
    artefact, sizes = artefact_of(read), np.array([s.nominal for s in artefact_of(read).sizes])
    xyz = read.points.xyz
    own = (read.points.measurement == 2)[:, None] * np.array([0.02, 0.0, 0.0])
    grown = (read.points.point == 5)[:, None] * np.array([0.01, 0.0, 0.0])
    bent = 1e-6 * (xyz[:, :1] - 300.0) ** 2 * np.array([1.0, 0.0, 0.0])
    left = [np.abs(artefact.fit(xyz + moved, sizes) - xyz - moved)[:, 0].max() for moved in (0.0 * own, own, bent)]
    assert abs(left[1] - left[0]) < 1e-6
    assert left[2] > left[0] + 2e-3
    if job == AXIS:
        assert abs(np.abs(artefact.fit(xyz + grown, sizes) - xyz - grown)[:, 0].max() - left[0]) < 1e-6


@pytest.mark.long
@pytest.mark.parametrize("job", [AXIS, PLANE])
def test_noise_alone_is_consistent_and_a_wave_is_found_with_its_size(job: Path, tmp_path: Path) -> None:
    (tmp_path / "noise").mkdir()
    noise = simulated(job, "seed = 2\n[noise]\ncoordinate_um = 1.1\n", tmp_path / "noise")
    assert json.loads(write_diagnosis(noise, tmp_path / "first").results)["diagnosis"]["verdict"] == "consistent"
    found = json.loads(write_diagnosis(simulated(job, WAVE.format(noise=1.1), tmp_path), tmp_path / "second").results)
    (effect,) = found["diagnosis"]["effects"]
    assert effect["effect"] == "periodic_scale_x"
    amplitude = effect["parameters"]["amplitude_um"]
    assert amplitude["interval95"][0] - amplitude["u"] < 6.0 < amplitude["interval95"][1] + amplitude["u"]


@pytest.mark.long
def test_the_report_of_a_simulated_gauge_holds_the_wave_with_its_sign(tmp_path: Path) -> None:
    results = json.loads(write_report(simulated(AXIS, WAVE.format(noise=1.1), tmp_path), tmp_path / "out").results)
    curve = results["curves"]["linearity_x"]
    x = np.array(curve["position_mm"])
    true = (wave(x) - wave(x[:1])) * 1e3
    assert np.abs(np.array(curve["error_um"]) - true).max() < 2 * max(curve["band_um"])
    assert np.corrcoef(curve["error_um"], true)[0, 1] > 0.9


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Any:
    return json.loads(write_report(SOURCE, tmp_path_factory.mktemp("source") / "out").results)


def test_equal_unequal_and_improved_integration_stand_side_by_side(source: Any) -> None:
    every, equal, unequal = source["selections"]
    assert [len(every["points"]), equal["points"], unequal["points"]] == [23, EQUAL, UNEQUAL]
    assert every["pitch"]["error_um"] == source["integrations"]["pitch"]["error_um"]
    left = [each[method]["left_um"] for each in (equal, unequal) for method in ("pitch", "improved")]
    assert every["pitch"]["left_um"] < left[1] < left[0]
    assert left[3] < left[2]


def test_a_selection_is_the_integration_of_its_own_points_written_out(source: Any) -> None:
    """Equations 3, 6 and 8 for the twelve at unequal pitch, from the means of the recording."""
    points = read_job(SOURCE).points
    a, b = (
        np.array([points.xyz[(points.measurement == s) & (points.point == p), 0].mean() for p in UNEQUAL])
        for s in (1, 2)
    )
    slope = 1.0 / (b - a)
    pitch = np.cumsum(np.r_[0.0, slope[:-1] * np.diff(a)])
    improved = np.cumsum(np.r_[0.0, slope[:-1] * (b - a)[:-1] + 0.5 * (slope[:-1] + slope[1:]) * (a[1:] - b[:-1])])
    for name, curve in (("pitch", pitch), ("improved", improved)):
        expected = (curve * 440.0 / curve[-1] - (a - a[0])) * 1e3
        np.testing.assert_allclose(source["selections"][2][name]["error_um"], expected, atol=1e-6)


def test_what_an_integration_leaves_is_what_it_leaves_of_the_truth_within_its_uncertainty(source: Any) -> None:
    for one in source["selections"]:
        x = np.array(one["pitch"]["position_mm"])
        true = (error(x) - error(x[:1])) * 1e3
        for method in ("pitch", "improved"):
            of_truth = float(np.ptp(np.array(one[method]["error_um"]) - true))
            assert abs(one[method]["left_um"] - of_truth) < 4 * one[method]["u_left_um"]


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("[1, 3, 5,", "[1, 3, 55,", "there is no point 55"),
        ("integrated_points = [[1, 3,", "integrated_points = [[3,", "among them 1 and 23"),
        ("shifts_mm = [0.0, 20.0]", "shifts_mm = [0.0, 20.0, 50.0]", "integrated_points are of two series"),
    ],
)
def test_points_that_make_no_integration_are_refused(old: str, new: str, told: str, tmp_path: Path) -> None:
    shutil.copytree(SOURCE, tmp_path / "job")
    job = tmp_path / "job" / "job.toml"
    text = job.read_text(encoding="utf-8")
    assert old in text
    job.write_text(text.replace(old, new, 1), encoding="utf-8")
    done = run("report", "job", "--out", "out", cwd=tmp_path)
    assert done.returncode == 2
    assert told in done.stderr
    assert "integrated_points" in done.stderr


def test_a_gauge_in_one_place_is_refused_alike(tmp_path: Path) -> None:
    job = read_job(AXIS)
    with pytest.raises(CmmUqError):
        ShiftedArtefact(job.facts.artefact, job.points.at(0.0 * job.points.xyz))  # type: ignore[arg-type]
