"""One session from its first word to its last: what instruments and operator say, put where the plan has it.

It knows no thread and no terminal: :meth:`Conductor.event`, :meth:`Conductor.line` and :meth:`Conductor.file` are told what
happens, :meth:`Conductor.tick` keeps time, and :meth:`Conductor.view` is what there is to be seen.
"""

from __future__ import annotations

import hashlib
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import NOTHING, Text, Verbatim, commas, names, say
from cmm_uq.base.points import Floats
from cmm_uq.jobs.tables.plan import AcquireFacts
from cmm_uq.laboratory.live.accepting import Accepting
from cmm_uq.laboratory.live.instruments.source import Event, Reading
from cmm_uq.laboratory.live.journal import Moment
from cmm_uq.laboratory.live.judging import Judge, PointJudgement
from cmm_uq.laboratory.live.lead import Lead, PlannedPoint, Run
from cmm_uq.laboratory.live.recorder import COORDINATES, Recorder
from cmm_uq.laboratory.live.screen import WORDS, OperatorInput, SessionView, coming, picture, understood
from cmm_uq.laboratory.live.soaking import Soak, is_temperature, unsettled
from cmm_uq.laboratory.live.story import Place, Story
from cmm_uq.laboratory.live.table import TYPED, LiveRecording, rows_of

_SAID = 50  # lines of what happened that a screen may show


