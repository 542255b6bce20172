"""Numbered tasks answered by processes of this machine, as many at once as asked for.

A process imports once and computes on one thread, whatever the machine has, so that an answer depends neither on how many
processes there are nor on whose they are. It is asked through its standard input and answers on its standard output, begun
anew when it dies and stopped when it hangs. Tasks are taken as they are needed and answers given as they come, so that
memory does not grow with their number: whoever does not take answers is not sent more.
"""

from __future__ import annotations

import contextlib
import gc
import os
import pickle
import queue
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Generator, Iterable, Iterator
from itertools import islice
from typing import Any, BinaryIO, cast

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.plugins import told_with_package
from cmm_uq.base.values import dataclass

ONE_THREAD = [f"{name}_NUM_THREADS" for name in ("OPENBLAS", "OMP", "MKL", "NUMEXPR")] + ["VECLIB_MAXIMUM_THREADS"]

BEGINNING_S = 300.0
"""How long a process may take to import and to begin: seconds, minutes where a disk is shared by many."""


@dataclass(frozen=True)
class WorkerTask:
    program: str  # module that a process runs; see :func:`serve`
    setting: Any  # what every process is told first
    seconds: float | None = None  # that one task may take; without one, as long as it takes
    tries: int = 3  # processes that a task may end before it is given up


@dataclass(frozen=True)
class TaskAnswer:
    number: int
    value: Any = None
    failure: CmmUqError | None = None
    ended: tuple[str, ...] = ()  # how each process ended that ended over it, such as "signal 9"


@dataclass(frozen=True)
class Packed:
    """A value that is opened by the process that it is for, and by nobody on its way."""

    content: bytes

    @classmethod
    def of(cls, value: Any) -> Packed:
        return cls(pickle.dumps(value, protocol=pickle.HIGHEST_PROTOCOL))


class _EndedError(Exception):
    """A process ended instead of answering."""


class WorkerProcess:
    """One process at a time, and what is asked of it."""

    def __init__(self, work: WorkerTask) -> None:
        self.work = work
        self._process: subprocess.Popen[bytes] | None = None
        self._lock = threading.Lock()
        self._over = False

    def ask(self, number: int, task: Any) -> TaskAnswer:
        """Have a task answered, by another process where one ends over it."""
        ended: list[str] = []
        while len(ended) < self.work.tries:
            process = self._begun()
            try:
                value = self._said(process, (number, task), self.work.seconds)
                break
            except TimeoutError:
                self._dismiss()
                fix = "Give a longer --time-limit where that is no wonder"
                value = CmmUqError(f"took longer than {self.work.seconds:g} s and was stopped", fix=fix)
                break
            except _EndedError:
                ended.append(self._dismiss())
        else:
            how = ", ".join(dict.fromkeys(ended))
            problem = f"{len(ended)} processes ended before its work was done ({how})"
            value = CmmUqError(problem, fix="Give fewer --workers where memory is short")
        if isinstance(value, CmmUqError):
            return TaskAnswer(number, failure=value, ended=tuple(ended))
        return TaskAnswer(number, value, ended=tuple(ended))

    def end(self) -> None:
        """Stop the process, whatever it does; nothing is asked any more."""
        self._over = True
        self._dismiss(0.0)

    def _begun(self) -> subprocess.Popen[bytes]:
        with self._lock:
            if self._process is not None:
                return self._process
            if self._over:
                raise CmmUqError("was stopped")
            self._process = process = _process(self.work.program)
        try:
            refused = self._said(process, self.work.setting, BEGINNING_S)
        except (TimeoutError, _EndedError):
            problem = f"a process that works could not begin ({self._dismiss()})"
            fix = "Give fewer --workers where memory is short"
            raise CmmUqError(problem, where=self.work.program, fix=fix) from None
        if isinstance(refused, CmmUqError):
            self._dismiss()
            raise refused
        return process

    def _said(self, process: subprocess.Popen[bytes], value: Any, seconds: float | None) -> Any:
        late = threading.Event()

        def stop() -> None:
            late.set()
            process.kill()

        watch = None if seconds is None else threading.Timer(seconds, stop)
        if watch is not None:
            watch.daemon = True
            watch.start()
        try:
            put(cast("BinaryIO", process.stdin), value)
            return pickle.load(cast("BinaryIO", process.stdout))  # noqa: S301 - of a process of one's own
        except Exception as error:
            if late.is_set():
                raise TimeoutError from error
            raise _EndedError from error
        finally:
            if watch is not None:
                watch.cancel()

    def _dismiss(self, patience_s: float = 0.2) -> str:
        """Have no process any more; how it ended, where it ended by itself within this time."""
        with self._lock:
            process, self._process = self._process, None
        if process is None:
            return "stopped"
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(patience_s)
        process.kill()
        code = process.wait()
        for pipe in (process.stdin, process.stdout):
            with contextlib.suppress(OSError, ValueError):  # what was not read any more
                if pipe is not None:
                    pipe.close()
        return f"signal {-code}" if code < 0 else f"exit code {code}"


def _process(program: str) -> subprocess.Popen[bytes]:
    """With this one's packages, none from the folder where it happens to be called, on one thread."""
    place = os.pathsep.join(path or os.getcwd() for path in sys.path)  # noqa: PTH109
    environment = {**os.environ, **dict.fromkeys(ONE_THREAD, "1"), "PYTHONPATH": place}
    return subprocess.Popen([sys.executable, "-P", "-m", program], stdin=subprocess.PIPE, stdout=subprocess.PIPE,  # noqa: S603
                            stderr=subprocess.DEVNULL, env=environment)  # fmt: skip


