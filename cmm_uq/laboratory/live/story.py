"""What the records of all sessions of a job come to: the points that count, with readings joined to them by time.

A stream is what one instrument says for one column of the recording. At the moment of a point its value is interpolated
between the two readings about it, each taken where it was measured: its arrival less the stated latency.

The standard uncertainty that this adds has two parts. Between two readings a smooth quantity lies off their straight line by
at most ½·|f″|·(t − t₀)·(t₁ − t) (the remainder of linear interpolation, e.g. Abramowitz & Stegun 25.2.3); f″ is the larger of
the last two second differences of the stream itself, and the bound is taken as a rectangular distribution (GUM 4.3.7). And
the latency is known no better than to be between nothing and twice what is stated: the slope times latency over √3. What the
instrument's own calibration leaves open, and the scatter of a single reading, are not in it.
"""

from __future__ import annotations

import contextlib
import os
import re
from bisect import bisect_left
from collections import deque
from collections.abc import Mapping
from math import hypot, sqrt
from pathlib import Path
from typing import Any

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, Verbatim, say
from cmm_uq.base.output.staging import locked
from cmm_uq.base.values import dataclass, field, replace
from cmm_uq.laboratory.live.instruments.source import Moment
from cmm_uq.laboratory.live.journal import Record, RecordingJournal, opened, refuse_damaged, refused

NS = 1e-9  # s
_BEFORE = 3  # readings before a point that its value is made of, with the one after it


@dataclass(frozen=True)
class Joined:
    """A value of a stream at a moment, with the standard uncertainty of having been interpolated."""

    value: float
    u: float


class Stream:
    """The last readings of one instrument for one column."""

    def __init__(self, column: str, source: str, *, latency_s: float = 0.0, max_gap_s: float = 10.0) -> None:
        self.column, self.source = column, source
        self.latency_s, self.max_gap_s = latency_s, max_gap_s
        self._latency_ns = round(latency_s / NS)
        self._keep_ns = round(3 * max_gap_s / NS)
        self._times: deque[int] = deque()
        self._values: deque[float] = deque()

    def __len__(self) -> int:
        return len(self._times)

    @property
    def latest(self) -> float | None:
        """Its last value; ``None`` before the first."""
        return self._values[-1] if self._values else None

    def age_s(self, now_ns: int) -> float | None:
        """Time since its last reading; ``None`` before the first."""
        return (now_ns - self._times[-1]) * NS if self._times else None

    def add(self, monotonic_ns: int, value: float) -> None:
        """A reading that arrived at a moment; none that is older than the last is taken."""
        time = monotonic_ns - self._latency_ns
        if self._times and time <= self._times[-1]:
            return
        self._times.append(time)
        self._values.append(value)

    def forget(self, before_ns: int) -> None:
        """Let go of what no point from this moment on can need."""
        while len(self._times) > _BEFORE + 1 and self._times[_BEFORE] < before_ns - self._keep_ns:
            self._times.popleft()
            self._values.popleft()

    def at(self, moment_ns: int, now_ns: int | None) -> Joined | Text | None:
        """Value at a moment, or why there is none; ``None`` while a reading may come (never where ``now_ns`` is ``None``)."""
        after, source = bisect_left(self._times, moment_ns), Verbatim(self.source)
        if after == len(self._times):
            if now_ns is None:
                return say("the session ended before {source} gave another reading", source=source)
            if (now_ns - moment_ns) * NS - self.latency_s <= self.max_gap_s:
                return None
            if after == 0:
                return say("{source} gave nothing", source=source)
            return say("{source} gave nothing for {gap:g} s after the point", source=source, gap=self.max_gap_s)
        if self._times[after] == moment_ns:
            return Joined(self._values[after], self._u(after, moment_ns))
        if after == 0:
            return say("{source} gave nothing before the point", source=source)
        gap = (self._times[after] - self._times[after - 1]) * NS
        if gap > self.max_gap_s:
            return say(
                "{source} gave nothing for {gap:.3g} s about the point, and {most:g} s are the most that is interpolated over",
                source=source, gap=gap, most=self.max_gap_s,
            )  # fmt: skip
        part = (moment_ns - self._times[after - 1]) / (self._times[after] - self._times[after - 1])
        before = self._values[after - 1]
        return Joined(before + part * (self._values[after] - before), self._u(after, moment_ns))

    def _u(self, after: int, moment_ns: int) -> float:
        times = [(self._times[i] - moment_ns) * NS for i in range(max(0, after - _BEFORE), after + 1)]
        values = [self._values[i] for i in range(max(0, after - _BEFORE), after + 1)]
        if len(times) < 2:
            return 0.0
        slope = (values[-1] - values[-2]) / (times[-1] - times[-2])
        if times[-1] == 0:
            off = 0.0
        elif len(times) == 2:
            off = abs(values[1] - values[0]) / sqrt(12)  # anywhere between the two (GUM 4.3.7)
        else:
            bends = [_bend(times[i : i + 3], values[i : i + 3]) for i in range(len(times) - 2)]
            off = 0.5 * max(bends) * -times[-2] * times[-1] / sqrt(3)
        return hypot(off, slope * self.latency_s / sqrt(3))


