"""Bytes are written as manuals write them, and read back the same.

Every ready profile understands an instrument that speaks as its manual says, at a real pseudo-terminal or socket.

The simulated instruments are written from the manuals and not from the profiles.
"""

from __future__ import annotations

import itertools
import os
from pathlib import Path

import pytest
from hypothesis import given, strategies as st

from cmm_uq.laboratory.live.instruments.library import profile_named, ready
from cmm_uq.laboratory.live.instruments.profile import bytes_of, shown
from cmm_uq.laboratory.live.instruments.simulated_line import SPEAKERS, SimulatedLine, Way
from cmm_uq.laboratory.live.instruments.source import Reading
from tests.laboratory.live.instruments.listening import hasty, listening, opened


def test_names_are_those_of_iso_646() -> None:
    assert bytes_of("<ESC>A0200<CR><LF>") == b"\x1bA0200\r\n"
    assert bytes_of("<STX><ETX><NAK><0xAA><DEL>") == b"\x02\x03\x15\xaa\x7f"
    assert bytes_of("a<b>") == b"a<b>"


@given(st.binary(max_size=30).filter(lambda data: b"<" not in data and b"\\" not in data))
def test_what_is_shown_is_read_back(data: bytes) -> None:
    assert bytes_of(shown(data)) == data
    assert shown(data).isprintable()


def test_what_is_no_byte_is_refused() -> None:
    with pytest.raises(ValueError, match="no single byte"):
        bytes_of("20 €")


WAYS: list[Way] = ["pty", "socket", "rfc2217"]
EACH = [(name, way) for name, way in zip(SPEAKERS, itertools.cycle(WAYS), strict=False)] + [("fluke-1529", "pty")]
SERIALS = {"vaisala-ptu300": "A1234567", "vaisala-ptb330": "A1234567", "fluke-1529": "A12345", "fluke-1502a": "A24680",
           "isotech-millik": "21-P2460"}  # fmt: skip

pytestmark = pytest.mark.skipif(os.name == "nt", reason="no pseudo-terminals here")


def test_there_is_a_simulated_instrument_for_every_profile_of_messages() -> None:
    assert set(SPEAKERS) == {name for name in ready() if profile_named(name).protocol == "messages"}


@pytest.mark.parametrize(("name", "way"), EACH)
def test_values_are_what_the_instrument_measures_and_raw_is_what_it_sent(name: str, way: Way, tmp_path: Path) -> None:
    speaker = SPEAKERS[name]()
    with SimulatedLine(speaker, way, tmp_path) as line, listening(opened(hasty(name), line.port)) as heard:
        heard.until(lambda one: len(one.good()) >= len(speaker.readings))
        rounds = heard.good()[: len(speaker.readings)]
        found = [value for reading in rounds for value in reading.values.values()][: len(speaker.readings)]
        assert found == pytest.approx(speaker.readings, abs=1e-12)
        assert heard.source.identity().serial == SERIALS.get(name)
        readings = [event for event in heard.events if isinstance(event, Reading)]
        assert [one.number for one in readings] == list(range(1, len(readings) + 1))
        assert not [one for one in readings if one.status]
        assert all(one.utc_ns > 1_700_000_000_000_000_000 for one in readings)
        speaker.ill = True
        heard.until(lambda one: any(isinstance(e, Reading) and e.status for e in one.events))
        told = next(event for event in heard.events if isinstance(event, Reading) and event.status)
        assert "20.11" not in told.status
        assert len(told.values) in (0, len(speaker.readings) - 1)
