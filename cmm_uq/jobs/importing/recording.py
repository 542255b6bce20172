"""The file of a recording: a CSV with one row a point is read as it is, a file in any other format is imported.

Every cell is checked where it stands, so that a message can name line and column; any numeric column of another name than
those of a recording is kept as a covariate.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import partial
from itertools import compress, zip_longest
from pathlib import PurePath

import numpy as np
from numpy.typing import NDArray

from cmm_uq.base.errors import CmmUqError, Gathered, suggestion
from cmm_uq.base.files.csv_table import GIVE, GIVE_OR_REMOVE, MEASURE, cells_of, column_problem, numbers
from cmm_uq.base.files.limits import TABLE_BYTES
from cmm_uq.base.messages import Verbatim, commas, names, say
from cmm_uq.base.points import Floats, Ints, Machine, Points
from cmm_uq.base.values import dataclass, field, replace
from cmm_uq.jobs.columns import COORDINATES, LARGEST_NUMBER, OPTIONAL, REQUIRED, WHOLE, largest, misnamed
from cmm_uq.jobs.importing import format as formats, header as heads
from cmm_uq.jobs.importing.answers import head_of
from cmm_uq.jobs.importing.cells.encodings import is_number
from cmm_uq.jobs.importing.cells.figures import SMALL
from cmm_uq.jobs.importing.columns import columns_of
from cmm_uq.jobs.importing.format import Fact, Format, ImportKeys, NotReadError, Recognition, Sheet
from cmm_uq.jobs.importing.header import LINES_BEFORE, POINTS, REFERENCES, Header, header_of
from cmm_uq.jobs.importing.lines import COLUMNS, REFERENCE, MeasuredLengths, axis_runs, placed, placed_runs
from cmm_uq.jobs.importing.roles import said
from cmm_uq.jobs.importing.tabular import alternatives
from cmm_uq.jobs.importing.understanding import Understanding, understand
from cmm_uq.jobs.machines import coordinates, required_columns, strange_column

# lengths between which nx, ny, nz are taken for a direction: rounded to three digits, or scaled
SHORTEST_NORMAL, LONGEST_NORMAL = 1e-3, 1e3
_UNIT_LINE = re.compile(
    r"(?:\b(?:units?|einheit(?:en)?|ma(?:ß|ss)einheit|unit[ée]s?|unit[àa]|unidad(?:es)?)\s*[:=;]+|(?:単位|单位|單位|단위)\s*[:：=;]*"
    r"|\b(?:dimensions|lengths|values|angaben|ma(?:ß|ss)e|werte|cotes|valeurs|misure|valori|medidas)\s+(?:in|en)\b)\s*([^\s;,]+)",
    re.IGNORECASE,
)


def read_recording(content: bytes, name: str, machine: Machine, without: Collection[str] = ()) -> Points:
    """Points of a recording in the project's own format, but for columns that it is to be read ``without``."""
    wrong, table = Gathered(), dict[str, Floats]()
    cells = cells_of(content, name, "Save the recording as CSV in UTF-8")
    header, whole = cells.header, [len(row) == len(cells.header) for row in cells.rows]
    for row, line in zip(cells.rows, cells.lines, strict=True):
        if len(row) != len(header):
            fix = "Complete the row; if it is the last one, the file was cut off: export it again"
            wrong.tell(f"has {len(row)} cells where the header has {len(header)}", where=f"{name} line {line}", fix=fix)
    if not cells.rows:
        raise CmmUqError("has no rows", where=name, fix="The first line names the columns, then one row a point")
    rows, lines = list(compress(cells.rows, whole)), list(compress(cells.lines, whole))
    with wrong.going_on():
        _check_header(header, name, needed := required_columns(machine, header), machine)
    if not set(needed) <= set(header):
        wrong.refuse()  # the cells of another table are another's
    for i, column in enumerate(header):
        fix = MEASURE if column in COORDINATES else GIVE if column in REQUIRED else GIVE_OR_REMOVE
        if column not in without:
            with wrong.going_on():
                table[column] = numbers([row[i] for row in rows], partial(_place, name, lines, column), fix)
    return points_of(table, lines, name, machine, wrong)


def _place(name: str, lines: Sequence[int], column: str, row: int) -> str:
    return f"{name} line {lines[row]}" + (f", column {column}" if column else "")