def _bend(times: list[float], values: list[float]) -> float:
    """Size of the second derivative of the parabola through three readings."""
    first = (values[1] - values[0]) / (times[1] - times[0])
    second = (values[2] - values[1]) / (times[2] - times[1])
    return abs(2 * (second - first) / (times[2] - times[0]))


Place = tuple[int, int, int]  # measurement, point, repeat


@dataclass(frozen=True)
class Point:
    record: int
    place: Place
    columns: Mapping[str, float]  # what was measured of it, by column
    moment: Moment
    time_s: float  # since the start of the job
    session: int  # number of the session that accepted it
    how: str  # it came: by an instrument's name, ``typed`` or a file's name
    joined: Mapping[str, Joined] = field(default_factory=dict)  # what streams had at that moment, by column
    missing: Mapping[str, str] = field(default_factory=dict)  # why others had nothing, by column
    settled: bool = False  # whether every stream has answered
    timed: bool = True  # whether the moment is its own; points of a file have that of the file


@dataclass
class Session:
    number: int
    start: Moment  # by both clocks
    offset_s: float  # time since the start of the job at its start
    said: Mapping[str, Any]  # what it was begun with
    end_s: float = 0.0

    def time_s(self, moment: Moment) -> float:
        """Time since the start of the job, by the clock that nobody sets."""
        return self.offset_s + (moment.monotonic_ns - self.start.monotonic_ns) * NS


