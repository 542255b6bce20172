"""Text, XML and numbers of a file, in whatever encoding and with whatever decimal sign it was exported.

XML has no entities, and no external documents. One group of three digits after a comma, and nothing else in the file to go by,
may be thousands or thousandths: that is refused, never guessed. A point alone is a decimal point.
"""

from __future__ import annotations

import codecs
import re
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import lru_cache
from itertools import pairwise
from xml.etree.ElementTree import Element, ParseError

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.csv_table import GIVE, LARGEST, number_problem, numbers
from cmm_uq.base.files.limits import LINES
from cmm_uq.base.points import Floats
from cmm_uq.jobs.importing.format import Cell, WrittenUnit, apart, unit_named

_MARKS = (
    (codecs.BOM_UTF8, "utf-8-sig", "UTF-8 with a byte-order mark"),
    (codecs.BOM_UTF32_LE, "utf-32", "UTF-32"),
    (codecs.BOM_UTF16_LE, "utf-16", "UTF-16"),
    (codecs.BOM_UTF16_BE, "utf-16", "UTF-16"),
)
_TITLES = {"utf-8": "UTF-8", "utf-16": "UTF-16", "latin-1": "ISO 8859-1", "cp932": "Shift JIS", "gb18030": "GB 18030"}
_TITLES |= {f"cp{number}": f"Windows-{number}" for number in (1250, 1251, 1252, 1253, 1254, 949)}
_TITLES |= {f"cp{number}": f"code page {number}" for number in (850, 852, 866)} | {"big5": "Big5"}
_WESTERN = "äöüß àâæçéèêëîïôùûüÿœ àèéìíîòóùú áéíóúñü ãõáâàçéêíóôúü åäöéü æøåéöä ëïéèóáüöç áéíóúýþæöð"
_EASTERN = "áčďéěíňóřšťúůýžôľĺŕä ąćęłńóśźż áéíóöőúüű ăâîşţșț čćđšž"
_CYRILLIC = "абвгдежзийклмнопрстуфхцчшщъыьэюяё№ґєії"
# letters beside a to z of one language each
_ALPHABETS = {"cp1252": _WESTERN, "cp1250": _EASTERN, "cp1254": "çğıiöşüâîû", "cp1251": _CYRILLIC}
_ALPHABETS |= {"cp1253": "αβγδεζηθικλμνξοπρστυφχψωςάέήίόύώϊϋΐΰ"}
_ALPHABETS |= {"cp850": _WESTERN, "cp852": _EASTERN, "cp866": _CYRILLIC}
_LAST_LATIN = "\u024f"
# of Arabic and Persian, and their signs of decimals and thousands
_FIGURES = {**{first + k: str(k) for first in (0x660, 0x6F0) for k in range(10)}, 0x66B: ".", 0x66C: "\u202f"}
_SIGNS = {*"µμ°±²³«»–—„“”‚‘’…·×÷§©®€ΔΩ∅≤≥¼½¾¹ªº†•™\u00a0\u202f\ufeff"}
_DIAMETER = re.compile(r"(?<![^\W\d_])Ø(?![^\W\d_])")
_WITHIN = re.compile(r"(?<=[^\W\d_])[³²¹¿¾¼½ªº](?=[^\W\d_])")  # a word, in which signs are letters of another encoding
# first and last bytes, ahead of the frequent ideographs or syllables of two, by which those standards begin; least second byte
_LEADS = {"cp932": (0x81, 0x98, 0x40), "cp949": (0xA1, 0xC8, 0xA1)}
_LEADS |= {"gb18030": (0xA1, 0xD7, 0xA1), "big5": (0xA1, 0xC6, 0x40)}
_SAMPLE = 5000  # characters by which an encoding is known
_FIX = "Export it again, or name encoding"
_REPORT_LINE = 2000  # characters of a line of a report, which has 80 to 200


