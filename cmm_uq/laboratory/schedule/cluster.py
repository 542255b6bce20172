"""Numbered tasks answered by a Dask cluster, a hundred to a task of the cluster, since each costs its scheduler time.

The workers need no disk in common: tasks and answers travel as bytes. A worker's thread asks a process of its own, as
``pool`` does here, so that answers, time limits and what becomes of a killed process are the same.
"""

from __future__ import annotations

import contextlib
import logging
import threading
import time
from collections.abc import Generator, Iterable, Iterator
from concurrent.futures import CancelledError
from dataclasses import replace
from importlib import import_module
from itertools import islice
from typing import Any

from cmm_uq import __version__
from cmm_uq.base.errors import CmmUqError
from cmm_uq.laboratory.schedule.processes import Packed, TaskAnswer, WorkerProcess, WorkerTask

MOST_TASKS, MOST_BYTES = 100, 8 * 2**20  # in one task of the cluster, unless a single one is larger

CONNECT_S, PATIENCE_S, LOOK_S = 10.0, 60.0, 5.0
"""How long to wait for a scheduler, for a worker where there is none any more, and between two looks."""

IDLE_S = 60.0  # how long a worker keeps a process that nobody asks
_AHEAD = 2  # tasks of the cluster for each thread of its workers
Chunk = tuple[tuple[int, Packed], ...]
_GO_ON = "Mend the cluster; the same command with --resume goes on"


def cluster_answers(
    address: str, work: WorkerTask, tasks: Iterable[tuple[int, Any]], count: int
) -> Generator[TaskAnswer, None, None]:
    """Have every task answered, in the order in which they are done."""
    client = _client(address)
    try:
        threads = _threads(client, address)
        packed = replace(work, setting=Packed.of(work.setting))
        yield from _Run(client, address, packed).through(_chunks(tasks, count, threads), _AHEAD * threads)
    finally:
        with contextlib.suppress(Exception):  # it may be gone
            client.run(end_idle)
        with contextlib.suppress(Exception):
            client.close(timeout=LOOK_S)


