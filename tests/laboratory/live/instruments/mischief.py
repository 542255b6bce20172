"""Simulated instruments and I++ servers that do wrong; what they do may be changed while they run."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass
from typing import Any

from cmm_uq.laboratory.live.instruments.ipp_server import SimulatedIppServer, fault
from cmm_uq.laboratory.live.instruments.simulated_line import SimulatedLine


@dataclass
class Mischief:
    hangs: bool = False
    halves: bool = False  # leaves out the second half of each message, or line of data
    noise: bytes = b""  # sends these bytes before each message
    garbled: bool = False  # sends other bytes than it means, as at a wrong baud rate
    a_byte_at_a_time: bool = False
    no_ack: bool = False
    exchanged: bool = False  # sends ``%`` where ``&`` belongs and the reverse, as some published programs do
    wrong_tag: bool = False


class UnreliableLine(SimulatedLine):
    def __init__(self, *of: Any) -> None:
        self.mischief = Mischief()
        super().__init__(*of)

    def restart(self) -> None:
        """Switch it off and on: it has forgotten what it was told, and says its banner."""
        with self._speaking, contextlib.suppress(OSError):
            self.speaker.__init__()  # type: ignore[misc]
            if self._wire is not None:
                self._wire.send(self.speaker.banner)

    def _say(self, wire: Any, data: bytes) -> None:
        if self.mischief.hangs or not data:
            return
        data = data[: len(data) // 2] if self.mischief.halves else data
        data = bytes(0x80 | (byte * 37 + 11) & 0x7F for byte in data) if self.mischief.garbled else data
        data = self.mischief.noise + data
        for part in map(bytes, zip(data)) if self.mischief.a_byte_at_a_time else [data]:
            wire.send(part)


class UnreliableIppServer(SimulatedIppServer):
    def __init__(self, **of: Any) -> None:
        self.mischief = Mischief()
        super().__init__(**of)

    def press(self, key: str) -> None:
        """The user presses a key (section 9.5.1)."""
        self._send(f'E0000 # KeyPress("{key}")')

    def trip(self, number: int = 500) -> None:
        """Something goes wrong by itself (section 6.2.4.1)."""
        self.state.error = True
        self._send(f"E0000 ! {fault(number, 'HealthCheck')}")

    def _command(self, body: bytes) -> None:
        if self.mischief.hangs:
            self.lines.append(f"> {body.decode('latin-1')}")
        else:
            super()._command(body)

    def _send(self, line: str) -> None:
        wrong, sign = self.mischief, line[6:7]
        if wrong.no_ack and sign == "&":
            return
        if wrong.exchanged and sign in ("&", "%"):
            line = f"{line[:6]}{'%' if sign == '&' else '&'}"
        if wrong.wrong_tag:
            line = f"9{line[1:]}"
        super()._send(line[: len(line) // 2] if wrong.halves and sign == "#" else line)

    def _put(self, data: bytes) -> None:
        super()._put(self.mischief.noise + data)
