"""``cmm-uq diagnose``, ``plan``, ``selftest``, ``--json`` and ``--language``."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import typer

from cmm_uq.app.cli.evaluations import selftest as command
from cmm_uq.app.commands.reading import read_job
from cmm_uq.certificate.plots import style as fonts
from cmm_uq.machine.physics.catalogue import EVERY
from cmm_uq.maths.uncertainty.reference import jcgm, selftest
from cmm_uq.maths.uncertainty.reference.jcgm import ReferenceCase
from tests.app.cli.process import run, run_apart
from tests.app.commands.test_planning import JOB, SIX
from tests.certificate.test_translatable import MODEL
from tests.conftest import ROOT


@pytest.fixture
def told_of_scale_only(job: Path) -> Path:
    path = job / "job.toml"
    text = re.sub(r"^effects = .*", 'effects = ["scale_x", "scale_y", "scale_z"]', path.read_text("utf-8"), flags=re.M)
    path.write_text(text, encoding="utf-8")
    return job


@pytest.mark.long
def test_it_names_what_was_left_out_and_keeps_the_contract(told_of_scale_only: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    done = run("diagnose", told_of_scale_only, "--out", out)
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


def test_effects_are_listed_with_all_that_is_said_of_them_or_asked_for_in_another_word() -> None:
    points_to = EVERY["trigger_delay"].points_to
    assert (
        run("effects", "trigger_delay").stdout
        == f"""\
  trigger_delay  Delay of the probe's trigger
                 formula: e = delay·speed·n
                 prior: delay_ms ±1 ms
                 needs: nx, ny, nz, speed_mm_s
                 lies in: controller
                 points to: {points_to}
"""
    )
    assert len(json.loads(run("effects", "--json").stdout)["effects"]) == len(EVERY)
    listed = [line.split()[0] for line in run("effects").stdout.splitlines()]
    assert listed == list(EVERY)  # a line each
    wrong = run("effects", "sqareness")
    assert (wrong.returncode, wrong.stdout) == (2, "")
    assert wrong.stderr == "cmm-uq: cmm-uq effects: no effect has 'sqareness' in it. Did you mean 'squareness'?\n"


@pytest.mark.long
def test_the_same_seed_gives_the_same_bytes(iota: Path, tmp_path: Path) -> None:
    for name in ("a", "b"):
        assert run_apart("diagnose", iota, "--out", tmp_path / name, "--quiet").stdout == ""
    for file in ("diagnosis.html", "diagnosis.pdf", "next_plan.csv", "results.json"):
        assert (tmp_path / "a" / file).read_bytes() == (tmp_path / "b" / file).read_bytes()


def test_an_absurd_false_alarm_rate_is_refused(iota: Path, tmp_path: Path) -> None:
    done = run("diagnose", iota, "--out", tmp_path / "out", "--alpha", "2")
    assert done.returncode == 2
    assert "false-alarm rate of 2" in done.stderr
    assert not (tmp_path / "out").exists()


@pytest.fixture
def planned(tmp_path: Path) -> Path:
    folder = tmp_path / "job"
    folder.mkdir()
    plan = 'criterion = "separation"\nmore = 2\ncandidates = 60'
    (folder / "job.toml").write_text(JOB.format(plan=plan, effects=SIX, length=400.0), encoding="utf-8")
    return folder


def test_a_job_without_recording_gets_its_placings_as_table_page_and_recording_to_be(
    planned: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    done = run("plan", planned, "--out", out, "--no-power", "--verbose")
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
    assert "Set-ups 1 to 3" in page
    assert page.count("<svg") == 8 + 1  # twenty-two placings, three a row, and what the better plan gains


def test_the_plan_is_read_as_a_recording_of_the_job(planned: Path, tmp_path: Path) -> None:
    done = run("plan", planned, "--out", tmp_path / "out", "--no-power", "--quiet")
    assert done.stdout == ""
    (planned / "recording.csv").write_bytes((tmp_path / "out" / "plan.csv").read_bytes())
    points = read_job(planned).points
    assert len(np.unique(points.measurement)) == 22
    bars = points.xyz[1::2] - points.xyz[::2]
    np.testing.assert_allclose(np.linalg.norm(bars, axis=1), 400.0, atol=1e-6)


@pytest.mark.long
def test_the_same_seed_gives_the_same_plan(planned: Path, tmp_path: Path) -> None:
    for name in ("a", "b"):
        assert run_apart("plan", planned, "--out", tmp_path / name, "--no-power", "--quiet").returncode == 0
    for file in ("plan.html", "plan.csv", "results.json"):
        assert (tmp_path / "a" / file).read_bytes() == (tmp_path / "b" / file).read_bytes()


def test_a_recording_is_judged_by_what_it_determined(iota: Path, tmp_path: Path) -> None:
    done = run("plan", iota, "--out", tmp_path / "out", "--no-power", "--json")
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
    planned: Path, tmp_path: Path, old: str, new: str, said: str
) -> None:
    path = planned / "job.toml"
    path.write_text(path.read_text("utf-8").replace(old, new), encoding="utf-8")
    done = run("plan", planned, "--out", tmp_path / "out", "--no-power")
    assert done.returncode == 2
    assert said in done.stderr
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "out").exists()


SUM = ReferenceCase("sum", "arithmetic", {"a": (2.0, 0.1)}, lambda: [2.5])


def test_every_published_figure_is_reproduced_and_named_with_its_source() -> None:
    done = run("selftest", "--verbose")
    assert done.returncode == 0, done.stdout
    passed, total = map(int, re.search(r"(\d+) of (\d+) figures", done.stdout).groups())
    assert passed == total > 100
    rows = re.findall(r"(?m)^PASS  (.+): (\S+), expected (\S+) within (\S+) \((.+)\)$", done.stdout)
    assert len(rows) == total
    assert any("JCGM 101" in source for *_, source in rows)


def test_programs_get_the_figures_as_numbers_and_what_differs_ends_with_4(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    outcomes = [*selftest.run(jcgm.CASES[:4]), *selftest.run([SUM])]
    monkeypatch.setattr(selftest, "run", lambda: outcomes)
    with pytest.raises(typer.Exit) as ended:
        command(json=True)
    assert ended.value.exit_code == 4
    data = json.loads(capsys.readouterr().out)
    *figures, wrong = data["figures"]
    assert (data["schema"], data["passed"]) == ("cmm-uq/selftest/1", len(figures))
    assert (wrong["case"], wrong["expected"], wrong["got"], wrong["passed"]) == ("sum: a", 2.0, 2.5, False)
    for figure in figures:
        assert figure["passed"] is True
        assert abs(figure["got"] - figure["expected"]) <= figure["tolerance"] + 1e-12 * abs(figure["expected"])


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("json")
    (folder / "truth.toml").write_text("seed = 1\n[noise]\ncoordinate_um = 1.0\n", encoding="utf-8")
    return folder


def test_a_simulation_says_what_it_wrote_where(folder: Path) -> None:
    job = ROOT / "examples" / "iota-1102-20C"
    done = run("simulate", job, "--truth", "truth.toml", "--out", "out", "--json", cwd=folder)
    assert (done.returncode, done.stderr) == (0, "")
    data = json.loads(done.stdout)
    assert (data["command"], data["folder"]) == ("simulate", "out")
    assert set(data["files"]) == {"job.toml", "ballbar.csv", "truth.toml"}
    manifest = json.loads((folder / "out" / "manifest.json").read_bytes())
    assert {**manifest, "folder": "out"} == data


@pytest.mark.parametrize(
    ("arguments", "problem", "where"),
    [
        (("report", "nowhere"), "no such file", str(Path("nowhere") / "job.toml")),
        (("report", "x", "--bogus"), "No such option: --bogus", None),
    ],
)
def test_an_error_is_an_object_with_problem_place_and_fix(
    folder: Path, arguments: tuple[str, ...], problem: str, where: str | None
) -> None:
    done = run(*arguments, "--json", cwd=folder)
    assert (done.returncode, done.stdout) == (2, "")
    told = json.loads(done.stderr)["error"]
    assert (told["problem"], told["where"], told["exit_code"]) == (problem, where, 2)
    assert told["fix"]


@pytest.fixture(scope="module")
def german(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a report in German and, beside it, one in English."""
    folder = tmp_path_factory.mktemp("language")
    example = Path(__file__).parents[3] / "examples" / "iota-1102-20C"
    told = [
        run("report", example, "--out", folder / "de", "--language", "de"),
        run("report", example, "--out", folder / "en"),
    ]
    assert [process.returncode for process in told] == [0, 0]
    assert told[0].stdout.splitlines()[0] == told[1].stdout.splitlines()[0]
    return folder / "de"


