"""What the records of all sessions of a job come to: the points that count, and what happened besides."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from cmm_uq.laboratory.live.joining import NS, Joined
from cmm_uq.laboratory.live.journal import Moment, Record

Place = tuple[int, int, int]  # measurement, point, repeat


@dataclass(frozen=True)
class Point:
    """A point that was accepted."""

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
    """One run of the program."""

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
    """All sessions of a job, record by record.

    ``points``: that count, by the number of their record, in the order in which they were accepted; ``identities``:
    what is known of each instrument, by its name; ``gaps``: when instruments were silent: source, s since the start of
    the job, for how long (``None``: to the end), why; ``clocks``: jumps of the wall clock: s since the start of the
    job, by how much, s; ``skipped, asked``: set-ups that the operator left out, and repeats more that were asked for;
    ``notes``: of the operator, and everything else that was said, each with its time.
    """

    sessions: list[Session] = field(default_factory=list)
    points: dict[int, Point] = field(default_factory=dict)
    undone: list[tuple[Point, str]] = field(default_factory=list)  # points that were taken back, each with the reason
    identities: dict[str, Mapping[str, Any]] = field(default_factory=dict)
    gaps: list[tuple[str, float, float | None, str]] = field(default_factory=list)
    clocks: list[tuple[float, float]] = field(default_factory=list)
    skipped: list[tuple[int, int]] = field(default_factory=list)
    asked: list[tuple[int, int]] = field(default_factory=list)
    notes: list[tuple[float, str]] = field(default_factory=list)
    files: dict[str, str] = field(default_factory=dict)  # that were read, by SHA-256, with their names
    damaged: list[str] = field(default_factory=list)  # lines of journals that are not in it
    changes: int = 0  # how many records changed what counts

    @property
    def session(self) -> Session:
        """The one that is running, or was last."""
        return self.sessions[-1]

    @property
    def by_place(self) -> dict[Place, Point]:
        """Points that count, by place."""
        return {point.place: point for point in self.points.values()}

    def take(self, record: Record) -> None:
        """Go on with a record; kinds that say nothing here are passed over."""
        if self.sessions:
            self.session.end_s = max(self.session.end_s, self.session.time_s(record.moment))
        told = getattr(self, f"_{record.kind}", None)
        if told is not None:
            told(record)
            self.changes += 1

    def _session(self, record: Record) -> None:
        offset = 0.0
        if self.sessions:
            first = self.sessions[0].start
            # where the clock was set back between two sessions, time goes on behind what was measured already
            offset = max((record.moment.utc_ns - first.utc_ns) * NS, self.session.end_s)
        self.gaps = [gap if gap[2] is not None else (*gap[:2], self._lasted(gap[1]), gap[3]) for gap in self.gaps]
        self.sessions.append(Session(record.data["session"], record.moment, offset, record.data, offset))
        self.damaged += record.data.get("damaged", [])

    def _lasted(self, since: float) -> float:
        return max(0.0, self.session.end_s - since)

    def _point(self, record: Record) -> None:
        data = record.data
        moment = Moment(*data["moment"])
        measurement, number, repeat = data["place"]
        self.points[record.number] = Point(
            record.number, (measurement, number, repeat), data["columns"], moment, self.session.time_s(moment),
            self.session.number, data["how"], timed=data.get("timed", True),
        )  # fmt: skip

    def _joined(self, record: Record) -> None:
        point = self.points.get(record.data["of"])
        if point is not None:
            values = {name: Joined(*pair) for name, pair in record.data["values"].items()}
            self.points[point.record] = replace(point, joined=values, missing=record.data["missing"], settled=True)

    def _undone(self, record: Record) -> None:
        for number in record.data["of"]:
            if number in self.points:
                self.undone.append((self.points.pop(number), record.data["reason"]))

    def _identity(self, record: Record) -> None:
        self.identities[record.data["name"]] = record.data

    def _gap(self, record: Record) -> None:
        self.gaps.append((record.data["source"], self.session.time_s(record.moment), None, record.data["why"]))

    def _returned(self, record: Record) -> None:
        for i, (source, since, lasted, why) in enumerate(self.gaps):
            if source == record.data["source"] and lasted is None:
                self.gaps[i] = (source, since, record.data["after_s"], why)

    def _clock(self, record: Record) -> None:
        self.clocks.append((self.session.time_s(record.moment), record.data["by_s"]))

    def _skip(self, record: Record) -> None:
        self.skipped.append((record.data["measurement"], record.data["repeat"]))

    def _repeat(self, record: Record) -> None:
        self.asked.append((record.data["measurement"], record.data["repeat"]))

    def _note(self, record: Record) -> None:
        self.notes.append((self.session.time_s(record.moment), record.data["text"]))

    def _file(self, record: Record) -> None:
        self.files[record.data["sha256"]] = record.data["name"]