def _chunks(tasks: Iterable[tuple[int, Any]], count: int, threads: int) -> Iterator[Chunk]:
    """Tasks in portions: large ones at first, smaller ones towards the end (Polychronopoulos and Kuck 1987, guided)."""
    chunk, size = list[tuple[int, Packed]](), 0
    for number, task in tasks:
        chunk.append((number, packed := Packed.of(task)))
        size += len(packed.content)
        if len(chunk) >= min(MOST_TASKS, max(1, count // (_AHEAD * threads))) or size >= MOST_BYTES:
            yield tuple(chunk)
            count -= len(chunk)
            chunk, size = [], 0
    if chunk:
        yield tuple(chunk)


class _Run:
    def __init__(self, client: Any, address: str, work: WorkerTask) -> None:
        self._client, self._address, self._work = client, address, work
        self._wait = import_module("distributed").wait
        self._asked: dict[Any, Chunk] = {}
        self._alone = time.monotonic()

    def through(self, chunks: Iterator[Chunk], most: int) -> Iterator[TaskAnswer]:
        """Have all of them answered, ``most`` under way at a time."""
        while True:
            for chunk in islice(chunks, max(0, most - len(self._asked))):
                self._ask(chunk)
            if not self._asked:
                return
            for future in self._done():
                yield from self._answered(future, self._asked.pop(future))

    def _ask(self, chunk: Chunk) -> None:
        # of a name of its own, so that equal tasks of another run are never taken for it
        future = self._client.submit(chunk_answered, __version__, self._work, chunk, pure=False)
        self._asked[future] = chunk

    def _done(self) -> list[Any]:
        """Those that are answered, as soon as there are some."""
        while self._asked:
            with contextlib.suppress(TimeoutError, CancelledError):
                self._wait(list(self._asked), timeout=LOOK_S, return_when="FIRST_COMPLETED")
            done = [future for future in self._asked if future.status != "pending"]
            if done:
                self._alone = time.monotonic()
                return done
            with contextlib.suppress(Exception):
                if self._client.status == "running" and self._client.nthreads():  # somebody is there to answer
                    self._alone = time.monotonic()
            if time.monotonic() - self._alone > PATIENCE_S:
                raise CmmUqError("has no workers any more", where=self._address, fix=_GO_ON)
        return []

    def _answered(self, future: Any, chunk: Chunk) -> Iterator[TaskAnswer]:
        try:
            answers: list[TaskAnswer] = future.result()
        except CmmUqError:
            raise
        except Exception as error:
            if isinstance(error, CancelledError) or future.status in ("cancelled", "lost"):
                raise CmmUqError("the scheduler is gone", where=self._address, fix=_GO_ON) from error
            if len(chunk) > 1:  # one of them may have ended the workers: alone it harms no other
                for task in chunk:
                    self._ask((task,))
                return
            why = str(error).split("\n", 1)[0]
            failure = CmmUqError(f"the cluster gave it up: {type(error).__name__}: {why}")
            answers = [TaskAnswer(chunk[0][0], failure=failure, ended=("worker",))]
        yield from answers
        future.release()


def _client(address: str) -> Any:
    try:
        distributed = import_module("distributed")
    except ModuleNotFoundError:
        fix = "Install it: pip install 'cmm-uq[fleet]'"
        raise CmmUqError("a cluster needs Dask", where="--scheduler", fix=fix) from None
    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # what matters is said in one line
    try:
        return distributed.Client(address, timeout=CONNECT_S)
    except (OSError, ValueError, TypeError) as error:
        fix = "Start one (dask scheduler), or mend the address: tcp://HOST:8786"
        raise CmmUqError("no Dask scheduler answers", where=f"--scheduler {address}", fix=fix) from error


def _threads(client: Any, address: str) -> int:
    """Of all workers, each of which has this version of the package."""
    # a function without a name travels whole: a worker that lacks the package can run it, too
    found = client.run(lambda: __import__("cmm_uq").__version__, on_error="return")
    if not found:
        fix = f"Start some: dask worker {address} --nthreads 1"
        raise CmmUqError("has no workers", where=f"--scheduler {address}", fix=fix) from None
    for worker, version in found.items():
        if version != __version__:
            has = f"has cmm-uq {version}" if isinstance(version, str) else f"has no cmm-uq ({version})"
            fix = "Install the same version everywhere: figures must not depend on it"
            raise CmmUqError(f"{has}, and this is {__version__}", where=f"worker {worker}", fix=fix)
    return max(1, sum(map(int, client.nthreads().values())))


_idle: dict[WorkerTask, list[WorkerProcess]] = {}
_lock = threading.Lock()


def chunk_answered(version: str, work: WorkerTask, chunk: Chunk) -> list[TaskAnswer]:
    """Answers of a portion, by a process of this worker that stays for the next one."""
    if version != __version__:
        raise CmmUqError(f"a worker that came later has cmm-uq {__version__}, and this is {version}", where="--scheduler",
                         fix="Install the same version everywhere; the same command with --resume goes on")  # fmt: skip
    with _lock:
        waiting = _idle.get(work)
        talk = waiting.pop() if waiting else WorkerProcess(work)
    answers = [talk.ask(number, task) for number, task in chunk]
    with _lock:
        _idle.setdefault(work, []).append(talk)
    late = threading.Timer(IDLE_S, _end_one, (work, talk))
    late.daemon = True
    late.start()
    return answers


def _end_one(work: WorkerTask, talk: WorkerProcess) -> None:
    with _lock:
        waiting = _idle.get(work, [])
        if talk not in waiting:
            return
        waiting.remove(talk)
    talk.end()


def end_idle() -> None:
    """Have none of these processes any more."""
    with _lock:
        talks = [talk for waiting in _idle.values() for talk in waiting]
        _idle.clear()
    for talk in talks:
        talk.end()
