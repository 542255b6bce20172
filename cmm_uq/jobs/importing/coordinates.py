"""Columns of coordinates, once or several times side by side or one below the other, and of deviations at targets of an axis.

Coordinates stand below the letters X, Y, Z or beside them; where a nominal value and a deviation stand beside a third figure,
that one is measured.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import combinations, permutations

import numpy as np

from cmm_uq.base.points import Floats
from cmm_uq.jobs.importing.blocks import SMALL, Block, CutSheet
from cmm_uq.jobs.importing.factors import hint, places, ways_of
from cmm_uq.jobs.importing.format import NotReadError, WrittenUnit
from cmm_uq.jobs.importing.header import plain_words, without_unit, words_of
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
    labels_of,
    like,
    mean_of,
    said,
    unit_beside,
)

_MOST, _COMPLETE = 0.8, "Complete the row, or take it out"
_OFF_MM = 1.0  # farther from its target no axis comes to rest
_LETTER = re.compile(r"(?<![A-Za-zÀ-ÿ])([xyzXYZ])(?![A-Za-zÀ-ÿ])|^([XYZ])(?=[A-Z]?[a-z])")
_ENDS = re.compile(r"(.*?)[\s_.:/-]*([XYZ])(?:[- ]?(?:axis|achse|axe|wert|value|[ck]oord\w*\.?))?", re.IGNORECASE)


def points_in(grid: CutSheet, blocks: Sequence[Block], rows: Sequence[int]) -> SheetReading | None:
    """Places of rows below one head that names X, Y and Z, once or for several points side by side."""
    columns = columns_in(grid, blocks, rows)
    checked, triples = 0, []
    for letter in "xyz":
        own = [c for c in columns if c.role != SUMMARY and c.may_be_length and _axis(c.path) == letter]
        own = [c for c in own if not _directed(c.path)]
        nominal = _nominal_of(own)
        checked += len(nominal) // 2
        rest = [c for c in own if c.i not in nominal and c.role not in (NOMINAL, DEVIATION, REFERENCE)]
        triples.append([c for c in rest if not mean_of(c, [o for o in rest if o is not c])] or rest)
    bare = _bare(grid, columns, rows)
    triples = [[c] for c in bare] or triples
    every = [c for own in triples for c in own]
    if not triples[0] or len({*map(len, triples)}) > 1 or len({c.unit.name for c in every if c.unit}) > 1:
        return None
    if not bare and len({tuple(map(_LETTER.sub, [" "] * len(c.path), c.path)) for c in triples[0]}) < len(triples[0]):
        return None  # side by side, and nothing tells them apart
    reading = SheetReading("points", unit=next((c.unit for c in every if c.unit), None), checked=checked)
    reading.bare = [c.i + 1 for c in bare]
    reading.taken = {f"{letter}_mm": own for letter, own in zip("xyz", triples, strict=True)}
    reading.collect(grid, rows, columns)
    for k, row in enumerate(rows):
        for three in zip(*triples, strict=True):
            xyz = tuple(float(c.values[k]) for c in three)
            if all(np.isfinite(xyz)):
                reading.add(row, k, three[0], triples[0], xyz)
            elif any(np.isfinite(xyz)):
                _refuse_gaps(grid, rows, every)
                return None
    for labels in reading.labels:
        labels |= {key: _LETTER.sub(" ", text).strip() or text for key, text in labels.items() if key[0] == "head"}
    xyz_ = np.array(reading.figures).reshape(-1, 3)
    alike = len(xyz_) > 2 and all(like(xyz_[:, 0], xyz_[:, k]) for k in (1, 2))  # lengths on lines called X, Y, Z
    return reading if len(xyz_) and not alike and _apart(xyz_, reading.unit) else None


def _bare(grid: CutSheet, columns: Sequence[FigureColumn], rows: Sequence[int]) -> list[FigureColumn]:
    """Three columns beside names, in a file that is nothing but them: each differs by more than a diameter does."""
    fine = [c for c in columns if c.step < 1]
    alone = len(grid.blocks) == 1 and not grid.blocks[0].head and len(rows) == len(grid.blocks[0].rows) > 3
    if not alone or len(fine) != 3 or len(columns) > 4 or grid.width > fine[-1].i + 1 or fine[-1].i - fine[0].i != 2:
        return []
    apart = all(c.full and np.ptp(c.values) > 1 for c in fine) and fine[0].i in (0, 1)
    alike = any(like(a.values, b.values, 1) for a, b in permutations(fine, 2))
    names = {grid.text(row, 0) for row in rows}
    again = len(names) < len(rows) or (
        apart and places(np.column_stack([c.values for c in fine])).max() + 1 < len(rows)
    )
    return fine if apart and not alike and not again else []


def _nominal_of(columns: Sequence[FigureColumn]) -> set[int]:
    """Nominal values and deviations beside measured ones, which are their sum."""
    found: set[int] = set()
    values, fine = np.array([c.values for c in columns]), np.array([c.step for c in columns])
    slack = np.add.outer(fine, fine) + 1e-6
    for d in columns:
        if d.role not in (None, DEVIATION) or not np.any(d.values) or not np.isfinite(d.values).any():
            continue
        at = int(
            np.nanargmax(np.abs(d.values))
        )  # of all sums that may be so few hold in this row, whatever the others say
        apart = np.subtract.outer(values[:, at], values[:, at])
        for f in dict.fromkeys(f for c in columns for f in factors(d, c)):
            for i, k in np.argwhere(~(np.abs(apart - d.values[at] * f) > d.step * f + slack)):
                measured, nominal = columns[i], columns[k]
                words = measured.role not in (NOMINAL, REFERENCE) and nominal.role != MEASURED
                other = d is not measured and d is not nominal and measured is not nominal
                if other and words and not {nominal.i, d.i} <= found and f in factors(d, nominal):
                    found |= {nominal.i, d.i} if agrees(d, measured, nominal, f) else set()
    return found


def _apart(xyz: Floats, unit: WrittenUnit | None) -> bool:
    """Whether figures may be places, and no deviations."""
    return bool(len(xyz) == 1 or np.ptp(xyz, axis=0).max() > 4 or (unit is not None and unit.name not in SMALL))


def _axis(path: Sequence[str]) -> str | None:
    """The axis that the lowest text above a column names."""
    for text in reversed(path):
        if found := {(m[1] or m[2]).lower() for m in _LETTER.finditer(without_unit(text)[0].strip())}:
            return found.pop() if len(found) == 1 else None
    return None


def _directed(path: Sequence[str]) -> bool:
    """Whether a column is part of a direction."""
    of, words = words_of("axis"), {word for text in path for word in plain_words(text)}
    return bool(words & (of["normal"] | of["approach"] - {"axis"})) and not words & of["coordinate"]


def rows_of_axes(grid: CutSheet, blocks: Sequence[Block], rows: Sequence[int]) -> SheetReading | None:
    """Places of which each coordinate has a row, called X, Y or Z in a column or at the end of a name."""
    for i in range(grid.width):
        ends = [_ENDS.fullmatch(grid.text(row, i)) for row in rows]
        stems = [end[1] for end in ends if end]
        if len(stems) < 3 or "".join(end[2].upper() for end in ends if end) != "XYZ" * (len(stems) // 3):
            continue
        own = [row for row, end in zip(rows, ends, strict=True) if end]
        above = heading(blocks[0].paths[i]) if i < len(blocks[0].paths) else ""
        if not any(stems) and any(map(str.isdigit, above)):
            stems = [above] * len(stems)  # the head of its own of each feature
        columns = [c for c in columns_in(grid, blocks, own) if c.i != i]
        _refuse_gaps(grid, own, [c for c in columns if c.role == MEASURED])
        columns = [c for c in columns if c.full]
        fine = [c for c in columns if c.step < 1]
        measured, checked = [c for c in fine if c.role == MEASURED], 0
        nominal = _nominal_of(fine)
        if nominal:
            checked = len(nominal) // 2
            measured = measured or [c for c in fine if c.i not in nominal and c.role is None]
        measured = measured or [c for c in fine if c.role is None]
        if not measured or (not checked and len(measured) > 1 and any(c.role is None for c in measured)):
            continue
        reading = SheetReading("points", unit=measured[0].unit or unit_beside(grid, own), checked=checked, others=rows)
        reading.taken = {"x_mm, y_mm, z_mm": measured}
        reading.collect(grid, own, columns, [i, *(c.i for c in fine)])
        if not _threes([{**one, ("name", ""): stem} for one, stem in zip(reading.beside, stems, strict=True)]):
            return None
        for k in range(0, len(own), 3):
            if own[k + 2] - own[k] > 6 or len({*stems[k : k + 3]}) > 1:
                return None
            for c in measured:
                reading.add(own[k], k, c, measured, tuple(map(float, c.values[k : k + 3])))
                reading.labels[-1] |= {("column", f"{i} "): stems[k]} if any(stems) else {}
        return reading if _apart(np.array(reading.figures), reading.unit) else None
    return None


def _refuse_gaps(grid: CutSheet, rows: Sequence[int], columns: Sequence[FigureColumn]) -> None:
    """An error where few of the measured figures are missing: another column is not taken for them."""
    for c in columns:
        there = np.isfinite(c.values)
        if c.step < 1 and _MOST < there.mean() < 1:
            raise NotReadError("no value", where=grid.at(rows[int(np.argmin(there))], c.i), fix=_COMPLETE)


def _threes(labels: Sequence[Mapping[tuple[str, str], str]]) -> bool:
    """Whether every three rows have a name of their own, or the number of a point, and none names each otherwise."""
    named = False
    for key in labels[0]:
        own = [one.get(key, "") for one in labels]
        of = hint(key[1].partition(" ")[2] if key[0] == "column" else key[1], lengths=False)
        if key[0] == "column" and of in ("line", "point") and own[0] != own[1] != own[2]:
            return False  # lines along the axes
        counts = key[0] != "block" and of != "run" and (of is not None or not all(one.isdecimal() for one in own))
        named = named or (counts and own[::3] == own[1::3] == own[2::3] and (len({*own}) > 1 or len(own) == 3))
    return named


def runs_in(grid: CutSheet, blocks: Sequence[Block], rows: Sequence[int]) -> SheetReading | None:
    """Deviations at targets along an axis, there and back."""
    columns = columns_in(grid, blocks, rows)
    if blocks[0].head and (across := grid.targets(blocks[0].head[-1])):
        return _across(grid, rows, columns, across, blocks[0].head[-1])
    ends = [c for c in columns if c.role in (TARGET, NOMINAL) and np.ptp(c.values[np.isfinite(c.values)]) > 1]
    target = min(ends, key=lambda c: c.counts, default=None)  # and not their numbers
    if target is None or not np.isfinite(target.values[0]):
        return None
    values = down(target.values)
    beside = [c for c in columns if c is not target and c.role in (None, DEVIATION, MEASURED) and c.may_be_length]
    small = [c for c in beside if (c.step < 1 or _way(c.heading)) and not like(c.values + 1000, values + 1000)]
    source = [c for c in small if not mean_of(c, [o for o in small if o is not c and _same_way(o, c)])]
    directed = [c for c in source if _way(c.heading)] or [c for c in source if c.role == DEVIATION]
    source = directed or source  # the others are reversals, spreads and what was recorded beside them
    reading = SheetReading("runs", unit=target.unit, small=next((c.unit for c in source if c.unit), None))
    if not any(map(_way, (c.heading for c in source))) and (reached := _reached(columns, target, values, source)):
        source, reading.positions = reached, True
    if not source or any(a.heading == b.heading and not _way(a.heading) for a, b in combinations(source, 2)):
        return None  # or of two instruments
    reading.taken = {"target": [target], "reading_um": source}
    reading.collect(grid, rows, columns)
    for k, row in enumerate(rows):
        for c in source:
            if np.isfinite(c.values[k]):
                reading.add(row, k, c, source, (float(values[k]), float(c.values[k])))
            else:
                reading.blank.append((row, c.i))
    return reading if any(ways_of(label.values) is not None for label in labels_of(reading)) else None


def _reached(
    columns: Sequence[FigureColumn], target: FigureColumn, values: Floats, deviations: Sequence[FigureColumn]
) -> list[FigureColumn]:
    """Positions that were reached, as deviations from their targets, where no deviation stands beside them."""
    roles = (None, MEASURED, REFERENCE)
    near = [c for c in columns if c is not target and c.role in roles and c.may_be_length and c.step < 1]
    near = [c for c in near if like(c.values, values, _OFF_MM) and np.nanmax(np.abs(values)) > 10 * _OFF_MM]
    found = [
        replace(c, values=c.values - values)
        for c in near
        if not mean_of(c, [o for o in near if o is not c and _same_way(o, c)])
    ]
    given = any(agrees(d, c, target, f) for d in deviations for c in near for f in factors(d, c))
    return [] if given else found


def _across(
    grid: CutSheet, rows: Sequence[int], columns: Sequence[FigureColumn], across: Sequence[int], head: int
) -> SheetReading | None:
    """Deviations below the targets that stand above them, a way and a run in each row."""
    source = [c for c in columns if c.i in across]
    labels = {row: [grid.text(row, k) for k in range(across[0])] for row in rows}
    own = [row for row in rows if said(labels[row]) != SUMMARY and any(map(_way, labels[row]))]
    reading = SheetReading("runs")
    reading.taken = {"target": source, "reading_um": source}
    reading.collect(grid, own, columns)
    for k, row in enumerate(own):
        for c in source:
            target, figure = grid.figures[head][c.i], grid.figures[row][c.i]
            if target is not None and figure is not None:
                reading.add(row, k, c, [c], (target[0], figure[0]))
    return reading if len(reading.figures) == len(own) * len(across) else None


def _way(text: str) -> bool:
    """Whether a text names a sense of travel."""
    return any(ways_of([text, other]) is not None for other in "+-")


def _same_way(a: FigureColumn, b: FigureColumn) -> bool:
    ways = ways_of([a.heading, b.heading])
    return ways is None or ways[0] == ways[1]
