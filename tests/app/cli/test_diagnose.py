"""``cmm-uq diagnose`` as a user meets it."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from functools import partial
from pathlib import Path

import pytest

from tests.app.cli.process import run as run_command, run_apart
from tests.conftest import ROOT

run = partial(run_command, "diagnose")


@pytest.fixture
def told_of_scale_only(job: Path) -> Path:
    path = job / "job.toml"
    text = re.sub(r"^effects = .*", 'effects = ["scale_x", "scale_y", "scale_z"]', path.read_text("utf-8"), flags=re.M)
    path.write_text(text, encoding="utf-8")
    return job


def test_it_names_what_was_left_out_and_keeps_the_contract(told_of_scale_only: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    done = run(told_of_scale_only, "--out", out)
    assert done.returncode == 0, done.stderr
    assert "EXPLAINED" in done.stdout
    assert "Squareness X–Y" in done.stdout
    names = sorted(path.name for path in out.iterdir())
    assert names == ["diagnosis.html", "diagnosis.pdf", "manifest.json", "results.json"]  # nothing is left to be parted
    data = json.loads((out / "results.json").read_bytes())["diagnosis"]
    assert data["effects"][0]["effect"] == "squareness_xy"
    assert data["screening"][0]["rows"] == ["14", "18"]
    page = (out / "diagnosis.html").read_text(encoding="utf-8")
    assert "Squareness X–Y" in page
    checker = ROOT.parent / "shared" / "check_results.py"
    if checker.is_file():
        kept = subprocess.run(
            [sys.executable, checker, out / "results.json"], capture_output=True, text=True, check=False
        )
        assert kept.returncode == 0, kept.stdout


def test_the_same_seed_gives_the_same_bytes(iota: Path, tmp_path: Path) -> None:
    for name in ("a", "b"):
        assert run_apart("diagnose", iota, "--out", tmp_path / name, "--quiet").stdout == ""
    for file in ("diagnosis.html", "diagnosis.pdf", "next_plan.csv", "results.json"):
        assert (tmp_path / "a" / file).read_bytes() == (tmp_path / "b" / file).read_bytes()


def test_an_absurd_false_alarm_rate_is_refused(iota: Path, tmp_path: Path) -> None:
    done = run(iota, "--out", tmp_path / "out", "--alpha", "2")
    assert done.returncode == 2
    assert "false-alarm rate of 2" in done.stderr
    assert not (tmp_path / "out").exists()
