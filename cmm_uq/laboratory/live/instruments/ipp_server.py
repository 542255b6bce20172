"""A simulated CMM behind an I++ DME server on a real socket, that keeps to specification 1.4.3.

It follows the sections of the specification that its methods name. It is for trying clients: it moves nothing.
"""

from __future__ import annotations

import contextlib
import math
import select
import socket
import threading
from collections.abc import Callable

from cmm_uq.base.values import dataclass, field
from cmm_uq.laboratory.live.instruments import ipp_client as ipp
from cmm_uq.laboratory.live.instruments.parsing import Framer
from cmm_uq.laboratory.live.instruments.profile import MessageFrame

TEXTS = {
    1: (2, "Illegal tag"), 6: (2, "Transaction aborted (Use ClearAllErrors To Continue)"), 7: (3, "Illegal character"),
    8: (3, "Protocol error"), 500: (3, "Emergency stop"), 501: (3, "Unsupported command"), 502: (3, "Incorrect arguments"),
    509: (3, "Bad argument"), 510: (3, "Bad property"), 511: (3, "Error processing method"), 512: (1, "No daemons are active"),
    513: (2, "Daemon does not exist"), 514: (2, "Use ClearAllErrors to continue"), 515: (2, "Daemon already exists"),
    1006: (2, "Surface not found"), 1502: (3, "Tool not found"), 1503: (3, "Tool not defined"),
    2500: (3, "Machine limit encountered [Move Out Of Limits]"),
}  # fmt: skip
"""Severity and text of errors by their numbers (section 8.2)."""

_TICK_S = 0.02
_IN_ERROR_TOO = ("ClearAllErrors", "GetErrStatusE", "GetXtdErrStatus", "AbortE", "EndSession", "StartSession")
LIMIT_MM = 1000.0  # of each axis, both ways


@dataclass
class SimulatedState:
    """Of the machine; kept from session to session (section 6.3.1.2)."""

    position: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])
    tool: str = "RefTool"
    found: str = "UnDefTool"
    homed: bool = False
    user: bool = False
    session: bool = False
    error: bool = False
    report: tuple[str, ...] = ("X", "Y", "Z")
    daemons: dict[str, tuple[str, ...]] = field(default_factory=dict)


_SETTINGS = {
    "clearallerrors": ("error", False), "aborte": ("error", True), "enableuser": ("user", True),
    "disableuser": ("user", False),
}  # fmt: skip
"""Methods that only set something of the state."""

_SAYINGS = {
    "getmachineclass": ("GetMachineClass(CartCMM)",), "geterrstatuse": ("ErrStatus({0.error:d})",),
    "getxtderrstatus": ("IsHomed({0.homed:d})", "IsUserEnabled({0.user:d})"), "ishomed": ("IsHomed({0.homed:d})",),
    "isuserenabled": ("IsUserEnabled({0.user:d})",),
}  # fmt: skip
"""Methods that only say something of it."""


class MethodError(Exception):
    """An error of a number, which the method answers with."""


