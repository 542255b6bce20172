"""From a sheet and its header to the columns of a recording, in its units.

Lengths are in the unit that the file or the job says, or that the machine's travel leaves no doubt of. Which points belong
together, numbers of measurement, point and repeat, follows from columns of the file or from the names that it has for them.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import takewhile

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.csv_table import GIVE_OR_REMOVE, MEASURE
from cmm_uq.base.files.limits import CELLS, COLUMNS, ROWS
from cmm_uq.base.messages import Text, Verbatim, commas, names, number, say, semicolons
from cmm_uq.base.points import Floats, Ints
from cmm_uq.jobs.columns import COORDINATES
from cmm_uq.jobs.importing import format as units, header as heads
from cmm_uq.jobs.importing.cells.encodings import decimal_sign, is_number, split_units, values_of
from cmm_uq.jobs.importing.cells.figures import figure
from cmm_uq.jobs.importing.factors import Label
from cmm_uq.jobs.importing.format import LENGTH, UNITS, Cell, Fact, ImportKeys, NotReadError, Sheet, WrittenUnit
from cmm_uq.jobs.importing.header import NAME, REMARK, SUMMARY, Header, filled_down, is_summary, named_alike, shown
from cmm_uq.jobs.importing.lengths.place_columns import FINER
from cmm_uq.jobs.importing.numbering import MEASUREMENT, NUMBERS, POINT, completed, numbered
from cmm_uq.jobs.importing.roles import names_length, said

LARGEST_MACHINE_MM = 40_000.0  # longest diagonal of a measuring machine: gantries of 30 m are the largest made
SIGNS = {".": say("point"), ",": say("comma")}
_SHOWN = 15
_LENGTHS = "Say which columns are lengths: columns = { length_mm = […] }"
_DECIMAL = re.compile(r"\d[.,]\d")

Written = Mapping[str, Sequence[tuple[Floats, WrittenUnit | None, int]]]
"""Values of each column as written, with its unit and its index."""


def by_extent(written: Written, where: str, reach_mm: float | None) -> tuple[WrittenUnit, Text]:
    """Millimetres, where inches would lead out of the machine."""
    lengths = [name for name in COORDINATES if name in written] or [name for name in written if name.endswith("_mm")]
    extents = [np.ptp(np.concatenate([values for values, _, _ in written[name]])) for name in lengths if written[name]]
    extent, reach = float(np.linalg.norm(extents)), reach_mm or LARGEST_MACHINE_MM
    in_inches = extent * UNITS["inch"].up / UNITS["inch"].down
    if extent <= reach < in_inches:
        return UNITS["mm"], say("since in inches the points would lie {extent:.3g} mm apart, and {reach:.3g} mm is the most",
                                extent=in_inches, reach=reach)  # fmt: skip
    what = f"nothing says the unit of lengths: points {extent:.4g} apart may be in mm or in inch"
    raise NotReadError(what, where=where, fix='Say unit = "mm" or unit = "inch"')


def settled_unit(
    stated: Sequence[tuple[WrittenUnit, Text]], where: str, by_size: Callable[[], tuple[WrittenUnit, Text]]
) -> tuple[WrittenUnit, Fact]:
    """The one unit of lengths that is stated, and how, else the one by the size of the machine."""
    if len({unit.name for unit, _ in stated}) > 1:
        each = " and ".join(f"{unit.name} {how}" for unit, how in stated)
        raise CmmUqError(f"the unit is {each}", where=where, fix="Mend the file, or leave out unit")
    unit, how = stated[0] if stated else by_size()
    return unit, Fact("unit", say("Unit of lengths"), say("{unit}, {how}", unit=Verbatim(unit.name), how=how))


Columns = tuple[dict[str, Floats], Ints, dict[str, str], tuple[Fact, ...]]
"""Columns of a recording by name, each (n,), with the line of each point in the file, each column's headings, and facts."""