def decoded(content: bytes, where: str, asked: str | None = None) -> tuple[str, str]:
    """Text of a file, and what its encoding is called.

    A byte-order mark decides; without one, UTF-16 shows by a zero in every other byte, UTF-8 by being valid; of the others
    that is taken in which most characters are letters of one language, or frequent ones of two bytes, Windows-1252 before all.
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
    return text if text.isascii() else text.translate(_FIGURES), title


def _without_mark(content: bytes) -> str:
    head = content[:4096]
    if len(head) >= 4 and head.count(0) > len(head) // 4:
        return "utf-16-le" if head[1::2].count(0) > head[::2].count(0) else "utf-16-be"
    if content.isascii():
        return "utf-8"
    with suppress(UnicodeDecodeError):
        content.decode("utf-8")
        return "utf-8"
    lines = b"\n".join(line for line in content.splitlines() if not line.isascii())[:_SAMPLE]
    known = _known(lines)
    return "latin-1" if known == "cp1252" and any(byte in content for byte in b"\x81\x8d\x8f\x90\x9d") else known


@lru_cache(maxsize=16)
def _known(lines: bytes) -> str:
    return max((*_ALPHABETS, *_LEADS), key=lambda codec: _explained(lines, codec))  # of those alike the first


def _explained(content: bytes, codec: str) -> float:
    """Which part of the characters that are not ASCII are signs, or letters of one language, in words of one case."""
    text = _WITHIN.sub("\ufffd", _DIAMETER.sub("", content.decode(codec, errors="replace")))
    others = [c for c in text if c > "\x7f" and c not in _SIGNS]
    if codec in _LEADS:
        first, last, least = _LEADS[codec]
        cells = (c.encode(codec, errors="replace") for c in others)
        known = sum(len(own) == 2 and first <= own[0] <= last and own[1] >= least for own in cells)
    else:
        known = max(sum(c.lower()[0] in own for c in others) for own in map(set, _ALPHABETS[codec].split()))
        known -= sum(_ill_joined(a, b) for a, b in pairwise(text))
    return known / len(others) if others else 1.0


def _ill_joined(a: str, b: str) -> bool:
    """Whether two characters stand beside each other in no word: a small letter before a capital one, two scripts."""
    if max(a, b) < "\x80" or not (a.isalpha() and b.isalpha()) or a in "µªº":
        return False
    return (a.islower() and b.isupper()) or (min(a, b) < "\x80" and max(a, b) > _LAST_LATIN)


def report_lines(content: bytes, where: str, asked: str | None = None) -> tuple[list[str], str]:
    """Lines of a report, none of them longer than a report's can be, and what its encoding is called."""
    text, title = decoded(content, where, asked)
    lines = text.splitlines()
    if len(lines) > LINES.most:
        raise CmmUqError(f"has {len(lines)} lines, {LINES.most} are the most", where=where, fix="Split the report")
    longest, line = max(((len(line), -i) for i, line in enumerate(lines, 1)), default=(0, 0))
    if longest > _REPORT_LINE:
        problem = f"the line has {longest} characters, {_REPORT_LINE} are the most in a report"
        raise CmmUqError(problem, where=f"{where} line {-line}", fix="Export it again as text")
    return lines, title


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


_E = r"(?:[eE][+-]?\d+)?"
_BLANKS = " \u00a0\u202f\u2009'’"
# A comma that can only be a decimal one
_COMMA_DECIMAL = re.compile(
    rf"^[+-]?(?:\d{{1,3}}(?:[.{_BLANKS}]\d{{3}})+,\d+|0\d*,\d+|\d{{4,}},\d+|\d*,(?:\d{{1,2}}|\d{{4,}})|,\d+"
    rf"|\d+,\d+(?=[eE])){_E}$", re.MULTILINE,
)  # fmt: skip
# commas that can only be between groups of three digits
_COMMA_GROUPS = re.compile(rf"^[+-]?[1-9]\d{{0,2}}(?:(?:,\d{{3}})+\.\d*|(?:,\d{{3}}){{2,}}){_E}$", re.MULTILINE)
# A point that can only be a decimal one
_POINT_DECIMAL = re.compile(
    rf"^[+-]?(?:0\d*\.\d+|\d{{4,}}\.\d*|\d*\.(?:\d{{1,2}}|\d{{4,}})?|\.\d+|\d+\.\d+(?=[eE])){_E}$", re.MULTILINE
)
_TWO_COMMAS = re.compile(r",\d*,")
_POINT_GROUPS = re.compile(r"^[+-]?[1-9]\d{0,2}(?:\.\d{3}){2,}$", re.MULTILINE)
# A number with groups of three digits
_GROUPED = {
    sign: re.compile(rf"[+-]?\d{{1,3}}(?:(?:[{_BLANKS}]\d{{3}})+|(?:{group}\d{{3}})+)(?:{mark}\d*)?{_E}")
    for sign, mark, group in ((".", r"\.", ","), (",", ",", r"\."))
}
At = Callable[[int, int], str]  # place of a cell, by indices of column and row


