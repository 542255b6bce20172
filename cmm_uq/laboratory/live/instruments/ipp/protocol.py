"""I++ DME (VDMA 8722): its lines, and transactions, one command after the other, each to the end of its answer.

Lines are by the syntax of specification 1.4.3, section 6.1.4: terms such as ``X(12.5)``, and responses with tags and a sign:
``&`` accepts a command, ``#`` brings data, ``!`` an error, ``%`` ends the transaction.
"""

from __future__ import annotations

import re
from collections import deque
from dataclasses import dataclass
from typing import Literal, cast

from cmm_uq.laboratory.live.instruments.conversation import SECOND
from cmm_uq.laboratory.live.instruments.parsing import Framer
from cmm_uq.laboratory.live.instruments.profile import MessageFrame
from cmm_uq.laboratory.live.instruments.source import Clock, Port

ACK, DATA, ERROR, DONE = "&", "#", "!", "%"
Sign = Literal["&", "#", "!", "%"]
END = b"\r\n"
LONGEST = 65536  # characters of a line (section 6.2)
MOST_DIGITS = 16  # of a number (section 6.1.4.2)
_RESPONSE = re.compile(r"(?P<tag>\d{5}|E\d{4}) (?P<sign>[&#!%])(?: (?P<rest>.*))?")
_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[Ee][+-]?\d{1,3})?")
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9]*(?:\.[A-Za-z][A-Za-z0-9]*)*")
_TOKEN = re.compile(
    rf' *(?:(?P<number>{_NUMBER.pattern})|(?P<name>{_NAME.pattern})|"(?P<text>[^"]*)"|(?P<sign>[(),])) *'
)
_DEEPEST = 10


class BadLineError(ValueError):
    """A line that is none of the protocol."""


@dataclass(frozen=True)
class Term:
    """A name with arguments: ``X(12.5)``, ``PtMeas(X(1), Y(2), Z(3))``."""

    name: str
    arguments: tuple[Argument, ...] = ()


Argument = float | str | Term  # A number, a text or a bare name, or a term


@dataclass(frozen=True)
class ServerLine:
    """A line of the server."""

    tag: str
    sign: Sign
    rest: str = ""


@dataclass(frozen=True)
class Fault:
    """An error of the server (section 8)."""

    severity: int  # 0 info, 1 warning, 2 error that the client may repair, 3 error that needs the user, 9 fatal
    number: int  # by the table of the specification
    cause: str  # method that it comes from
    text: str

    @property
    def stops(self) -> bool:
        """Whether errors must be cleared before the server goes on."""
        return self.severity >= 2

    def __str__(self) -> str:
        return f"error {self.number:04d} of {self.cause}, severity {self.severity}: {self.text}"


def response_of(line: bytes) -> ServerLine:
    """A line without its end."""
    if any(not 32 <= byte <= 126 for byte in line):
        raise BadLineError("a character outside ASCII 32 to 126")
    found = _RESPONSE.fullmatch(line.decode("ascii"))
    if found is None or found["tag"] == "00000":
        raise BadLineError("no tag of five characters with a blank and one of & # ! % behind it")
    return ServerLine(found["tag"], cast("Sign", found["sign"]), found["rest"] or "")


def arguments_of(text: str) -> tuple[Argument, ...]:
    """Arguments, or data, with commas between them."""
    tokens = _tokens(text)
    found, place = _list(tokens, 0, 0)
    if place != len(tokens):
        raise BadLineError(f"something follows the end: {text}")
    return found


def terms_of(text: str) -> dict[str, tuple[Argument, ...]]:
    """Data whose parts all are terms, by their names."""
    found = arguments_of(text)
    return by_name(found)


def by_name(found: tuple[Argument, ...]) -> dict[str, tuple[Argument, ...]]:
    """Terms by their names."""
    terms = {one.name: one.arguments for one in found if isinstance(one, Term)}
    if len(terms) < len(found):
        raise BadLineError("not terms alone, each of a name of its own")
    return terms


def fault_of(rest: str) -> Fault:
    """What a line with ``!`` says; the method may stand in quotes, as the syntax has it, or without, as the examples."""
    found = arguments_of(rest)
    given = found[0].arguments if len(found) == 1 and isinstance(found[0], Term) and found[0].name == "Error" else ()
    if len(given) != 4 or not isinstance(given[0], float) or not isinstance(given[1], float):
        raise BadLineError(f"no Error(severity, number, method, text): {rest}")
    cause, text = (one.name if isinstance(one, Term) else str(one) for one in given[2:])
    return Fault(int(given[0]), int(given[1]), cause, text)


