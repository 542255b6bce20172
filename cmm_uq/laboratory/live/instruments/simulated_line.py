"""Simulated instruments at a real pseudo-terminal, TCP socket or RFC 2217 server.

What each says is by its manual, written from the same sources as its profile and not from the profile.
"""

from __future__ import annotations

import contextlib
import os
import re
import select
import socket
import threading
import time
from collections.abc import Callable, Mapping
from functools import partial
from math import pi
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal

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


class Speaker:
    """An instrument that is asked, or that speaks by itself every so often, of readings in the unit that it sends."""

    banner = b""  # what it says when it is switched on
    every_s = 0.0
    usual: tuple[float, ...] = (20.0,)

    def __init__(self) -> None:
        self.readings, self.ill, self._waiting = list(self.usual), False, b""

    def hear(self, received: bytes) -> bytes:
        self._waiting += received
        *commands, self._waiting = re.split(rb"[\r\n]", self._waiting)
        return b"".join(self.answer(command.decode("latin-1").strip()) for command in commands if command)

    def answer(self, command: str) -> bytes:
        """Nothing to a command that it does not know."""
        return b""

    def says(self) -> bytes:
        return b""


class Vaisala(Speaker):
    """Both stations: FORM with the modifiers that the manuals explain, SEND, ?."""

    model, flags = "PTU300", 4
    usual: tuple[float, ...] = (1013.21, 20.04, 45.1)
    banner = b"PTU300 / 5.02\r\n"
    letters: tuple[str, ...] = ("P", "T", "RH")
    units = ("hPa", "'C", "%RH")

    def __init__(self) -> None:
        super().__init__()
        self._form = '6.1 "P=" P " " U6 3.1 "T=" T " " U3 3.1 "RH=" RH " " U4 #r #n'

    def answer(self, command: str) -> bytes:
        word = command.lower().partition(" ")[0]
        if word == "form":
            self._form = command[5:]
            return b"OK\r\n>"
        if word == "smode":
            return b"Serial mode        : STOP\r\n>"
        if word == "send":
            return self._sent().encode("latin-1") + b">"
        if word == "?":
            serial = "Serial number  : A1234567\r\nBatch number   : B8901234\r\nBaud P D S     : 4800 E 7 1"
            return f"{self.model} / 1.01\r\n{serial}\r\n>".encode()
        return b"Unknown command\r\n>"

    def _sent(self) -> str:
        """The message by the FORM."""
        said, decimals, unit = "", 1, ""
        for word in re.findall(r'"[^"]*"|\S+', self._form):
            if word.startswith('"'):
                said += word[1:-1]
            elif re.fullmatch(r"\d\.\d", word):
                decimals = int(word[2])
            elif word.startswith("#"):
                said += {"#r": "\r", "#n": "\n", "#rn": "\r\n", "#t": "\t"}.get(word.lower(), "")
            elif re.fullmatch(r"U\d", word):
                said += f"{unit:{word[1]}}"
            elif word == "ERR":
                said += ("1" if self.ill else "0") + "0" * (self.flags - 1)
            elif word in self.letters:
                value, unit = self.readings[self.letters.index(word)], self.units[self.letters.index(word)]
                said += "*" * 7 if self.ill and word == "P" else f"{value:7.{decimals}f}"
        return said


class Barometer(Vaisala):
    model, flags = "PTB330", 3
    usual = (1013.02,)
    banner = b"PTB330 / 1.01\r\n"
    letters = ("P",)


class Readout1502(Speaker):
    """Fluke 1502A: T, DU, SA, *IDN?; it echoes until DU=H."""

    usual = (20.013,)

    def __init__(self) -> None:
        super().__init__()
        self._echo = True

    def answer(self, command: str) -> bytes:
        echo = f"{command}\r\n".encode() if self._echo else b""
        if command.upper() == "DU=H":
            self._echo = False
        if command.upper() == "T":
            return echo + (b"t:   ----.-  C\r\n" if self.ill else f"t: {self.readings[0]:8.3f} C\r\n".encode())
        return echo + (b"HART,1502A,A24680,1.10\r\n" if command.upper() == "*IDN?" else b"")


class MilliK(Speaker):
    """Isotech milliK: settings and READ? in one line, CR both ways."""

    usual = (107.794123, 100.012345)

    def __init__(self) -> None:
        super().__init__()
        self._channel = 1

    def answer(self, command: str) -> bytes:
        said = b""
        for one in command.upper().split(";"):
            if one.startswith("SENSE:CHANNEL "):
                self._channel = int(one[-1])
            elif one == "READ?":
                said += b'-230,"Data error"\r' if self.ill else f"{self.readings[self._channel - 1]:.6f}\r".encode()
            elif one == "*IDN?":
                said += b"Isothermal Technology,milliK,21-P2460,4.0.0\r"
        return said


class Digimatic(Speaker):
    """Mitutoyo: sends by itself, as by its foot switch."""

    every_s = 0.1
    usual = (0.123,)

    def says(self) -> bytes:
        return b"911\r" if self.ill else f"01A{self.readings[0]:+09.3f}\r".encode()


class TotalStation(Speaker):
    """Leica by GeoCOM: the angles of RPC 2003, in rad, with what else it measured."""

    usual = (57.29577951308232, 90.0)

    def answer(self, command: str) -> bytes:
        if command != "%R1Q,2003:1":
            return b"%R1P,0,0:3\r\n"
        hz, v = (value * pi / 180 for value in self.readings)
        rest = "4.8E-6,1234,0.0001,-0.0002,4.8E-6,1234,0"
        return b"%R1P,0,0:1285\r\n" if self.ill else f"%R1P,0,0:0,{hz:.16f},{v:.16f},{rest}\r\n".encode()


