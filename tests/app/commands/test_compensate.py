"""A job with an error map becomes a compensated job."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from cmm_uq.app.commands.jobs.compensate import write_compensated, write_new_map
from cmm_uq.app.commands.reading import read_job
from cmm_uq.app.commands.report import analyse
from cmm_uq.base.errors import CmmUqError
from tests.app.cli.process import run
from tests.conftest import ROOT, without_diagnosis


def named(job: Path, map_text: str) -> Path:
    """The job with an error map of the table 7 squareness."""
    (job / "map.csv").write_text(map_text, encoding="utf-8")
    path = job / "job.toml"
    lines = (
        'error_map = [\n  { file = "map.csv", temperature_c = 20.0 },  # of the interferometer\n]\n'
        "squareness_arcsec = { xy = -173.0, yz = -19.0, zx = 21.0 }\n"
    )
    text = re.sub(r"(?m)^(chain = .*\n)", rf"\1{lines}", path.read_text(encoding="utf-8"))
    path.write_text(text, encoding="utf-8")
    return job


def straight(high: float = 900.0) -> str:
    rows = ["axis,position_mm,dx_um,dy_um,dz_um,rx_arcsec,ry_arcsec,rz_arcsec"]
    for axis, low, end in (("x", 0.0, high), ("y", 0.0, 550.0), ("z", -500.0, 0.0)):
        rows += [f"{axis},{position},0,0,0,0,0,0" for position in (low, end)]
    return "\n".join(rows) + "\n"


def test_squareness_alone_moves_points_by_its_angles(job: Path, tmp_path: Path) -> None:
    """Carriages move along unit vectors that enclose 90° + S: the Cholesky factor of the cosines between them."""
    before = read_job(job).points
    write_compensated(named(job, straight()), tmp_path / "out")
    after = read_job(tmp_path / "out").points
    xy, yz, zx = np.cos(np.pi / 2 + np.pi / 648000 * np.array([-173, -19, 21]))
    unit = np.linalg.cholesky(np.array([[1, xy, zx], [xy, 1, yz], [zx, yz, 1]]))
    np.testing.assert_allclose(after.carriages, before.carriages @ unit, atol=2e-7)


def test_the_compensated_job_is_not_compensated_again_and_tells_its_source(job: Path, tmp_path: Path) -> None:
    write_compensated(named(job, straight()), tmp_path / "out")
    compensated = read_job(tmp_path / "out")
    assert not compensated.facts.machine.error_map
    assert compensated.facts.machine.squareness_arcsec is None
    assert compensated.facts.machine.chain == "XYZ"
    first = (tmp_path / "out" / "ballbar.csv").read_text(encoding="utf-8").splitlines()[0]
    assert first.startswith("# compensated by cmm-uq")
    told = json.loads((tmp_path / "out" / "compensation.json").read_text(encoding="utf-8"))
    assert told["inputs_sha256"].keys() == {"job.toml", "ballbar.csv", "map.csv"}
    assert told["error_maps"][0]["squareness_arcsec"] == {"xy": -173.0, "yz": -19.0, "zx": 21.0}


@pytest.mark.usefixtures("no_diagnosis")
def test_the_thesis_map_brings_the_rms_accuracy_error_to_12_6_micrometres(job: Path, tmp_path: Path) -> None:
    """Harris 2004 prints 12.8 µm for its own compensation, which also knew the digitizer's pose."""
    source = ROOT.parent / "shared" / "data" / "harris2004" / "error_map_20C.csv"
    if not source.is_file():
        pytest.skip("the source tables are not beside the project")
    write_compensated(named(job, source.read_text(encoding="utf-8")), tmp_path / "out")
    found = analyse(tmp_path / "out")
    assert found.accuracy["rms_accuracy_error_um"].value == pytest.approx(12.6, abs=0.1)


def test_a_job_without_a_map_says_so(job: Path, tmp_path: Path) -> None:
    with pytest.raises(CmmUqError, match="has no error map"):
        write_compensated(job, tmp_path / "out")


