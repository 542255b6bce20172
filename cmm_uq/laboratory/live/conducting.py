"""One session from its first word to its last: what instruments and operator say, put where the plan has it.

It knows no thread and no terminal: :meth:`Conductor.event`, :meth:`Conductor.line` and :meth:`Conductor.file` are told what
happens, :meth:`Conductor.tick` keeps time, and :meth:`Conductor.view` is what there is to be seen. A point is kept, then shown
as accepted, judged, and written with its set-up.
"""

from __future__ import annotations

import hashlib
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from cmm_uq.base.errors import CmmUqError, OutputError
from cmm_uq.base.messages import NOTHING, Text, Verbatim, commas, names, say, signed
from cmm_uq.jobs.tables.plan import AcquireFacts
from cmm_uq.laboratory.live.instruments.source import Event, Moment, Reading
from cmm_uq.laboratory.live.judging import Judge, PointJudgement
from cmm_uq.laboratory.live.lead import TYPED, Lead, LiveRecording, PlannedPoint, Run, rows_of
from cmm_uq.laboratory.live.recorder import COORDINATES, Recorder
from cmm_uq.laboratory.live.screen import WORDS, OperatorInput, SessionView, Soak, coming, picture, understood
from cmm_uq.laboratory.live.story import Place, Point, Story

_SHOWN = 50  # lines of what happened that a screen may show
_PASTED_S = 0.6  # between two points that are typed: in less nobody measures
_NUMBERS = ("measurement", "point", "repeat")
_NOTHING_LEFT = say("nothing is left of the plan")
_Measured = tuple[PlannedPoint, Mapping[str, float]]  # a point of the plan, and what was measured of it by column
_UNTIMED = {"timed": False}  # of points that share a moment which is none of theirs


