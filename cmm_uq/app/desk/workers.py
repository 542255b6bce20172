"""The processes that read and compute for the desk: asked, waited for no longer than it may take, and ended.

What the desk hands on: files of its folder, in a sandbox.
"""

from __future__ import annotations

import json
import os
import queue
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from http import HTTPStatus
from pathlib import Path
from typing import IO, Any, cast

from cmm_uq.app.desk.place import below
from cmm_uq.app.serve.exchange import RefusedRequest, WebRequest, WebResponse, sent_file
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.limits import TABLE_BYTES, content_of
from cmm_uq.base.messages import Verbatim

MEMORY = 4 * 2**30  # bytes that reading a file may take, the libraries among them
PATIENCE_S = 60.0  # for an answer; the largest file that is read takes a few
BEAT_S = 1.0  # between two signs of life of a run
STREAM_S = 300.0  # after which a browser asks for events anew
_THREADS = (
    "OPENBLAS_NUM_THREADS",
    "OMP_NUM_THREADS",
    "MKL_NUM_THREADS",
)  # as the commands set them: figures are the same


class Worker:
    """A process in the root folder; begun when it is first asked, and again after it was ended."""

    def __init__(self, root: Path, memory: int = MEMORY) -> None:
        self._root, self._memory, self._lock = root, memory, threading.Lock()
        self._process: subprocess.Popen[str] | None = None
        self._lines: queue.Queue[str | None] = queue.Queue()

    def begin(self) -> IO[str]:
        """Start it, unless it is there; what it reads."""
        if (process := self._process) is not None and process.poll() is None:
            return cast("IO[str]", process.stdin)
        self.end()
        environment = {**dict.fromkeys(_THREADS, "1"), **os.environ}
        command = [sys.executable, "-P", "-m", "cmm_uq.app.desk.work", str(self._memory)]
        process = subprocess.Popen(  # noqa: S603 - this interpreter and this package
            command,
            cwd=self._root,
            env=environment,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            encoding="utf-8",
        )
        self._process, self._lines = process, queue.Queue()
        threading.Thread(target=_pumped, args=(process.stdout, self._lines), daemon=True).start()
        return cast("IO[str]", process.stdin)

    def ask(self, do: str, seconds: float = PATIENCE_S, **given: Any) -> Any:
        with self._lock:
            for line in self.lines(do, seconds, given):
                if "found" in line:
                    return line["found"]
                if "refused" in line:
                    where, problem, fix = line["refused"]
                    if "fault" in line:
                        raise RefusedRequest(HTTPStatus.INTERNAL_SERVER_ERROR, Verbatim(problem), Verbatim(fix))
                    raise CmmUqError(problem, where=where or None, fix=fix or None)
        raise CmmUqError("ended without an answer", where=do)

    def lines(self, do: str, seconds: float, given: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
        """All that it says, until it has answered."""
        try:
            stdin = self.begin()
            stdin.write(json.dumps({"do": do, **given}) + "\n")
            stdin.flush()
        except OSError:
            yield {"refused": ["", "the process that reads files has ended", "Try it again"]}
            return
        end = time.monotonic() + seconds
        while True:
            try:
                text = self._lines.get(timeout=max(0.0, end - time.monotonic()))
            except queue.Empty:
                self.end()
                text = json.dumps(
                    {"refused": ["", f"took longer than {seconds:g} s and was ended", "Export less of it"]}
                )
            if text is None:
                self.end()
                yield {"refused": ["", "needed more than the desk gives to a file, and was ended", "Export less of it"]}
                return
            line = json.loads(text)
            yield line
            if not {"found", "refused"}.isdisjoint(line):
                return

    def end(self) -> None:
        """End it, whatever it does and whoever else ends it; what it had staged is removed."""
        process, self._process = self._process, None
        if process is None:
            return
        if process.poll() is None:
            process.terminate()
            try:
                process.wait(3.0)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
        with suppress(OSError):
            cast("IO[str]", process.stdin).close()


def _pumped(out: IO[str], lines: queue.Queue[str | None]) -> None:
    with out:
        for line in out:
            lines.put(line)
    lines.put(None)


class ReportRun:
    """A report under way, in a process of its own; ``part`` of it is done, ``found`` and ``problem`` at its end.

    ``done``: what is done with what it found, before anybody is told.
    """

    def __init__(self, root: Path, job: str, done: Callable[[Mapping[str, Any]], None]) -> None:
        self.job, self.what, self.part, self.since = job, "Starting", 0.0, time.monotonic()
        self.found: dict[str, Any] | None = None
        self.problem: list[str] | None = None  # where, what, and how to mend it
        self.cancelled = self.over = False
        self._worker, self._changed, self._done = Worker(root, 0), threading.Condition(), done
        self._worker.begin()  # or it could be cancelled before it is there
        threading.Thread(target=self._run, daemon=True).start()

    def _run(self) -> None:
        for line in self._worker.lines("report", 24 * 3600.0, {"job": self.job}):
            if "found" in line:
                with suppress(CmmUqError):
                    self._done(line["found"])
            with self._changed:
                if "found" in line:
                    self.found, self.over = line["found"], True
                elif "refused" in line:
                    self.problem, self.over = line["refused"], True
                else:
                    self.what, self.part = line["what"], line["part"]
                self._changed.notify_all()
        self._worker.end()

    def cancel(self) -> None:
        with self._changed:
            self.cancelled = not self.over
        self._worker.end()

    @property
    def left(self) -> str:
        """How long it will go on, as far as that can be said."""
        elapsed = time.monotonic() - self.since
        if self.over or elapsed < 3.0 or not 0.05 < self.part < 1.0:
            return ""
        left = elapsed * (1 - self.part) / self.part
        return f"about {left:.0f} s left" if left < 90 else f"about {left / 60:.0f} min left"

    def state(self) -> dict[str, Any]:
        return {"what": self.what, "percent": round(100 * self.part), "left": self.left, "over": self.over}

    def events(self) -> Iterator[bytes]:
        """Its states as server-sent events, until it is over."""
        end = time.monotonic() + STREAM_S
        while time.monotonic() < end:
            state = self.state()
            yield f"data: {json.dumps(state)}\n\n".encode()
            if state["over"]:
                return
            with self._changed:
                self._changed.wait(BEAT_S)


def shown_file(root: Path, request: WebRequest) -> WebResponse:
    """A file of the folder, in a sandbox; only the desk's own pages may frame it."""
    request.only(("at", "keep"))
    path = below(root, request.text("at"))
    content = content_of(path, TABLE_BYTES, "It lies in the folder of the desk")
    answer = sent_file(path.name, content, keep=bool(request.one_of("keep", ("yes",))))
    policy = answer.policy.replace("frame-ancestors 'none'", "frame-ancestors 'self'")
    return replace(answer, policy=policy, headers={**answer.headers, "X-Frame-Options": "SAMEORIGIN"})
