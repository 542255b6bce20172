"""Every command on a job whose recording are error maps: an answer, or one line that says why not."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.app.cli.process import run
from tests.conftest import ROOT

EXAMPLE = ROOT / "examples" / "iota-1102-maps"
TWO_MORE = "".join(f'    {{ file = "error_map_{t}C.csv", temperature_c = {t}.0 }},\n' for t in (25, 30))
CHECK = ROOT.parent / "shared" / "check_results.py"


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("maps") / "out"
    process = run("diagnose", EXAMPLE, "--out", out)
    assert process.returncode == 0, process.stderr
    assert process.stdout.startswith("PARTIAL")
    return out


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
        ("simulate", ("--truth", EXAMPLE / "job.toml"), "error maps cannot be simulated"),
    ],
)
def test_other_commands_say_what_to_do_instead(
    command: str, more: tuple[object, ...], says: str, tmp_path: Path
) -> None:
    process = run(command, EXAMPLE, *more, "--out", tmp_path / "out")
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
    shutil.copytree(EXAMPLE, job)
    text = (job / "job.toml").read_text(encoding="utf-8")
    assert old in text
    (job / "job.toml").write_text(text.replace(old, new), encoding="utf-8")
    process = run("diagnose", job, "--out", tmp_path / "out")
    assert process.returncode == 2
    assert says in process.stderr
    assert "Traceback" not in process.stderr
    assert not (tmp_path / "out").exists()
