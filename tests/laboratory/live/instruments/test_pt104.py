"""A PT-104 over UDP: locked, converted by the calibration that it holds, kept alive, and named where it does not answer."""

from __future__ import annotations

import socket
import struct
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.laboratory.live.instruments import pt104
from cmm_uq.laboratory.live.instruments.library import profile_named
from cmm_uq.laboratory.live.instruments.source import Gap, Reading, Returned
from tests.laboratory.live.instruments.listening import listening, opened

CALIBRATIONS = (100_000_000, 100_200_000, 99_900_000, 100_000_001)  # µΩ
TABLE = {20.0: 107.79, 50.0: 119.40, 100.0: 138.51}  # of IEC 60751:2008, °C and Ω
HALF_A_DIGIT = 0.005 / 0.379  # of the table, by its slope at 100 °C


class Device:
    """Answers as the maker's example expects; ``counts``: four measurements by channel, sent when the next command comes."""

    def __init__(self) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", 0))
        self._socket.settimeout(0.05)
        self.port = f"pt104://127.0.0.1:{self._socket.getsockname()[1]}"
        self.heard: list[bytes] = []
        self.counts: dict[int, tuple[int, int, int, int]] = {}
        self.locked_by_another = self.hangs = False
        self._ends, self._peer = threading.Event(), ("", 0)
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def _serve(self) -> None:
        converts = False
        while not self._ends.is_set():
            try:
                command, self._peer = self._socket.recvfrom(100)
            except TimeoutError:
                command = b""
            if self.hangs:
                continue
            self.heard += [command] if command else []
            for answer in self._answers(command):
                self._socket.sendto(answer, self._peer)
            converts = command[1:] != b"\0" if command[:1] == b"1" else converts
            for channel, counts in self.counts.items() if converts else ():
                numbered = [each for i, count in enumerate(counts) for each in (4 * (channel - 1) + i, count)]
                self._socket.sendto(struct.pack(">BiBiBiBi", *numbered), self._peer)

    def _answers(self, command: bytes) -> list[bytes]:
        if command == b"lock":
            return [] if self.locked_by_another else [b"Lock Success"]
        if command == b"2":
            eeprom = bytearray(128)
            eeprom[19:29], eeprom[29:37] = b"AX123/45  ", b"01Feb26 "
            struct.pack_into("<4i", eeprom, 37, *CALIBRATIONS)
            return [b"Eeprom=" + bytes(eeprom)]
        return (
            [{b"0": b"Mains Changed", b"1": b"Converting", b"4": b"Alive"}[command[:1]]]
            if command[:1] in b"014" and command
            else []
        )

    def close(self) -> None:
        self._ends.set()
        self._thread.join()
        self._socket.close()


@pytest.fixture
def device() -> Iterator[Device]:
    made = Device()
    yield made
    made.close()


def counts_of(ohm: float, channel: int) -> tuple[int, int, int, int]:
    """Of a resistance, with offsets of either pair that must drop out; the span as in the maker's arithmetic."""
    span = 1_000_000_000
    return 12_345, 12_345 + span, -777, -777 + round(ohm * span / (CALIBRATIONS[channel - 1] * 1e-6))


def test_resistances_and_temperatures_are_those_of_the_standards_table(device: Device) -> None:
    for channel, ohm in enumerate(TABLE.values(), 1):
        device.counts[channel] = counts_of(ohm, channel)
    device.counts[4] = counts_of(96.0859, 4)  # -10 °C
    with listening(opened(profile_named("pico-pt104"), device.port)) as heard:
        heard.until(lambda one: len({name for reading in one.good() for name in reading.values}) == 7)
        found = {name: value for reading in heard.good() for name, value in reading.values.items()}
        assert heard.source.identity().serial == "AX123/45"
    for channel, (celsius, ohm) in enumerate(TABLE.items(), 1):
        assert found[f"resistance{channel}_ohm"] == pytest.approx(ohm, abs=1e-5)
        assert found[f"temp{channel}_c"] == pytest.approx(celsius, abs=HALF_A_DIGIT)
    assert found["resistance4_ohm"] == pytest.approx(96.0859, abs=1e-5)
    assert "temp4_c" not in found
    assert device.heard[:4] == [b"lock", b"2", b"0\0", b"1\xff"]
    end = time.monotonic() + 10
    while b"3" not in device.heard and time.monotonic() < end:
        time.sleep(0.01)
    assert device.heard[-2:] == [b"1\0", b"3"]  # converts no more, and is free for another computer


def test_a_channel_without_a_probe_is_said_to_be_one_and_no_other_datagram_is_a_value(device: Device) -> None:
    port = pt104.opener(device.port)()
    try:
        assert port._line(struct.pack(">BiBiBiBi", 4, 5, 5, 5, 6, 0, 7, 9)) == b"2 open\r\n"  # type: ignore[attr-defined]
        for odd in (
            b"",
            b"Lock Success",
            struct.pack(">BiBiBiBi", 4, 0, 6, 9, 5, 0, 7, 9),
            b"\x10" + bytes(19),
            bytes(21),
        ):
            assert port._line(odd) == odd + b"\r\n"  # type: ignore[attr-defined]
        assert port._line(b"Alive") == b""  # type: ignore[attr-defined]
    finally:
        port.close()


def test_it_is_kept_alive(device: Device, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pt104, "ALIVE_S", 0.1)
    device.counts[1] = counts_of(107.7935, 1)
    with listening(opened(profile_named("pico-pt104"), device.port)) as heard:
        heard.until(lambda one: device.heard.count(b"4") >= 2)
        assert not [one for one in heard.of(Reading) if isinstance(one, Reading) and one.status]


def test_one_that_falls_silent_is_said_to_and_is_read_again_when_it_is_back(device: Device) -> None:
    profile = profile_named("pico-pt104")
    hasty = profile.model_copy(update={"send": profile.send.model_copy(update={"silent_after_s": 0.5})})
    device.counts[1] = counts_of(107.7935, 1)
    with listening(opened(hasty, device.port)) as heard:
        heard.until(lambda one: bool(one.good()))
        device.hangs = True
        heard.until(lambda one: bool(one.of(Gap)))
        time.sleep(1.2)  # silent twice: it may have been switched off, and have forgotten everything
        device.hangs = False
        heard.until(lambda one: bool(one.of(Returned)))
        assert device.heard.count(b"lock") >= 2


@pytest.mark.parametrize(("port", "told"), [
    ("pt104://127.0.0.1", "is no address"), ("pt104://127.0.0.1:0", "is no address"),
])  # fmt: skip
def test_what_is_no_address_is_refused(port: str, told: str) -> None:
    with pytest.raises(CmmUqError, match=told):
        opened(profile_named("pico-pt104"), port)


def test_one_that_another_computer_has_locked_is_named(device: Device, tmp_path: Path) -> None:
    device.locked_by_another = True
    with pytest.raises(CmmUqError, match="no PT-104 answers") as error:
        opened(profile_named("pico-pt104"), device.port)
    assert "no other computer reads it" in str(error.value)
