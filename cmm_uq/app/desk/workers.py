"""The processes that read and compute for the desk: asked, waited for no longer than it may take, and ended.

What the desk hands on: files of its folder in a sandbox, pages of the records by the worker, its own style and script.
"""

from __future__ import annotations

import base64
import json
import os
import queue
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from http import HTTPStatus
from pathlib import Path
from typing import IO, Any, cast

from cmm_uq.app.desk.place import below
from cmm_uq.app.serve.exchange import LARGEST, RefusedRequest, WebRequest, WebResponse, sent_file, style
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.limits import TABLE_BYTES, content_of
from cmm_uq.base.messages import Verbatim, say
from cmm_uq.certificate.look import template_folder

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
                _refuse(line)
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
            if not {"found", "refused", "fault"}.isdisjoint(line):
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


def _refuse(line: Mapping[str, Any]) -> None:
    if "refused" in line:
        where, problem, fix = line["refused"]
        raise CmmUqError(problem, where=where or None, fix=fix or None)
    if "fault" in line:
        told = say("a fault of the program: {what}", what=Verbatim(line["fault"]))
        raise RefusedRequest(HTTPStatus.INTERNAL_SERVER_ERROR, told, say("Please report it"))


class ReportRun:
    """A report under way, in a process of its own; ``part`` of it is done, ``found`` and ``problem`` at its end.

    ``done``: what is done with what it found, before anybody is told.
    """

    def __init__(self, root: Path, job: str, done: Callable[[Mapping[str, Any]], None]) -> None:
        self.job, self.what, self.part, self.since = job, "Starting", 0.0, time.monotonic()
        self.found: dict[str, Any] | None = None
        self.problem: tuple[str, str, str] | None = None
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
                    where, problem, fix = line["refused"]
                    self.problem, self.over = (where, problem, fix), True
                elif "fault" in line:
                    self.problem, self.over = ("", f"a fault of the program: {line['fault']}", "Please report it"), True
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


OWN_FILES = {
    "/desk.js": "text/javascript; charset=utf-8",
    "/icon.svg": "image/svg+xml",
    "/style.css": "text/css; charset=utf-8",
}


def own_file(path: str) -> WebResponse:
    content = style() if path == "/style.css" else (template_folder() / "serve" / path[1:]).read_bytes()
    return WebResponse(content, OWN_FILES[path])


def shown_file(root: Path, request: WebRequest) -> WebResponse:
    """A file of the folder, in a sandbox; only the desk's own pages may frame it."""
    request.only(("at", "keep"))
    path = below(root, request.text("at"))
    content = content_of(path, TABLE_BYTES, "It lies in the folder of the desk")
    answer = sent_file(path.name, content, keep=bool(request.one_of("keep", ("yes",))))
    policy = answer.policy.replace("frame-ancestors 'none'", "frame-ancestors 'self'")
    return replace(answer, policy=policy, headers={**answer.headers, "X-Frame-Options": "SAMEORIGIN"})


def records_page(worker: Worker, request: WebRequest, *, account: bool) -> WebResponse:
    """A page of the records, made by the worker."""
    headers = {name: value for name, value in request.headers.items() if name == "content-type"}
    given: dict[str, Any] = {
        "method": request.method,
        "path": request.path,
        "query": dict(request.query),
        "headers": headers,
        "account": account,
    }
    if request.body is None:
        return _answered(worker.ask("page", body=None, **given))
    if request.length > LARGEST:
        problem = say("the file is larger than {most} MB", most=LARGEST // 2**20)
        fix = say("No certificate is; check that it is the right file")
        raise RefusedRequest(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, problem, fix)
    with tempfile.TemporaryDirectory(prefix="cmm-uq-") as folder:
        path = Path(folder) / "sent"
        with path.open("wb") as file:
            shutil.copyfileobj(_LimitedBody(request), file)
        return _answered(worker.ask("page", body=str(path), **given))


class _LimitedBody:
    """The body of a request, as long as it says that it is."""

    def __init__(self, request: WebRequest) -> None:
        self._body, self._left = request.body, request.length

    def read(self, size: int = 2**16) -> bytes:
        block = self._body.read(min(size, self._left)) if self._body is not None and self._left else b""
        self._left -= len(block)
        return block


def _answered(found: Mapping[str, Any]) -> WebResponse:
    body, status = base64.b64decode(found["body"]), HTTPStatus(found["status"])
    return WebResponse(body, found["media"], status, found["policy"], found["referrer"], found["headers"])
