"""Bytes are written as manuals write them, and read back the same."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cmm_uq.laboratory.live.instruments.profile import bytes_of, shown


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
