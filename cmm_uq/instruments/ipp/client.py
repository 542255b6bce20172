"""A client of I++ DME: one command after the other, each to the end of its transaction; what comes unasked is kept.

No command moves the machine unless its caller allowed it and confirms each (:class:`Client`, ``confirm``).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from cmm_uq.errors import CmmUqError
from cmm_uq.instruments.conversation import SECOND
from cmm_uq.instruments.framing import Framer
from cmm_uq.instruments.ipp.line import (
    ACK,
    DATA,
    ERROR,
    LONGEST,
    BadLineError,
    Fault,
    Response,
    Term,
    arguments_of,
    fault_of,
    number_text,
    response_of,
    terms_of,
)
from cmm_uq.instruments.ports import Port
from cmm_uq.instruments.profile import Frame
from cmm_uq.instruments.source import Clock

ANSWER_WITHIN_S = 2.0
"""Time for the acknowledgement, and for data of what does not move the machine."""

MOVED_WITHIN_S = 300.0
"""Time for what moves it."""

NOT_THERE = range(500, 512)
"""Errors by which a server says that it does not know a command or a property."""

_KEPT = 1000
Position = tuple[float, float, float]


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


class Client:
    """A client of one server.

    Parameters
    ----------
    port : connected to the server.
    clock : for stamps and patience.
    confirm : asked before each command that moves the machine, with the command; ``None``: nothing ever moves.
    within_s : usual time to each line of an answer.

    Attributes
    ----------
    unasked : lines that answer no command: events, reports of daemons, errors by themselves, and what is no response.
    sent : the last lines that were sent.
    """

    def __init__(
        self, port: Port, clock: Clock, *, confirm: Callable[[str], bool] | None = None, within_s: float = ANSWER_WITHIN_S
    ) -> None:  # fmt: skip
        self._port, self._clock, self._confirm, self.within_s = port, clock, confirm, within_s
        self._framer = Framer(Frame(terminator="<CR><LF>", longest=LONGEST))
        self._tag, self._event = 0, 0
        self._came: deque[Heard] = deque()
        self.unasked: deque[Heard] = deque()
        self.sent: deque[str] = deque(maxlen=_KEPT)

    # --- transactions -------------------------------------------------------------------------------------------------------

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

    # --- session and errors -------------------------------------------------------------------------------------------------

    def start_session(self, *, take_over: bool = False) -> None:
        """Begin.

        Parameters
        ----------
        take_over : end a session that is active, such as one's own that was cut off.
        """
        if take_over:
            self.call("EndSession()")
        self.call("StartSession()")

    def end_session(self) -> None:
        """End; daemons end with it."""
        self.call("EndSession()")

    def version(self) -> str | None:
        """Version of the specification that the server implements; ``None`` before 1.4, which does not know the question."""
        (answer,) = self._known("GetDMEVersion()") or (None,)
        return None if answer is None else str(_arguments(answer, "DMEVersion")[0])

    def machine_class(self) -> str | None:
        """``CartCMM`` or another."""
        (answer,) = self._known("GetMachineClass()") or (None,)
        return None if answer is None else str(_arguments(answer, "GetMachineClass")[0])

    def in_error(self) -> bool:
        """Whether the server waits for its errors to be cleared."""
        (answer,) = self.call("GetErrStatusE()", event=True)
        return _arguments(answer, "ErrStatus")[0] == 1.0

    def clear_all_errors(self) -> None:
        """Let the server go on after an error."""
        self.call("ClearAllErrors()")

    def abort(self) -> None:
        """Stop all motion as soon as possible, and let the server go on."""
        self.call("AbortE()", event=True)
        self.clear_all_errors()

    # --- positions ----------------------------------------------------------------------------------------------------------

    def get(self, *names: str) -> Heard:
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
        """End reports."""
        self.call(f"StopDaemon({tag})")

    def enable_user(self) -> None:
        """Let the user move the machine and pick points by the joystick."""
        self.call("EnableUser()")

    # --- tools and temperatures ---------------------------------------------------------------------------------------------

    def tools(self) -> list[str]:
        """Names of the tools that may be chosen."""
        return [str(arguments_of(_rest(answer))[0]) for answer in self.call("EnumTools()")]

    def tool(self) -> str:
        """Name of the active tool."""
        (answer,) = self.call("GetProp(Tool.Name())")
        return str(_arguments(answer, "Tool.Name")[0])

    def find_tool(self, name: str) -> None:
        """Look for a tool.

        Raises
        ------
        FaultError : 1502, there is none of this name.
        """
        self.call(f"FindTool({_quoted(name)})")

    def part_temperature(self) -> float | None:
        """Temperature of the part, °C, as section 9.6 of 1.4.3 announces it; ``None`` where the server has none."""
        (answer,) = self._known("GetProp(Part.Temperature())") or (None,)
        return None if answer is None else float(str(_arguments(answer, "Part.Temperature")[0]))

    def scale_temperatures(self) -> dict[str, float]:
        """Temperatures of the scales by axis, °C, as servers of VDMA 8722 (2.5) give them; empty where the server has none."""
        (answer,) = self._known("GetScaleTemperatures(X(), Y(), Z())") or (None,)
        if answer is None:
            return {}
        try:
            found = terms_of(_rest(answer))
        except BadLineError as error:
            raise NoAnswerError(str(error)) from None
        return {axis: value[0] for axis, value in found.items() if value and isinstance(value[0], float)}

    # --- what moves the machine ---------------------------------------------------------------------------------------------

    def pt_meas(self, position: Position, normal: Position | None = None) -> Heard:
        """Measure a point: the machine moves.

        Parameters
        ----------
        position : nominal, mm.
        normal : of the surface, outward; without it, the direction from the last position.

        Raises
        ------
        CmmUqError : moving was not allowed, or not confirmed.
        """
        where = ", ".join(f"{axis}({number_text(value)})" for axis, value in zip("XYZ", position, strict=True))
        towards = f", IJK({', '.join(map(number_text, normal))})" if normal else ""
        (answer,) = self._moving(f"PtMeas({where}{towards})")
        return answer

    def go_to(self, position: Position) -> None:
        """Move there; see :meth:`pt_meas`."""
        where = ", ".join(f"{axis}({number_text(value)})" for axis, value in zip("XYZ", position, strict=True))
        self._moving(f"GoTo({where})")

    def change_tool(self, name: str) -> None:
        """Change the tool: the machine may move; see :meth:`pt_meas`."""
        self._moving(f"ChangeTool({_quoted(name)})")

    def _moving(self, command: str) -> list[Heard]:
        if self._confirm is None:
            raise CmmUqError(
                f"{command} moves the machine, which was not allowed", fix="Allow it and confirm each move"
            )
        if not self._confirm(command):
            raise CmmUqError(f"{command} was not confirmed: the machine was not moved")
        return self.call(command, within_s=MOVED_WITHIN_S)

    def _known(self, command: str) -> list[Heard] | None:
        """Answer to what older servers may not know; ``None`` where this one does not, and goes on."""
        try:
            return self.call(command)
        except FaultError as error:
            if error.fault.number not in NOT_THERE:
                raise
            self.clear_all_errors()
            return None


def _empty(names: Sequence[str]) -> str:
    return ", ".join(f"{name}()" for name in names)


def _quoted(name: str) -> str:
    if not name or any(not 32 <= ord(c) <= 126 or c == '"' for c in name):
        raise CmmUqError(f"{name!r} can be no name of a tool", fix="Name it in ASCII, without quotes")
    return f'"{name}"'


def _rest(heard: Heard) -> str:
    return heard.response.rest if heard.response else ""


def _arguments(heard: Heard, name: str) -> tuple[float | str | Term, ...]:
    """What a term of an answer holds, at least one thing.

    Raises
    ------
    NoAnswerError : the answer is another.
    """
    try:
        found = terms_of(_rest(heard)).get(name, ())
    except BadLineError:
        found = ()
    if not found:
        raise NoAnswerError(f"{_rest(heard)!r} where {name}(…) belongs")
    return found


def _fault(response: Response) -> Fault:
    try:
        return fault_of(response.rest)
    except BadLineError as error:
        raise NoAnswerError(f"an error that is none of the protocol: {error}") from None
