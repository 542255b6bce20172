"""Check tells all that is wrong with a job at once, each with its place and its fix, and what report refuses it refuses."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from cmm_uq.app.commands.jobs.check import Problem, check_job
from cmm_uq.app.commands.reading import read_job
from cmm_uq.app.commands.report import write_report
from cmm_uq.base.errors import CmmUqError
from cmm_uq.certificate.clauses import formal_warnings
from tests.app.cli.process import run
from tests.conftest import MACHINE_JOBS, ROOT


@pytest.fixture
def gauge(tmp_path: Path) -> Path:
    return Path(shutil.copytree(ROOT / "examples" / "step-gauge-simulated", tmp_path / "job"))


def change(path: Path, pattern: str, replacement: str) -> int:
    """Line of the first match, which is replaced."""
    text = path.read_text(encoding="utf-8")
    match = re.search(pattern, text, re.MULTILINE)
    assert match is not None
    path.write_text(text[: match.start()] + replacement + text[match.end() :], encoding="utf-8")
    return text.count("\n", 0, match.start()) + 1


@pytest.mark.parametrize("folder", MACHINE_JOBS, ids=lambda folder: folder.name)
def test_an_example_is_sound_unless_it_is_still_to_be_measured(folder: Path) -> None:
    found = check_job(folder)
    if folder.name.startswith("plan-"):
        (problem,) = found.problems
        assert problem.problem == "no such file"
    else:
        assert found.problems == ()


def test_everything_that_is_wrong_is_told_at_once_with_line_key_and_fix(gauge: Path) -> None:
    toml, csv = gauge / "job.toml", gauge / "recording.csv"
    lines = {
        "chain": change(toml, r"^chain = .*", 'chain = "XY"'),
        "u_mm": change(toml, r"^u_um = ", "u_mm = "),
        "effects": change(toml, r'^effects = \["scale_x", ', 'effects = ["scale", '),
        "mpe": change(toml, r"^mpe = .*", 'mpe = "4 per 100"'),
        "reference": change(csv, r"^1,2,1,([^,]*),([^,]*),([^,]*),140", r"1,2,1,1,2,3,x"),
        "row": change(csv, r"^1,4,1,.*", "1,4,1,2"),
    }
    problems = check_job(gauge).problems
    assert {(Path(one.file).name, one.line, one.key) for one in problems} == {
        ("job.toml", lines["chain"], "[machine] chain"),
        ("job.toml", lines["u_mm"], "[artefact] u_mm"),
        ("job.toml", lines["mpe"], "[[conformity]] 1 mpe"),
        ("job.toml", lines["effects"], "[model] effects"),
        ("recording.csv", lines["reference"], "reference_mm"),
        ("recording.csv", lines["row"], ""),
    }
    told = {one.key: one.fix for one in problems}
    assert told["[model] effects"] == "Did you mean 'scale_x', 'scale_y', 'scale_z'?"
    assert told["[artefact] u_mm"] == "Give u_um = 1000 · u_mm"


@pytest.mark.parametrize(
    ("pattern", "replacement", "told"),
    [
        (r"^standard = .*", 'standard = "ISO 10360-5:2010"', "is not decided on a step_gauge"),
        (r"^effects = .*", 'effects = ["thermal_scale_x"]', "thermal_scale_x needs the column temp_x_c"),
        (r"^file = .*", 'file = "gone.csv"', "no such file"),
        (r'^origin = "simulated"', 'origin = "measured"', ""),
        (r'^kind = "step_gauge"', 'kind = "plate"', "reference_x_mm"),
        (r"^u_um = .*", "u_um = 0.0", "needs the uncertainty"),
    ],
)
def test_what_stops_report_stops_check_and_nothing_else_does(
    pattern: str, replacement: str, told: str, gauge: Path, tmp_path: Path
) -> None:
    change(gauge / "job.toml", pattern, replacement)
    found = check_job(gauge)
    if not told:
        assert found.sound
        return
    with pytest.raises(CmmUqError):
        write_report(gauge, tmp_path / "report")
    assert any(told in one.problem for one in found.problems)


def test_what_the_certificate_warns_of_is_told_with_the_key_that_mends_it(iota: Path) -> None:
    found = check_job(iota)
    (missing,) = [text for text in formal_warnings(read_job(iota)) if text.startswith("Not complete")]
    keys = [one.key for one in found.warnings if "ISO/IEC 17025" in one.problem]
    assert keys == re.findall(r": (\[[a-z.]+\] [a-z]+)", missing)
    assert "[machine] serial" in keys
    assert any("repeats the coordinates of measurement 14" in one.problem for one in found.warnings)


@pytest.mark.parametrize(
    ("where", "expected"),
    [
        ("jobs/a/job.toml line 3: [artefact] u_um", ("jobs/a/job.toml", 3, "[artefact] u_um")),
        ("jobs/a/job.toml: [recording] file", ("jobs/a/job.toml", None, "[recording] file")),
        ("a b/rec.csv line 12, column x_mm", ("a b/rec.csv", 12, "x_mm")),
        ("rec.csv lines 3 and 9", ("rec.csv", 3, "")),
        ("rec.csv", ("rec.csv", None, "")),
    ],
)
def test_the_place_of_a_message_is_taken_apart(where: str, expected: tuple[str, int | None, str]) -> None:
    found = Problem.of(CmmUqError("is wrong", where=where))
    assert (found.file, found.line, found.key) == expected


def test_the_command_tells_several_jobs_as_text_and_as_json(iota: Path, gauge: Path) -> None:
    (gauge / "recording.csv").unlink()
    ended = run("check", iota, gauge)
    assert ended.returncode == 2
    assert f"SOUND  {iota}: nothing would stop report" in ended.stdout
    assert f"STOPS  {gauge}: 1 problem" in ended.stdout
    data = json.loads(run("check", "--json", gauge).stdout)["jobs"]
    assert [one["sound"] for one in data] == [False]
    assert data[0]["problems"][0]["fix"].startswith("Put it beside job.toml")
    assert run("check", "-q", iota).returncode == 0


@pytest.mark.parametrize("command", ["check", "new"])
def test_a_command_that_does_not_compute_loads_nothing_heavy(command: str, iota: Path, tmp_path: Path) -> None:
    program = (
        "import sys; sys.argv = ['cmm-uq', *sys.argv[1:]]\n"
        "import cmm_uq.app.cli.commands as c\nc.run()\n"
        "heavy = ['matplotlib', 'scipy.stats', 'emcee', 'pandas', 'scipy.optimize._optimize', 'jinja2', 'typst']\n"
        "print([name for name in heavy if name in sys.modules])"
    )
    asked = [str(iota), "-q"] if command == "check" else ["step_gauge", str(tmp_path / "new"), "-q"]
    ended = subprocess.run(
        [sys.executable, "-c", program, command, *asked], capture_output=True, text=True, check=True, cwd=ROOT
    )
    assert ended.stdout.strip() == "[]"