class Pt104(Speaker):
    """The lines of a PT-104's port, of its first channel."""

    every_s = 0.1
    usual = (107.7935, 20.0)

    def says(self) -> bytes:
        return b"1 open\r\n" if self.ill else f"1 {self.readings[0]:.5f} {self.readings[1]:.5f}\r\n".encode()


class Thermocouples(Speaker):
    """Eleven channels, a line a scan."""

    every_s = 0.1
    usual = (20.11, 20.13, 20.09, 20.31, 20.3, 20.28, 20.55, 20.52, 20.57, 20.02, 19.87)

    def says(self) -> bytes:
        values = [9999.0, *self.readings[1:]] if self.ill else self.readings
        return ("14:03:22," + ",".join(f"{value:.2f}" for value in values) + "\r\n").encode()


class Lines(Speaker):
    every_s = 0.1
    usual = (20.01, 20.02, -3.0)

    def says(self) -> bytes:
        return (b"open\r\n") if self.ill else ("; ".join(map(str, self.readings)) + "\r\n").encode()


class Answering(Speaker):
    """An instrument of few commands: what it says to each, by a regular expression, and what where something is wrong."""

    def __init__(
        self, usual: tuple[float, ...], replies: Mapping[str, tuple[str, str]], otherwise: tuple[str, str] = ("", "")
    ) -> None:
        self.usual, self._replies, self._otherwise = usual, replies, otherwise
        super().__init__()

    def answer(self, command: str) -> bytes:
        fitting = (said for known, said in self._replies.items() if re.fullmatch(known, command))
        said = next(fitting, self._otherwise)[self.ill]
        steps = round(1e4 * self.readings[0])  # without a decimal point
        return said.format(*self.readings, command=command[:2], steps=steps).encode("latin-1")


_FEW: Mapping[str, tuple[Any, ...]] = MappingProxyType({
    # each input by its name, dashes where its probe is open
    "asl-f250": ((20.013, 20.104), {f"M{key}": (f"{name} {{{n}:.3f}} C\r\n", f"{name} ------\r\n")
                                    for n, (key, name) in enumerate((("I", "A"), ("J", "B")))}),
    # ESC commands, STX before what is asked for, NAK for what is not known
    "heidenhain-nd287": ((-12345.6789,), {
        "\x1bA0000": ("\x02ND-287    \r\n646118-01 \r\nV1-01     \r\n", "\x15"),
        "\x1bA0100": ("\x02{0:+.4f}\r\n", "\x15"), "\x1bA0200": ("\x02{steps:+010d}\r\n", "\x15")}, ("\x15",) * 2),
    # SCPI, a bare number for each channel
    "fluke-1529": ((20.0132, 20.1044, 19.9871, 21.0), {
        **{rf"(?i)(FETCH?|READ|MEAS)\? ?{n + 1}": (f"{{{n}:.4f}}\r\n", "9.9E37\r\n") for n in range(4)},
        r"(?i)\*IDN\?": ("HART,1529,A12345,1.2\r\n",) * 2}),
    "fluke-1522": ((25.587,), {r"(?i)f|fetch\?|read\?|meas\?": ("t:{0:.3f} C\r\n", "t:------ C\r\n")}),
    # commands are echoed; ERR and a number say what is wrong
    "sylvac-rs232": ((12.345,), {r"\?|PRI": ("{0:+09.3f}\r", "ERR3\r"), r"ID\?": ("SYLVAC Z_CAL\r",) * 2,
                                 "MM": ("MM\r",) * 2}, ("ERR1\r",) * 2),
    # a absolute, r relative
    "moeller-wedel-elcomat": ((4.5, -2.3), {"a": ("4 003 {0:.2f} {1:.2f}\r", "4 001 {0:.2f}\r"),
                                            "r": ("2 103 {0:.2f} {1:.2f}\r", "2 001 {0:.2f}\r")}),
    # M with the outputs that are meant and whether their comparisons are; ER where it cannot
    "keyence-ls7000": ((1.345, 24.6234), {
        "M0,0": ("M0,{0:+08.4f},{1:+08.4f}\r", "ER,M0,01\r"), "M1,0": ("M1,{0:+08.4f}\r", "ER,M1,01\r"),
        "M2,0": ("M2,{1:+08.4f}\r", "ER,M2,01\r")}, ("ER,{command},00\r", "ER,{command},01\r")),
    # features, each by its number, with sign, leading zeros, unit and tolerance
    "mahr-millimar-c1202": ((-12.34,), {r"M1\?": ("1 {0:+07.2f} mm =\r", "1 ERR6\r"),
                                        r"ID\?": ("1 T 52401234 1 S 19051234 2 T 52401235 2 S 19051235\r",) * 2}),
    "tesa-tt80": ((-12.34,), {r"\?": ("{0:+08.2f}\r\n", "ERR23\r\n")}),
})  # fmt: skip

SPEAKERS: Mapping[str, Callable[[], Speaker]] = MappingProxyType({
    "vaisala-ptu300": Vaisala, "vaisala-ptb330": Barometer, "fluke-1502a": Readout1502, "isotech-millik": MilliK,
    "mitutoyo-digimatic": Digimatic, "leica-geocom": TotalStation, "thermocouple-logger-11": Thermocouples,
    "line-logger": Lines, "pico-pt104": Pt104,
    **{name: partial(Answering, *said) for name, said in _FEW.items()},
})  # fmt: skip
"""By the name of the profile."""
