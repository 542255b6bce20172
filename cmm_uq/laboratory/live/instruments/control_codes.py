"""Bytes as manuals write them: ``<ESC>A0200<CR>``, with a control character by its name and any byte as ``<0x41>``."""

from __future__ import annotations

import re

from cmm_uq.base.errors import printable

NAMES = (
    "NUL", "SOH", "STX", "ETX", "EOT", "ENQ", "ACK", "BEL", "BS", "HT", "LF", "VT", "FF", "CR", "SO", "SI", "DLE",
    "DC1", "DC2", "DC3", "DC4", "NAK", "SYN", "ETB", "CAN", "EM", "SUB", "ESC", "FS", "GS", "RS", "US",
)  # fmt: skip
"""Of the characters 0 to 31 (ISO/IEC 646)."""

_CODES = {name: bytes([code]) for code, name in enumerate(NAMES)} | {"DEL": b"\x7f"}
_WRITTEN = re.compile(r"<(?:([A-Z]{2,3}\d?)|0x([0-9A-Fa-f]{2}))>")


def bytes_of(text: str) -> bytes:
    """The bytes that are meant; what stands in angle brackets and is no name is taken as it is written.

    Raises
    ------
    ValueError : a character that is no single byte.
    """
    found, place = b"", 0
    for written in _WRITTEN.finditer(text):
        code = bytes.fromhex(written[2]) if written[2] else _CODES.get(written[1], written[0].encode())
        found += _plain(text[place : written.start()]) + code
        place = written.end()
    return found + _plain(text[place:])


def shown(data: bytes) -> str:
    """Bytes as :func:`bytes_of` reads them again, on one line that a terminal shows."""
    return "".join(_shown(byte) for byte in data)


def _shown(byte: int) -> str:
    if byte < len(NAMES):
        return f"<{NAMES[byte]}>"
    if byte == 0x7F:
        return "<DEL>"
    return printable(chr(byte)) if byte < 0x80 else f"<0x{byte:02X}>"


def _plain(text: str) -> bytes:
    try:
        return text.encode("latin-1")
    except UnicodeEncodeError as error:
        raise ValueError(f"{text[error.start]!r} is no single byte: write each byte as <0x41>") from None