def points_of(
    table: Mapping[str, Floats], lines: Sequence[int], name: str, machine: Machine, wrong: Gathered | None = None
) -> Points:
    """Points of the columns of a recording, each (n,), the required ones among them."""
    wrong = wrong or Gathered()

    def refuse(bad: NDArray[np.bool_], problem: str, fix: str, column: str, of: Floats) -> None:
        if bad.any():
            row = int(np.argmax(bad))
            wrong.tell(problem.format(of[row]), where=_place(name, lines, column, row), fix=fix)

    for column, values in table.items():
        if column not in WHOLE:
            most = largest(column)
            refuse(np.abs(values) > most, "{:g} is more than anything that is measured",
                   f"{most:g} is the most: check its unit and its exponent", column, values)  # fmt: skip
    # normals are brought to unit length where they are used: a direction must be meant
    if all(f"n{axis}" in table for axis in "xyz"):
        length = np.sqrt(sum(table[f"n{axis}"] ** 2 for axis in "xyz"))
        bad = (length != 0) & ((length < SHORTEST_NORMAL) | (length > LONGEST_NORMAL))
        refuse(bad, "the normal nx, ny, nz has the length {:.3g}", "Give outward unit normals", "", length)
    for column in (one for one in WHOLE if one in table):
        values = table[column]
        refuse((values != np.round(values)) | (np.abs(values) > LARGEST_NUMBER), "{:g} is not a whole number",
               "Number measurements, points and repeats 1, 2, …", column, values)  # fmt: skip
    for column in (one for one in ("approach_x", "approach_y", "approach_z") if one in table):
        refuse(~np.isin(table[column], (-1, 0, 1)), "{:g} is no direction",
               "The direction of travel into the point is −1, 0 or +1", column, table[column])  # fmt: skip
    wrong.refuse()
    measurement, point, repeat = (table.get(column, np.ones(len(lines))).astype(np.int64) for column in WHOLE)
    seen: dict[tuple[int, int, int], int] = {}
    for key, line in zip(zip(*map(np.ndarray.tolist, (measurement, point, repeat)), strict=True), lines, strict=True):
        if key in seen:
            said = f"measurement {key[0]}, point {key[1]}, repeat {key[2]} is there twice"
            fix = "Number repeated measurements in a column repeat"
            raise CmmUqError(said, where=f"{name} lines {seen[key]} and {line}", fix=fix)
        seen[key] = line
    columns = {column: values for column, values in table.items() if column not in (*REQUIRED, "repeat")}
    xyz = coordinates(machine, table, lines, name)
    return Points(xyz, measurement, point, repeat, machine, columns, np.array(lines, dtype=np.int64))


def _check_header(header: Sequence[str], name: str, needed: Sequence[str], machine: Machine) -> None:
    where = f"{name} line 1"
    if len(header) == 1 and ";" in header[0]:
        raise CmmUqError("cells are separated by semicolons", where=where,
                         fix="Separate them by commas, with a decimal point in numbers")  # fmt: skip
    wrong = Gathered()
    for i, column in enumerate(header):
        if not column:
            wrong.tell(f"column {i + 1} has no name", where=where, fix="Name it, or remove it")
        elif column in header[:i]:
            wrong.tell(f"the column {column!r} is there twice", where=where, fix="Keep one")
        elif problem := column_problem(column):
            wrong.tell(problem, where=where, fix="Name it with letters, digits and _")
        elif wrong_name := misnamed(column, header) or strange_column(machine, column, header):
            wrong.tell(wrong_name[0], where=where, fix=wrong_name[1])
    for column in needed:
        alike = [one for one in header if one[:2] == column[:2]]
        if column not in header and not any(strange_column(machine, one, header) for one in alike):
            unread = " (of an axis that nobody reads, give one number in all rows)" * (column in COORDINATES)
            fix = f"{suggestion(column, set(header) - set(needed))}{unread}"
            wrong.tell(f"no column {column!r}", where=where, fix=fix)
    wrong.refuse()


@dataclass(frozen=True, eq=False)
class ImportedTable:
    """A file, read: columns of a recording by name, each (n,), in the units of their names, and each point's line."""

    columns: dict[str, Floats]
    lines: Ints
    recognised: Recognition
    places: Mapping[str, str] = field(default_factory=dict)  # of lines of lengths, and of axes, by name


class UnplacedError(CmmUqError):
    """Lengths were read whole, and nothing says where they lie; ``recognised``: how they were read."""

    def __init__(self, error: CmmUqError, recognised: Recognition, lengths: Sequence[MeasuredLengths]) -> None:
        super().__init__(error.problem, where=error.where, fix=error.fix)
        self.recognised, self.lengths = recognised, lengths


