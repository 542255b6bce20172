"""``cmm-uq plan`` as a user meets it."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from cmm_uq.app.commands.reading import read_job
from tests.app.cli.process import run as run_command, run_apart
from tests.app.commands.test_planning import JOB, SIX

run = partial(run_command, "plan")


@pytest.fixture
def job(tmp_path: Path) -> Path:
    folder = tmp_path / "job"
    folder.mkdir()
    plan = 'criterion = "separation"\nmore = 2\ncandidates = 60'
    (folder / "job.toml").write_text(JOB.format(plan=plan, effects=SIX, length=400.0), encoding="utf-8")
    return folder


def test_a_job_without_recording_gets_its_placings_as_table_page_and_recording_to_be(job: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    done = run(job, "--out", out, "--no-power", "--verbose")
    assert done.returncode == 0, done.stderr
    assert "along +X +Y" in done.stdout
    assert "Searching for better placings" in done.stderr
    assert "Squareness X–Y" in done.stdout
    assert sorted(path.name for path in out.iterdir()) == ["manifest.json", "plan.csv", "plan.html", "results.json"]
    data = json.loads((out / "results.json").read_bytes())
    assert data["schema"] == "cmm-uq/plan/1"
    assert len(data["placings"]) == 22
    assert data["better"]["kept"] == 20
    page = (out / "plan.html").read_text(encoding="utf-8")
    assert "Placings 1 to 3" in page
    assert page.count("<svg") == 8 + 1  # twenty-two placings, three a row, and what the better plan gains


def test_the_plan_is_read_as_a_recording_of_the_job(job: Path, tmp_path: Path) -> None:
    done = run(job, "--out", tmp_path / "out", "--no-power", "--quiet")
    assert done.stdout == ""
    (job / "recording.csv").write_bytes((tmp_path / "out" / "plan.csv").read_bytes())
    points = read_job(job).points
    assert len(np.unique(points.measurement)) == 22
    bars = points.xyz[1::2] - points.xyz[::2]
    np.testing.assert_allclose(np.linalg.norm(bars, axis=1), 400.0, atol=1e-6)


def test_the_same_seed_gives_the_same_bytes(job: Path, tmp_path: Path) -> None:
    for name in ("a", "b"):
        assert run_apart("plan", job, "--out", tmp_path / name, "--no-power", "--quiet").returncode == 0
    for file in ("plan.html", "plan.csv", "results.json"):
        assert (tmp_path / "a" / file).read_bytes() == (tmp_path / "b" / file).read_bytes()


def test_a_recording_is_judged_by_what_it_determined(iota: Path, tmp_path: Path) -> None:
    done = run(iota, "--out", tmp_path / "out", "--no-power", "--json")
    assert done.returncode == 0, done.stderr
    data = json.loads(done.stdout)
    assert data["start"]["name"] == "recording"
    (placing,) = data["placings"]  # measurement 18 is a copy, so B89's twentieth position is still to be measured
    assert (placing["measurement"], placing["title"]) == (21, "along +X +Y")
    assert all(condition["met"] for condition in data["conditions"])
    squareness = {p["effect"]: p["u"] for p in data["start"]["determined"]}["squareness_xy"]
    assert 3 < squareness < 12  # ″; the residuals of 12.7 µm on bars of 404 mm


@pytest.mark.parametrize(("old", "new", "said"), [
    ("length_mm = 400.0", "length_mm = 4000.0", "long along"),
    (SIX, "", "no effect is named"),
    ("more = 2", "more = 0", "more"),
    ("more = 2", "more = 2\nnumber = 3", "number and more"),
    ("candidates = 60", "candidates = 60\n[plan.fixtures]\ndirections = [[0, 0, 0]]", "directions"),
    ("candidates = 60", "candidates = 60\nreadi = 1", "unknown key"),
])  # fmt: skip
def test_bad_input_ends_with_its_reason_and_leaves_nothing(
    job: Path, tmp_path: Path, old: str, new: str, said: str
) -> None:
    path = job / "job.toml"
    path.write_text(path.read_text("utf-8").replace(old, new), encoding="utf-8")
    done = run(job, "--out", tmp_path / "out", "--no-power")
    assert done.returncode == 2
    assert said in done.stderr
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "out").exists()
