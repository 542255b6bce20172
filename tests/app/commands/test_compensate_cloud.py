"""Clouds of a digitizer by the whole chain, from disk to disk."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cmm_uq.app.commands.jobs.compensate import write_compensated_cloud
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.output import read_manifest, sha256_of
from cmm_uq.base.points import Floats
from cmm_uq.machine.physics.compensation import Compensation
from cmm_uq.machine.physics.digitizer import Digitizer, euler_313
from cmm_uq.machine.physics.error_map import read_error_map
from cmm_uq.machine.physics.map_interpolation import ErrorMaps
from tests.app.cli.process import run
from tests.app.commands.test_compensate import straight
from tests.app.commands.test_map_squareness import HARRIS, TABLE_7, stated, unit_vectors
from tests.conftest import ROOT

COLUMNS = ("u_mm", "v_mm", "d_mm", "e_mm", "f_mm")
OFFSET = (1.001, 264.505, 129.575)
ANGLES = {1: (90.0, 90.0, -60.0), 2: (90.0, 90.0, 15.0)}


def machine(folder: Path, maps: str, more: str = "", poses: tuple[int, ...] = (1,)) -> Path:
    """A job that describes the digitizer; its recording is not needed."""
    job = Path(shutil.copytree(ROOT / "examples" / "iota-1102-20C", folder / "job"))
    (job / "ballbar.csv").unlink()
    entries = ", ".join(
        f"{{ pose = {p}, alpha_deg = {ANGLES[p][0]}, beta_deg = {ANGLES[p][1]}, gamma_deg = {ANGLES[p][2]} }}" for p in poses
    )  # fmt: skip
    lines = f"{maps}{more}digitizer = {{ offset_mm = {list(OFFSET)}, poses = [{entries}] }}\n"
    path = job / "job.toml"
    path.write_text(re.sub(r"(?m)^(chain = .*\n)", rf"\1{lines}", path.read_text(encoding="utf-8")), encoding="utf-8")
    return job


def square(folder: Path, **more: object) -> Path:
    """A machine without errors but the squareness of table 7."""
    job = machine(
        folder, f'error_map = [ {{ file = "map.csv", temperature_c = 20.0{stated(TABLE_7[20])} }} ]\n', **more
    )  # type: ignore[arg-type]
    (job / "map.csv").write_text(straight())
    return job


def thesis(folder: Path, more: str = "", poses: tuple[int, ...] = (1, 2)) -> Path:
    """The maps of the thesis at three temperatures."""
    entries = ", ".join(f'{{ file = "{t}.csv", temperature_c = {t}.0{stated(s)} }}' for t, s in TABLE_7.items())
    job = machine(folder, f"error_map = [ {entries} ]\n", more, poses)
    for t in TABLE_7:
        shutil.copy(HARRIS / f"error_map_{t}C.csv", job / f"{t}.csv")
    return job


def scanned(n: int = 500) -> Floats:
    return np.random.default_rng(11).uniform([-30, -30, 0, 0, -500], [30, 30, 900, 550, 0], (n, 5))


def write_csv(path: Path, rows: Floats, columns: tuple[str, ...] = COLUMNS) -> Path:
    np.savetxt(path, rows, delimiter=",", header=",".join(columns), comments="", fmt="%.17g")
    return path


def read_csv(path: Path) -> Floats:
    return np.loadtxt(path, delimiter=",", skiprows=2)


def by_hand(rows: Floats) -> Floats:
    """Equation 35 where no carriage rotates: E·([u v 0] − [U1 V1 W1]) + D + e; E from SciPy, e by the vectors of the axes."""
    u, v, *_ = rows.T
    D = rows[:, 2:]
    e = D @ (unit_vectors(TABLE_7[20]) - np.eye(3))
    scan = np.column_stack([u, v, 0 * u]) - OFFSET
    return Rotation.from_euler("ZXZ", ANGLES[1], degrees=True).apply(scan) + D + e


@pytest.mark.parametrize("form", ["csv", "npy", "folder", "parquet"])
def test_a_cloud_is_the_equation_of_the_source_in_every_form(tmp_path: Path, form: str) -> None:
    job, rows, cloud = square(tmp_path), scanned(), tmp_path / f"cloud.{form}"
    if form == "csv":
        write_csv(cloud, rows)
    elif form == "npy":
        np.save(cloud, rows)
    elif form == "folder":
        cloud = tmp_path / "chunks"
        cloud.mkdir()
        for i, part in enumerate(np.array_split(rows, 3)):
            np.save(cloud / f"{i}.npy", part)
    else:
        arrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
        parquet.write_table(arrow.table(dict(zip(COLUMNS, rows.T, strict=True))), cloud)
    files = write_compensated_cloud(job, cloud, tmp_path / "out")
    written = next(iter(set(files) - {"compensation.json", "manifest.json"}))
    if form == "parquet":
        table = parquet.read_table(files[written])
        found = np.column_stack([table[f"{axis}_mm"] for axis in "xyz"])
        assert table.schema.metadata[b"origin"].startswith(b"compensated by cmm-uq")
    else:
        found = read_csv(files[written]) if form == "csv" else np.load(files[written])
    np.testing.assert_allclose(found, by_hand(rows), rtol=0, atol=6e-8 if form == "csv" else 1e-11)


def test_every_point_has_its_pose_and_the_temperatures_of_its_scales(tmp_path: Path) -> None:
    """Against the chain computed pose by pose from the maps themselves."""
    job, rows = thesis(tmp_path), scanned()
    random = np.random.default_rng(3)
    pose, temperatures = random.integers(1, 3, len(rows)), random.uniform(20, 30, (len(rows), 3))
    columns = (*COLUMNS, "power", "pose", "temp_x_c", "temp_y_c", "temp_z_c")
    cloud = write_csv(tmp_path / "cloud.csv", np.column_stack([rows, 0 * pose, pose, temperatures]), columns)
    write_compensated_cloud(job, cloud, tmp_path / "out")
    found = read_csv(tmp_path / "out" / "cloud-compensated.csv")
    maps = ErrorMaps(
        [read_error_map(HARRIS / f"error_map_{t}C.csv", temperature=t).with_squareness_arcsec(*s) for t, s in TABLE_7.items()]
    )  # fmt: skip
    for number, angles in ANGLES.items():
        here = pose == number
        digitizer = Digitizer(euler_313(*np.radians(angles)), np.array(OFFSET), Compensation(maps))
        expected, _ = digitizer.coordinates(rows[here, :2], rows[here, 2:], temperatures[here])
        np.testing.assert_allclose(found[here], expected, rtol=0, atol=6e-8)


def test_a_log_gives_the_temperatures_at_the_time_of_each_point(tmp_path: Path) -> None:
    job = thesis(tmp_path, 'temperature_log = { file = "log.csv" }\n', (1,))
    (job / "log.csv").write_text("time_s,x1_c,y1_c,z1_c\n0,20,21,22\n100,25,26,27\n")
    rows, time = scanned(), np.linspace(0, 100, 500)
    temperatures = np.array([20, 21, 22]) + 0.05 * time[:, None]
    cloud = write_csv(tmp_path / "a.csv", np.column_stack([rows, time]), (*COLUMNS, "time_s"))
    write_compensated_cloud(job, cloud, tmp_path / "a")
    own = thesis(tmp_path / "own", "", (1,))
    columns = (*COLUMNS, "temp_x_c", "temp_y_c", "temp_z_c")
    cloud = write_csv(tmp_path / "b.csv", np.column_stack([rows, temperatures]), columns)
    write_compensated_cloud(own, cloud, tmp_path / "b")
    one, other = read_csv(tmp_path / "a" / "a-compensated.csv"), read_csv(tmp_path / "b" / "b-compensated.csv")
    np.testing.assert_allclose(one, other, rtol=0, atol=1.1e-7)
    with pytest.raises(CmmUqError, match=r"b\.csv: has temp_x_c, and \[machine\] temperature_log gives it as well"):
        write_compensated_cloud(job, cloud, tmp_path / "c")


def test_what_was_written_says_where_it_comes_from(tmp_path: Path) -> None:
    job, cloud = square(tmp_path), write_csv(tmp_path / "cloud.csv", scanned())
    out = tmp_path / "out"
    write_compensated_cloud(job, cloud, out)
    assert (out / "cloud-compensated.csv").read_text().startswith("# compensated by cmm-uq")
    told = json.loads((out / "compensation.json").read_text(encoding="utf-8"))
    assert (told["origin"], told["points"]) == ("compensated", 500)
    assert told["inputs_sha256"].keys() == {"job.toml", "map.csv", "cloud.csv"}
    assert told["inputs_sha256"]["cloud.csv"] == sha256_of(cloud)
    assert told["digitizer"]["offset_mm"] == list(OFFSET)
    manifest = read_manifest(out)
    assert manifest is not None
    assert manifest.files["cloud-compensated.csv"] == sha256_of(out / "cloud-compensated.csv")
    write_compensated_cloud(job, cloud, out)  # the same command may replace what it wrote


def test_memory_does_not_grow_with_the_cloud(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    job, peaks = square(tmp_path), []
    monkeypatch.setattr("cmm_uq.app.commands.jobs.compensate.transform_cloud", in_blocks_of_2000())
    for n in (10_000, 100_000):
        np.save(tmp_path / "cloud.npy", np.resize(scanned(), (n, 5)))
        tracemalloc.start()
        write_compensated_cloud(job, tmp_path / "cloud.npy", tmp_path / f"{n}")
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < 1.2 * peaks[0]


def in_blocks_of_2000():  # type: ignore[no-untyped-def]
    from functools import partial

    from cmm_uq.machine.physics.point_cloud import transform_cloud

    return partial(transform_cloud, block=2000)


def test_points_beyond_the_maps_are_refused_or_flagged(tmp_path: Path) -> None:
    job, rows = square(tmp_path), scanned()
    rows[7, 2] = 905.0
    cloud = write_csv(tmp_path / "cloud.csv", rows)
    with pytest.raises(CmmUqError, match=r"cloud\.csv, rows from 1: point 8: x reads 905 mm"):
        write_compensated_cloud(job, cloud, tmp_path / "out")
    assert not (tmp_path / "out").exists()
    write_compensated_cloud(job, cloud, tmp_path / "out", beyond="extrapolate")
    found = read_csv(tmp_path / "out" / "cloud-compensated.csv")
    assert np.flatnonzero(found[:, 3]).tolist() == [7]


HEAD = ",".join(COLUMNS)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (f"{HEAD}\n1,2,3,4,-5\n# a remark\n1,2,x,4,-5\n", r"cloud\.csv line 4, column d_mm: 'x' is not a number"),
        (f"{HEAD}\n1,2,nan,4,-5\n", r"line 2, column d_mm: 'nan' is not a finite number"),
        (f"{HEAD}\n1,2,3,4\n", r"line 2: has 4 cells where the header has 5"),
        (f"{HEAD}\n1,2,3,4,5,6\n1,2,3,4\n", r"line 2: has 6 cells where the header has 5"),
        ("u_mm,v_mm,d_mm,e_mm\n1,2,3,4\n", r"has no column f_mm"),
        (f"{HEAD},u_mm\n1,2,3,4,-5,1\n", r"line 1: column 'u_mm' is there twice"),
        (f"{HEAD},pose\n1,2,3,4,-5,3\n", r"point 1: pose 3 is not described.*Known: 1"),
        (f"{HEAD},temp_x_c\n1,2,3,4,-5,20\n", r"has no column temp_y_c"),
        ("", r"has no rows"),
        ("u" * 100_001, r"line 1: the line is longer than 100000 characters"),
    ],
)
def test_a_cloud_that_is_none_is_refused_with_its_line_and_nothing_is_written(
    tmp_path: Path, text: str, says: str
) -> None:
    job = square(tmp_path)
    (tmp_path / "cloud.csv").write_text(text)
    with pytest.raises(CmmUqError, match=says):
        write_compensated_cloud(job, tmp_path / "cloud.csv", tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_cloud_is_read_line_by_line_wherever_its_blocks_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Remarks with letters of two bytes, empty lines, blanks and no end of the last line, in pieces of seven bytes."""
    job, rows = square(tmp_path), scanned(40)
    lines = [", ".join(f"{value:.17g}" for value in row) for row in rows]
    lines[5:5] = ["# µµµµµµµµ, ″", "", "  "]
    (tmp_path / "cloud.csv").write_text("\ufeff# a remark\n" + f"{HEAD}\r\n" + "\r\n".join(lines), encoding="utf-8")
    monkeypatch.setattr("cmm_uq.machine.physics.point_cloud.CHUNK", 7)
    write_compensated_cloud(job, tmp_path / "cloud.csv", tmp_path / "out")
    np.testing.assert_allclose(read_csv(tmp_path / "out" / "cloud-compensated.csv"), by_hand(rows), rtol=0, atol=6e-8)
    lines[20] = lines[20].replace(",", ";", 1)
    (tmp_path / "cloud.csv").write_text("\n".join([HEAD, *lines]), encoding="utf-8")
    with pytest.raises(CmmUqError, match=r"cloud\.csv line 22: has 4 cells where the header has 5"):
        write_compensated_cloud(job, tmp_path / "cloud.csv", tmp_path / "out")


