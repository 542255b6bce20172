"""An instrument as a source: its port, which question is asked when, its messages with their times, its silence and return."""

from __future__ import annotations

import contextlib
import re
import threading
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, Verbatim, commas, say
from cmm_uq.jobs.tables.plan import DeclaredSource
from cmm_uq.laboratory.live.instruments import pt104, source
from cmm_uq.laboratory.live.instruments.ipp_machine import open_machine
from cmm_uq.laboratory.live.instruments.library import PAUSE, Conversation, profile_of_source, unsaid_units
from cmm_uq.laboratory.live.instruments.parsing import FramedMessage, Framer, Parser, Understood
from cmm_uq.laboratory.live.instruments.profile import Identify, ProfileFile, bytes_of
from cmm_uq.laboratory.live.instruments.source import SECOND, Identity

RETRY_S = 0.25  # between two attempts to open a port that is gone; a return is to be noticed within 2 s
INTRODUCED_WITHIN_S = 0.7  # time for an instrument that came back to say which one it is


class LiveInstrument:
    """An instrument at a port; a silent connection over a network is made anew: it may be dead unnoticed."""

    def __init__(
        self, identity: source.Identity, profile: ProfileFile, opened: source.PortOpener, clock: source.Clock, *,
        reopen_when_silent: bool = False,
    ) -> None:  # fmt: skip
        self.name = identity.name
        self._declared, self._identity = identity, identity
        self._profile, self._opened, self._clock = profile, opened, clock
        self._reopen_when_silent = reopen_when_silent
        self._parser, self._framer = Parser(profile), Framer(profile.frame)
        self._number, self._gap_at, self._closed = 0, -1, False
        self._byte_at = clock.monotonic_ns()
        self._told, self._known = "", False
        self._noisy_at = -1  # since when bytes come that keep it from being asked
        self._half: Text | None = None  # why the next message may not be whole, or not be an answer
        self._port: source.Port | None = opened()
        self._conversation = self._begun()
        self._held: list[source.Event] = []
        try:
            self._held = list(self._introduced(self._port, profile.send.answer_within_s))
        except source.PortLostError as lost:
            fix = "Check cable and power"
            raise CmmUqError(f"the port was lost at once: {lost}", where=self.name, fix=fix) from None
        except CmmUqError:
            self._port.close()
            raise

    def identity(self) -> source.Identity:
        return self._identity

    def close(self) -> None:
        self._closed = True
        if (port := self._port) is not None:
            with contextlib.suppress(source.PortLostError):
                for text in self._profile.send.stop:
                    port.write(bytes_of(text))
            self._close_port()

    def events(self, stop: threading.Event) -> Iterator[source.Event]:
        held, self._held = self._held, []
        yield from held
        while not stop.is_set() and not self._closed:
            port = self._port
            if port is None:
                yield from self._reconnected()
                continue
            try:
                yield from self._step(port)
            except source.EndOfFileError as end:
                yield from self._rest()
                yield from self._silent(say("{why}", why=Verbatim(str(end))))
                return
            except source.PortLostError as lost:
                if not self._closed:
                    yield from self._lost(say("the port was lost: {why}", why=Verbatim(str(lost))))
        yield from self._rest()

    def _step(self, port: source.Port) -> Iterator[source.Event]:
        if not self._conversation.expects:
            yield from self._heard(port.read(wait=False), port)  # what is there before a question is no answer to it
        now = self._clock.monotonic_ns()
        question = self._conversation.question(now) if self._quiet() and self._port is port else None
        if question is not None:
            if self._profile.frame.length and not self._profile.frame.start:
                yield from self._rest()
                self._half = None
            elif self._parser.begins(self._framer.waiting):
                self._half = say("it began before the question")
            port.write(question)
        received = port.read()
        if received:
            yield from self._heard(received, port)
        elif self._framer.waiting and self._since_byte_s() > self._profile.send.answer_within_s:
            yield from self._rest()
        if self._conversation.overdue(self._clock.monotonic_ns()):
            yield from self._overdue(port)

    def _heard(self, received: bytes, port: source.Port) -> Iterator[source.Event]:
        if received:
            stamp = source.Moment.now(self._clock)
            self._byte_at = stamp.monotonic_ns
            for framed in self._framer.feed(received):
                yield from self._message(framed, stamp, port)

    def _since_byte_s(self) -> float:
        return (self._clock.monotonic_ns() - self._byte_at) / SECOND

    def _quiet(self) -> bool:
        """Whether no message is on its way, which would end behind a question; what comes without an end is not waited for."""
        if not self._framer.waiting.strip() or self._since_byte_s() > source.TICK_S:
            self._noisy_at = -1
            return True
        now = self._clock.monotonic_ns()
        self._noisy_at = now if self._noisy_at < 0 else self._noisy_at
        return now - self._noisy_at > PAUSE

    def _message(
        self, framed: FramedMessage, stamp: source.Moment, port: source.Port | None = None
    ) -> Iterator[source.Event]:
        """What came, with the return of an instrument that was silent; with a port, that is asked first who it is."""
        understood = self._parser.read(framed, max(self._conversation.asked, 0))
        half, self._half = self._half, None
        self._conversation.heard(stamp.monotonic_ns)
        if understood.answers:
            back = self._conversation.expects
            why = self._conversation.answered(stamp.monotonic_ns) if half is None else half
            if why is not None and understood.values:
                what = commas(Verbatim(f"{name} = {value:.10g}") for name, value in understood.values.items())
                status = say("{what} answers no question, and is not used: {why}", what=what, why=why)
                understood = Understood(status=status, answers=back, unasked=True)
        if understood.answers and self._gap_at >= 0:
            yield from self._returned(framed, understood, stamp, port)
        else:
            yield self._reading(framed, understood, stamp)

    def _returned(
        self, framed: FramedMessage, understood: Understood, stamp: source.Moment, port: source.Port | None
    ) -> Iterator[source.Event]:
        gap, self._gap_at = self._gap_at, -1
        try:
            further = [] if self._known or port is None else list(self._introduced(port, INTRODUCED_WITHIN_S))
        except (CmmUqError, source.PortLostError) as error:
            self._gap_at, self._conversation.gap = gap, True
            yield self._reading(framed, Understood(status=Verbatim(str(error))), stamp)
            yield from self._refused(error)
            return
        self._told = ""
        yield source.Returned(self.name, stamp.utc_ns, stamp.monotonic_ns, (stamp.monotonic_ns - gap) / SECOND)
        yield self._reading(framed, understood, stamp)
        yield from further

    def _refused(self, error: CmmUqError | source.PortLostError) -> Iterator[source.Event]:
        """Another instrument is there, or the port is lost again: the gap goes on, and a new reason for it is said."""
        self._close_port()
        why = error.problem if isinstance(error, CmmUqError) else str(error)
        if self._told != why:
            self._told, stamp = why, source.Moment.now(self._clock)
            yield source.Gap(self.name, stamp.utc_ns, stamp.monotonic_ns, Verbatim(why))

    def _reading(self, framed: FramedMessage, understood: Understood, stamp: source.Moment) -> source.Reading:
        self._number += 1
        return source.Reading(
            self.name, self._number, stamp.utc_ns, stamp.monotonic_ns, framed.raw, dict(understood.values),
            understood.status, unasked=understood.unasked,
        )  # fmt: skip

    def _rest(self) -> Iterator[source.Event]:
        rest = self._framer.rest()
        if rest is not None:
            self._half = say("it may be the rest of the message before") if self._parser.begins(rest.raw) else None
            yield self._reading(rest, self._parser.read(rest), source.Moment.now(self._clock))

    def _overdue(self, port: source.Port) -> Iterator[source.Event]:
        yield from self._rest()
        asked = bool(self._profile.send.poll)
        why = say("no answer within {s:g} s", s=self._profile.send.answer_within_s) if asked else say("nothing comes")
        if self._conversation.kept_since is not None:
            why = say("it sends without being asked, so that nothing can be asked")
        if self._reopen_when_silent and self._gap_at >= 0:
            yield from self._lost(why)
        else:
            yield from self._silent(why)
            for text in self._profile.send.start:  # an instrument that was switched off has forgotten what it was told
                port.write(bytes_of(text))

    def _silent(self, why: Text) -> Iterator[source.Event]:
        """Say that nothing comes, once for each reason."""
        self._conversation.gap = True
        stamp = source.Moment.now(self._clock)
        if self._gap_at < 0:
            self._gap_at, self._known = stamp.monotonic_ns, False
        if not self._told:
            self._told = why
            yield source.Gap(self.name, stamp.utc_ns, stamp.monotonic_ns, why)

    def _lost(self, why: Text) -> Iterator[source.Event]:
        yield from self._rest()
        self._framer, self._half = Framer(self._profile.frame), None
        self._close_port()
        yield from self._silent(why)

    def _close_port(self) -> None:
        port, self._port = self._port, None
        if port is not None:
            port.close()

    def _reconnected(self) -> Iterator[source.Event]:
        try:
            port = self._opened()
        except CmmUqError:
            self._clock.sleep(RETRY_S)
            return
        self._conversation, self._port = self._begun(), port
        self._conversation.gap = True
        try:
            yield from self._introduced(port, INTRODUCED_WITHIN_S)
        except source.PortLostError:
            self._close_port()
            self._clock.sleep(RETRY_S)
        except CmmUqError as error:
            yield from self._refused(error)
            self._clock.sleep(RETRY_S)

    def _introduced(self, port: source.Port, within_s: float) -> Iterator[source.Event]:
        """Ask which instrument it is and begin; what comes meanwhile is kept."""
        self._byte_at = self._clock.monotonic_ns()
        wanted = self._profile.identify
        if wanted is not None and not isinstance(port, source.ReplayedFile):
            introduction = Introduction(wanted)
            port.write(bytes_of(wanted.send))
            came, lost = self._answers(port, introduction, within_s)
            found = introduction.found
            wrong = None if found is None else another(self._identity, found, self._declared)
            status = None if wrong is None else Verbatim(str(wrong))
            for place, (framed, stamp) in enumerate(came):
                if introduction.tells(place) or wrong is not None:
                    yield self._reading(framed, Understood(status=status), stamp)
                else:
                    yield from self._message(framed, stamp)
            if (failed := wrong or lost) is not None:
                raise failed
            if found is not None:
                said: dict[str, Any] = {key: value for key, value in vars(found).items() if value}
                said |= {"name": self.name, "certificate": self._declared.certificate}
                self._identity, self._known = replace(self._declared, **said), True
        for text in self._profile.send.start:
            port.write(bytes_of(text))

    def _answers(
        self, port: source.Port, introduction: Introduction, within_s: float
    ) -> tuple[list[tuple[FramedMessage, source.Moment]], source.PortLostError | None]:
        """What comes until the instrument has said who it is, or the time is over, or the port is lost."""
        came: list[tuple[FramedMessage, source.Moment]] = []
        until = self._clock.monotonic_ns() + round(within_s * SECOND)
        while introduction.found is None and self._clock.monotonic_ns() < until:
            try:
                received = port.read()
            except source.PortLostError as lost:
                return came, lost
            stamp = source.Moment.now(self._clock)
            for framed in self._framer.feed(received):
                came.append((framed, stamp))
                introduction.hear(framed)
        return came, None

    def _begun(self) -> Conversation:
        replayed = isinstance(self._port, source.ReplayedFile)
        return Conversation(self._profile.send, self._clock.monotonic_ns(), replayed=replayed)


