"""A sheet as people arrange it, as a table: a head of several rows as one, rows that are no figures left out by name.

An upper head stands over the columns up to the next one, units may stand in a row of their own, a label may stand in the first
row of those that it is of. What is left out is told with its place and why: a summary (mean, max, MPE), a remark, a head again
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import pairwise

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Verbatim, commas, say
from cmm_uq.jobs.columns import COORDINATES
from cmm_uq.jobs.importing.encodings import is_number
from cmm_uq.jobs.importing.format import Cell, Fact, Sheet, unit_named
from cmm_uq.jobs.importing.header import (
    LINES_BEFORE,
    Header,
    Heading,
    plain_words,
    understood,
    without_unit,
    words_of,
)

_SAYS_UNIT = re.compile(r"\bunits?\s*[=:]\s*([\w.µμ\"]+)\Z", re.IGNORECASE)
NUMBERED = ("measurement", "point", "repeat")
_ENDS_IN_AXIS = re.compile(r"(.*?)[\s_.:/-]*([XYZ])", re.IGNORECASE)
_DECIMAL = re.compile(r"[.,]\d")  # of a figure, which is in no head
_DEEPEST = 4  # rows of a head
_SHOWN = 40  # characters of a row that is left out
SUMMARY, REMARK, AGAIN = "a summary", "a remark", "the head again"
BASES, FIGURES = (
    ("reference_mm", "nominal_mm"),
    ("length_mm", "deviation_um", "deviation_mm", "run"),
)  # of a table of lengths


_MEASURED, _OF_LENGTHS = ("length_mm", "run"), ("line", "repeat")
_NOT_MEASURED = ("nominal_mm", "reference_mm", "deviation_um", "deviation_mm", "summary")
_OF_UNITS = re.compile(r"units?|einheit(?:en)?|unit[ée]s?|unit[àa]|unidad(?:es)?|単位", re.IGNORECASE)


def text_of(cell: Cell) -> str:
    return cell if isinstance(cell, str) else f"{cell:g}"


def with_one_head(
    sheet: Sheet, find: Callable[[Sheet], Header | None], meaning_of: Callable[[str], Heading]
) -> tuple[Sheet, Header, int] | None:
    """A sheet that begins with its head as one row, its header, and how many rows of the sheet stand ahead of figures.

    ``find``: the header of a sheet by its first row.
    """
    problem: CmmUqError | None = None
    for last, below in enumerate(sheet.rows[1 : LINES_BEFORE + 1]):
        if not any(cell != "" and is_number(cell) for cell in below):
            continue
        for top in range(last, max(last - _DEEPEST, -1), -1):
            head = _combined(sheet.rows[top : last + 1], meaning_of)
            if not any(head) or any(is_number(cell) and _DECIMAL.search(text_of(cell)) for cell in sheet.rows[top]):
                break
            probe = replace(sheet, rows=[head, below], lines=sheet.lines[last : last + 2])
            try:
                header = find(probe)
            except CmmUqError as error:
                problem = problem or error
                continue
            if header is not None and figures_follow(probe, header):
                whole = replace(sheet, rows=[head, *sheet.rows[last + 1 :]], lines=sheet.lines[last:])
                return whole, header, last + 1
    if problem is not None:
        raise problem
    return None


def with_blocks(sheet: Sheet) -> Sheet:
    """Tables of points below each other with the same head, as one.

    Each is a measurement where it has a title and no column numbers them; a head without one is that of another page.
    """
    heads = [row for row in sheet.rows[:LINES_BEFORE] if _names_places(row)] if not sheet.listed else []
    starts = [i for i, row in enumerate(sheet.rows) if row == heads[0]] if heads else []
    if len(starts) < 2:
        return sheet
    head = [*map(text_of, heads[0])]
    ahead = [next((row for row in reversed(sheet.rows[:i]) if any(cell != "" for cell in row)), ()) for i in starts[1:]]
    titled = all(map(_names_a_measurement, ahead))
    numbered = not titled or any(understood(cell).column == "measurement" for cell in head)
    table: list[list[Cell]] = [[*head, *([] if numbered else ["Measurement"])]]
    lines, left_out = [sheet.lines[starts[0]]], [*sheet.left_out]
    for block, (start, end) in enumerate(pairwise([*starts, len(sheet.rows)]), 1):
        for i in range(start + 1, end):
            row = [*sheet.rows[i], *[""] * (len(head) - len(sheet.rows[i]))]
            if any(cell != "" and is_number(cell) for cell in row[1:]):
                table.append([*row, *([] if numbered else [str(block)])])
                lines.append(sheet.lines[i])
            elif any(cell != "" for cell in row):
                left_out.append(shown(sheet, i, REMARK))
    return replace(sheet, rows=table, lines=lines, left_out=tuple(left_out))


def _names_a_measurement(row: Sequence[Cell]) -> bool:
    """Whether a row is a title such as ``Lage 2``, and neither figures nor the number of a page."""
    if any(cell != "" and is_number(cell) for cell in row):
        return False
    words = plain_words(" ".join(map(text_of, row)))
    return any(understood(word).column == "measurement" or word in words_of("lengths")["line"] for word in words)


def _names_places(row: Sequence[Cell]) -> bool:
    return {*COORDINATES} <= {understood(text_of(cell)).column for cell in row}


def with_points(sheet: Sheet, meaning_of: Callable[[str], Heading]) -> Sheet:
    """A sheet with a row for each point, where each coordinate has one: X, Y and Z in turn, or names that end in them.

    Every three rows have a label of their own; lengths on lines that are called X, Y and Z have none. As it is where the
    column that was measured is not clear.
    """
    for first in range(1, min(LINES_BEFORE, len(sheet.rows) - 2)) if not sheet.listed else ():
        for axis, three in enumerate(zip(*sheet.rows[first : first + 3], strict=False)):
            if _axes(three) == "XYZ":
                return _of_coordinates(sheet, first, axis, meaning_of) or sheet
    return sheet


def _axes(cells: Sequence[Cell]) -> str:
    ends = (_ENDS_IN_AXIS.fullmatch(text_of(cell)) for cell in cells)
    return "".join(end[2].upper() if end else "?" for end in ends)


def _of_coordinates(sheet: Sheet, first: int, axis: int, meaning_of: Callable[[str], Heading]) -> Sheet | None:
    """The table of a sheet whose column ``axis`` names axes from row ``first`` on; ``None`` where it holds no points."""
    filled = [i for i in range(first, len(sheet.rows)) if any(cell != "" for cell in sheet.rows[i])]
    places = [i for i in filled if axis < len(sheet.rows[i]) and _axes(sheet.rows[i][axis : axis + 1]) in {*"XYZ"}]
    width = max(len(sheet.rows[i]) for i in places)
    columns = [*zip(*([*sheet.rows[i], *[""] * (width - len(sheet.rows[i]))] for i in places), strict=True)]
    if _axes(columns[axis]) != "XYZ" * (len(places) // 3):
        return None
    head = [*map(text_of, sheet.rows[first - 1]), *[""] * width]
    stems = [text_of(cell)[:-1].rstrip("_.:/- ") for cell in columns[axis]]
    texts = {axis: stems} if all(stems) else {j: [*map(text_of, columns[j])] for j in range(width) if j != axis}
    labels = {j: own[::3] for j, own in texts.items() if _of_threes(own, head[j])}
    names = [*zip(*labels.values(), strict=True)]
    figures = [j for j, own in enumerate(columns) if j not in (axis, *labels) and all(map(is_number, own))]
    figures = [j for j in figures if meaning_of(head[j]).column not in _NOT_MEASURED]
    measured = [j for j in figures if meaning_of(head[j]).column in _MEASURED] or figures
    of_points = any(meaning_of(head[j]).column not in _OF_LENGTHS for j in labels)
    clear = len(measured) == 1 or (bool(measured) and meaning_of(head[measured[0]]).column in _MEASURED)
    if not (of_points and clear) or len({*names}) < len(places) // 3:
        return None
    runs = ["Repeat"] if len(measured) > 1 else []
    alike = [(head[j].strip(), text_of(own[0])) for j, own in enumerate(columns) if len({*own}) == 1]
    said = [text if _OF_UNITS.fullmatch(name) else "".join(_SAYS_UNIT.findall(text)) for name, text in alike]
    unit = next(filter(None, [without_unit(head[measured[0]])[1], *map(unit_named, said)]), None)
    xyz = [f"{letter} [{unit.name}]" if unit else letter for letter in "XYZ"]
    rows: list[list[Cell]] = [[*(head[j] for j in labels), *runs, *xyz]]
    for k, name in enumerate(names):
        for repeat, j in enumerate(measured, 1):
            rows.append([*name, *([str(repeat)] if runs else []), *columns[j][3 * k : 3 * k + 3]])
    lines = [sheet.lines[first - 1], *(sheet.lines[i] for i in places[::3] for _ in measured)]
    values = commas([Verbatim(head[j]) for j in measured])
    of = say("{axis}: X, Y, Z; values: {values}", axis=Verbatim(head[axis]), values=values)
    fact = Fact("in_rows", say("A row for each coordinate"), of)
    left_out = (*sheet.left_out, *(shown(sheet, i, "no coordinate") for i in filled if i not in {*places}))
    return replace(sheet, rows=rows, lines=lines, spreadsheet=False, facts=(*sheet.facts, fact), left_out=left_out)


def _of_threes(labels: Sequence[str], heading: str) -> bool:
    """Whether labels are of three rows each, in all of them or in the first, and say more than a number nobody names."""
    of = understood(heading)
    if (of.column not in NUMBERED or of.unit is not None) and all(map(is_number, filter(None, labels))):
        return False
    threes = zip(labels[::3], labels[1::3], labels[2::3], strict=True)
    return all(one and two == three and two in (one, "") for one, two, three in threes)


def figures_follow(sheet: Sheet, header: Header) -> bool:
    """Whether the rows after a header begin with a figure in each coordinate, or in the nominal length and one of its runs."""
    of = {
        name: [i for one in names for i in header.columns.get(one, ())]
        for name, names in (("all", (*COORDINATES, *BASES)), ("any", FIGURES))
    }
    for row in sheet.rows[header.first : header.first + _DEEPEST]:
        if any(cell != "" for cell in row[len(header.headings) :]):
            return False
        cells = {name: [row[i] if i < len(row) else "" for i in columns] for name, columns in of.items()}
        if any(cell != "" for own in cells.values() for cell in own):
            number = {name: [cell != "" and is_number(cell) for cell in own] for name, own in cells.items()}
            return all(number["all"]) and (any(number["any"]) or COORDINATES[0] in header.columns)
    return False


def _combined(rows: Sequence[Sequence[Cell]], meaning_of: Callable[[str], Heading]) -> list[str]:
    """Headings of a head of several rows."""
    width = max(map(len, rows))
    texts = [[*map(text_of, row), *[""] * (width - len(row))] for row in rows]
    if len(rows) == 1:
        return texts[0]
    for depth, row in enumerate(texts[:-1]):
        for i in range(1, width):
            if not row[i] and any(below[i] for below in texts[depth + 1 :]):
                row[i] = row[i - 1]
    headings = []
    for column in zip(*texts, strict=True):
        parts, unit = [], ""
        for part in filter(None, column):
            if unit_named(part.strip("[]()<>{} ")):
                unit = part.strip("[]()<>{} ")
                continue
            bare, own, _ = without_unit(part)
            unit = own.name if own else unit
            parts.append(bare if own else part)
        parts = list(dict.fromkeys(parts))
        full, last = " ".join(parts), parts[-1] if parts else ""
        if meaning_of(full).column is None and meaning_of(last).column not in (None, *COORDINATES):
            above = plain_words(" ".join(parts[:-1]))
            numbers = [word for word in above if word.isdigit()]
            full = f"{last} {numbers[0]}" if len(numbers) == 1 else last
            if not words_of("rows")["summary"].isdisjoint(above):  # the mean of what stands beside it
                full = " ".join(parts)
        headings.append(f"{full} [{unit}]" if unit and full else full)
    return headings


def is_summary(row: Sequence[Cell]) -> bool:
    """Whether one of the first two cells is a word for a figure of other rows, or the first has a unit: ``Form (µm)``."""
    labels = [cell for cell in row if cell != ""][:2]
    if any(isinstance(cell, str) and " ".join(plain_words(cell)) in words_of("rows")["summary"] for cell in labels):
        return True
    label = text_of(labels[0]) if labels else ""
    return label.endswith((")", "]")) and not re.search(r"\d", label) and without_unit(label)[1] is not None


def shown(sheet: Sheet, i: int, why: str) -> str:
    """A row that is left out, with its place and why."""
    text = " ".join(text_of(cell) for cell in sheet.rows[i] if cell != "")
    return f"{sheet.at('', i).removeprefix(': ').strip()}: {text[:_SHOWN]!r}, {why}"


def filled_down(cells: Sequence[Cell], *, evenly: bool = False) -> Sequence[Cell]:
    """Labels of all rows, where each stands in the first row of those that it is of; else the cells as they are.

    ``evenly``: only where each is of as many rows.
    """
    places = [i for i, cell in enumerate(cells) if cell != ""]
    if len(places) == len(cells) or not places or places[0] or any(cells[a] == cells[b] for a, b in pairwise(places)):
        return cells
    if evenly and len({b - a for a, b in pairwise([*places, len(cells)])}) > 1:
        return cells
    return list(_down(cells))


def _down(cells: Sequence[Cell]) -> Iterator[Cell]:
    last: Cell = ""
    for cell in cells:
        last = cell if cell != "" else last
        yield last