@pytest.mark.long
def test_a_signal_in_the_middle_leaves_nothing(tmp_path: Path) -> None:
    job, folder = square(tmp_path), tmp_path / "cloud"
    folder.mkdir()
    for i in range(40):  # far more than is done before the signal
        np.save(folder / f"{i:02}.npy", np.resize(scanned(), (250_000, 5)))
    command = [sys.executable, "-m", "cmm_uq", "compensate", job, "--cloud", folder, "--out", tmp_path / "out"]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        deadline = time.monotonic() + 60
        while not list(tmp_path.glob("out/.unfinished-*/new/.unfinished-*")) and time.monotonic() < deadline:
            time.sleep(0.01)
        process.send_signal(signal.SIGTERM)
        _, said = process.communicate(timeout=30)
    assert process.returncode == 128 + signal.SIGTERM
    assert "interrupted; nothing was written" in said
    assert not (tmp_path / "out").exists()


def test_pipes_other_endings_and_numbers_that_are_none_are_refused(tmp_path: Path) -> None:
    job = square(tmp_path)
    os.mkfifo(tmp_path / "cloud.csv")
    (tmp_path / "cloud.xyz").write_text(f"{HEAD}\n1,2,3,4,-5\n")
    rows = scanned()
    rows[3, 1] = np.nan
    np.save(tmp_path / "cloud.npy", rows)
    for name, says in (
        ("cloud.csv", "is a pipe, not a file"), ("cloud.xyz", "is no cloud by its ending"), ("no.npy", "cannot be read"),
        ("cloud.npy", "point 4: v_mm is no finite number"),
    ):  # fmt: skip
        with pytest.raises(CmmUqError, match=says):
            write_compensated_cloud(job, tmp_path / name, tmp_path / "out")