def decimal_sign(columns: Sequence[Sequence[Cell]], at: At, asked: str | None, most: float = np.inf) -> str:
    """The decimal sign of the numbers of a table, of which none is larger than ``most``."""
    if asked is not None:
        return asked
    texts = ["\n".join([cell if isinstance(cell, str) else "" for cell in column]) for column in columns]
    if not any("," in text for text in texts):
        return "," if any(_POINT_GROUPS.search(text) for text in texts) else "."
    points = any("." in text for text in texts)
    comma = _first(texts, (_COMMA_DECIMAL, _POINT_GROUPS) if points else (_COMMA_DECIMAL,))
    groups = (_COMMA_GROUPS,) if any(_TWO_COMMAS.search(text) for text in texts) or points else ()
    point = _first(texts, (*groups, _POINT_DECIMAL) if points else groups)
    if comma and point:
        problem = f"{comma[2]!r} has a decimal comma, and {point[2]!r} ({at(*point[:2])}) has a decimal point"
        fix = "Export it again with one decimal sign; if it was put together, mend the odd rows"
        raise CmmUqError(problem, where=at(*comma[:2]), fix=fix)
    if comma or point:
        return "," if comma else "."
    i = next(i for i, text in enumerate(texts) if "," in text)
    row, value = next((row, str(cell)) for row, cell in enumerate(columns[i]) if isinstance(cell, str) and "," in cell)
    thousands = (text.replace(",", "").lstrip("+-−") for own in texts for text in own.split("\n") if "," in text)
    if any(text.isdecimal() and float(text) > most for text in thousands):
        return ","
    problem = f"{value!r} can be {value.replace(',', '')} or {value.replace(',', '.')}, and no number of the file tells"
    raise CmmUqError(problem, where=at(i, row), fix='Say decimal = "," or decimal = "."')


def _first(texts: Sequence[str], patterns: Sequence[re.Pattern[str]]) -> tuple[int, int, str] | None:
    """Column, row and text of the first cell that shows one of the patterns."""
    for i, text in enumerate(texts):
        for pattern in patterns:
            if found := pattern.search(text):
                return i, text.count("\n", 0, found.start()), found[0]
    return None


def split_units(cells: Sequence[Cell], at: Callable[[int], str]) -> tuple[Sequence[Cell], WrittenUnit | None]:
    """Cells without the unit that all of them end in, and that unit."""
    first = next((cell for cell in cells if isinstance(cell, str) and cell), None)
    parts = apart(first) if first else None
    if parts is None:
        return cells, None
    unit, bare = parts[1], list(cells)
    for row, cell in enumerate(cells):
        if cell == "":
            continue
        own = apart(cell) if isinstance(cell, str) else None
        if own is None or own[1] != unit:
            raise CmmUqError(f"{cell!r} among numbers in {unit.name}: the column mixes units", where=at(row),
                             fix="Export the column in one unit")  # fmt: skip
        bare[row] = own[0]
    return bare, unit


def values_of(cells: Sequence[Cell], sign: str, at: Callable[[int], str], fix: str = GIVE) -> Floats:
    """Values (n,) of cells."""
    sorts = set(map(type, cells))
    if str not in sorts:
        values = np.array(cells, dtype=np.float64)
        bad = np.flatnonzero(~(np.abs(values) <= LARGEST))
        if bad.size:
            raise CmmUqError(f"{values[bad[0]]:g} is no number that can be used", where=at(int(bad[0])), fix=fix)
        return values
    if len(sorts) > 1:
        return np.array([values_of([cell], sign, lambda _, row=row: at(row), fix)[0] for row, cell in enumerate(cells)])  # type: ignore[misc]
    texts: Sequence[str] = cells  # type: ignore[assignment]
    joined = "\n".join(texts)
    if "−" in joined:
        joined = joined.replace("−", "-")
        texts = joined.split("\n")
    if (sign == "," and "." in joined) or (sign == "." and "," in joined) or any(blank in joined for blank in _BLANKS):
        texts = [_plain(text, sign, row, at) for row, text in enumerate(texts)]
    elif sign == ",":
        texts = joined.replace(",", ".").split("\n")
    return numbers(texts, at, fix)


def _plain(text: str, sign: str, row: int, at: Callable[[int], str]) -> str:
    """A number with a decimal point and no groups; whatever is no number stays as it is, and is refused as such."""
    other = "." if sign == "," else ","
    if other in text or any(blank in text for blank in _BLANKS):
        if _GROUPED[sign].fullmatch(text):
            text = text.translate(_WITHOUT[sign])
        elif other in text and number_problem(text.replace(other, ".")) is None:
            raise CmmUqError(f"{text!r} has its decimal sign as {other!r}, the others as {sign!r}", where=at(row),
                             fix="Export the table again with one decimal sign")  # fmt: skip
    return text.replace(",", ".") if sign == "," else text


_WITHOUT = {sign: str.maketrans("", "", other + _BLANKS) for sign, other in ((".", ","), (",", "."))}


def is_number(cell: Cell) -> bool:
    """Whether a cell is a number in any of the ways of writing one."""
    if not isinstance(cell, str):
        return True
    plain = cell.replace("−", "-")
    if (parts := apart(plain)) is not None and unit_named(plain) is None:
        plain = parts[0]
    grouped = any(pattern.fullmatch(plain) for pattern in _GROUPED.values())
    return grouped or number_problem(plain.replace(",", ".")) is None
