"""Where tables of lengths stand in a file, and what their columns are: nominal lengths, runs, deviations, lines."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache

from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.importing import arrangement, header as head_words
from cmm_uq.jobs.importing.arrangement import BASES, FIGURES, text_of
from cmm_uq.jobs.importing.encodings import is_number
from cmm_uq.jobs.importing.format import Cell, ImportKeys, Sheet, sources_of
from cmm_uq.jobs.importing.header import NAME, Header

LINE, RUN, BARE, OTHER = "line", "run", "length", "summary"
REFERENCE, NOMINAL, MEASURED, DEVIATION_UM, DEVIATION_MM = (
    "reference_mm",
    "nominal_mm",
    "length_mm",
    "deviation_um",
    "deviation_mm",
)
COLUMNS = (*BASES, *FIGURES[:3], LINE, "repeat")
"""Columns of a table of lengths, which a job may name."""
_TEMPERATURES = ("temp_artefact_c", "temp_air_c", "temp_x_c", "temp_y_c", "temp_z_c")
BESIDE = ("time_s", *_TEMPERATURES, "pressure_hpa", "humidity_pct")
_ROLES = {
    OTHER: OTHER,
    "deviation": DEVIATION_UM,
    "reference": REFERENCE,
    "nominal": NOMINAL,
    "measured": MEASURED,
    RUN: RUN,
    LINE: LINE,
    BARE: BARE,
    "face": NAME,
}


@lru_cache(maxsize=4096)
def of_lengths(heading: str) -> head_words.Heading:
    """What a heading is in a table of lengths: each of its words must be known there."""
    if head_words.understood(heading).column in BESIDE:
        return head_words.understood(heading)
    text, unit, odd = head_words.without_unit(heading)
    named, indices = head_words.numbered_words(text)
    words = head_words.words_of("lengths")
    known = [role for role in _ROLES if not words[role].isdisjoint(named)]
    if (
        not named
        or len(indices) > 1
        or len(heading) > 120
        or not {*named} <= frozenset().union(*words.values())
        or not known
    ):
        return head_words.Heading(None, None, unit, odd)
    column, index = _ROLES[known[0]], indices[0] if indices else None
    if column == RUN and index is None:
        column = "repeat"
    return head_words.Heading(column, index, unit, odd)


def length_header(sheet: Sheet, keys: ImportKeys, where: str) -> Header | None:
    """The header of a sheet whose first row is its head; ``None`` where it has no lengths."""
    headings = [text_of(cell) for cell in sheet.rows[0]]
    named = {name: sources_of(given) for name, given in keys.columns.items()}
    found = head_words.assigned(headings, named, of_lengths)
    if found is None or (settled := _settled(found, named)) is None:
        return None
    runs = max(len(settled.get(name, ())) for name in FIGURES)
    told = {MEASURED if name == RUN and MEASURED not in settled else name: own for name, own in settled.items()}
    columns = head_words.unambiguous(told, headings, sheet.at(where, 0), runs)
    header = head_words.with_units(
        sheet, 0, headings, {name if name in settled else RUN: own for name, own in columns.items()}
    )
    return replace(header, units={i: unit for i, unit in header.units.items() if unit is not None})


def _settled(found: head_words.Assigned, named: Mapping[str, object]) -> head_words.Assigned | None:
    """Columns of a table of lengths among those that headings say; ``None`` where they are none."""
    found = {name: own for name, own in found.items() if name != OTHER and (name != NAME or len(own) == 1)}
    bare, figures = found.pop(BARE, []), [name for name in FIGURES if name in found]
    if len(found.get(LINE, ())) > 1 and not figures:  # a column a line
        lines = [one for one in found.pop(LINE) if one[0] is not None]
        found[RUN], figures = [(k, i) for k, (_, i) in enumerate(lines, 1)], [RUN]
    base = [name for name in BASES if name in found]
    if bare and figures and not base:
        found[NOMINAL], base = bare, [NOMINAL]
    elif bare and not figures and (base or LINE in found):
        found[MEASURED], figures = bare, [MEASURED]
    if not figures or not (base or (MEASURED in figures and LINE in found)):
        return None
    if REFERENCE in found and NOMINAL not in named:
        found.pop(NOMINAL, None)
    return _without_others(found, named)


def _without_others(found: head_words.Assigned, named: Mapping[str, object]) -> head_words.Assigned:
    """Without figures beside those that the job names, or that were measured, but for deviations that check these."""
    figures = [name for name in FIGURES if name in found]
    said = [name for name in figures if name in named]
    leading = said or [name for name in (MEASURED, RUN) if name in figures][:1] or figures[:1]
    count = max(len(found[name]) for name in leading)
    for name in figures:
        # one deviation beside several runs is the mean of them, or the worst
        check = name in (DEVIATION_UM, DEVIATION_MM) and not said and len(found[name]) == count
        if name not in leading and not check:
            found.pop(name)
    return found


def tables_of(sheets: Sequence[Sheet], keys: ImportKeys, where: str) -> list[tuple[Sheet, Header]]:
    """Every sheet with a table of lengths, begun by its head, with the header."""
    tables = []
    for sheet in sheets:
        if not {*keys.columns} <= {*COLUMNS, *BESIDE}:
            continue
        if (numbered := head_words.by_number(keys)) and (
            header := head_words.first_figures(sheet, numbered)
        ) is not None:
            tables.append(_cleaned(sheet, header, [], "", where))
        elif (
            found := arrangement.with_one_head(sheet, lambda one: length_header(one, keys, where), of_lengths)
        ) is not None:
            one, header, ahead = found
            heads = [row for row in sheet.rows[:ahead] if row]
            title = next(
                (" ".join(text_of(cell) for cell in row if cell != "") for row in reversed(heads) if _is_title(row)), ""
            )
            tables.append(_cleaned(one, header, heads, title, where))
    return tables


def _is_title(row: Sequence[Cell]) -> bool:
    """Whether a row names the line of those that follow: text alone, with a word for a line."""
    filled = [cell for cell in row if cell != ""]
    words = head_words.numbered_words(text_of(filled[0]))[0] if filled else ()
    return (
        len(filled) <= 2
        and isinstance(filled[0], str)
        and not is_number(filled[0])
        and any(word in head_words.words_of("lengths")[LINE] for word in words)
    )


def _refuse_wider(sheet: Sheet, i: int, width: int, figures: Sequence[int], where: str) -> None:
    """A row of figures with more cells than the head, of which nobody knows which stands below which heading."""
    if figures and any(cell != "" for cell in sheet.rows[i][width:]):
        what, fix = f"has {len(sheet.rows[i])} cells where the header has {width}", "Give every column a heading"
        raise CmmUqError(what, where=sheet.at(where, i), fix=f"{fix}, or mend the row")


def _cleaned(
    sheet: Sheet, header: Header, heads: Sequence[Sequence[Cell]], title: str, where: str
) -> tuple[Sheet, Header]:
    """Rows with a length alone, each with the name of its block, where blocks have one."""
    width = len(header.headings)
    figures = [i for name in FIGURES for i in header.columns.get(name, ())]
    base = [i for name in BASES for i in header.columns.get(name, ())]
    texts = [[*map(text_of, row)] for row in heads]
    above = next((text_of(row[0]) for row in reversed(heads) if len([cell for cell in row if cell != ""]) == 1), "")
    rows: list[list[Cell]] = []
    lines: list[int] = []
    left_out = list(sheet.left_out)
    before = ""
    for i in range(header.first, len(sheet.rows)):
        row = [*sheet.rows[i], *[""] * (width - len(sheet.rows[i]))]
        numeric = [k for k in figures if row[k] != "" and is_number(row[k])]
        _refuse_wider(sheet, i, width, numeric, where)
        if [text_of(cell) for cell in sheet.rows[i]] in texts and not _is_title(row):
            left_out[-1 if before and left_out else len(left_out) :] = [arrangement.shown(sheet, i, arrangement.AGAIN)]
            if before and not title:  # the first block is named as the others are
                rows = [[*row[:width], above] for row in rows]
            title = before or title
        elif arrangement.is_summary(row):
            left_out.append(arrangement.shown(sheet, i, arrangement.SUMMARY))
        elif numeric and all(is_number(row[k]) if row[k] != "" else rows for k in base):
            rows.append([*row[:width], title])
            lines.append(sheet.lines[i])
        elif numeric and not _is_title(row):
            raise CmmUqError(
                "has figures, and no length that they belong to",
                where=sheet.at(where, i),
                fix="Complete the row, or take it out",
            )
        else:
            if _is_title(row):
                title = " ".join(text_of(cell) for cell in row if cell != "")
                before = ""
                continue
            left_out.append(arrangement.shown(sheet, i, arrangement.REMARK))
            filled = [text_of(cell) for cell in row if cell != ""]
            before = filled[0] if len(filled) == 1 else ""
            continue
        before = ""
    for i in base:
        for row, cell in zip(rows, arrangement.filled_down([row[i] for row in rows], evenly=True), strict=True):
            row[i] = cell
    head: list[Cell] = [*header.headings, "Line" if title else ""]
    columns = dict(header.columns) | ({LINE: (width,)} if title and LINE not in header.columns else {})
    header = replace(header, row=0, first=1, headings=list(map(text_of, head)), columns=columns)
    return replace(sheet, rows=[head, *rows], lines=[sheet.lines[0], *lines], left_out=tuple(left_out)), header
