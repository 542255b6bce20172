"""A process that runs cases one after another by the command's own ``main``: ``python -m benchmarks.hostile.worker``.

A line with a number on standard input asks for that case; lines of JSON on descriptor ``--reply`` say when the full run begins
and how the case ended. What a case prints goes to files in memory, by descriptor, so that nothing escapes.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import shutil
import sys
import time
import traceback
import warnings
from collections.abc import Callable
from http import HTTPStatus
from pathlib import Path
from typing import Any, TextIO

from benchmarks.hostile import cases, every_command
from benchmarks.hostile.cases import Case
from benchmarks.hostile.invariants import Outcome, lost, problems, set_problems, snapshot
from benchmarks.hostile.seeds import small_truth

PAGES = (
    "/",
    "/machine?id=1",
    "/certificates",
    "/certificate?entry=1",
    "/diagnoses",
    "/artefacts",
    "/file",
    "/integrity",
)
MEMORY = 4 * 2**30
"""Bytes of address space: whoever reads an endless file fails within a second or two."""


def read(kind: str, path: Path) -> None:
    """Read what a command would read first, and no more."""
    from cmm_uq.app.commands.reading import read_job
    from cmm_uq.base.files.limits import JOB_BYTES, content_of
    from cmm_uq.base.files.toml_file import checked
    from cmm_uq.jobs.derived_job import Truth
    from cmm_uq.machine.model.predicted_errors import maps_of
    from cmm_uq.maths.uncertainty.models.model_file import read_model_file

    if kind == "budget":
        read_model_file(path)
    elif kind == "truth":
        checked(content_of(path, JOB_BYTES, "-"), path, Truth)
    else:
        job = read_job(path, recorded=kind != "plan")
        if kind == "maps":
            maps_of(job)


def look_at(server: Any, poll_interval: float = 0.5) -> None:
    """In place of waiting for browsers: every page once, none of which may end in a fault of the program."""
    from cmm_uq.app.serve.exchange import WebRequest, read_address

    for page in PAGES:
        answer = server.answer(WebRequest("GET", *read_address(page)))
        if answer.status == HTTPStatus.INTERNAL_SERVER_ERROR:
            raise AssertionError(f"{page}: {answer.body.decode()[-300:]}")


class Runner:
    """Runs the command in this process, with what it says caught by descriptor, and a fault shown where it happened."""

    def __init__(self, stdout: TextIO, stderr: TextIO, part: str = "mutations") -> None:
        from cmm_uq.app.cli import commands, main
        from cmm_uq.app.serve.server import RecordsServer
        from cmm_uq.base.errors import CmmUqError
        from cmm_uq.base.output import interruption

        if part == "mutations":  # in place of the command that prints a certificate
            commands.app.command("read")(read)
        RecordsServer.serve_forever = look_at  # type: ignore[assignment]
        inner = commands.run

        def shown() -> int:
            try:
                return inner()
            except (CmmUqError, MemoryError):
                raise
            except Exception:
                traceback.print_exc()
                raise

        commands.run = shown
        interruption.watch = lambda: None  # no signal comes, and each call would cost a thread and a pipe
        self._main: Callable[[], None] = main
        self._files = stdout, stderr

    def __call__(self, arguments: tuple[str, ...]) -> Outcome:
        """Run with these arguments."""
        for file in self._files:
            os.ftruncate(file.fileno(), 0)
            os.lseek(file.fileno(), 0, os.SEEK_SET)
        sys.argv = ["cmm-uq", *arguments]
        began = time.process_time()
        code = self._ended()
        said = [self._said(file) for file in self._files]
        return Outcome(code, *said, time.process_time() - began)

    def _ended(self) -> int:
        with warnings.catch_warnings():
            warnings.simplefilter("always")
            for silent in (DeprecationWarning, PendingDeprecationWarning, ImportWarning, ResourceWarning):
                warnings.simplefilter("ignore", silent)
            try:
                self._main()
            except SystemExit as end:
                return end.code if isinstance(end.code, int) else 0 if end.code is None else 1
            except BaseException:
                traceback.print_exc()
                return 1
            finally:
                sys.stdout.flush()
                sys.stderr.flush()
        return 0

    def _said(self, file: TextIO) -> str:
        size = os.fstat(file.fileno()).st_size
        return os.pread(file.fileno(), min(size, 1 << 20), 0).decode("utf-8", "replace")


def run_of_command(
    this: Case, run: Callable[[tuple[str, ...]], Outcome], root: Path, begin: Callable[[], None]
) -> dict[str, object]:
    """Lay a case of any command out, run it, and say what of its words, its end and the files beside does not hold."""
    shutil.rmtree(root, ignore_errors=True)
    root.mkdir(parents=True)
    every_command.lay_out(this, root)
    here = Path.cwd()
    os.chdir(root)
    before = snapshot(root)
    begin()
    outcome = run(this.command)
    os.chdir(here)
    allowed = outcome.code in every_command.CODES.get(this.target, ())
    if this.target in ("check", "batch", "report") and outcome.stdout:  # these say on standard output what is wrong
        allowed = allowed or outcome.code == 2
    found = [] if allowed and "Traceback" not in outcome.stderr else problems(outcome, quiet=False)
    own = tuple(f"job/{name}" for name in every_command.OWN.get(this.target, ()))
    after = {name: seal for name, seal in snapshot(root).items() if not name.endswith(("-wal", "-shm"))}
    held = {name: seal for name, seal in before.items() if not name.endswith("records.db") and not name.startswith(own)}
    found += lost(held, after)
    # a scheduled run keeps its log and what it has told
    kept = (".lock", "records.db", "schedule.log")
    new = {
        name
        for name in after
        if not (name.endswith(kept) or "/.scheduled" in name or name.startswith(own) or name in before)
    }
    if outcome.code == 2 and new and not allowed:
        found.append("something is written though refused")
    return {"number": this.number, "target": this.target, "what": this.what, "code": outcome.code, "ran": this.target,
            "found": found, "said": outcome.stderr[-1500:] if found else "", "seconds": outcome.seconds}  # fmt: skip


def run_case(this: Case, run: Runner, root: Path, begin: Callable[[], None]) -> dict[str, object]:
    """Lay a case out, run it, and say what does not hold."""
    shutil.rmtree(root, ignore_errors=True)
    root.mkdir(parents=True)
    cases.lay_out(this, root)
    (root / "truth.toml").write_bytes(small_truth())
    os.chdir(root)
    before = snapshot(root)
    found, code, ran = [], 0, ""
    if this.reads:
        outcome = run(this.reads)
        found, code = problems(outcome), outcome.code
    if this.command and code == 0:
        begin()
        ran = this.command[0]
        outcome = run(this.command)
        found += problems(outcome)
        code = outcome.code
        after = snapshot(root)
        found += lost(before, after)
        if code in (0, 4) and "out" in this.command:
            found += set_problems(root / "out")
        elif code not in (0, 4) and set(after) - set(before):
            found.append("something is written though refused")
    os.chdir("/")
    told = outcome.stderr[-1500:] if found else ""
    return {"number": this.number, "target": this.target, "what": this.what, "code": code, "ran": ran, "found": found,
            "said": told, "seconds": outcome.seconds}  # fmt: skip


JUDGED = {"mutations": (cases.case, run_case), "commands": (every_command.case, run_of_command),
          "unaltered": (lambda seed, number: every_command.unaltered(number), run_of_command)}  # fmt: skip
"""What makes a case by its seed and number, and what runs it, of each part."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--root", type=Path, required=True)
    parser.add_argument("--reply", type=int, required=True)
    parser.add_argument("--part", choices=tuple(JUDGED), default="mutations")
    options = parser.parse_args()
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    reply = os.fdopen(options.reply, "w")
    asking = os.fdopen(os.dup(0))
    with open(os.devnull) as nothing:  # noqa: PTH123 - what a command reads from its standard input
        os.dup2(nothing.fileno(), 0)
    for number, name in ((1, "stdout"), (2, "stderr")):
        os.dup2(os.memfd_create(name), number)
    run = Runner(sys.stdout, sys.stderr, options.part)

    def tell(**message: object) -> None:
        print(json.dumps(message), file=reply, flush=True)

    make, judge = JUDGED[options.part]
    for line in asking:
        tell(done=judge(make(options.seed, int(line)), run, options.root, lambda: tell(begins=True)))


if __name__ == "__main__":
    main()
