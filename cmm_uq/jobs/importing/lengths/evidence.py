"""What figures say of columns side by side, whatever their heads are called.

A deviation is measured minus reference to the printed digits; a reference comes again where what was measured scatters; means,
ranges and extremes follow from others, and limits from the reference.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import pairwise, permutations

import numpy as np

from cmm_uq.jobs.importing.blocks import CutSheet
from cmm_uq.jobs.importing.factors import numberless, way_of
from cmm_uq.jobs.importing.format import NotReadError
from cmm_uq.jobs.importing.header import plain_words, understood, words_of
from cmm_uq.jobs.importing.roles import FigureColumn, SheetReading, columns_in, each, like, said

_PART = 4  # of the figures of a turned sheet, the least that is read
_MANY = 12  # rows in which no run is the largest, or the mean, of others by chance
_UNCERTAIN = ("reference_u_um", "reference_U_um")
_LEAST = 4  # rows by which a column is known to follow from another


Difference = tuple[FigureColumn, FigureColumn, FigureColumn]
"""A deviation, what was measured and what it is less of, to the printed digits in all rows."""


def differences(group: Sequence[FigureColumn], small: Sequence[FigureColumn]) -> list[Difference]:
    """Columns of ``group`` whose differences stand in ``small`` ones, and are more than their rounding."""
    found = []
    for d in small:
        if not np.any(d.values) or not np.isfinite(d.values).any():
            continue
        at = int(np.nanargmax(np.abs(d.values)))  # the row in which the fewest pairs fit by chance
        for m, b in permutations((c for c in group if c is not d), 2):
            apart = m.values[at] - b.values[at]
            for f in d.factors(m):
                own, slack = d.values[at] * f, d.slack(m, b, f)
                if abs(apart - own) <= slack < abs(own) and d.agrees(m, b, f):
                    found.append((d, m, b))
    return found


def scatters(measured: FigureColumn, base: FigureColumn) -> bool:
    """Whether one column comes again in many rows, and the other does not."""
    both = np.isfinite(measured.values) & np.isfinite(base.values)
    again, other = (len(np.unique(one.values[both])) for one in (base, measured))
    return bool(again * 2 <= both.sum() and other >= again + max(2, (both.sum() - again) // 4))


def steady(measured: FigureColumn, deviation: FigureColumn) -> FigureColumn | None:
    """The references, of several rows each, less which what was measured is the deviation beside it; ``None`` of others."""
    for f in deviation.factors(measured):
        own, slack = measured.values - deviation.values * f, deviation.slack(measured, measured, f)
        if len(own) < _LEAST or not np.isfinite(own).all() or np.ptp(deviation.values * f) <= 4 * slack:
            continue
        order = np.argsort(own)
        each = np.split(order, 1 + np.flatnonzero(np.diff(own[order]) > 4 * slack))
        if 2 * len(each) <= len(own) and all(np.ptp(own[rows]) <= 2 * slack for rows in each):
            values = np.empty(len(own))
            for rows in each:
                values[rows] = round(float(np.median(own[rows])), round(-np.log10(measured.step)))
            path = [f"{measured.heading} − {deviation.heading}"]
            return replace(measured, i=-1, path=path, values=values, role="reference")
    return None


def of_means(measured: FigureColumn, reference: FigureColumn) -> bool:
    """Whether references are but the means of what was measured of each, from which deviations may be taken."""
    each = [(value, measured.values[reference.values == value].mean()) for value in np.unique(reference.values)]
    return all(abs(value - mean) <= 1.05 * reference.step for value, mean in each)


def follows(column: FigureColumn, base: FigureColumn) -> bool:
    """Whether figures say nothing beside the reference: the same wherever it is the same, or a straight line of it."""
    both = np.isfinite(column.values) & np.isfinite(base.values)
    own, (of, which) = column.values[both], np.unique(base.values[both], return_inverse=True)
    if 4 * len(of) <= 3 * len(own):
        first = np.full(len(of), np.nan)
        first[which] = own
        return bool(np.abs(own - first[which]).max(initial=0.0) <= 1e-9)
    if len(own) < _LEAST or own.min() < 0 or len(of) < 3:
        return False
    line = np.polyval(np.polyfit(base.values[both], own, 1), base.values[both])
    return bool(np.abs(own - line).max() <= 0.55 * column.step)


def families(columns: Sequence[FigureColumn]) -> list[list[FigureColumn]]:
    """Columns whose heads are alike but for their number, together."""
    alike: dict[str, list[FigureColumn]] = {}
    for c in columns:
        alike.setdefault(numberless(c.heading), []).append(c)
    return [*alike.values()]


def without_derived(columns: Sequence[FigureColumn]) -> list[FigureColumn]:
    """Columns that are no mean, range, deviation or extreme of others."""
    left = [*columns]
    # of few rows one may be the largest by chance
    several = {c.i for own in families(columns) if len(own) > 1 for c in own}
    for c in columns:
        if c.i in several and c.role != "summary" and len(c.values) < _MANY:
            continue
        others = [o for o in left if o is not c]
        if any(c.sums_up(own, worst=True) for own in sets_of(others, c)):
            left.remove(c)
    return left


def sums_of(columns: Sequence[FigureColumn], others: Sequence[FigureColumn]) -> bool:
    """Whether each column is a mean, range or extreme of the same of others, row by row."""
    alike = len(columns) < len(others) and all(len(c.values) == len(others[0].values) for c in columns)
    return alike and all(any(c.sums_up(own, worst=True) for own in sets_of(others, c)) for c in columns)


def sets_of(columns: Sequence[FigureColumn], beside: FigureColumn) -> Iterator[Sequence[FigureColumn]]:
    """Columns that a mean may be of: all, those of one head, those of one sense of travel, those of one family."""
    yield columns
    for part in {c.path[0] for c in columns if len(c.path) > 1 and c.path[0]}:
        yield [c for c in columns if c.path[0] == part]
    yield from ([c for c in columns if way_of(c.heading) == sense] for sense in (1, -1))
    yield from families(columns)
    yield [c for c in columns if c.i < beside.i]


def take_certified(reading: SheetReading, grids: Sequence[CutSheet]) -> None:
    """Calibrated lengths of another table in place of nominal ones, of which no deviation is."""
    base = next(iter(reading.taken.get("reference_mm", ())), None)
    if reading.kind != "lengths" or base is None or base.role == "reference" or not base.round or reading.checked:
        return
    known = _certified(grids)
    if {own[0] for own in reading.figures} <= {*known}:
        reading.figures = [(known[own[0]][0], *own[1:]) for own in reading.figures]
        head = next(iter(known.values()))[1]
        reading.taken["reference_mm"] = [replace(base, i=-1, path=[head])]


def _certified(grids: Sequence[CutSheet]) -> dict[float, tuple[float, str]]:
    """Calibrated lengths, each with its head, by the nominal ones beside or above them; none where two of one differ."""
    found: dict[float, set[tuple[float, str]]] = {}
    for grid in grids:
        pairs = [
            (n.values, c.values, c.heading)
            for blocks, rows in each(grid)
            for n, c in permutations(columns_in(grid, blocks, rows), 2)
            if (n.role, c.role) == ("nominal", "reference")
        ]
        rows = [row for row, own in enumerate(grid.figures) if any(own)]
        for a, b in pairwise(rows):
            if (said(grid.text(a, 0)), said(grid.text(b, 0))) == ("nominal", "reference"):
                both = np.array([[(grid.figure(row, k) or (np.nan,))[0] for k in range(grid.width)] for row in (a, b)])
                pairs.append((*both[:, np.isfinite(both).all(axis=0)], grid.text(b, 0)))
        for nominal, calibrated, name in pairs:
            each_one = zip(nominal.tolist(), calibrated.tolist(), strict=True) if like(nominal, calibrated) else ()
            for one, of_it in each_one:
                found.setdefault(one, set()).add((of_it, name))
    alone = all(len({value for value, _ in own}) == 1 for own in found.values())
    return {nominal: own.pop() for nominal, own in found.items()} if alone else {}


def refuse_certificate(reading: SheetReading, heads: Sequence[str], where: str) -> None:
    """Nominal lengths, each with one value and its uncertainty, of no line and no run, are calibrated and not measured."""
    words = words_of("others")["uncertainty"]
    certain = (understood(head).column in _UNCERTAIN or not words.isdisjoint(plain_words(head)) for head in heads)
    if len(reading.source) == 1 and len(reading.figures) >= _LEAST and any(certain):
        what = "gives each nominal length a value with its uncertainty, no line and no run, as the certificate of a gauge does"
        fix = 'Name it as [artefact.certificate] file, or say columns = { nominal_mm = "…", length_mm = "…" } of a test'
        raise NotReadError(what, where=where, fix=fix)


def few_of(reading: SheetReading, grid: CutSheet, rows: Sequence[int]) -> bool:
    """Whether a reading of what stands across has so few of its figures that arithmetic may fit by chance."""
    return _PART * np.size(reading.figures) < sum(f is not None for row in rows for f in grid.figures[row])


def passes_over_axes(reading: SheetReading, paths: Sequence[Sequence[str]]) -> bool:
    """Whether lengths that stand less nothing leave out columns below X, Y and Z, which are places."""
    if reading.kind != "lengths" or reading.taken.get("reference_mm"):
        return False
    used = {c.i for c in reading.source}
    named = [(i, {*" ".join(path).upper().split()} & {*"XYZ"}) for i, path in enumerate(paths)]
    every = {axis for _, own in named for axis in own}
    return len(every) == len("XYZ") and any(own for i, own in named if i not in used)


def spread(columns: Iterable[Sequence[FigureColumn]], wide: float) -> bool:
    """Whether coordinates are of a plate: of no ring that stays where it is, nor lengths along two axes that grow together."""
    every = [c for own in columns for c in own]
    steps = [np.abs(np.diff(c.values)) > wide for c in every]
    return all(c.full and c.step < 1 and np.ptp(c.values) > wide for c in every) and not np.all(steps, axis=0).all()
