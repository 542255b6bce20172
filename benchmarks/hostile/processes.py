"""The command as a real process: one cheap job for each command, in two versions, and the sets that undisturbed runs write."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from benchmarks.hostile.invariants import Outcome, set_problems
from benchmarks.hostile.seeds import seeds, small_truth

PROGRAM = [sys.executable, "-m", "cmm_uq"]
ROOT = Path(__file__).parents[2]
LIMIT = 120.0
"""Seconds after which a process is taken to hang: the dearest command here computes for less than ten."""
OUT = "out"


@dataclass(frozen=True)
class Command:
    """A command and a cheap job for it.

    Parameters
    ----------
    name : of the command.
    seed : the job it runs on.
    more : arguments beside the job and ``--out``.
    """

    name: str
    seed: str
    more: tuple[str, ...] = ()

    def arguments(self, job: str = "job", out: str = OUT) -> tuple[str, ...]:
        """Arguments of the command, relative to the folder of :func:`prepare`."""
        subject = f"{job}/budget.toml" if self.name == "budget" else job
        return (self.name, subject, "--out", out, "--quiet", *self.more)

    def prepare(self, folder: Path, version: int = 0, job: str = "job", name: str | None = None) -> Path:
        """Lay the job out: the second version has another customer and a reading that differs, the same id."""
        place = folder / job
        place.mkdir(parents=True)
        (folder / "truth.toml").write_bytes(small_truth())
        for file, content in seeds()[self.seed].files.items():
            (place / file).write_bytes(_version(file, content, version, name))
        return place


def _version(file: str, content: bytes, version: int, name: str | None) -> bytes:
    if name and file == "job.toml":
        start = content.index(b'id = "') + 6
        content = content[:start] + name.encode() + content[content.index(b'"', start) :]
    if not version:
        return content
    if file == "budget.toml":
        return content.replace(b"value = 0.05", b"value = 0.06")
    if file.endswith(".csv") and b"measurement" in content:
        first = content.index(b"\n") + 1
        return content[:first] + content[first:].replace(b".", b".0", 1) if b"nx" not in content else content
    return content.replace(b"[job]", b'[job]\ncustomer = "second version"', 1) if file == "job.toml" else content


COMMANDS = {command.name: command for command in (
    Command("simulate", "sphere-simulated", ("--truth", "truth.toml")),
    Command("compensate", "compensable"),
    Command("budget", "budget-sum"),
    Command("plan", "shift-simulated", ("--no-power",)),
    Command("diagnose", "gauge-blocks-simulated"),
    Command("report", "gauge-blocks-simulated"),
)}  # fmt: skip
CHEAP = ("simulate", "compensate", "budget")


def environment(more: Mapping[str, str] | None = None) -> dict[str, str]:
    """What a process sees: this project first on the path, no bytecode written, no coverage measured.

    Coverage writes a file of its own when a process ends, which in a bad place fails with a traceback of its own.
    """
    kept = {name: value for name, value in os.environ.items() if not name.startswith("COVERAGE_")}
    return {**kept, "PYTHONPATH": str(ROOT), "PYTHONDONTWRITEBYTECODE": "1", **(more or {})}


def run(arguments: Sequence[str], cwd: Path, *, prefix: Sequence[str] = (), kill: tuple[int, float] | None = None,
        limit: float = LIMIT, **more: object) -> Outcome:  # fmt: skip
    """Run the command to its end.

    Parameters
    ----------
    prefix : a program that runs it, such as strace.
    kill : a signal, and the seconds after which it is sent. ``seconds`` then counts from it, 0 when the end came
        first; otherwise it is the time computed, so that a busy machine is not taken for a slow command.
    more : for ``subprocess.Popen``.
    """
    with tempfile.TemporaryFile() as stdout, tempfile.TemporaryFile() as stderr:
        given = {"stdout": stdout, "stderr": stderr, "stdin": subprocess.DEVNULL, "env": environment(), **more}
        process = subprocess.Popen([*prefix, *PROGRAM, *arguments], cwd=cwd, start_new_session=True, **given)
        began, sent, code = time.monotonic(), 0.0, None
        while code is None and time.monotonic() - began < limit:
            ended, status, usage = os.wait4(process.pid, os.WNOHANG)
            if ended:
                code = process.returncode = os.waitstatus_to_exitcode(status)
            elif kill and not sent and time.monotonic() - began >= kill[1]:
                process.send_signal(kill[0])
                sent = time.monotonic()
            else:
                time.sleep(0.002)
        computed = usage.ru_utime + usage.ru_stime
        if code is None:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()
        said = [os.pread(file.fileno(), 1 << 20, 0).decode("utf-8", "replace") for file in (stdout, stderr)]
    return Outcome(code, *said, (time.monotonic() - sent if sent else 0.0) if kill else computed)


@cache
def reference(name: str, version: int, job: str | None = None) -> Mapping[str, bytes]:
    """What an undisturbed run writes, by file name.

    Parameters
    ----------
    name : of the command.
    version : of its job.
    job : id of the job, instead of its own.

    Raises
    ------
    RuntimeError : it does not end well, so that nothing could be compared.
    """
    with tempfile.TemporaryDirectory(dir=memory()) as folder:
        COMMANDS[name].prepare(Path(folder), version, name=job)
        outcome = run(COMMANDS[name].arguments(), Path(folder))
        if outcome.code != 0:
            raise RuntimeError(f"{name}: {outcome.stderr}")
        return contents(Path(folder) / OUT)


def contents(folder: Path) -> dict[str, bytes]:
    """Files directly in a folder, hidden ones left out."""
    found = folder.iterdir() if folder.is_dir() else ()
    return {path.name: path.read_bytes() for path in found if path.is_file() and not path.name.startswith(".")}


def put(folder: Path, files: Mapping[str, bytes]) -> None:
    """Write files into a folder of their own."""
    folder.mkdir(parents=True)
    for name, content in files.items():
        (folder / name).write_bytes(content)


def taken_for_a_set(folder: Path) -> bool:
    """Whether a reader that goes by the manifest takes what lies in a folder for a complete set."""
    return folder.is_dir() and not [p for p in set_problems(folder) if not p.startswith("left over")]


def memory() -> str | None:
    """A folder in memory where there is one."""
    return "/dev/shm" if os.access("/dev/shm", os.W_OK) else None


def emptied(folder: Path) -> Path:
    """A new, empty folder at this place."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    return folder
