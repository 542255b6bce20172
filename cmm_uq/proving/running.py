"""Processes that answer numbered tasks, and a file that keeps every answer as soon as it is there.

Each process imports once and computes on one thread, whatever the machine has, so that an answer does not depend on how
many processes there are. Answers are appended a line each and are on the disk before the next is awaited: what a kill
leaves is a prefix of whole lines, and perhaps a torn one, which is dropped.
"""

from __future__ import annotations

import contextlib
import json
import os
import pickle
import queue
import shutil
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, BinaryIO, cast

from cmm_uq.errors import CmmUqError, OutputError
from cmm_uq.proving.sealed import canonical
from cmm_uq.writing.locking import locked

Record = dict[str, Any]
"""What was said of a task: plain data with its ``number``."""

TRUTH, RECORDS, LOCK = "truth.json", "cases.jsonl", "lock"

_ONE_THREAD = (
    "OPENBLAS_NUM_THREADS",
    "OMP_NUM_THREADS",
    "MKL_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
    "NUMEXPR_NUM_THREADS",
)


class Kept:
    """A folder with the sealed truth and the answers so far; this process alone writes to it while it is open.

    Parameters
    ----------
    folder : that may hold a run which was interrupted.
    truth : contents of the sealed file: the run is the same if and only if these are.

    Raises
    ------
    CmmUqError : it holds another run, or another process is at it.
    OutputError : it cannot be written to.
    """

    def __init__(self, folder: Path, truth: bytes) -> None:
        self.folder = folder
        self._descriptor = -1
        with _told(folder):
            folder.mkdir(parents=True, exist_ok=True)
            (folder / LOCK).touch()
            descriptor = locked(folder / LOCK, create=False)
            if descriptor is None:
                raise CmmUqError("another cmm-uq prove is at work here", where=str(folder), fix="Wait until it is done")
            self._descriptor = descriptor
            try:
                self.records = self._begun(truth)
                self._file = (folder / RECORDS).open("ab")
            except BaseException:
                os.close(descriptor)
                raise

    def _begun(self, truth: bytes) -> dict[int, Record]:
        sealed = self.folder / TRUTH
        if sealed.exists() and sealed.read_bytes() != truth:
            raise CmmUqError("holds an unfinished run with another truth: other options, inputs, seed or version",
                             where=str(self.folder),
                             fix="Repeat the command that began it to go on, or remove the folder")  # fmt: skip
        if not sealed.exists():
            part = self.folder / f"{TRUTH}.part"
            with part.open("wb") as file:
                _synced(file, truth)
            (self.folder / RECORDS).unlink(missing_ok=True)
            part.replace(sealed)
        path = self.folder / RECORDS
        content = path.read_bytes() if path.exists() else b""
        records, whole = _whole_lines(content)
        if whole < len(content):
            with path.open("rb+") as file:
                file.truncate(whole)
        return records

    def keep(self, record: Record) -> None:
        """Append an answer."""
        with _told(self.folder):
            _synced(self._file, canonical(record))
        self.records[record["number"]] = record

    def close(self) -> None:
        """Leave it to others; what it holds stays."""
        if self._descriptor >= 0:
            self._file.close()
            os.close(self._descriptor)
            self._descriptor = -1

    def remove(self) -> None:
        """What was kept is in place elsewhere."""
        self.close()
        shutil.rmtree(self.folder, ignore_errors=True)


def _whole_lines(content: bytes) -> tuple[dict[int, Record], int]:
    """Answers in the whole lines, and how many bytes these are."""
    found: dict[int, Record] = {}
    end = 0
    for line in content.splitlines(keepends=True):
        try:
            record: Record = json.loads(line) if line.endswith(b"\n") else {}
            found[int(record["number"])] = record
        except (ValueError, TypeError, KeyError):
            break
        end += len(line)
    return found, end


