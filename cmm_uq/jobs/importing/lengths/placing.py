"""Where each line of a file lies: by what stands beside its lengths, else by what is said of it elsewhere."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence

import numpy as np

from cmm_uq.base.points import Floats
from cmm_uq.jobs.importing.blocks import CutSheet
from cmm_uq.jobs.importing.factors import LINE, hint
from cmm_uq.jobs.importing.format import Sheet
from cmm_uq.jobs.importing.header import LINES_BEFORE
from cmm_uq.jobs.importing.lengths.places import full_place, place_of_line, place_text, said_in, says_figures
from cmm_uq.jobs.importing.roles import SheetReading

AXES = {*"XYZ"}
_NEAR_MM = 1.0  # by which places are rounded
_SHOWN = 160  # characters of the words of a place
_LABEL = 30  # characters of the name of a line elsewhere
_WORDS = 60  # characters of what stands beside a line
DIAGONAL = re.compile(
    r"diag|[+-]?X ?[+-]Y ?[+-]Z|\b[PN]{3}\b"
    r"|[uú]hlop|przek|átló|köşegen|対角|对角|對角|대각|диагон|(?<![^\W_])(?:XY|XZ|YZ|XYZ)(?![^\W_])",
    re.IGNORECASE,
)
Elsewhere = Sequence[tuple[str, str, str]]
"""Rows that are no lengths: the first cell of each, its text, and its sheet."""


def stated_places(
    names: Sequence[str], texts: Sequence[str], elsewhere: Elsewhere, measured_mm: Sequence[float], mm: float, sign: str
) -> dict[str, tuple[str, str]]:
    """Where lines lie by the texts of each of their lengths, in mm with ``?`` for what is open, and the words that say it.

    elsewhere : they speak of the line whose name they have, or its number.
    """
    rows: dict[str, dict[str, float]] = {name: {} for name in names}
    shortest: dict[str, float] = {}
    for name, text, length in zip(names, texts, measured_mm, strict=True):
        rows[name][text] = max(rows[name].get(text, 0.0), length)
        shortest[name] = min(shortest.get(name, length), length)
    starts = {name: _starts(own, sign) for name, own in rows.items()}
    found = {}
    for name, own in rows.items():
        for more in ((), _about(name, rows, elsewhere)):
            said = [said_in([*_own(text, name, rows), *more], sign) for text in own]
            others = [one for other, starts_ in starts.items() if other != name for one in starts_]
            most, alone = max(own.values()), max(own.values()) - shortest[name] < _NEAR_MM
            place = place_of_line(said, most / mm, _NEAR_MM / mm, others, alone=alone)
            if place and (name not in found or "?" not in place):
                each = (one for text in (*own, *more) for one in text.split("\n") if says_figures(one))
                words = "; ".join(dict.fromkeys(each))
                found[name] = _in_mm(place, mm), words[:_SHOWN]
            if place and "?" not in place:
                break
    return found


def said_elsewhere(sheets: Sequence[Sheet], chosen: Sequence[tuple[SheetReading, CutSheet]]) -> Elsewhere:
    """Rows that are not read and may say where lines lie, each with the text in its first cell; none of places themselves."""
    if chosen[0][0].kind == "points":
        return []
    taken = {(grid.sheet.name, line) for reading, grid in chosen for line in reading.lines}
    found = []
    for grid in map(CutSheet, sheets):
        for row in range(min(len(grid.sheet.rows), LINES_BEFORE)):
            if (grid.sheet.name, grid.sheet.lines[row]) not in taken:
                texts = grid.says(row) if row in grid.block_of else [grid.line(row)]
                found.append((grid.text(row, 0), "\n".join(texts), grid.sheet.name))
    return [one for one in found if says_figures(one[1])]


def _starts(texts: Iterable[str], sign: str) -> list[Floats]:
    each = (said_in(text.split("\n"), sign) for text in texts)
    return [own for said in each if (own := full_place(said.start, said.across)) is not None][:1]


def _about(name: str, names: Mapping[str, Collection[str]], elsewhere: Elsewhere) -> list[str]:
    """Texts elsewhere with the name of a line up to that of another, or its number where each has its own; of one line all.

    names : of lines, with the texts of each, which begin with its sheet; one with a sheet of its own has all its texts.
    """
    numbers = {one: re.findall(r"\d+", one) for one in names}
    apart = len({*map(tuple, numbers.values())}) == len(names) and all(len(own) == 1 for own in numbers.values())
    first_ = {f for f, *_ in elsewhere if len(f) < _LABEL and apart and re.findall(r"\d+", f) == numbers[name]} | {name}
    sheets = {one: {text.partition("\n")[0] for text in own} for one, own in names.items()}
    alone = {sheet for sheet in sheets[name] if not any(sheet in own for one, own in sheets.items() if one != name)}
    found = [text for first, text, sheet in elsewhere if len(names) == 1 or first in first_ or sheet in alone]
    found += [part for _, text, _ in elsewhere for one, part in _parts(text, names) if one == name]
    return [line for text in dict.fromkeys(found) for line in text.split("\n")]


def _parts(text: str, names: Collection[str]) -> list[tuple[str, str]]:
    """Names of lines in a text, each with what follows up to the next."""
    called = {one: one for one in names}
    called |= {part: one for one in names for part in re.findall(r"\b[^\W\d_]+\d+\b", one)}  # as P1 of ``Position P1``
    lined = (one.split(" ", 1) for one in names if hint(one.split(" ", 1)[0], lengths=True) == LINE)
    called |= {own[1]: " ".join(own) for own in lined if len(own[-1]) > 2 and len(own) > 1}
    words = (
        re.escape(one) + r"(?=\s*[=:]\s*[^\s\d+-])" * (one.isdigit() or len(one) == 1)  # then ``A = along …``
        for one in sorted(called, key=len, reverse=True)
    )
    parts = [*re.finditer(rf"(?<!\w)(?:{'|'.join(words)})(?!\w)", text)]
    ends = [*(part.start() for part in parts[1:]), len(text)] if parts else []
    return [(called[part[0]], text[part.start() : end]) for part, end in zip(parts, ends, strict=True)]


def _own(text: str, name: str, names: Collection[str]) -> list[str]:
    """Lines of a text; of one that speaks of several lines what it says of this one."""
    lines = []
    for line in text.split("\n"):
        parts = _parts(line, names)
        lines += [part for one, part in parts if one == name] if len({one for one, _ in parts}) > 1 else [line]
    return lines


def place_of_axis(
    axis: str, texts: Iterable[str], mm: float, sign: str, targets: Sequence[float] = (0.0,)
) -> tuple[str, str] | None:
    """Where a run along an axis lies, its scale at 0, in mm: where a text that names it gives both other coordinates.

    targets : from the lowest; a start that is said is that of the first, as a diagonal is of 0.
    """
    found: dict[str, str] = {}
    if axis not in AXES and not targets[0]:  # a diagonal, whose targets count from its start
        own = [text for text in texts if says_figures(text)]
        place = place_of_line([said_in(own, sign)], targets[-1], _NEAR_MM / mm) if own else ""
        return (_in_mm(place, mm), "; ".join(own)[:_SHOWN]) if place and "?" not in place else None
    for text in texts:
        said = said_in([text], sign)
        named = hint(text, lengths=True) == LINE or {one[-1] for one in said.axes} == {axis}
        known = said.across | said.start
        if {*known} >= AXES - {axis} and named and not said.odd and not said.end:
            known[axis] = known.get(axis, targets[0]) - targets[0]
            place = f"along {axis} from {place_text(np.array([known[one] for one in 'XYZ']))}"
            found[_in_mm(place, mm)] = text
    return found.popitem() if len(found) == 1 else None


def _in_mm(place: str, mm: float) -> str:
    return (
        place if mm == 1 else re.sub(r"-?\d+(?:\.\d+)?(?:e[+-]?\d+)?", lambda one: f"{float(one[0]) * mm:.10g}", place)
    )


def words_beside(names: Sequence[str], texts: Sequence[str]) -> dict[str, str]:
    """What a file says beside all lengths of a line and of no other: of a line ``4`` that it is ``Diagonal A``."""
    own: dict[str, list[str]] = {}
    for name, text in zip(names, texts, strict=True):
        parts = [one.strip() for one in text.split("\n")]
        own[name] = [one for one in own.get(name, parts) if one in parts]
    count = Counter(part for parts in own.values() for part in {*parts})
    return {
        name: "; ".join(one for one in dict.fromkeys(parts) if one and one != name and count[one] == 1)[:_WORDS]
        for name, parts in own.items()
    }


def proposed(place: str, words: str = "") -> tuple[str, str]:
    """A place as far as a file says it, and an example of one, with two ends where the words are of a diagonal.

    Examples
    --------
    >>> proposed("along Y from ?,?,?"), proposed("along X from ?,800,400")[0], proposed("", "Diagonal A")[1]
    (('', 'along Y from 100,200,300'), 'along X from ?,800,400', 'from 100,200,300 to 500,600,700')
    """
    axes = {one[-1] for one in said_in([words]).axes}
    axis = axes.pop() if len(axes) == 1 else "" if DIAGONAL.search(words) else "X"
    example = f"along {axis} from 100,200,300" if axis else "from 100,200,300 to 500,600,700"
    return place if re.search(r"\d", place) else "", place.replace("?,?,?", "100,200,300") or example
