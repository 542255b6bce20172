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
from cmm_uq.jobs.importing.blocks import SMALL, Block, CutSheet, heading
from cmm_uq.jobs.importing.factors import hint, places, ways_of
from cmm_uq.jobs.importing.format import WrittenUnit
from cmm_uq.jobs.importing.header import plain_words, without_unit, words_of
from cmm_uq.jobs.importing.roles import FigureColumn, SheetReading, columns_in, like, said, without_sums, words_above

_MOST = 0.8  # of figures: where fewer are there, they may be of something else
_OFF_MM = 1.0  # farther from its target no axis comes to rest
_LETTER = re.compile(r"(?<![A-Za-zÀ-ÿ])([xyzXYZ])(?![A-Za-zÀ-ÿ])|^([XYZ])(?=[A-Z]?[a-z])")
_ENDS = re.compile(r"(.*?)[\s_.:/-]*([XYZ])(?:[- ]?(?:axis|achse|axe|wert|value|[ck]oord\w*\.?))?", re.IGNORECASE)


def points_in(grid: CutSheet, blocks: Sequence[Block], rows: Sequence[int]) -> SheetReading | None:
    """Places of rows below one head that names X, Y and Z, once or for several points side by side."""
    columns = columns_in(grid, blocks, rows)
    checked, triples = 0, []
    for letter in "xyz":
        own = [c for c in columns if c.role != "summary" and c.may_be_length and _axis(c.path) == letter]
        own = [c for c in own if not _directed(c.path)]
        nominal = _nominal_of(own)
        checked += len(nominal) // 2
        rest = [c for c in own if c.i not in nominal and c.role not in ("nominal", "deviation", "reference")]
        triples.append(without_sums(rest) or rest)
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
    places = np.array(reading.figures).reshape(-1, 3)
    alike = len(places) > 2 and all(like(places[:, 0], places[:, k]) for k in (1, 2))  # lengths on lines X, Y, Z
    return reading if len(places) and not alike and _apart(places, reading.unit) else None


def _bare(grid: CutSheet, columns: Sequence[FigureColumn], rows: Sequence[int]) -> list[FigureColumn]:
    """Three columns beside names, in a file that is nothing but them: each differs by more than a diameter does."""
    fine = [c for c in columns if c.step < 1]
    alone = len(grid.blocks) == 1 and not grid.blocks[0].head and len(rows) == len(grid.blocks[0].rows) > 3
    if not alone or len(fine) != 3 or len(columns) > 4 or grid.width > fine[-1].i + 1 or fine[-1].i - fine[0].i != 2:
        return []
    if fine[0].i > 1 or not all(c.full and np.ptp(c.values) > 1 for c in fine):
        return []
    alike = any(like(a.values, b.values, 1) for a, b in permutations(fine, 2))
    again = len({grid.text(row, 0) for row in rows}) < len(rows)
    again = again or places(np.column_stack([c.values for c in fine])).max() + 1 < len(rows)
    return [] if alike or again else fine


