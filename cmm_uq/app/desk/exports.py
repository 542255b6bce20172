"""A dropped export as the worker reads it: its cells, what each column is taken for, and corrections as keys of an import."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from hashlib import sha256
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from cmm_uq.app.commands.jobs import exchange
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.limits import TABLE_BYTES, content_of
from cmm_uq.base.points import Machine
from cmm_uq.jobs.importing.answers import matching, path_of
from cmm_uq.jobs.importing.format import SAME_PLACE, Cell, ImportKeys, Recognition, Sheet, letters, sources_of
from cmm_uq.jobs.importing.header import NAME, Header, text_of, understood
from cmm_uq.jobs.importing.recording import example, imported, tables_in
from cmm_uq.jobs.importing.roles import said as role_said
from cmm_uq.jobs.recording.own import points_of

BEFORE, AFTER, WIDEST = 4, 8, 40  # rows ahead of the first figures and after it, and columns, that are shown
IGNORED, UNKNOWN = "ignored", "unknown"


def first_keys(path: str) -> dict[str, Any]:
    """Keys with which an export is first read: those that are remembered of its format."""
    return exchange.remembered_keys(Path(path), ImportKeys())[0].model_dump(exclude_defaults=True)


def remembered(path: str, keys: Mapping[str, Any]) -> str:
    """Keep the answers to an export for all with the same head, as ``cmm-uq import --save-as`` does; under which name."""
    said, content = keys_of(keys), content_of(Path(path), TABLE_BYTES, "Drop it again")
    head = imported(content, Path(path).name, said).recognised.head
    name = f"desk-{sha256(repr(head).encode()).hexdigest()[:8]}"
    own = path_of(name)
    if (known := matching(content, Path(path).name)) is not None and known[0] != own:
        raise CmmUqError(
            f"is remembered as {known[0].stem} already", where=Path(path).name, fix=f"Remove {known[0]} first"
        )
    own.unlink(missing_ok=True)
    exchange.remember(name, said, head)
    return name


def keys_of(data: Mapping[str, Any]) -> ImportKeys:
    try:
        return ImportKeys.model_validate(data)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        raise CmmUqError(
            first["msg"].removeprefix("Value error, "), where=".".join(map(str, first["loc"][:2]))
        ) from None


def read(path: str, keys: Mapping[str, Any]) -> dict[str, Any]:
    """The whole reading of an export, as a page shows it; what is wrong with it is part of it."""
    return _read(path, keys)[0]


def _read(path: str, keys: Mapping[str, Any]) -> tuple[dict[str, Any], Header | None]:
    """With the head of the first table, where there is one."""
    name, content, said = Path(path).name, content_of(Path(path), TABLE_BYTES, "Drop it again"), keys_of(keys)
    stated = [[str.__str__(text) for text in one.row] for one in exchange.offered(Path(path), said)]
    found: dict[str, Any] = {"name": name, "command": command(name, said), "problem": None, "lines": {}, "facts": []}
    found |= {"example": "", "amounts": "", "stated": stated, "doubtful": []}
    recognised: Recognition | None = None
    try:
        table = imported(content, name, said)
        points_of(table.columns, table.lines.tolist(), name, Machine())
        recognised, found["example"] = table.recognised, example(table)
        found["amounts"] = exchange.amounts(table)
        found["lines"] = {line: (*exchange.proposed(place), "") for line, place in table.places.items()}
    except CmmUqError as error:
        if (asked := exchange.lines_asked(error)) is not None:
            recognised, found["example"], found["lines"] = asked
        found["problem"] = [error.where or "", error.problem, error.fix or ""]
    found["lines"] = [(line, *own) for line, own in found["lines"].items()]
    try:
        sheets, tables = tables_in(content, name, said)
    except CmmUqError:  # it is told already why nothing is read
        return found | {"sheets": [], "columns": [], "rows": [], "more": 0, "understood": False}, None
    if recognised is not None:
        found["facts"] = [
            [str.__str__(label), str.__str__(text)]
            for label, text in recognised.rows
            if not str.__str__(label).startswith("Column ")
        ]
        found["doubtful"] = [
            f"{str.__str__(fact.label)}: {str.__str__(fact.value)}. Say where each lies, if they differ"
            for fact in recognised.facts
            if fact.key == SAME_PLACE
        ]
    found["sheets"] = [sheet.name for sheet in sheets if sheet.name]
    return found | _grid(sheets, tables), tables[0][1] if tables else None


def _grid(sheets: Sequence[Sheet], tables: Sequence[tuple[Sheet, Header]]) -> dict[str, Any]:
    """Headings, meanings and rows of the first table, or of the largest sheet where none is understood."""
    if tables:
        table, header = tables[0]
        raw = next(sheet for sheet in sheets if sheet.name == table.name)
        line = table.lines[header.first]
        # of a table that a format made of a report the head has the line of the first row
        first = header.first if raw.listed else raw.lines.index(line) if line in raw.lines else 0
        headings, taken = list(header.headings), meanings(header)
    else:
        raw = max(sheets, key=lambda sheet: len(sheet.rows))
        first, headings, taken = min(BEFORE, len(raw.rows)), [], {}
    rows = range(max(0, first - BEFORE), min(len(raw.rows), first + AFTER))
    width = min(WIDEST, max((len(raw.rows[i]) for i in rows), default=0))
    headings = [*headings, *[""] * width][:width]
    if not tables:
        headings = [f"column {letters(i) if raw.spreadsheet else i + 1}" for i in range(width)]
    columns = [[heading, taken.get(i) or _untaken(heading if tables else "?")] for i, heading in enumerate(headings)]
    cells = [
        [
            raw.lines[i],
            [*map(_shown, raw.rows[i][:width]), *[""] * (width - len(raw.rows[i]))],
            i < first and bool(tables),
        ]
        for i in rows
    ]
    return {
        "columns": columns,
        "rows": cells,
        "more": len(raw.rows) - rows.stop if rows else 0,
        "understood": bool(tables),
    }


def _shown(cell: Cell) -> str:
    return text_of(cell) if isinstance(cell, str) else f"{cell:.12g}"


def meanings(header: Header) -> dict[int, str]:
    """What each column of a table is taken for, by its index."""
    return {i: name for name, own in header.columns.items() for i in own}


def _untaken(heading: str) -> str:
    """Of a column that is not used, whether its heading is understood."""
    known = not heading or understood(heading.strip()).column or role_said(heading)
    return IGNORED if known else UNKNOWN


def corrected(path: str, keys: Mapping[str, Any], chosen: Mapping[str, str], said: Mapping[str, Any]) -> dict[str, Any]:
    """Keys after a form was sent: ``chosen`` meaning of each column by its index, ``said``: other keys, empty where none."""
    before = keys_of(keys)
    page, header = _read(path, keys)
    taken = meanings(header) if header is not None else {}
    shown = {i: _told(meaning) for i, (_, meaning) in enumerate(page["columns"])}
    now = {**taken, **shown, **{int(i): _told(meaning) for i, meaning in chosen.items()}}
    changed = [i for i in map(int, chosen) if now[i] != shown.get(i, "")]
    columns: dict[str, Any] = dict(before.columns)
    # what nobody touched is no answer: a table that is read by its rows shows less than it has
    for name in {one[i] for i in changed for one in (shown, now) if i in one} - {"", NAME}:
        own = [i for i in sorted(now) if now[i] == name]
        columns.pop(name, None)
        if own:
            sources = [_source(i, header) for i in own]
            columns[name] = sources if len(sources) > 1 else sources[0]
    lines = {name: place for name, place in said.get("lines", {}).items() if place}
    others = {name: value for name, value in said.items() if name not in ("lines", "plan") and value}
    if (points := others.get("points_per_measurement")) and points.isdecimal():
        others["points_per_measurement"] = int(points)
    after = keys_of({"columns": columns, "lines": lines, **others})
    if said.get("plan"):
        after = exchange.placed_by_plan(Path(path), after, Path(said["plan"]))
    return after.model_dump(exclude_defaults=True)


def _told(meaning: str) -> str:
    """The meaning of a column that stands in a list box; empty where it is not used."""
    return "" if meaning in (IGNORED, UNKNOWN) else meaning


def _source(i: int, header: Header | None) -> str | int:
    """A column by its heading, or by its number where no other has none, or the same."""
    heading = header.headings[i].strip() if header is not None and i < len(header.headings) else ""
    alone = header is not None and heading and not heading.isdecimal() and header.headings.count(heading) == 1
    return heading if alone else i + 1


def command(name: str, keys: ImportKeys) -> str:
    """The command that reads the same."""
    words = ["cmm-uq", "import", name]
    for column, sources in keys.columns.items():
        named = sources_of(sources)
        whole = all(isinstance(one, int) for one in named)
        each = [",".join(map(str, named))] if whole else map(str, named)
        words += [word for one in each for word in ("--column", f"{column}={one}")]
    for key in ("unit", "sheet", "decimal", "delimiter", "encoding", "points_per_measurement"):
        if (value := getattr(keys, key)) is not None:
            words += ["--key", f"{key}={value}"]
    words += [word for line, place in keys.lines.items() for word in ("--line", f"{line}={place}")]
    return shlex.join(words)
