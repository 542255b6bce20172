"""Takes what instruments say, keeps it, and joins it to the points: nothing is shown as accepted that is not on the disk.

It knows no thread and no screen. Whoever runs it passes events on as they come, and calls :meth:`Recorder.tick` at least
every 100 ms, which puts everything on the disk.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, Verbatim, say
from cmm_uq.base.points import AXES
from cmm_uq.jobs.tables.plan import DeclaredSource
from cmm_uq.laboratory.live.folder import STREAMS, Journals
from cmm_uq.laboratory.live.instruments.source import Clock, Event, Gap, Identity, Reading, Returned
from cmm_uq.laboratory.live.joining import NS, Joined, Stream
from cmm_uq.laboratory.live.journal import Moment, NoRoomError, RecordingJournal, lines_in
from cmm_uq.laboratory.live.story import Place, Point, Story

READINGS = "readings"  # kind of such a record


class Blocks:
    """Readings that came since the last commit, by instrument."""

    def __init__(self) -> None:
        self._open: dict[str, list[Reading]] = {}

    def add(self, reading: Reading) -> None:
        self._open.setdefault(reading.source, []).append(reading)

    def put(self, journal: RecordingJournal, moment: Moment) -> None:
        """Move everything into a journal, a record for each instrument."""
        for source, readings in self._open.items():
            for run in _runs(readings):
                journal.append(READINGS, _as_data(source, run), moment)
        self._open.clear()


def _runs(readings: list[Reading]) -> Iterator[list[Reading]]:
    """Readings whose numbers follow each other."""
    start = 0
    for i in range(1, len(readings) + 1):
        if i == len(readings) or readings[i].number != readings[i - 1].number + 1:
            yield readings[start:i]
            start = i


def _as_data(source: str, readings: list[Reading]) -> dict[str, Any]:
    told = {str(i): str.__str__(reading.status) for i, reading in enumerate(readings) if reading.status is not None}
    probed = {str(i): reading.point for i, reading in enumerate(readings) if reading.point is not None}
    names = list(readings[0].values)
    alike = all(list(reading.values) == names for reading in readings)
    return {
        "source": source,
        "first": readings[0].number,
        "utc_ns": [reading.utc_ns for reading in readings],
        "monotonic_ns": [reading.monotonic_ns for reading in readings],
        "raw": [reading.raw.decode("latin-1") for reading in readings],
        **({"names": names, "values": [list(reading.values.values()) for reading in readings]} if alike
           else {"values": [dict(reading.values) for reading in readings]}),
        **({"status": told} if told else {}),
        **({"point": probed} if probed else {}),
    }  # fmt: skip


def readings_of(data: Mapping[str, Any]) -> Iterable[Reading]:
    """The readings of a record, as they came."""
    names, told, probed = data.get("names"), data.get("status", {}), data.get("point", {})
    rows = zip(data["utc_ns"], data["monotonic_ns"], data["raw"], data["values"], strict=True)
    for i, (utc_ns, monotonic_ns, raw, values) in enumerate(rows):
        given = values if names is None else dict(zip(names, values, strict=True))
        status = Verbatim(told[str(i)]) if str(i) in told else None
        yield Reading(
            data["source"],
            data["first"] + i,
            utc_ns,
            monotonic_ns,
            raw.encode("latin-1"),
            given,
            status,
            probed.get(str(i)),
        )


COORDINATES = tuple(f"{axis}_mm" for axis in AXES)
_JUMP_S = 0.5
"""By which the wall clock leaves the monotonic one before it is said; a clock that is kept right is moved by far less."""


class Recorder:
    """One session of a recording."""

    def __init__(
        self, journals: Journals, sources: Sequence[DeclaredSource], *, max_gap_s: float, clock: Clock
    ) -> None:
        self._journals, self._clock, self._max_gap_s = journals, clock, max_gap_s
        self._declared = {source.name: source for source in sources}
        self._blocks, self._identities = Blocks(), dict[str, Identity]()
        self._open: list[int] = []
        start = journals.story.session.start
        self._between = start.utc_ns - start.monotonic_ns
        self.streams: dict[str, Stream] = {}
        self._fed: dict[str, list[tuple[str, Stream]]] = {}
        self.stalled: Text | None = None
        self.counts: dict[str, int] = {}
        self.ill: dict[str, Text] = {}
        self.told: list[Text] = []
        for source in sources:
            for quantity in source.values:
                self._stream(source.name, quantity)

    @property
    def story(self) -> Story:
        return self._journals.story

    @property
    def now(self) -> Moment:
        return Moment(self._clock.utc_ns(), self._clock.monotonic_ns())

    def identified(self, identity: Identity) -> None:
        """Which instrument a source is; written down whenever it says something new."""
        if self._identities.get(identity.name) == identity:
            return
        self._identities[identity.name] = identity
        declared = self._declared.get(identity.name)
        more = {} if declared is None else {"columns": dict(declared.values), "latency_ms": declared.latency_ms}
        self._journals.say("identity", {**vars(identity), **more}, self.now)

    def take(self, event: Event) -> Reading | None:
        """An event of a source; the reading, where it is a point that a machine measured."""
        if isinstance(event, Reading):
            return self._reading(event)
        moment = Moment(event.utc_ns, event.monotonic_ns)
        if isinstance(event, Gap):
            self.ill[event.source] = event.why
            self._journals.say("gap", {"source": event.source, "why": str.__str__(event.why)}, moment)
            self.told.append(say("{source}: {why}", source=Verbatim(event.source), why=event.why))
        elif isinstance(event, Returned):
            self.ill.pop(event.source, None)
            self._journals.say("returned", {"source": event.source, "after_s": event.after_s}, moment)
            self.told.append(say("{source} is back after {s:.3g} s", source=Verbatim(event.source), s=event.after_s))
        return None

    def accept(
        self,
        place: Place,
        columns: Mapping[str, float],
        moment: Moment,
        how: str,
        *,
        of: Mapping[str, Any] | None = None,
    ) -> int:
        """Write a point down with what belongs to it; it counts once :meth:`commit` has returned ``True``."""
        data = {
            "place": list(place),
            "columns": dict(columns),
            "moment": [moment.utc_ns, moment.monotonic_ns],
            "how": how,
        }
        record = self._journals.say("point", {**data, **(of or {})}, self.now)
        self._open.append(record.number)
        return record.number

    def undo(self, points: Sequence[Point], reason: str) -> None:
        """Take points back; what they were stays in the journal, with the reason."""
        self._journals.say("undone", {"of": [point.record for point in points], "reason": reason}, self.now)

    def say(self, kind: str, **data: Any) -> None:
        """Write down what else happened: a note, a pause, a set-up that is left out."""
        self._journals.say(kind, data, self.now)

    def commit(self, *, streams: bool = True) -> bool:
        """Put everything on the disk, with or without streams; if not possible, it waits, and :attr:`stalled` says why."""
        if streams:
            self._blocks.put(self._journals.streams, self.now)
        try:
            self._journals.events.commit()
            if streams:
                self._journals.streams.commit()
        except NoRoomError as error:
            if self.stalled is None:
                self.told.append(Verbatim(str(error)))
            self.stalled = Verbatim(error.problem)
            return False
        if streams and self.stalled is not None:
            self.told.append(say("there is room on the disk again, and everything that waited is on it"))
            self.stalled = None
        return True

    def tick(self) -> bool:
        """Join what can be joined by now, look at the clocks, and commit."""
        now = self.now
        self._watch_clock(now)
        self._open = [number for number in self._open if not self._settle(number, now.monotonic_ns)]
        for stream in self.streams.values():
            stream.forget(now.monotonic_ns)
        return self.commit()

    def finish(self) -> None:
        """Join what is left, now that nothing more will come."""
        for number in self._open:
            self._settle(number, None)
        self._open.clear()

    @property
    def unsettled(self) -> int:
        """Points whose streams have not answered yet."""
        return len(self._open)

    def latest(self, columns: Sequence[str]) -> dict[str, float]:
        """What streams read just now, for a point that is taken while the machine stands still."""
        found, now = dict[str, float](), self._clock.monotonic_ns()
        for column in columns:
            stream = self.streams.get(column)
            age = stream.age_s(now) if stream is not None else None
            if stream is None or stream.latest is None or age is None or age > self._max_gap_s:
                silent = "" if age is None else f" for {age:.3g} s"
                raise CmmUqError(f"no reading of {column}{silent}: the point was not taken",
                                 fix="Look at its instrument, then take the point again")  # fmt: skip
            found[column] = stream.latest
        return found

    def column(self, source: str, quantity: str) -> str:
        """Column of the recording that a quantity of an instrument goes into."""
        declared = self._declared.get(source)
        return declared.values.get(quantity, quantity) if declared else quantity

    @property
    def names(self) -> tuple[str, ...]:
        """Of the instruments that the job declares."""
        return tuple(self._declared)

    def latency_ns(self, source: str) -> int:
        """From the measurement to the arrival of its last byte."""
        declared = self._declared.get(source)
        return round(declared.latency_ms * 1e6) if declared else 0

    def _reading(self, reading: Reading) -> Reading | None:
        self._blocks.add(reading)
        source = reading.source
        self.counts[source] = self.counts.get(source, 0) + 1
        if reading.status is not None:
            self.ill[source] = reading.status
        elif reading.values and source in self.ill:
            del self.ill[source]
        if reading.point is not None:
            return reading
        if reading.status is None:
            for quantity, value in reading.values.items():
                self._stream(source, quantity).add(reading.monotonic_ns, value)
        return None

    def _stream(self, source: str, quantity: str) -> Stream:
        for name, stream in self._fed.setdefault(source, []):
            if name == quantity:
                return stream
        column = self._own_column(source, quantity)
        stream = Stream(column, source, latency_s=self.latency_ns(source) * NS, max_gap_s=self._max_gap_s)
        self.streams[column] = stream
        self._fed[source].append((quantity, stream))
        return stream

    def _own_column(self, source: str, quantity: str) -> str:
        """The column of a quantity; with the instrument's name before it where another one fills that of its own name."""
        column = self.column(source, quantity)
        return f"{re.sub(r'[^A-Za-z0-9]', '_', source)}_{column}" if column in self.streams else column

    def _settle(self, number: int, now_ns: int | None) -> bool:
        """Join a point; whether every stream has answered."""
        point = self.story.points.get(number)
        if point is None:
            return True  # taken back meanwhile
        values, missing = dict[str, list[float]](), dict[str, str]()
        for column, stream in self.streams.items():
            if column in point.columns or column in COORDINATES:
                continue
            answer = stream.at(point.moment.monotonic_ns, now_ns)
            if answer is None:
                return False
            if isinstance(answer, Joined):
                values[column] = [answer.value, answer.u]
            else:
                missing[column] = str.__str__(answer)
                self.told.append(say("{column}: {why}", column=Verbatim(column), why=answer))
        self._journals.say("joined", {"of": number, "values": values, "missing": missing}, self.now)
        return True

    def _watch_clock(self, now: Moment) -> None:
        between = now.utc_ns - now.monotonic_ns
        by_s = (between - self._between) * NS
        if abs(by_s) > _JUMP_S:
            self._between = between
            self._journals.say("clock", {"by_s": by_s}, now)
            self.told.append(say(
                "the computer's clock was moved by {s:.3g} s, or it slept; times go on by the one that nobody sets", s=by_s
            ))  # fmt: skip


