"""A client of I++ DME: session, positions, tools, temperatures, errors, and measuring.

No command moves the machine unless its caller allowed it and confirms each (:class:`Client`, ``confirm``).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from cmm_uq.base.errors import CmmUqError
from cmm_uq.laboratory.live.instruments.ipp.protocol import (
    ANSWER_WITHIN_S,
    BadLineError,
    FaultError,
    HeardLine,
    NoAnswerError,
    Term,
    Transactions,
    arguments_of,
    number_text,
    terms_of,
)
from cmm_uq.laboratory.live.instruments.source import Clock, Port

MOVED_WITHIN_S = 300.0  # time for what moves it

NOT_THERE = frozenset({501, 502, 505, 506, 507, 509, 510})
"""Errors by which a server says that it does not know a command, an argument or a property (section 8.2)."""

Position = tuple[float, float, float]


class Client(Transactions):
    """A client of one server; ``confirm`` is asked before each command that moves the machine, else nothing moves."""

    def __init__(
        self, port: Port, clock: Clock, *, confirm: Callable[[str], bool] | None = None, within_s: float = ANSWER_WITHIN_S
    ) -> None:  # fmt: skip
        super().__init__(port, clock, within_s)
        self._confirm = confirm

    # --- session and errors ------------------------------------------------------------

    def start_session(self, *, take_over: bool = False) -> None:
        """Begin; with ``take_over`` after ending one that is active, such as one's own that was cut off."""
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

    # --- positions ------------------------------------------------------------

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
        """End reports."""
        self.call(f"StopDaemon({tag})")

    def enable_user(self) -> None:
        """Let the user move the machine and pick points by the joystick."""
        self.call("EnableUser()")

    # --- tools and temperatures ------------------------------------------------------------

    def tools(self) -> list[str]:
        """Names of the tools that may be chosen."""
        return [str(arguments_of(_rest(answer))[0]) for answer in self.call("EnumTools()")]

    def tool(self) -> str:
        """Name of the active tool."""
        (answer,) = self.call("GetProp(Tool.Name())")
        return str(_arguments(answer, "Tool.Name")[0])

    def find_tool(self, name: str) -> None:
        """Look for a tool; error 1502 where there is none of this name."""
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

    # --- what moves the machine ------------------------------------------------------------

    def pt_meas(self, position: Position, normal: Position | None = None) -> HeardLine:
        """Measure a point, mm: the machine moves; without an outward normal in the direction from the last position."""
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

    def _moving(self, command: str) -> list[HeardLine]:
        if self._confirm is None:
            fix = "Allow it and confirm each move"
            raise CmmUqError(f"{command} moves the machine, which was not allowed", fix=fix)
        if not self._confirm(command):
            raise CmmUqError(f"{command} was not confirmed: the machine was not moved")
        return self.call(command, within_s=MOVED_WITHIN_S)

    def _known(self, command: str) -> list[HeardLine] | None:
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


def _rest(heard: HeardLine) -> str:
    return heard.response.rest if heard.response else ""


def _arguments(heard: HeardLine, name: str) -> tuple[float | str | Term, ...]:
    """What a term of an answer holds, at least one thing."""
    try:
        found = terms_of(_rest(heard)).get(name, ())
    except BadLineError:
        found = ()
    if not found:
        raise NoAnswerError(f"{_rest(heard)!r} where {name}(…) belongs")
    return found