@pytest.mark.long
def test_the_documents_are_in_the_language(german: Path) -> None:
    page = (german / "certificate.html").read_text(encoding="utf-8")
    assert '<html lang="de">' in page
    assert "<h1>Kalibrierschein</h1>" in page
    assert "404,2051" in page
    assert "404.2051" not in page


@pytest.mark.long
def test_the_results_are_the_english_ones_but_for_the_name_of_the_language(german: Path) -> None:
    data, english = (json.loads((folder / "results.json").read_bytes()) for folder in (german, german.parent / "en"))
    assert data["job"].pop("language") == "de"
    assert data == english
    assert (german / "posterior.npz").read_bytes() == (german.parent / "en" / "posterior.npz").read_bytes()


def test_a_budget_is_said_in_the_language_with_the_words_of_its_file(tmp_path: Path) -> None:
    (tmp_path / "model.toml").write_text(MODEL, encoding="utf-8")
    process = run("budget", tmp_path / "model.toml", "--out", tmp_path / "out", "--language", "fr")
    assert process.returncode == 0, process.stderr
    page = (tmp_path / "out" / "budget.html").read_text(encoding="utf-8")
    assert '<html lang="fr">' in page
    assert "certificate 123" in page
    assert re.search(r"\b0,05\d*", page)
    assert json.loads((tmp_path / "out" / "results.json").read_bytes())["language"] == "fr"


def test_a_language_that_nobody_translated_is_refused(iota: Path, tmp_path: Path) -> None:
    process = run("report", iota, "--out", tmp_path / "out", "--language", "it")
    assert process.returncode == 2
    assert "'de'" in process.stderr
    assert not (tmp_path / "out").exists()


def test_with_a_schedule_jobs_have_the_language_that_they_name(tmp_path: Path) -> None:
    process = run("report", "--scheduled", tmp_path, "--language", "de")
    assert process.returncode == 2
    assert "--language: goes without --scheduled" in process.stderr


def test_japanese_without_its_font_leaves_nothing_behind(
    iota: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(fonts, "find_spec", lambda name: None)
    process = run("report", iota, "--out", tmp_path / "out", "--language", "ja")
    assert process.returncode == 2
    assert "cmm-uq[ja]" in process.stderr
    assert not (tmp_path / "out").exists()
