"""Transactions of I++ DME: one command after the other, each to the end of its answer; what comes unasked is kept."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

from cmm_uq.laboratory.live.instruments.conversation import SECOND
from cmm_uq.laboratory.live.instruments.framing import Framer
from cmm_uq.laboratory.live.instruments.ipp.line import (
    ACK,
    DATA,
    ERROR,
    LONGEST,
    BadLineError,
    Fault,
    Response,
    fault_of,
    response_of,
)
from cmm_uq.laboratory.live.instruments.port import Port
from cmm_uq.laboratory.live.instruments.profile import Frame
from cmm_uq.laboratory.live.instruments.source import Clock

ANSWER_WITHIN_S = 2.0
"""Time for the acknowledgement, and for data of what does not move the machine."""

_KEPT = 1000
"""Lines sent that are remembered."""


class FaultError(Exception):
    """The server answered a command with an error."""

    def __init__(self, fault: Fault) -> None:
        self.fault = fault
        super().__init__(str(fault))


class NoAnswerError(Exception):
    """The server did not answer in time, or not by the protocol."""


@dataclass(frozen=True)
class Heard:
    """A line that came, with its time, ns by both clocks.

    Parameters
    ----------
    raw : with its end.
    response : what it is; ``None`` where it is none of the protocol.
    """

    raw: bytes
    response: Response | None
    utc_ns: int
    monotonic_ns: int


class Transactions:
    """Transactions with one server.

    Parameters
    ----------
    port : connected to the server.
    clock : for stamps and patience.
    within_s : usual time to each line of an answer.

    Attributes
    ----------
    unasked : lines that answer no command: events, reports of daemons, errors by themselves, and what is no response.
    sent : the last lines that were sent.
    """

    def __init__(self, port: Port, clock: Clock, within_s: float = ANSWER_WITHIN_S) -> None:
        self._port, self._clock, self.within_s = port, clock, within_s
        self._framer = Framer(Frame(terminator="<CR><LF>", longest=LONGEST))
        self._tag, self._event = 0, 0
        self._came: deque[Heard] = deque()
        self.unasked: deque[Heard] = deque()
        self.sent: deque[str] = deque(maxlen=_KEPT)

    def call(self, command: str, *, event: bool = False, within_s: float | None = None) -> list[Heard]:
        """Send a command and wait for the end of its transaction.

        Parameters
        ----------
        command : a method with its arguments.
        event : whether it is one for the fast queue, whose tag begins with E.
        within_s : time to each line of the answer; the usual one where it is left out.

        Returns
        -------
        its lines of data.

        Raises
        ------
        FaultError : the server says an error of severity 2 or more, or that does not know the command.
        NoAnswerError : it does not answer in time, or not by the protocol.
        PortLostError : the connection is gone.
        """
        tag = self._next_event() if event else self._next_tag()
        self._port.write(f"{tag} {command}\r\n".encode("ascii"))
        self.sent.append(f"{tag} {command}")
        data: list[Heard] = []
        faults: list[Fault] = []
        acknowledged = False
        while True:
            heard = self._answer(tag, command, self.within_s if within_s is None else within_s)
            response = heard.response
            if response is None or (response.sign != ACK and not acknowledged):
                raise NoAnswerError(f"{command} was answered {heard.raw!r} before it was acknowledged with {ACK}")
            if response.sign == ACK:
                if acknowledged:
                    raise NoAnswerError(f"{command} was acknowledged twice")
                acknowledged = True
            elif response.sign == DATA:
                data.append(heard)
            elif response.sign == ERROR:
                faults.append(_fault(response))
            else:
                break
        stopping = [fault for fault in faults if fault.stops]
        if stopping:
            raise FaultError(stopping[0])
        return data

    def listen(self) -> bool:
        """Take what comes within a moment; whether anything is in :attr:`unasked`."""
        self._read()
        while self._came:
            self.unasked.append(self._came.popleft())
        return bool(self.unasked)

    def _answer(self, tag: str, command: str, within_s: float) -> Heard:
        """The next line with this tag; others are kept."""
        until = self._clock.monotonic_ns() + round(within_s * SECOND)
        while True:
            while self._came:
                heard = self._came.popleft()
                if heard.response is not None and heard.response.tag == tag:
                    return heard
                self.unasked.append(heard)
            if self._clock.monotonic_ns() >= until:
                raise NoAnswerError(f"{command} was not answered within {within_s:g} s")
            self._read()

    def _read(self) -> None:
        received = self._port.read()
        utc, monotonic = self._clock.utc_ns(), self._clock.monotonic_ns()
        for framed in self._framer.feed(received):
            try:
                response = response_of(framed.body) if framed.whole else None
            except BadLineError:
                response = None
            self._came.append(Heard(framed.raw, response, utc, monotonic))

    def _next_tag(self) -> str:
        self._tag = self._tag % 99999 + 1
        return f"{self._tag:05d}"

    def _next_event(self) -> str:
        self._event = self._event % 9999 + 1
        return f"E{self._event:04d}"


def _fault(response: Response) -> Fault:
    try:
        return fault_of(response.rest)
    except BadLineError as error:
        raise NoAnswerError(f"an error that is none of the protocol: {error}") from None
