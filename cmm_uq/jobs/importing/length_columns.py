"""Which columns of a table of lengths are calibrated, measured and deviations: what words leave open, arithmetic decides.

Lengths stand in columns that are alike row by row. A deviation beside them must be measured minus reference, either way round,
or the worst or the mean of several; what is a mean or a range of others is no run.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from cmm_uq.base.points import Floats
from cmm_uq.jobs.importing.blocks import Block, CutSheet, unit_of
from cmm_uq.jobs.importing.factors import hint
from cmm_uq.jobs.importing.format import UNITS, NotReadError
from cmm_uq.jobs.importing.header import plain_words, without_unit
from cmm_uq.jobs.importing.roles import (
    DEVIATION,
    MEASURED,
    NOMINAL,
    REFERENCE,
    SUMMARY,
    TARGET,
    FigureColumn,
    SheetReading,
    agrees,
    columns_in,
    down,
    factors,
    heading,
    known,
    like,
    mean_of,
    said,
    said_by,
    unit_beside,
)

_BASES = (REFERENCE, NOMINAL, TARGET)
_FAR = 1.0  # mm by which no measured length differs from its reference, where both are called so
_MANY = 3  # rows by which lengths without a reference are known for ones of an artefact
_COMPLETE = "Complete the row, or take it out"
_NAME = "Name the columns by what they are: nominal_mm, reference_mm, length_mm, deviation_um"


def lengths_in(grid: CutSheet, blocks: Sequence[Block], rows: Sequence[int]) -> SheetReading | None:
    """Lengths of rows below one head: ``None`` where there are none; what is left open is an error that asks."""
    for i, path in enumerate(blocks[0].paths):
        if {*"XYZ"} <= {grid.text(row, i) for row in rows} and hint(heading(path), lengths=True) != "line":
            return None  # coordinates of a report, one a row
    columns = columns_in(grid, blocks, rows)
    for one in columns:
        if one.role in _BASES and np.isfinite(one.values[0]) and not one.full:
            filled = down(one.values)
            one.values = filled if len(np.unique(filled)) < len(filled) and _evenly(one.values) else one.values
    groups: list[list[FigureColumn]] = []
    for one in filter(_sized, columns):
        fars = [_FAR if one.role and group[0].role else 0.04 for group in groups]
        fitting = [own for own, far in zip(groups, fars, strict=True) if like(own[0].values, one.values, far)]
        if fitting:
            fitting[0].append(one)
        else:
            groups.append([one])
    groups = [own for own in groups if len(own) > 1 or own[0].role in (*_BASES, MEASURED) or _is_length(own[0])]
    _refuse_far(grid, rows, groups)
    readings = [found for own in groups if (found := _lengths(grid, rows, columns, own)) is not None]
    return max(readings, key=lambda found: (found.checked, len(found.figures)), default=None)


def _sized(column: FigureColumn) -> bool:
    """Whether a column may hold lengths: not the count of something, nothing small, in a unit of lengths."""
    whole = column.role in _BASES or (column.role is None and _is_length(column) and not column.counts)
    fits = column.may_be_length and not column.minute
    large = np.nanmedian(np.abs(column.values)) >= 0.5 and (np.nanmin(column.values) > 0 or column.role == TARGET)
    return column.role not in (SUMMARY, DEVIATION) and (column.step < 1 or whole) and fits and bool(large)


def _refuse_far(grid: CutSheet, rows: Sequence[int], groups: Sequence[Sequence[FigureColumn]]) -> None:
    """Measured lengths that are near no reference are an error, not another table."""
    bases = [c for own in groups for c in own if c.role in (REFERENCE, NOMINAL)]
    lone = [c for own in groups for c in own if c.role == MEASURED and all(o.role not in _BASES for o in own)]
    for k, row in enumerate(rows if bases and lone else ()):
        base, length = bases[0].values[k], lone[0].values[k]
        if not np.isfinite(base):
            raise NotReadError("no value", where=grid.at(row, bases[0].i), fix=_COMPLETE)
        if not like(bases[0].values[k : k + 1], lone[0].values[k : k + 1], _FAR):
            what = f"{length:.6g} mm is no measured length of {base:.6g} mm"
            raise NotReadError(what, where=grid.at(row, lone[0].i), fix=_NAME)


def _is_length(column: FigureColumn) -> bool:
    return any(known(word, "length") for text in column.path for word in plain_words(without_unit(text)[0]))


def _evenly(values: Floats) -> bool:
    """Whether each figure stands in the first of as many rows."""
    starts = np.flatnonzero(np.isfinite(values))
    return len({*np.diff([*starts, len(values)]).tolist()}) == 1


def _base(
    group: Sequence[FigureColumn], small: Sequence[FigureColumn]
) -> tuple[FigureColumn | None, list[FigureColumn]] | None:
    """The reference among columns of one length each, and the measured ones, by deviations, else by words."""
    open_ = [c for c in group if c.role is None and not mean_of(c, [o for o in group if o.role == MEASURED])]
    named = [c for c in group if c.role in _BASES]
    measured = [c for c in group if c.role == MEASURED]
    pairs = [(d, m, f) for d in small if np.any(d.values) for m in (*measured, *open_) for f in factors(d, m)]
    scores = {c.i: sum(m is not c and agrees(d, m, c, f) for d, m, f in pairs) for c in (*named, *open_)}
    by_figures = [c for c in (*named, *open_) if scores[c.i] == max(scores.values()) > 0]
    by_words = [c for c in named if c.role == REFERENCE] or named
    fine = [c for c in open_ if c.step < 1]
    base = next((c for c in by_words if c in by_figures), None) or next(iter(by_figures), None)
    if base is None and by_words:
        if by_words[0].role != REFERENCE and measured and fine:
            return None  # which of both is calibrated nobody says
        base = by_words[0]
    elif base is None and measured and open_:
        base = fine[0] if len(fine) == 1 else open_[0] if not fine and len(open_) == 1 else None
        if base is None or (fine and not (_is_length(base) or len(open_) > 1)):
            return None
    elif base is None and len(group) == len(open_) == 1 and any(_deviates(c) for c in small):
        base = open_[0]
    elif base is None and open_ and len(group) > len(open_) + len(measured):
        return None
    rest = [c for c in group if c not in named and c is not base]
    rest = [c for c in rest if c.role == MEASURED or base is None or c.step < min(1, 20 * base.step)]
    rest = [c for c in rest if c.role == MEASURED] or rest
    return base, [c for c in rest if not mean_of(c, [o for o in rest if o is not c and o.role == c.role])] or rest


def _deviates(column: FigureColumn) -> bool:
    """Whether a column says that it holds deviations."""
    return column.role == DEVIATION or (column.role in (None, MEASURED) and column.minute)


def _lengths(
    grid: CutSheet, rows: Sequence[int], columns: Sequence[FigureColumn], group: Sequence[FigureColumn]
) -> SheetReading | None:
    most = np.nanmax(np.abs(group[0].values))
    small = [c for c in columns if c not in group and c.role != SUMMARY and c.may_be_length]
    small = [c for c in small if _deviates(c) or (not c.counts and np.nanmax(np.abs(c.values)) < max(0.01 * most, 0.2))]
    if (found := _base(group, small)) is None:
        return None
    base, source = found
    deviations, checked, factor = base is not None and not source, 0, 0.0
    if base is not None and not source:
        source = _deviations(grid, rows, [c for c in columns if c not in group], small, base)
    elif base is not None:
        checked, factor = _checked(grid, rows, small, source, base)
    if not deviations:
        checked += sum(mean_of(c, source, worst=True) for c in columns if c.role == SUMMARY)
        base = base or reference_in_head(grid, rows, source)
    named = {c.unit.name for c in source if c.unit} if deviations else set()
    if not source or len(named) > 1 or not _plain(columns, group, base, source, checked):
        return None
    units = [c.unit for c in (*(() if deviations else source), *([base] if base else [])) if c.unit and not c.minute]
    if not units and abs(factor - 1e-3) < 1e-12 and any(c.unit is not None and c.unit.name == "um" for c in small):
        units = [UNITS["mm"]]  # by which measured minus reference is the deviation in µm
    left = [c for c in group if c not in source and c is not base and c.role not in (*_BASES, SUMMARY)]
    if any(c.step < 1 and c.full and not mean_of(c, source, worst=True) for c in left):
        return None  # measured as well, for all that is known
    reading = SheetReading("lengths", units[0] if units else unit_beside(grid, rows), None, checked, deviations)
    reading.small = UNITS[named.pop()] if named else None
    reading.taken = {"reference_mm": [base] if base else [], ("deviation_um" if deviations else "length_mm"): source}
    reading.collect(grid, rows, columns)
    of_lines = any(
        key[0] == "column" and hint(key[1].partition(" ")[2], lengths=True) == "line" for key in reading.beside[0]
    )
    if base is None and len(rows) < _MANY and not of_lines:
        return None
    _fill(reading, grid, rows, base, source)
    return reading


def _fill(
    reading: SheetReading,
    grid: CutSheet,
    rows: Sequence[int],
    base: FigureColumn | None,
    source: Sequence[FigureColumn],
) -> None:
    """Observations of rows; an error where a length has no reference, and others have one."""
    for k, row in enumerate(rows):
        for c in source:
            reference = np.nan if base is None else float(base.values[k])
            if not np.isfinite(c.values[k]):
                reading.blank.append((row, c.i))
            elif base is None or np.isfinite(reference):
                reading.add(row, k, c, source, (reference, float(c.values[k])))
            elif not grid.other_quantity(row) and said([grid.text(row, 0)]) != SUMMARY:
                raise NotReadError("no value", where=grid.at(row, base.i), fix=_COMPLETE)


def _plain(
    columns: Sequence[FigureColumn],
    group: Sequence[FigureColumn],
    base: FigureColumn | None,
    source: Sequence[FigureColumn],
    checked: int,
) -> bool:
    """Whether words or arithmetic leave no doubt of what the columns are."""
    if not _side_by_side(source):
        return False
    if base is None:  # of one length alone, on many lines
        others = any(c.role in _BASES and not c.counts for c in columns)
        return not others and all(_is_length(c) or c.role == MEASURED for c in source)
    return bool(checked) or (_named(base) and (all(map(_named, source)) or (len(group) == 2 and base.role is not None)))


def _side_by_side(columns: Sequence[FigureColumn]) -> bool:
    """Whether columns are runs or lines side by side: their heads are alike but for numbers, or all name a line or a run."""
    for texts in zip(*(c.path for c in columns), strict=True):
        counted = len({re.sub(r"\d+", "0", text) for text in texts}) == 1
        if not counted and any(hint(text, lengths=True) not in ("line", "run") for text in texts):
            return False
    return True


def _deviations(
    grid: CutSheet,
    rows: Sequence[int],
    others: Sequence[FigureColumn],
    small: Sequence[FigureColumn],
    base: FigureColumn,
) -> list[FigureColumn]:
    """Columns of deviations, beside which no measured length stands."""
    source = [c for c in small if _deviates(c)]
    runs = [c for c in others if c.role == MEASURED]
    if not source and base.role and not all(c.counts for c in runs):
        what = f"{', '.join(repr(c.heading) for c in runs[:3])} may be lengths, or deviations in µm or mm"
        fix = said_by("deviation_um", runs, ", deviation_mm or length_mm")
        raise NotReadError(what, where=grid.at(rows[0]), fix=fix)
    return [c for c in source if not mean_of(c, [o for o in source if o is not c])] or source


def _checked(
    grid: CutSheet,
    rows: Sequence[int],
    small: Sequence[FigureColumn],
    source: Sequence[FigureColumn],
    base: FigureColumn,
) -> tuple[int, float]:
    """How many deviations are measured minus reference, and by which factor; an error where one is not."""
    pairs = [(d, m, f) for d in small if np.any(d.values) for m in source for f in factors(d, m)]
    hits = [f for d, m, f in pairs if agrees(d, m, base, f) or agrees(d, base, m, f)]
    if (wrong := denied(small, source, base)) is not None:
        what = f"{wrong.heading!r} is not measured minus reference: one of the columns is another"
        fix = said_by("deviation_um", [wrong], ", or length_mm")
        raise NotReadError(what, where=grid.at(rows[0]), fix=fix)
    return len(hits), hits[-1] if hits else 0.0


def denied(small: Sequence[FigureColumn], measured: Sequence[FigureColumn], base: FigureColumn) -> FigureColumn | None:
    """A column that is called a deviation and is none of the measured lengths, nor of their mean, or the worst of them."""
    for d in small:
        if d.role != DEVIATION or not np.any(d.values):
            continue
        for f in factors(d, measured[0]):
            step = base.step * (base.step < 1)
            errors = [replace(m, values=(m.values - base.values) / f, step=(m.step + step) / f) for m in measured]
            if mean_of(d, errors, worst=True) or any(agrees(d, m, base, f) or agrees(d, base, m, f) for m in measured):
                break
        else:
            return d
    return None


def reference_in_head(grid: CutSheet, rows: Sequence[int], measured: Sequence[FigureColumn]) -> FigureColumn | None:
    """The one calibrated length of a bar, where the rows above its measured lengths say it."""
    found = {}
    for row in range(min(rows)):
        for k, own in enumerate(grid.figures[row]):
            before = next((grid.text(row, j) for j in range(k - 1, -1, -1) if grid.text(row, j)), "")
            if own is not None and own[1] < 1 and said([before]) == REFERENCE:
                values = np.full(len(rows), own[0])
                if all(like(values, c.values) for c in measured):
                    found[own[0]] = FigureColumn(-1, [before], values, own[1], unit_of([before]), REFERENCE)
    return found.popitem()[1] if len(found) == 1 else None


def _named(column: FigureColumn) -> bool:
    """Whether words say what a column is."""
    return column.role is not None or _is_length(column) or any(hint(text, lengths=True) for text in column.path)
