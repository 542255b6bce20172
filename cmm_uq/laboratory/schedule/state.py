"""What earlier runs have done, how far this one is, and one run at a job, by a lock that the system releases when it ends.

The records of the laboratory keep the state, or the folder of the reports where there are none: the manifest of a report says
that it is whole, its results.json what it was made from. While a run is at a job its lock file says so, and says nothing
afterwards: words in a file that nobody holds were left by a run that ended in the middle.
"""

from __future__ import annotations

import contextlib
import datetime as dt
import hashlib
import json
import logging
import logging.handlers
import os
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cmm_uq.base.errors import CmmUqError, OutputError, printable
from cmm_uq.base.files.limits import TABLE_BYTES, content_of
from cmm_uq.base.output import read_manifest, sha256_of
from cmm_uq.base.output.staging import locked, replace_file
from cmm_uq.base.values import dataclass
from cmm_uq.jobs.source import RESULTS
from cmm_uq.jobs.verdicts import NONE
from cmm_uq.laboratory.records.facts import instant

if TYPE_CHECKING:
    from cmm_uq.laboratory.records.facts import RecordedCertificate
    from cmm_uq.laboratory.records.store import Records


PRIVATE = ".scheduled"  # folder beside the reports with locks and messages
COMMAND = "report"


_FIX = "Free the disk, or mend the permissions"
_PATIENCE_S = 2.0  # how long to wait for another run that writes a line, or what it told


@dataclass(frozen=True)
class Dispatch:
    """When the same thing went out, to a receiver or in an exit code: for the first time, and for the last."""

    first: dt.datetime
    last: dt.datetime


@dataclass
class FolderState:
    """What is remembered from run to run, kept with the reports alone; without it everything is new again."""

    out: Path

    def results(self, job: str) -> Mapping[str, Any] | None:
        """What the newest certificate of a job states, as results.json has it; ``None`` where it has none."""
        folder = self.out / job
        manifest = read_manifest(folder)
        if manifest is None or (manifest.owner.command, manifest.owner.job) != (COMMAND, job):
            return None
        there = all(os.path.lexists(folder / name) for name in manifest.files)
        return _results_in(folder) if there and sha256_of(folder / RESULTS) == manifest.files.get(RESULTS) else None

    def released(self, job: str) -> bool:
        """Whether a person has released the newest certificate of a job, so that it must not be replaced."""
        return False

    def is_draft(self, job: str) -> bool:
        """Whether nobody has released or withdrawn the newest certificate of a job yet."""
        return True

    def sent(self, key: str) -> Dispatch | None:
        try:
            data = json.loads(self._marker(key).read_text(encoding="utf-8"))
            last = _moment(data["at"])
            first = _moment(data.get("first")) or last
        except (OSError, ValueError, TypeError, KeyError, AttributeError, RecursionError):
            return None  # damaged: once more does less harm than never
        return None if last is None or first is None else Dispatch(min(first, last), last)

    def add_sent(self, key: str, content: Mapping[str, Any]) -> None:
        replace_file(self._marker(key), json.dumps(content, ensure_ascii=False).encode(), _FIX)

    def claim(self, key: str, content: Mapping[str, Any], again: Callable[[Dispatch | None], bool]) -> bool:
        """Remember that something goes out now, where it goes out again: of runs at the same time one only is to say it."""
        with turn(self.out / PRIVATE / "told.lock", patience_s=_PATIENCE_S):
            before = self.sent(key)
            if again(before):
                self.add_sent(key, {**content, **({"first": before.first.isoformat()} if before else {})})
                return True
        return False

    def _marker(self, key: str) -> Path:
        return self.out / PRIVATE / "sent" / f"{key}.json"


