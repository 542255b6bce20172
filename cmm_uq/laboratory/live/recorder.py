"""Takes what instruments say, keeps it, and joins it to the points: nothing is shown as accepted that is not on the disk.

It knows no thread and no screen. Whoever runs it passes events on as they come, and calls :meth:`Recorder.tick` at least
every 100 ms, which puts everything on the disk.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import NOTHING, Text, Verbatim, say
from cmm_uq.base.points import AXES
from cmm_uq.jobs.tables.plan import DeclaredSource
from cmm_uq.laboratory.live.instruments.source import Clock, Event, Identity, Moment, Reading, Returned
from cmm_uq.laboratory.live.journal import NoRoomError, RecordingJournal, lines_in
from cmm_uq.laboratory.live.story import NS, STREAMS, Joined, Journals, Place, Story, Stream

READINGS = "readings"  # kind of such a record
COORDINATES = tuple(f"{axis}_mm" for axis in AXES)
_JUMP_S = 0.5
"""By which the wall clock leaves the monotonic one before it is said; a clock that is kept right is moved by far less."""


def put_blocks(readings: Iterable[Reading], journal: RecordingJournal, moment: Moment) -> None:
    """Readings into a journal, a record for each instrument and run of numbers that follow each other."""
    by_source: dict[str, list[Reading]] = {}
    for reading in readings:
        by_source.setdefault(reading.source, []).append(reading)
    for source, of in by_source.items():
        ends = [i for i in range(1, len(of)) if of[i].number != of[i - 1].number + 1]
        for start, end in pairwise((0, *ends, len(of))):
            journal.append(READINGS, _as_data(source, of[start:end]), moment)


def _as_data(source: str, readings: list[Reading]) -> dict[str, Any]:
    status = {str(i): str.__str__(reading.status) for i, reading in enumerate(readings) if reading.status is not None}
    probed = {str(i): reading.point for i, reading in enumerate(readings) if reading.point is not None}
    names = list(readings[0].values)
    alike = all(list(reading.values) == names for reading in readings)
    return {
        "source": source, "first": readings[0].number, "utc_ns": [reading.utc_ns for reading in readings],
        "monotonic_ns": [reading.monotonic_ns for reading in readings],
        "raw": [reading.raw.decode("latin-1") for reading in readings],
        **({"names": names, "values": [list(reading.values.values()) for reading in readings]} if alike
           else {"values": [dict(reading.values) for reading in readings]}),
        **({"status": status} if status else {}), **({"point": probed} if probed else {}),
    }  # fmt: skip


def readings_of(data: Mapping[str, Any]) -> Iterable[Reading]:
    names, wrong, probed = data.get("names"), data.get("status", {}), data.get("point", {})
    rows = zip(data["utc_ns"], data["monotonic_ns"], data["raw"], data["values"], strict=True)
    for i, (utc_ns, monotonic_ns, raw, row) in enumerate(rows):
        values = row if names is None else dict(zip(names, row, strict=True))
        status = Verbatim(wrong[str(i)]) if str(i) in wrong else None
        number, point = data["first"] + i, probed.get(str(i))
        yield Reading(data["source"], number, utc_ns, monotonic_ns, raw.encode("latin-1"), values, status, point)


class Recorder:
    def __init__(
        self, journals: Journals, sources: Sequence[DeclaredSource], *, max_gap_s: float, clock: Clock
    ) -> None:
        self._journals, self._clock, self._max_gap_s = journals, clock, max_gap_s
        self.declared = {source.name: source for source in sources}  # by the job
        self._came: list[Reading] = []  # since the last commit
        self._identities: dict[str, Identity] = {}
        self.unsettled: list[int] = []  # records of points that not every stream has answered
        start = journals.story.session.start
        self._between = start.utc_ns - start.monotonic_ns
        self.streams: dict[str, Stream] = {}  # of readings that come by themselves, by column
        self._fed: dict[tuple[str, str], Stream] = {}  # the same by instrument and quantity
        self.stalled: Text | None = None  # why nothing can be kept at the moment
        self.counts: dict[str, int] = {}  # readings of each instrument in this session
        self.unasked: dict[str, int] = {}  # those of them that are answers which nobody had asked for
        self.ill: dict[str, Text] = {}  # what is wrong with an instrument, by its name
        self.told: list[Text] = []  # what happened, to be shown once
        for source in sources:
            for quantity in source.values:
                self._stream(source.name, quantity)

    @property
    def story(self) -> Story:
        return self._journals.story

    @property
    def now(self) -> Moment:
        return Moment.now(self._clock)

    def identified(self, identity: Identity) -> None:
        """Which instrument a source is; written down whenever it says something new."""
        if self._identities.get(identity.name) != identity:
            self._identities[identity.name] = identity
            declared = self.declared.get(identity.name)
            more = {} if declared is None else {"columns": dict(declared.values), "latency_ms": declared.latency_ms}
            self.say("identity", **vars(identity), **more)

    def take(self, event: Event) -> Reading | None:
        """An event of a source; the reading, where it is a point that a machine measured."""
        source, called = event.source, Verbatim(event.source)
        if isinstance(event, Reading):
            return self._reading(event)
        moment = Moment(event.utc_ns, event.monotonic_ns)
        if isinstance(event, Returned):
            self.ill.pop(source, None)
            self._journals.say("returned", {"source": source, "after_s": event.after_s}, moment)
            self.told.append(say("{source} is back after {s:.3g} s", source=called, s=event.after_s))
        else:
            self.ill[source] = event.why
            self._journals.say("gap", {"source": source, "why": str.__str__(event.why)}, moment)
            self.told.append(say("{source}: {why}", source=called, why=event.why))
        return None

    def accept(
        self, place: Place, columns: Mapping[str, float], moment: Moment, how: str, of: Mapping[str, Any] | None = None
    ) -> None:
        """Write a point down with what belongs to it; it counts once :meth:`commit` has returned ``True``."""
        data = {"place": list(place), "columns": dict(columns), "moment": [moment.utc_ns, moment.monotonic_ns]}
        self.unsettled.append(self._journals.say("point", {**data, "how": how, **(of or {})}, self.now).number)

    def say(self, kind: str, **data: Any) -> None:
        """Write down what else happened: a note, a pause, a set-up that is left out, points that are taken back."""
        self._journals.say(kind, data, self.now)

    def commit(self, *, streams: bool = True) -> bool:
        """Put everything on the disk, with or without streams; if not possible, it waits, and :attr:`stalled` says why."""
        if streams:
            put_blocks(self._came, self._journals.streams, self.now)
            self._came.clear()
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
        between = now.utc_ns - now.monotonic_ns
        by_s = (between - self._between) * NS
        if abs(by_s) > _JUMP_S:
            self._between = between
            self._journals.say("clock", {"by_s": by_s}, now)
            self.told.append(say(
                "the computer's clock was moved by {s:.3g} s, or it slept; times go on by the one that nobody sets", s=by_s
            ))  # fmt: skip
        self.unsettled = [number for number in self.unsettled if not self._settle(number, now.monotonic_ns)]
        for stream in self.streams.values():
            stream.forget(now.monotonic_ns)
        return self.commit()

    def finish(self) -> None:
        """Join what is left, now that nothing more will come."""
        for number in self.unsettled:
            self._settle(number, None)
        self.unsettled.clear()
        for source, count in self.unasked.items():
            self.say("unasked", source=source, count=count)

    def latest(self, columns: Sequence[str]) -> dict[str, float]:
        """What streams read just now, for a point that is taken while the machine stands still."""
        values, now = dict[str, float](), self._clock.monotonic_ns()
        for column in columns:
            stream = self.streams.get(column)
            age = stream.age_s(now) if stream is not None else None
            if stream is None or stream.latest is None or age is None or age > self._max_gap_s:
                silent = "" if age is None else f" for {age:.3g} s"
                fix = "Look at its instrument, then take the point again"
                raise CmmUqError(f"no reading of {column}{silent}: the point was not taken", fix=fix)
            values[column] = stream.latest
        return values

    def column(self, source: str, quantity: str) -> str:
        """Column of the recording that a quantity of an instrument goes into."""
        return self.declared[source].values.get(quantity, quantity) if source in self.declared else quantity

    def latency_ns(self, source: str) -> int:
        """From the measurement to the arrival of its last byte."""
        declared = self.declared.get(source)
        return round(declared.latency_ms * 1e6) if declared else 0

    def _reading(self, reading: Reading) -> Reading | None:
        self._came.append(reading)
        source = reading.source
        self.counts[source] = self.counts.get(source, 0) + 1
        if reading.unasked:
            count = self.unasked[source] = self.unasked.get(source, 0) + 1
            if count & (count - 1) == 0:  # at each power of two, lest they fill the journal; the last at the end
                self.say("unasked", source=source, count=count)
                self.told.append(say("{source}: {why}", source=Verbatim(source), why=reading.status or NOTHING))
        if reading.status is not None:
            self.ill[source] = reading.status
        elif reading.values:
            self.ill.pop(source, None)
        if reading.point is not None:
            return reading
        if reading.status is None:
            for quantity, value in reading.values.items():
                self._stream(source, quantity).add(reading.monotonic_ns, value)
        return None

    def _stream(self, source: str, quantity: str) -> Stream:
        """In the column of the quantity; with the instrument's name before it where another one fills that."""
        if (source, quantity) not in self._fed:
            stream = self._new_stream(source, quantity)
            if stream.column in self.streams:
                stream.column = f"{re.sub(r'[^A-Za-z0-9]', '_', source)}_{stream.column}"
            self.streams[stream.column] = self._fed[source, quantity] = stream
        return self._fed[source, quantity]

    def _new_stream(self, source: str, quantity: str) -> Stream:
        latency_s = self.latency_ns(source) * NS
        return Stream(self.column(source, quantity), source, latency_s=latency_s, max_gap_s=self._max_gap_s)

    def _settle(self, number: int, now_ns: int | None) -> bool:
        """Join a point; whether every stream has answered."""
        point = self.story.points.get(number)
        if point is None:
            return True  # taken back meanwhile
        answers = dict[str, Joined | Text]()
        for column, stream in self.streams.items():
            if column not in point.columns and column not in COORDINATES:
                if (answer := stream.at(point.moment.monotonic_ns, now_ns)) is None:
                    return False
                answers[column] = answer
        self.told += [say("{column}: {why}", column=Verbatim(column), why=why)
                      for column, why in answers.items() if not isinstance(why, Joined)]  # fmt: skip
        self._say_joined(number, answers)
        return True

    def settle_earlier(self) -> int:
        """Join what earlier sessions left open; how many points that were."""
        session = self.story.session.number
        left = [point for point in self.story.points.values() if not point.settled and point.session != session]
        for point in left:
            moment_ns = point.moment.monotonic_ns
            streams = {(one.name, quantity): self._new_stream(one.name, quantity)
                       for one in self.declared.values() for quantity in one.values}  # fmt: skip
            path = self._journals.folder / STREAMS.format(point.session)
            for reading in _about(path, moment_ns, round(3e9 * self._max_gap_s)):
                for quantity, value in reading.values.items():
                    key = (reading.source, quantity)
                    streams.setdefault(key, self._new_stream(*key)).add(reading.monotonic_ns, value)
            skipped = (*point.columns, *COORDINATES)
            answers = {one.column: one.at(moment_ns, None) for one in streams.values() if one.column not in skipped}
            self._say_joined(point.record, answers)
        return len(left)

    def _say_joined(self, number: int, answers: Mapping[str, Joined | Text | None]) -> None:
        values = {name: [one.value, one.u] for name, one in answers.items() if isinstance(one, Joined)}
        missing = {name: str.__str__(one) for name, one in answers.items() if one and not isinstance(one, Joined)}
        self.say("joined", of=number, values=values, missing=missing)


def _about(path: Path, moment_ns: int, near_ns: int) -> Iterator[Reading]:
    """Sound readings about a moment, from a journal of streams; damaged lines are passed over."""
    for line in lines_in(path) if path.exists() else ():
        record = line.record
        if record is None or record.kind != READINGS or record.data["monotonic_ns"][-1] < moment_ns - near_ns:
            continue
        if record.data["monotonic_ns"][0] > moment_ns + near_ns:
            return
        yield from (one for one in readings_of(record.data) if one.status is None and one.point is None)