def put(stream: BinaryIO, value: Any) -> None:
    pickle.dump(value, stream, protocol=pickle.HIGHEST_PROTOCOL)
    stream.flush()


def serve(begin: Callable[[Any], Callable[[int, Any], Any]]) -> None:
    """Be such a process: ``begin`` makes, of the setting, what answers a task; its own error ends the run."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the one who asks decides
    gc.set_threshold(300_000)  # looking every 700 objects for what refers to itself takes a tenth of a report
    asked, told = sys.stdin.buffer, os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # whatever a library prints is no answer
    with contextlib.suppress(BrokenPipeError):
        values = _given(asked)
        try:
            answer = begin(_opened(next(values)))
        except CmmUqError as error:
            put(told, error)
            return
        put(told, None)
        for number, task in values:
            put(told, _answer(answer, number, task))


def _answer(answer: Callable[[int, Any], Any], number: int, task: Any) -> Any:
    try:
        return answer(number, _opened(task))
    except CmmUqError as error:
        return error
    except MemoryError:
        return CmmUqError("the memory does not suffice for this input", fix="Give fewer --workers")
    except Exception as error:
        problem = f"a fault of the program: {type(error).__name__}: {error}"
        return told_with_package(error) or CmmUqError(problem, fix="Please report it with the input")


def _opened(value: Any) -> Any:
    return pickle.loads(value.content) if isinstance(value, Packed) else value  # noqa: S301 - the same


def _given(stream: BinaryIO) -> Iterator[Any]:
    """What is asked; when whoever asks is gone, interrupted or killed, this process ends at once, whatever it is at."""
    asked: queue.SimpleQueue[Any] = queue.SimpleQueue()

    def read() -> None:
        code = 1
        try:
            while True:
                asked.put(pickle.load(stream))  # noqa: S301 - of the process that began this one
        except EOFError:
            code = 0
        finally:
            os._exit(code)

    threading.Thread(target=read, daemon=True).start()
    while True:
        yield asked.get()


MOST_WORKERS = 256
_AHEAD = 2  # tasks for each process that are ready before it asks
_Tasks = queue.SimpleQueue[tuple[int, Any] | None]
_Answers = queue.SimpleQueue[TaskAnswer | BaseException]


def check_workers(workers: int) -> None:
    """Refuse a number of processes that is none."""
    if not 1 <= workers <= MOST_WORKERS:
        raise CmmUqError(f"{workers} workers", where="--workers", fix=f"Give from 1 to {MOST_WORKERS} processes")


def processes() -> int:
    """How many processes this one may use."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # not every system says
        return os.cpu_count() or 1


def answers(work: WorkerTask, tasks: Iterable[tuple[int, Any]], workers: int) -> Generator[TaskAnswer, None, None]:
    """Have every numbered task answered, in the order in which they are done; no process is begun without a task."""
    todo, asked = iter(tasks), 0
    waiting, done = _Tasks(), _Answers()
    talks: list[WorkerProcess] = []
    threads: list[threading.Thread] = []

    try:
        for task in islice(todo, _AHEAD * workers):
            waiting.put(task)
            asked += 1
            if len(talks) < workers:
                talks.append(WorkerProcess(work))
                threads.append(threading.Thread(target=_converse, args=(talks[-1], waiting, done), daemon=True))
                threads[-1].start()
        while asked:
            answer = done.get()
            if isinstance(answer, BaseException):
                raise answer
            asked -= 1
            for task in islice(todo, 1):
                waiting.put(task)
                asked += 1
            yield answer
    finally:
        for _ in threads:
            waiting.put(None)
        for talk in talks:
            talk.end()
        for thread in threads:
            thread.join()


def _converse(talk: WorkerProcess, waiting: _Tasks, done: _Answers) -> None:
    try:
        while (task := waiting.get()) is not None:
            done.put(talk.ask(*task))
    except BaseException as error:
        done.put(error)


class Pace:
    """Counts what is done of a number of jobs, by a clock that never goes back."""

    def __init__(self, count: int, clock: Callable[[], float] = time.monotonic) -> None:
        self.count = count
        self.done = self.failed = 0
        self._clock, self._began, self._computed = clock, clock(), 0

    def add(self, *, computed: bool = True, failed: bool = False) -> None:
        """One more is done; one that was there already says nothing of the pace."""
        self.done += 1
        self.failed += failed
        self._computed += computed

    @property
    def seconds(self) -> float:
        return self._clock() - self._began

    @property
    def part(self) -> float:
        """Of the whole that is done."""
        return self.done / self.count if self.count else 1.0

    def __str__(self) -> str:
        parts = [f"{self.done} of {self.count}", *([f"{self.failed} failed"] if self.failed else [])]
        if self._computed and (seconds := self.seconds) > 0:
            rate = self._computed / seconds
            parts += [pace(rate), *([f"{duration((self.count - self.done) / rate)} left"] if self.part < 1 else [])]
        return ", ".join(parts)


def pace(rate: float) -> str:
    """Jobs in the unit of time in which there are some."""
    for seconds, unit in ((1, "s"), (60, "min")):
        if rate * seconds >= 1:
            return f"{rate * seconds:.1f}/{unit}"
    return f"{rate * 3600:.1f}/h"


def duration(seconds: float) -> str:
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60} s"
    return f"{whole // 3600} h {whole % 3600 // 60} min"
