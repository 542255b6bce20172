"""Figures in cells with the steps of their last digits, and the units that stand above them or elsewhere in a file."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence

import numpy as np

from cmm_uq.jobs.importing.factors import LINE, hint
from cmm_uq.jobs.importing.format import LENGTH, UNITS, Cell, Sheet, WrittenUnit, apart, unit_named
from cmm_uq.jobs.importing.header import without_unit

_FIGURE = re.compile(r"[±<>≤≥~]?\s*([+-]?\d[\d .,'’]*|[+-]?[.,]\d+)(?:[eE][+-]?\d+)?")
_GROUPS = {sign: re.compile(rf"(?<=\d)[{other} '’](?=\d{{3}})") for sign, other in ((",", "."), (".", ","))}
_PLAIN = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?")
_DECIMAL = re.compile(r"^[^\d]*\d+[.,]\d+\D*$")
_SAYS_UNIT = re.compile(r"\bunits?\s*[=:]\s*(\w+)", re.IGNORECASE)
_MENTION = re.compile(r"[^\W\d_]+|µ\w+|\"")
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
