"""A client of I++ DME: session, positions, tools, temperatures, errors, and measuring.

Transactions follow one after the other, each to the end of its answer. No command moves the machine unless its caller allowed
it and confirms each (:class:`Client`, ``confirm``).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence

from cmm_uq.base.errors import CmmUqError
from cmm_uq.laboratory.live.instruments import ipp
from cmm_uq.laboratory.live.instruments.parsing import Framer
from cmm_uq.laboratory.live.instruments.profile import MessageFrame
from cmm_uq.laboratory.live.instruments.source import Clock, Port

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
        self._framer = Framer(MessageFrame(terminator="<CR><LF>", longest=ipp.LONGEST))
        self._commands = self._events = 0
        self._came: deque[ipp.HeardLine] = deque()
        self.unasked: deque[ipp.HeardLine] = deque()
        self.sent: deque[str] = deque(maxlen=_KEPT)

    def call(self, command: str, *, event: bool = False, within_s: float | None = None) -> list[ipp.HeardLine]:
        """Send a command and wait for the end of its transaction, each line in time; its lines of data."""
        if event:
            self._events = self._events % 9999 + 1
            tag = f"E{self._events:04d}"
        else:
            self._commands = self._commands % 99999 + 1
            tag = f"{self._commands:05d}"
        self._port.write(f"{tag} {command}\r\n".encode("ascii"))
        self.sent.append(f"{tag} {command}")
        within_s = self.within_s if within_s is None else within_s
        first = self._answer(tag, command, within_s)
        if first.response is None or first.response.sign != ipp.ACK:
            raise ipp.NoAnswerError(f"{command} was answered {first.raw!r} before it was acknowledged with {ipp.ACK}")
        data, faults = [], []
        while (response := (heard := self._answer(tag, command, within_s)).response) and response.sign != ipp.DONE:
            if response.sign == ipp.ACK:
                raise ipp.NoAnswerError(f"{command} was acknowledged twice")
            if response.sign == ipp.DATA:
                data.append(heard)
                continue
            try:
                faults.append(ipp.fault_of(response.rest))
            except ipp.BadLineError as error:
                raise ipp.NoAnswerError(f"an error that is none of the protocol: {error}") from None
        if stopping := next((fault for fault in faults if fault.stops), None):
            raise ipp.FaultError(stopping)
        return data

    def listen(self) -> bool:
        """Take what comes within a moment; whether anything is in :attr:`unasked`."""
        self._read()
        self.unasked += self._came
        self._came.clear()
        return bool(self.unasked)

    def _answer(self, tag: str, command: str, within_s: float) -> ipp.HeardLine:
        until = self._clock.monotonic_ns() + round(within_s * 1e9)
        while True:
            while self._came:
                heard = self._came.popleft()
                if heard.response is not None and heard.response.tag == tag:
                    return heard
                self.unasked.append(heard)
            if self._clock.monotonic_ns() >= until:
                raise ipp.NoAnswerError(f"{command} was not answered within {within_s:g} s")
            self._read()

    def _read(self) -> None:
        received = self._port.read()
        utc, monotonic = self._clock.utc_ns(), self._clock.monotonic_ns()
        for framed in self._framer.feed(received):
            try:
                response = ipp.response_of(framed.body) if framed.whole else None
            except ipp.BadLineError:
                response = None
            self._came.append(ipp.HeardLine(framed.raw, response, utc, monotonic))

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

    def get(self, *names: str) -> ipp.HeardLine:
        """Ask for what the names say now, ``X``, ``Y``, ``Z`` where none is given."""
        (answer,) = self.call(f"Get({_empty(names or 'XYZ')})")
        return answer

    def on_pt_meas_report(self, *names: str) -> None:
        """Say what is reported of each measured point."""
        self.call(f"OnPtMeasReport({_empty(names)})")

    def on_move_report(self, time_s: float, distance_mm: float, *names: str) -> str:
        """Have positions reported while the machine moves; the tag of the reports, by which :meth:`stop_daemon` ends them."""
        spaced = f"Time({ipp.number_text(max(time_s, 0.1))}), Dis({ipp.number_text(distance_mm)})"
        self.call(f"OnMoveReportE({spaced}, {_empty(names)})", event=True)
        return self.sent[-1].partition(" ")[0]

    def stop_daemon(self, tag: str) -> None:
        self.call(f"StopDaemon({tag})")

    def enable_user(self) -> None:
        """Let the user move the machine and pick points by the joystick."""
        self.call("EnableUser()")

    def tools(self) -> list[str]:
        return [str(ipp.arguments_of(_rest(answer))[0]) for answer in self.call("EnumTools()")]

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
            found = ipp.terms_of(_rest(answer)) if answer is not None else {}
        except ipp.BadLineError as error:
            raise ipp.NoAnswerError(str(error)) from None
        return {axis: value[0] for axis, value in found.items() if value and isinstance(value[0], float)}

    def pt_meas(self, position: Position, normal: Position | None = None) -> ipp.HeardLine:
        """Measure a point, mm: the machine moves; without an outward normal in the direction from the last position."""
        towards = f", IJK({', '.join(map(ipp.number_text, normal))})" if normal else ""
        (answer,) = self._moving(f"PtMeas({_place(position)}{towards})")
        return answer

    def go_to(self, position: Position) -> None:
        """Move there; see :meth:`pt_meas`."""
        self._moving(f"GoTo({_place(position)})")

    def change_tool(self, name: str) -> None:
        """Change the tool: the machine may move; see :meth:`pt_meas`."""
        self._moving(f"ChangeTool({_quoted(name)})")

    def _moving(self, command: str) -> list[ipp.HeardLine]:
        if self._confirm is None:
            fix = "Allow it and confirm each move"
            raise CmmUqError(f"{command} moves the machine, which was not allowed", fix=fix)
        if not self._confirm(command):
            raise CmmUqError(f"{command} was not confirmed: the machine was not moved")
        return self.call(command, within_s=MOVED_WITHIN_S)

    def _unless_unknown(self, command: str) -> ipp.HeardLine | None:
        """Answer to what older servers may not know; ``None`` where this one does not, and goes on."""
        try:
            (answer,) = self.call(command)
        except ipp.FaultError as error:
            if error.fault.number not in NOT_THERE:
                raise
            self.clear_all_errors()
            return None
        return answer

    def _known(self, command: str, name: str) -> str | None:
        answer = self._unless_unknown(command)
        return None if answer is None else str(_first(answer, name))


def _empty(names: Sequence[str]) -> str:
    return ", ".join(f"{name}()" for name in names)


def _place(position: Position) -> str:
    return ", ".join(f"{axis}({ipp.number_text(value)})" for axis, value in zip("XYZ", position, strict=True))


def _quoted(name: str) -> str:
    if not name or any(not 32 <= ord(c) <= 126 or c == '"' for c in name):
        raise CmmUqError(f"{name!r} can be no name of a tool", fix="Name it in ASCII, without quotes")
    return f'"{name}"'


def _rest(heard: ipp.HeardLine) -> str:
    return heard.response.rest if heard.response else ""


def _first(heard: ipp.HeardLine, name: str) -> ipp.Argument:
    """The first that a term of an answer holds."""
    try:
        return ipp.terms_of(_rest(heard))[name][0]
    except (ipp.BadLineError, LookupError):
        raise ipp.NoAnswerError(f"{_rest(heard)!r} where {name}(…) belongs") from None
