"""Jobs of shifts and of error maps, from the command line."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pikepdf
import pytest

from cmm_uq.app.commands.report import analyse
from cmm_uq.artefacts.shift.axis import ShiftResult
from tests.app.cli.process import run
from tests.artefacts.simulated import analysed
from tests.conftest import ROOT

MAPS = ROOT / "examples" / "iota-1102-maps"
TWO_MORE = "".join(f'    {{ file = "error_map_{t}C.csv", temperature_c = {t}.0 }},\n' for t in (25, 30))
CHECK = ROOT.parent / "shared" / "check_results.py"


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("maps") / "out"
    process = run("diagnose", MAPS, "--out", out)
    assert process.returncode == 0, process.stderr
    assert process.stdout.startswith("PARTIAL")
    return out


@pytest.mark.long
def test_a_diagnosis_is_a_page_and_results(out: Path) -> None:
    assert sorted(path.name for path in out.iterdir()) == [
        "diagnosis.html",
        "diagnosis.pdf",
        "manifest.json",
        "results.json",
    ]
    page = (out / "diagnosis.html").read_text(encoding="utf-8")
    for text in ("Thermal expansion of scale Y", "in the map at 25 °C differs from the others", "What to measure next"):
        assert text in page


def test_the_results_name_inputs_effects_and_places(out: Path) -> None:
    results = json.loads((out / "results.json").read_text(encoding="utf-8"))
    names = {"job.toml", *(f"error_map_{t}C.csv" for t in (20, 25, 30))}
    assert set(results["job"]["inputs_sha256"]) == names
    diagnosis = results["diagnosis"]
    assert {e["effect"] for e in diagnosis["effects"]} == {"thermal_scale_y", "thermal_scale_z"}
    assert {place["covariate"] for place in diagnosis["where"]} <= {"x_mm", "y_mm", "z_mm"}
    assert {finding["kind"] for finding in diagnosis["screening"]} >= {"copied", "not measured"}
    assert results["sampling"]["converged"]


@pytest.mark.skipif(not CHECK.exists(), reason="the contract's checker is not here")
def test_the_results_keep_the_contract(out: Path) -> None:
    process = subprocess.run([sys.executable, CHECK, out / "results.json"], capture_output=True, text=True, check=False)
    assert process.returncode == 0, process.stdout


@pytest.mark.parametrize(
    ("command", "more", "says"),
    [
        ("report", (), "error maps cannot be reported"),
        ("plan", (), "error maps cannot be planned"),
        ("compensate", (), "error maps cannot be compensated"),
        ("simulate", ("--truth", MAPS / "job.toml"), "error maps cannot be simulated"),
    ],
)
def test_other_commands_say_what_to_do_instead(
    command: str, more: tuple[object, ...], says: str, tmp_path: Path
) -> None:
    process = run(command, MAPS, *more, "--out", tmp_path / "out")
    assert process.returncode == 2
    assert says in process.stderr
    assert "cmm-uq diagnose JOB" in process.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        (TWO_MORE, "", "one error map has nothing to be compared with"),
        ("error_map_25C.csv", "elsewhere.csv", "no such file"),
        ("[model]", '[recording]\nfile = "a.csv"\n[model]', "a job of kind 'error_map' has no recording of points"),
        ("effects = []", 'effects = ["thermal_scal_x"]', "thermal_scale_x"),
        ("effects = []", 'effects = ["hysteresis_x"]', "hysteresis_x needs approach_x, which error maps do not have"),
        ("[model]", '[[conformity]]\nstandard = "VDI/VDE 2617"\nlimit_um = 5.0\n[model]', "no standard here decides on them"),
    ],
)  # fmt: skip
def test_what_such_a_job_cannot_have_is_said_with_its_key(old: str, new: str, says: str, tmp_path: Path) -> None:
    job = tmp_path / "job"
    shutil.copytree(MAPS, job)
    text = (job / "job.toml").read_text(encoding="utf-8")
    assert old in text
    (job / "job.toml").write_text(text.replace(old, new), encoding="utf-8")
    process = run("diagnose", job, "--out", tmp_path / "out")
    assert process.returncode == 2
    assert says in process.stderr
    assert "Traceback" not in process.stderr
    assert not (tmp_path / "out").exists()


SHIFT = ROOT / "examples" / "shift-simulated"


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("shift") / "report"
    process = run("report", SHIFT, "--out", out)
    assert process.returncode == 0, process.stderr
    return out


@pytest.mark.long
def test_a_report_has_its_correction_table_also_inside_the_pdf(report: Path) -> None:
    names = [
        "certificate-simulated.html", "certificate-simulated.pdf", "certificate-simulated.xml",
        "correction_table-simulated.csv", "manifest.json", "posterior-simulated.npz", "provenance.json", "results.json",
    ]  # fmt: skip
    assert sorted(path.name for path in report.iterdir()) == names
    with pikepdf.open(report / "certificate-simulated.pdf") as pdf:
        assert set(pdf.attachments) == {"job.toml", "recording.csv", *names[2:]} - {"manifest.json"}


@pytest.mark.long
def test_compensating_by_the_table_brings_the_error_down(report: Path, tmp_path: Path) -> None:
    """What is left of about 27 µm is within the uncertainty of the curve: the job calibrates itself a second time."""
    job = tmp_path / "job"
    shutil.copytree(SHIFT, job)
    shutil.copy(report / "correction_table-simulated.csv", job / "correction_table.csv")
    text = (job / "job.toml").read_text(encoding="utf-8")
    named = 'error_map = [ { file = "correction_table.csv", temperature_c = 20.0 } ]\n'
    (job / "job.toml").write_text(re.sub(r"(?m)^(chain = .*\n)", rf"\1{named}", text), encoding="utf-8")
    process = run("compensate", job, "--out", tmp_path / "out")
    assert process.returncode == 0, process.stderr
    before, after = analysed(SHIFT.name), analyse(tmp_path / "out")
    assert isinstance(before, ShiftResult)
    assert isinstance(after, ShiftResult)
    assert np.ptp(before.fine.error) > 0.024
    assert np.ptp(after.fine.error) < 2 * before.fine.simultaneous_factor * before.fine.u.max()
    assert np.ptp(after.fine.error) < 0.1 * np.ptp(before.fine.error)
    truth = [np.loadtxt(path / "recording.csv", delimiter=",", skiprows=s)[:, :4] for path, s in
             ((SHIFT, 1), (tmp_path / "out", 2))]  # fmt: skip
    x = truth[0][:, 3]
    true = x + 0.012 * np.sin(x / 90) + 0.010 * np.exp((x - 590) / 60) + 8e-6 * x
    left = [np.ptp(rows[:, 3] - true) for rows in truth]
    assert left[1] < left[0] / 5


@pytest.mark.parametrize("command", ["prove", "compensate", "budget"])
def test_what_a_shift_job_cannot_have_is_one_line_and_exit_code_2(command: str, tmp_path: Path) -> None:
    process = run(command, SHIFT, "--out", tmp_path / "out")
    assert process.returncode == 2
    assert "Traceback" not in process.stderr
    said = {
        "prove": "has an analysis of its own",
        "compensate": "the job has no error map",
        "budget": "is a folder, not a file",
    }
    assert said[command] in process.stderr
    assert not (tmp_path / "out").exists() or not any((tmp_path / "out").iterdir())


PLATE = ROOT / "examples" / "shift-plate-simulated"


@pytest.mark.long
def test_a_plates_table_compensates_the_machine_too(tmp_path: Path) -> None:
    """Residuals of the true places by the example's own formula, after the best rigid motion, of all 525 readings."""
    assert run("report", PLATE, "--out", tmp_path / "report").returncode == 0
    job = tmp_path / "job"
    shutil.copytree(PLATE, job)
    shutil.copy(tmp_path / "report" / "correction_table-simulated.csv", job / "correction_table.csv")
    text = (job / "job.toml").read_text(encoding="utf-8")
    named = 'error_map = [ { file = "correction_table.csv", temperature_c = 20.0 } ]\n'
    (job / "job.toml").write_text(re.sub(r"(?m)^(chain = .*\n)", rf"\1{named}", text), encoding="utf-8")
    process = run("compensate", job, "--out", tmp_path / "out")
    assert process.returncode == 0, process.stderr
    before = np.loadtxt(PLATE / "recording.csv", delimiter=",", skiprows=1)
    after = np.loadtxt(tmp_path / "out" / "recording.csv", delimiter=",", skiprows=2)
    x, y = before[:, 3:5].T
    yaw = 5e-6 * np.sin(x / 150) + 1e-5 * x / 600
    true = np.column_stack([
        x + 0.010 * np.sin(x / 90) + 20e-6 * x + 0.003 * np.sin(y / 100) - 60e-6 * y - y * yaw,
        y - 0.008 * np.cos(y / 110) - 10e-6 * y + 0.004 * (x / 300 - 1) ** 2 + 0.002 * np.sin(x / 60),
    ])  # fmt: skip
    left = [rms_after_rigid_motion(rows[:, 3:5], true) for rows in (before, after)]
    assert left[0] > 0.008
    assert left[1] < 0.001