def test_several_poses_without_their_column_are_refused(tmp_path: Path) -> None:
    job = square(tmp_path, poses=(1, 2))
    np.save(tmp_path / "cloud.npy", scanned())
    for cloud in (write_csv(tmp_path / "cloud.csv", scanned()), tmp_path / "cloud.npy"):
        with pytest.raises(CmmUqError, match="has no column pose"):
            write_compensated_cloud(job, cloud, tmp_path / "out")


def test_a_pose_that_is_described_twice_is_refused(tmp_path: Path) -> None:
    with pytest.raises(CmmUqError, match=r"\[machine\] digitizer: pose 1 is there twice"):
        write_compensated_cloud(square(tmp_path, poses=(1, 1)), tmp_path, tmp_path / "out")


def test_the_command_line_does_it_too(tmp_path: Path) -> None:
    job, cloud = square(tmp_path), write_csv(tmp_path / "cloud.csv", scanned())
    process = run("compensate", job, "--cloud", cloud, "--out", tmp_path / "out", "--verbose")
    assert process.returncode == 0, process.stderr
    assert "cloud-compensated.csv" in process.stdout
    assert "Compensating" in process.stderr
    process = run("compensate", job, "--cloud", cloud, "--map-text", "20", "--out", tmp_path / "other")
    assert process.returncode == 2
    assert "--map-text goes with a recording" in process.stderr