@dataclass
class Story:
    """All sessions of a job, record by record; times are in s since its start."""

    sessions: list[Session] = field(default_factory=list)
    points: dict[int, Point] = field(default_factory=dict)  # that count, by their records, as they were accepted
    undone: list[tuple[Point, str]] = field(default_factory=list)  # points that were taken back, each with the reason
    identities: dict[str, Mapping[str, Any]] = field(default_factory=dict)
    gaps: list[tuple[str, float, float | None, str]] = field(default_factory=list)  # instrument, since, how long, why
    clocks: list[tuple[float, float]] = field(default_factory=list)  # jumps of the wall clock: when, by how much, s
    skipped: list[tuple[int, int]] = field(default_factory=list)  # set-ups that the operator left out
    asked: list[tuple[int, int]] = field(default_factory=list)  # repeats more that were asked for
    notes: list[tuple[float, str]] = field(default_factory=list)
    unasked: dict[tuple[str, int], int] = field(default_factory=dict)  # answers, by instrument and session
    files: dict[str, str] = field(default_factory=dict)  # that were read, by SHA-256, with their names
    damaged: list[str] = field(default_factory=list)  # lines of journals that are not in it
    changes: int = 0  # how many records changed what counts

    @property
    def session(self) -> Session:
        return self.sessions[-1]

    @property
    def by_place(self) -> dict[Place, Point]:
        """Points that count, by place."""
        return {point.place: point for point in self.points.values()}

    def take(self, record: Record) -> None:
        """Go on with a record; kinds that say nothing here are passed over."""
        data, time_s = record.data, 0.0
        if self.sessions:
            time_s = self.session.time_s(record.moment)
            self.session.end_s = max(self.session.end_s, time_s)
        match record.kind:
            case "session" | "point" | "joined" | "undone" | "returned":
                getattr(self, f"_{record.kind}")(record, data)
            case "identity":
                self.identities[data["name"]] = data
            case "gap":
                self.gaps.append((data["source"], time_s, None, data["why"]))
            case "clock":
                self.clocks.append((time_s, data["by_s"]))
            case "skip" | "repeat":
                runs = self.skipped if record.kind == "skip" else self.asked
                runs.append((data["measurement"], data["repeat"]))
            case "unasked":
                self.unasked[data["source"], self.session.number] = data["count"]
            case "note":
                self.notes.append((time_s, data["text"]))
            case "file":
                self.files[data["sha256"]] = data["name"]
            case _:
                return
        self.changes += 1

    def _session(self, record: Record, data: Mapping[str, Any]) -> None:
        offset = 0.0
        if self.sessions:
            first, end_s = self.sessions[0].start, self.session.end_s
            # where the clock was set back between two sessions, time goes on behind what was measured already
            offset = max((record.moment.utc_ns - first.utc_ns) * NS, end_s)
            self.gaps = [(source, since, max(0.0, end_s - since) if lasted is None else lasted, why)
                         for source, since, lasted, why in self.gaps]  # fmt: skip
        self.sessions.append(Session(data["session"], record.moment, offset, data, offset))
        self.damaged += data.get("damaged", [])

    def _point(self, record: Record, data: Mapping[str, Any]) -> None:
        moment, (measurement, number, repeat) = Moment(*data["moment"]), data["place"]
        self.points[record.number] = Point(
            record.number, (measurement, number, repeat), data["columns"], moment, self.session.time_s(moment),
            self.session.number, data["how"], timed=data.get("timed", True),
        )  # fmt: skip

    def _joined(self, record: Record, data: Mapping[str, Any]) -> None:
        if (point := self.points.get(data["of"])) is not None:
            values = {name: Joined(*pair) for name, pair in data["values"].items()}
            self.points[point.record] = replace(point, joined=values, missing=data["missing"], settled=True)

    def _undone(self, record: Record, data: Mapping[str, Any]) -> None:
        gone = [self.points.pop(number) for number in data["of"] if number in self.points]
        self.undone += [(point, data["reason"]) for point in gone]

    def _returned(self, record: Record, data: Mapping[str, Any]) -> None:
        self.gaps = [(source, since, data["after_s"] if source == data["source"] and lasted is None else lasted, why)
                     for source, since, lasted, why in self.gaps]  # fmt: skip


FOLDER = "acquisition"  # inside the job's
LOCK = "lock"
EVENTS, STREAMS = "{:04d}-events.jsonl", "{:04d}-streams.jsonl"  # names of the two journals of a session, by its number
_EVENTS = re.compile(r"(\d{4})-events\.jsonl")


@dataclass
class Journals:
    folder: Path
    events: RecordingJournal  # of what happened: points, gaps, notes
    streams: RecordingJournal  # of the readings that come by themselves
    story: Story
    _lock: int

    def say(self, kind: str, data: Mapping[str, Any], moment: Moment) -> Record:
        """A record of what happened, kept by the next :meth:`commit`."""
        record = self.events.append(kind, data, moment)
        self.story.take(record)
        return record

    def commit(self) -> None:
        self.events.commit()
        self.streams.commit()

    def close(self) -> None:
        self.events.close()
        self.streams.close()
        with contextlib.suppress(OSError):
            os.close(self._lock)


