"""What instruments say: each by its manual, written from the same sources as its profile and not from the profile."""

from __future__ import annotations

import re
from collections.abc import Mapping
from math import pi
from types import MappingProxyType


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


class PositionDisplay(Speaker):
    """ND 287: ESC commands, STX before what is asked for, NAK for what is not known; A0200 is without a decimal point."""

    usual = (-12345.6789,)

    def answer(self, command: str) -> bytes:
        if self.ill:
            return b"\x15"
        if command == "\x1bA0000":
            return b"\x02ND-287    \r\n646118-01 \r\nV1-01     \r\n"
        if command in ("\x1bA0100", "\x1bA0200"):
            value = self.readings[0]
            shown = f"{value:+.4f}" if command.endswith("0100") else f"{round(value * 1e4):+010d}"
            return f"\x02{shown}\r\n".encode()
        return b"\x15"


class Readout1529(Speaker):
    """Fluke 1529: SCPI, a bare number for each channel."""

    usual = (20.0132, 20.1044, 19.9871, 21.0)

    def answer(self, command: str) -> bytes:
        if asked := re.fullmatch(r"(?:FETC|FETCH|READ|MEAS)\? ?([1-4])", command, re.IGNORECASE):
            return b"9.9E37\r\n" if self.ill else f"{self.readings[int(asked[1]) - 1]:.4f}\r\n".encode()
        return b"HART,1529,A12345,1.2\r\n" if command.upper() == "*IDN?" else b""


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


class Sylvac(Speaker):
    """Sylvac: ? gives the value, ERR and a number what is wrong; commands are echoed."""

    usual = (12.345,)

    def answer(self, command: str) -> bytes:
        if command in ("?", "PRI"):
            return b"ERR3\r" if self.ill else f"{self.readings[0]:+09.3f}\r".encode()
        return {"ID?": b"SYLVAC Z_CAL\r", "MM": b"MM\r"}.get(command, b"ERR1\r")


class Autocollimator(Speaker):
    """Elcomat 3000: a absolute, r relative."""

    usual = (4.5, -2.3)

    def answer(self, command: str) -> bytes:
        if command not in ("a", "r"):
            return b""
        (x, y), (sort, status) = self.readings, (4, "003") if command == "a" else (2, "103")
        return f"{sort} 001 {x:.2f}\r".encode() if self.ill else f"{sort} {status} {x:.2f} {y:.2f}\r".encode()


class Handheld1522(Speaker):
    """Fluke 1521 and 1522: fetch? and its other names, without an echo."""

    usual = (25.587,)

    def answer(self, command: str) -> bytes:
        if command.lower() in ("f", "fetch?", "read?", "meas?"):
            return b"t:------ C\r\n" if self.ill else f"t:{self.readings[0]:.3f} C\r\n".encode()
        return b""


class Micrometer7000(Speaker):
    """Keyence LS-7000: M with the outputs that are meant and whether their comparisons are; ER where it cannot."""

    usual = (1.345, 24.6234)

    def answer(self, command: str) -> bytes:
        if self.ill:
            return f"ER,{command[:2]},01\r".encode()
        if command not in ("M0,0", "M1,0", "M2,0"):
            return f"ER,{command[:2]},00\r".encode()
        of = {"0": self.readings, "1": self.readings[:1], "2": self.readings[1:]}[command[1]]
        return (",".join([command[:2], *(f"{value:+08.4f}" for value in of)]) + "\r").encode()


class Column1202(Speaker):
    """Mahr Millimar C1202: features, each by its number, with sign, leading zeros, unit and tolerance."""

    usual = (-12.34,)

    def answer(self, command: str) -> bytes:
        if command == "ID?":
            return b"1 T 52401234 1 S 19051234 2 T 52401235 2 S 19051235\r"
        return (
            (b"1 ERR6\r" if self.ill else f"1 {self.readings[0]:+07.2f} mm =\r".encode()) if command == "M1?" else b""
        )


class Tesa80(Speaker):
    """TESA TT80: ? for what it displays, by commands that end with CR."""

    usual = (-12.34,)

    def answer(self, command: str) -> bytes:
        return (b"ERR23\r\n" if self.ill else f"{self.readings[0]:+08.2f}\r\n".encode()) if command == "?" else b""


class TotalStation(Speaker):
    """Leica by GeoCOM: the angles of RPC 2003, in rad, with what else it measured."""

    usual = (57.29577951308232, 90.0)

    def answer(self, command: str) -> bytes:
        if command != "%R1Q,2003:1":
            return b"%R1P,0,0:3\r\n"
        hz, v = (value * pi / 180 for value in self.readings)
        rest = "4.8E-6,1234,0.0001,-0.0002,4.8E-6,1234,0"
        return b"%R1P,0,0:1285\r\n" if self.ill else f"%R1P,0,0:0,{hz:.16f},{v:.16f},{rest}\r\n".encode()


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


SPEAKERS: Mapping[str, type[Speaker]] = MappingProxyType({
    "vaisala-ptu300": Vaisala, "vaisala-ptb330": Barometer, "heidenhain-nd287": PositionDisplay, "fluke-1529": Readout1529,
    "fluke-1502a": Readout1502, "isotech-millik": MilliK, "mitutoyo-digimatic": Digimatic, "sylvac-rs232": Sylvac,
    "fluke-1522": Handheld1522, "keyence-ls7000": Micrometer7000, "mahr-millimar-c1202": Column1202, "tesa-tt80": Tesa80,
    "leica-geocom": TotalStation,
    "moeller-wedel-elcomat": Autocollimator, "thermocouple-logger-11": Thermocouples, "line-logger": Lines,
})  # fmt: skip
"""By the name of the profile."""
