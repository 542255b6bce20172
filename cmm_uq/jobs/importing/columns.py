"""In which unit the lengths of a file are: as it says, as the job says, or as the machine's travel leaves no doubt.

From a sheet and its header to the columns of a recording, in its units.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.limits import CELLS, COLUMNS, ROWS
from cmm_uq.base.files.numbers import GIVE_OR_REMOVE, MEASURE
from cmm_uq.base.messages import Text, Verbatim, commas, names, number, say
from cmm_uq.base.points import Floats, Ints
from cmm_uq.jobs.importing.header import Header
from cmm_uq.jobs.importing.keys import (
    FAHRENHEIT,
    LENGTH,
    UNITS,
    ImportKeys,
    WrittenUnit,
    converted,
    length_named,
    sort_of,
)
from cmm_uq.jobs.importing.numbering import MEASUREMENT, NUMBERS, POINT, completed, numbered
from cmm_uq.jobs.importing.numerals import decimal_sign, is_number, split_units, values_of
from cmm_uq.jobs.importing.recording import COORDINATES
from cmm_uq.jobs.importing.sheet import Cell, Fact, Sheet
from cmm_uq.jobs.importing.vocabulary import NAME

LARGEST_MACHINE_MM = 40_000.0
"""Longest diagonal of a coordinate measuring machine: gantries of 30 m are the largest made."""

Written = Mapping[str, Sequence[tuple[Floats, WrittenUnit | None, int]]]
"""Values of each column as written, with its unit and its index."""


def lengths_unit(
    sheet: Sheet, keys: ImportKeys, named: Mapping[str, WrittenUnit], written: Written, where: str,
    reach_mm: float | None = None,
) -> tuple[WrittenUnit, list[Fact]]:  # fmt: skip
    """The unit of the coordinates, and of every length whose unit is not named."""
    found = {unit.name: heading for heading, unit in reversed(list(named.items()))}
    if len(found) > 1:
        (one, first), (other, second) = list(found.items())[:2]
        raise CmmUqError(f"{first!r} is in {one} and {second!r} in {other}: the coordinates mix units", where=where,
                         fix="Export all coordinates in one unit")  # fmt: skip
    said: list[tuple[WrittenUnit, Text]] = []
    if found:
        heading = next(iter(found.values()))
        said.append((named[heading], say("in the heading {heading}", heading=Verbatim(heading))))
    if sheet.unit is not None and (unit := length_named(sheet.unit)):
        said.append((unit, say("in the file")))
    if keys.unit is not None and (unit := length_named(keys.unit)):
        said.append((unit, say("by the key unit")))
    if len({unit.name for unit, _ in said}) > 1:
        told = " and ".join(f"{unit.name} {how}" for unit, how in said)
        raise CmmUqError(f"the unit is {told}", where=where, fix="Mend the file, or leave out unit")
    unit, how = said[0] if said else _by_extent(written, where, reach_mm)
    return unit, [Fact("unit", say("Unit of lengths"), say("{unit}, {how}", unit=Verbatim(unit.name), how=how))]


def _by_extent(written: Written, where: str, reach_mm: float | None) -> tuple[WrittenUnit, Text]:
    """Millimetres, where inches would lead out of the machine."""
    lengths = [name for name in COORDINATES if name in written] or [name for name in written if name.endswith("_mm")]
    extents = [np.ptp(np.concatenate([values for values, _, _ in written[name]])) for name in lengths if written[name]]
    extent, reach = float(np.linalg.norm(extents)), reach_mm or LARGEST_MACHINE_MM
    inch, mm = UNITS["inch"], UNITS["mm"]
    if extent <= reach < extent * inch.up / inch.down:
        return mm, say("since in inches the points would lie {extent:.3g} mm apart, and {reach:.3g} mm is the most",
                       extent=extent * inch.up / inch.down, reach=reach)  # fmt: skip
    raise CmmUqError(
        f"nothing says the unit of lengths: points {extent:.4g} apart may be in mm or in inch", where=where,
        fix='Say unit = "mm" or unit = "inch"',
    )  # fmt: skip


SIGNS = {".": say("point"), ",": say("comma")}
_SHOWN = 15


@dataclass(frozen=True, eq=False)
class Columns:
    """Columns of a recording.

    values : by name, each (n,).
    lines : (n,) of each point in the file.
    sources : heading and unit of each column, by name.
    facts : recognised.
    """

    values: dict[str, Floats]
    lines: Ints
    sources: dict[str, str]
    facts: tuple[Fact, ...]


@dataclass(frozen=True, eq=False)
class _Rows:
    """Rows of figures.

    columns : cells of each column of the sheet.
    at : index of each row in the sheet.
    after : rows of text after the table.
    """

    columns: Sequence[Sequence[Cell]]
    at: Sequence[int]
    after: int


def columns_of(
    sheet: Sheet, header: Header, keys: ImportKeys, where: str, *, reach_mm: float | None = None, points: bool = True
) -> Columns:
    """Columns of a recording, from a sheet.

    ``points``: whether measurements and points must be numbered.
    """
    rows = _rows(sheet, header, where)
    table = _Table(sheet, header, rows, where)
    numeric = [i for name, own in header.columns.items() if name != NAME and name not in NUMBERS for i in own]
    sign = sheet.decimal or decimal_sign(
        [rows.columns[i] for i in numeric], lambda i, row: table.place(numeric[i], row), keys.decimal
    )
    written = {name: table.written(name, sign) for name in header.columns if name != NAME and name not in NUMBERS}
    unit, said = lengths_unit(sheet, keys, table.named_units(written), written, where, reach_mm)
    values = {name: table.in_units(name, parts, unit) for name, parts in written.items() if parts}
    numbers, facts = table.numbers(sign)
    lines = np.repeat(np.array([sheet.lines[i] for i in rows.at], dtype=np.int64), header.points)
    labels = table.labels()
    if not points and POINT not in numbers and labels and all(label.isdecimal() for label in labels):
        numbers[POINT] = np.array([float(label) for label in labels])
    if points:
        numbers, further = completed(numbers, labels, len(lines), keys, table.start())
        facts += further
    left_out = [name for name, parts in written.items() if not parts]
    facts = [*said, Fact("decimal", say("Decimal sign"), SIGNS[sign]), *table.facts(left_out), *facts]
    return Columns({**numbers, **values}, lines, table.sources(unit, values), tuple(facts))


@dataclass(frozen=True, eq=False)
class _Table:
    """Rows with their header."""

    sheet: Sheet
    header: Header
    rows: _Rows
    where: str

    def place(self, column: int, row: int) -> str:
        return self.sheet.at(self.where, self.rows.at[row], column, self.header.headings[column])

    def start(self) -> str:
        return self.sheet.at(self.where, self.header.row)

    def cells(self, column: int) -> Sequence[Cell]:
        return self.rows.columns[column]

    def written(self, name: str, sign: str) -> list[tuple[Floats, WrittenUnit | None, int]]:
        """Values as written of each column of a name, with the unit that its cells or its heading name.

        A column beside the coordinates that holds no number at all is left out.
        """
        found = []
        for i in self.header.columns[name]:
            at = partial(self.place, i)
            cells, unit = split_units(self.cells(i), at)
            if name not in COORDINATES and not any(cell != "" and is_number(cell) for cell in cells):
                return []
            fix = MEASURE if name in COORDINATES else GIVE_OR_REMOVE
            found.append((values_of(cells, sign, at, fix), unit or self.header.units.get(i), i))
        return found

    def named_units(self, written: dict[str, list[tuple[Floats, WrittenUnit | None, int]]]) -> dict[str, WrittenUnit]:
        """Units that headings or cells of lengths name, by heading."""
        named = {}
        leading = [name for name in COORDINATES if name in written] or [
            name for name in written if not name.endswith("_um")
        ]
        for name, parts in written.items():
            sort = sort_of(name)
            for _, unit, i in parts:
                heading = self.header.headings[i]
                if sort and unit is None and i in self.header.odd_units:
                    raise CmmUqError(f"the unit {self.header.odd_units[i]!r} of {heading!r} is not known", where=self.start(),
                                     fix="Name the column and its unit: columns, unit")  # fmt: skip
                if unit == FAHRENHEIT:
                    raise CmmUqError(f"{heading!r} is in °F", where=self.start(),
                                     fix=f"Export it in °C: {name} = (°F − 32) / 1.8")  # fmt: skip
                if sort and unit and unit.sort != sort[0]:
                    raise CmmUqError(f"{heading!r} is in {unit.name}, which is no unit of {name}", where=self.start(),
                                     fix=f'Say which column it is: columns = {{ {name} = "…" }}')  # fmt: skip
                if name in leading and sort and sort[0] == LENGTH and (unit or name == heading):
                    named[heading] = unit or UNITS["mm"]
        return named

    def in_units(self, name: str, parts: list[tuple[Floats, WrittenUnit | None, int]], length: WrittenUnit) -> Floats:
        """A column in the unit of its name, (n,), points of a row in turn."""
        sort, found = sort_of(name), []
        for values, unit, i in parts:
            own = unit
            if own is None and sort and sort[0] == LENGTH and name != self.header.headings[i]:
                own = length if not name.endswith("_um") else UNITS["um"]
            found.append(values if own is None or sort is None else converted(values, own, name))
        if len(found) == 1:
            return np.repeat(found[0], self.header.points)
        return np.column_stack(found).ravel()

    def numbers(self, sign: str) -> tuple[dict[str, Floats], list[Fact]]:
        """Columns of numbers of measurements, points and repeats that the file has."""
        found, facts = {}, []
        for name in NUMBERS:
            for i in self.header.columns.get(name, ())[:1]:
                values, named = numbered(self.cells(i), sign, partial(self.place, i))
                found[name] = np.repeat(values, self.header.points)
                if named:
                    facts.append(Fact(f"{name}_names", say("Names in {column}", column=Verbatim(name)), named))
        if self.header.points > 1 and POINT not in found:
            count = len(self.rows.at)
            found[POINT] = np.tile(np.arange(1.0, self.header.points + 1), count)
            if MEASUREMENT not in found:
                found[MEASUREMENT] = np.repeat(np.arange(1.0, count + 1), self.header.points)
                facts.append(Fact("numbering", say("Numbering"), say("each row is one measurement")))
        return found, facts

    def labels(self) -> list[str] | None:
        own = self.header.columns.get(NAME, ())
        if len(own) != 1 or self.header.points > 1:
            return None
        return [cell if isinstance(cell, str) else f"{cell:g}" for cell in self.cells(own[0])]

    def facts(self, left_out: Sequence[str]) -> list[Fact]:
        """The kind of table, and what of it is not used."""
        found = []
        if not self.sheet.listed:
            several = say("{points} points in a row", points=self.header.points)
            found.append(Fact("table", say("Table"), several if self.header.points > 1 else say("one point in a row")))
            found.append(Fact("header", say("Header"), Verbatim(self.start().removeprefix(self.where).lstrip(": "))))
        unused = [self.header.headings[i] for i in self.header.unused]
        unused += [self.header.headings[i] for name in left_out for i in self.header.columns[name]]
        if unused:
            shown = commas(names(unused[:_SHOWN]))
            text = (
                shown
                if len(unused) <= _SHOWN
                else say("{shown} and {more} more", shown=shown, more=len(unused) - _SHOWN)
            )
            found.append(Fact("not_used", say("Columns not used"), text))
        if self.rows.after:
            found.append(Fact("after", say("Lines of text after the table"), number(self.rows.after)))
        return found

    def sources(self, length: WrittenUnit, values: dict[str, Floats]) -> dict[str, str]:
        """Headings of every column that is taken, by its name."""
        taken = (*(name for name in NUMBERS if name in self.header.columns), *values)
        return {name: ", ".join(self.header.headings[i] for i in self.header.columns[name]) for name in taken}


def _rows(sheet: Sheet, header: Header, where: str) -> _Rows:
    """The rows of figures, complete, without empty ones and without text after the table."""
    width, first = len(header.headings), header.first
    if width > COLUMNS.most:
        raise CmmUqError(f"has {width} columns, {COLUMNS.most} are the most", where=sheet.at(where, header.row),
                         fix="Export the columns that the job needs")  # fmt: skip
    body = sheet.rows[first:]
    if len(body) > ROWS.most or len(body) * width > CELLS.most:
        raise CmmUqError(f"has {len(body)} rows of {width} columns", where=where,
                         fix=f"{ROWS.most} rows and {CELLS.most} cells are the most: split or thin out the table")  # fmt: skip
    needed = [i for name in COORDINATES for i in header.columns.get(name, ())] or [
        i for name, own in header.columns.items() if name not in (NAME, *NUMBERS) for i in own
    ]
    at: Sequence[int] = range(first, first + len(body))
    after = 0
    if not set(map(len, body)) - {width}:
        columns = list(zip(*body, strict=True))
        if columns and not any("" in columns[i] for i in needed):
            return _Rows(columns, at, after)
    at, after = _usable(sheet, header, needed, where)
    body = [_exactly(sheet.rows[i], width) for i in at]
    if not body:
        raise CmmUqError("has a header and no rows of figures", where=sheet.at(where, header.row),
                         fix="Export the table with its figures")  # fmt: skip
    return _Rows(list(zip(*body, strict=True)), at, after)


def _exactly(row: Sequence[Cell], width: int) -> Sequence[Cell]:
    return [*row[:width], *[""] * (width - len(row))]


def _usable(sheet: Sheet, header: Header, needed: Sequence[int], where: str) -> tuple[list[int], int]:
    """Indices of the rows with figures, and the number of rows of text after them."""
    kept: list[int] = []
    text: list[int] = []
    width = len(header.headings)
    for i in range(header.first, len(sheet.rows)):
        row = sheet.rows[i]
        if not any(cell != "" for cell in row):
            continue
        if all(place >= len(row) or row[place] == "" for place in needed):
            text.append(i)
            continue
        _refuse_another_length(sheet, header, i, needed, where)
        if text:
            raise CmmUqError("has no coordinates, and figures follow", where=sheet.at(where, text[0]),
                             fix="Remove the line, or complete it; two tables in one file are two exports")  # fmt: skip
        kept.append(i)
    if sheet.unended and len(kept) > 1 and all(len(sheet.rows[i]) == width for i in kept[:-1]):
        _refuse_cut(sheet, kept[-1], width, where)
    for i in text:
        if all(cell == "" or is_number(cell) for cell in sheet.rows[i]) and not sheet.spreadsheet:
            _refuse_cut(sheet, i, width, where)
    return kept, len(text)


def _refuse_cut(sheet: Sheet, i: int, width: int, where: str) -> None:
    """Refuse a row that ends before the others do."""
    if len(sheet.rows[i]) < width:
        raise CmmUqError(f"the row ends after {len(sheet.rows[i])} of {width} cells: the file was cut off",
                         where=sheet.at(where, i), fix="Export it again")  # fmt: skip


def _refuse_another_length(sheet: Sheet, header: Header, i: int, needed: Sequence[int], where: str) -> None:
    row, width = sheet.rows[i], len(header.headings)
    surplus = [cell for cell in row[width:] if cell != ""]
    if surplus:
        halves = " (a decimal comma in cells that commas separate?)" if len(row) >= 2 * width - 1 else ""
        raise CmmUqError(f"has {len(row)} cells where the header has {width}{halves}", where=sheet.at(where, i),
                         fix="Export with semicolons or tabs between cells, or mend the row")  # fmt: skip
    if len(row) <= max(needed) and not sheet.spreadsheet:
        last = all(not any(cell != "" for cell in later) for later in sheet.rows[i + 1 :])
        cut = "the file was cut off: export it again" if last else "Complete the row"
        raise CmmUqError(f"the row ends after {len(row)} of {width} cells", where=sheet.at(where, i),
                         fix=cut[0].upper() + cut[1:])  # fmt: skip
