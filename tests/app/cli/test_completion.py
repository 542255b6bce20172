"""Completion in a shell: what the command's own bash function gives, typed into a real bash on a pseudo-terminal."""

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

from cmm_uq.app.cli.options import job_folders, toml_files
from tests.app.cli.terminal import until
from tests.conftest import ROOT

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
