"""The file of a recording, whatever its format: the project's own is read as it is, any other is imported."""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from pathlib import PurePath

import numpy as np

from cmm_uq.base.errors import CmmUqError, suggestion
from cmm_uq.base.files.limits import TABLE_BYTES
from cmm_uq.base.messages import Verbatim, commas, names, say
from cmm_uq.base.points import Floats, Ints, Machine, Points
from cmm_uq.jobs.importing.columns import columns_of
from cmm_uq.jobs.importing.format import format_of
from cmm_uq.jobs.importing.header import POINTS, REFERENCES, Header, header_of, no_header
from cmm_uq.jobs.importing.keys import FileKeys, ImportKeys, length_named
from cmm_uq.jobs.importing.recording import REQUIRED, points_of, read_recording
from cmm_uq.jobs.importing.sheet import Fact, Recognition, Sheet

_UNIT_LINE = re.compile(
    r"\b(?:units?|einheit(?:en)?|ma(?:ß|ss)einheit|unit[ée]s?|unit[àa]|unidad(?:es)?)\s*[:=;]+\s*([^\s;]+)",
    re.IGNORECASE,
)


@dataclass(frozen=True, eq=False)
class ImportedTable:
    """A file, read: columns of a recording by name, each (n,), in the units of their names, and each point's line."""

    columns: dict[str, Floats]
    lines: Ints
    recognised: Recognition


def imported(content: bytes, where: str, keys: ImportKeys, *, reach_mm: float | None = None) -> ImportedTable:
    """A recording in any format that is known."""
    table = _read(content, where, keys, POINTS, reach_mm)
    headings, columns = table.recognised.columns, table.columns
    uncertainties = [name for name in columns if name.startswith("reference_u_") or name == "reference_U_um"]
    others = [name for name in uncertainties if headings[name] != name and name not in keys.columns]
    if not others or any(name.startswith("reference_") and name.endswith("_mm") for name in columns):
        return table
    # of the measured point, not of a certificate
    unused = commas(names([headings[name] for name in others]))
    recognised = replace(
        table.recognised, columns={name: heading for name, heading in headings.items() if name not in others},
        facts=(*table.recognised.facts, Fact("uncertainties_not_used", say("Uncertainties not used"), unused)),
    )  # fmt: skip
    return replace(
        table, columns={name: columns[name] for name in columns if name not in others}, recognised=recognised
    )


def imported_references(content: bytes, where: str, keys: FileKeys) -> ImportedTable:
    """Certified values in any format that is known: distances or places, by the number of their point."""
    every = ImportKeys.model_validate({name: getattr(keys, name) for name in FileKeys.model_fields})
    table = _read(content, where, every, REFERENCES, None)
    columns = {f"reference_{name}" if name in POINTS[0] else name: values for name, values in table.columns.items()}
    return replace(table, columns=columns)


def _read(
    content: bytes, where: str, keys: ImportKeys, wanted: Sequence[Sequence[str]], reach_mm: float | None
) -> ImportedTable:
    if len(content) > TABLE_BYTES.most:
        raise CmmUqError(f"is larger than the {TABLE_BYTES.most} {TABLE_BYTES.unit} that are read of such a file", where=where,
                         fix="Split it")  # fmt: skip
    form = format_of(content, where)
    sheet, header = _chosen(form.read(content, where, keys), keys, where, wanted)
    for row in sheet.rows[: header.row] if sheet.unit is None else ():  # ``Units: mm`` in a line before the table
        match = _UNIT_LINE.search(";".join(map(str, row)))
        if match and (unit := length_named(match[1].strip("[]().,;"))):
            sheet = replace(sheet, unit=unit.name)
            break
    columns = columns_of(sheet, header, keys, where, reach_mm=reach_mm, points=wanted is POINTS)
    named = (Fact("sheet", say("Sheet"), Verbatim(sheet.name)),) if sheet.name else ()
    recognised = Recognition(PurePath(where).name, form.name, form.title, (*named, *sheet.facts, *columns.facts),
                             columns.sources, len(columns.lines))  # fmt: skip
    return ImportedTable(columns.values, columns.lines, recognised)


def _chosen(
    sheets: Sequence[Sheet], keys: ImportKeys, where: str, wanted: Sequence[Sequence[str]]
) -> tuple[Sheet, Header]:
    """The sheet with the table, and its header."""
    if keys.sheet is not None:
        known = [sheet.name for sheet in sheets if sheet.name]
        sheets = [sheet for sheet in sheets if sheet.name.casefold() == keys.sheet.casefold()]
        if not sheets:
            fix = suggestion(keys.sheet, known) if known else "Leave sheet out: the file has only one table"
            raise CmmUqError(f"has no sheet {keys.sheet!r}", where=where, fix=fix)
    tables = [(sheet, header) for sheet in sheets if (header := header_of(sheet, keys, where, wanted)) is not None]
    if not tables:
        raise no_header(sheets, keys, where, wanted)
    if len(tables) > 1:
        listed = ", ".join(repr(sheet.name) for sheet, _ in tables)
        raise CmmUqError(f"holds {len(tables)} tables of points: {listed}", where=where,
                         fix=f'Say which: sheet = "{tables[0][0].name}"')  # fmt: skip
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
