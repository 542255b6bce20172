"""Recordings and clouds of machines with rotary axes: corrected by maps of their carriages, and by errors of their axes."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from benchmarks.artefacts.rotary_table_coverage import SECOND, SPHERES, recorded, turning
from cmm_uq.app.commands.jobs.compensate import (
    compensate_job,
    worth_of,
    write_compensated,
    write_compensated_cloud,
    write_new_map,
)
from cmm_uq.app.commands.reading import read_job
from cmm_uq.base.errors import CmmUqError
from tests.app.cli.process import run

TRUE = {  # of the table that is calibrated
    "rotary_location_c_x": np.array([11.0]), "rotary_location_c_y": np.array([-7.0]),
    "rotary_tilt_c_x": np.array([6.0]), "rotary_tilt_c_y": np.array([-4.0]),
    "rotary_positioning_c_1": np.array([3.0, -2.0]), "rotary_play_c": np.array([2.5]),
}  # fmt: skip
MAP = "axis,position_mm,dx_um,dy_um,dz_um,rx_arcsec,ry_arcsec,rz_arcsec\n" + "".join(
    f"{axis},{at},{at if axis == 'x' else 0},0,0,0,0,0\n" for axis in "xyz" for at in (-1000, 2000)
)


THREE = np.vstack([SPHERES, [-40.0, 170.0, 120.0]])


def exact(xyz: np.ndarray, degrees: np.ndarray, senses: np.ndarray) -> np.ndarray:
    """What the machine indicates without noise of places on its table, by rotation matrices alone."""
    offset = 1e-3 * np.array([TRUE["rotary_location_c_x"][0], TRUE["rotary_location_c_y"][0], 0.0])
    lean = turning(SECOND * np.array([TRUE["rotary_tilt_c_x"][0], TRUE["rotary_tilt_c_y"][0], 0.0]))
    found, (a, b) = [], TRUE["rotary_positioning_c_1"]
    for place, at, sense in zip(xyz, np.radians(degrees), senses, strict=True):
        own = a * np.cos(at) - b * np.sin(at) + 0.5 * sense * TRUE["rotary_play_c"][0]
        about = turning(SECOND * np.array([0, 0, own])) @ lean @ turning(np.array([0, 0, at])) @ lean.T
        found.append(turning(np.array([0, 0, at])).T @ (offset + about @ (place - offset)))
    return np.array(found)


@pytest.fixture(scope="module")
def calibrated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The file of errors of a simulated table, and what was said of it."""
    folder = tmp_path_factory.mktemp("table")
    out = np.linspace(0, 360, 17)
    turns = np.concatenate([out, out[-2::-1]]), np.repeat([0.0, 1.0, -1.0], [1, 16, 16])
    recorded(TRUE, list(TRUE), np.random.default_rng(5), folder / "job", THREE, turns)
    _, found = write_new_map(folder / "job", folder / "errors")
    (folder / "worth.txt").write_text("\n".join(worth_of(found)))
    return folder


def other(calibrated: Path, folder: Path, *, play: bool = True, extra: str = "") -> tuple[Path, np.ndarray]:
    """A job of other spheres at other angles of the same table, without noise, and where they truly are."""
    random = np.random.default_rng(11)
    n = 60
    true = np.repeat(random.uniform(-200, 200, (6, 3)) + np.array([0, 0, 150]), 10, axis=0)
    degrees, senses = random.uniform(0, 720, n), random.choice([-1.0, 1.0], n)
    folder.mkdir()
    head, rows = "measurement,point,repeat,x_mm,y_mm,z_mm,c_deg", []
    for i, xyz in enumerate(exact(true, degrees, senses)):
        row = f"1,{i // 10 + 1},{i % 10 + 1},{','.join(f'{v:.7f}' for v in xyz)},{degrees[i]:.6f}"
        rows.append(f"{row},{senses[i]:g}" if play else row)
    text = "\n".join([head + (",c_approach" if play else ""), *rows]) + "\n"
    (folder / "recording.csv").write_text(text, encoding="utf-8")
    toml = (calibrated / "job" / "job.toml").read_text(encoding="utf-8")
    key = (calibrated / "errors" / "rotary-errors.toml").read_text(encoding="utf-8").splitlines()[1]
    (folder / "job.toml").write_text(toml.replace("[artefact]", f"{key}\n{extra}[artefact]"), encoding="utf-8")
    for name in ("rotary-errors.csv", "rotary-errors-covariance.npy"):
        shutil.copy(calibrated / "errors" / name, folder / name)
    return folder, true


