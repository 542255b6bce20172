"""What the records of all sessions of a job come to: the points that count, and what happened besides."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from cmm_uq.laboratory.live.instruments.source import Moment
from cmm_uq.laboratory.live.joining import NS, Joined
from cmm_uq.laboratory.live.journal import Record

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