def columns_of(
    sheet: Sheet, header: Header, keys: ImportKeys, where: str, *, reach_mm: float | None = None, points: bool = True
) -> Columns:
    """Columns of a recording, from a sheet; ``points``: whether measurements and points must be numbered."""
    table = ExportTable(sheet, header, where)
    plain = [name for name in header.columns if name != NAME and name not in NUMBERS]
    numeric = [i for name in plain for i in header.columns[name]]
    stated = [*header.units.values(), *filter(None, map(units.length_named, (sheet.unit or "", keys.unit or "")))]
    most = LARGEST_MACHINE_MM / min((unit.metres * 1000 for unit in stated if unit.sort == LENGTH), default=1.0)
    cells = [table.cells[i] for i in numeric]
    sign = sheet.decimal or decimal_sign(cells, lambda i, row: table.place(numeric[i], row), keys.decimal, most)
    written = {name: table.written(name, sign) for name in plain}
    if "read_x" not in written:  # places along a diagonal are no lengths
        _refuse_lengths_along_axes(written, table.start)
    _refuse_places_of_lengths(written, table, sign)
    unit, of_unit = table.lengths_unit(keys, written, reach_mm)
    values = {name: table.in_units(name, parts, unit) for name, parts in written.items() if parts}
    numbers, facts = table.numbers(sign)
    lines = np.repeat(np.array([sheet.lines[i] for i in table.rows], dtype=np.int64), header.points)
    labels = table.labels()
    named = [header.headings[i] for i in header.columns.get(NAME, ())]
    for label in (one for one in labels if not points and POINT not in numbers and one.words in named[:1]):
        if all(one.isdecimal() for one in label.values):
            numbers[POINT] = np.array([float(one) for one in label.values])
    if points:
        xyz = np.column_stack([values[name] for name in COORDINATES])
        numbers, further = completed(numbers, labels, xyz, keys, table.start)
        facts += further
    left_out = [name for name, parts in written.items() if not parts]
    facts = [of_unit, Fact("decimal", say("Decimal sign"), SIGNS[sign]), *table.facts(left_out), *facts]
    taken = (*(name for name in NUMBERS if name in header.columns), *values)
    sources = {name: ", ".join(header.headings[i] for i in header.columns[name]) for name in taken}
    return {**numbers, **values}, lines, sources, tuple(facts)


def _refuse_lengths_along_axes(written: Written, place: str) -> None:
    """Columns called X, Y and Z that hold the same lengths row by row are lines along the axes, and no coordinates."""
    xyz = [np.column_stack([values for values, _, _ in written[axis]]) for axis in COORDINATES if written.get(axis)]
    alike = len(xyz) == 3 and all(np.abs(xyz[0] - own).max() <= 0.04 + 0.002 * np.abs(own).max() for own in xyz[1:])
    if alike and len(xyz[0]) > 2 and np.ptp(xyz[0]) > 1:
        raise NotReadError("X, Y and Z have the same lengths in each row", where=place, fix=_LENGTHS)


def _refuse_places_of_lengths(written: Written, table: ExportTable, sign: str) -> None:
    """Places beside which lengths stand that are printed much finer are where those begin, and were not measured."""
    used, headings = {i for own in table.header.columns.values() for i in own}, table.header.headings
    beside = [
        i for i, head in enumerate(headings) if i not in used and (said(head) == "measured" or names_length([head]))
    ]
    whole = all(np.all(values % 1 == 0) for axis in COORDINATES for values, _, _ in written.get(axis, ()))
    places = [table.cells[k] for axis in COORDINATES for k in table.header.columns.get(axis, ())]
    finest = min((f[1] for own in places for cell in own if (f := figure(cell, sign))), default=0.0)
    coarse = 1.0 if whole else finest
    for i in beside:
        if (first := figure(table.cells[i][0], sign)) and first[0] > 1 and first[1] * (1 if whole else FINER) < coarse:
            what = f"X, Y and Z are {'whole' if whole else 'coarse'}, and {headings[i]!r} was measured there"
            raise NotReadError(what, where=table.start, fix=_LENGTHS)


