"""I++ DME (VDMA 8722): its lines, and a client: session, positions, tools, temperatures, errors, and measuring.

Lines are by the syntax of specification 1.4.3, section 6.1.4: terms such as ``X(12.5)``, and responses with tags and a sign:
``&`` accepts a command, ``#`` brings data, ``!`` an error, ``%`` ends the transaction. Transactions follow one after the
other, each to the end of its answer. No command moves the machine unless its caller allowed it and confirms each
(:class:`Client`, ``confirm``).
"""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Callable, Sequence
from itertools import count

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.values import dataclass
from cmm_uq.laboratory.live.instruments.parsing import Framer
from cmm_uq.laboratory.live.instruments.profile import MessageFrame
from cmm_uq.laboratory.live.instruments.source import Clock, Port

ACK, DATA, ERROR, DONE = "&", "#", "!", "%"
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
    sign: str
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
    return ServerLine(found["tag"], found["sign"], found["rest"] or "")


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
        kind = str(token.lastgroup)
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


ANSWER_WITHIN_S = 2.0  # time for the acknowledgement, and for data of what does not move the machine
MOVED_WITHIN_S = 300.0  # time for what moves it
NOT_THERE = frozenset({501, 502, 505, 506, 507, 509, 510})
"""Errors by which a server says that it does not know a command, an argument or a property (section 8.2)."""

_KEPT = 1000  # lines sent that are remembered
Position = tuple[float, float, float]


