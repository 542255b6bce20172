"""Help, completion, and what a quick command does without."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from cmm_uq.app.cli.commands import GROUPS, app
from cmm_uq.app.cli.options import job_folders, toml_files
from cmm_uq.base.errors import CmmUqError
from tests.app.cli.process import run
from tests.app.cli.terminal import until
from tests.conftest import ROOT

COMMANDS = {info.name: info for info in app.registered_commands}
GROUP = typer.main.get_command(app)


def helped(*arguments: str) -> str:
    return CliRunner().invoke(app, [*arguments, "--help"], prog_name="cmm-uq").output


@pytest.mark.parametrize("name", COMMANDS)
def test_a_help_shows_every_sentence_as_it_is_written_and_ends_with_calls(name: str) -> None:
    shown = " ".join(helped(name).split())
    for parameter in GROUP.commands[name].params:
        assert (parameter.help or "") in shown
        if not parameter.required and parameter.param_type_name == "option" and not parameter.is_flag:
            assert re.search(rf"{re.escape(parameter.opts[0])} .*?\[default: [^\]]+\]", shown), parameter.name
    calls = re.findall(rf"(?m)^ +cmm-uq {name}\b.*$", helped(name).partition("Examples:")[2])
    assert calls


def test_brackets_of_toml_are_not_taken_for_markup() -> None:
    assert "Job folder with [machine] error_map, " in helped("compensate")


def test_the_list_of_commands_is_not_cut() -> None:
    shown = helped()
    assert "..." not in shown.partition("First:")[2]
    assert "Exit codes: 0 done; 2 bad input" in shown


def test_every_command_is_listed_once_in_a_group_and_six_come_first() -> None:
    listed = [name for names in GROUPS.values() for name in names]
    assert sorted(listed) == sorted(GROUP.commands)
    assert len(GROUPS["First"]) == 6
    shown = helped()
    places = [shown.index(f"\n{title}:\n") for title in ("First", "Make", "Decide", "Records", "Check", "Instruments")]
    assert places == sorted(places)
    for name in listed:
        assert len(re.findall(rf"(?m)^  {name}  ", shown)) == 1


def test_alone_the_command_shows_the_three_most_used_calls() -> None:
    done = run()
    assert done.returncode == 0
    assert re.findall(r"(?m)^  cmm-uq (\w+)", done.stdout) == ["new", "report", "diagnose"]
    assert max(map(len, done.stdout.splitlines())) <= 80


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (
            ("diagnoes", "x"),
            "No such command 'diagnoes'. Did you mean 'diagnose'? cmm-uq --help lists commands and options",
        ),
        (
            ("report", "x", "--seeed", "3"),
            "No such option: --seeed. Did you mean --seed? cmm-uq report --help lists its options",
        ),
        (("report",), "Missing argument 'JOB'. cmm-uq report --help lists its options"),
    ],
)
def test_a_slip_is_answered_with_what_was_meant(arguments: tuple[str, ...], told: str, monkeypatch) -> None:
    from cmm_uq.app.cli import commands

    monkeypatch.setattr("sys.argv", ["cmm-uq", *arguments])
    with pytest.raises(CmmUqError) as error:
        commands.run()
    assert str(error.value) == told


@pytest.mark.parametrize("group", ["records", "schedule"])
def test_a_group_of_commands_alone_shows_its_help(group: str) -> None:
    done = run(group)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.rstrip() == run(group, "--help").stdout.rstrip()


needs_bash = pytest.mark.skipif(os.name == "nt" or shutil.which("bash") is None, reason="no bash here")


@pytest.fixture
def jobs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for name in ("jobs/a", "jobs/deep/b", "other/too/deep/for/it", ".hidden"):
        (tmp_path / name).mkdir(parents=True)
        (tmp_path / name / "job.toml").touch()
    (tmp_path / "jobs" / "truth.toml").touch()
    (tmp_path / "model.toml").touch()
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_folders_with_a_job_are_completed_and_nothing_hidden_or_far_below(jobs: Path) -> None:
    assert [path.replace(os.sep, "/") for path in job_folders("")] == ["jobs/a", "jobs/deep/b"]
    assert [path.replace(os.sep, "/") for path in job_folders("jobs/d")] == ["jobs/deep/b"]
    assert job_folders("nowhere/") == []
    assert [path.replace(os.sep, "/") for path in job_folders("other/too/d")] == ["other/too/deep/for/it"]


def test_files_of_toml_are_completed_that_are_no_job(jobs: Path) -> None:
    assert [path.replace(os.sep, "/") for path in toml_files("")] == ["jobs/truth.toml", "model.toml"]


@pytest.fixture
def shell(tmp_path: Path) -> Iterator[int]:
    """A bash with the command's completion; the command is this interpreter's."""
    import pty

    command = tmp_path / "bin" / "cmm-uq"
    command.parent.mkdir()
    command.write_text(f'#!/bin/sh\nexec {sys.executable} -m cmm_uq "$@"\n', encoding="utf-8")
    command.chmod(0o755)
    master, slave = pty.openpty()
    environment = {**os.environ, "PATH": f"{command.parent}:{os.environ['PATH']}", "TERM": "dumb", "PS1": "$ ",
                   "HOME": str(tmp_path), "PYTHONPATH": str(ROOT)}  # fmt: skip
    with subprocess.Popen(["bash", "--norc", "--noprofile", "-i"], stdin=slave, stdout=slave, stderr=slave, cwd=ROOT,
                          env=environment, start_new_session=True) as process:  # fmt: skip
        os.close(slave)
        yield master
        process.kill()
    os.close(master)


def typed(master: int, keys: str, wanted: str) -> None:
    os.write(master, keys.encode())
    shown = until(master, wanted, time.monotonic() + 30)
    assert re.search(wanted, shown), shown


@needs_bash
def test_bash_completes_commands_jobs_and_options_once_it_is_installed(shell: int, tmp_path: Path) -> None:
    typed(shell, "cmm-uq --install-completion\n", "bash completion installed in")
    typed(shell, f"source {tmp_path}/.bashrc; echo rea''dy\n", "ready")
    typed(shell, "cmm-uq rep\t", "report ")
    typed(shell, "examples/iota-1102-m\t", "iota-1102-maps ")
    typed(shell, "--verb\t", "--verbose ")


@needs_bash
def test_the_script_can_be_shown_instead() -> None:
    done = subprocess.run(["bash", "-c", f"{sys.executable} -m cmm_uq --show-completion; exit $?"], capture_output=True,
                          text=True, check=False, cwd=ROOT)  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "complete -o default -F" in done.stdout


COMMAND = """
import sys
from cmm_uq.base.unused import lighten
lighten()
import emcee
import numpy as np
import scipy.linalg.interpolative
import scipy.optimize
import scipy.special
assert not {"scipy.stats", "numpy.f2py.crackfortran", "scipy.spatial"} & {*sys.modules}
sampler = emcee.EnsembleSampler(4, 1, lambda x: -0.5 * x @ x)
sampler.run_mcmc([[0.1], [0.2], [0.3], [0.4]], 5)
found = scipy.optimize.shgo(lambda x: (x[0] - 1) ** 2, [(-3.0, 3.0)])
assert abs(found.x[0] - 1) < 1e-6
assert scipy.linalg.interpolative.interp_decomp(np.outer([1.0, 2.0, 3.0], [1.0, 2.0]), 1e-6)[0] == 1
import scipy.stats
assert round(scipy.stats.norm.cdf(1.96), 3) == 0.975
"""


@pytest.mark.long
def test_what_is_not_used_is_not_loaded_until_it_is() -> None:
    run = subprocess.run([sys.executable, "-c", COMMAND], capture_output=True, check=False, text=True)
    assert (run.returncode, run.stderr) == (0, "")
