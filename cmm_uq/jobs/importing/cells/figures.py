"""Figures in cells with the steps of their last digits, and the units that stand above them or elsewhere in a file."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence

import numpy as np

from cmm_uq.jobs.importing.factors import LINE, hint
from cmm_uq.jobs.importing.format import LENGTH, UNITS, Cell, Sheet, WrittenUnit, apart, unit_named
from cmm_uq.jobs.importing.header import plain_words, without_unit, words_of

_FIGURE = re.compile(r"[±<>≤≥~]?\s*([+-]?\d[\d .,'’]*|[+-]?[.,]\d+)(?:[eE][+-]?\d+)?")
_GROUPS = {sign: re.compile(rf"(?<=\d)[{other} '’](?=\d{{3}})") for sign, other in ((",", "."), (".", ","))}
_PLAIN = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?")
_DECIMAL = re.compile(r"^[^\d]*\d+[.,]\d+\D*$")
_SAYS_UNIT = re.compile(r"\bunits?\s*[=:]\s*(\w+)", re.IGNORECASE)
_MENTION = re.compile(r"[^\W\d_]+|µ\w+|\"")
_SCRIPT = re.compile("[\u0400-\u04ff\u3040-\u30ff\u4e00-\u9fff\uac00-\ud7a3]")  # of no language that measures in inches
_ACCENTED = re.compile("[à-öø-ÿā-ž]")
# dates with the day or the year first, and temperatures in °C
_ELSEWHERE = re.compile(
    r"\b(?:1[3-9]|2\d|3[01])[/-]\d{1,2}[/-]\d{2,4}\b|\b\d{1,2}\.\d{1,2}\.(?:19|20)\d\d\b|\b\d{1,2}-[a-z]{3}-\d{4}|°\s?C\b"
    r"|\btemp[^\d\n]{0,30}\b(?:1[5-9]|2[0-8])[.,]\d",
    re.IGNORECASE,
)
_INCHES = re.compile(r"\b(?:inch|inches|zoll|pouces?|pollici|pulgadas?)\b", re.IGNORECASE)
_LONG_IN, _LONGEST_IN = 40.0, 120.0  # few artefacts are longer, and none
SMALL = ("um", "nm", "microinch")  # units of deviations
_POWER = 99  # of ten, beyond which a text is no figure
_LETTERED = re.compile(r"\s[A-Z]\s*$")  # which names, and is no unit


def figure(cell: Cell, sign: str) -> tuple[float, float] | None:
    """Value of a cell and the step of its last digit; ``None`` where it is no number."""
    if not isinstance(cell, str):
        text = f"{cell:.9f}".rstrip("0")
        return float(cell), 10.0 ** -len(text.partition(".")[2])
    text = cell.replace("−", "-").replace("\u00a0", " ").replace("\u202f", " ").strip()
    if (own := apart(text.lstrip("±<>≤≥~ "))) is not None:
        text = own[0].strip()
    if not _FIGURE.fullmatch(text):
        return None
    text = _GROUPS[sign].sub("", text.lstrip("±<>≤≥~ "))
    text = text.replace(",", ".") if sign == "," else text
    if not _PLAIN.fullmatch(text):
        return None
    mantissa, _, power = text.lower().partition("e")
    if abs(int(power[:5] or 0)) > _POWER or not np.isfinite(value := float(text)):
        return None
    return value, 10.0 ** (int(power or 0) - len(mantissa.partition(".")[2]))


def sign_of(rows: Sequence[Sequence[Cell]]) -> str:
    """The decimal sign that most figures of a sheet show."""
    texts = (cell for row in rows for cell in row if isinstance(cell, str) and _DECIMAL.match(cell) and len(cell) < 24)
    counts = Counter("," if text.rfind(",") > text.rfind(".") else "." for text in texts)
    return "," if counts[","] > counts["."] else "."


def unit_of(path: Sequence[str]) -> WrittenUnit | None:
    """The unit in the texts above a column: the lowest one."""
    for text in reversed(path):
        unit = text and (unit_named(text.strip("[]()<>{} ")) or without_unit(text.replace("\n", " "))[1])
        if unit and not (_LETTERED.search(text) and hint(text, lengths=True) == LINE):  # as ``Line C``
            return unit
    return None


def unit_elsewhere(sheets: Sequence[Sheet], *, small: bool) -> WrittenUnit | None:
    """The one unit of lengths, or of deviations, that the texts of a file say (``UNITS=IN``), else mention."""
    cells = (cell for sheet in sheets for row in sheet.rows for cell in row if isinstance(cell, str))
    texts = {cell for cell in cells if not cell[:1].isdigit()}
    said = {word for text in texts for word in _SAYS_UNIT.findall(text)}
    mentioned = {word for text in texts for word in _MENTION.findall(text) if len(word) > 1 and word.casefold() != "in"}
    for words in (said, mentioned):
        units = [unit for unit in map(unit_named, words) if unit and unit.sort == LENGTH]
        named = {unit.name for unit in units if (unit.name in SMALL) == small}
        if len(named) == 1:
            return UNITS[named.pop()]
    return None


def metric(sheets: Sequence[Sheet], sign: str, largest: float) -> bool:
    """Whether texts are of those who measure in mm: by decimal comma or script, by words of another language, or dates and °C.

    largest : figure, which in inches is the longer than artefacts are the less it needs.
    """
    text = "\n".join(" ".join(map(str, row)) for sheet in sheets for row in (*sheet.rows, (sheet.name,)))
    if _INCHES.search(text):
        return False
    words = {*re.findall(r"[^\W\d_]{3,}", text.casefold())}
    others = {word for word in words if _ACCENTED.search(word)}
    others |= {word for word in words if not words_of("metric")["words"].isdisjoint(plain_words(word))}
    if sign == "," or _SCRIPT.search(text) is not None or (len(others) > 1 and largest > _LONG_IN):
        return True
    return largest > _LONGEST_IN and _ELSEWHERE.search(text) is not None