class Conductor:
    def __init__(
        self,
        recorder: Recorder,
        lead: Lead,
        judge: Judge,
        table: LiveRecording,
        facts: AcquireFacts,
        *,
        soak_k_per_h: float | None,
        machine: Callable[[PlannedPoint], None] | None = None,  # has a machine measure a point
        clear: Sequence[Callable[[], None]] = (),  # of each machine that waits for its errors to be cleared
    ) -> None:
        self.recorder, self.lead, self.paused = recorder, lead, False
        self.said: deque[Text] = deque()  # what happened and was not read yet, oldest first
        self._log: deque[Text] = deque(maxlen=_SHOWN)
        self._judge, self._table, self._facts, self._limit = judge, table, facts, soak_k_per_h
        self._machine, self._clears = machine, clear
        self._soaks: dict[str, Soak] = {}
        self._next_run: Run | None = None  # what the operator goes on with
        self._unsaid: list[PlannedPoint] = []  # points that are accepted when they are on the disk
        self._unjudged: list[Run] = []  # complete set-ups, judged when they are written
        self._judgement, self._written = PointJudgement(), -1
        self._asks, self._ending, self._at_once, self._typed_ns = 0, False, False, 0

    @property
    def story(self) -> Story:
        return self.recorder.story

    @property
    def ended(self) -> bool:
        """Whether the operator has ended it, and nothing is being measured or waits for a reading any more."""
        return self._ending and (self._at_once or not (self._asks or self.recorder.unsettled))

    @property
    def step(self) -> PlannedPoint | None:
        return self.lead.next(self.story, self._next_run)

    @property
    def reportable(self) -> bool:
        return bool(rows_of(self.story, self.lead))

    def event(self, event: Event) -> None:
        probed = self.recorder.take(event)
        if isinstance(event, Reading) and event.status is None:
            for quantity, value in event.values.items():
                column = self.recorder.column(event.source, quantity)
                if column.endswith("_c"):  # a temperature
                    soak = self._soaks.setdefault(column, Soak(column, self._limit, self._facts.soak_min))
                    soak.add(event.monotonic_ns, value)
        if probed is not None:
            self._probed(probed)
        self._listen()

    def line(self, line: str) -> None:
        try:
            typed = understood(line)
            if typed.word in ("take", "point"):
                self._take(typed)
            else:
                getattr(self, f"_{typed.word}")(typed.text)
        except CmmUqError as error:
            self.tell(Verbatim(f"{error.problem}. {error.fix}" if error.fix else error.problem))

    def file(self, name: str, content: bytes, moment: Moment, rows: Sequence[Mapping[str, float]], kept: str) -> None:
        """Points of a file that a machine's program wrote: where the file says, else in the order of the plan."""
        digest, called = hashlib.sha256(content).hexdigest(), Verbatim(name)
        if digest in self.story.files:
            self.tell(say("{name} holds what {other} held, byte for byte: it is not taken again", name=called,
                           other=Verbatim(self.story.files[digest])))  # fmt: skip
            return
        places = self.lead.places(self.story, self.step, [_place_in(row) for row in rows])
        if isinstance(places, Text):
            self.tell(say("{name}: {why}; no point of it is taken", name=called, why=places))
            return
        self.recorder.say("file", name=name, sha256=digest, kept=kept, points=len(places))
        self._accept(
            [(step, {n: row[n] for n in row if n not in _NUMBERS}) for step, row in zip(places, rows, strict=False)],
            moment, name, {"sha256": digest, **_UNTIMED},
        )  # fmt: skip
        if len(rows) > len(places):
            self.tell(say("{name}: {more} points are more than the plan has left, and are not taken", name=called,
                           more=len(rows) - len(places)))  # fmt: skip

    def tick(self) -> None:
        """Keep everything, join what can be joined, judge what is complete, and write the recording where it grew."""
        if self.recorder.tick():
            self._say_accepted()
            if self._written != self.story.changes:
                self._written = self.story.changes
                self._judge_complete()
                try:
                    self._table.write(self.story, self.lead)
                except OutputError as error:
                    self._written = -1
                    why = Verbatim(str(error))
                    self.tell(say("the recording could not be written, the journal has it all: {why}", why=why))
        self._listen()

    def finish(self) -> None:
        self.recorder.finish()
        self.recorder.say("end")
        self.tick()
        self._table.finish(self.story, self.lead)

    def view(self) -> SessionView:
        done, every = len(self.lead.complete(self.story)), len(self.lead.all_runs(self.story))
        step, head, again = self.step, say("{done} of {every} set-ups", done=done, every=every), self._judgement.again
        if self.recorder.stalled is not None:
            head = say("NOTHING IS KEPT: {why}", why=self.recorder.stalled)
        elif self.paused:
            head = say("PAUSED, {head}", head=head)
        if waiting := [name for name, soak in self._soaks.items() if soak.unsettled]:
            head = say("{head}; WAIT, not settled: {columns}", head=head, columns=commas(names(waiting)))
        instruments: list[Text] = []
        for name in dict.fromkeys((*self.recorder.declared, *self.recorder.counts)):
            count = say("{name}: {count} readings", name=Verbatim(name), count=self.recorder.counts.get(name, 0))
            ill = self.recorder.ill.get(name)
            instruments.append(count if ill is None else say("{count}, {why}", count=count, why=ill))
        steps = () if step is None else self.lead.steps(step.run)
        return SessionView(
            head, coming(step, self.lead), picture(self.lead.plan.machine, steps, step), self._judgement.shown,
            say("REPEAT? {why}", why=again) if again else NOTHING,
            tuple(soak.words for soak in self._soaks.values()), tuple(instruments), tuple(self._log),
        )  # fmt: skip

    def tell(self, text: Text) -> None:
        self.said.append(text)
        self._log.append(text)

    def _listen(self) -> None:
        for text in self.recorder.told:
            self.tell(text)
        self.recorder.told.clear()

    def _probed(self, reading: Reading) -> None:
        """A point of a machine; where it was asked for further ones, the next is asked for now."""
        columns = {self.recorder.column(reading.source, name): value for name, value in reading.values.items()}
        why: Text | None = reading.status
        if self.paused:
            why = say("points are not taken now")
        elif why is None and not all(name in columns for name in COORDINATES):
            why = say("it lacks a coordinate")
        step = self.step
        if why is not None or step is None:
            why = why or _NOTHING_LEFT
            self.tell(say("{source}: a point is not taken: {why}", source=Verbatim(reading.source), why=why))
        else:
            latency = self.recorder.latency_ns(reading.source)
            moment = Moment(reading.utc_ns - latency, reading.monotonic_ns - latency)
            of = {"reading": reading.number, "raw": reading.raw.decode("latin-1")}
            self._accept([(step, columns)], moment, reading.source, of)
        self._asks = max(0, self._asks - 1)
        if self._asks and self._machine is not None:
            if (following := self.step) is None:
                self._asks = 0
            else:
                self._machine(following)

    def _take(self, typed: OperatorInput) -> None:
        step, now = self.step, self.recorder.now
        if self.paused:
            raise CmmUqError("paused: no point is taken", fix="resume goes on")
        if step is None:
            raise CmmUqError("nothing is left of the plan", fix="repeat, go or quit")
        if typed.word == "take" and self._machine is not None:
            self._asks += 1
            if self._asks == 1:
                self._machine(step)
        elif typed.word == "take":
            if not any(name in self.recorder.streams for name in COORDINATES):
                fix = "Type them: x y z, or a distance from the first point"
                raise CmmUqError("no instrument reads coordinates", fix=fix)
            self._accept([(step, self.recorder.latest(COORDINATES))], now, "scales", {})
        elif len(typed.numbers) == 3:
            pasted = now.monotonic_ns - self._typed_ns <= _PASTED_S * 1e9  # faster than they can be measured
            self._typed_ns = now.monotonic_ns
            columns = dict(zip(COORDINATES, typed.numbers, strict=True))
            self._accept([(step, columns)], now, TYPED, {"raw": typed.text, **(_UNTIMED if pasted else {})})
        else:
            places = self.lead.at_distance(step, typed.numbers[0], self.story)
            points = [(point, dict(zip(COORDINATES, xyz.tolist(), strict=True))) for point, xyz in places]
            self._accept(points, now, f"{TYPED} length", {"raw": typed.text, **_UNTIMED})

    def _accept(self, points: Sequence[_Measured], moment: Moment, how: str, of: Mapping[str, Any]) -> None:
        """Keep points, and say so; where there is no room they wait, and it is said when they are kept."""
        for step, columns in points:
            self.recorder.accept(step.place, columns, moment, how, of)
            self._unsaid.append(step)
        if self.recorder.commit(streams=False):
            self._say_accepted()

    def _say_accepted(self) -> None:
        steps, self._unsaid = self._unsaid, []
        for step in steps:
            if (point := self.story.by_place.get(step.place)) is None:
                continue
            m, p, r = step.place
            at = commas(signed(point.columns[name], ".4f") for name in COORDINATES)
            self.tell(say("accepted: measurement {m}, point {p}, repeat {r}: {at}", m=m, p=p, r=r, at=at))
            self._judgement = self._judge.point(step, self.story, self.lead)
            self._tell_judgement(self._judgement)
            if not self.lead.missing(step.run, self.story) and step.run not in self._unjudged:
                self._unjudged.append(step.run)

    def _judge_complete(self) -> None:
        rows = rows_of(self.story, self.lead)
        there = {row.step.run for row in rows}
        for run in [run for run in self._unjudged if run in there]:
            self._unjudged.remove(run)
            judged = self._judge.run(run, rows, repeats_most=self._facts.repeats_most)
            self._judgement = PointJudgement((*self._judgement.shown, *judged.shown), (), judged.again)
            self._tell_judgement(judged)
            if judged.again is not None:
                self.tell(say("REPEAT? {why} (repeat does)", why=judged.again))

    def _tell_judgement(self, judged: PointJudgement) -> None:
        for text in (*judged.shown, *(say("WARNING: {why}", why=why) for why in judged.warnings)):
            self.tell(text)

    def _last_point(self, problem: str) -> Point:
        if not self.story.points:
            raise CmmUqError(problem)
        return list(self.story.points.values())[-1]

    def _write_down(self, kind: str, **data: Any) -> None:
        """A word of the operator, on the disk at once."""
        self.recorder.say(kind, **data)
        if not self.recorder.commit():
            self.tell(say("it is not on the disk yet"))

    def _undo(self, reason: str) -> None:
        last = self._last_point("no point is there to be taken back")
        self._write_down("undone", of=[last.record], reason=reason)
        (m, p, r), self._judgement, self._next_run = last.place, PointJudgement(), (last.place[0], last.place[2])
        self.tell(say("taken back: measurement {m}, point {p}, repeat {r}: {why}", m=m, p=p, r=r, why=Verbatim(reason)))

    def _repeat(self, _: str) -> None:
        last = self._last_point("no set-up is there to be repeated").place
        run = self.lead.more((last[0], last[2]), self.story)
        self._write_down("repeat", measurement=run[0], repeat=run[1])
        self._next_run, self._judgement = run, PointJudgement()

    def _skip(self, reason: str) -> None:
        if (step := self.step) is None:
            raise CmmUqError("nothing is left of the plan")
        m, r = step.run
        self._write_down("skip", measurement=m, repeat=r, reason=reason)
        self._next_run = None
        self.tell(say("left out: measurement {m}, repeat {r}", m=m, r=r))

    def _go(self, text: str) -> None:
        if not text.isdecimal():
            raise CmmUqError(f"{text!r} is no number of a measurement", fix="Type it so: go 5")
        self._next_run = self.lead.run_of(int(text), self.story)

    def _note(self, text: str) -> None:
        self._write_down("note", text=text)
        self.tell(say("noted"))

    def _clear(self, _: str) -> None:
        if not self._clears:
            raise CmmUqError("no machine here waits for its errors to be cleared")
        for clear in self._clears:
            clear()
        self._write_down("note", text="errors of the machine cleared by the operator")
        self.tell(say("the machine is told to go on"))

    def _pause(self, reason: str) -> None:
        self.paused = True
        self._write_down("pause", reason=reason)

    def _resume(self, _: str) -> None:
        self.paused = False
        self._write_down("resume")

    def _help(self, _: str) -> None:
        self.tell(say("x y z: a point; one number: its distance from the first; Enter: where the scales are now"))
        for word, what in WORDS.items():
            self.tell(say("{word} {what}", word=Verbatim(word), what=Verbatim(what)))

    def _quit(self, _: str) -> None:
        self._at_once, self._ending = self._ending, True
        if not self.ended:
            self.tell(say("it ends when every point has its readings; quit again ends it at once"))


def _place_in(row: Mapping[str, float]) -> Place | None:
    """Measurement, point and repeat of a row of a file; ``None`` where it does not number them."""
    if "measurement" not in row or "point" not in row:
        return None
    return int(row["measurement"]), int(row["point"]), int(row.get("repeat", 1))