class ExportTable:
    """Rows of figures with their header: ``cells`` of each column, ``rows`` of the sheet, ``after`` them rows of text."""

    def __init__(self, sheet: Sheet, header: Header, where: str) -> None:
        self.sheet, self.header, self.where, self.start = sheet, header, where, sheet.at(where, header.row)
        width, body = len(header.headings), sheet.rows[header.first :]
        if width > COLUMNS.most:
            raise CmmUqError(f"has {width} columns, {COLUMNS.most} are the most", where=self.start,
                             fix="Export the columns that the job needs")  # fmt: skip
        if len(body) > ROWS.most or len(body) * width > CELLS.most:
            fix = f"{ROWS.most} rows and {CELLS.most} cells are the most: split or thin out the table"
            raise CmmUqError(f"has {len(body)} rows of {width} columns", where=where, fix=fix)
        others = (columns for name, columns in header.columns.items() if name not in (NAME, *NUMBERS))
        needed = [i for name in COORDINATES for i in header.columns.get(name, ())] or [i for own in others for i in own]
        self.rows: Sequence[int] = range(header.first, header.first + len(body))
        self.after, self.left_out = 0, list(sheet.left_out)
        self.cells: Sequence[Sequence[Cell]] = []
        if not set(map(len, body)) - {width}:
            self.cells = list(zip(*body, strict=True))
        self.called = named_alike(sheet.rows, self.rows)  # rows ahead of results
        self.kinds = all(map(is_summary, body))  # then a word for summaries is one for something else, as S for spheres
        uneven = not self.cells or self.called < len(body) or any(map(is_summary, body))
        if uneven or any("" in self.cells[i] for i in needed):
            self.rows, self.after = self._usable(needed)
            if not self.rows:
                fix = "Export the table with its figures"
                raise NotReadError("has a header and no rows of figures", where=self.start, fix=fix)
            body = [[*sheet.rows[i][:width], *[""] * (width - len(sheet.rows[i]))] for i in self.rows]
            self.cells = list(zip(*body, strict=True))

    def _usable(self, needed: Sequence[int]) -> tuple[list[int], int]:
        """Indices of the rows with figures, and the number of rows of text after them; what else is left out is told."""
        sheet, width = self.sheet, len(self.header.headings)
        usable: list[int] = []
        text: list[int] = []

        def figured(rows: Sequence[int]) -> list[int]:
            return [i for i in rows if all(cell == "" or is_number(cell) for cell in sheet.rows[i])]

        for i in range(self.header.first, len(sheet.rows)):
            row = sheet.rows[i]
            if not any(cell != "" for cell in row):
                continue
            if (is_summary(row) and not self.kinds) or i >= self.header.first + self.called:
                self.left_out.append(shown(sheet, i, SUMMARY))
            elif all(place >= len(row) or row[place] == "" for place in needed) or (
                any(place >= len(row) or row[place] == "" for place in needed)
                and not any(cell != "" and is_number(cell) for cell in row)
            ):
                text.append(i)
            else:
                _refuse_another_length(sheet, self.header, i, needed, self.where)
                if not any(map(str.isdigit, "".join(heads.text_of(row[k]) for k in needed))):
                    raise NotReadError(
                        "names columns of another table", where=sheet.at(self.where, i), fix="Export one table"
                    )
                if figures := figured(text):
                    raise CmmUqError("has no coordinates, and figures follow", where=sheet.at(self.where, figures[0]),
                                     fix="Remove the line, or complete it")  # fmt: skip
                self.left_out += [shown(sheet, j, REMARK) for j in text]
                text = []
                usable.append(i)
        cut = sheet.unended and len(usable) > 1 and all(len(sheet.rows[i]) == width for i in usable[:-1])
        at_once = takewhile(lambda i: figured([i]), text)  # below words stands another table
        for i in [*(usable[-1:] if cut else []), *([] if sheet.spreadsheet else at_once)]:
            if len(sheet.rows[i]) < width:
                raise CmmUqError(f"the row ends after {len(sheet.rows[i])} of {width} cells: the file was cut off",
                                 where=sheet.at(self.where, i), fix="Export it again")  # fmt: skip
        return usable, len(text)

    def place(self, column: int, row: int) -> str:
        return self.sheet.at(self.where, self.rows[row], column, self.header.headings[column])

    def written(self, name: str, sign: str) -> list[tuple[Floats, WrittenUnit | None, int]]:
        """Values as written of each column of a name, with the unit that its cells or its heading name.

        A column beside the coordinates that holds no number at all is left out.
        """
        parts = []
        for i in self.header.columns[name]:
            at = partial(self.place, i)
            cells, unit = split_units(self.cells[i], at)
            if name not in COORDINATES and not any(cell != "" and is_number(cell) for cell in cells):
                return []
            try:
                values = values_of(cells, sign, at, MEASURE if name in COORDINATES else GIVE_OR_REMOVE)
            except CmmUqError as error:
                raise _of_another_table(error) if name not in COORDINATES else error from None
            parts.append((values, unit or self.header.units.get(i), i))
        return parts

    def named_units(self, written: Written) -> dict[str, WrittenUnit]:
        """Units that headings or cells of lengths name, by heading."""
        named = {}
        leading = [name for name in COORDINATES if name in written]
        leading = leading or [name for name in written if not name.endswith("_um")]
        for name, parts in written.items():
            sort = units.sort_of(name)
            for _, unit, i in parts:
                heading, problem, fix = self.header.headings[i], "", ""
                if sort and unit is None and i in self.header.odd_units:
                    problem = f"the unit {self.header.odd_units[i]!r} of {heading!r} is not known"
                    fix = "Export it in mm, µm or inch"
                elif unit == units.FAHRENHEIT:
                    problem, fix = f"{heading!r} is in °F", f"Export it in °C: {name} = (°F − 32) / 1.8"
                elif sort and unit and unit.sort != sort[0]:
                    problem = f"{heading!r} is in {unit.name}, which is no unit of {name}"
                    fix = f'Say which column it is: columns = {{ {name} = "…" }}'
                elif name in leading and sort and sort[0] == LENGTH and (unit or name == heading):
                    named[heading] = unit or UNITS["mm"]
                if problem:
                    raise CmmUqError(problem, where=self.start, fix=fix)
        return named

    def lengths_unit(self, keys: ImportKeys, written: Written, reach_mm: float | None) -> tuple[WrittenUnit, Fact]:
        """The unit of the coordinates, and of every length whose unit is not named."""
        named = self.named_units(written)
        headings = {unit.name: heading for heading, unit in reversed(list(named.items()))}
        if len(headings) > 1:
            (first, of_first), (second, of_second) = list(headings.items())[:2]
            mixed = f"{of_first!r} is in {first} and {of_second!r} in {second}: the coordinates mix units"
            raise CmmUqError(mixed, where=self.where, fix="Export all coordinates in one unit")
        stated = [(named[each], say("in the heading {heading}", heading=Verbatim(each))) for each in headings.values()]
        for name, origin in ((self.sheet.unit, say("in the file")), (keys.unit, say("by the key unit"))):
            if unit := units.length_named(name or ""):
                stated.append((unit, origin))
        return settled_unit(stated, self.where, lambda: by_extent(written, self.where, reach_mm))

    def in_units(
        self, name: str, parts: Sequence[tuple[Floats, WrittenUnit | None, int]], length: WrittenUnit
    ) -> Floats:
        """A column in the unit of its name, (n,), points of a row in turn."""
        sort, columns = units.sort_of(name), []
        for values, unit, i in parts:
            if unit is None and sort and sort[0] == LENGTH and name != self.header.headings[i]:
                unit = length if not name.endswith("_um") else UNITS["um"]
            columns.append(values if unit is None or sort is None else units.converted(values, unit, name))
        return np.repeat(columns[0], self.header.points) if len(columns) == 1 else np.column_stack(columns).ravel()

    def numbers(self, sign: str) -> tuple[dict[str, Floats], list[Fact]]:
        """Columns of numbers of measurements, points and repeats that the file has."""
        columns, facts, points = {}, [], self.header.points
        for name in NUMBERS:
            for i in self.header.columns.get(name, ())[:1]:
                try:
                    values, named = numbered(filled_down(self.cells[i]), sign, partial(self.place, i))
                except CmmUqError as error:
                    raise _of_another_table(error) from None
                columns[name] = np.repeat(values, points)
                if named:
                    facts.append(Fact(f"{name}_names", say("Names in {column}", column=Verbatim(name)), named))
        if points > 1 and POINT not in columns:
            count = len(self.rows)
            columns[POINT] = np.tile(np.arange(1.0, points + 1), count)
            if MEASUREMENT not in columns:
                columns[MEASUREMENT] = np.repeat(np.arange(1.0, count + 1), points)
                facts.append(Fact("numbering", say("Numbering"), say("each row is one measurement")))
        return columns, facts

    def labels(self) -> list[Label]:
        """Names and whole numbers that stand beside points, in the columns of names and in those that are not known."""
        names = self.header.columns.get(NAME, ())
        beside = () if self.header.points > 1 else sorted({*names, *self.header.unused})
        cells = [(i, self.header.headings[i], [*map(heads.text_of, filled_down(self.cells[i]))]) for i in beside]
        whole = [one for one in cells if one[0] in names or not any(map(_DECIMAL.search, one[2]))]
        return [Label(name, tuple(own)) for _, name, own in whole if "" not in own]

    def facts(self, left_out: Sequence[str]) -> list[Fact]:
        """The kind of table, and what of it is not used."""
        facts, header = [], self.header
        if not self.sheet.listed:
            several = say("{points} points in a row", points=header.points)
            facts.append(Fact("table", say("Table"), several if header.points > 1 else say("one point in a row")))
            facts.append(Fact("header", say("Header"), Verbatim(self.start.removeprefix(self.where).lstrip(": "))))
        indices = [*header.unused, *(i for name in left_out for i in header.columns[name])]
        if unused := [header.headings[i] for i in indices]:
            facts.append(Fact("not_used", say("Columns not used"), _first_of(unused, commas), (*unused,)))
        if self.after:
            facts.append(Fact("after", say("Lines of text after the table"), number(self.after)))
        return [*facts, *left_out_fact(self.left_out)]


