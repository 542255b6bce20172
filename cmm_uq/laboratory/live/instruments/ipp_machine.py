"""A CMM as a source: picked points, positions and errors of an I++ DME server as readings; nothing here moves the machine."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Iterator
from dataclasses import replace

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, Verbatim, say
from cmm_uq.laboratory.live.instruments import ipp_client as ipp, source
from cmm_uq.laboratory.live.instruments.ipp_client import ANSWER_WITHIN_S, Client
from cmm_uq.laboratory.live.instruments.profile import Connection, Positions, ProfileFile, shown
from cmm_uq.laboratory.live.instruments.source import SECOND, Event, PortLostError

PORT = 1294  # of an I++ DME server (specification 1.4.3, section 6.1)

AGAIN_WITHIN_S = 0.8
"""Least time for each answer of a server that came back; more where it took more to begin the first time."""

RETRY_S = 0.25  # between two attempts to connect; a return is to be noticed within 2 s

ALIVE_EVERY_S = 1.0
"""How often a server that says nothing is asked whether it is in error: a connection may be dead unnoticed."""

USER_NEEDED = 3
"""Severity of an error from which on the user has to look at the machine (section 8.1): it is not cleared by a program."""

POINT = "PtMeas"
_REPORTED = ("X", "Y", "Z")


def open_machine(identity: source.Identity, profile: ProfileFile, port: str, clock: source.Clock) -> IppMachine:
    if not port.startswith(source.NETWORK):
        fix = f'Give port = "tcp://host:{PORT}"'
        raise CmmUqError("a CMM by I++ DME is reached over the network", where=port or identity.name, fix=fix)
    return IppMachine(identity, profile.ipp, source.opener(port, Connection(), tcp_port=PORT), clock)


class IppMachine:
    """``identity``: what the job says of it; ``asked``: what the server is asked for."""

    def __init__(
        self, identity: source.Identity, asked: Positions, opened: source.PortOpener, clock: source.Clock
    ) -> None:
        self.name, self._identity, self._asked = identity.name, identity, asked
        self._opened, self._clock = opened, clock
        self._clear, self._user_needed = threading.Event(), False
        self._number, self._gap_at, self._closed = 0, -1, False
        self._port = opened()
        self._connected = True
        self.client, began = Client(self._port, clock), clock.monotonic_ns()
        try:
            self._begin(take_over=False)
        except ipp.FaultError as error:
            self._port.close()
            fix = "End the session of the other program, and clear the machine's errors"
            raise CmmUqError(f"the server refuses: {error}", where=self.name, fix=fix) from None
        except (ipp.NoAnswerError, PortLostError) as error:
            self._port.close()
            fix = "Check that the port is that of the I++ DME server, usually 1294"
            raise CmmUqError(f"no I++ DME server answers: {error}", where=self.name, fix=fix) from None
        took_s = (clock.monotonic_ns() - began) / SECOND
        self._again_within_s = min(max(AGAIN_WITHIN_S, took_s), ANSWER_WITHIN_S)

    def identity(self) -> source.Identity:
        return self._identity

    def clear_errors(self) -> None:
        """Let the server go on after an error that needs the user, who has looked at it; from any thread."""
        self._clear.set()

    def close(self) -> None:
        self._closed = True
        if self._connected:
            with contextlib.suppress(ipp.NoAnswerError, ipp.FaultError, PortLostError):
                self.client.end_session()
            self._port.close()
            self._connected = False

    def events(self, stop: threading.Event) -> Iterator[Event]:
        while not stop.is_set() and not self._closed:
            if not self._connected:
                yield from self._reconnected()
                continue
            try:
                yield from self._step()
            except (PortLostError, ipp.NoAnswerError) as error:
                if not self._closed:
                    yield from self._lost(say("the connection was lost: {why}", why=Verbatim(str(error))))

    def _begin(self, *, take_over: bool) -> None:
        client = self.client
        client.start_session(take_over=take_over)
        version, kind = client.version(), client.machine_class()
        client.on_pt_meas_report(*_REPORTED)
        if self._asked.user:
            client.enable_user()
        if self._asked.moves:
            client.on_move_report(0.1, 0.1, *_REPORTED)
        told = " ".join(filter(None, ("I++ DME", version)))
        self._identity = replace(self._identity, model=self._identity.model or kind, firmware=told)
        self._ask_at = self._alive_at = self._clock.monotonic_ns()

    def _step(self) -> Iterator[Event]:
        now = self._clock.monotonic_ns()
        if self._clear.is_set():
            self._clear.clear()
            self._user_needed = False
            self.client.clear_all_errors()
        if self._asked.every_s and now >= self._ask_at:
            self._ask_at = max(self._ask_at + round(self._asked.every_s * SECOND), now)
            yield from self._position()
        elif now >= self._alive_at:
            self._alive_at = now + round(ALIVE_EVERY_S * SECOND)
            self.client.in_error()
        self.client.listen()
        yield from self._unasked()

    def _position(self) -> Iterator[Event]:
        try:
            heard = self.client.get(*_REPORTED)
        except ipp.FaultError as error:
            if error.fault.severity < USER_NEEDED and not self._user_needed:
                self.client.clear_all_errors()
            nothing = ipp.HeardLine(b"", None, self._clock.utc_ns(), self._clock.monotonic_ns())
            yield self._reading(nothing, status=say("the machine says {what}", what=Verbatim(str(error.fault))))
            return
        yield from self._unasked()
        yield from self._told_by(heard)

    def _unasked(self) -> Iterator[Event]:
        while self.client.unasked:
            yield from self._told_by(self.client.unasked.popleft())

    def _told_by(self, heard: ipp.HeardLine) -> Iterator[Event]:
        response = heard.response
        if response is None:
            seen = Verbatim(shown(heard.raw[:60]))
            yield self._reading(heard, status=say("no line of I++ DME: {seen}", seen=seen))
        elif response.sign == ipp.DATA:
            yield self._data(heard, response.rest)
        elif response.sign == ipp.ERROR:
            try:
                fault = ipp.fault_of(response.rest)
                self._user_needed = self._user_needed or fault.severity >= USER_NEEDED
                status = say("the machine says {what}", what=Verbatim(str(fault)))
            except ipp.BadLineError as error:
                status = say("an error that is none of the protocol: {why}", why=Verbatim(str(error)))
            yield self._reading(heard, status=status)

    def _data(self, heard: ipp.HeardLine, rest: str) -> source.Reading:
        """Data of a point, a position, or something else that is no place."""
        point = None
        try:
            found = ipp.arguments_of(rest)
            if len(found) == 1 and isinstance(found[0], ipp.Term) and found[0].name == POINT:
                point, found = POINT, found[0].arguments
            terms = ipp.terms_of(found)
        except ipp.BadLineError as error:
            return self._reading(heard, status=say("not understood: {why}", why=Verbatim(str(error))))
        values = {
            f"{axis.lower()}_mm": place[0]
            for axis in _REPORTED
            if len(place := terms.get(axis, ())) == 1 and isinstance(place[0], float)
        }
        if len(values) == len(_REPORTED):
            return self._reading(heard, values, point=point)
        if point is None and not set(_REPORTED) & set(terms):
            return self._reading(heard)  # a key, a tool: nothing that is measured
        return self._reading(heard, status=say("a place without X, Y and Z: {seen}", seen=Verbatim(rest)))

    def _reading(
        self, heard: ipp.HeardLine, values: dict[str, float] | None = None, *, status: Text | None = None,
        point: str | None = None,
    ) -> source.Reading:  # fmt: skip
        self._number += 1
        times = heard.utc_ns, heard.monotonic_ns
        return source.Reading(self.name, self._number, *times, heard.raw, values or {}, status, point)

    def _lost(self, why: Text) -> Iterator[Event]:
        yield from self._unasked()
        self._port.close()
        self._connected = False
        if self._gap_at < 0:
            self._gap_at = self._clock.monotonic_ns()
            yield source.Gap(self.name, self._clock.utc_ns(), self._gap_at, why)

    def _reconnected(self) -> Iterator[Event]:
        """Try once; the session before was this one's own, so it is ended."""
        try:
            self._port = self._opened()
        except CmmUqError:
            self._clock.sleep(RETRY_S)
            return
        self.client = Client(self._port, self._clock, within_s=self._again_within_s)
        try:
            self._begin(take_over=True)
        except (ipp.NoAnswerError, ipp.FaultError, PortLostError):
            self._port.close()
            self._clock.sleep(RETRY_S)
            return
        self._connected, self.client.within_s = True, ANSWER_WITHIN_S
        now, gap, self._gap_at = self._clock.monotonic_ns(), self._gap_at, -1
        yield source.Returned(self.name, self._clock.utc_ns(), now, (now - gap) / SECOND)
