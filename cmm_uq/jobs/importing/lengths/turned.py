"""Tables whose rows are columns: references or targets stand in one row, what was measured of them in the rows below it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cmm_uq.base.values import dataclass, replace
from cmm_uq.jobs.importing.blocks import CutSheet
from cmm_uq.jobs.importing.factors import LINE, RUN, hint, way_of
from cmm_uq.jobs.importing.format import Cell, Sheet
from cmm_uq.jobs.importing.header import filled_down, text_of
from cmm_uq.jobs.importing.lengths.length_columns import BASES
from cmm_uq.jobs.importing.roles import like, said

_WIDEST = 300  # columns
_HEADS = 2  # rows of them
_MOST = 60  # such parts of a sheet; points whose coordinates differ look like them
_COARSE = 0.05  # mm: nominal lengths are printed no finer
_APART = 0.5  # of references or targets, in the unit of the file


@dataclass
class AcrossPart:
    """Of a sheet: rows of heads that stand over all columns or beside rows, the row of references and those below it."""

    over: list[int]
    beside: list[int]
    rows: list[int]
    columns: list[int]
    name: str = ""  # of the references, where it stands above them


def turned(grid: CutSheet) -> Sheet | None:
    """A sheet with each such part of it turned, and whatever else it holds as it is; ``None`` where there is none."""
    sheet, rows, lines, found, i = grid.sheet, list[Sequence[Cell]](), list[int](), 0, 0
    bases: AcrossPart | None = None
    while i < len(sheet.rows):
        part = _part(grid, i)
        if part is not None and all(_named_base(grid, row, part) for row in part.rows):
            bases, part = part, None  # of all parts below it
        elif part is not None and bases is not None and _of(grid, part, bases) and not _named_base(grid, i, part):
            part.rows = [*bases.rows, *part.rows]
        if part is None:
            rows.append(sheet.rows[i])
            lines.append(sheet.lines[i])
            i += 1
            continue
        del rows[len(rows) - len(part.over) :], lines[len(lines) - len(part.over) :]
        first, base, found = part.columns[0], part.rows[0], found + 1
        if found > _MOST:
            return None
        above = [grid.text(base, k) for k in range(first)]
        several = sum(map(bool, above)) > 1  # then each names what stands below it, and none the row
        if several and not part.name and RUN in {hint(text, lengths=True) for text in above}:
            fine = any((grid.figure(base, k) or (0, 1))[1] < _COARSE for k in part.columns)
            sensed = any(way_of(grid.text(row, k)) for row in part.rows[1:] for k in range(first))
            # figures among heads are what the lengths are called by
            part.name = "target" if sensed else "reference" if fine else "nominal"
        for k in range(first):  # what stands ahead of rows becomes the head of columns
            names = [text for row in (*part.over, *part.beside) if (text := grid.text(row, k))] or [above[k]] * several
            texts = [grid.text(row, k) for row in (*part.over, *part.rows)]
            texts[: len(part.over)] = [""] * len(part.over)
            below = [text_of(one) for one in filled_down(texts[len(part.over) + 1 :])]
            # what holds on ends where something new begins ahead of it
            anew = [any(grid.text(row, j) for j in range(k)) for row in part.rows[1:]]
            given = texts[len(part.over) + 1 :]
            texts[len(part.over) + 1 :] = [
                "" if new and not own else one for new, own, one in zip(anew, given, below, strict=True)
            ]
            texts[len(part.over)] = part.name if several or not any(above) else above[k]
            named = f"{names[0]} {{}}" if names else "({})"
            line = bool(names) and hint(names[0], lengths=True) == LINE and len({*texts[len(part.over) + 1 :]}) > 1
            plain = [bool(text) and said(text) is None and not hint(text, lengths=True) for text in texts]
            each = zip(texts, plain, strict=True)
            rows.append([named.format(text) if text.isdigit() or (line and bare) else text for text, bare in each])
        own = [sheet.rows[row] for row in (*part.over, *part.rows)]
        rows += [[cells[k] if k < len(cells) else "" for cells in own] for k in part.columns]
        # of a row further down, so that what stands above is a title, and no head
        lines += [sheet.lines[max(part.rows[1], i)]] * (len(rows) - len(lines))
        i = part.rows[-1] + 1
    return replace(sheet, rows=rows, lines=lines, spreadsheet=False) if found else None


def _named_base(grid: CutSheet, row: int, part: AcrossPart) -> bool:
    return said(*(grid.text(row, k) for k in range(part.columns[0]))) in BASES


def _of(grid: CutSheet, part: AcrossPart, bases: AcrossPart) -> bool:
    """Whether the first row of a part may be of references above it."""
    values = (grid.column([part.rows[0], bases.rows[-1]], k)[0] for k in bases.columns)
    return part.columns == bases.columns and like(*np.array([*values]).T)


def _part(grid: CutSheet, i: int) -> AcrossPart | None:
    """The part that begins with this row: its figures differ by far, and those below are alike, or much smaller."""
    columns = [k for k, f in enumerate(grid.figures[i]) if f is not None]
    values = np.array([f[0] for f in grid.figures[i] if f is not None])
    apart = np.abs(np.diff(values)).min(initial=np.inf)
    if not 2 < len(columns) <= _WIDEST or columns[0] == 0 or apart < _APART or not _side_by_side(grid, i, columns):
        return None
    part = AcrossPart([], [], [i], columns)
    for j in range(i + 1, min(len(grid.figures), i + _WIDEST)):
        figures = np.array([(grid.figure(j, k) or (np.nan,))[0] for k in columns])
        there = np.isfinite(figures)
        small = np.abs(figures[there]).max(initial=0) < 0.2 * apart
        if grid.kinds[j] == "rule":
            continue
        if not there.any() and len(part.rows) == 1 and len(part.beside) < _HEADS:
            part.beside.append(j)
        elif 2 * there.sum() > len(columns) and (small or like(figures, values)):
            part.rows.append(j)
        else:
            break
    for j in range(i - 1, max(-1, i - 1 - _HEADS), -1):
        over = [k for k in range(len(grid.sheet.rows[j])) if k >= columns[0] and grid.text(j, k)]
        if any(f is not None and f[1] < 1 for f in grid.figures[j]):
            break
        if over != columns:
            if grid.kinds[j] == "text" and over and not part.over:  # over some of them, as names of what is beside are
                part.beside += [j] if any(grid.text(j, k) for k in range(columns[0])) else []
                name = grid.text(j, over[0])
                part.name = name if len(over) == 1 and said(name) in BASES else ""
            break
        part.over.insert(0, j)
    return part if len(part.rows) > 1 else None


def _side_by_side(grid: CutSheet, i: int, columns: Sequence[int]) -> bool:
    """Whether nothing stands between columns of a row, nor in the row below it."""
    between = {*range(columns[0], columns[-1])} - {*columns}
    return not any(grid.text(row, k) for row in (i, min(i + 1, len(grid.figures) - 1)) for k in between)