def rms_after_rigid_motion(found: np.ndarray, true: np.ndarray) -> float:
    z, w = (part @ [1, 1j] - (part @ [1, 1j]).mean() for part in (found, true))
    turn = np.angle(np.vdot(z, w))
    return float(np.sqrt(np.mean(np.abs(z * np.exp(1j * turn) - w) ** 2)))


@pytest.mark.parametrize(
    ("pattern", "replacement", "said"),
    [
        (r'plane = "xy"', 'plane = "xy"\naxis = "x"', "leave out axis"),
        (r'plane = "xy"', 'plane = "xz"', "plane"),
        (r'plane = "xy"', 'plane = "yz"', "does not lie in the plane yz"),
        (r"to = 25", "to = 26", "no point 26"),
        (r"to = 25", "to = 5", "mm apart, not 565.688 mm"),
        (r"effects = \[\]", 'effects = ["scale_x"]', "not by effects"),
    ],
)
def test_what_a_plates_job_cannot_be_is_said(tmp_path: Path, pattern: str, replacement: str, said: str) -> None:
    job = tmp_path / "job"
    shutil.copytree(PLATE, job)
    text, count = re.subn(pattern, replacement, (job / "job.toml").read_text(encoding="utf-8"))
    assert count == 1
    (job / "job.toml").write_text(text, encoding="utf-8")
    process = run("report", job, "--out", tmp_path / "out")
    assert process.returncode == 2
    assert said in process.stderr
    assert "Traceback" not in process.stderr
