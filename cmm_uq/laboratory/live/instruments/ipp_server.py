"""A simulated CMM behind an I++ DME server on a real socket, that keeps to specification 1.4.3.

It follows the sections of the specification that its methods name. It is for trying clients: it moves nothing.
"""

from __future__ import annotations

import contextlib
import select
import socket
import threading
from collections.abc import Callable

from cmm_uq.base.values import dataclass, field
from cmm_uq.laboratory.live.instruments import ipp_client as ipp
from cmm_uq.laboratory.live.instruments.parsing import Framer
from cmm_uq.laboratory.live.instruments.profile import MessageFrame

TEXTS = {
    1: (2, "Illegal tag"), 8: (3, "Protocol error"), 500: (3, "Emergency stop"), 501: (3, "Unsupported command"),
    510: (3, "Bad property"), 514: (2, "Use ClearAllErrors to continue"), 515: (2, "Daemon already exists"),
}  # fmt: skip
"""Severity and text of errors by their numbers (section 8.2)."""

_TICK_S = 0.02
_IN_ERROR_TOO = ("ClearAllErrors", "GetErrStatusE", "EndSession", "StartSession")


@dataclass
class SimulatedState:
    """Of the machine; kept from session to session (section 6.3.1.2)."""

    position: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])
    user: bool = False
    session: bool = False
    error: bool = False
    report: tuple[str, ...] = ("X", "Y", "Z")
    daemons: dict[str, tuple[str, ...]] = field(default_factory=dict)


_SETTINGS = {"clearallerrors": ("error", False), "enableuser": ("user", True)}
"""Methods that only set something of the state."""

_SAYINGS = {"getmachineclass": "GetMachineClass(CartCMM)", "geterrstatuse": "ErrStatus({0.error:d})"}
"""Methods that only say something of it."""


class MethodError(Exception):
    """An error of a number, which the method answers with."""


class SimulatedIppServer:
    """A CMM behind a server, listening at a free port until it is closed.

    Each method that does more than set or say something gives its data, and is named ``_do_`` and its name in small letters.
    """

    def __init__(self, *, version: str | None = "1.4.3") -> None:
        self.state, self.port = SimulatedState(), 0
        self.version = version  # ``None``: it does not know the question
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
        self._send(f"E0000 # PtMeas({self.reported(self.state.report)})")

    def move(self, x: float, y: float, z: float) -> None:
        """The user moves the machine by the joystick, and daemons report it."""
        self.state.position = [x, y, z]
        for tag, names in self.state.daemons.items():
            self._send(f"{tag} # {self.reported(names)}")

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
            act: Callable[[str, ipp.Term], str | None] | None = getattr(self, f"_do_{name}", None)
            if name in _SETTINGS:
                setattr(state, *_SETTINGS[name])
            elif act is None and name not in _SAYINGS:
                raise MethodError(501)
            if line := act(tag, method) if act else _SAYINGS.get(name, "").format(state):
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

    def _do_getdmeversion(self, tag: str, method: ipp.Term) -> str:
        if self.version is None:
            raise MethodError(501)
        return f'DMEVersion("{self.version}")'

    def _do_get(self, tag: str, method: ipp.Term) -> str:
        return self.reported(_names(method))

    def _do_onptmeasreport(self, tag: str, method: ipp.Term) -> None:
        self.state.report = _names(method)

    def _do_onmovereporte(self, tag: str, method: ipp.Term) -> None:
        if self.state.daemons:
            raise MethodError(515)
        self.state.daemons[tag] = _names(method, besides=("Time", "Dis"))

    def reported(self, names: tuple[str, ...]) -> str:
        return ", ".join(f"{axis}({self.state.position['XYZ'.index(axis)]:.4f})" for axis in names)


def _names(method: ipp.Term, besides: tuple[str, ...] = ()) -> tuple[str, ...]:
    terms = [one for one in method.arguments if isinstance(one, ipp.Term)]
    names = tuple(one.name for one in terms if not one.arguments)
    if not names or not {one.name for one in terms} <= {"X", "Y", "Z", *besides} or len(terms) < len(method.arguments):
        raise MethodError(510)
    return names


def fault(number: int, cause: str) -> str:
    severity, text = TEXTS[number]
    return f'Error({severity}, {number:04d}, "{cause}", "{text}")'