def imported(content: bytes, where: str, keys: ImportKeys, *, reach_mm: float | None = None) -> ImportedTable:
    """A recording in any format that is known."""
    table = _imported(content, where, keys, POINTS, reach_mm)
    headings, columns = table.recognised.columns, table.columns
    uncertainties = [name for name in columns if name.startswith("reference_u_") or name == "reference_U_um"]
    others = [name for name in uncertainties if headings[name] != name and name not in keys.columns]
    if not others or any(name.startswith("reference_") and name.endswith("_mm") for name in columns):
        return table
    # of the measured point, not of a certificate
    left = commas(names([headings[name] for name in others]))
    unused = Fact("uncertainties_not_used", say("Uncertainties not used"), left)
    taken = {name: heading for name, heading in headings.items() if name not in others}
    recognised = replace(table.recognised, columns=taken, facts=(*table.recognised.facts, unused))
    used = {name: values for name, values in columns.items() if name not in others}
    return replace(table, columns=used, recognised=recognised)


def imported_references(content: bytes, where: str, keys: formats.FileKeys) -> ImportedTable:
    """Certified values in any format that is known: distances or places, by the number of their point."""
    every = ImportKeys.model_validate({name: getattr(keys, name) for name in formats.FileKeys.model_fields})
    try:
        table = _imported(content, where, every, REFERENCES, None)
    except NotReadError as error:
        lengths = _lengths_headed(_sheets_of(formats.format_of(content, where), content, where, every))
        if len(lengths) != 1 or every.columns.keys() & {"reference_mm"}:
            problem, fix = ((text or "").replace("x_mm", "reference_mm", 1) for text in (error.problem, error.fix))
            raise NotReadError(problem, where=error.where, fix=fix) from None
        taken = every.model_copy(update={"columns": {**every.columns, "reference_mm": lengths.pop()}})
        table = _imported(content, where, taken, REFERENCES, None)
    columns = {f"reference_{name}" if name in COORDINATES else name: values for name, values in table.columns.items()}
    return replace(table, columns=columns)


def _lengths_headed(sheets: Sequence[Sheet]) -> set[str]:
    """Headings that say a length and no more: on a certificate the certified one."""
    words = heads.words_of("lengths")["length"]
    texts = (cell for sheet in sheets for row in sheet.rows[:LINES_BEFORE] for cell in row if isinstance(cell, str))
    each = ((text, heads.without_unit(text.replace("_", " "))[0]) for text in texts)
    return {text for text, plain in each if " ".join(heads.plain_words(plain)) in words}


def _imported(
    content: bytes, where: str, keys: ImportKeys, wanted: Sequence[Sequence[str]], reach_mm: float | None
) -> ImportedTable:
    if len(content) > TABLE_BYTES.most:
        large = f"is larger than the {TABLE_BYTES.most} {TABLE_BYTES.unit} that are read of such a file"
        raise CmmUqError(large, where=where, fix="Split it")
    form, file = formats.format_of(content, where), PurePath(where).name
    recognised = Recognition(file, form.name, form.title, (), {}, 0)
    problem: NotReadError | None = None
    try:
        sheets = _sheets_of(form, content, where, keys)
        sheet, header = _chosen(sheets, keys, where, wanted)
        head = tuple(head_of(sheet.rows[header.row])) if header.row < header.first else ()
        if sheet.rows[header.row] in sheet.rows[header.row + 1 :] or any(
            map(heads.names_axes, sheet.rows[header.first + 1 :])
        ):
            raise NotReadError("its head comes again", where=sheet.at(where, header.row), fix="Export one table")
        if (
            not keys.columns
            and len(header.columns.get("x_mm", ())) == 2
            and {"reference", "measured"} <= {*map(said, head)}
        ):
            raise NotReadError(
                "its rows are lengths with both ends", where=sheet.at(where, header.row), fix="Name columns"
            )
        return _points(sheet, header, keys, where, reach_mm, replace(recognised, head=head), points=wanted is POINTS)
    except NotReadError as error:
        problem = error
    if wanted is POINTS and {*keys.columns} <= {*COLUMNS, *OPTIONAL, *WHOLE}:
        understood = understand(_alternatives(form, content, where, keys), keys.columns, where, points=not keys.lines)
        if understood is not None:
            return _understood(understood, keys, where, reach_mm, recognised)
    raise problem or heads.no_header(sheets, keys, where, wanted)


