"""A digitizer by the whole chain of the source: error maps, attitude of the mount, compensation, calibration, cloud."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import least_squares

from cmm_uq.app.commands.jobs.compensate import write_compensated, write_compensated_cloud
from cmm_uq.app.commands.reading import read_job
from cmm_uq.app.commands.report import write_report
from cmm_uq.artefacts import artefact_of
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.physics.compensation import Compensation
from cmm_uq.machine.physics.digitizer import Digitizer, euler_313
from cmm_uq.machine.physics.error_map import read_error_map
from cmm_uq.machine.physics.map_interpolation import ErrorMaps
from tests.artefacts.digitizer.aligned import OFFSET, RADIUS, SPHERE, THREE, cap, turned
from tests.conftest import ROOT

MAP = Path(__file__).parents[2] / "machine" / "physics" / "harris2004" / "error_map_20C.csv"
SQUARENESS = (-173.0, -19.0, 21.0)
"""XY, YZ, ZX in ″ at 20 °C (Harris 2004, table 7)."""

JOB = """
[job]
id = "hymarc"
date = 2026-02-03

[machine]
name = "DEA Iota 1102"
travel_mm = {{ x = [0, 900], y = [0, 550], z = [-500, 0] }}
error_map = [ {{ file = "map.csv", temperature_c = 20.0, squareness_arcsec = {{ xy = -173.0, yz = -19.0, zx = 21.0 }} }} ]
{machine}

[artefact]
kind = "digitizer"
length_mm = 25.4

[recording]
file = "scans.csv"
u_coordinate_um = 1.0

[model]
effects = []
"""


def machine() -> Compensation:
    return Compensation(ErrorMaps([read_error_map(MAP, temperature=20.0).with_squareness_arcsec(*SQUARENESS)]))


def scanned() -> Floats:
    """Rows number, α, β, γ, u, v, D, E, F: readings for which equation 35 gives points of one sphere, by iteration."""
    rows = []
    for number, angles in enumerate(THREE, 1):
        n = RADIUS * cap(40)
        seen, true = n[:, :2], SPHERE + n @ turned(angles).T
        digitizer = Digitizer(euler_313(*np.radians(angles)), OFFSET, machine())
        readings = true - (np.column_stack([seen, 0 * seen[:, 0]]) - OFFSET) @ turned(angles).T
        for _ in range(8):
            readings = readings + true - digitizer.coordinates(seen, readings)[0]
        np.testing.assert_allclose(digitizer.coordinates(seen, readings)[0], true, atol=1e-9)
        rows.append(np.column_stack([np.tile([number, *angles], (40, 1)), seen, readings]))
    return np.vstack(rows)


def job(folder: Path, machine: str = "") -> Path:
    folder.mkdir(parents=True)
    shutil.copy(MAP, folder / "map.csv")
    (folder / "job.toml").write_text(JOB.format(machine=machine), encoding="utf-8")
    rows = scanned()
    table = np.column_stack([rows[:, 0], np.tile(np.arange(1, 41), 3), rows[:, 6:], rows[:, 1:6]])
    header = "measurement,point,x_mm,y_mm,z_mm,alpha_deg,beta_deg,gamma_deg,u_mm,v_mm"
    np.savetxt(folder / "scans.csv", table, "%.10g", ",", header=header, comments="")
    return folder


def estimate(folder: Path) -> Floats:
    read = read_job(folder)
    artefact = artefact_of(read.facts.artefact, read.points)
    return RecordingModel(artefact, (), 1e-3).estimate().least_squares.value[:3]


def test_a_compensated_recording_gives_the_offset_that_the_exact_chain_was_made_with(tmp_path: Path) -> None:
    """To a few nanometres, though the errors of the machine alone would shift it by more than 10 µm."""
    raw = job(tmp_path / "job")
    write_compensated(raw, tmp_path / "compensated")
    np.testing.assert_allclose(estimate(tmp_path / "compensated"), OFFSET, atol=3e-6)
    assert np.abs(estimate(raw) - OFFSET).max() > 0.01


def test_without_the_attitude_of_the_mount_it_would_be_off_by_micrometres(tmp_path: Path) -> None:
    """Rotations of up to 4″ over 295 mm: with tip offsets of zero they are lost."""
    folder = job(tmp_path / "job")
    head, *rows = (folder / "scans.csv").read_text().splitlines()
    lines = [f"{head},tip_x_mm,tip_y_mm,tip_z_mm", *(f"{row},0,0,0" for row in rows)]
    (folder / "scans.csv").write_text("\n".join(lines))
    write_compensated(folder, tmp_path / "compensated")
    assert np.abs(estimate(tmp_path / "compensated") - OFFSET).max() > 5e-4


def test_scipy_finds_it_on_the_exact_chain_as_well() -> None:
    """Second method: equation 35 itself inside scipy.optimize.least_squares, offset and centre unknown."""
    rows, compensation = scanned(), machine()

    def misses(state: Floats) -> Floats:
        found = []
        for number, angles in enumerate(THREE, 1):
            part = rows[rows[:, 0] == number]
            digitizer = Digitizer(euler_313(*np.radians(angles)), state[:3], compensation)
            found.append(digitizer.coordinates(part[:, 4:6], part[:, 6:])[0])
        return np.linalg.norm(np.vstack(found) - state[3:], axis=1) - RADIUS

    start = np.concatenate([OFFSET + np.array([0.1, -0.2, 0.15]), SPHERE + 0.1])
    found = least_squares(misses, start, xtol=1e-15, ftol=1e-15, gtol=1e-15)
    np.testing.assert_allclose(found.x[:3], OFFSET, atol=1e-6)


@pytest.fixture(scope="module")
def calibrated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The report of a compensated recording."""
    folder = tmp_path_factory.mktemp("calibrated")
    write_compensated(job(folder / "job"), folder / "compensated")
    write_report(folder / "compensated", folder / "report")
    return folder / "report"


