"""The certificate of simulated distances: what was put in comes out, stations too; plans, screening, and the map."""

from __future__ import annotations

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.artefacts.multilateration_coverage import SET_UPS, Square, recorded
from benchmarks.examples.simulated_jobs import multilateration
from cmm_uq.app.commands.jobs.compensate import write_new_map
from cmm_uq.app.commands.jobs.simulate import recording as as_csv
from cmm_uq.app.commands.plan import write_plan
from cmm_uq.app.commands.reading import read_job
from cmm_uq.app.commands.report import write_report
from cmm_uq.artefacts.multilateration.artefact import NEAR_MM
from cmm_uq.base.errors import CmmUqError
from cmm_uq.certificate.document import Paragraph
from cmm_uq.machine.physics.kinematics import on_leaning_axes
from tests.artefacts.simulated import blocks, results
from tests.conftest import ROOT
from tests.recordings import screened

NAME = "multilateration-simulated"
JOB = ROOT / "examples" / NAME
TRUTH = multilateration().truth


def test_all_21_errors_that_were_put_in_are_found() -> None:
    assert len(TRUTH) == 21
    for effect, true in TRUTH.items():
        (found,) = results(NAME)["estimates"][effect].values()
        assert abs(found["value"] - float(true)) < 3 * found["u"], effect  # type: ignore[arg-type]
        assert found["u"] < 0.25 * abs(float(true)), effect  # type: ignore[arg-type]


@pytest.mark.long
def test_stations_stand_where_another_simulator_put_them(tmp_path: Path) -> None:
    """By the table of the certificate too."""
    points = recorded(
        Square(np.random.default_rng(21)), np.arange(6.0), 3e-4 * np.random.default_rng(22).normal(size=288)
    )
    untimed = {name: values for name, values in points.columns.items() if name != "time_s"}
    points = replace(points, columns=untimed)
    stations = json.loads(write_report(job_of(points, tmp_path), tmp_path / "out").results)["stations"]
    assert [one["measurement"] for one in stations] == [1, 2, 3, 4, 5, 6]
    off = np.array([np.array(one["position_mm"]) - place for one, (place, _) in zip(stations, SET_UPS, strict=True)])
    expanded = np.array([one["U_position_um"] for one in stations]) / 1e3
    assert np.abs(off / expanded).max() < 2
    assert np.sqrt(np.mean((off / expanded) ** 2)) < 1
    assert expanded.max() < 5e-3
    paths = [(one["dead_path_mm"] - i) / (1e-3 * one["U_dead_path_um"]) for i, one in enumerate(stations)]
    assert np.abs(paths).max() < 2


def test_what_is_free_is_named_and_is_no_error() -> None:
    assert results(NAME)["free"] == [
        "the position of each station (18 coordinates), and with it every motion of the whole machine",
        "the dead path of each station (6 in all)",
    ]
    paragraphs = [str(block.text) for block in blocks(NAME) if isinstance(block, Paragraph)]
    assert any(
        text.startswith("Free, and no error of the machine: the position of each station") for text in paragraphs
    )


def test_targets_by_distances_alone_are_where_the_model_has_them() -> None:
    found = results(NAME)["targets"]
    assert (len(found["each"]), found["degrees_of_freedom"]) == (48, 38)
    error, expanded, left = (np.array([one[key] for one in found["each"]]) for key in ("error_um", "U_um", "left_um"))
    assert np.mean(np.abs(left) <= expanded) > 0.9
    assert np.sqrt(np.mean(left**2)) < 0.2 * np.sqrt(np.mean(error**2))
    assert 0.3 < found["residual_sd_um"] < 0.55  # 0.4 µm were put in


def test_a_factor_is_decided_by_the_stated_limit() -> None:
    tolerances = results(NAME)["tolerances"]
    assert tolerances["squareness_xy"]["verdict"] == "out"  # 12″ against 10″
    assert tolerances["squareness_yz"]["verdict"] == "in"  # −7.5″


def job_of(points: object, tmp_path: Path, more: str = "") -> Path:
    job = tmp_path / "job"
    shutil.copytree(JOB, job)
    (job / "recording.csv").write_bytes(as_csv(points))  # type: ignore[arg-type]
    toml = (job / "job.toml").read_text(encoding="utf-8").replace("tolerances", "# tolerances")
    (job / "job.toml").write_text(toml.replace("\n[recording]", f"{more}\n[recording]"), encoding="utf-8")
    return job