@pytest.mark.long
def test_another_set_up_on_the_table_is_corrected_to_within_its_uncertainty(calibrated: Path, tmp_path: Path) -> None:
    """Spheres and angles that the calibration has not seen: u says how little is left."""
    job, true = other(calibrated, tmp_path / "part")
    before = read_job(job).points.xyz
    files = write_compensated(job, tmp_path / "out")
    after = read_job(tmp_path / "out").points.xyz
    u = 1e-3 * np.loadtxt(tmp_path / "out" / "points-u.csv", delimiter=",", skiprows=1)[:, 3:]
    off, left = (float(np.sqrt(np.mean((each - true) ** 2))) for each in (before, after))
    assert off > 8e-3
    assert left < 0.03 * off
    assert 0.5 < left / np.sqrt(np.mean(u**2)) < 2
    assert np.mean(np.abs(after - true) < 2 * u) > 0.93
    told = json.loads((tmp_path / "out" / "compensation.json").read_text(encoding="utf-8"))
    assert told["rotary_errors"]["file"] == "rotary-errors.csv"
    assert "rotary_play_c" in told["rotary_errors"]["effects"]
    assert [row["up_to_mm"] for row in told["distances"]] == sorted(row["up_to_mm"] for row in told["distances"])
    assert all(0 < row["u_um"] < 10 for row in told["distances"])
    assert "rotary_errors" not in (tmp_path / "out" / "job.toml").read_text(encoding="utf-8")
    assert {"points-u.csv", "compensation.json", "recording.csv"} <= set(files)


@pytest.mark.long
def test_distances_on_the_part_lie_within_their_uncertainty(calibrated: Path, tmp_path: Path) -> None:
    """Between spheres at other angles; u of distances is smaller than that of points as if these shared nothing."""
    job, true = other(calibrated, tmp_path / "part")
    points, told = compensate_job(read_job(job))
    assert told["sign"] == "true = indicated + e"
    from cmm_uq.app.commands.jobs.compensate_rotary import RotaryCompensation
    from cmm_uq.machine.physics.map_interpolation import of_distances

    read = read_job(job)
    by = RotaryCompensation.of(read, "refuse")
    root, beside = by.uncertain(read.points)
    first, second = (each[:300] for each in np.triu_indices(60, 10))
    u = of_distances(root, beside, points.xyz, (first, second))
    found, right = (np.linalg.norm(xyz[second] - xyz[first], axis=1) for xyz in (points.xyz, true))
    apart = right > 1
    assert np.mean(np.abs(found - right)[apart] < 2 * u[apart]) > 0.93
    assert np.all(u[apart] > 0)


@pytest.mark.long
def test_what_the_file_is_worth_is_tried_on_angles_held_out(calibrated: Path) -> None:
    told = json.loads((calibrated / "errors" / "compensation.json").read_text(encoding="utf-8"))
    held = told["held_out_rms_um"]
    assert held["left_out"] == "angles"
    assert held["corrected"] < 0.1 * held["uncorrected"]
    assert held["corrected"] == pytest.approx(held["predicted"]["corrected"], rel=0.2)
    assert told["range_rms_um"]["corrected"] < 0.05 * told["range_rms_um"]["uncorrected"]
    said = (calibrated / "worth.txt").read_text()
    assert "Angles held out are off by" in said
    assert "rotary-errors.toml holds the key" in said


@pytest.mark.long
def test_a_cloud_is_corrected_as_a_recording_is(calibrated: Path, tmp_path: Path) -> None:
    job, _ = other(calibrated, tmp_path / "part")
    rows = np.loadtxt(job / "recording.csv", delimiter=",", skiprows=1)[:, 3:]
    np.save(tmp_path / "scan.npy", rows)
    text = "x_mm,y_mm,z_mm,c_deg,c_approach\n" + "\n".join(",".join(f"{v:.7f}" for v in row) for row in rows)
    (tmp_path / "scan.csv").write_text(text + "\n", encoding="utf-8")
    points, _ = compensate_job(read_job(job))
    write_compensated(job, tmp_path / "whole")
    u = np.loadtxt(tmp_path / "whole" / "points-u.csv", delimiter=",", skiprows=1)[:, 3:]
    for name in ("scan.csv", "scan.npy"):
        write_compensated_cloud(job, tmp_path / name, tmp_path / f"of-{name}")
        made = tmp_path / f"of-{name}" / f"scan-compensated{Path(name).suffix}"
        found = np.load(made) if name.endswith("npy") else np.loadtxt(made, delimiter=",", skiprows=2)
        np.testing.assert_allclose(found[:, :3], points.xyz, atol=2e-7)
        np.testing.assert_allclose(1e3 * found[:, 3:], u, atol=2e-4)
        told = json.loads((tmp_path / f"of-{name}" / "compensation.json").read_text(encoding="utf-8"))
        assert told["columns"] == ["x_mm", "y_mm", "z_mm", "c_deg", "c_approach"]
        assert told["distances"]


def on_a_chain(folder: Path, chain: str, keys: str, columns: str, angle: float) -> Path:
    """A job of a machine whose X is too short by 1 mm/m, read at one place with an axis at an angle."""
    folder.mkdir()
    (folder / "map.csv").write_text(MAP, encoding="utf-8")
    toml = f"""[job]
id = "turned"
date = 2026-01-01
origin = "simulated"
[machine]
name = "m"
chain = "{chain}"
error_map = [{{ file = "map.csv", temperature_c = 20.0 }}]
origin_mm = [450.0, 600.0, -400.0]
{keys}
[artefact]
kind = "table_spheres"
[recording]
file = "recording.csv"
[model]
effects = []
"""
    (folder / "job.toml").write_text(toml, encoding="utf-8")
    rows = [f"1,1,{i},100,20,30,{angle}" for i in (1, 2)] + [f"1,2,{i},-60,50,90,{angle}" for i in (1, 2)]
    (folder / "recording.csv").write_text(
        "\n".join([f"measurement,point,repeat,x_mm,y_mm,z_mm,{columns}", *rows]) + "\n"
    )
    return folder