def _understood(
    understood: Understanding, keys: ImportKeys, where: str, reach_mm: float | None, begun: Recognition
) -> ImportedTable:
    """A recording of what was understood of a file."""
    head, reading = understood.header, understood.reading
    begun = replace(begun, head=tuple(head_of(understood.grid.sheet.rows[head.row])) if head.row < head.first else ())
    if reading.kind == "runs":
        runs = axis_runs(reading, understood.sheets, where)
        stated = understood.axis_places(runs)
        sheet = placed_runs(runs, keys, where, stated=stated)[0]
        header = header_of(sheet, keys.model_copy(update={"columns": {}}), where, POINTS)
        assert header is not None  # of the head that was written  # noqa: S101
        table = _points(sheet, header, keys, where, reach_mm, begun, points=True)
        return replace(table, places={axis: place for axis, (place, _) in stated.items()} | keys.lines)
    lines, places = reading.lines, dict[str, str]()
    if reading.kind == "points":
        columns, facts = understood.points(keys, where, reach_mm)
    else:
        lengths = understood.lengths(keys, where, reach_mm)
        facts = lengths.facts
        try:
            columns, of_lines, lines = placed(lengths, keys, where)
            places = {name: place for name, (place, _) in lengths.places.items()} | keys.lines
        except CmmUqError as error:
            found = replace(begun, facts=facts, columns=lengths.sources, points=2 * len(lengths.names))
            raise UnplacedError(error, found, [lengths]) from None
        facts += of_lines
    found = replace(begun, facts=facts, columns=understood.sources, points=len(lines))
    return ImportedTable(columns, np.array(lines), found, places)


def _alternatives(form: Format, content: bytes, where: str, keys: ImportKeys) -> Iterator[Sequence[Sheet]]:
    """Ways of cutting a file into cells."""
    if form.name != "text":
        with suppress(CmmUqError):
            yield [_with_unit(sheet) for sheet in form.read(content, where, keys) if keys.sheet in (None, sheet.name)]
    if form.name in ("text", "calypso", "pc-dmis"):
        for sheets in alternatives(content, where, keys):
            yield [_with_unit(replace(sheet, decimal=keys.decimal)) for sheet in sheets]


def _points(
    sheet: Sheet, header: Header, keys: ImportKeys, where: str, reach_mm: float | None, begun: Recognition, *, points: bool
) -> ImportedTable:  # fmt: skip
    values, lines, sources, facts = columns_of(sheet, header, keys, where, reach_mm=reach_mm, points=points)
    named = (Fact("sheet", say("Sheet"), Verbatim(sheet.name)),) if sheet.name else ()
    found = replace(begun, facts=(*named, *sheet.facts, *facts), columns=sources, points=len(lines))
    return ImportedTable(values, lines, found)


def tables_in(content: bytes, where: str, keys: ImportKeys) -> tuple[list[Sheet], list[tuple[Sheet, Header]]]:
    """Sheets of a file, and its table with its header; none where it is not understood."""
    form = formats.format_of(content, where)
    sheets = _sheets_of(form, content, where, keys)
    with suppress(CmmUqError):
        sheet, header = _chosen(sheets, keys, where, POINTS)
        if sheet.rows[header.row] not in sheet.rows[header.row + 1 :]:
            columns_of(sheet, header, keys, where)
        return sheets, [(sheet, header)]
    with suppress(CmmUqError):
        if found := understand(_alternatives(form, content, where, keys), keys.columns, where, points=not keys.lines):
            if found.reading.kind == "points" and len(found.reading.taken) == 1:  # a row for each coordinate, as points
                columns, _ = found.points(keys, where, None)
                cells = ([f"{cell:.9g}" for cell in row] for row in zip(*columns.values(), strict=True))
                rows = [("", row, line) for row, line in zip(cells, found.reading.lines, strict=True)]
                sheets = formats.sheets_of(rows, [*columns], unit="mm")
                return sheets, [(sheets[0], Header(0, 1, [*columns], {name: (i,) for i, name in enumerate(columns)}))]
            return [*found.sheets], [(found.grid.sheet, found.header)]
    return sheets, []


def _sheets_of(form: Format, content: bytes, where: str, keys: ImportKeys) -> list[Sheet]:
    return [_with_unit(sheet) for sheet in form.read(content, where, keys)]