def test_a_job_without_a_digitizer_says_how_to_describe_it(tmp_path: Path) -> None:
    job = square(tmp_path)
    path = job / "job.toml"
    path.write_text(re.sub(r"(?m)^digitizer = .*\n", "", path.read_text()))
    process = run("compensate", job, "--cloud", write_csv(tmp_path / "c.csv", scanned()), "--out", tmp_path / "out")
    assert process.returncode == 2
    assert "the job describes no digitizer" in process.stderr


def test_a_cloud_has_u_of_each_coordinate_where_the_map_has_a_covariance(tmp_path: Path) -> None:
    """A scale of x known to 10 ppm, and 0.2 µm beside it along z: at the mount's reading of x, turned by nothing."""
    job = machine(tmp_path, 'error_map = [ { file = "map.csv", temperature_c = 20.0, covariance = "u.npy", '
                            "u_beside_um = [0, 0, 0.2] } ]\n", poses=(1, 2))  # fmt: skip
    (job / "map.csv").write_text(straight())
    factor = np.zeros((6 * 6 + 3, 1))
    factor[6] = 9.0  # µm at x = 900 mm
    np.save(job / "u.npy", factor)
    cloud = tmp_path / "cloud.csv"
    cloud.write_text("u_mm,v_mm,d_mm,e_mm,f_mm,pose\n1,2,100,50,-100,1\n-3,4,450,60,-200,2\n5,6,900,70,-300,1\n")
    files = write_compensated_cloud(job, cloud, tmp_path / "out")
    lines = files["cloud-compensated.csv"].read_text(encoding="utf-8").splitlines()
    assert lines[1] == "x_mm,y_mm,z_mm,u_x_mm,u_y_mm,u_z_mm"
    u = np.array([[float(cell) for cell in line.split(",")] for line in lines[2:]])[:, 3:]
    np.testing.assert_allclose(u, [[0.001, 0, 0.0002], [0.0045, 0, 0.0002], [0.009, 0, 0.0002]], atol=1e-9)
    told = json.loads(files["compensation.json"].read_text(encoding="utf-8"))
    assert len(told["distances"]) == 3
    assert told["distances"][-1]["u_um"] == pytest.approx(8.0, rel=0.05)