class SimulatedIppServer:
    """A CMM behind a server, listening at a port (0: a free one) until it is closed.

    Each method that does more than set or say something gives its data, and is named ``_do_`` and its name in small letters.
    """

    tools = ("RefTool", "NoTool", "Probe1", "Probe2")

    def __init__(self, tcp_port: int = 0, *, part_c: float | None = 20.13, version: str | None = "1.4.3") -> None:
        self.state, self.port = SimulatedState(), tcp_port
        self.part_c, self.version = part_c, version  # ``None``: it does not know the property, the question
        self.radial = 0.0  # how far the surface lies from where it is expected, along the normal, mm
        self.lines: list[str] = []  # all that was said, by both sides, with > and <
        self._sending = threading.Lock()
        self._connection: socket.socket | None = None
        self.start()

    def start(self) -> None:
        self._listening = socket.create_server(("127.0.0.1", self.port))
        self.port = self._listening.getsockname()[1]
        self.url = f"tcp://127.0.0.1:{self.port}"  # as a job names it
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Cut the connection, and listen no more; :meth:`start` begins again."""
        self._stop.set()
        self._thread.join()
        self._listening.close()

    def pick(self, x: float, y: float, z: float) -> None:
        """The user picks a point by hand (section 9.5.3)."""
        self.state.position = [x, y, z]
        self._send(f"E0000 # PtMeas({self.reported(self.state.report, (0, 0, 1))})")

    # --- the connection -----------------------------------------------------------------------------------------------------

    def _run(self) -> None:
        while not self._stop.is_set():
            if not select.select([self._listening], [], [], _TICK_S)[0]:
                continue
            self._connection, _ = self._listening.accept()
            with self._connection, contextlib.suppress(OSError):
                self._serve(self._connection)
            self._connection = None
            self.state.session = False
            self.state.daemons.clear()

    def _serve(self, connection: socket.socket) -> None:
        framer = Framer(MessageFrame(terminator="<CR><LF>", longest=ipp.LONGEST))
        while not self._stop.is_set():
            if not select.select([connection], [], [], _TICK_S)[0]:
                continue
            received = connection.recv(4096)
            if not received:
                return
            for framed in framer.feed(received):
                self._command(framed.body)

    def _send(self, line: str) -> None:
        self.lines.append(f"< {line}")
        self._put(line.encode("ascii") + b"\r\n")

    def _put(self, data: bytes) -> None:
        if self._connection is not None:
            with self._sending, contextlib.suppress(OSError):
                self._connection.sendall(data)

    def _command(self, body: bytes) -> None:
        """A line of the client, answered in the order of the signs."""
        line = body.decode("latin-1")
        self.lines.append(f"> {line}")
        tag, text = line[:5], line[6:]
        if not (tag[:1].isdigit() or tag[:1] == "E") or not tag[1:].isdigit() or tag in ("00000", "E0000"):
            self._send(f"E0000 ! {fault(1, 'Tag')}")
            return
        self._send(f"{tag} &")
        try:
            (method,) = ipp.arguments_of(text)
            if line[5:6] != " " or not isinstance(method, ipp.Term):
                raise ipp.BadLineError("no method")
        except (ipp.BadLineError, ValueError):
            self._send(f"{tag} ! {fault(8, 'Parser')}")
            self.state.error = True
        else:
            self._answer(tag, method)
        self._send(f"{tag} %")

    def _answer(self, tag: str, method: ipp.Term) -> None:
        state, name = self.state, method.name.lower()
        try:
            if not state.session and method.name not in ("StartSession", "EndSession"):
                raise MethodError(8)
            if state.error and method.name not in _IN_ERROR_TOO:
                raise MethodError(514)
            act: Callable[[str, ipp.Term], list[str] | None] | None = getattr(self, f"_do_{name}", None)
            if name in _SETTINGS:
                setattr(state, *_SETTINGS[name])
            elif act is None and name not in _SAYINGS:
                raise MethodError(501)
            data = act(tag, method) if act else [saying.format(state) for saying in _SAYINGS.get(name, ())]
            for line in data or ():
                self._send(f"{tag} # {line}")
        except MethodError as error:
            number = int(error.args[0])
            state.error = state.error or TEXTS[number][0] >= 2
            self._send(f"{tag} ! {fault(number, method.name)}")

    # --- the methods --------------------------------------------------------------------------------------------------------

    def _do_startsession(self, tag: str, method: ipp.Term) -> None:
        if self.state.session:
            raise MethodError(8)
        self.state.session, self.state.error, self.state.report = True, False, ("X", "Y", "Z")

    def _do_endsession(self, tag: str, method: ipp.Term) -> None:
        self.state.session = False
        self.state.daemons.clear()

    def _do_getdmeversion(self, tag: str, method: ipp.Term) -> list[str]:
        if self.version is None:
            raise MethodError(501)
        return [f'DMEVersion("{self.version}")']

    def _do_home(self, tag: str, method: ipp.Term) -> None:
        self.state.homed, self.state.position, self.state.user = True, [0.0, 0.0, 0.0], False

    def _do_get(self, tag: str, method: ipp.Term) -> list[str]:
        return [self.reported(_names(method.arguments, ("X", "Y", "Z", "Tool.A", "Tool.B", "Tool.C")))]

    def _do_onptmeasreport(self, tag: str, method: ipp.Term) -> None:
        self.state.report = _names(method.arguments, ("X", "Y", "Z", "IJK", "ER", "Q", "Tool.A", "Tool.B", "Tool.C"))

    def _do_onmovereporte(self, tag: str, method: ipp.Term) -> None:
        if self.state.daemons:
            raise MethodError(515)
        rest = [one for one in method.arguments if not (isinstance(one, ipp.Term) and one.name in ("Time", "Dis"))]
        self.state.daemons[tag] = _names(tuple(rest), ("X", "Y", "Z"))

    def _do_stopdaemon(self, tag: str, method: ipp.Term) -> None:
        if len(method.arguments) != 1 or self.state.daemons.pop(str(method.arguments[0]), None) is None:
            raise MethodError(513)

    def _do_stopalldaemons(self, tag: str, method: ipp.Term) -> None:
        if not self.state.daemons:
            raise MethodError(512)
        self.state.daemons.clear()

    def _do_goto(self, tag: str, method: ipp.Term) -> None:
        self._move(_target(method, self.state.position)[0])

    def _do_ptmeas(self, tag: str, method: ipp.Term) -> list[str]:
        place, normal = _target(method, self.state.position)
        size = math.hypot(*normal) or 1.0
        unit = (normal[0] / size, normal[1] / size, normal[2] / size)
        self._move([at + self.radial * n for at, n in zip(place, unit, strict=True)])
        return [self.reported(self.state.report, unit)]

    def _do_enumtools(self, tag: str, method: ipp.Term) -> list[str]:
        return [f'"{name}"' for name in self.tools]

    def _do_findtool(self, tag: str, method: ipp.Term) -> None:
        self.state.found = self._tool(method)

    def _do_changetool(self, tag: str, method: ipp.Term) -> None:
        self.state.tool, self.state.user = self._tool(method), False

    def _do_settool(self, tag: str, method: ipp.Term) -> None:
        self.state.tool = self._tool(method)

    def _do_getprop(self, tag: str, method: ipp.Term) -> list[str]:
        known = {"Tool.Name": f'"{self.state.tool}"', "FoundTool.Name": f'"{self.state.found}"'}
        if self.part_c is not None:
            known["Part.Temperature"] = ipp.number_text(self.part_c)
        names = [one.name if isinstance(one, ipp.Term) else "" for one in method.arguments]
        if not set(names) <= set(known):
            raise MethodError(510)
        return [", ".join(f"{name}({known[name]})" for name in names)]

    def _tool(self, method: ipp.Term) -> str:
        if len(method.arguments) != 1 or method.arguments[0] not in self.tools:
            raise MethodError(1502)
        return str(method.arguments[0])

    def _move(self, place: list[float]) -> None:
        if any(abs(value) > LIMIT_MM for value in place):
            raise MethodError(2500)
        self.state.position, self.state.user = place, False
        for tag, names in self.state.daemons.items():
            self._send(f"{tag} # {self.reported(names)}")

    def reported(self, names: tuple[str, ...], normal: tuple[float, float, float] = (0, 0, 1)) -> str:
        """What a report says of the names, with the direction of a measured point."""
        places = {axis: f"{value:.4f}" for axis, value in zip("XYZ", self.state.position, strict=True)}
        further = {"IJK": ", ".join(map(ipp.number_text, normal)), "ER": "1.0", "Q": "0"}
        return ", ".join(f"{name}({places.get(name) or further.get(name) or '0'})" for name in names)


def _names(arguments: tuple[ipp.Argument, ...], known: tuple[str, ...]) -> tuple[str, ...]:
    names = tuple(one.name for one in arguments if isinstance(one, ipp.Term) and not one.arguments)
    if not names or len(names) != len(arguments) or not set(names) <= set(known):
        raise MethodError(510)
    return names


def _target(method: ipp.Term, position: list[float]) -> tuple[list[float], tuple[float, float, float]]:
    """Where a command goes, axes that it does not name staying, and the direction that it names."""
    place, normal = list(position), (0.0, 0.0, 1.0)
    for one in method.arguments:
        if not isinstance(one, ipp.Term) or not all(isinstance(value, float) for value in one.arguments):
            raise MethodError(509)
        numbers = [value for value in one.arguments if isinstance(value, float)]
        if one.name in ("X", "Y", "Z") and len(numbers) == 1:
            place["XYZ".index(one.name)] = numbers[0]
        elif one.name == "IJK" and len(numbers) == 3:
            normal = (numbers[0], numbers[1], numbers[2])
        else:
            raise MethodError(509)
    return place, normal


def fault(number: int, cause: str) -> str:
    severity, text = TEXTS[number]
    return f'Error({severity}, {number:04d}, "{cause}", "{text}")'
