"""Simulated instruments at a real pseudo-terminal, TCP socket or RFC 2217 server."""

from __future__ import annotations

import contextlib
import os
import select
import socket
import threading
import time
from pathlib import Path
from typing import Any, Literal

from cmm_uq.laboratory.live.instruments.speakers import Speaker

Way = Literal["pty", "socket", "rfc2217"]
WAYS: tuple[Way, ...] = ("pty", "socket", "rfc2217")
_TICK_S = 0.01


class SimulatedLine(contextlib.AbstractContextManager["SimulatedLine"]):
    """An instrument that speaks from a thread of its own until closed; a pseudo-terminal keeps its name in ``folder``."""

    def __init__(self, speaker: Speaker, way: Way = "pty", folder: Path | None = None, tcp_port: int = 0) -> None:
        self.speaker, self._way = speaker, way
        self._name = (folder or Path()) / "tty"
        self._speaking, self._tcp_port = threading.Lock(), tcp_port
        self._wire: _Wire | None = None
        self._listening: socket.socket | None = None
        self.plug_in()

    @property
    def port(self) -> str:
        """As a job names it."""
        return str(self._name) if self._way == "pty" else f"{self._way}://127.0.0.1:{self._tcp_port}"

    def plug_in(self) -> None:
        self._stop = threading.Event()
        if self._way == "pty":
            self._wire = _Pty(Path(self.port))
        else:
            self._listening = socket.create_server(("127.0.0.1", self._tcp_port))
            self._tcp_port = self._listening.getsockname()[1]
        self._thread = threading.Thread(target=self._run, args=(self._stop,), daemon=True)
        self._thread.start()

    def unplug(self) -> None:
        self._stop.set()
        self._thread.join()
        for end in (self._wire, self._listening):
            if end is not None:
                end.close()
        self._wire = self._listening = None

    close = unplug

    def __exit__(self, *_: object) -> None:
        self.unplug()

    def _run(self, stop: threading.Event) -> None:
        following = time.monotonic()
        while not stop.is_set():
            wire = self._wire = self._wire or self._accepted()
            if wire is None:
                continue
            try:
                received = wire.receive()
                with self._speaking:
                    self._say(wire, self.speaker.hear(received))
                    if self.speaker.every_s and time.monotonic() >= following:
                        following += self.speaker.every_s
                        self._say(wire, self.speaker.says())
            except OSError:
                if self._way == "pty":  # nobody has it open yet
                    time.sleep(_TICK_S)
                else:
                    wire.close()
                    self._wire = None

    def _say(self, wire: _Wire, data: bytes) -> None:
        wire.send(data)

    def _accepted(self) -> _Wire | None:
        if self._listening is None or not select.select([self._listening], [], [], 5 * _TICK_S)[0]:
            return None
        connection, _ = self._listening.accept()
        return _DeviceServer(connection) if self._way == "rfc2217" else _Tcp(connection)


class _Pty:
    """The master's side of a pseudo-terminal; ``name`` is a link to the other."""

    def __init__(self, name: Path) -> None:
        import pty
        import tty

        self._master, slave = pty.openpty()
        tty.setraw(slave)
        os.set_blocking(self._master, False)  # it looks readable while nobody has the other side open, and then is not
        self._name = name
        name.unlink(missing_ok=True)
        name.symlink_to(os.ttyname(slave))
        os.close(slave)

    def receive(self) -> bytes:
        return os.read(self._master, 4096) if select.select([self._master], [], [], _TICK_S)[0] else b""

    def send(self, data: bytes) -> None:
        if data:
            os.write(self._master, data)

    def close(self) -> None:
        self._name.unlink(missing_ok=True)
        os.close(self._master)


class _Tcp:
    def __init__(self, connection: socket.socket) -> None:
        self._connection = connection
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def receive(self) -> bytes:
        if not select.select([self._connection], [], [], _TICK_S)[0]:
            return b""
        received = self._connection.recv(4096)
        if not received:
            raise ConnectionResetError
        return received

    def send(self, data: bytes) -> None:
        self._connection.sendall(data)

    def close(self) -> None:
        self._connection.close()


class _DeviceServer(_Tcp):
    def __init__(self, connection: socket.socket) -> None:
        import serial
        from serial import rfc2217

        super().__init__(connection)
        self.line: Any = serial.serial_for_url("loop://", timeout=0)
        self.write = super().send  # of answers of the protocol itself; the manager calls it
        self._manager = rfc2217.PortManager(self.line, self)

    def receive(self) -> bytes:
        return b"".join(self._manager.filter(super().receive()))

    def send(self, data: bytes) -> None:
        super().send(b"".join(self._manager.escape(data)))

    def close(self) -> None:
        super().close()
        self.line.close()


_Wire = _Pty | _Tcp