class Client:
    """A client of one server.

    ``confirm``: asked before each command that moves the machine, with the command; ``None``: nothing ever moves;
    ``unasked``: lines that answer no command: events, reports of daemons, errors by themselves, and what is no response.
    """

    def __init__(
        self, port: Port, clock: Clock, *, confirm: Callable[[str], bool] | None = None, within_s: float = ANSWER_WITHIN_S
    ) -> None:  # fmt: skip
        self._port, self._clock, self._confirm, self.within_s = port, clock, confirm, within_s
        self._framer = Framer(MessageFrame(terminator="<CR><LF>", longest=LONGEST))
        self._commands, self._events = count(), count()
        self._came: deque[HeardLine] = deque()
        self.unasked: deque[HeardLine] = deque()
        self.sent: deque[str] = deque(maxlen=_KEPT)

    def call(self, command: str, *, event: bool = False, within_s: float | None = None) -> list[HeardLine]:
        """Send a command and wait for the end of its transaction, each line in time; its lines of data."""
        tag = f"E{next(self._events) % 9999 + 1:04d}" if event else f"{next(self._commands) % 99999 + 1:05d}"
        self._port.write(f"{tag} {command}\r\n".encode("ascii"))
        self.sent.append(f"{tag} {command}")
        within_s = self.within_s if within_s is None else within_s
        first = self._answer(tag, command, within_s)
        if first.response is None or first.response.sign != ACK:
            raise NoAnswerError(f"{command} was answered {first.raw!r} before it was acknowledged with {ACK}")
        data, faults = [], []
        while (response := (heard := self._answer(tag, command, within_s)).response) and response.sign != DONE:
            if response.sign == ACK:
                raise NoAnswerError(f"{command} was acknowledged twice")
            if response.sign == DATA:
                data.append(heard)
                continue
            try:
                faults.append(fault_of(response.rest))
            except BadLineError as error:
                raise NoAnswerError(f"an error that is none of the protocol: {error}") from None
        if stopping := next((fault for fault in faults if fault.stops), None):
            raise FaultError(stopping)
        return data

    def listen(self) -> bool:
        """Take what comes within a moment; whether anything is in :attr:`unasked`."""
        self._read()
        self.unasked += self._came
        self._came.clear()
        return bool(self.unasked)

    def _answer(self, tag: str, command: str, within_s: float) -> HeardLine:
        until = self._clock.monotonic_ns() + round(within_s * 1e9)
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

    def start_session(self, *, take_over: bool = False) -> None:
        """Begin; with ``take_over`` after ending one that is active, such as one's own that was cut off."""
        if take_over:
            self.end_session()
        self.call("StartSession()")

    def end_session(self) -> None:
        """End; daemons end with it."""
        self.call("EndSession()")

    def version(self) -> str | None:
        """Version of the specification that the server implements; ``None`` before 1.4, which does not know the question."""
        return self._known("GetDMEVersion()", "DMEVersion")

    def machine_class(self) -> str | None:
        """``CartCMM`` or another."""
        return self._known("GetMachineClass()", "GetMachineClass")

    def in_error(self) -> bool:
        """Whether the server waits for its errors to be cleared."""
        (answer,) = self.call("GetErrStatusE()", event=True)
        return _first(answer, "ErrStatus") == 1.0

    def clear_all_errors(self) -> None:
        """Let the server go on after an error."""
        self.call("ClearAllErrors()")

    def abort(self) -> None:
        """Stop all motion as soon as possible, and let the server go on."""
        self.call("AbortE()", event=True)
        self.clear_all_errors()

    def get(self, *names: str) -> HeardLine:
        """Ask for what the names say now, ``X``, ``Y``, ``Z`` where none is given."""
        (answer,) = self.call(f"Get({_empty(names or 'XYZ')})")
        return answer

    def on_pt_meas_report(self, *names: str) -> None:
        """Say what is reported of each measured point."""
        self.call(f"OnPtMeasReport({_empty(names)})")

    def on_move_report(self, time_s: float, distance_mm: float, *names: str) -> str:
        """Have positions reported while the machine moves; the tag of the reports, by which :meth:`stop_daemon` ends them."""
        spaced = f"Time({number_text(max(time_s, 0.1))}), Dis({number_text(distance_mm)})"
        self.call(f"OnMoveReportE({spaced}, {_empty(names)})", event=True)
        return self.sent[-1].partition(" ")[0]

    def stop_daemon(self, tag: str) -> None:
        self.call(f"StopDaemon({tag})")

    def enable_user(self) -> None:
        """Let the user move the machine and pick points by the joystick."""
        self.call("EnableUser()")

    def tools(self) -> list[str]:
        return [str(arguments_of(_rest(answer))[0]) for answer in self.call("EnumTools()")]

    def tool(self) -> str:
        (answer,) = self.call("GetProp(Tool.Name())")
        return str(_first(answer, "Tool.Name"))

    def find_tool(self, name: str) -> None:
        """Look for a tool; error 1502 where there is none of this name."""
        self.call(f"FindTool({_quoted(name)})")

    def part_temperature(self) -> float | None:
        """Temperature of the part, °C, as section 9.6 of 1.4.3 announces it; ``None`` where the server has none."""
        celsius = self._known("GetProp(Part.Temperature())", "Part.Temperature")
        return None if celsius is None else float(celsius)

    def scale_temperatures(self) -> dict[str, float]:
        """Temperatures of the scales by axis, °C, as servers of VDMA 8722 (2.5) give them; empty where the server has none."""
        answer = self._unless_unknown("GetScaleTemperatures(X(), Y(), Z())")
        try:
            found = terms_of(_rest(answer)) if answer is not None else {}
        except BadLineError as error:
            raise NoAnswerError(str(error)) from None
        return {axis: value[0] for axis, value in found.items() if value and isinstance(value[0], float)}

    def pt_meas(self, position: Position, normal: Position | None = None) -> HeardLine:
        """Measure a point, mm: the machine moves; without an outward normal in the direction from the last position."""
        towards = f", IJK({', '.join(map(number_text, normal))})" if normal else ""
        (answer,) = self._moving(f"PtMeas({_place(position)}{towards})")
        return answer

    def go_to(self, position: Position) -> None:
        """Move there; see :meth:`pt_meas`."""
        self._moving(f"GoTo({_place(position)})")

    def change_tool(self, name: str) -> None:
        """Change the tool: the machine may move; see :meth:`pt_meas`."""
        self._moving(f"ChangeTool({_quoted(name)})")

    def _moving(self, command: str) -> list[HeardLine]:
        if self._confirm is None:
            fix = "Allow it and confirm each move"
            raise CmmUqError(f"{command} moves the machine, which was not allowed", fix=fix)
        if not self._confirm(command):
            raise CmmUqError(f"{command} was not confirmed: the machine was not moved")
        return self.call(command, within_s=MOVED_WITHIN_S)

    def _unless_unknown(self, command: str) -> HeardLine | None:
        """Answer to what older servers may not know; ``None`` where this one does not, and goes on."""
        try:
            (answer,) = self.call(command)
        except FaultError as error:
            if error.fault.number not in NOT_THERE:
                raise
            self.clear_all_errors()
            return None
        return answer

    def _known(self, command: str, name: str) -> str | None:
        return None if (answer := self._unless_unknown(command)) is None else str(_first(answer, name))


def _empty(names: Sequence[str]) -> str:
    return ", ".join(f"{name}()" for name in names)


def _place(position: Position) -> str:
    return ", ".join(f"{axis}({number_text(value)})" for axis, value in zip("XYZ", position, strict=True))


def _quoted(name: str) -> str:
    if not name or any(not 32 <= ord(c) <= 126 or c == '"' for c in name):
        raise CmmUqError(f"{name!r} can be no name of a tool", fix="Name it in ASCII, without quotes")
    return f'"{name}"'


def _rest(heard: HeardLine) -> str:
    return heard.response.rest if heard.response else ""


def _first(heard: HeardLine, name: str) -> Argument:
    """The first that a term of an answer holds."""
    try:
        return terms_of(_rest(heard))[name][0]
    except (BadLineError, LookupError):
        raise NoAnswerError(f"{_rest(heard)!r} where {name}(…) belongs") from None