def _nominal_of(columns: Sequence[FigureColumn]) -> set[int]:
    """Nominal values and deviations beside measured ones, which are their sum."""
    found: set[int] = set()
    values, fine = np.array([c.values for c in columns]), np.array([c.step for c in columns])
    slack = np.add.outer(fine, fine) + 1e-6
    for d in columns:
        if d.role not in (None, "deviation") or not np.any(d.values) or not np.isfinite(d.values).any():
            continue
        at = int(np.nanargmax(np.abs(d.values)))  # the row in which the fewest sums hold by chance
        apart = np.subtract.outer(values[:, at], values[:, at])
        for f in dict.fromkeys(f for c in columns for f in d.factors(c)):
            for i, k in np.argwhere(~(np.abs(apart - d.values[at] * f) > d.step * f + slack)):
                measured, nominal = columns[i], columns[k]
                words = measured.role not in ("nominal", "reference") and nominal.role != "measured"
                other = d is not measured and d is not nominal and measured is not nominal
                if other and words and not {nominal.i, d.i} <= found and f in d.factors(nominal):
                    found |= {nominal.i, d.i} if d.agrees(measured, nominal, f) else set()
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
        _refuse_gaps(grid, own, [c for c in columns if c.role == "measured"])
        columns = [c for c in columns if c.full]
        fine = [c for c in columns if c.step < 1]
        nominal = _nominal_of(fine)
        unnamed = [c for c in fine if c.role is None]
        measured = [c for c in fine if c.role == "measured"] or [c for c in unnamed if c.i not in nominal] or unnamed
        if not measured or (not nominal and len(measured) > 1 and any(c.role is None for c in measured)):
            continue
        reading = SheetReading("points", measured[0].unit or grid.unit_beside(own), None, len(nominal) // 2)
        reading.taken, reading.others = {"x_mm, y_mm, z_mm": measured}, rows
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
            raise grid.no_value(rows[int(np.argmin(there))], c.i)


def _threes(labels: Sequence[Mapping[tuple[str, str], str]]) -> bool:
    """Whether every three rows have a name of their own, or the number of a point, and none names each otherwise."""
    named = False
    for key in labels[0]:
        own = [one.get(key, "") for one in labels]
        of = hint(words_above(key), lengths=False)
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
    ends = [c for c in columns if c.role in ("target", "nominal") and np.ptp(c.values[np.isfinite(c.values)]) > 1]
    target = min(ends, key=lambda c: c.counts, default=None)  # and not their numbers
    if target is None or not np.isfinite(target.values[0]):
        return None
    values = target.downwards
    beside = [c for c in columns if c is not target and c.role in (None, "deviation", "measured") and c.may_be_length]
    small = [c for c in beside if (c.step < 1 or _way(c.heading)) and not like(c.values + 1000, values + 1000)]
    small = _of_runs(small)
    directed = [c for c in small if _way(c.heading)] or [c for c in small if c.role == "deviation"]
    source = directed or small  # the others are reversals, spreads and what was recorded beside them
    reading = SheetReading("runs", unit=target.unit, small=next((c.unit for c in source if c.unit), None))
    if not any(_way(c.heading) for c in source) and (reached := _reached(columns, target, values, source)):
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
    return reading if any(ways_of(label.values) is not None for label in reading.every_label) else None


def _reached(
    columns: Sequence[FigureColumn], target: FigureColumn, values: Floats, deviations: Sequence[FigureColumn]
) -> list[FigureColumn]:
    """Positions that were reached, as deviations from their targets, where no deviation stands beside them."""
    near = [c for c in columns if c is not target and c.role in (None, "measured", "reference")]
    near = [c for c in near if c.may_be_length and c.step < 1 and like(c.values, values, _OFF_MM)]
    near = [c for c in near if np.nanmax(np.abs(values)) > 10 * _OFF_MM]
    given = any(d.agrees(c, target, f) for d in deviations for c in near for f in d.factors(c))
    return [] if given else [replace(c, values=c.values - values) for c in _of_runs(near)]


def _of_runs(columns: Sequence[FigureColumn]) -> list[FigureColumn]:
    """Columns that are no mean of others of the same sense of travel."""
    found = []
    for c in columns:
        ways = [(o, ways_of([o.heading, c.heading])) for o in columns if o is not c]
        if not c.sums_up([o for o, of in ways if of is None or of[0] == of[1]]):
            found.append(c)
    return found


def _across(
    grid: CutSheet, rows: Sequence[int], columns: Sequence[FigureColumn], across: Sequence[int], head: int
) -> SheetReading | None:
    """Deviations below the targets that stand above them, a way and a run in each row."""
    source = [c for c in columns if c.i in across]
    labels = {row: [grid.text(row, k) for k in range(across[0])] for row in rows}
    own = [row for row in rows if said(labels[row]) != "summary" and any(map(_way, labels[row]))]
    reading = SheetReading("runs", taken={"target": source, "reading_um": source})
    reading.collect(grid, own, columns)
    for k, row in enumerate(own):
        for c in source:
            if (target := grid.figure(head, c.i)) and (figure := grid.figure(row, c.i)):
                reading.add(row, k, c, [c], (target[0], figure[0]))
    return reading if len(reading.figures) == len(own) * len(across) else None


def _way(text: str) -> bool:
    """Whether a text names a sense of travel."""
    return any(ways_of([text, other]) is not None for other in "+-")
