"""Pico's PT-104 over Ethernet (UDP) as a port of lines: a channel with its resistance, and its temperature from 0 °C on.

Commands, answers and the resistance of four wires are as the maker's example has them (picosdk-ethernet-protocol-examples,
UdpPt104.cs); the temperature is that of a Pt100 by IEC 60751, R = 100 Ω·(1 + A·t + B·t²).
"""

from __future__ import annotations

import contextlib
import math
import socket
import struct
import time

from cmm_uq.base.errors import CmmUqError
from cmm_uq.laboratory.live.instruments import source

SCHEME = "pt104://"
A, B = 3.9083e-3, -5.775e-7  # 1/°C and 1/°C²
ALIVE_S = 10.0  # 15 s after the last sign of life it unlocks itself
_MAINS_50_HZ, _CONVERT, _EEPROM, _UNLOCK, _ALIVE = b"\x30\x00", b"\x31", b"\x32", b"\x33", b"\x34"
_ALL = b"\xff"  # the channels that convert in the lower four bits, those up to 375 Ω in the upper
_COUNTS = struct.Struct(">BiBiBiBi")  # of one channel: four measurements, each with its number before it
_LARGEST = 2048


def opener(port: str) -> source.PortOpener:
    """What opens ``pt104://host:port``."""
    address = source.ADDRESS.fullmatch(port)
    if address is None or not 0 < int(address["port"]) < 65536:
        raise CmmUqError("is no address", where=port, fix=f"Write it as {SCHEME}host:port")
    return lambda: Pt104Port(address["host"].strip("[]"), int(address["port"]), port)


class Pt104Port:
    """All four channels, one after the other; its first line says which one it is. Locked, so that nobody else reads it."""

    def __init__(self, host: str, port: int, name: str) -> None:
        self._socket = socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.connect((host, port))
            self._asked(b"lock", b"lock success")
            eeprom = self._asked(_EEPROM, b"eeprom=")[7:]
            self._factors = struct.unpack_from("<4i", eeprom, 37)  # µΩ
            self._asked(_MAINS_50_HZ, b"mains changed")
            self._asked(_CONVERT + _ALL, b"converting")
        except (OSError, struct.error) as error:
            self._socket.close()
            fix = "Check address, cable and power, and that no other computer reads it"
            raise CmmUqError(f"no PT-104 answers: {error}", where=name, fix=fix) from None
        self._waiting = b"PT-104,%s\r\n" % eeprom[19:29].strip(b" \0")
        self._alive_at = time.monotonic()

    def _asked(self, command: bytes, begins: bytes) -> bytes:
        """The answer to a command, which begins with a word; measurements come in between."""
        self._socket.send(command)
        until = time.monotonic() + source.CONNECT_WITHIN_S
        while (left := until - time.monotonic()) > 0:
            self._socket.settimeout(left)
            if (answer := self._socket.recv(_LARGEST)).lower().startswith(begins):
                return answer
        raise TimeoutError("timed out")

    def read(self, *, wait: bool = True) -> bytes:
        waiting, self._waiting = self._waiting, b""
        if waiting:
            return waiting
        try:
            if (now := time.monotonic()) - self._alive_at > ALIVE_S:
                self._socket.send(_ALIVE)
                self._alive_at = now
            self._socket.settimeout(source.TICK_S if wait else 0)
            return self._line(self._socket.recv(_LARGEST))
        except (TimeoutError, BlockingIOError):
            return b""
        except OSError as error:
            raise source.PortLostError(error.strerror or str(error)) from None

    def _line(self, received: bytes) -> bytes:
        if received.lower().startswith(b"alive"):
            return b""
        numbers = _COUNTS.unpack(received)[::2] if len(received) == _COUNTS.size else ()
        if not numbers or numbers[0] not in (0, 4, 8, 12) or numbers != tuple(range(numbers[0], numbers[0] + 4)):
            return received + b"\r\n"
        zero, span, low, high = _COUNTS.unpack(received)[1::2]
        channel = numbers[0] // 4
        if span == zero:
            return b"%d open\r\n" % (channel + 1)
        ohm = self._factors[channel] * 1e-6 * (high - low) / (span - zero)
        under = A * A - 4 * B * (1 - ohm / 100)
        celsius = f" {(math.sqrt(under) - A) / (2 * B):.5f}" if ohm >= 100 and under >= 0 else ""
        return f"{channel + 1} {ohm:.5f}{celsius}\r\n".encode()

    def write(self, data: bytes) -> None: ...

    def close(self) -> None:
        with contextlib.suppress(OSError):
            self._socket.send(_CONVERT + b"\x00")
            self._socket.send(_UNLOCK)
        self._socket.close()