def _tokens(text: str) -> list[tuple[str, str]]:
    found, place = [], 0
    while place < len(text):
        token = _TOKEN.match(text, place)
        if token is None:
            raise BadLineError(f"not understood from {text[place : place + 20]!r}")
        kind = cast("str", token.lastgroup)
        found.append((kind, token[kind]))
        place = token.end()
    return found


def _list(tokens: list[tuple[str, str]], place: int, depth: int) -> tuple[tuple[Argument, ...], int]:
    """Arguments from a place on, and the place behind them."""
    if depth > _DEEPEST:
        raise BadLineError("brackets are nested too deeply")
    found: list[Argument] = []
    if place >= len(tokens) or tokens[place] == ("sign", ")"):
        return (), place
    while True:
        argument, place = _argument(tokens, place, depth)
        found.append(argument)
        if place >= len(tokens) or tokens[place] != ("sign", ","):
            return tuple(found), place
        place += 1


def _argument(tokens: list[tuple[str, str]], place: int, depth: int) -> tuple[Argument, int]:
    kind, text = tokens[place] if place < len(tokens) else ("", "")
    if kind == "number":
        if sum(c.isdigit() for c in re.split("[Ee]", text)[0]) > MOST_DIGITS:
            raise BadLineError(f"a number of more than {MOST_DIGITS} digits")
        return float(text), place + 1
    if kind == "text":
        return text, place + 1
    if kind != "name":
        raise BadLineError(f"{text!r} where a number, a text or a name belongs")
    if place + 1 >= len(tokens) or tokens[place + 1] != ("sign", "("):
        return text, place + 1
    inside, place = _list(tokens, place + 2, depth + 1)
    if place >= len(tokens) or tokens[place] != ("sign", ")"):
        raise BadLineError("a bracket is not closed")
    return Term(text, inside), place + 1


def number_text(value: float) -> str:
    """A number as it is sent: 16 digits at most, no more than are needed."""
    return f"{value:.12g}"


ANSWER_WITHIN_S = 2.0  # time for the acknowledgement, and for data of what does not move the machine
_KEPT = 1000  # lines sent that are remembered


class FaultError(Exception):
    """The server answered a command with an error."""

    def __init__(self, fault: Fault) -> None:
        self.fault = fault
        super().__init__(str(fault))


class NoAnswerError(Exception):
    """The server did not answer in time, or not by the protocol."""


@dataclass(frozen=True)
class HeardLine:
    """A line that came, with its time, ns by both clocks."""

    raw: bytes
    response: ServerLine | None  # what it is; ``None`` where it is none of the protocol
    utc_ns: int
    monotonic_ns: int


class Transactions:
    """Transactions with one server; ``unasked`` are lines that answer no command, or are no response."""

    def __init__(self, port: Port, clock: Clock, within_s: float = ANSWER_WITHIN_S) -> None:
        self._port, self._clock, self.within_s = port, clock, within_s
        self._framer = Framer(MessageFrame(terminator="<CR><LF>", longest=LONGEST))
        self._tag, self._event = 0, 0
        self._came: deque[HeardLine] = deque()
        self.unasked: deque[HeardLine] = deque()
        self.sent: deque[str] = deque(maxlen=_KEPT)

    def call(self, command: str, *, event: bool = False, within_s: float | None = None) -> list[HeardLine]:
        """Send a command and wait for the end of its transaction; its lines of data."""
        tag = self._next_event() if event else self._next_tag()
        self._port.write(f"{tag} {command}\r\n".encode("ascii"))
        self.sent.append(f"{tag} {command}")
        data: list[HeardLine] = []
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

    def _answer(self, tag: str, command: str, within_s: float) -> HeardLine:
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
            self._came.append(HeardLine(framed.raw, response, utc, monotonic))

    def _next_tag(self) -> str:
        self._tag = self._tag % 99999 + 1
        return f"{self._tag:05d}"

    def _next_event(self) -> str:
        self._event = self._event % 9999 + 1
        return f"E{self._event:04d}"


def _fault(response: ServerLine) -> Fault:
    try:
        return fault_of(response.rest)
    except BadLineError as error:
        raise NoAnswerError(f"an error that is none of the protocol: {error}") from None