def open_source(
    declared: DeclaredSource, *, clock: source.Clock = source.SYSTEM, folder: Path = Path()
) -> source.LiveSource:
    profile = profile_of_source(declared, folder)
    identity = source.Identity(
        declared.name, profile.maker or None, profile.model or None, declared.serial or None,
        certificate=declared.certificate or None, units=unsaid_units(profile, declared), units_stated=list(declared.units),
    )  # fmt: skip
    if profile.protocol == "ipp":
        return open_machine(identity, profile, declared.port, clock)
    return instrument(identity, profile, declared.port, clock, folder)


def instrument(
    identity: source.Identity, profile: ProfileFile, port: str, clock: source.Clock, folder: Path
) -> LiveInstrument:
    if port.startswith(source.FILE):
        return LiveInstrument(identity, profile, partial(source.ReplayedFile, port, folder, clock), clock)
    far = port.startswith((*source.NETWORK, source.RFC2217, pt104.SCHEME))
    opened = pt104.opener(port) if port.startswith(pt104.SCHEME) else source.opener(port, profile.connection)
    return LiveInstrument(identity, profile, opened, clock, reopen_when_silent=far)


MOST_LINES = 200  # in which an instrument is to say which one it is: each is looked at with all before it


class Introduction:
    def __init__(self, wanted: Identify) -> None:
        self._pattern = re.compile(wanted.pattern)
        self._lines: list[str] = []
        self._span = (0, 0)
        self.found: Identity | None = None  # what it said; ``None`` until it did

    def hear(self, message: FramedMessage) -> None:
        if len(self._lines) == MOST_LINES:
            return
        self._lines.append(message.body.decode("latin-1").strip("\r\n"))
        whole = "\n".join(self._lines)
        found = self._pattern.search(whole)
        if found is not None and self.found is None:
            told = {key: text.strip() for key, text in found.groupdict().items() if text}
            self.found = Identity("", told.get("maker"), told.get("model"), told.get("serial"), told.get("firmware"))
            self._span = whole.count("\n", 0, found.start()), whole.count("\n", 0, max(found.start(), found.end() - 1))

    def tells(self, place: int) -> bool:
        """Whether a message is part of the introduction, counted from 0."""
        return self.found is not None and self._span[0] <= place <= self._span[1]


def another(known: Identity, found: Identity, declared: Identity) -> CmmUqError | None:
    """What is wrong where the serial number is another than that of the job, or of the instrument that was there before."""
    for expected, whose in ((declared.serial, "the job names"), (known.serial, "before it was")):
        if expected and found.serial and expected.casefold() != found.serial.casefold():
            problem = f"another instrument answers: it says serial number {found.serial!r}, {whose} {expected!r}"
            return CmmUqError(problem, where=declared.name, fix="Connect the right one, or correct its serial number")
    return None
