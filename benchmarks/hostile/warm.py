"""Commands as processes of their own that spend no second on imports: forked from one that has imported everything.

Signals, streams, exit codes and the end of the interpreter are the command's own; nothing ran in the process before it.
``python -m benchmarks.hostile.warm`` is asked by lines of JSON: what to run, where, and by whom.
"""

from __future__ import annotations

import contextlib
import encodings
import importlib
import json
import os
import pkgutil
import re
import runpy
import select
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

from benchmarks.hostile.invariants import Outcome

ROOT = Path(__file__).parents[2]


class Warm(contextlib.AbstractContextManager["Warm"]):
    """A process that forks commands, one at a time; ``user``: to whom they belong, else to this one."""

    def __init__(self, user: int | None = None) -> None:
        environment = {name: value for name, value in os.environ.items() if not name.startswith("COVERAGE_")}
        self._server = subprocess.Popen(
            [sys.executable, "-m", "benchmarks.hostile.warm"], cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE,
            env={**environment, "PYTHONPATH": str(ROOT), "PYTHONDONTWRITEBYTECODE": "1", "OPENBLAS_NUM_THREADS": "1"},
            user=user, group=user, extra_groups=None if user is None else (),
        )  # fmt: skip
        self.pid = 0

    def start(self, arguments: Sequence[str], cwd: Path, *, streams: Sequence[Path | str] = ("/dev/null",) * 3,
              environment: Mapping[str, str] | None = None, stopped: bool = False) -> int:  # fmt: skip
        """Begin a command; its process.

        Parameters
        ----------
        streams : files of standard input, output and error, opened by the command's process.
        environment : variables beside those that there are.
        stopped : it waits for SIGCONT before it does anything.
        """
        assert self._server.stdin is not None
        asked = {"arguments": arguments, "cwd": str(cwd), "streams": list(map(str, streams)),
                 "environment": dict(environment or {}), "stopped": stopped}  # fmt: skip
        self._server.stdin.write(json.dumps(asked).encode() + b"\n")
        self._server.stdin.flush()
        self.pid = int(self._reply()["pid"])
        return self.pid

    def ended(self, seconds: float) -> tuple[int, float] | None:
        """Exit code and the seconds computed, negative for a signal; ``None`` where it has not ended in that time."""
        assert self._server.stdout is not None
        if not select.select([self._server.stdout], [], [], seconds)[0]:
            return None
        reply = self._reply()
        return int(reply["code"]), reply["seconds"]

    def run(self, arguments: Sequence[str], cwd: Path, *, kill: tuple[int, float] | None = None, limit: float = 120.0,
            environment: Mapping[str, str] | None = None, traced: Sequence[str] = ()) -> Outcome:  # fmt: skip
        """As :func:`benchmarks.hostile.processes.run`; ``traced`` by strace with its options, attached to the process."""
        with tempfile.NamedTemporaryFile() as stdout, tempfile.NamedTemporaryFile() as stderr:
            for file in (stdout, stderr):
                Path(file.name).chmod(0o666)
            streams = ("/dev/null", stdout.name, stderr.name)
            self.start(arguments, cwd, streams=streams, environment=environment, stopped=bool(traced))
            tracer = _attached(traced, self.pid) if traced else None
            sent = 0.0
            ended = self.ended(kill[1] if kill else limit)
            if ended is None and kill:
                os.kill(self.pid, kill[0])
                sent = time.monotonic()
                ended = self.ended(limit)
            since = time.monotonic() - sent if sent else 0.0
            if ended is None:
                os.killpg(self.pid, signal.SIGKILL)
                self.ended(limit)
            if tracer is not None:
                tracer.communicate()
            said = [os.pread(file.fileno(), 1 << 20, 0).decode("utf-8", "replace") for file in (stdout, stderr)]
        code, computed = ended or (None, limit)
        return Outcome(code, *said, since if kill else computed)

    def _reply(self) -> dict[str, float]:
        assert self._server.stdout is not None
        return dict(json.loads(self._server.stdout.readline()))

    def __exit__(self, *_: object) -> None:
        self._server.kill()
        self._server.wait()
        for pipe in (self._server.stdin, self._server.stdout):
            if pipe is not None:
                with contextlib.suppress(BrokenPipeError):
                    pipe.close()


def _attached(traced: Sequence[str], process: int) -> subprocess.Popen[bytes]:
    """A tracer of a process that is stopped, which goes on once it is attached to."""
    while Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "T":
        time.sleep(0.001)
    tracer = subprocess.Popen([*traced, "-p", str(process)], stderr=subprocess.PIPE)
    while re.search(r"TracerPid:\t0\n", Path(f"/proc/{process}/status").read_text()):
        time.sleep(0.001)
    os.kill(process, signal.SIGCONT)
    return tracer


def _become(asked: dict, reply: int) -> None:
    """In the forked process: its folder, user, streams and arguments, as if it had just been started."""
    os.close(reply)
    os.setsid()
    if asked["stopped"]:
        os.kill(os.getpid(), signal.SIGSTOP)
    os.environ.update(asked["environment"])
    with contextlib.suppress(OSError):  # a folder that this user may not enter
        os.chdir(asked["cwd"])
    flags = (os.O_RDONLY, os.O_WRONLY | os.O_CREAT, os.O_WRONLY | os.O_CREAT)
    for number, (name, flag) in enumerate(zip(asked["streams"], flags, strict=True)):
        opened = os.open(name, flag)  # a terminal becomes that of this session
        os.dup2(opened, number)
        if opened > 2:
            os.close(opened)
    sys.stdin, sys.stdout, sys.stderr = (
        os.fdopen(number, mode, encoding="utf-8", errors=errors, closefd=False)
        for number, mode, errors in (
            (0, "r", "surrogateescape"),
            (1, "w", "surrogateescape"),
            (2, "w", "backslashreplace"),
        )
    )
    sys.stdout.reconfigure(line_buffering=sys.stdout.isatty())
    sys.stderr.reconfigure(line_buffering=True)
    sys.argv = ["cmm-uq", *asked["arguments"]]
    runpy.run_module("cmm_uq", run_name="__main__")
    sys.exit()


def main() -> None:
    """Import everything, and fork what is asked for."""
    import cmm_uq

    everything = (
        *pkgutil.walk_packages(cmm_uq.__path__, "cmm_uq."),
        *pkgutil.iter_modules(encodings.__path__, "encodings."),
    )
    for module in everything:
        if not module.name.endswith("__main__"):
            with contextlib.suppress(ImportError):
                importlib.import_module(module.name)
    asking, reply = os.dup(0), os.dup(1)
    os.dup2(2, 1)
    with os.fdopen(asking, "rb", buffering=0) as lines:
        for line in lines:
            asked = json.loads(line)
            process = os.fork()
            if not process:
                os.close(asking)
                _become(asked, reply)
            os.write(reply, json.dumps({"pid": process}).encode() + b"\n")
            _, status, usage = os.wait4(process, 0)
            seconds = usage.ru_utime + usage.ru_stime
            ended = {"code": os.waitstatus_to_exitcode(status), "seconds": seconds}
            os.write(reply, json.dumps(ended).encode() + b"\n")


if __name__ == "__main__":
    main()
