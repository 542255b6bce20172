"""Rows with figures that are no observations, as results and deviations: each is left out with its reason, or none is read."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence

import numpy as np

from cmm_uq.base.errors import CmmUqError, suggestion
from cmm_uq.jobs.importing import header
from cmm_uq.jobs.importing.blocks import CutSheet, heading
from cmm_uq.jobs.importing.columns import LARGEST_MACHINE_MM
from cmm_uq.jobs.importing.factors import LINE, RUN, hint, says_of, states_of
from cmm_uq.jobs.importing.format import UNITS, Cell, NotReadError, Sources, sources_of
from cmm_uq.jobs.importing.header import WORD, plain_words, words_of
from cmm_uq.jobs.importing.roles import SheetReading, said

_NUMBERED = 0.6  # of rows
_TIMES = re.compile(r"(?i)(?<![\w.,])(?:0?[.,]0*1\s?[µumn]?|10+\s?[µun])(?:m|in)(?![^\W_])")  # as 0.1 µm, 10 µm
_BRACKETS = re.compile(r"\([^)]*\)")
_SEVERAL = re.compile(r"(?<![^\s])[+-]?\d+[.,]\d+\s+[+-]?\d+[.,]\d+(?!\S)")


def below_deviations(grid: CutSheet, rows: Iterable[int]) -> set[int]:
    """Rows below a title that says that they hold deviations, with figures much smaller than those of the rows without it."""
    titles = {row: grid.block_of[row].titles[row].values() for row in rows if row in grid.block_of}
    counts = {row: sum(said(text) == "deviation" for text in own) for row, own in titles.items()}
    small = {row for row, count in counts.items() if count > min(counts.values())}
    sizes: dict[int, list[float]] = {0: [], 1: []}
    for row in counts:
        sizes[row in small] += [abs(f[0]) for f in grid.figures[row] if f is not None and f[1] < 1]
    return small if small and max(sizes[1], default=np.inf) < 0.1 * max(sizes[0], default=0.0) else set()


def below_angles(grid: CutSheet, rows: Iterable[int]) -> set[int]:
    """Rows below a title that says that they hold angles, where others have none."""
    counts = {row: sum(map(says_of, grid.block_of[row].titles[row].values())) for row in rows if row in grid.block_of}
    return {row for row, count in counts.items() if count > min(counts.values())}


def is_void(row: Sequence[Cell], *tables: str) -> bool:
    """Whether a cell of a row says that it is no measured point or length."""
    known = frozenset().union(*(words_of("rows")[table] for table in tables))
    texts = (cell for cell in row if isinstance(cell, str) and not (len(cell) == 1 and cell.isascii()))  # as O, for oui
    words = [*map(plain_words, texts)]
    if "feature" in tables:  # as ``Flatness 2``, unless lines are called so
        formed = {one for one in known - words_of("lengths")["line"] if len(one) > len("rad") or not one.isascii()}
        words += [own[:-1] for own in words if len(own) > 1 and own[-1].isdigit() and " ".join(own[:-1]) in formed]
    void = words_of("rows")["void"] - words_of("lengths")["run"] if "void" in tables else frozenset[str]()
    return any(" ".join(own) in known or (len(own) > 1 and own[0] in void) for own in words)  # as ``VOID - air alarm``


def layout(grid: CutSheet, rows: list[int]) -> list[int]:
    """Rows that have figures where most of them have."""
    fine = {k for row in rows for k, f in enumerate(grid.figures[row]) if f is not None and f[1] < 1}
    signs = {row: frozenset(k for k in fine if grid.figure(row, k)) for row in rows}
    many = [own for own in signs.values() if len(own) > 1]
    most = many if len(many) >= 0.4 * len(rows) else [*signs.values()]  # and not the second line of each
    common = Counter(k for own in most for k in own)
    needed = {k for k, n in common.items() if n > 0.6 * len(most)}
    near = [row for row in rows if len(signs[row] & needed) * 2 >= len(needed)]
    near = [row for row in near if needed <= signs[row] or not grid.other_quantity(row)]
    return [row for row in near if row not in _unnumbered(grid, near)]


def _unnumbered(grid: CutSheet, rows: Sequence[int]) -> set[int]:
    """Rows without a number in a column that numbers nearly all, and with a name of their own: results of those above."""
    found = set[int]()
    fine = (k for k in range(grid.width) if any((f := grid.figure(row, k)) and f[1] < 1 for row in rows))
    for k in range(next(fine, 0)):  # ahead of what was measured
        own = [row for row in rows if (f := grid.figure(row, k)) and f[1] >= 1]
        bare = {row for row in rows if not grid.text(row, k) and WORD.search(" ".join(map(str, grid.sheet.rows[row])))}
        if len(own) > _NUMBERED * len(rows) and len(own) + len(bare) == len(rows):
            found |= bare
    return found


def of_feature(grid: CutSheet, row: int) -> bool:
    """Whether the text right above a block says that it is of a plane, a line, or something else that has no place."""
    block = grid.block_of[row]
    words = [plain_words(grid.line(k)) for k in block.above[-1:]]
    return any(own and own[0] in words_of("rows")["feature"] and not any(map(str.isdigit, own)) for own in words)


def rows_left_out(readings: Sequence[SheetReading], grid: CutSheet) -> list[str] | None:
    """Rows with figures beside those that are read of a sheet; ``None`` where one of them may be measured."""
    rows, columns = {r for one in readings for r in one.rows}, {c.i for one in readings for c in one.source}
    taken = rows | {r for one in readings for r in one.others}
    summed = {r for one in readings for r in one.summaries}
    heads, last = {row for block in grid.blocks for row in block.head}, max(taken)
    texts = [row for row in range(min(taken), last) if grid.kinds[row] == "text"]
    texts = [row for row in texts if not (grid.names_line(row) or grid.place(row))]
    cells = (cell for row in (*rows, *texts) for cell in grid.sheet.rows[row])
    if any(isinstance(cell, str) and _SEVERAL.search(_BRACKETS.sub("", cell)) for cell in cells):
        return None  # cells that were not cut apart
    told = [header.shown(grid.sheet, row, header.SUMMARY) for row in sorted(grid.ends & taken - rows)]
    above = grid.sheet.rows[: min(taken)]  # of a table, and again above each further page of it
    again = {row for row in range(min(taken), len(grid.sheet.rows)) if grid.sheet.rows[row] in above}
    angles = below_angles(grid, grid.block_of)
    first, alike = min(grid.block_of[row].rows[0] if row in grid.block_of else row for row in taken), 0
    told += [header.shown(grid.sheet, row, "a head again") for row in sorted(heads & again) if row < last]
    for row in range(len(grid.sheet.rows)):
        if grid.kinds[row] == "text" and first <= row < last and row not in heads:
            own = [grid.figure(row, k) for k in columns]
            figured = None not in own and any(f is not None and f[1] < 1 for f in own)
            alike += figured
            if figured and (2 * alike >= len(rows) or not (grid.lettered(row) or grid.place(row))):
                return None  # whatever else stands in it, it may be measured
            text = next(filter(None, (grid.text(row, k) for k in range(len(grid.sheet.rows[row])))), "")
            if hint(text, lengths=True) not in (LINE, RUN):  # else the title of a line or a run
                told.append(header.shown(grid.sheet, row, header.REMARK))
        if row in taken or row in again or grid.kinds[row] != "figures":
            continue
        figures = [k for k, f in enumerate(grid.figures[row]) if f is not None and (f[1] < 1 or k in columns)]
        within = first <= row < last or 0 < grid.sheet.lines[row] - grid.sheet.lines[last] == row - last  # no gap
        within |= readings[0].kind == "points" and row > first and columns <= {*figures}
        known = row in summed or (readings[0].kind == "points" and of_feature(grid, row))
        if figures and within and not known and not _known(grid, row, figures, rows, columns):
            return None
        why = "angles" if row in angles else header.SUMMARY
        told += [header.shown(grid.sheet, row, why)] if figures and row > first else []
    blank = [cell for one in readings for cell in one.blank if cell[0] not in again]
    if any(map(str.isdigit, "".join(grid.text(row, i) for row, i in blank))):
        return None
    places = (grid.sheet.at("", row, i, heading(grid.path(row, i))) for row, i in blank)
    return told + [f"{place.removeprefix(': ').strip()}: nothing in the cell" for place in places]


def _known(grid: CutSheet, row: int, figures: Sequence[int], rows: Collection[int], columns: Collection[int]) -> bool:
    """Whether a row is void or a summary by its words or by arithmetic, or has none of the columns that are read."""
    cells, block = grid.sheet.rows[row], grid.block_of[row].rows
    if _of_results(grid, row, rows) or header.is_summary(cells) or is_void(cells, "void", "feature"):
        return True
    if row in below_deviations(grid, [row, *rows]) | below_angles(grid, [row, *rows]) or _of_preamble(
        grid, row, rows, columns
    ):
        return True
    if said(*(grid.text(row, k) for k in range(len(cells)) if k not in figures)) == "summary":
        return True
    alone = len(figures) < 2 or {*block}.isdisjoint(rows)
    if (alone and {*columns}.isdisjoint(figures)) or grid.other_quantity(row):
        return True
    whole = [f is not None and f[1] >= 1 for f in (grid.figure(row, k) for k in figures)]
    if len(figures) < 2 and all(whole) and not any((grid.figure(r, figures[0]) or (0, 1))[1] >= 1 for r in rows):
        return True  # a count of something, below figures with digits behind the point
    if alone and is_void([text for k in figures for text in grid.path(row, k)], "feature"):
        return True
    for k in {*figures} & {*columns}:
        above = [f[0] for r in block if r in rows and (f := grid.figure(r, k))]
        value, step = grid.figures[row][k] or (0.0, 1.0)
        sums = (np.mean(above), max(above), min(above), np.ptp(above), np.std(above, ddof=1)) if len(above) > 1 else ()
        if not any(abs(value - one) <= 1.05 * step for one in sums):
            return False
    return True


def _of_results(grid: CutSheet, row: int, rows: Collection[int]) -> bool:
    """Whether a row has words where all that are read have a figure, or a name and nothing where they have their number."""
    full = [k for k in range(grid.width) if all(grid.figure(own, k) for own in rows)]
    fine = [k for k in full if any((f := grid.figure(own, k)) and f[1] < 1 for own in rows)]
    numbers = [k for k in full if k < min(fine, default=0)]
    worded = [k for k in full if WORD.search(grid.text(row, k)) and not grid.figure(row, k)]
    if any(k in fine for k in worded) or (worded and not all(grid.figure(row, k) for k in fine)):
        return True
    return WORD.search(grid.line(row)) is not None and any(not grid.text(row, k) for k in numbers)


def _of_preamble(grid: CutSheet, row: int, rows: Collection[int], columns: Collection[int]) -> bool:
    """Whether a row of words and figures is of what stands above a table.

    None of its kind is read, and all that are have figures where it has its word, or numbers in their names.
    """
    first = next((k for k in range(grid.width) if grid.text(row, k)), 0)
    word = grid.figures[row][first] is None
    if word and first in columns and sum(f is not None for f in grid.figures[row]) < 2 <= len(columns):
        return True  # a result with its name, in place of one of several coordinates
    if not word or not {*grid.block_of[row].rows}.isdisjoint(rows):
        return False
    names = [(grid.text(r, first), grid.figure(r, first)) for r in rows]
    digits = [any(map(str.isdigit, name)) for name, _ in names]
    numbered = not any(map(str.isdigit, grid.text(row, first))) and all(digits)
    return numbered or all(f is not None for _, f in names)


_THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2}(?:,\d{3})+")


def refuse_either_sign(reading: SheetReading, grid: CutSheet) -> None:
    """Figures that may be thousands or thousandths, where none of the sheet tells, nor their size or that of a reference."""
    figured = [(row, i) for row, own in enumerate(grid.figures) for i, f in enumerate(own) if f]
    texts = [(place, text) for place in figured if "," in (text := grid.text(*place))]
    if grid.sheet.decimal is not None or not all(_THOUSANDS.fullmatch(text) for _, text in texts):
        return
    largest = 1e6 * np.nanmax(np.abs(reading.figures)) * (reading.unit or UNITS["mm"]).metres
    read = {c.i for own in reading.taken.values() for c in own}
    commas = {i for (_, i), _ in texts if i in read}
    if commas and largest <= LARGEST_MACHINE_MM and (commas == read or reading.kind != "lengths" or reading.deviations):
        place, first = texts[0]
        either = f"{first.replace(',', '')} or {first.replace(',', '.')}"
        raise CmmUqError(f"{first!r} can be {either}, and no number of the sheet tells", where=grid.at(*place),
                         fix='Say decimal = "," or decimal = "."')  # fmt: skip


def refuse_unmatched(grids: Sequence[CutSheet], keys: Mapping[str, Sources], where: str) -> None:
    """A column that the job names must be there."""
    matched = {one for grid in grids for one in grid.matched}
    for source in (str(one) for sources in keys.values() for one in sources_of(sources)):
        if source not in matched:
            headings = [heading(path) for path in grids[0].blocks[-1].paths]
            raise NotReadError(f"no column is {source!r}", where=where, fix=suggestion(source, headings))


def refuse_mixed(whole: SheetReading, parts: Sequence[tuple[SheetReading, CutSheet]], where: str) -> None:
    """A machine before and after it was adjusted is no single recording; figures that count parts of a unit are none."""
    for own in (label.values for label in whole.every_label):
        if len(states_of({*own})) > 1:
            named = ", ".join(map(repr, dict.fromkeys(own)))
            what = f"{named} are of a machine before and after it was adjusted: two recordings"
            raise NotReadError(what, where=where, fix="Name the columns of one of them, or export one of them")
    for text in (text for one, grid in parts for c in one.source for text in grid.path(one.rows[0], c.i)):
        if _TIMES.search(text):
            what = f"{text!r} counts parts or multiples of a unit"
            raise NotReadError(what, where=where, fix="Export it in µm, mm or inch")