def test_a_map_of_the_carriages_acts_where_a_turned_table_had_them(tmp_path: Path) -> None:
    """With the table at 90° its x is the machine's y: X reads 450 − 20 mm there, and errs along −y of the table."""
    job = on_a_chain(tmp_path / "job", "XYZ|C", "", "c_deg", 90.0)
    found = compensate_job(read_job(job))[0].xyz - read_job(job).points.xyz
    np.testing.assert_allclose(found[0], [0.0, -0.430, 0.0], atol=1e-9)
    np.testing.assert_allclose(found[2], [0.0, -0.400, 0.0], atol=1e-9)


def test_a_map_of_the_carriages_acts_where_a_turned_head_had_them(tmp_path: Path) -> None:
    """A stylus of 100 mm along x, turned by 180°: the ram stands 200 mm further along x than with the head at 0."""
    job = on_a_chain(tmp_path / "job", "XYZ-C", "head = { stylus_mm = [100.0, 0.0, 0.0] }", "c_deg", 180.0)
    found = compensate_job(read_job(job))[0].xyz - read_job(job).points.xyz
    np.testing.assert_allclose(found[0], [0.750, 0.0, 0.0], atol=1e-9)


@pytest.mark.long
def test_maps_and_errors_of_the_axes_add_up(calibrated: Path, tmp_path: Path) -> None:
    job, _ = other(calibrated, tmp_path / "part", extra='error_map = [{ file = "map.csv", temperature_c = 20.0 }]\n')
    (job / "map.csv").write_text(MAP, encoding="utf-8")
    together, told = compensate_job(read_job(job))
    alone, _ = compensate_job(read_job(other(calibrated, tmp_path / "alone")[0]))
    read = read_job(job).points
    e = read.on_artefact((1e-3 * read.carriages * [1, 0, 0])[:, :, None])[:, :, 0]
    np.testing.assert_allclose(together.xyz - alone.xyz, e, atol=1e-9)
    assert told["u"] == "of the rotary errors alone: the map has no covariance"
    assert told["error_maps"][0]["file"] == "map.csv"


def refused(job: Path, problem: str, where: str) -> None:
    with pytest.raises(CmmUqError) as told:
        compensate_job(read_job(job))
    assert problem in str(told.value)
    assert where in str(told.value.where)


@pytest.mark.long
def test_what_cannot_be_corrected_is_refused(calibrated: Path, tmp_path: Path) -> None:
    job, _ = other(calibrated, tmp_path / "side", play=False)
    refused(job, "the errors go by c_approach, which is not there", "recording.csv")
    job, _ = other(calibrated, tmp_path / "chain")
    toml = job / "job.toml"
    toml.write_text(toml.read_text().replace('"XYZ|C"', '"XYZ|B"'), encoding="utf-8")
    rows = job / "recording.csv"
    rows.write_text(rows.read_text().replace("c_deg", "b_deg"), encoding="utf-8")
    refused(job, "is of a rotary table C", "rotary-errors.csv")
    job, _ = other(calibrated, tmp_path / "measured")
    toml = job / "job.toml"
    toml.write_text(toml.read_text().replace('origin = "simulated"', ""), encoding="utf-8")
    refused(job, "was made of a simulated recording", "rotary-errors.csv")
    job, _ = other(calibrated, tmp_path / "same")
    shutil.copy(calibrated / "job" / "recording.csv", job / "recording.csv")
    refused(job, "was made of this very recording", "rotary-errors.csv")


@pytest.mark.long
def test_errors_of_rotary_axes_are_of_no_machine_without_them(calibrated: Path, tmp_path: Path) -> None:
    job, _ = other(calibrated, tmp_path / "part")
    toml = job / "job.toml"
    toml.write_text(re.sub(r'chain = "XYZ\|C"', 'chain = "XYZ"', toml.read_text()), encoding="utf-8")
    told = run("compensate", str(job), "--out", str(tmp_path / "out"))
    assert told.returncode == 2
    assert "rotary_errors are of a machine with rotary axes" in told.stderr
    assert "Traceback" not in told.stderr


@pytest.mark.long
def test_two_spheres_leave_a_turn_about_the_line_through_them_open(calibrated: Path, tmp_path: Path) -> None:
    """A third one, beside that line, closes it: u of a point far from the line is some ten times as large without."""
    recorded(TRUE, list(TRUE), np.random.default_rng(5), tmp_path / "two")
    write_new_map(tmp_path / "two", tmp_path / "errors")
    before, after = (
        json.loads((folder / "errors" / "compensation.json").read_text(encoding="utf-8"))["held_out_rms_um"][
            "predicted"
        ]
        for folder in (calibrated, tmp_path)
    )
    assert after["corrected"] > 5 * before["corrected"]
