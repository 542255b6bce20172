"""A simulated CMM behind an I++ DME server on a real socket: one that keeps to specification 1.4.3, or one that does not.

It follows the sections of the specification that its methods name. It is for trying clients: it moves nothing.
"""

from __future__ import annotations

import contextlib
import select
import socket
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from cmm_uq.laboratory.live.instruments.framing import Framer
from cmm_uq.laboratory.live.instruments.ipp.line import LONGEST, BadLineError, Term, arguments_of
from cmm_uq.laboratory.live.instruments.ipp.server_methods import TEXTS, MethodError, Methods
from cmm_uq.laboratory.live.instruments.profile import Frame

_TICK_S = 0.02


@dataclass
class IppMischief:
    """What a server does wrong; all may be changed while it runs.

    Parameters
    ----------
    hangs : answers nothing.
    no_ack : leaves out the acknowledgement.
    exchanged : sends ``%`` where ``&`` belongs and the reverse, as some published programs do.
    wrong_tag : answers with another tag.
    halves : cuts each line of data.
    noise : bytes before each line.
    delay_s : before each answer.
    """

    hangs: bool = False
    no_ack: bool = False
    exchanged: bool = False
    wrong_tag: bool = False
    halves: bool = False
    noise: bytes = b""
    delay_s: float = 0.0


class SimulatedMachine(Methods):
    """A server, listening until it is closed.

    Parameters
    ----------
    tcp_port : 0 takes a free one.
    part_c : temperature of the part, °C; ``None``: no such property.
    version : that it says; ``None``: it does not know the question.
    """

    def __init__(self, tcp_port: int = 0, *, part_c: float | None = 20.13, version: str | None = "1.4.3") -> None:
        super().__init__(part_c=part_c, version=version)
        self.mischief = IppMischief()
        self.lines: list[str] = []
        """All that was said, by both sides, with > and <."""
        self._sending = threading.Lock()
        self._connection: socket.socket | None = None
        self.port = tcp_port
        self.start()

    @property
    def url(self) -> str:
        """As a job names it."""
        return f"tcp://127.0.0.1:{self.port}"

    def start(self) -> None:
        """Listen."""
        self._listening = socket.create_server(("127.0.0.1", self.port))
        self.port = self._listening.getsockname()[1]
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

    def press(self, key: str) -> None:
        """The user presses a key (section 9.5.1)."""
        self._send(f'E0000 # KeyPress("{key}")')

    def trip(self, number: int = 500) -> None:
        """Something goes wrong by itself (section 6.2.4.1)."""
        severity, text = TEXTS[number]
        self.state.error = severity >= 2
        self._send(f'E0000 ! Error({severity}, {number:04d}, "HealthCheck", "{text}")')

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
        framer = Framer(Frame(terminator="<CR><LF>", longest=LONGEST))
        while not self._stop.is_set():
            if not select.select([connection], [], [], _TICK_S)[0]:
                continue
            received = connection.recv(4096)
            if not received:
                return
            for framed in framer.feed(received):
                self._command(framed.body)

    def said(self, line: str) -> None:
        """See :meth:`Methods.said`."""
        self._send(line)

    def _send(self, line: str) -> None:
        self.lines.append(f"< {line}")
        wrong = self.mischief
        if wrong.exchanged and line[6:7] in ("&", "%"):
            line = f"{line[:6]}{'%' if line[6] == '&' else '&'}"
        if wrong.wrong_tag:
            line = f"9{line[1:]}"
        if wrong.halves and line[6:7] == "#":
            line = line[: len(line) // 2]
        if self._connection is not None:
            with self._sending, contextlib.suppress(OSError):
                self._connection.sendall(wrong.noise + line.encode("ascii") + b"\r\n")

    def _command(self, body: bytes) -> None:
        """A line of the client, answered in the order of the signs."""
        line = body.decode("latin-1")
        self.lines.append(f"> {line}")
        if self.mischief.hangs:
            return
        time.sleep(self.mischief.delay_s)
        tag, text = line[:5], line[6:]
        if not (tag[:1].isdigit() or tag[:1] == "E") or not tag[1:].isdigit() or tag in ("00000", "E0000"):
            self._send(f"E0000 ! {_error(1, 'Tag')}")
            return
        if not self.mischief.no_ack:
            self._send(f"{tag} &")
        try:
            (method,) = arguments_of(text)
            if line[5:6] != " " or not isinstance(method, Term):
                raise BadLineError("no method")
        except (BadLineError, ValueError):
            self._send(f"{tag} ! {_error(8, 'Parser')}")
            self.state.error = True
        else:
            self._answer(tag, method)
        self._send(f"{tag} %")

    def _answer(self, tag: str, method: Term) -> None:
        state = self.state
        asks = method.name in (
            "ClearAllErrors",
            "GetErrStatusE",
            "GetXtdErrStatus",
            "AbortE",
            "EndSession",
            "StartSession",
        )
        try:
            if not state.session and method.name not in ("StartSession", "EndSession"):
                raise MethodError(8)
            if state.error and not asks:
                raise MethodError(514)
            act: Callable[[str, Term], Iterator[str]] | None = getattr(self, f"_do_{method.name.lower()}", None)
            if act is None:
                raise MethodError(501)
            for data in act(tag, method):
                self._send(f"{tag} # {data}")
        except MethodError as error:
            number = int(error.args[0])
            state.error = state.error or TEXTS[number][0] >= 2
            self._send(f"{tag} ! {_error(number, method.name)}")


def _error(number: int, cause: str) -> str:
    severity, text = TEXTS[number]
    return f'Error({severity}, {number:04d}, "{cause}", "{text}")'
