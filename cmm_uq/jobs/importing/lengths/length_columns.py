"""Which columns of a table of lengths are calibrated, measured and deviations: figures decide, words what they leave open.

Lengths stand in columns that are alike row by row. A deviation beside them must be measured minus reference, either way round,
or the worst or the mean of several; what is a mean, a range or a limit is no run.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from cmm_uq.jobs.importing.blocks import Block, CutSheet, heading
from cmm_uq.jobs.importing.cells.figures import figure, unit_of
from cmm_uq.jobs.importing.factors import counts_ways, hint, numberless
from cmm_uq.jobs.importing.format import UNITS, NotReadError, WrittenUnit
from cmm_uq.jobs.importing.lengths import evidence
from cmm_uq.jobs.importing.lengths.evidence import Difference, differences, families, follows, without_derived
from cmm_uq.jobs.importing.roles import FigureColumn, SheetReading, columns_in, like, said, said_by

BASES = ("reference", "nominal", "target")
_FAR = 1.0  # mm by which no measured length differs from its reference, where both are called so
_LEAST = 2.0  # of a length without a reference, in the unit of the file
WIDEST = 100  # columns of a table of lengths
_WITHIN = re.compile(r"(?<![\d.,])\d+[.,]\d+(?![\d.,]*\d)")  # figures in texts
_AXIS = re.compile(r"(?<![A-Za-zÀ-ɏ])[XYZ](?![A-Za-zÀ-ɏ])")
_CODE = re.compile(r"[A-Z]{1,3}\W?\d{1,2}|[XYZ]{1,3}")  # of a run or a line, in a head
_LEAST_ROWS = 4  # in which no column is the mean of others by chance
_MANY = 3  # rows by which lengths without a reference are known for ones of an artefact

_NAME = "Name the columns by what they are: nominal_mm, reference_mm, length_mm, deviation_um"


def lengths_in(grid: CutSheet, blocks: Sequence[Block], rows: Sequence[int]) -> SheetReading | None:
    """Lengths of rows below one head: ``None`` where there are none; what is left open is an error that asks."""
    for i, path in enumerate(blocks[0].paths if not grid.placed(rows) else ()):
        texts = "".join(text if (text := grid.text(row, i)) in {*"XYZ"} else "." for row in rows)
        if "XYZ" in texts and hint(heading(path), lengths=True) != "line":
            return None  # coordinates of a report, one a row
    columns = columns_in(grid, blocks, rows)
    if len(columns) > WIDEST:
        return None
    _fill_down(columns)
    columns = _in_micrometres(columns)
    groups: list[list[FigureColumn]] = []
    for one in filter(_sized, columns):
        fars = [_FAR if one.role and group[0].role else 0.04 for group in groups]
        fitting = [own for own, far in zip(groups, fars, strict=True) if like(own[0].values, one.values, far)]
        if fitting:
            fitting[0].append(one)
        else:
            groups.append([one])
    several = [c for own in families(columns) for c in own if len(own) > 1 and c.role == "deviation"]
    lone = [own[0] for own in groups if own[0].role is None and len(own) == 1]
    if several and len(lone) == len(groups) == 1 and side_by_side(several):
        lone[0].role = "reference"  # of which each run has a deviation
    groups = [own for own in groups if len(own) > 1 or _alone(own[0], columns)]
    _refuse_far(grid, rows, groups)
    readings = [found for own in groups if (found := _lengths(grid, rows, columns, own)) is not None]
    return max(readings, key=lambda found: (found.checked, len(found.figures)), default=None)


def _fill_down(columns: Sequence[FigureColumn]) -> None:
    """References that stand once for the rows below: evenly, or where what was measured stays near them."""
    for one in columns:
        if one.full or not np.isfinite(one.values[0]) or one.role in ("measured", "deviation") or one.minute:
            continue
        filled, starts = one.downwards, [*np.flatnonzero(np.isfinite(one.values)), len(one.values)]
        evenly = one.role in BASES and len({*np.diff(starts).tolist()}) == 1 and len(np.unique(filled)) < len(filled)
        near = (
            o for o in columns if o.full and o is not one and o.role != "summary" and not o.counts and o.may_be_length
        )
        if evenly or any(np.nanmin(filled) > 0 and like(filled, o.values) for o in near):
            one.values = filled


def _in_micrometres(columns: Sequence[FigureColumn]) -> list[FigureColumn]:
    """Columns, with deviations relative to a length as what they are of the only one beside them."""
    bases = [c for c in columns if c.role in (*BASES, None) and c.may_be_length and not c.minute]
    bases = [c for c in bases if c.role] or [c for c in bases if c.is_length]
    if len(bases) != 1 or any(c.role == "deviation" and c.may_be_length for c in columns):
        return [*columns]
    metres = bases[0].values * (bases[0].unit or UNITS["mm"]).metres
    step = float(np.nanmax(metres))
    return [
        replace(c, values=c.values * metres, step=c.step * step, unit=UNITS["um"])
        if c.unit == UNITS["ppm"] and c.role != "summary"
        else c
        for c in columns
    ]


def _sized(column: FigureColumn) -> bool:
    """Whether a column may hold lengths: not the count of something, nothing small, in a unit of lengths."""
    if column.role == "deviation" or not column.may_be_length or column.minute:
        return False
    whole = (column.role in BASES and (column.unit is not None or not column.counts)) or (
        column.role is None and not column.counts
    )
    positive = np.nanmin(column.values) >= (0 if column.role == "target" else 1e-9)
    return bool((column.step < 1 or whole) and positive and np.nanmedian(np.abs(column.values)) >= 0.5)


def _alone(column: FigureColumn, columns: Sequence[FigureColumn]) -> bool:
    """Whether words call it a length, or a deviation beside it has one reference."""
    called = column.role in (*BASES, "measured") or column.is_length
    return called or any(c.role == "deviation" and evidence.steady(column, c) for c in columns)


def _refuse_far(grid: CutSheet, rows: Sequence[int], groups: Sequence[Sequence[FigureColumn]]) -> None:
    """Measured lengths that are near no reference are an error, not another table."""
    bases = [c for own in groups for c in own if c.role in ("reference", "nominal")]
    lone = [c for own in groups for c in own if c.role == "measured" and all(o.role not in BASES for o in own)]
    least = 0.2 * min((np.nanmin(c.values) for c in bases), default=0.0)
    lone = [c for c in lone if np.nanmax(np.abs(c.values)) > least]  # else they are deviations in columns of runs
    for k, row in enumerate(rows if bases and lone else ()):
        base, length = bases[0].values[k], lone[0].values[k]
        if not like(bases[0].values[k : k + 1], lone[0].values[k : k + 1], _FAR):
            what = f"{length:.6g} mm is no measured length of {base:.6g} mm"
            raise NotReadError(what, where=grid.at(row, lone[0].i), fix=_NAME)


def settled_base(group: Sequence[FigureColumn], pairs: Sequence[Difference]) -> FigureColumn | None:
    """The column from which others differ by deviations beside them: it comes again, else by words, else by their sign."""
    if stated := next((c for c in group if c.stated and c.role in BASES), None):
        return stated
    of: dict[int, set[int]] = {c.i: set() for c in group}
    for _, a, b in pairs:
        turned = not evidence.scatters(a, b) and _rank(a) < _rank(b) + evidence.scatters(b, a)
        if b.stated or (turned and not a.stated):
            a, b = b, a
        of[b.i] |= set() if b.stated else {a.i}
    most = max(map(len, of.values()), default=0)
    return min((c for c in group if len(of[c.i]) == most > 0), key=lambda c: (_rank(c), c.step), default=None)


def _rank(column: FigureColumn) -> int:
    """How little words call a column a reference."""
    return 3 if column.role == "measured" else (*BASES, None).index(column.role) if column.role in BASES else 2


def _base(
    group: Sequence[FigureColumn], small: Sequence[FigureColumn], where: str
) -> tuple[FigureColumn | None, list[FigureColumn]] | None:
    """The reference among columns of one length each, and the measured ones; ``None`` where nobody says which is which."""
    pairs = differences(group, small)
    base = settled_base(group, pairs)
    for d, a, b in pairs:
        if a is base and a.role == b.role not in BASES:
            what = f"{a.heading!r} comes again, as a reference does, and {d.heading!r} is what it is less {b.heading!r}"
            raise NotReadError(what, where=where, fix=said_by("reference_mm", [b], ", or the other"))
    group = [c for c in group if c.role != "summary" or c is base]  # figures know better than words which is none
    named = [c for c in group if c.role in BASES]
    measured = [c for c in group if c.role == "measured"]
    open_ = without_derived([c for c in group if c.role is None])
    again = [c for c in (*named, *open_) if any(evidence.scatters(o, c) for o in group)]
    fine = [c for c in again if not c.round]
    base = base or min((c for c in named if c.role == "reference"), key=lambda c: c.round, default=None)
    if base is None and len(fine) == 1:
        base = fine[0]
    elif base is None and named and measured and any(c.step < 1 for c in open_):
        return None  # which of both is calibrated nobody says
    base = base or next(iter((*named, *(again if not fine else ()))), None)
    alone = base is None and len(group) == len(open_) == 1
    if alone and any(c.deviates and not evidence.steady(group[0], c) for c in small):
        base = open_[0]
    elif base is None and open_ and len(group) > len(open_):
        return None
    finer = [c for c in group if base is not None and not base.stated and c.step < base.step and follows(c, base)]
    others = [c for c in group if c is not base and c not in named and c not in finer]
    if base is not None and len(finer) == 1 and others and all(evidence.scatters(c, base) for c in others):
        base = finer[0]  # the same wherever it comes again, as nothing that was measured is
    rest = [c for c in group if c is not base and (c not in named or (base is not None and evidence.scatters(c, base)))]
    rest = [c for c in rest if c.role == "measured" or base is None or c.step < min(1, 20 * base.step)]
    rest = [c for c in rest if c.role == "measured"] or [c for c in rest if base is None or not follows(c, base)]
    own = [c for c in rest if base and any({a.i, b.i} == {c.i, base.i} for _, a, b in pairs)]
    rest = own if len(own) == 1 and not side_by_side(rest) else rest  # what is not corrected has no deviation
    return base, without_derived(rest) or rest


def _call_reference(group: Sequence[FigureColumn], columns: Sequence[FigureColumn], where: str) -> None:
    """Of ``Nominal``, ``Actual``, ``Run 1`` and on the second is calibrated, where the mean error says so; else it asks."""
    runs = max(families(group), key=len)
    lone = [c for c in group if c not in runs and c.role == "measured" and not c.sums_up(runs, worst=True)]
    if len(runs) < len("12") or len(lone) != 1 or lone[0].stated or any(c.role == "reference" for c in group):
        return
    nominal = [c for c in group if c.role in BASES]
    errors = [c for c in columns if c not in group and c.role in ("summary", "deviation")]
    of = [c for c in (*lone, *nominal) if any(_stands(d, runs, c, f) for d in errors for f in d.factors(c))]
    if side_by_side(runs) and of and of[0] is lone[0]:  # printed finer than what is nominal
        lone[0].role = "reference"
    elif side_by_side(runs) and nominal and not of and not any(follows(lone[0], c) for c in nominal):
        what = f"{lone[0].heading!r} beside {runs[0].heading!r} may be calibrated, or measured"
        raise NotReadError(what, where=where, fix=said_by("reference_mm", lone, ", or leave it out"))


def _lengths(
    grid: CutSheet, rows: Sequence[int], columns: Sequence[FigureColumn], group: Sequence[FigureColumn]
) -> SheetReading | None:
    most = np.nanmax(np.abs(group[0].values))
    small = [c for c in columns if c not in group and c.role != "summary" and c.may_be_length]
    least = max(0.01 * most, 0.2)
    little = [c for c in small if not c.counts and (np.nanmax(np.abs(c.values)) < least or np.nanmin(c.values) < 0)]
    small = [c for c in small if c.deviates or c in little]
    _call_reference(group, columns, grid.at(rows[0]))
    if (found := _base(group, small, grid.at(rows[0]))) is None:
        return None
    base, source = found
    alike = next((own for own in families(columns) if base in own and base.role in BASES), []) if base else []
    if base and sum(not like(base.values, c.values) for c in alike) > 1:
        return None  # targets side by side, of which each has a column
    deviations, checked, factor = base is not None and not source, 0, 0.0
    if base is not None and not source:
        source = _deviations(grid, rows, [c for c in columns if c not in group], small, base)
        checked = int(bool(source) and source == summed_up([c for c in columns if c not in group]))
    elif base is not None:
        checked, factor = _checked(grid, rows, small, source, base)
    if not deviations:
        checked += sum(c.sums_up(source, worst=True) for c in columns if c.role == "summary")
        whole = source if len(source) == 1 else [c for c in group if c not in source and c.sums_up(source)]
        single = (
            [evidence.steady(m, c) for m in whole for c in columns if c in small or c.minute] if base is None else []
        )
        checked += sum(map(bool, single))
        known = (one for one in single if one is not None and not evidence.of_means(source[0], one))
        base = base or _reference_in_head(grid, rows, source) or next(known, None)
    named = {c.unit.name for c in source if c.unit} if deviations else set()
    source = source if side_by_side(source) or (deviations and checked) else counted_heads(source)
    if not source or len(named) > 1 or not _plain(columns, group, base, source, checked):
        return None
    units = [c.unit for c in (*(() if deviations else source), *([base] if base else [])) if c.unit and not c.minute]
    units = units or [u for c in small if c.unit and (u := _unit_by(c.unit, factor)) is not None]
    left = [c for c in group if c not in source and c is not base and c.role not in (*BASES, "summary")]
    left = [c for c in without_derived([*source, *left]) if c in left and not (base and follows(c, base))]
    if any(c.step < 1 and c.full and not (checked and c.role == "measured" and len(source) == 1) for c in left):
        return None  # measured as well, for all that is known
    reading = SheetReading("lengths", units[0] if units else grid.unit_beside(rows), None, checked, deviations)
    reading.small = UNITS[named.pop()] if named else None
    reading.taken = {"reference_mm": [base] if base else [], ("deviation_um" if deviations else "length_mm"): source}
    reading.collect(grid, rows, columns)
    if base is None and len(rows) < _MANY and not reading.on_lines:
        return None
    return _filled(reading, grid, rows)


def _filled(reading: SheetReading, grid: CutSheet, rows: Sequence[int]) -> SheetReading:
    """With the observations of rows; an error where a length has no reference, and others have one."""
    base, source = next(iter(reading.taken["reference_mm"]), None), reading.source
    for k, row in enumerate(rows):
        reference = np.nan if base is None else float(base.values[k])
        for c in source:
            if not np.isfinite(c.values[k]):
                reading.blank.append((row, c.i))
            elif base is None or np.isfinite(reference):
                reading.add(row, k, c, source, (reference, float(c.values[k])))
            elif not grid.other_quantity(row) and said(grid.text(row, 0)) != "summary":
                raise grid.no_value(row, base.i)
    return reading


def _plain(
    columns: Sequence[FigureColumn], group: Sequence[FigureColumn], base: FigureColumn | None,
    source: Sequence[FigureColumn], checked: int,
) -> bool:  # fmt: skip
    """Whether words or arithmetic leave no doubt of what the columns are."""
    if base is None:  # of one length alone, on many lines
        others = any(c.role in BASES and not c.counts for c in columns)
        near = bool(np.nanmedian(source[0].values) >= _LEAST) and all(like(source[0].values, c.values) for c in source)
        return near and not others and all(c.is_length or c.role == "measured" for c in source)
    lone = [c for c in group if c is not base and c.role not in BASES]
    every = all(c.named for c in source) or (len(lone) == 1 and base.role is not None)
    every = every or (len(source) > 1 and all(c.minute for c in source) and side_by_side(source))
    # columns that are numbered, near a reference and other wherever it comes again, as no calibration is
    other = len(source) > 1 and side_by_side(source) and all(evidence.scatters(c, base) for c in source)
    return bool(checked) or other or (base.named and every)


def side_by_side(columns: Sequence[FigureColumn]) -> bool:
    """Whether columns are runs or lines side by side: their heads are alike but for numbers, or name lines or runs.

    What else stands in a head must be the same for each of those.
    """
    levels = [*zip(*(c.path for c in columns), strict=True)]
    counting = [len({_AXIS.sub("0", numberless(text)) for text in texts}) == 1 and _from_one(texts) for texts in levels]
    counting = [known or counts_ways(texts) for known, texts in zip(counting, levels, strict=True)]
    called = [all(hint(text, lengths=True) in ("line", "run") for text in texts) for texts in levels]
    known = [own for own, *known in zip(levels, counting, called, strict=True) if any(known)]
    each = [*zip(*known, strict=True)] if known else [()] * len(columns)
    alike = all(len({*zip(each, own, strict=True)}) == len({*each}) for own in levels) and (bool(known) or not levels)
    coded = [{*texts} for texts in levels if len({*texts}) > 1]  # X, Y, Z, D1, D2 or H1, R1, H2, R2
    return alike or (len(coded) == 1 and len(coded[0]) == len(columns) and all(map(_CODE.fullmatch, coded[0])))


def _from_one(texts: Sequence[str]) -> bool:
    """Whether texts are no bare numbers, or such from 1 on: others number all columns of a table."""
    numbers = {int(text) for text in texts if text.isdecimal()}
    return numbers <= {*range(1, len(numbers) + 1)}


def summed_up(columns: Sequence[FigureColumn]) -> list[FigureColumn]:
    """Columns side by side of which a mean or a range follows, whatever their heads are."""
    fine = [c for c in columns if c.full and c.step < 1 and c.may_be_length]
    for size in range(len(fine) - 1, 1, -1) if len(fine) and len(fine[0].values) >= _LEAST_ROWS else ():
        for k in range(len(fine) - size):
            own, after = fine[k : k + size], fine[k + size]
            beside = own[-1].i - own[0].i == size - 1 and after.sums_up(own)
            if beside and not any(o.sums_up(own[:j]) for j, o in enumerate(own) if j > 1):
                return own
    return []


def counted_heads(columns: Sequence[FigureColumn]) -> list[FigureColumn]:
    """Those of columns whose heads count them, as ``Run 1`` and ``Run 2``; none of the others, which nobody explains."""
    several = [c for own in families(columns) if len(own) > 1 for c in own]
    return several if side_by_side(several) else []


def _deviations(
    grid: CutSheet, rows: Sequence[int], others: Sequence[FigureColumn], small: Sequence[FigureColumn], base: FigureColumn
) -> list[FigureColumn]:  # fmt: skip
    """Columns of deviations, beside which no measured length stands."""
    free = [c for c in small if not follows(c, base)]
    parted = [c for c in free if c.step < 1 or np.nanmin(c.values) < 0]  # which no count of something is
    source = [c for c in free if c.deviates] or [c for c in parted if c.role == "measured"]
    runs = [c for c in others if c.role == "measured"]
    if not source and base.role and not all(c.counts for c in runs):
        what = f"{', '.join(repr(c.heading) for c in runs[:3])} may be lengths, or deviations in µm or mm"
        fix = said_by("deviation_um", runs, ", deviation_mm or length_mm")
        raise NotReadError(what, where=grid.at(rows[0]), fix=fix)
    source = summed_up(others) or source
    source = source or ((parted if side_by_side(parted) else counted_heads(parted)) if base.role else [])
    source = without_derived(source) or source
    alike = [c for c in parted if c.role is None and c not in source and of_one_sort(c, source)]
    alike = [c for c in without_derived([*source, *alike]) if c in alike]
    if alike:  # measured as well, for all that is known: H1, R1, H2, R2 are, there and back
        each = sorted([*source, *alike], key=lambda c: c.i)
        source = each if side_by_side(each) else []
    once = len(np.unique(base.values)) == len(base.values)
    return [] if once and len(source) == 1 and len(free) < len(small) and base.round else source  # as certificates are


def of_one_sort(column: FigureColumn, source: Sequence[FigureColumn]) -> bool:
    """Whether nothing but words tells a column from one that is read: its unit and its last digit are the same."""
    return any((column.unit, column.step, column.full) == (c.unit, c.step, c.full) for c in source)


def _unit_by(small: WrittenUnit, factor: float) -> WrittenUnit | None:
    """The unit of lengths in which measured minus reference is ``factor`` times the deviation in its unit."""
    every = (UNITS[name] for name in ("mm", "inch"))
    return next((unit for unit in every if abs(small.metres / unit.metres / (factor or 1e9) - 1) < 1e-6), None)


def _checked(
    grid: CutSheet, rows: Sequence[int], small: Sequence[FigureColumn], source: Sequence[FigureColumn], base: FigureColumn
) -> tuple[int, float]:  # fmt: skip
    """How many deviations are measured minus reference, and by which factor; an error where one is not."""
    hits: list[float] = []
    for d in (one for one in small if np.any(one.values)):
        own = [f for f in d.factors(source[0]) if _stands(d, source, base, f)]
        if d.role == "deviation" and not own and not (follows(d, base) and d.full):  # as what is permitted does
            what = f"{d.heading!r} is not measured minus reference: one of the columns is another"
            raise NotReadError(what, where=grid.at(rows[0]), fix=said_by("deviation_um", [d], ", or length_mm"))
        hits += own
    return len(hits), hits[-1] if hits else 0.0


def _stands(d: FigureColumn, measured: Sequence[FigureColumn], base: FigureColumn, f: float) -> bool:
    """Whether a deviation is that of measured lengths, either way round, or of their mean, or of the worst of them."""
    step = base.step * (base.step < 1)
    errors = [replace(m, values=(m.values - base.values) / f, step=(m.step + step) / f) for m in measured]
    return d.sums_up(errors, worst=True) or any(d.agrees(m, base, f) or d.agrees(base, m, f) for m in measured)


def _reference_in_head(grid: CutSheet, rows: Sequence[int], measured: Sequence[FigureColumn]) -> FigureColumn | None:
    """The one calibrated length of a bar, where the rows above its measured lengths say it."""
    found = {}
    for row in range(min(rows)):
        cells = [(grid.text(row, k), own) for k, own in enumerate(grid.figures[row]) if grid.text(row, k)]
        within = [(text[: m.start()], figure(m[0], grid.sign)) for text, _ in cells for m in _WITHIN.finditer(text)]
        beside = [(before, own) for (before, _), (_, own) in pairwise(cells)]
        for before, own in (*beside, *within):
            if own is not None and own[1] < 1 and said(before) == "reference":
                values = np.full(len(rows), own[0])
                if all(like(values, c.values) for c in measured):
                    found[own[0]] = FigureColumn(-1, [before], values, own[1], unit_of([before]), "reference")
    return found.popitem()[1] if len(found) == 1 else None
