"""What each instrument answers, by its manual; written from the same sources as the profiles and not from the profiles."""

from __future__ import annotations

import re
from collections.abc import Mapping
from types import MappingProxyType


class Speaker:
    """An instrument that is asked, or that speaks by itself every so often, of readings in the unit that it sends."""

    ends = b"\r"
    """What ends a command; CR and LF are both taken for it where it is CR."""
    banner = b""
    """What it says when it is switched on."""
    every_s = 0.0
    usual: tuple[float, ...] = (20.0,)

    def __init__(self) -> None:
        self.readings = list(self.usual)
        self.ill = False
        self._waiting = b""

    def hear(self, received: bytes) -> bytes:
        self._waiting += received
        *commands, self._waiting = re.split(rb"[\r\n]", self._waiting)
        return b"".join(self.answer(command.decode("latin-1").strip()) for command in commands if command)

    def answer(self, command: str) -> bytes:
        """Answer to one command; nothing to one that it does not know."""
        return b""

    def says(self) -> bytes:
        """What it sends by itself."""
        return b""

    def restarted(self) -> bytes:
        """It was switched off and on; what it says then."""
        self.__init__()  # type: ignore[misc]
        return self.banner


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
        word, _, rest = command.partition(" ")
        if word.lower() == "form":
            self._form = rest
            return b"OK\r\n>"
        if word.lower() == "smode":
            return b"Serial mode        : STOP\r\n>"
        if word.lower() == "send":
            return self._sent().encode("latin-1") + b">"
        if word == "?":
            lines = (
                f"{self.model} / 1.01",
                "Serial number  : A1234567",
                "Batch number   : B8901234",
                "Baud P D S     : 4800 E 7 1",
            )
            return ("\r\n".join(lines) + "\r\n>").encode()
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
    """PTB330."""

    model, flags = "PTB330", 3
    usual = (1013.02,)
    banner = b"PTB330 / 1.01\r\n"
    letters = ("P",)


class PositionDisplay(Speaker):
    """ND 287: ESC commands, STX before what is asked for, NAK for what is not known."""

    usual = (-12345.6789,)

    def answer(self, command: str) -> bytes:
        if self.ill:
            return b"\x15"
        if command == "\x1bA0000":
            return b"\x02ND-287    \r\n646118-01 \r\nV1-01     \r\n"
        if command in ("\x1bA0100", "\x1bA0200"):
            value = self.readings[0]
            return f"\x02{'-' if value < 0 else '+'}{abs(value):.4f}\r\n".encode()
        return b"\x15"


class Readout1529(Speaker):
    """Fluke 1529: SCPI, a bare number for each channel."""

    usual = (20.0132, 20.1044, 19.9871, 21.0)

    def answer(self, command: str) -> bytes:
        asked = re.fullmatch(r"(?:FETC|FETCH|READ|MEAS)\? ?([1-4])", command, re.IGNORECASE)
        if asked:
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
        x, y = self.readings
        kinds = {"a": (4, "003"), "r": (2, "103")}
        if command not in kinds:
            return b""
        sort, status = kinds[command]
        return f"{sort} 001 {x:.2f}\r".encode() if self.ill else f"{sort} {status} {x:.2f} {y:.2f}\r".encode()


class Thermocouples(Speaker):
    """Eleven channels, a line a scan."""

    every_s = 0.1
    usual = (20.11, 20.13, 20.09, 20.31, 20.3, 20.28, 20.55, 20.52, 20.57, 20.02, 19.87)

    def says(self) -> bytes:
        shown = [9999.0, *self.readings[1:]] if self.ill else self.readings
        return ("14:03:22," + ",".join(f"{value:.2f}" for value in shown) + "\r\n").encode()


class Lines(Speaker):
    """A logger of three numbers."""

    every_s = 0.1
    usual = (20.01, 20.02, -3.0)

    def says(self) -> bytes:
        return (b"open\r\n") if self.ill else ("; ".join(map(str, self.readings)) + "\r\n").encode()


SPEAKERS: Mapping[str, type[Speaker]] = MappingProxyType({
    "vaisala-ptu300": Vaisala, "vaisala-ptb330": Barometer, "heidenhain-nd287": PositionDisplay, "fluke-1529": Readout1529,
    "fluke-1502a": Readout1502, "isotech-millik": MilliK, "mitutoyo-digimatic": Digimatic, "sylvac-rs232": Sylvac,
    "moeller-wedel-elcomat": Autocollimator, "thermocouple-logger-11": Thermocouples, "line-logger": Lines,
})  # fmt: skip
"""By the name of the profile."""
