"""What earlier runs have done, how far this one is, and one run at a job, by a lock that the system releases when it ends.

The records of the laboratory keep the state, or the folder of the reports where there are none: the manifest of a report says
that it is whole, its results.json what it was made from. While a run is at a job its lock file says so, and says nothing
afterwards: words in a file that nobody holds were left by a run that ended in the middle.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import logging
import logging.handlers
import os
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from cmm_uq.base.errors import CmmUqError, OutputError, printable
from cmm_uq.base.files.content import content_of
from cmm_uq.base.files.limits import TABLE_BYTES
from cmm_uq.base.output import read_manifest, sha256_of
from cmm_uq.base.output.new_file import write_new
from cmm_uq.base.output.staging import locked
from cmm_uq.jobs.source import RESULTS

if TYPE_CHECKING:
    from cmm_uq.laboratory.records.facts import RecordedCertificate
    from cmm_uq.laboratory.records.store import Records


PRIVATE = ".scheduled"  # folder beside the reports with locks and messages
COMMAND = "report"


class State(Protocol):
    """What is remembered from run to run."""

    def reported(self, job: str) -> Mapping[str, str] | None:
        """SHA-256 by name of every file that a job's newest certificate was made from; ``None`` where it has none."""

    def released(self, job: str) -> bool:
        """Whether a person has released the newest certificate of a job, so that it must not be replaced."""

    def sent(self, key: str) -> bool: ...
    def add_sent(self, key: str, content: Mapping[str, Any]) -> None: ...


@dataclass(frozen=True)
class FolderState:
    """State kept with the reports alone."""

    out: Path

    def reported(self, job: str) -> Mapping[str, str] | None:
        folder = self.out / job
        manifest = read_manifest(folder)
        if manifest is None or (manifest.owner.command, manifest.owner.job) != (COMMAND, job):
            return None
        there = all(os.path.lexists(folder / name) for name in manifest.files)
        return inputs_in(folder) if there and sha256_of(folder / RESULTS) == manifest.files.get(RESULTS) else None

    def released(self, job: str) -> bool:
        return False

    def sent(self, key: str) -> bool:
        return self._marker(key).exists()

    def add_sent(self, key: str, content: Mapping[str, Any]) -> None:
        marker = self._marker(key)
        try:
            marker.parent.mkdir(parents=True, exist_ok=True)
            marker.write_text(json.dumps(content, ensure_ascii=False), encoding="utf-8")
        except OSError as error:
            fix = "Free the disk, or mend the permissions"
            raise OutputError(f"cannot be written: {error.strerror}", where=str(marker), fix=fix) from error

    def _marker(self, key: str) -> Path:
        return self.out / PRIVATE / "sent" / f"{key}.json"


class RecordsState:
    """State kept in the records; the folder of the reports says what they need not be asked for."""

    def __init__(self, records: Records, out: Path) -> None:
        self.records, self.folder = records, FolderState(out)
        self._sent: set[str] = set()
        self._read = 0

    def reported(self, job: str) -> Mapping[str, str] | None:
        if (here := self.folder.reported(job)) is not None:
            digest = sha256_of(self.folder.out / job / RESULTS)
            if digest is not None and self.records.has_results(digest) is not None:
                return here
        newest = self._newest(job)
        inputs = None if newest is None else next(self.records.entries(newest.entry)).data.get("inputs")
        return {str(name): str(digest) for name, digest in inputs.items()} if inputs else None

    def released(self, job: str) -> bool:
        newest = self._newest(job)
        return newest is not None and newest.state == "released"

    def sent(self, key: str) -> bool:
        for entry in self.records.entries(self._read + 1, kind="sent"):
            self._sent.add(str(entry.data.get("key")))
            self._read = entry.number
        return key in self._sent

    def add_sent(self, key: str, content: Mapping[str, Any]) -> None:
        self.records.append("sent", {**content, "key": key})

    def _newest(self, job: str) -> RecordedCertificate | None:
        found = self.records.certificates(job=job, origin=None, values=False)
        return max(found, key=lambda one: one.entry, default=None)


def inputs_in(folder: Path) -> dict[str, str] | None:
    """SHA-256 of every file that a report was made from, by name, as its results.json says; ``None`` where it does not."""
    try:
        data = json.loads(content_of(folder / RESULTS, TABLE_BYTES, ""))
        return {str(name): str(digest) for name, digest in data["job"]["inputs_sha256"].items()}
    except (CmmUqError, ValueError, TypeError, KeyError, AttributeError, RecursionError):
        return None


class Problems:
    def __init__(self, out: Path) -> None:
        self.folder = out / PRIVATE / "problems"
        try:
            self._known = {path.name for path in self.folder.iterdir()}
        except OSError:
            self._known = set()

    def since(self, about: str, problem: str, now: str) -> str:
        """The moment at which a problem was first met; now, where it is new."""
        path = self.folder / f"{_short(about)}-{_short(problem)}"
        with contextlib.suppress(OSError, OutputError):  # a full disk: it will be new again
            self.folder.mkdir(parents=True, exist_ok=True)
            write_new(path, now.encode())
            self._known.add(path.name)
        try:
            return path.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError):
            return now

    def mended(self, about: str) -> None:
        """Forget what was wrong with a job or a folder."""
        short = _short(about)
        for name in [name for name in self._known if name.startswith(f"{short}-")] if self._known else ():
            self._known.discard(name)
            with contextlib.suppress(OSError):
                (self.folder / name).unlink()


def _short(text: str) -> str:
    return hashlib.sha256(text.encode("utf-8", "surrogateescape")).hexdigest()[:16]


_BEGUN = b"begun\n"
_ATTEMPTS = 20  # at a file that others lock and remove at the same time


@dataclass(eq=False)
class Turn:
    """The lock of a file, held."""

    path: Path
    descriptor: int
    resumed: bool  # whether a run ended before it was through with what the lock is of
    through: bool = True  # whether this one is, so that it may be forgotten


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
            if taken.through:
                try:
                    path.unlink()
                except OSError:  # on Windows while it is open; empty it says the same
                    with contextlib.suppress(OSError):
                        os.ftruncate(taken.descriptor, 0)
            os.close(taken.descriptor)


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