class RecordsState(FolderState):
    """State kept in the records; the folder of the reports says what they need not be asked for."""

    def __init__(self, records: Records, out: Path) -> None:
        super().__init__(out)
        self.records = records
        self._sent: dict[str, Dispatch] = {}
        self._read = 0

    def results(self, job: str) -> Mapping[str, Any] | None:
        if inputs_of(here := super().results(job)) is not None:
            digest = sha256_of(self.out / job / RESULTS)
            if digest is not None and self.records.has_results(digest) is not None:
                return here
        if (newest := self._newest(job)) is None:
            return None
        data = self.records.entry(newest.entry).data  # its files were taken away
        decided = [] if newest.decision == NONE else [{"standard": "its certificate", "decision": newest.decision}]
        machine = (data.get("machine") or {}).get("name")
        of = {"id": job, "machine": machine, "inputs_sha256": data.get("inputs") or None}
        diagnosis = {"verdict": newest.diagnosis}
        return {"job": of, "verdicts": data.get("verdicts"), "conformity": decided, "diagnosis": diagnosis}

    def released(self, job: str) -> bool:
        newest = self._newest(job)
        return newest is not None and newest.state == "released"

    def is_draft(self, job: str) -> bool:
        newest = self._newest(job)
        return newest is None or newest.state == "draft"

    def sent(self, key: str) -> Dispatch | None:
        for entry in self.records.entries(self._read + 1, kind="sent"):
            data = entry.data
            at = _moment(data.get("at")) or _moment(entry.at)
            if at is not None:
                known = self._sent.get(str(data.get("key")))
                self._sent[str(data.get("key"))] = Dispatch(min(known.first, at) if known else at, at)
            self._read = entry.number
        return self._sent.get(key)

    def add_sent(self, key: str, content: Mapping[str, Any]) -> None:
        self.records.append("sent", {**content, "key": key})

    def claim(self, key: str, content: Mapping[str, Any], again: Callable[[Dispatch | None], bool]) -> bool:
        if not again(self.sent(key)):  # as on most days
            return False
        with self.records.writing() as writing:
            if again(self.sent(key)):
                writing.add([("sent", {**content, "key": key}, None)])
                return True
        return False

    def _newest(self, job: str) -> RecordedCertificate | None:
        found = self.records.certificates(job=job, origin=None, values=False)
        return max(found, key=lambda one: one.entry, default=None)


def _results_in(folder: Path) -> Mapping[str, Any] | None:
    try:
        data = json.loads(content_of(folder / RESULTS, TABLE_BYTES, ""))
    except (CmmUqError, ValueError, RecursionError):
        return None
    return data if isinstance(data, dict) else None


def inputs_of(results: Mapping[str, Any] | None) -> dict[str, str] | None:
    """SHA-256 of every file that a report was made from, by name; ``None`` where results do not say."""
    try:
        return {str(name): str(digest) for name, digest in results["job"]["inputs_sha256"].items()}  # type: ignore[index]
    except (TypeError, KeyError, AttributeError):
        return None


class Problems:
    def __init__(self, out: Path) -> None:
        self.folder = out / PRIVATE / "problems"
        try:
            self._known = {path.name for path in self.folder.iterdir()}
        except OSError:
            self._known = set()

    def since(self, about: str, problem: str, now: str) -> str:
        """The moment at which a problem was first met; now, where it is new, or the moment is damaged or of the future."""
        path = self.folder / f"{_short(about)}-{_short(problem)}"
        since = _moment_in(path)
        if since is not None and since <= dt.datetime.fromisoformat(now) + AHEAD:
            return path.read_text(encoding="utf-8")
        with contextlib.suppress(OutputError):  # a full disk: it will be new again
            replace_file(path, now.encode(), _FIX)
            self._known.add(path.name)
        return now

    def mended(self, about: str) -> None:
        """Forget what was wrong with a job or a folder."""
        short = _short(about)
        for name in [name for name in self._known if name.startswith(f"{short}-")] if self._known else ():
            self._known.discard(name)
            with contextlib.suppress(OSError):
                (self.folder / name).unlink()


AHEAD = dt.timedelta(days=1)
"""By how much something may be of the future: clocks of two computers differ, and so do their zones."""


def last_run(out: Path) -> dt.datetime | None:
    """When the last run that came to its end began, by the clock and the zone of then."""
    return _moment_in(out / PRIVATE / "last-run")


def remember_run(out: Path, begun: dt.datetime, now: dt.datetime) -> None:
    """Of runs at the same time the later one counts, unless it is of the future."""
    before = last_run(out)
    if before is None or not begun <= before <= now:
        replace_file(out / PRIVATE / "last-run", begun.isoformat(timespec="seconds").encode(), _FIX)


def _moment_in(path: Path) -> dt.datetime | None:
    with contextlib.suppress(OSError, ValueError):
        return _moment(path.read_text(encoding="utf-8"))
    return None


def _moment(text: Any) -> dt.datetime | None:
    """A moment with its zone that any zone has; ``None`` where a text says none."""
    moment = instant(str(text))
    return moment if moment is not None and 2000 < moment.year < dt.MAXYEAR else None


@contextlib.contextmanager
def running(out: Path) -> Iterator[bool]:
    """While a run is at work: whether one before ended in the middle, so that nobody saw its exit code."""
    folder, cut = out / PRIVATE / "runs", False
    for path in folder.glob("*.lock"):
        with turn(path) as left:
            cut |= left is not None and left.resumed
    with turn(folder / f"{os.getpid()}-{time.monotonic_ns()}.lock"):
        yield cut


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
        raise OutputError(f"cannot be locked: {error.strerror}", where=str(path), fix=_FIX) from error
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
            handler.handleError = lambda record: None  # type: ignore[method-assign]
            try:
                handler.emit(logging.makeLogRecord({"msg": printable(text)}))
            finally:
                handler.close()