def test_a_map_that_does_not_cover_the_travel_is_refused(job: Path, tmp_path: Path) -> None:
    with pytest.raises(CmmUqError, match=r"map\.csv"):
        write_compensated(named(job, straight(high=600.0)), tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_points_beyond_the_map_are_refused_with_their_line_or_flagged(job: Path, tmp_path: Path) -> None:
    """Position 16 reads X = 731 mm; a map that ends at 720 mm needs a travel that ends there too."""
    path = job / "job.toml"
    path.write_text(path.read_text(encoding="utf-8").replace("x = [0, 900]", "x = [0, 720]"), encoding="utf-8")
    short = named(job, straight(high=720.0))
    with pytest.raises(CmmUqError, match=r"ballbar\.csv.*line \d+"):
        write_compensated(short, tmp_path / "out")
    write_compensated(short, tmp_path / "flagged", beyond="extrapolate")
    flagged = read_job(tmp_path / "flagged")
    assert flagged.points.columns["extrapolated"].sum() == 1
    lapsed = [text for text, _ in flagged.circumstances.lapsed]  # by which nothing passes
    assert "error maps that reach all points (1 were corrected beyond them)" in lapsed
    assert not any("beyond" in text for text, _ in read_job(short).circumstances.lapsed)


def test_the_job_itself_is_not_written_over(job: Path) -> None:
    with pytest.raises(CmmUqError, match="is an input of this command"):
        write_compensated(named(job, straight()), job)


def test_how_it_came_about_names_files_not_folders(job: Path, tmp_path: Path) -> None:
    """The same bytes wherever the job lies, and nothing of the user's machine."""
    named(job, straight())
    elsewhere = Path(shutil.copytree(job, tmp_path / "elsewhere"))
    for folder, out in ((job, "a"), (elsewhere, "b")):
        write_compensated(folder, tmp_path / out)
    told = [(tmp_path / out / "compensation.json").read_bytes() for out in ("a", "b")]
    assert told[0] == told[1]
    assert json.loads(told[0])["error_maps"][0]["file"] == "map.csv"


@pytest.fixture(scope="module")
def new_map(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Made of every second of the twenty bars of the example, so that the others are another recording."""
    folder = tmp_path_factory.mktemp("map")
    made_of = some_bars(ROOT / "examples" / "iota-1102-20C", folder / "job", range(1, 21, 2))
    with without_diagnosis():
        write_new_map(made_of, folder / "map")
    return folder / "map"


def some_bars(job: Path, into: Path, kept: range) -> Path:
    """A copy of a job with some of its measurements."""
    shutil.copytree(job, into)
    head, *rows = (into / "ballbar.csv").read_text(encoding="utf-8").splitlines()
    rows = [row for row in rows if int(row.partition(",")[0]) in kept]
    (into / "ballbar.csv").write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")
    return into


def with_new_map(job: Path, new_map: Path) -> Path:
    for name in ("error-map.csv", "error-map-covariance.npy"):
        shutil.copy(new_map / name, job / name)
    keys = (new_map / "error-map.toml").read_text(encoding="utf-8").splitlines()[1]
    path = job / "job.toml"
    path.write_text(re.sub(r"(?m)^(chain = .*\n)", rf"\1{keys}\n", path.read_text(encoding="utf-8")), encoding="utf-8")
    return job


@pytest.mark.long
def test_a_map_of_a_calibration_corrects_other_recordings_and_says_how_well(new_map: Path, tmp_path: Path) -> None:
    """Ten bars of a real machine that the map was not made of: corrected they agree far better, each coordinate has its u."""
    job = some_bars(ROOT / "examples" / "iota-1102-20C", tmp_path / "job", range(2, 21, 2))
    read = read_job(job)
    write_compensated(with_new_map(job, new_map), tmp_path / "out")
    after = read_job(tmp_path / "out").points
    rows = (tmp_path / "out" / "points-u.csv").read_text(encoding="utf-8").splitlines()
    assert rows[0] == "measurement,point,repeat,u_x_um,u_y_um,u_z_um"
    u = np.array([[float(cell) for cell in row.split(",")] for row in rows[1:]])
    np.testing.assert_array_equal(u[:, :3], np.column_stack([after.measurement, after.point, after.repeat]))
    beside = json.loads((tmp_path / "out" / "compensation.json").read_text(encoding="utf-8"))["error_maps"][0][
        "u_beside_um"
    ]
    assert np.all((u[:, 3:] > beside) & (u[:, 3:] < 100))  # no less than what no map holds
    spread = [np.std(np.linalg.norm(points.xyz[0::2] - points.xyz[1::2], axis=1)) for points in (read.points, after)]
    assert spread[1] < 0.3 * spread[0]
    told = json.loads((tmp_path / "out" / "compensation.json").read_text(encoding="utf-8"))
    assert [row["u_um"] <= row["largest_u_um"] for row in told["distances"]] == [True] * 8


def test_a_new_map_says_what_it_is_worth(new_map: Path) -> None:
    told = json.loads((new_map / "compensation.json").read_text(encoding="utf-8"))
    held = told["held_out_rms_um"]
    assert held["left_out"] == "set-ups"
    assert max(held["corrected"], held["named_errors"]) < 0.5 * held["uncorrected"]  # ten bars do not part these two
    assert (told["sign"], told["recording"]) == ("true = indicated + e", "measured")
    assert "hysteresis_x" in told["errors_not_in_it"]
    assert told["inputs_sha256"].keys() == {"job.toml", "ballbar.csv"}


def test_a_recording_is_not_corrected_by_the_map_that_was_made_of_it(new_map: Path, tmp_path: Path) -> None:
    job = some_bars(ROOT / "examples" / "iota-1102-20C", tmp_path / "job", range(1, 21, 2))
    head, *rows = (job / "ballbar.csv").read_text(encoding="utf-8").splitlines()
    (job / "ballbar.csv").write_text("\n".join([head, *reversed(rows)]) + "\n", encoding="utf-8")  # in another order
    with pytest.raises(CmmUqError, match="was made of this very recording") as told:
        write_compensated(with_new_map(job, new_map), tmp_path / "out")
    assert str(told.value.where).endswith("error-map.csv")
    assert not (tmp_path / "out").exists()


def test_a_map_of_a_simulated_recording_corrects_no_measured_one(job: Path, new_map: Path, tmp_path: Path) -> None:
    job = with_new_map(job, new_map)
    text = (job / "error-map.csv").read_text(encoding="utf-8")
    (job / "error-map.csv").write_text(text.replace("of a measured", "of a simulated", 1), encoding="utf-8")
    with pytest.raises(CmmUqError, match="was made of a simulated recording"):
        write_compensated(job, tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.long
def test_a_map_is_made_of_recordings_that_name_errors_of_a_machine_alone(tmp_path: Path) -> None:
    for name in ("shift-simulated", "iota-1102-maps"):
        with pytest.raises(CmmUqError):
            write_new_map(ROOT / "examples" / name, tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("option", [["--extrapolate"], ["--map-text", "20"], ["--cloud", "cloud.csv"]])
def test_making_a_map_goes_with_no_option_of_correcting(option: list[str], tmp_path: Path) -> None:
    found = run(
        "compensate", str(ROOT / "examples" / "iota-1102-20C"), "--new-map", "--out", str(tmp_path / "out"), *option
    )
    assert found.returncode == 2
    assert "--new-map makes a map, and goes with none of" in found.stderr


def test_a_covariance_beside_two_maps_or_of_another_map_is_refused(job: Path, new_map: Path, tmp_path: Path) -> None:
    (job / "map.csv").write_text(straight(), encoding="utf-8")
    shutil.copy(new_map / "error-map-covariance.npy", job)
    path, text = job / "job.toml", (job / "job.toml").read_text(encoding="utf-8")
    one = '{ file = "map.csv", temperature_c = 20.0, covariance = "error-map-covariance.npy" }'
    for maps, problem in (
        (f'[{one}, {{ file = "map.csv", temperature_c = 25.0 }}]', "says nothing of maps between two"),
        (f"[{one}]", "has 1173 rows, the map map.csv has 39 figures with its squareness"),
        (
            '[{ file = "map.csv", temperature_c = 20.0, u_beside_um = [1, 1, 1] }]',
            "u_beside_um stands beside a covariance",
        ),
    ):
        path.write_text(re.sub(r"(?m)^(chain = .*\n)", rf"\1error_map = {maps}\n", text), encoding="utf-8")
        with pytest.raises(CmmUqError, match=problem):
            write_compensated(job, tmp_path / "out")
    assert not (tmp_path / "out").exists()