@pytest.mark.long
def test_the_drift_of_a_dead_path_is_told_with_its_sign(tmp_path: Path) -> None:
    """A distance is the reading and a dead path that grows: 0.1 mm/h of the second station, −0.1 mm/h of the fifth."""
    points = recorded(
        Square(np.random.default_rng(21)), np.arange(6.0), 3e-4 * np.random.default_rng(22).normal(size=288)
    )
    grows = 0.1 * ((points.measurement == 2) * 1.0 - (points.measurement == 5)) * points.columns["time_s"] / 3600
    points = replace(points, columns={**points.columns, "reading_mm": points.columns["reading_mm"] - grows})
    job = job_of(points.select((points.point - 1) // 3 % 3 != 0), tmp_path, "dead_path_drifts = true\n")
    write_report(job, tmp_path / "out")
    stations = json.loads((tmp_path / "out" / "results.json").read_text(encoding="utf-8"))["stations"]
    for one, true in zip(stations, (0.0, 100.0, 0.0, 0.0, -100.0, 0.0), strict=True):
        assert abs(one["drift_um_per_h"] - true) < 1.5 * one["U_drift_um_per_h"] < 50
    page = (tmp_path / "out" / "certificate-simulated.html").read_text(encoding="utf-8")
    told = re.findall(r"Measurement (\d): the dead path drifts by (\S+) ± (\S+) µm/h", page)
    assert [which for which, *_ in told] == list("123456")
    assert float(told[4][1].replace("−", "-")) == pytest.approx(stations[4]["drift_um_per_h"], abs=1)
    assert float(told[4][2]) == pytest.approx(stations[4]["U_drift_um_per_h"], rel=0.06)
    assert "how each dead path drifts, in proportion to time" in page


@pytest.mark.long
def test_a_map_of_the_distances_corrects_the_machine_and_the_other_sign_spoils_it(tmp_path: Path) -> None:
    """Distances between places anywhere, by the simulator that shares no code."""
    machine = Square(np.random.default_rng(12))
    points = recorded(machine, np.arange(6.0), 3e-4 * np.random.default_rng(13).normal(size=288))
    _, found = write_new_map(job_of(points, tmp_path), tmp_path / "map")
    random, travel = np.random.default_rng(2), np.array([[0, 900], [0, 1200], [-600, 0.0]])
    first, second = (travel[:, 0] + random.random((400, 3)) * np.ptp(travel, axis=1) for _ in range(2))

    def by_map(xyz: np.ndarray) -> np.ndarray:
        figures = np.stack([
            np.column_stack([np.interp(xyz[:, i], axis.positions, axis.errors[:, k]) for k in range(6)])
            for i, axis in enumerate(found.error_map.axes)
        ], axis=1)  # fmt: skip
        return on_leaning_axes(xyz, figures, found.error_map.squareness, chain="XYZ")

    along = second - first
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    none = np.zeros(3)
    true, known = (
        np.sum((of(second) - of(first)) * along, axis=1) for of in (lambda xyz: machine.off(xyz, none), by_map)
    )
    left, before, other = (float(np.sqrt(np.mean(each**2))) for each in (true - known, true, true + known))
    assert left < 0.2 * before < before < 1.8 * before < other


def test_a_reading_that_is_no_distance_of_its_station_is_set_aside() -> None:
    job = read_job(JOB)
    columns = dict(job.points.columns)
    columns["reading_mm"] = columns["reading_mm"] + 20.0 * (np.arange(288) == 100)
    found = screened(
        replace(job.points, columns=columns), job.facts.artefact, needed=set(), set_aside=[], where="recording.csv"
    )
    (one,) = found.findings
    assert (one.rows, len(found.points)) == ((100,), 287)


@pytest.mark.parametrize(
    ("how", "said"),
    [
        pytest.param("inches", "inches", marks=pytest.mark.long), ("few", "has 5 targets"), ("nan", "line 3"),
        ("negative scale", "line 20: [artefact] u_scale_um_per_m"),
    ],
)  # fmt: skip
def test_a_recording_that_cannot_be_is_refused_with_place_and_fix(how: str, said: str, tmp_path: Path) -> None:
    job = job_of(read_job(JOB).points, tmp_path)
    head, *rows = (job / "recording.csv").read_text(encoding="utf-8").splitlines()
    cells = [row.split(",") for row in rows]
    if how == "inches":
        cells = [[*row[:9], repr(float(row[9]) / 25.4)] for row in cells]
    if how == "few":
        cells = cells[43:]
    if how == "nan":
        cells[1][9] = "nan"
    if how == "negative scale":
        toml = (job / "job.toml").read_text(encoding="utf-8")
        (job / "job.toml").write_text(toml.replace("per_m = 0.2", "per_m = -0.2"), encoding="utf-8")
    (job / "recording.csv").write_text("\n".join([head, *map(",".join, cells)]) + "\n", encoding="utf-8")
    with pytest.raises(CmmUqError) as told:
        write_report(job, tmp_path / "out")
    assert said in str(told.value)


PLAN = '\n[plan]\ngrid = [3, 3]\nrepeats = 1\ncriterion = "D"\nnumber = 4\ncandidates = 75\n'


@pytest.mark.long
def test_a_plan_finds_stations_that_tell_more_than_four_corners(tmp_path: Path) -> None:
    job = tmp_path / "job"
    shutil.copytree(JOB, job)
    (job / "recording.csv").unlink()
    toml = (job / "job.toml").read_text(encoding="utf-8").replace('origin = "simulated"\n', "")
    names = toml[toml.index("effects = [") : toml.index("\n", toml.index("effects = ["))]
    toml = toml.replace(names, 'effects = ["scale_x", "scale_y", "scale_z", "squareness_xy"]')
    toml = toml.replace("tolerances", "# tolerances") + PLAN
    (job / "job.toml").write_text(toml, encoding="utf-8")
    better = json.loads(write_plan(job, tmp_path / "plan", power=False).results)
    start = {one["effect"]: one["u"] for one in better["start"]["determined"]}
    after = {one["effect"]: one["u"] for one in better["better"]["determined"]}
    assert np.prod(list(after.values())) < np.prod(list(start.values()))
    assert all(one["title"].startswith("station at (") for one in better["placings"])
    lines = (tmp_path / "plan" / "plan.csv").read_text(encoding="utf-8").splitlines()
    readings = [float(line.split(",")[lines[1].split(",").index("reading_mm")]) for line in lines[2:]]
    assert min(readings) > NEAR_MM