def sessions_in(folder: Path) -> list[Path]:
    try:
        names = sorted(path.name for path in folder.iterdir() if _EVENTS.fullmatch(path.name))
    except OSError:
        return []
    return [folder / name for name in names]


def begin(folder: Path, said: Mapping[str, Any], moment: Moment, *, skip_damaged: bool = False) -> Journals:
    """Begin a session: take the lock, read what earlier ones left, cut what was never finished, and open new journals."""
    with contextlib.ExitStack() as failed:
        lock = _taken(folder)
        failed.callback(os.close, lock)
        story, following, torn, damaged = _read(folder, skip_damaged)
        known = {line for session in story.sessions for line in session.said.get("damaged", [])}
        number = 1 + max((int(path.name[:4]) for path in sessions_in(folder)), default=0)
        streams = folder / STREAMS.format(number - 1)
        torn += [(streams, tail)] if (tail := _torn_end(streams)) else []
        events = RecordingJournal(folder / EVENTS.format(number), first=following)
        journals = Journals(folder, events, RecordingJournal(folder / STREAMS.format(number)), story, lock)
        fresh = [line for line in damaged if line not in known]
        journals.say("session", {"session": number, **said, **({"damaged": fresh} if fresh else {})}, moment)
        for path, tail in torn:
            journals.say("cut", {"file": path.name, "bytes": len(tail), "text": tail.decode("latin-1")}, moment)
        journals.commit()  # before anything is cut, it is kept here
        for path, tail in torn:
            try:
                with path.open("rb+") as file:
                    file.truncate(path.stat().st_size - len(tail))
                    file.flush()
                    os.fsync(file.fileno())
            except OSError as error:
                raise refused("cannot be written", error, path, "Mend its permissions") from None
        failed.pop_all()
    return journals


def read_story(folder: Path, *, skip_damaged: bool = False) -> Story:
    """What all sessions in a folder come to; nothing is changed."""
    return _read(folder, skip_damaged)[0]


def _read(folder: Path, skip_damaged: bool) -> tuple[Story, int, list[tuple[Path, bytes]], list[str]]:
    """The story, the number of the next record, what was torn off which file, and damaged lines."""
    story, following, torn, damaged = Story(), 1, list[tuple[Path, bytes]](), list[str]()
    for path in sessions_in(folder):
        content = opened(path, first=following)
        if not skip_damaged:
            refuse_damaged(path, content)
        damaged += [f"{path.name} line {number}" for number in content.damaged]
        if content.records and content.records[0].kind != "session":  # whose times and plan all others go by
            fix = "Put a copy of the file in its place, or move the file away and measure its points again"
            raise CmmUqError("the line that begins the session is damaged", where=f"{path} line 1", fix=fix)
        for record in content.records:
            story.take(record)
        following = max(following, *(record.number + 1 for record in content.records), 1)
        torn += [(path, content.torn)] if content.torn else []
    return story, following, torn, damaged


def _torn_end(path: Path) -> bytes:
    """What stands behind the last line feed of a file that may be large."""
    try:
        with path.open("rb") as file:
            size = file.seek(0, os.SEEK_END)
            step = 65536
            while True:
                start = max(0, size - step)
                file.seek(start)
                text = file.read(size - start)
                if b"\n" in text or start == 0:
                    return text[text.rfind(b"\n") + 1 :]
                step *= 2
    except OSError:
        return b""


def _taken(folder: Path) -> int:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with (folder / LOCK).open("ab"):
            pass
        lock = locked(folder / LOCK, create=False)
    except OSError as error:
        raise refused("cannot be written", error, folder, "Mend its permissions") from None
    if lock is None:
        fix = "End it there; a program that was killed holds no lock"
        raise CmmUqError("this job is being recorded by another program", where=str(folder), fix=fix)
    return lock