def answered(
    program: str, setting: Any, tasks: Mapping[int, Any], workers: int, *, keep: Callable[[Record], None]
) -> None:  # fmt: skip
    """Have every task answered.

    Parameters
    ----------
    program : module that a process runs; see :func:`serve`.
    setting : what every process is told first.
    tasks : by number.
    workers : processes at once.
    keep : given every answer as it comes.

    Raises
    ------
    CmmUqError : a process ended before its work was done.
    """
    waiting: queue.SimpleQueue[tuple[int, Any] | None] = queue.SimpleQueue()
    for task in tasks.items():
        waiting.put(task)
    count = max(1, min(workers, len(tasks)))
    for _ in range(count):
        waiting.put(None)
    answers: queue.SimpleQueue[Record | Exception] = queue.SimpleQueue()
    processes = [_process(program) for _ in range(count if tasks else 0)]
    talks = [
        threading.Thread(target=_converse, args=(process, setting, waiting, answers), daemon=True)
        for process in processes
    ]
    try:
        for talk in talks:
            talk.start()
        for _ in tasks:
            answer = answers.get()
            if isinstance(answer, Exception):
                raise _ended(answer) from answer
            keep(answer)
    finally:
        for process in processes:
            process.kill()
        for process, talk in zip(processes, talks, strict=True):
            process.wait()
            talk.join()
            for pipe in (process.stdin, process.stdout):
                with contextlib.suppress(OSError):  # what was not read any more
                    if pipe is not None:
                        pipe.close()


def _ended(answer: Exception) -> CmmUqError:
    if isinstance(answer, CmmUqError):
        return answer
    return CmmUqError("a process that diagnosed cases ended before its work was done", where="cmm-uq prove",
                      fix="Give fewer --workers where memory is short; the same command goes on")  # fmt: skip


def _process(program: str) -> subprocess.Popen[bytes]:
    """With this one's packages, none from the folder where it happens to be called, on one thread."""
    place = os.pathsep.join(path or os.getcwd() for path in sys.path)  # noqa: PTH109
    environment = {**os.environ, **dict.fromkeys(_ONE_THREAD, "1"), "PYTHONPATH": place}
    return subprocess.Popen([sys.executable, "-P", "-m", program], stdin=subprocess.PIPE, stdout=subprocess.PIPE,  # noqa: S603
                            stderr=subprocess.DEVNULL, env=environment)  # fmt: skip


def _converse(
    process: subprocess.Popen[bytes], setting: Any, waiting: queue.SimpleQueue[tuple[int, Any] | None],
    answers: queue.SimpleQueue[Record | Exception],
) -> None:  # fmt: skip
    """Give one process its tasks, one after the other."""
    asked, told = cast("BinaryIO", process.stdin), cast("BinaryIO", process.stdout)
    try:
        _put(asked, setting)
        while (task := waiting.get()) is not None:
            _put(asked, task)
            answers.put(pickle.load(told))  # noqa: S301 - of a process of one's own
    except Exception as error:
        answers.put(error)


def _put(stream: BinaryIO, value: Any) -> None:
    pickle.dump(value, stream)
    stream.flush()


def serve(begin: Callable[[Any], Callable[[int, Any], Record]]) -> None:
    """Be such a process: read the setting, then answer tasks until nobody asks any more.

    Parameters
    ----------
    begin : makes, of the setting, what answers a task by number and content. A :class:`CmmUqError` of it ends the run.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the one who asks decides
    asked, told = sys.stdin.buffer, os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # whatever a library prints is no answer
    with contextlib.suppress(EOFError, BrokenPipeError):
        values = _given(asked)
        setting = next(values)
        try:
            answer = begin(setting)
        except CmmUqError as error:
            _put(told, error)
            return
        for number, task in values:
            _put(told, _answer(answer, number, task))


def _answer(answer: Callable[[int, Any], Record], number: int, task: Any) -> Record | CmmUqError:
    try:
        return answer(number, task)
    except CmmUqError as error:
        return error


def _given(stream: BinaryIO) -> Iterator[Any]:
    while True:
        yield pickle.load(stream)  # noqa: S301 - of the process that began this one


def _synced(file: Any, content: bytes) -> None:
    file.write(content)
    file.flush()
    os.fsync(file.fileno())


@contextlib.contextmanager
def _told(folder: Path) -> Iterator[None]:
    try:
        yield
    except (OSError, ValueError) as error:
        if isinstance(error, CmmUqError):
            raise
        what = getattr(error, "strerror", None) or error
        raise OutputError(f"cannot be written: {what}", where=str(folder),
                          fix="Free the disk, mend the permissions, or choose another --out") from error  # fmt: skip
