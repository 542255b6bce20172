"""How far a run of many jobs is, and what it did; and one run at a job, by a lock that the system releases when it ends.

While a run is at the job its lock file says so, and says nothing afterwards: words in a file that nobody holds were left by
a run that ended in the middle.
"""

from __future__ import annotations

import contextlib
import logging
import logging.handlers
import os
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from cmm_uq.base.errors import CmmUqError, OutputError, printable
from cmm_uq.base.output.staging import locked

_BEGUN = b"begun\n"
_ATTEMPTS = 20  # at a file that others lock and remove at the same time


@dataclass(eq=False)
class Turn:
    """The lock of a file, held."""

    path: Path
    descriptor: int
    resumed: bool  # whether a run ended before it was through with what the lock is of
    through: bool = True  # whether this one is, so that it may be forgotten

    def end(self) -> None:
        if self.through:
            try:
                self.path.unlink()
            except OSError:  # on Windows while it is open; empty it says the same
                with contextlib.suppress(OSError):
                    os.ftruncate(self.descriptor, 0)
        os.close(self.descriptor)


def turn_at(path: Path) -> Turn | None:
    """Take a lock without waiting; ``None`` where another process holds it."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        for _ in range(_ATTEMPTS):
            try:
                descriptor = locked(path, create=True)
            except FileExistsError:
                descriptor = locked(path, create=False)
            if descriptor is not None:
                break
            if path.exists():
                return None
        else:
            return None
        resumed = bool(os.read(descriptor, len(_BEGUN)))
        if not resumed:
            os.write(descriptor, _BEGUN)
    except OSError as error:
        fix = "Free the disk, or mend the permissions"
        raise OutputError(f"cannot be locked: {error.strerror}", where=str(path), fix=fix) from error
    return Turn(path, descriptor, resumed)


@contextlib.contextmanager
def turn(path: Path, *, patience_s: float = 0.0) -> Iterator[Turn | None]:
    """A lock while something is done; ``None`` where another process holds it for longer than ``patience_s`` seconds."""
    deadline = time.monotonic() + patience_s
    taken = turn_at(path)
    while taken is None and time.monotonic() < deadline:
        time.sleep(0.05)
        taken = turn_at(path)
    try:
        yield taken
    finally:
        if taken is not None:
            taken.end()


def was_left(path: Path) -> bool:
    """Whether a run that is no more ended at what a lock is of; one that is at it now looks the same."""
    try:
        return path.stat().st_size > 0
    except OSError:
        return False


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


_PATIENCE_S = 2.0  # how long to wait for another run that writes its line


@dataclass(frozen=True)
class Log:
    path: Path | None  # of the file; ``None`` for no log
    largest: int  # bytes at which a new one is begun
    kept: int

    def write(self, text: str) -> None:
        """One line; a log that cannot be written stops nothing."""
        if self.path is None:
            return
        with (
            contextlib.suppress(OSError, CmmUqError),
            turn(self.path.with_name(f".{self.path.name}.lock"), patience_s=_PATIENCE_S),
        ):
            # opened for each line, so that a file that another run has begun anew is not written on
            handler = logging.handlers.RotatingFileHandler(
                self.path, maxBytes=self.largest, backupCount=self.kept, encoding="utf-8", errors="backslashreplace",
                delay=True,
            )  # fmt: skip
            handler.handleError = _passed_over  # type: ignore[method-assign]
            try:
                handler.emit(logging.makeLogRecord({"msg": printable(text)}))
            finally:
                handler.close()


def _passed_over(record: logging.LogRecord) -> None: ...
