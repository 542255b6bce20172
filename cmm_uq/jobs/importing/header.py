"""Where the table of a sheet begins, and which of its columns is which of a recording's.

Which columns a table must have: of a recording its coordinates, of an artefact's certificate its certified values.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.importing.keys import ImportKeys, Sources, WrittenUnit, unit_named
from cmm_uq.jobs.importing.numerals import is_number
from cmm_uq.jobs.importing.recording import COORDINATES
from cmm_uq.jobs.importing.sheet import Cell, Sheet
from cmm_uq.jobs.importing.vocabulary import Heading, is_nominal, understood

LINES_BEFORE = 2000
"""Lines of text before a table that are searched for its header."""

_SHOWN = 12
"""Headings in a message."""


@dataclass(frozen=True)
class Header:
    """A header, understood.

    row : its index in the sheet; that of the first row of figures where columns are named by number and there is none.
    first : index of the first row of figures.
    headings : of every column.
    columns : indices of the columns of each column of a recording: several where a row holds several points.
    units : of the columns, by index, where the header names them.
    unused : indices of the others.
    """

    row: int
    first: int
    headings: Sequence[str]
    columns: Mapping[str, tuple[int, ...]]
    units: Mapping[int, WrittenUnit] = field(default_factory=dict)
    odd_units: Mapping[int, str] = field(default_factory=dict)

    @property
    def points(self) -> int:
        return max(map(len, self.columns.values()))

    @property
    def unused(self) -> list[int]:
        """Columns with a heading that are not taken."""
        used = {i for own in self.columns.values() for i in own}
        return [i for i, heading in enumerate(self.headings) if heading and i not in used]


def header_of(sheet: Sheet, keys: ImportKeys, where: str, wanted: Sequence[Sequence[str]]) -> Header | None:
    """The header of a sheet: the first row that names the wanted columns.

    Returns ``None`` where no row names them.
    """
    if _by_number(keys) and any(set(columns) <= set(keys.columns) for columns in wanted):
        return _numbered(sheet, keys)
    for row, cells in enumerate(sheet.rows[:LINES_BEFORE]):
        if len(cells) < 2 and not keys.columns:
            continue
        headings = [cell if isinstance(cell, str) else f"{cell:g}" for cell in cells]
        found = _assigned(headings, keys)
        if found is not None and any(set(columns) <= set(found) for columns in wanted):
            place = sheet.at(where, row)
            return _with_units(sheet, row, headings, _unambiguous(found, headings, place))
    return None


def _by_number(keys: ImportKeys) -> bool:
    sources = [source for given in keys.columns.values() for source in (given if isinstance(given, list) else [given])]
    return bool(sources) and all(isinstance(source, int) for source in sources)


def _numbered(sheet: Sheet, keys: ImportKeys) -> Header | None:
    """A table whose columns are named by number: it begins with the first row of figures in all of them."""
    columns = {name: tuple(_sources(given)) for name, given in keys.columns.items()}
    needed = [i for name in COORDINATES for i in columns.get(name, ())] or [i for own in columns.values() for i in own]
    for row, cells in enumerate(sheet.rows[:LINES_BEFORE]):
        if len(cells) > max(needed) and all(cells[i] != "" and is_number(cells[i]) for i in needed):
            names = [f"{i + 1}" for i in range(len(cells))]
            return Header(row, row, names, columns)
    return None


def _sources(given: Sources) -> Iterable[int]:
    return [int(source) - 1 for source in (given if isinstance(given, list) else [given])]


Found = dict[str, list[tuple[int | None, int]]]
"""Of each column of a recording: index of the point in a row, and index of the column."""


def _assigned(headings: Sequence[str], keys: ImportKeys) -> Found | None:
    """What the headings of a row are; ``None`` where one that the job names is not among them."""
    found: Found = {}
    for name, given in keys.columns.items():
        sources = given if isinstance(given, list) else [given]
        places = [_place(source, headings) for source in sources]
        if None in places:
            return None
        found[name] = [
            (i if len(places) > 1 else None, place) for i, place in enumerate(places, 1) if place is not None
        ]
    taken = {place for own in found.values() for _, place in own}
    for i, heading in enumerate(headings):
        told = understood(heading.strip()) if heading else Heading()
        if told.column and told.column not in keys.columns and i not in taken:
            found.setdefault(told.column, []).append((told.index, i))
    return found


def _place(source: str | int, headings: Sequence[str]) -> int | None:
    """Index of the column that a job names by heading or number."""
    if isinstance(source, int):
        return source - 1 if source <= len(headings) else None
    for wanted, among in ((source.strip(), headings), (source.strip().casefold(), [h.casefold() for h in headings])):
        if wanted in among:
            return list(among).index(wanted)
    return None


def _unambiguous(found: Found, headings: Sequence[str], place: str) -> dict[str, tuple[int, ...]]:
    """One column each, or one for each point of a row."""
    count = len({index for index, _ in found.get("x_mm", ())} - {None})
    columns: dict[str, tuple[int, ...]] = {}
    for name, own in found.items():
        indices = [index for index, _ in own]
        several = count > 1 and None not in indices and len(set(indices)) == len(indices)
        if len(own) > 1 and not several:
            shown = " and ".join(repr(headings[i]) for _, i in own[:3])
            first = own[0][1]
            one = first + 1 if headings.count(headings[first]) > 1 else f'"{headings[first]}"'
            raise CmmUqError(f"columns {shown} could all be {name}", where=place,
                             fix=f"Say which: columns = {{ {name} = {one} }}")  # fmt: skip
        columns[name] = tuple(i for _, i in sorted(own, key=lambda one: one[0] or 0))
    return _one_count(columns, place)


def _one_count(columns: dict[str, tuple[int, ...]], place: str) -> dict[str, tuple[int, ...]]:
    """Every column once a row, or once for each of its points."""
    count = max(map(len, columns.values()))
    odd = next((name for name, own in columns.items() if len(own) not in (1, count)), None)
    if odd is None and all(len(columns.get(name, ())) in (0, count) for name in COORDINATES):
        return columns
    name = odd or next(name for name in COORDINATES if len(columns.get(name, ())) != count)
    raise CmmUqError(f"{count} points in a row, and {len(columns[name])} columns {name}", where=place,
                     fix=f"Say which: columns = {{ {name} = [ … ] }}, one heading for each point")  # fmt: skip


def _with_units(sheet: Sheet, row: int, headings: Sequence[str], columns: Mapping[str, tuple[int, ...]]) -> Header:
    """The header with its units, which may stand in a row of their own."""
    units, odd = {}, {}
    for i, heading in enumerate(headings):
        told = understood(heading.strip()) if heading else Heading()
        if told.unit:
            units[i] = told.unit
        elif told.odd_unit:
            odd[i] = told.odd_unit
    below = sheet.rows[row + 1] if row + 1 < len(sheet.rows) else []
    own = {i: _unit_alone(cell) for i, cell in enumerate(below) if cell != ""}
    if own and all(own.values()):
        return Header(row, row + 2, headings, columns, units | {i: unit for i, unit in own.items() if unit}, odd)
    return Header(row, row + 1, headings, columns, units, odd)


def _unit_alone(cell: Cell) -> WrittenUnit | None:
    return unit_named(cell.strip("[]()<>{} ")) if isinstance(cell, str) else None


def no_header(sheets: Sequence[Sheet], keys: ImportKeys, where: str, wanted: Sequence[Sequence[str]]) -> CmmUqError:
    """Why no sheet has the columns that are needed."""
    best: tuple[int, Sheet, int, list[str]] | None = None
    for sheet in sheets:
        for row, cells in enumerate(sheet.rows[:LINES_BEFORE]):
            headings = [cell for cell in cells if isinstance(cell, str) and cell]
            score = sum(understood(heading).column is not None for heading in headings)
            score += sum(_place(source, headings) is not None for source in _named(keys))
            if score and (best is None or score > best[0]):
                best = (score, sheet, row, headings)
    if best is None:
        given = f" ({', '.join(map(repr, _named(keys)))})" if keys.columns else ""
        return CmmUqError(f"no line names the columns{given} of a table of points", where=where,
                          fix="Name them by number: columns = { x_mm = 1, y_mm = 2, z_mm = 3 }, or export one")  # fmt: skip
    _, sheet, row, headings = best
    missing = _missing(headings, keys, wanted)
    listed = ", ".join(map(repr, headings[:_SHOWN])) + (" …" if len(headings) > _SHOWN else "")
    hint = " (nominal values are not taken for measured ones)" if any(map(is_nominal, headings)) else ""
    return CmmUqError(f"no column is {missing} among {listed}{hint}", where=sheet.at(where, row),
                      fix=f'Say which: columns = {{ {missing} = "…" }}')  # fmt: skip


def _named(keys: ImportKeys) -> list[str]:
    return [source for given in keys.columns.values() for source in (given if isinstance(given, list) else [given])
            if isinstance(source, str)]  # fmt: skip


def _missing(headings: Sequence[str], keys: ImportKeys, wanted: Sequence[Sequence[str]]) -> str:
    for name, given in keys.columns.items():
        sources = given if isinstance(given, list) else [given]
        if any(_place(source, headings) is None for source in sources):
            return name
    known = {understood(heading).column for heading in headings} | set(keys.columns)
    return next((name for name in wanted[0] if name not in known), wanted[0][0])


POINTS = (COORDINATES,)
REFERENCES = (*POINTS, ("reference_mm",), ("reference_x_mm", "reference_y_mm", "reference_z_mm"))
