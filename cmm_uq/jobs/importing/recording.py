"""A recording in any format that is known: its table is found, its columns named, its points numbered."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from itertools import zip_longest
from pathlib import PurePath

import numpy as np

from cmm_uq.base.errors import CmmUqError, suggestion
from cmm_uq.base.files.limits import TABLE_BYTES
from cmm_uq.base.messages import Verbatim, commas, names, say
from cmm_uq.base.points import Floats, Ints
from cmm_uq.base.values import dataclass, field, replace
from cmm_uq.jobs.columns import COORDINATES, OPTIONAL, WHOLE
from cmm_uq.jobs.importing import format as formats, header as heads
from cmm_uq.jobs.importing.answers import head_of
from cmm_uq.jobs.importing.cells.encodings import is_number
from cmm_uq.jobs.importing.cells.figures import SMALL
from cmm_uq.jobs.importing.columns import columns_of
from cmm_uq.jobs.importing.factors import hint
from cmm_uq.jobs.importing.format import Fact, Format, ImportKeys, NotReadError, Recognition, Sheet
from cmm_uq.jobs.importing.header import LINES_BEFORE, POINTS, REFERENCES, Header, header_of
from cmm_uq.jobs.importing.lengths.axis_runs import axis_runs
from cmm_uq.jobs.importing.lengths.circles import centre_of, circles_of
from cmm_uq.jobs.importing.lengths.other_kinds import other_kind
from cmm_uq.jobs.importing.lines import COLUMNS, REFERENCE, MeasuredLengths, placed, placed_runs
from cmm_uq.jobs.importing.numbering import NUMBERS, REPEAT, refuse_uneven
from cmm_uq.jobs.importing.roles import at_places, said
from cmm_uq.jobs.importing.tabular import alternatives
from cmm_uq.jobs.importing.understanding import Understanding, understand

_UNIT_LINE = re.compile(
    r"(?:\b(?:units?|einheit(?:en)?|ma(?:ß|ss)einheit|unit[ée]s?|unit[àa]|unidad(?:es)?)\s*[:=;]+|(?:単位|单位|單位|단위)\s*[:：=;]*"
    r"|\b(?:dimensions|lengths|values|angaben|ma(?:ß|ss)e|werte|cotes|valeurs|misure|valori|medidas)\s+(?:in|en)\b)\s*([^\s;,]+)",
    re.IGNORECASE,
)


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
    if REPEAT in columns and not ({*NUMBERS} & {*headings, *keys.columns} or keys.points_per_measurement):
        refuse_uneven(columns, where)
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
    form, file, sheets = formats.format_of(content, where), PurePath(where).name, list[Sheet]()
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
        if not keys.columns and wanted is POINTS and _lengths_at_places(sheet, header):
            what = "its rows are lengths, measured at planned places"
            raise NotReadError(what, where=sheet.at(where, header.row), fix="Name columns")
        two_ends = not keys.columns and len(header.columns.get("x_mm", ())) == 2
        if two_ends and {"reference", "measured"} <= {*map(said, head)}:
            what = "its rows are lengths with both ends"
            raise NotReadError(what, where=sheet.at(where, header.row), fix="Name columns")
        return _points(sheet, header, keys, where, reach_mm, replace(recognised, head=head), points=wanted is POINTS)
    except NotReadError as error:
        problem = error
    if wanted is POINTS and {*keys.columns} <= {*COLUMNS, *OPTIONAL, *WHOLE}:
        understood = understand(_alternatives(form, content, where, keys), keys.columns, where, points=not keys.lines)
        if understood is not None:
            return _understood(understood, keys, where, reach_mm, recognised)
        problem = other_kind(sheets, where) or problem if not keys.columns else problem
    raise problem or heads.no_header(sheets, keys, where, wanted)


def _lengths_at_places(sheet: Sheet, header: Header) -> bool:
    """Whether calibrated and measured lengths stand beside coordinates, as far finer figures."""
    row = sheet.rows[header.first] if header.first < len(sheet.rows) else ()
    steps = [10.0 ** -len((re.findall(r"(?<=\d)[.,](\d+)", text) or [""])[-1]) for text in map(heads.text_of, row)]
    places = [steps[own[0]] for name, own in header.columns.items() if name in COORDINATES and own[0] < len(row)]
    roles = [said(text) or hint(text, lengths=True) for text in header.headings[: len(row)]]
    return bool(places) and at_places(zip(roles, steps, strict=False), min(places))


def _understood(
    understood: Understanding, keys: ImportKeys, where: str, reach_mm: float | None, begun: Recognition
) -> ImportedTable:
    """A recording of what was understood of a file."""
    head, reading = understood.header, understood.reading
    begun = replace(begun, head=tuple(head_of(understood.grid.sheet.rows[head.row])) if head.row < head.first else ())
    if reading.kind in ("runs", "circles"):
        round_ = reading.kind == "circles"
        sheets, grid = understood.sheets, understood.grid
        runs = circles_of(reading, sheets, grid, where) if round_ else axis_runs(reading, sheets, where)
        stated = centre_of(grid, runs) if round_ else understood.axis_places(runs)
        labels = [label.words for label in reading.every_label if len({*label.values}) > 1]
        sheet = placed_runs(runs, keys, where, understood.passed_over(labels), stated)[0]
        header = header_of(sheet, keys.model_copy(update={"columns": {}}), where, POINTS)
        assert header is not None  # of the head that was written  # noqa: S101
        table = _points(sheet, header, keys, where, reach_mm, begun, points=True)
        heads_of = dict.fromkeys(COORDINATES, understood.sources["target"]) | {
            "reading_um": understood.sources["reading_um"]
        }
        found = replace(table.recognised, columns={**table.recognised.columns, **heads_of})
        places = {axis: place for axis, (place, _) in stated.items()} | keys.lines
        return replace(table, recognised=found, places=places)
    lines, places = reading.lines, {}
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
        error, first = CmmUqError if tables[0][0].listed else NotReadError, tables[0][0].name
        what = f"holds {len(tables)} tables of points: {', '.join(repr(sheet.name) for sheet, _ in tables)}"
        raise error(what, where=where, fix=f'Say which: sheet = "{first}"')
    return tables[0]


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
