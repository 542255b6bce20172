"""However a command ends: one line, a documented exit code, and nothing of the user's lost."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.app.cli.process import COMMAND, run
from tests.conftest import ROOT

BUDGET = (
    '[model]\noutputs = { y = "2*x" }\nmethod = "first"\n[inputs.x]\ndistribution = "normal"\nvalue = 1.0\nu = 0.1\n'
)
TRUTH = "seed = 1\n[noise]\ncoordinate_um = 1.0\n"


@pytest.fixture
def budget(tmp_path: Path) -> Path:
    path = tmp_path / "model.toml"
    path.write_text(BUDGET)
    return path


@pytest.mark.usefixtures("no_regions", "no_diagnosis")
def test_a_strict_run_ends_with_4_where_the_machine_does_not_conform(iota: Path, tmp_path: Path) -> None:
    done = run("report", iota, "--out", tmp_path / "out", "--strict", "--quiet")
    assert done.returncode == 4
    assert (tmp_path / "out" / "certificate.pdf").is_file()


@pytest.mark.parametrize(("dof", "code"), [(2.2, 4), (30.0, 0)])
def test_a_strict_budget_ends_with_4_where_monte_carlo_is_not_stable(
    budget: Path, tmp_path: Path, dof: float, code: int
) -> None:
    """A t of 2.2 degrees of freedom has so heavy a tail that u is not found; it is written all the same, and says so."""
    budget.write_text(
        '[model]\noutputs = { y = "x" }\nmethod = "monte_carlo"\ndigits = 1\n'
        f'[inputs.x]\ndistribution = "t"\nvalue = 0.0\nu = 1.0\ndof = {dof}\n'
    )
    done = run("budget", budget, "--out", tmp_path / "out", "--strict", "--json")
    assert done.returncode == code
    (told,) = json.loads(done.stdout)["outputs"].values()
    assert told["monte_carlo"]["stable"] is (code == 0)
    assert ("not stable" in told["reason"]) is (code == 4)


@pytest.mark.long
def test_a_strict_diagnosis_ends_with_4_where_something_was_left_out_and_with_0_where_not(
    job: Path, tmp_path: Path
) -> None:
    path = job / "job.toml"
    assert run("diagnose", job, "--out", tmp_path / "a", "--strict", "--quiet").returncode == 0
    path.write_text(path.read_text().replace('"squareness_xy", ', "", 1))
    assert run("diagnose", job, "--out", tmp_path / "b", "--strict", "--quiet").returncode == 4


@pytest.mark.long
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full on this system")
def test_a_full_standard_output_ends_with_3_and_the_files_are_there(budget: Path, tmp_path: Path) -> None:
    with Path("/dev/full").open("w") as full:
        done = subprocess.run([*COMMAND, "budget", str(budget), "--out", str(tmp_path / "out")], stdout=full,
                              stderr=subprocess.PIPE, text=True, check=False)  # fmt: skip
    assert done.returncode == 3
    assert done.stderr == f"cmm-uq: standard output cannot be written. The files are written in {tmp_path / 'out'}\n"
    assert (tmp_path / "out" / "manifest.json").is_file()


@pytest.mark.long(but=">&- 2>&-")
@pytest.mark.skipif(os.name == "nt", reason="shell of POSIX")
@pytest.mark.parametrize("redirection", [">&-", "2>&-", "<&-", ">&- 2>&-"])
def test_closed_streams_end_without_a_traceback(budget: Path, tmp_path: Path, redirection: str) -> None:
    line = f"exec {sys.executable} -m cmm_uq budget {budget} --out {tmp_path / 'out'} {redirection}"
    done = subprocess.run(["sh", "-c", line], capture_output=True, text=True, check=False)
    assert done.returncode == (3 if redirection.startswith(">") else 0), done.stderr
    assert "Traceback" not in done.stderr
    assert (tmp_path / "out" / "manifest.json").is_file()


@pytest.mark.skipif(os.name == "nt", reason="a folder in use cannot be removed there")
def test_a_working_folder_that_is_gone_is_told_in_one_line(budget: Path, tmp_path: Path) -> None:
    gone = tmp_path / "gone"
    gone.mkdir()
    line = f"cd {gone} && rmdir {gone} && exec {sys.executable} -m cmm_uq budget {budget}"
    done = subprocess.run(["sh", "-c", line], capture_output=True, text=True, check=False,
                          env={**os.environ, "PYTHONPATH": str(ROOT)})  # fmt: skip
    assert done.returncode == 2
    assert done.stderr == "cmm-uq: the working folder is gone. Change to a folder that exists\n"


def test_an_unknown_option_is_one_line() -> None:
    done = run("report", "x", "--bogus")
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "--bogus" in done.stderr


@pytest.mark.long
def test_a_fault_of_the_program_is_one_line_too(budget: Path, tmp_path: Path) -> None:
    """A library that breaks: here one that cannot even be imported."""
    (tmp_path / "jinja2").mkdir()
    (tmp_path / "jinja2" / "__init__.py").write_text("raise RuntimeError('broken\\n installation' * 100)")
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), str(ROOT)])}
    done = subprocess.run([*COMMAND, "budget", str(budget), "--out", str(tmp_path / "out")], capture_output=True,
                          text=True, check=False, env=environment)  # fmt: skip
    assert done.returncode == 3
    assert done.stderr.count("\n") == 1
    assert len(done.stderr) < 320
    assert "RuntimeError" in done.stderr
    assert "Nothing was written" in done.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.long
def test_a_fault_after_the_files_are_written_says_that_they_are(budget: Path, tmp_path: Path) -> None:
    """Here the summary breaks, as a library on a terminal may."""
    program = (
        "import sys\nfrom cmm_uq.app.cli import main, terminal\n"
        "def broken(text=''):\n    raise RuntimeError('broken')\n"
        "terminal.say = broken\nsys.argv = ['cmm-uq', *sys.argv[1:]]\nmain()\n"
    )
    done = subprocess.run([sys.executable, "-c", program, "budget", str(budget), "--out", str(tmp_path / "out")],
                          capture_output=True, text=True, check=False)  # fmt: skip
    assert done.returncode == 3
    assert f"The files are written in {tmp_path / 'out'}" in done.stderr
    assert "Nothing was written" not in done.stderr
    assert (tmp_path / "out" / "manifest.json").is_file()


def _files(folder: Path) -> dict[str, bytes]:
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def _commands(folder: Path) -> dict[str, list[str]]:
    """Each command on a job of its own, all of one id."""
    iota = ROOT / "examples" / "iota-1102-20C"
    for name in ("a", "b"):
        shutil.copytree(iota, folder / name)
    text = (folder / "a" / "job.toml").read_text()
    rows = ["axis,position_mm,dx_um,dy_um,dz_um,rx_arcsec,ry_arcsec,rz_arcsec"]
    for axis, low, end in (("x", 0.0, 900.0), ("y", 0.0, 550.0), ("z", -500.0, 0.0)):
        rows += [f"{axis},{position},0,0,0,0,0,0" for position in (low, end)]
    (folder / "a" / "map.csv").write_text("\n".join(rows) + "\n")
    maps = 'error_map = [ { file = "map.csv", temperature_c = 20.0 } ]\n'
    (folder / "a" / "job.toml").write_text(text.replace('chain = "XYZ"\n', f'chain = "XYZ"\n{maps}', 1))
    (folder / "truth.toml").write_text(TRUTH)
    (folder / "model.toml").write_text(BUDGET)
    return {
        "simulate": ["simulate", str(folder / "b"), "--truth", str(folder / "truth.toml")],
        "compensate": ["compensate", str(folder / "a")],
        "budget": ["budget", str(folder / "model.toml")],
        "plan": ["plan", str(folder / "b"), "--no-power"],
        "diagnose": ["diagnose", str(folder / "b")],
        "report": ["report", str(folder / "b")],
    }


@pytest.mark.parametrize("first", ["budget", "simulate", "compensate"])
def test_no_command_takes_the_folder_of_another(tmp_path: Path, first: str) -> None:
    commands = _commands(tmp_path)
    out = tmp_path / "out"
    assert run(*commands[first], "--out", out, "--quiet").returncode == 0
    before = _files(tmp_path)
    for second in commands.keys() - {first}:
        done = run(*commands[second], "--out", out, "--quiet")
        assert done.returncode == 2, (second, done.stderr)
        assert "--force" in done.stderr
    assert _files(tmp_path) == before
    assert run(*commands[first], "--out", out, "--quiet").returncode == 0
    assert _files(tmp_path) == before


@pytest.mark.usefixtures("no_regions", "no_diagnosis")
@pytest.mark.parametrize("command", ["budget", "plan", "diagnose", "report", "simulate", "compensate"])
def test_no_command_writes_over_its_own_inputs(tmp_path: Path, command: str) -> None:
    """A recording that has the name of an output, or the job's own folder as the output."""
    commands = _commands(tmp_path)
    folder = tmp_path if command == "budget" else tmp_path / ("a" if command == "compensate" else "b")
    (folder / ("budget.html" if command == "budget" else "plan.csv")).write_text("mine")
    before = _files(tmp_path)
    done = run(*commands[command], "--out", folder, "--quiet")
    after = _files(tmp_path)
    assert before.items() <= after.items()
    if command in ("budget", "plan", "simulate", "compensate"):
        assert done.returncode == 2
        assert after == before