def settle_earlier(journals: Journals, sources: Iterable[DeclaredSource], max_gap_s: float, now: Moment) -> int:
    """Join what earlier sessions left open; how many points that were."""
    story, declared = journals.story, {source.name: source for source in sources}
    left = [point for point in story.points.values() if not point.settled and point.session != story.session.number]
    for number in dict.fromkeys(point.session for point in left):
        own = [point for point in left if point.session == number]
        for point, streams in _streams(journals.folder / STREAMS.format(number), own, declared, max_gap_s):
            answers = {
                stream.column: stream.at(point.moment.monotonic_ns, None)
                for stream in streams.values()
                if stream.column not in (*point.columns, *COORDINATES)
            }
            values = {name: [one.value, one.u] for name, one in answers.items() if isinstance(one, Joined)}
            missing = {name: str.__str__(one) for name, one in answers.items() if one and not isinstance(one, Joined)}
            journals.say("joined", {"of": point.record, "values": values, "missing": missing}, now)
    return len(left)


def _streams(
    path: Path, points: list[Point], declared: dict[str, DeclaredSource], max_gap_s: float
) -> Iterable[tuple[Point, dict[tuple[str, str], Stream]]]:
    for point in points:
        streams: dict[tuple[str, str], Stream] = {}
        for source in declared.values():
            for quantity, column in source.values.items():
                streams[source.name, quantity] = _stream(column, source, source.name, max_gap_s)
        for reading in _about(path, point.moment.monotonic_ns, round(3e9 * max_gap_s)):
            given = declared.get(reading.source)
            for quantity, value in reading.values.items():
                column = given.values.get(quantity, quantity) if given else quantity
                key = (reading.source, quantity)
                streams.setdefault(key, _stream(column, given, reading.source, max_gap_s))
                streams[key].add(reading.monotonic_ns, value)
        yield point, streams


def _about(path: Path, moment_ns: int, near_ns: int) -> Iterator[Reading]:
    """Sound readings about a moment, from a journal of streams; damaged lines are passed over."""
    for line in lines_in(path) if path.exists() else ():
        record = line.record
        if record is None or record.kind != READINGS or record.data["monotonic_ns"][-1] < moment_ns - near_ns:
            continue
        if record.data["monotonic_ns"][0] > moment_ns + near_ns:
            return
        yield from (one for one in readings_of(record.data) if one.status is None and one.point is None)


def _stream(column: str, declared: DeclaredSource | None, source: str, max_gap_s: float) -> Stream:
    latency = declared.latency_ms * 1e-3 if declared else 0.0
    return Stream(column, source, latency_s=latency, max_gap_s=max_gap_s)