def cloud(folder: Path) -> tuple[Path, Floats]:
    """The scans as a cloud, and where the points lie."""
    rows = scanned()
    header = "pose,u_mm,v_mm,d_mm,e_mm,f_mm"
    np.savetxt(folder / "cloud.csv", rows[:, [0, 4, 5, 6, 7, 8]], "%.17g", ",", header=header, comments="")
    true = np.vstack([SPHERE + RADIUS * cap(40) @ turned(angles).T for angles in THREE])
    return folder / "cloud.csv", true


@pytest.mark.long
@pytest.mark.parametrize("named", ["hymarc", "hymarc/", "hymarc/results.json", "hymarc.json"])
def test_a_calibration_is_read_back_to_compensate_a_cloud(tmp_path: Path, calibrated: Path, named: str) -> None:
    folder = job(tmp_path / "use", f'digitizer = {{ calibration = "{named}" }}')
    target = folder / (named if named.endswith(".json") else "hymarc/results.json")
    target.parent.mkdir(exist_ok=True)
    shutil.copy(calibrated / "results.json", target)
    source, true = cloud(tmp_path)
    written = write_compensated_cloud(folder, source, tmp_path / "out")
    found = np.loadtxt(written["cloud-compensated.csv"], delimiter=",", skiprows=2)
    told = json.loads(written["compensation.json"].read_text(encoding="utf-8"))
    result = json.loads((calibrated / "results.json").read_text(encoding="utf-8"))["digitizer"]
    offset = [result["offset_mm"][name]["value"] for name in ("U1", "V1", "W1")]
    assert told["digitizer"]["offset_mm"] == offset
    assert told["digitizer"]["offset_covariance_mm2"] == result["covariance_mm2"]
    assert told["digitizer"]["calibration"] in told["inputs_sha256"]
    # the posterior mean is off by a few nanometres of Monte Carlo
    np.testing.assert_allclose(found, true, atol=2e-5)


def use(tmp_path: Path, content: str, more: str = "") -> Path:
    folder = job(tmp_path / "use", f'digitizer = {{ calibration = "hymarc.json"{more} }}')
    (folder / "hymarc.json").write_text(content, encoding="utf-8")
    return folder


@pytest.mark.parametrize(
    ("content", "told"),
    [
        ("{}", "is no calibration of a digitizer: schema: field required"),
        ("not JSON", "is no calibration of a digitizer: it is no JSON"),
        ('{"schema": "cmm-uq/results/1", "job": {"id": "a", "origin": "measured"}}', "digitizer: field required"),
    ],
)
def test_what_is_no_calibration_is_refused_with_what_it_lacks(tmp_path: Path, content: str, told: str) -> None:
    with pytest.raises(CmmUqError, match=told):
        write_compensated_cloud(use(tmp_path, content), cloud(tmp_path)[0], tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.long
def test_a_simulated_calibration_serves_no_measured_cloud(tmp_path: Path) -> None:
    write_report(ROOT / "examples" / "digitizer-simulated", tmp_path / "report")
    content = (tmp_path / "report" / "results.json").read_text(encoding="utf-8")
    with pytest.raises(CmmUqError, match="is of a simulated recording, job 'digitizer-simulated'"):
        write_compensated_cloud(use(tmp_path, content), cloud(tmp_path)[0], tmp_path / "out")


@pytest.mark.long
def test_poses_beside_a_calibration_replace_its_own(tmp_path: Path, calibrated: Path) -> None:
    content = (calibrated / "results.json").read_text(encoding="utf-8")
    poses = ", poses = [ { pose = 7, alpha_deg = 90.0, beta_deg = 90.0, gamma_deg = 15.0 } ]"
    with pytest.raises(CmmUqError, match=r"pose 1 is not described.*Known: 7"):
        write_compensated_cloud(use(tmp_path, content, poses), cloud(tmp_path)[0], tmp_path / "out")


@pytest.mark.parametrize(
    ("digitizer", "told"),
    [
        ("{ }", "give either offset_mm"),
        ('{ calibration = "a.json", offset_mm = [1.0, 2.0, 3.0] }', "give either offset_mm"),
        ("{ offset_mm = [1.0, 2.0, 3.0] }", "without poses"),
        ('{ calibration = "../report" }', "not inside the job folder"),
        ('{ calibration = "results.json" }', "a name that cmm-uq writes itself"),
        ('{ calibration = "nothing" }', "no such file"),
    ],
)
def test_a_digitizer_described_twice_or_by_halves_is_refused(tmp_path: Path, digitizer: str, told: str) -> None:
    folder = job(tmp_path / "use", f"digitizer = {digitizer}")
    with pytest.raises(CmmUqError, match=told):
        write_compensated_cloud(folder, cloud(tmp_path)[0], tmp_path / "out")
