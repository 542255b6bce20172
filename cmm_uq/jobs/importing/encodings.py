"""Text and XML of a file, in whatever encoding it was exported in: no entities, no external documents."""

from __future__ import annotations

import codecs
from xml.etree.ElementTree import Element, ParseError

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.limits import LINES

_MARKS = (
    (codecs.BOM_UTF8, "utf-8-sig", "UTF-8 with a byte-order mark"),
    (codecs.BOM_UTF32_LE, "utf-32", "UTF-32"),
    (codecs.BOM_UTF16_LE, "utf-16", "UTF-16"),
    (codecs.BOM_UTF16_BE, "utf-16", "UTF-16"),
)
_TITLES = {"utf-8": "UTF-8", "utf-16": "UTF-16", "cp1252": "Windows-1252", "latin-1": "ISO 8859-1"}
_FIX = "Export it again, or name encoding"
_REPORT_LINE = 2000  # characters of a line of a report, which has 80 to 200


def decoded(content: bytes, where: str, asked: str | None = None) -> tuple[str, str]:
    """Text of a file, and what its encoding is called.

    A byte-order mark decides; without one, UTF-16 shows by a zero in every other byte, UTF-8 by being valid; what remains is
    Windows-1252, which has every character of ISO 8859-1 in the same place.
    """
    mark = next((found for found in _MARKS if content.startswith(found[0])), None)
    if mark is not None and (asked is None or mark[1].startswith(asked)):
        codec, title = mark[1], mark[2]
    else:
        codec = asked or _without_mark(content)
        title = _TITLES.get(codec, "UTF-16")
    try:
        text = content.decode(codec)
    except UnicodeDecodeError as error:
        line = content[: error.start].count(b"\n") + 1
        raise CmmUqError(f"is no text in {title}", where=f"{where} line {line}", fix=_FIX) from None
    if "\0" in text:
        line = text[: text.index("\0")].count("\n") + 1
        raise CmmUqError("has zero bytes in it: it is damaged, or no text", where=f"{where} line {line}", fix=_FIX)
    return text, title


def _without_mark(content: bytes) -> str:
    head = content[:4096]
    if len(head) >= 4 and head.count(0) > len(head) // 4:
        return "utf-16-le" if head[1::2].count(0) > head[::2].count(0) else "utf-16-be"
    try:
        content.decode("utf-8")
    except UnicodeDecodeError:
        return "cp1252" if not any(byte in content for byte in b"\x81\x8d\x8f\x90\x9d") else "latin-1"
    return "utf-8"


def report_lines(text: str, where: str) -> list[str]:
    """Lines of a report, none of them longer than a report's can be."""
    lines = text.splitlines()
    if len(lines) > LINES.most:
        raise CmmUqError(f"has {len(lines)} lines, {LINES.most} are the most", where=where, fix="Split the report")
    longest, line = max(((len(line), -i) for i, line in enumerate(lines, 1)), default=(0, 0))
    if longest > _REPORT_LINE:
        raise CmmUqError(f"the line has {longest} characters, {_REPORT_LINE} are the most in a report",
                         where=f"{where} line {-line}", fix="Export it again as text")  # fmt: skip
    return lines


def head_text(head: bytes) -> str:
    """The beginning of a file as text, for recognising it: whatever cannot be read is replaced."""
    mark = next((found for found in _MARKS if head.startswith(found[0])), None)
    codec = mark[1] if mark else _without_mark(head[: head.rfind(b"\n") + 1] or head)
    return head.decode(codec, errors="replace")


HOSTILE_FIX = "Export it again; a measuring program writes no DOCTYPE or ENTITY"


def root_of(content: bytes, where: str) -> Element:
    from defusedxml.common import DefusedXmlException
    from defusedxml.ElementTree import fromstring

    try:
        root: Element = fromstring(content, forbid_dtd=True)
    except DefusedXmlException:
        raise CmmUqError("declares entities or a document type, which can be made to exhaust a machine", where=where,
                         fix=HOSTILE_FIX) from None  # fmt: skip
    except (ParseError, ValueError, LookupError) as error:
        line = getattr(error, "position", (0, 0))[0]
        raise CmmUqError(f"is damaged XML: {error}", where=f"{where} line {line}" if line else where,
                         fix="Export it again: it was cut off or changed") from None  # fmt: skip
    return root


def local(element: Element) -> str:
    """Name of an element without its namespace."""
    return str(element.tag).rpartition("}")[2]


def begins_with(head: bytes, *roots: str) -> bool:
    """Whether a file is XML whose root is one of these."""
    text = head_text(head).lstrip("\ufeff \r\n\t")
    return text.startswith("<") and any(f"<{root}" in text or f":{root}" in text for root in roots)