def _of_another_table(error: CmmUqError) -> NotReadError:
    """Of a cell beside coordinates, whose row may be something else, as the centre below the points of a ball."""
    return NotReadError(error.problem, where=error.where, fix=error.fix)


def _first_of(words: Sequence[str], join: Callable[[Sequence[Text]], Text]) -> Text:
    """The first of many words, and how many more there are."""
    shown, more = join(names(words[:_SHOWN])), len(words) - _SHOWN
    return say("{shown} and {more} more", shown=shown, more=more) if more > 0 else shown


def left_out_fact(rows: Sequence[str]) -> list[Fact]:
    """Rows that are left out, by their place and why."""
    alike: dict[tuple[str, str], list[str]] = {}  # numbers of rows, by what stands there and why it is left out
    for row in rows:
        place, _, what = row.partition(": ")
        before, _, last = place.rpartition(" ")
        alike.setdefault((before, what), []).append(last)
    told = [f"{before} {', '.join(numbers)}: {what}".strip() for (before, what), numbers in alike.items()]
    return [Fact("left_out", say("Rows left out"), _first_of(told, semicolons))] if told else []


def _refuse_another_length(sheet: Sheet, header: Header, i: int, needed: Sequence[int], where: str) -> None:
    row, width = sheet.rows[i], len(header.headings)
    if any(cell != "" and (not sheet.spreadsheet or is_number(cell)) for cell in row[width:]):
        halves = " (a decimal comma in cells that commas separate?)" if len(row) >= 2 * width - 1 else ""
        above = max(len(one) for one in sheet.rows[max(header.row - 2, 0) : header.first])  # of a head in several rows
        problem = NotReadError if sheet.spreadsheet or above >= len(row) else CmmUqError
        raise problem(f"has {len(row)} cells where the header has {width}{halves}", where=sheet.at(where, i),
                      fix="Export with semicolons or tabs between cells, or mend the row")  # fmt: skip
    if len(row) <= max(needed) and not sheet.spreadsheet:
        last = not any(cell != "" for later in sheet.rows[i + 1 :] for cell in later)
        raise NotReadError(f"the row ends after {len(row)} of {width} cells", where=sheet.at(where, i),
                         fix="The file was cut off: export it again" if last else "Complete the row")  # fmt: skip
