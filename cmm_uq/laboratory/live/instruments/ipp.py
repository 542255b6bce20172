"""I++ DME (VDMA 8722): its lines.

Lines are by the syntax of specification 1.4.3, section 6.1.4: terms such as ``X(12.5)``, and responses with tags and a sign:
``&`` accepts a command, ``#`` brings data, ``!`` an error, ``%`` ends the transaction.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal, cast

ACK, DATA, ERROR, DONE = "&", "#", "!", "%"
Sign = Literal["&", "#", "!", "%"]
LONGEST = 65536  # characters of a line (section 6.2)
MOST_DIGITS = 16  # of a number (section 6.1.4.2)
_RESPONSE = re.compile(r"(?P<tag>\d{5}|E\d{4}) (?P<sign>[&#!%])(?: (?P<rest>.*))?")
_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[Ee][+-]?\d{1,3})?")
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9]*(?:\.[A-Za-z][A-Za-z0-9]*)*")
_TOKEN = re.compile(
    rf' *(?:(?P<number>{_NUMBER.pattern})|(?P<name>{_NAME.pattern})|"(?P<text>[^"]*)"|(?P<sign>[(),])) *'
)
_DEEPEST = 10
_END, _CLOSED = ("end", ""), ("sign", ")")


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
    if tokens[place] != _END:
        raise BadLineError(f"something follows the end: {text}")
    return found


def terms_of(data: str | tuple[Argument, ...]) -> dict[str, tuple[Argument, ...]]:
    """Data whose parts all are terms, by their names."""
    found = arguments_of(data) if isinstance(data, str) else data
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
    return [*found, ("end", "")]


def _list(tokens: list[tuple[str, str]], place: int, depth: int) -> tuple[tuple[Argument, ...], int]:
    """Arguments from a place on, and the place behind them."""
    if depth > _DEEPEST:
        raise BadLineError("brackets are nested too deeply")
    found: list[Argument] = []
    while found or tokens[place] not in (_END, _CLOSED):
        argument, place = _argument(tokens, place, depth)
        found.append(argument)
        if tokens[place] != ("sign", ","):
            break
        place += 1
    return tuple(found), place


def _argument(tokens: list[tuple[str, str]], place: int, depth: int) -> tuple[Argument, int]:
    kind, text = tokens[place]
    if kind == "number":
        if sum(c.isdigit() for c in re.split("[Ee]", text)[0]) > MOST_DIGITS:
            raise BadLineError(f"a number of more than {MOST_DIGITS} digits")
        return float(text), place + 1
    if kind not in ("text", "name"):
        raise BadLineError(f"{text!r} where a number, a text or a name belongs")
    if kind == "text" or tokens[place + 1] != ("sign", "("):
        return text, place + 1
    inside, place = _list(tokens, place + 2, depth + 1)
    if tokens[place] != _CLOSED:
        raise BadLineError("a bracket is not closed")
    return Term(text, inside), place + 1


def number_text(value: float) -> str:
    """A number as it is sent: 16 digits at most, no more than are needed."""
    return f"{value:.12g}"


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