def _with_unit(sheet: Sheet) -> Sheet:
    """With the unit that a line ahead of its table says, as ``Units: mm``."""
    rows = sheet.rows[:LINES_BEFORE] if sheet.unit is None and not sheet.listed else ()
    for row, below in zip_longest(rows, rows[1:], fillvalue=()):  # which may stand below its word
        text = ";".join(map(str, row))
        match = _UNIT_LINE.search(f"{text} {below[0]}" if len(row) == len(below) == 1 and text[-1:] == ":" else text)
        if match and (unit := formats.length_named(match[1].strip("[]().,;"))) and unit.name not in SMALL:
            return replace(sheet, unit=unit.name)
        if sum(cell != "" and is_number(cell) for cell in row) > 1:
            break
    return sheet


def _chosen(
    sheets: Sequence[Sheet], keys: ImportKeys, where: str, wanted: Sequence[Sequence[str]]
) -> tuple[Sheet, Header]:
    """The sheet with the table of points, and its header."""
    if keys.sheet is not None:
        known = [sheet.name for sheet in sheets if sheet.name]
        sheets = [sheet for sheet in sheets if sheet.name.casefold() == keys.sheet.casefold()]
        if not sheets:
            fix = suggestion(keys.sheet, known) if known else "Leave sheet out: the file has only one table"
            raise CmmUqError(f"has no sheet {keys.sheet!r}", where=where, fix=fix)
    tables = [(sheet, header) for sheet in sheets if (header := header_of(sheet, keys, where, wanted)) is not None]
    if not tables:
        raise heads.no_header(sheets, keys, where, wanted)
    if len(tables) > 1:
        listed = ", ".join(repr(sheet.name) for sheet, _ in tables)
        raise (CmmUqError if tables[0][0].listed else NotReadError)(
            f"holds {len(tables)} tables of points: {listed}",
            where=where,
            fix=f'Say which: sheet = "{tables[0][0].name}"',
        )
    return tables[0]


def read_recording_file(
    content: bytes, where: str, machine: Machine, keys: ImportKeys, without: Collection[str] = ()
) -> tuple[Points, Recognition | None]:
    """Points of a recording, and how it was read where it is in another format than the project's own."""
    if not keys.asked and is_own(content):
        return read_recording(content, where, machine, without), None
    spans = machine.travel_mm[:, 1] - machine.travel_mm[:, 0]
    reach = float(np.linalg.norm(spans)) if np.all(np.isfinite(spans)) else None
    table = imported(content, where, keys, reach_mm=reach)
    return points_of(table.columns, table.lines.tolist(), where, machine), table.recognised


def is_own(content: bytes) -> bool:
    """Whether a recording is in the project's own format: empty, or a header that names one of its columns between commas."""
    return not content.strip() or any(name in REQUIRED for name in header(content))


def header(content: bytes) -> list[str]:
    """Names between commas in the first line that is no comment."""
    text = content[:16_384].decode("utf-8-sig", errors="replace")
    line = next((line for line in map(str.strip, text.splitlines()) if line and not line.startswith("#")), "")
    return [name.strip().strip('"') for name in line.split(",")]


def example(read: ImportedTable | Sequence[MeasuredLengths]) -> str:
    """What was read first, in words: ``line 1, run 1: 120 mm measured as 120.0012 mm, +1.2 µm``."""
    if not isinstance(read, ImportedTable):
        of_line, measured, nominal = f"line {read[0].names[0]}, ", read[0].measured[0], read[0].reference[0]
        run = read[0].repeat[0]
    elif "length_mm" not in read.recognised.columns:
        first = {name: values[0] for name, values in read.columns.items()}
        numbers = " ".join(f"{name} {first[name]:g}," for name in WHOLE if name in first)
        return f"{numbers} {', '.join(f'{name[0]} {first[name]:.4f} mm' for name in COORDINATES)}"
    else:  # two points a length
        xyz, reference = np.diff([read.columns[name][:2] for name in COORDINATES]), read.columns.get(REFERENCE)
        of_line, measured, run = "", float(np.linalg.norm(xyz)), read.columns["repeat"][0]
        nominal = None if reference is None else float(reference[1])
    of, error = "", ""
    if nominal is not None:
        of, error = f"{nominal:.4f} mm measured as ", f", {1000 * (measured - nominal):+.4g} µm"
    return f"{of_line}run {run:g}: {of}{measured:.4f} mm{error}"