class Conductor:
    """A session."""

    def __init__(
        self,
        recorder: Recorder,
        lead: Lead,
        judge: Judge,
        table: LiveRecording,
        facts: AcquireFacts,
        *,
        soak_k_per_h: float | None,
        machine: Callable[[PlannedPoint], None] | None = None,
        clear: Sequence[Callable[[], None]] = (),
    ) -> None:
        self.recorder, self.lead = recorder, lead
        self._table, self._facts, self._limit = table, facts, soak_k_per_h
        self._accepting = Accepting(recorder, lead, judge, table, facts.repeats_most, self.tell)
        self._machine, self._clears = machine, tuple(clear)
        self._soaks: dict[str, Soak] = {}
        self._wanted: Run | None = None
        self.said: deque[Text] = deque()
        self._log: deque[Text] = deque(maxlen=_SAID)
        self._asks, self._ending, self._at_once = 0, False, False
        self._typed_ns = 0
        self.paused = False

    @property
    def story(self) -> Story:
        return self.recorder.story

    @property
    def ended(self) -> bool:
        """Whether the operator has ended it, and nothing is being measured or waits for a reading any more."""
        return self._ending and (self._at_once or not (self._asks or self.recorder.unsettled))

    @property
    def step(self) -> PlannedPoint | None:
        return self.lead.next(self.story, self._wanted)

    @property
    def reportable(self) -> bool:
        """Whether the recording has a set-up in it."""
        return bool(rows_of(self.story, self.lead))

    def event(self, event: Event) -> None:
        """Something that a source says."""
        probed = self.recorder.take(event)
        if isinstance(event, Reading) and event.status is None:
            self._warm(event)
        if probed is not None:
            self._probed(probed)
        self._listen()

    def line(self, line: str) -> None:
        """A line of the operator."""
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
        digest = hashlib.sha256(content).hexdigest()
        if digest in self.story.files:
            self.tell(say("{name} holds what {other} held, byte for byte: it is not taken again", name=Verbatim(name),
                           other=Verbatim(self.story.files[digest])))  # fmt: skip
            return
        places = self.lead.places(self.story, self.step, [_numbers(row) for row in rows])
        if isinstance(places, Text):
            self.tell(say("{name}: {why}; no point of it is taken", name=Verbatim(name), why=places))
            return
        self.recorder.say("file", name=name, sha256=digest, kept=kept, points=len(places))
        self._accepting.accept(
            [(step, {n: row[n] for n in row if n not in _NUMBERS}) for step, row in zip(places, rows, strict=False)],
            moment, name, {"sha256": digest, **_OF_ALL},
        )  # fmt: skip
        if len(rows) > len(places):
            self.tell(say("{name}: {more} points are more than the plan has left, and are not taken", name=Verbatim(name),
                           more=len(rows) - len(places)))  # fmt: skip

    def tick(self) -> None:
        """Keep everything, join what can be joined, judge what is complete, and write the recording where it grew."""
        if self.recorder.tick():
            self._accepting.kept()
        self._listen()

    def finish(self) -> None:
        """Write the last of it."""
        self.recorder.finish()
        self.recorder.say("end")
        self.tick()
        self._table.finish(self.story, self.lead)

    def view(self) -> SessionView:
        """What there is to be seen."""
        done, every = self.lead.progress(self.story)
        step, head = self.step, say("{done} of {every} set-ups", done=done, every=every)
        if self.recorder.stalled is not None:
            head = say("NOTHING IS KEPT: {why}", why=self.recorder.stalled)
        elif self.paused:
            head = say("PAUSED, {head}", head=head)
        if waiting := unsettled(self._soaks):
            head = say("{head}; WAIT, not settled: {columns}", head=head, columns=commas(names(waiting)))
        steps = () if step is None else self.lead.steps((step.place[0], step.place[2]))
        return SessionView(
            head, coming(step, self.lead), picture(self.lead.plan.machine, steps, step), self._accepting.judged.shown,
            say("REPEAT? {why}", why=self._accepting.judged.again) if self._accepting.judged.again else NOTHING,
            tuple(soak.words for soak in self._soaks.values()), tuple(self._instruments()), tuple(self._log),
        )  # fmt: skip

    def _probed(self, reading: Reading) -> None:
        """A point of a machine; where it was asked for further ones, the next is asked for now."""
        columns = {self.recorder.column(reading.source, name): value for name, value in reading.values.items()}
        latency = self.recorder.latency_ns(reading.source)
        moment = Moment(reading.utc_ns - latency, reading.monotonic_ns - latency)
        step = self.step
        why = self._refused(reading, columns)
        if why is not None or step is None:
            self.tell(say("{source}: a point is not taken: {why}", source=Verbatim(reading.source), why=why or _ALL))
        else:
            of = {"reading": reading.number, "raw": reading.raw.decode("latin-1")}
            self._accepting.accept([(step, columns)], moment, reading.source, of)
        self._asks = max(0, self._asks - 1)
        if self._asks and self._machine is not None:
            following = self.step
            if following is None:
                self._asks = 0
            else:
                self._machine(following)

    def _refused(self, reading: Reading, columns: Mapping[str, float]) -> Text | None:
        if self.paused:
            return say("points are not taken now")
        if reading.status is not None:
            return reading.status
        return None if all(name in columns for name in COORDINATES) else say("it lacks a coordinate")

    def _take(self, typed: OperatorInput) -> None:
        step, now = self.step, self.recorder.now
        if self.paused:
            raise CmmUqError("paused: no point is taken", fix="resume goes on")
        if step is None:
            raise CmmUqError("nothing is left of the plan", fix="repeat, go or quit")
        if typed.word == "take":
            if self._machine is not None:
                self._asks += 1
                if self._asks == 1:
                    self._machine(step)
                return
            if not any(name in self.recorder.streams for name in COORDINATES):
                raise CmmUqError(
                    "no instrument reads coordinates", fix="Type them: x y z, or a distance from the first point"
                )
            self._accepting.accept([(step, self.recorder.latest(COORDINATES))], now, "scales", {})
        elif len(typed.numbers) == 3:
            columns = dict(zip(COORDINATES, typed.numbers, strict=True))
            self._accepting.accept([(step, columns)], now, TYPED, {"raw": typed.text, **self._own_time(now)})
        else:
            found = self.lead.at_distance(step, typed.numbers[0], self.story)
            points = [(one, _columns(xyz)) for one, xyz in found]
            self._accepting.accept(points, now, f"{TYPED} length", {"raw": typed.text, **_OF_ALL})

    def _own_time(self, now: Moment) -> Mapping[str, bool]:
        """Nothing, but for points that are pasted faster than they can be measured."""
        before, self._typed_ns = self._typed_ns, now.monotonic_ns
        return {} if now.monotonic_ns - before > _PASTED_S * 1e9 else _OF_ALL

    def _warm(self, reading: Reading) -> None:
        for quantity, value in reading.values.items():
            column = self.recorder.column(reading.source, quantity)
            if is_temperature(column):
                if column not in self._soaks:
                    self._soaks[column] = Soak(column, self._limit, self._facts.soak_min)
                self._soaks[column].add(reading.monotonic_ns, value)

    def _undo(self, reason: str) -> None:
        if not self.story.points:
            raise CmmUqError("no point is there to be taken back")
        last = list(self.story.points.values())[-1]
        self.recorder.undo([last], reason)
        self._after_word()
        self._accepting.judged, self._wanted = PointJudgement(), (last.place[0], last.place[2])
        self.tell(say("taken back: measurement {m}, point {p}, repeat {r}: {why}", m=last.place[0], p=last.place[1],
                       r=last.place[2], why=Verbatim(reason)))  # fmt: skip

    def _repeat(self, _: str) -> None:
        if not self.story.points:
            raise CmmUqError("no set-up is there to be repeated")
        last = list(self.story.points.values())[-1].place
        run = self.lead.more((last[0], last[2]), self.story)
        self.recorder.say("repeat", measurement=run[0], repeat=run[1])
        self._after_word()
        self._wanted, self._accepting.judged = run, PointJudgement()

    def _skip(self, reason: str) -> None:
        step = self.step
        if step is None:
            raise CmmUqError("nothing is left of the plan")
        self.recorder.say("skip", measurement=step.place[0], repeat=step.place[2], reason=reason)
        self._after_word()
        self._wanted = None
        self.tell(say("left out: measurement {m}, repeat {r}", m=step.place[0], r=step.place[2]))

    def _go(self, text: str) -> None:
        if not text.isdecimal():
            raise CmmUqError(f"{text!r} is no number of a measurement", fix="Type it so: go 5")
        self._wanted = self.lead.run_of(int(text), self.story)

    def _note(self, text: str) -> None:
        self.recorder.say("note", text=text)
        self._after_word()
        self.tell(say("noted"))

    def _clear(self, _: str) -> None:
        if not self._clears:
            raise CmmUqError("no machine here waits for its errors to be cleared")
        for clear in self._clears:
            clear()
        self.recorder.say("note", text="errors of the machine cleared by the operator")
        self._after_word()
        self.tell(say("the machine is told to go on"))

    def _pause(self, reason: str) -> None:
        self.paused = True
        self.recorder.say("pause", reason=reason)
        self._after_word()

    def _resume(self, _: str) -> None:
        self.paused = False
        self.recorder.say("resume")
        self._after_word()

    def _help(self, _: str) -> None:
        self.tell(say("x y z: a point; one number: its distance from the first; Enter: where the scales are now"))
        for word, what in WORDS.items():
            self.tell(say("{word} {what}", word=Verbatim(word), what=Verbatim(what)))

    def _quit(self, _: str) -> None:
        self._at_once, self._ending = self._ending, True
        if not self.ended:
            self.tell(say("it ends when every point has its readings; quit again ends it at once"))

    def _after_word(self) -> None:
        if not self.recorder.commit():
            self.tell(say("it is not on the disk yet"))

    def _instruments(self) -> list[Text]:
        told: list[Text] = []
        for name in dict.fromkeys((*self.recorder.names, *self.recorder.counts)):
            count = say("{name}: {count} readings", name=Verbatim(name), count=self.recorder.counts.get(name, 0))
            ill = self.recorder.ill.get(name)
            told.append(count if ill is None else say("{count}, {why}", count=count, why=ill))
        return told

    def _listen(self) -> None:
        told, self.recorder.told = self.recorder.told, []
        for text in told:
            self.tell(text)

    def tell(self, text: Text) -> None:
        self.said.append(text)
        self._log.append(text)


_ALL = say("nothing is left of the plan")
_OF_ALL: Mapping[str, bool] = MappingProxyType({"timed": False})
"""Of points that share a moment which is none of theirs."""

_PASTED_S = 0.6  # between two points that are typed: in less nobody measures
_NUMBERS = ("measurement", "point", "repeat")


def _columns(xyz: Floats) -> dict[str, float]:
    return dict(zip(COORDINATES, np.asarray(xyz).tolist(), strict=True))


def _numbers(row: Mapping[str, float]) -> Place | None:
    """Measurement, point and repeat of a row of a file; ``None`` where it does not number them."""
    if "measurement" not in row or "point" not in row:
        return None
    return int(row["measurement"]), int(row["point"]), int(row.get("repeat", 1))
