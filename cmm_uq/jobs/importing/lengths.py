"""Tables of lengths, as tests after ISO 10360-2 and B89 are reported: nominal, several runs, deviations, without coordinates.

A length on a known line becomes two points a length apart, the first at the line's start, and is a measurement of its own: the
scatter of both ends stands at the second, so that it is right for their difference. Where the lines lie no table
says: it is asked for. Deviations are measured minus reference; where a table has both, one must follow from the other.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from cmm_uq.base.errors import CmmUqError, suggestion
from cmm_uq.base.messages import Verbatim, commas, names, say, semicolons
from cmm_uq.base.points import Floats
from cmm_uq.jobs.columns import COORDINATES
from cmm_uq.jobs.importing import format as units, length_tables as of_table
from cmm_uq.jobs.importing.arrangement import BASES, FIGURES, filled_down, text_of
from cmm_uq.jobs.importing.columns import SIGNS, ExportTable, split_names
from cmm_uq.jobs.importing.encodings import decimal_sign, is_number, values_of
from cmm_uq.jobs.importing.format import LENGTH, LINE_PLACE, UNITS, Cell, Fact, ImportKeys, Sheet, WrittenUnit
from cmm_uq.jobs.importing.header import NAME, Header, without_unit
from cmm_uq.jobs.importing.length_tables import BESIDE, DEVIATION_MM, DEVIATION_UM, LINE, MEASURED, REFERENCE, RUN

_FAR, _FAR_PART = 1.0, 0.002  # mm, and part of a length, by which no measured length differs from its reference


@dataclass
class MeasuredLengths:
    """Lengths of a sheet, of each its line by name, reference, run, measured value, mm, and line of the file."""

    names: list[str]
    reference: list[float | None]
    repeat: list[int]
    measured: list[float]
    lines: list[int]
    beside: dict[str, list[float]]
    sources: dict[str, str]
    facts: tuple[Fact, ...]
    left_out: tuple[str, ...]


Parts = Sequence[tuple[Floats, WrittenUnit | None, int]]
"""Values of columns as written, their units, and their indices."""


def lengths_of(sheet: Sheet, header: Header, keys: ImportKeys, where: str, reach_mm: float | None) -> MeasuredLengths:
    """The lengths of a cleaned sheet."""
    table, of = ExportTable(sheet, header, where), header.columns
    numeric = {name: own for name, own in of.items() if name not in (LINE, NAME, "repeat")}
    every = [i for own in numeric.values() for i in own]
    sign = sheet.decimal or decimal_sign(
        [table.cells[i] for i in every], lambda i, row: table.place(every[i], row), keys.decimal
    )
    written: dict[str, Parts] = {name: table.written(name, sign, blank=name in FIGURES) for name in numeric}
    if RUN in of:
        role = _run_is(table, written)
        written[role] = written.pop(RUN)
    values, of_unit = _in_units(table, written, keys, reach_mm)
    base = next((values[name][:, 0] for name in BASES if name in values), None)
    measured, source = _measured(table, values, written, base)
    labels, runs = _labels_and_runs(table, header, sign, base, measured.shape[1], keys)
    by_line = LINE not in of and all(of_table.of_lengths(header.headings[i]).column == LINE for i in of.get(RUN, (-1,)))
    beside = {name: own[:, 0].tolist() for name, own in values.items() if name in BESIDE}
    indices, left_out = [i for _, _, i in written[source]], list(sheet.left_out)
    found = MeasuredLengths([], [], [], [], [], {name: [] for name in beside}, {}, (), ())
    for row, k in np.ndindex(measured.shape):
        if np.isnan(measured[row, k]):
            left_out.append(f"{table.place(indices[k], row).removeprefix(where).lstrip(': ')}: nothing in the cell")
            continue
        found.names.append(without_unit(header.headings[indices[k]])[0] if by_line else labels[row])
        found.reference.append(None if base is None else float(base[row]))
        found.repeat.append(1 if by_line else runs[row][k])
        found.measured.append(float(measured[row, k]))
        found.lines.append(sheet.lines[table.rows[row]])
        for name, own in found.beside.items():
            own.append(beside[name][row])
    facts = [of_unit, Fact("decimal", say("Decimal sign"), SIGNS[sign])]
    used = {i for own in of.values() for i in own}
    if unused := [heading for i, heading in enumerate(header.headings) if heading and i not in used]:
        facts.append(Fact("not_used", say("Columns not used"), commas(names(unused))))
    shown_columns = {
        name: ", ".join(header.headings[i] for _, _, i in parts)
        for name, parts in written.items()
        if name in (*BASES, source, *BESIDE)
    }
    shown_columns |= {name: header.headings[of[name][0]] for name in (LINE, "repeat") if name in of}
    return replace(found, sources=shown_columns, facts=tuple(facts), left_out=tuple(left_out))


def _in_units(
    table: ExportTable, written: Mapping[str, Parts], keys: ImportKeys, reach_mm: float | None
) -> tuple[dict[str, Floats], Fact]:
    """Columns (n, k) in the units of their names; a deviation alone must say its own."""
    for name in (DEVIATION_UM, DEVIATION_MM):
        if MEASURED not in written and name not in keys.columns:
            bare = [table.header.headings[i] for _, unit, i in written.get(name, ()) if unit is None]
            if bare:
                fix = f"Say which: columns = {{ deviation_um = {_sources(bare)} }}, or deviation_mm"
                raise CmmUqError(f"nothing says the unit of {bare[0]!r}: µm or mm", where=table.start, fix=fix)
    lengths = {name: parts for name, parts in written.items() if name in (*BASES, MEASURED)}
    length, of_unit = table.lengths_unit(keys, lengths, reach_mm)
    values = {}
    for name, parts in written.items():
        sort = units.sort_of(name)
        usual = (
            None
            if not sort or sort[0] != LENGTH
            else {DEVIATION_UM: UNITS["um"], DEVIATION_MM: UNITS["mm"]}.get(name, length)
        )
        own = [(figures, unit or usual) for figures, unit, _ in parts]
        values[name] = np.column_stack(
            [units.converted(figures, unit, name) if unit else figures for figures, unit in own]
        )
    return values, of_unit


def _measured(
    table: ExportTable, values: Mapping[str, Floats], written: Mapping[str, Parts], base: Floats | None
) -> tuple[Floats, str]:
    """Measured lengths (n, k), and the column that they are from."""
    deviations = [
        (name, values[name] / (1000 if name == DEVIATION_UM else 1))
        for name in (DEVIATION_UM, DEVIATION_MM)
        if name in values
    ]
    if MEASURED not in values:
        name, deviation = deviations[0]
        return np.asarray(deviation if base is None else base[:, None] + deviation), name
    if base is not None:
        _check_near(table, values[MEASURED], base, written[MEASURED])
        for name, deviation in deviations:
            _check_deviation(table, values[MEASURED] - base[:, None], written, name, deviation)
    return values[MEASURED], MEASURED


def _run_is(table: ExportTable, written: Mapping[str, Sequence[tuple[Floats, WrittenUnit | None, int]]]) -> str:
    """Whether columns that are only called runs hold lengths or deviations: by their unit, else by their size."""
    parts = written[RUN]
    given = {unit.name for _, unit, _ in parts if unit}
    base = next((written[name][0][0] for name in BASES if name in written), None)
    if given and given <= {"um", "nm", "mil"}:
        return DEVIATION_UM
    values = np.column_stack([values for values, _, _ in parts])
    if base is not None:
        if np.nanmax(np.abs(values - base[:, None]) / np.abs(base[:, None])) < 0.01:
            return MEASURED
        if given and np.nanmax(np.abs(values)) < 0.002 * np.min(np.abs(base)):
            return DEVIATION_UM
    headings = [table.header.headings[i] for _, _, i in parts]
    fix = f"Say which: columns = {{ deviation_um = {_sources(headings)} }}, deviation_mm or length_mm"
    what = f"{', '.join(map(repr, headings[:3]))} may be lengths, or deviations in µm or mm"
    raise CmmUqError(what, where=table.start, fix=fix)


def _sources(headings: Sequence[str]) -> str:
    return f'"{headings[0]}"' if len(headings) == 1 else f"[{', '.join(map(_quoted, headings))}]"


def _quoted(heading: str) -> str:
    return f'"{heading}"'


def _check_near(table: ExportTable, measured: Floats, base: Floats, parts: Parts) -> None:
    """That measured lengths are near their references: else a column is another."""
    far = np.abs(measured - base[:, None]) > np.maximum(_FAR, _FAR_PART * np.abs(base))[:, None]
    if far.any():
        row, k = np.argwhere(far)[0]
        what = f"{measured[row, k]:.6g} mm is no measured length of {base[row]:.6g} mm"
        fix = "Name the columns by what they are: nominal_mm, reference_mm, length_mm, deviation_um"
        raise CmmUqError(what, where=table.place(parts[k][2], int(row)), fix=fix)


def _check_deviation(
    table: ExportTable, error: Floats, written: Mapping[str, Parts], name: str, deviation: Floats
) -> None:
    """That deviations beside lengths are measured minus reference, to the last printed digits, in mm or µm, either way."""

    def step(column: str) -> float:
        return float(10.0 ** -max(_decimals(cell) for _, _, i in written[column] for cell in table.cells[i]))

    least, last = step(MEASURED), step(name)
    least += sum(step(one) for one in BASES if one in written and step(one) < 1)  # whole millimetres are exact
    for factor in (1.0, 1000.0) if name == DEVIATION_UM else (1.0, 0.001):
        away = min(np.nanmax(np.abs(side * error - deviation * factor)) for side in (1.0, -1.0))
        if away <= 1.01 * (least + last * (factor if name == DEVIATION_MM else factor / 1000)):
            return
    heading = table.header.headings[written[name][0][2]]
    raise CmmUqError(
        f"{heading!r} is not measured minus reference: one of the columns is another",
        where=table.start,
        fix=f'Say which to take: columns = {{ deviation_um = "{heading}" }}, or length_mm',
    )


def _decimals(cell: Cell) -> int:
    """Digits after the decimal sign; of a stored number so many as a rounding leaves."""
    return 6 if not isinstance(cell, str) else len(re.split("[.,]", cell)[-1]) if re.search("[.,]", cell) else 0


def _of_names(table: ExportTable, base: Floats | None) -> tuple[list[str], list[int]] | None:
    """Lines and runs by names with two or three numbers: that which fixes the nominal length counts the lengths."""
    named = table.labels() if base is not None else None
    if named is None or base is None or (split := split_names(named)) is None:
        return None
    known, numbers = split
    runs = [k for k, one in enumerate(known) if one == "repeat"]
    fixes = [all(np.ptp(base[column == value]) == 0 for value in np.unique(column)) for column in numbers.T]
    lines = [k for k in range(len(known)) if k not in runs and not fixes[k]]
    if len(runs) != len(known) - 2 or len(lines) != 1:
        return None
    pattern = re.compile(r"[\W_]*(.*?\d+)" * (lines[0] + 1))
    return [pattern.match(name)[lines[0] + 1] for name in named], [int(row[runs[0]]) if runs else 1 for row in numbers]  # type: ignore[index]


def _tells_apart(cells: Sequence[Cell], *, again: bool) -> bool:
    """Whether a column holds texts of which some are the same, or names that lengths which are there ``again`` differ by."""
    texts = [cell for cell in cells if isinstance(cell, str) and cell and not is_number(cell)]
    return len(texts) == len(cells) and 1 < len({*texts}) < len(cells) + again


def _labels_and_runs(
    table: ExportTable, header: Header, sign: str, base: Floats | None, runs: int, keys: ImportKeys
) -> tuple[list[str], list[list[int]]]:
    """Name of the line of each row, and number of the run of each of its lengths."""
    of = header.columns
    if LINE not in of and "repeat" not in of and runs == 1 and (by_name := _of_names(table, base)):
        return by_name[0], [[run] for run in by_name[1]]
    labels = [table.sheet.name if table.sheet.spreadsheet else "1"] * len(table.rows)
    used = {i for own in of.values() for i in own} - {*of.get(NAME, ())}
    again = base is not None and "repeat" not in of and len(np.unique(base)) < len(base)
    texts = [
        i
        for i, cells in enumerate(table.cells)
        if i not in used and header.headings[i] and _tells_apart(cells, again=again)
    ]
    if LINE not in of and texts and labels[0] not in keys.lines:
        raise CmmUqError(
            "nothing says which lengths lie on one line",
            where=table.start,
            fix=f'Say by which column: columns = {{ line = "{header.headings[texts[0]]}" }}',
        )
    if LINE in of:
        cells = filled_down(table.cells[of[LINE][0]])
        if "" in cells:
            place = table.place(of[LINE][0], list(cells).index(""))
            raise CmmUqError("no line is named", where=place, fix="Complete the row")
        labels = list(map(text_of, cells))
    if runs > 1:
        if "repeat" in of:
            raise CmmUqError(
                f"{header.headings[of['repeat'][0]]!r} counts runs, and so do {runs} columns",
                where=table.start,
                fix="Name one of them alone: columns",
            )
        return labels, [[*range(1, runs + 1)] for _ in labels]
    if "repeat" in of:
        i = of["repeat"][0]
        return labels, [
            [int(one)] for one in values_of(filled_down(table.cells[i]), sign, lambda row: table.place(i, row))
        ]
    seen: Counter[tuple[str, float]] = Counter()
    numbers = []
    for row, label in enumerate(labels):  # in turn
        key = (label, 0.0 if base is None else float(base[row]))
        seen[key] += 1
        numbers.append([seen[key]])
    return labels, numbers


def placed(
    tables: Sequence[MeasuredLengths], keys: ImportKeys, where: str
) -> tuple[dict[str, Floats], list[Fact], list[int]]:
    """Columns of a recording, (2n,): both ends of every length, where the job says that its line lies."""
    wanted = list(dict.fromkeys(name for one in tables for name in one.names))
    starts = {name: place_of(keys.lines[name]) for name in wanted if name in keys.lines}
    if lacking := [name for name in wanted if name not in starts]:
        one, which = lacking[0], ", ".join(map(repr, lacking))
        lie = f"lines {which} lie" if len(lacking) > 1 else f"line {one!r} lies"
        raise CmmUqError(
            f"nothing says where {lie}, along which lengths were measured",
            where=where,
            fix=f'Say it, with its start in mm: lines = {{ "{one}" = "along X from 100,200,300" }}',
        )
    if unknown := [name for name in keys.lines if name not in starts]:
        raise CmmUqError(f"has no line {unknown[0]!r}", where=where, fix=suggestion(unknown[0], wanted))
    number: dict[tuple[str, float | None], int] = {}
    columns: dict[str, list[float]] = {name: [] for name in ("measurement", "point", "repeat", *COORDINATES, REFERENCE)}
    beside = [name for name in tables[0].beside if all(name in one.beside for one in tables)]
    columns |= {name: [] for name in beside}
    lines: list[int] = []
    for table in tables:
        for i, name in enumerate(table.names):
            reference = table.reference[i]
            start, direction = starts[name]
            measurement = number.setdefault((name, reference), len(number) + 1)
            for point, (xyz, base) in enumerate(
                ((start, 0.0), (start + table.measured[i] * direction, reference or 0.0)), 1
            ):
                row = (measurement, point, table.repeat[i], *xyz, base, *(table.beside[one][i] for one in beside))
                for column, value in zip(columns.values(), row, strict=True):
                    column.append(value)
                lines.append(table.lines[i])
    bare = [reference is None for table in tables for reference in table.reference]
    if all(bare):
        columns.pop(REFERENCE)
    elif any(bare):
        raise CmmUqError(
            "a length has no nominal length, and others have one",
            where=f"{where} line {lines[2 * bare.index(True)]}",
            fix="Give it for all, or read the sheets one by one: sheet",
        )
    told = semicolons(
        [say("{name}: {place}", name=Verbatim(name), place=Verbatim(keys.lines[name])) for name in wanted]
    )
    facts = [Fact("lines", say("Lines"), told)]
    return {name: np.array(values) for name, values in columns.items()}, facts, lines


def place_of(text: str) -> tuple[Floats, Floats]:
    """Start (3,) and direction (3,) of a line."""
    parts = LINE_PLACE.fullmatch(text.strip())
    if parts is None:
        raise CmmUqError(f"{text!r} says no place", where="lines", fix='Write "along X from 100,200,300"')
    figures = [float(figure.replace("−", "-")) for figure in parts.groups()[2:] if figure]
    start = np.array(figures[:3])
    if parts[2]:
        direction = np.zeros(3)
        direction["xyz".index(parts[2].lower())] = 1.0 if parts[1] in ("", "+") else -1.0
    else:
        direction = np.array(figures[3:]) - start
        if not direction.any():
            raise CmmUqError(f"{text!r} begins where it ends", where="lines", fix="Say two places of the line")
        direction /= np.linalg.norm(direction)
    return start, direction
