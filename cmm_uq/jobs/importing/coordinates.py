"""Columns of coordinates, once or several times side by side or one below the other, and of deviations at targets of an axis.

Coordinates stand below the letters X, Y, Z or beside them; where a nominal value and a deviation stand beside a third figure,
that one is measured.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from itertools import combinations, permutations

import numpy as np

from cmm_uq.base.points import Floats
from cmm_uq.base.values import dataclass, replace
from cmm_uq.jobs.columns import COORDINATES
from cmm_uq.jobs.importing.blocks import Block, CutSheet, heading
from cmm_uq.jobs.importing.cells.figures import SMALL, figure
from cmm_uq.jobs.importing.factors import hint, says_of
from cmm_uq.jobs.importing.format import NotReadError
from cmm_uq.jobs.importing.header import without_unit
from cmm_uq.jobs.importing.lengths.evidence import spread
from cmm_uq.jobs.importing.roles import FigureColumn, SheetReading, at_places, columns_in, like, said_by, words_above

_MOST = 0.8  # of figures: where fewer are there, they may be of something else
_OFF_MM = 1.0  # farther from its target no axis comes to rest
_SAME = 2.0  # between what is nominal and what is measured; or a part of 0.002
_EXACT = ("nominal", "reference", "target")
_SCATTER = 1e-3  # of how far a place is away
_WIDE = 4.0  # of deviations and tolerances, in the unit of the file
_PROBED = 8  # places on a circle
_FEW = 3  # places, which may be round by chance
_UNIT_VECTOR = 2e-3  # to which directions have the length 1
_LETTER = re.compile(r"(?<![A-Za-zÀ-ɏ])([xyzXYZ])(?![A-Za-zÀ-ɏ])")
_EQUAL = re.compile(r"\s*[=:]\s*[-+]?\d")
_LEVEL = re.compile(r"(?<![^\W\d_])([XYZ])\s*[=:]\s*([-+]?\d+(?:[.,]\d+)?)(?![^\s;)])")
_COUNTED = re.compile(r"\d+|(?<![^\W\d_])[A-Za-z](?![^\W\d_])")
OF_CIRCLES = "Give x_mm, y_mm and z_mm, from radius and angle (docs/reference/columns.md, circular_test)"


class EitherError(NotReadError):
    """Two columns may be the measured one of an axis; what else a sheet holds may be read."""


@dataclass(frozen=True, eq=False)
class Triple:
    """Figures (n, 3) of three columns, or of a column in which each of three has a row; and their head without the axis."""

    columns: tuple[FigureColumn, ...]
    values: Floats
    head: str
    summed: bool = False  # whether they are nominal values and deviations together

    @property
    def role(self) -> str | None:
        return next((c.role for c in self.columns if c.role), None)

    @property
    def directed(self) -> bool:
        """Whether they are directions, all of the length 1."""
        length = np.linalg.norm(self.values[np.isfinite(self.values).all(axis=1)], axis=1)
        length = length[length > 0]
        return len(length) > 0 and bool((np.abs(length - 1) < _UNIT_VECTOR).all())

    @property
    def wide(self) -> bool:
        """Whether they are as far apart as places are, and deviations are not."""
        unit, extent = self.columns[0].unit, np.nanmax(self.values, axis=0) - np.nanmin(self.values, axis=0)
        if self.role == "deviation" and unit is not None and unit.name in SMALL:
            return False  # however large
        return bool(extent.max() > _WIDE or (unit is not None and unit.name not in SMALL and extent.max() > 0))

    @property
    def again(self) -> bool:
        """Whether they are one place, measured again and again; below ``X = 60`` lengths of a line stand as well."""
        own = self.values[np.isfinite(self.values).all(axis=1)]
        headed = len(own) > 0 and not any(_EQUAL.search(text) for c in self.columns for text in c.path)
        return headed and bool(np.ptp(own, axis=0).max() < _SCATTER * np.linalg.norm(own.mean(axis=0)))

    @property
    def grain(self) -> float:
        """The largest power of ten of which all figures are multiples."""
        own = np.abs(self.values[np.isfinite(self.values)])
        powers = [10.0**k for k in range(3, -9, -1)]
        return next((g for g in powers if np.abs(own / g - np.round(own / g)).max() < 1e-6), powers[-1])

    @property
    def step(self) -> float:
        """Of the last printed digit."""
        return min(c.step for c in self.columns) * 5

    @property
    def shown(self) -> str:
        return ", ".join(dict.fromkeys(c.heading or f"column {c.i + 1}" for c in self.columns))

    @property
    def several(self) -> int:
        """How many of them differ."""
        return len(np.unique(self.values, axis=0))

    def near(self, other: Triple) -> bool:
        """Whether they are the same places, nominal or measured."""
        away, both = np.abs(self.values - other.values), np.isfinite(self.values + other.values)
        return bool(both.any() and (away[both] <= np.maximum(_SAME, 0.002 * np.abs(self.values[both]))).all())

    def minus(self, other: Triple, deviations: Triple) -> bool:
        """Whether deviations are these less others to the printed digits."""
        alike = len(self.columns) == len(other.columns) == len(deviations.columns)
        each = zip(deviations.columns, self.columns, other.columns, strict=True) if alike else ()
        return alike and all(any(d.agrees(a, b, f) for f in d.factors(a)) for d, a, b in each)


def points_in(grid: CutSheet, blocks: Sequence[Block], rows: Sequence[int]) -> SheetReading | None:
    """Places of rows below a head that names X, Y and Z, once or for several points side by side, or of columns alike."""
    rows = [row for row in rows if row not in grid.ends]
    columns = columns_in(grid, blocks, rows) if rows else []
    lengths = [c for c in columns if c.may_be_length and not any(says_of(text, "straight") for text in c.path)]
    named = _named(lengths, _levels(grid))
    triples, checked = _measured(_in_one_unit(named) or _bare(lengths), grid.at(min(rows, default=0)))
    checked = checked or sum(_deviates_from(own, lengths) for own in triples)
    every = [c for own in triples for c in own.columns]
    if not triples or len({c.unit.name for c in every if c.unit}) > 1:
        return None
    finer = any(c.role in (None, "measured") and c.step < 1 < c.values[0] for c in lengths)
    if finer and all(c.step >= 1 for c in every):
        return None  # whole places, at which lengths were measured
    if any(_between(c, a, b) for a, b in combinations(triples, 2) for c in lengths if c not in every):
        return None  # places as they were set up, between which lengths were measured
    if any(_a_radius(c, own) for own in triples for c in lengths if c not in every):
        what = "its points lie round a centre, from which a column has their distances, as in circular tests"
        raise NotReadError(what, where=grid.at(rows[0]), fix=OF_CIRCLES)
    reading = SheetReading("points", unit=next((c.unit for c in every if c.unit), None), checked=checked)
    others = ((c.role, c.step) for c in lengths if c not in every)
    reading.planned = at_places(others, min(c.step for c in every))
    alone = not checked and sum(own.wide for own in named) == 1
    reading.beside_lengths = reading.planned or (alone and bool(_COUNTED.sub("", triples[0].head).strip()))
    reading.bare = [] if named else [c.i + 1 for c in every]
    reading.others = [*grid.ends]
    reading.taken = {f"{letter}_mm": [own.columns[k] for own in triples] for k, letter in enumerate("xyz")}
    reading.collect(grid, rows, columns)
    for k, row in enumerate(rows):
        for own in triples:
            if np.isfinite(own.values[k]).all():
                reading.add(row, k, own.columns[0], [one.columns[0] for one in triples], tuple(own.values[k].tolist()))
            elif np.isfinite(own.values[k]).any():
                _refuse_gaps(grid, rows, every)
                return None
    for labels in reading.labels:
        labels |= {key: _LETTER.sub(" ", text).strip() or text for key, text in labels.items() if key[0] == "head"}
    return reading if _places(np.array(reading.figures).reshape(-1, 3)) else None


def _deviates_from(of: Triple, columns: Sequence[FigureColumn]) -> bool:
    """Whether two of its coordinates, as of holes in a plate, are nominal values and deviations beside them together."""
    beside = [c for c in columns if c not in of.columns and c.step < 1]
    found = [
        any(d.role == "deviation" and d.values.any() and d.agrees(c, b, 1.0) for d, b in permutations(beside, 2))
        for c in of.columns
    ]
    return sum(found) > 1


def _between(column: FigureColumn, a: Triple, b: Triple) -> bool:
    """Whether it is how far two places of each row are apart, known ten times better than those."""
    coarse = min(c.step for c in (*a.columns, *b.columns))
    away = np.linalg.norm(a.values - b.values, axis=1) - column.values if a.values.shape == b.values.shape else np.inf
    return column.full and 9 * column.step < coarse < 1 and bool(np.max(np.abs(away)) < 2 * coarse)


def _a_radius(column: FigureColumn, of: Triple) -> bool:
    """Whether it is how far places are from the origin in one plane, to the printed digits."""
    own = of.values
    if not column.full or len(of.columns) < len(COORDINATES) or len(own) < _PROBED or np.isnan(own).any():
        return False
    step = 1.5 * max(column.step, *(c.step for c in of.columns if c.i >= 0))
    return any(np.abs(np.hypot(a, b) - column.values).max() <= step for a, b in combinations(own.T, 2))


def _places(xyz: Floats) -> bool:
    """Whether figures (n, 3) are no lengths on lines along X, Y and Z."""
    return len(xyz) > 0 and not (len(xyz) > 2 and all(like(xyz[:, 0], xyz[:, k]) for k in (1, 2)))


def _levels(grid: CutSheet) -> dict[str, float]:
    """Coordinates that all points have, where each text that says one of any axis says it: ``taken at Z = -412.5``."""
    texts = (grid.line(row) for row, kind in enumerate(grid.kinds) if kind == "text")
    every = [[(match[1].lower(), figure(match[2], grid.sign)) for match in _LEVEL.finditer(text)] for text in texts]
    each = [{axis: f[0] for axis, f in own if f and all(f == g for b, g in own if b == axis)} for own in every if own]
    first, *others = each or [{}]
    return {axis: value for axis, value in first.items() if all(own.get(axis) == value for own in others)}


def _named(columns: Sequence[FigureColumn], levels: Mapping[str, float]) -> list[Triple]:
    """Columns whose heads are the same but for a letter x, y or z; of two of them with what is said of the third."""
    found: dict[tuple[str, str], dict[str, list[FigureColumn]]] = {}
    for c in columns:
        text = " ".join(without_unit(one.replace("\n", " "))[0].strip() for one in c.path).strip()
        for match in re.finditer("[xyzXYZ]", text):
            rest = text[: match.start()].casefold(), text[match.end() :].casefold()
            found.setdefault(rest, {}).setdefault(match[0].lower(), []).append(c)
    flat = not levels and not any("z" in own for own in found.values())
    for own in found.values() if all(len(own) < 3 for own in found.values()) else ():
        if len(axes := {*"xyz"} - {*own}) == 1 and (
            (axis := axes.pop()) in levels or (flat and axis == "z" and spread(own.values(), _WIDE))
        ):
            (first, *_), level = own.values(), levels.get(axis, 0.0)
            path = [f"{axis.upper()} = {level:g}" if axis in levels else "0, as the file has no Z"]
            own[axis] = [
                replace(c, i=-1, path=path, values=c.values * 0 + level * (np.ptp(c.values) > _WIDE)) for c in first
            ]
    parts = [rest for rest, own in found.items() if len(own) < 3]
    for a, b in permutations(parts, 2):
        if "x" not in found[a] or len(found[a]) + len(found[b]) != 3 or len(both := {**found[a], **found[b]}) != 3:
            continue
        each = [columns.index(c) for axis in "xyz" for c in both.get(axis, ())]
        if each == [*range(each[0], each[0] + 3)]:
            found |= {a: both, b: {}}  # a head that ends at an empty column
    whole = [(rest, own) for rest, own in found.items() if len(own) == 3 and len({*map(len, own.values())}) == 1]
    forms = [_COUNTED.sub("0", " ".join(rest)) for rest, _ in whole]
    if any(len(own) == 2 and _COUNTED.sub("0", " ".join(rest)) in forms for rest, own in found.items()):
        return []  # a coordinate of one of several points is called otherwise
    threes = ((three, rest) for rest, own in whole for three in zip(*(own[axis] for axis in "xyz"), strict=True))
    return [_three(three, " ".join(rest).strip()) for three, rest in threes]


def _in_one_unit(triples: Sequence[Triple]) -> list[Triple]:
    """Those that are not the same again in another unit, to the printed digits."""

    def again(one: Triple, other: Triple) -> bool:
        units = [[c.unit for c in t.columns] for t in (one, other)]
        (a, *_), (b, *_) = units
        if a is None or b is None or a.name == b.name or any(u not in (own[0],) for own in units for u in own):
            return False
        factor = b.metres / a.metres
        slack = one.columns[0].step + other.columns[0].step * factor
        return bool(np.nanmax(np.abs(one.values - other.values * factor), initial=0.0) <= slack)

    return [t for k, t in enumerate(triples) if not any(again(t, other) for other in triples[:k])]


def _bare(columns: Sequence[FigureColumn]) -> list[Triple]:
    """Three columns side by side that no head names, the only ones of a file that may be coordinates."""
    fine = [c for c in columns if c.step < 1 and c.full and not "".join(c.path).strip()]
    every = [_three(fine[k : k + 3], "") for k in range(len(fine) - 2) if fine[k + 2].i - fine[k].i == 2]
    directed = {c.i for own in every if own.directed for c in own.columns}
    left = [c for c in fine if c.i not in directed]
    beyond = left[3:]
    extents = [np.ptp(c.values) for c in left]
    if len(left) < 3 or left[2].i - left[0].i != 2 or len(left[0].values) < 4 or sorted(extents[:3])[1] < 4:
        return []
    if beyond and not (max(extents[3:]) == 0 < extents[2] or (max(extents[3:]) < 1 < extents[2])):
        return []
    alike = any(like(a.values, b.values, 1) for a, b in combinations(left[:3], 2))
    return [] if alike else [_three(left[:3], "")]


def _three(columns: Sequence[FigureColumn], head: str) -> Triple:
    return Triple(tuple(columns), np.column_stack([c.values for c in columns]), head)


def _measured(triples: Sequence[Triple], where: str) -> tuple[list[Triple], int]:
    """Those that are measured, of several points or runs side by side, and how many arithmetic confirms.

    Of two that are the same places the nominal one is told by its deviations, by words, or by its figures, which are rounder.
    """
    rest = [t for t in triples if not t.directed and np.ptp(t.values, axis=1).any()]
    wide = [t for t in rest if t.wide]
    single = [t for t in rest if 1 in (len(t.columns), len(t.values)) or t.again]
    one_place = [t for t in single if np.nanmax(np.abs(t.values)) > _WIDE]
    large = wide or one_place
    nominal, confirmed, deviating = set[Triple](), set[Triple](), set[Triple]()
    for a, b in permutations(large, 2):
        told = (b.role in _EXACT) - (a.role in _EXACT)
        told = told or (a.role == "measured") - (b.role == "measured")
        if told >= 0 and {a, b}.isdisjoint(nominal) and a.near(b):
            others = [d for d in rest if d is not a and d is not b]
            deviating |= (checks := {d for d in others if a.minus(b, d)})
            if told > 0 and not checks and any(b.minus(a, d) for d in others):
                what = f"{a.shown} is called measured, and by the deviations {b.shown} is"
                raise EitherError(what, where=where, fix=said_by("x_mm", a.columns[:1], ", and y_mm and z_mm"))
            confirmed |= {a} if checks else set()
            rounder = a.grain * 5 < b.grain or 2 * b.several <= a.several
            rounder = rounder and a.several > _FEW and _COUNTED.sub("0", a.head) != _COUNTED.sub("0", b.head)
            if checks or told > 0 or rounder:
                nominal.add(b)
    left = [t for t in large if t not in nominal | deviating and t.role != "deviation"]
    left = [t for t in left if t.role != "summary"] or [t for t in left if t in confirmed]
    if deviations := [t for t in rest if t.role == "deviation" and t not in large] if not nominal else []:
        left = [t for t in left if t.role not in _EXACT] or _summed(left, deviations, where)
    left = [t for t in left if t.role not in _EXACT or t.summed]
    small = min((t.grain for t in rest if t not in large and t.several > 1), default=np.inf)
    if round_ := [
        t for t in left if not t.summed and t.role is None and t.several > _FEW and small * 5 < t.grain > t.step
    ]:
        what = f"{round_[0].shown} may be nominal values, for all are round, and no measured ones stand beside them"
        raise EitherError(what, where=where, fix=said_by("x_mm", round_[0].columns[:1], ", and y_mm and z_mm"))
    if len({_COUNTED.sub("0", t.head) for t in left}) > 1:
        left = [t for t in left if not t.head] or left
    counted = len({_COUNTED.sub("0", t.head) for t in left}) < 2 and len({t.head for t in left}) == len(left)
    if len(left) > 1 and not (counted or _rigid(left)):
        what = f"{left[0].shown} and {left[1].shown} may both be measured places"
        raise EitherError(what, where=where, fix=said_by("x_mm", left[0].columns[:1], ", and y_mm and z_mm"))
    return left, len(confirmed)


def _summed(nominal: Sequence[Triple], deviations: Sequence[Triple], where: str) -> list[Triple]:
    """Nominal places with their deviations, where no measured place stands beside them."""
    if len(nominal) > 1:
        what = f"{nominal[0].shown} and {nominal[1].shown} may both be the nominal values of what was measured"
        raise EitherError(what, where=where, fix="Keep the columns of one of them, with their deviations")
    found: list[Triple] = []
    for dev in deviations if nominal else ():  # of one pass, or of several side by side
        pairs = [*zip(dev.columns, nominal[0].columns, strict=False)]
        factors = [d.factors(n) for d, n in pairs]
        if len(dev.columns) != len(nominal[0].columns) or any(one != factors[0] for one in factors):
            return []
        if len(factors[0]) > 1 < len({c.unit for c in dev.columns}):
            return []
        whole = nominal[0].values + dev.values * factors[0][0]
        each = tuple(replace(d, unit=n.unit, step=n.step) for d, n in pairs)
        one = replace(nominal[0], values=whole, summed=True)
        found.append(one if len(deviations) == 1 else replace(one, columns=each, head=dev.head))
    return found


def _rigid(triples: Sequence[Triple]) -> bool:
    """Whether what stands side by side in each row is an artefact: the distances are the same in all rows."""
    apart = [np.linalg.norm(a.values - b.values, axis=1) for a, b in combinations(triples, 2)]
    return all(np.nanmin(d) > _SAME and np.ptp(d[np.isfinite(d)]) < 0.1 and len(d) > 2 for d in apart)


def rows_of_axes(grid: CutSheet, blocks: Sequence[Block], rows: Sequence[int]) -> SheetReading | None:
    """Places of which each coordinate has a row that names X, Y or Z in one of its cells."""
    for i in range(grid.width):
        named = [
            (row, text, found[0]) for row in rows if len(found := [*_LETTER.finditer(text := grid.text(row, i))]) == 1
        ]
        named = [one for one in named if not _EQUAL.match(one[1], one[2].end())]
        own = [row for row, _, _ in named]
        stems = [f"{text[: m.start()]} {text[m.end() :]}".strip(" \t_.:/=-") for _, text, m in named]
        if len(own) < 3 or "".join(m[0].upper() for _, _, m in named) != "XYZ" * (len(own) // 3):
            continue
        above = heading(blocks[0].paths[i]) if i < len(blocks[0].paths) else ""
        if not any(stems) and any(map(str.isdigit, above)):
            stems = [above] * len(stems)  # the head of its own of each feature
        columns = [c for c in columns_in(grid, blocks, own) if c.i != i and c.may_be_length]
        _refuse_gaps(grid, own, [c for c in columns if c.role == "measured"])
        fine = [c for c in columns if c.full and c.step < 1]
        own_triples = [Triple((c,), c.values.reshape(-1, 3), c.heading or f"column {c.i + 1}") for c in fine]
        triples, checked = _measured(own_triples, grid.at(own[0]))
        if not triples or not _places(np.concatenate([t.values for t in triples])):
            continue
        measured = [t.columns[0] for t in triples]
        reading = SheetReading("points", measured[0].unit or grid.unit_beside(own), None, checked)
        others = [r for r, kind in enumerate(grid.kinds) if kind == "figures" and not _has_axis(grid, r)]
        reading.taken, reading.others = {"x_mm, y_mm, z_mm": measured}, [*rows, *others]
        three = ((c, c.values[: len(own)].reshape(-1, 3)) for c in columns)
        apart = [c.i for c, values in three if np.isfinite(values).all() and np.ptp(values, axis=1).any()]
        reading.collect(grid, own, columns, [i, *(c.i for c in fine), *apart])
        reading.read.add(i)
        if not _threes([{**one, ("name", ""): stem} for one, stem in zip(reading.beside, stems, strict=True)]):
            return None
        for k in range(0, len(own), 3):
            if own[k + 2] - own[k] > 6 or len({*stems[k : k + 3]}) > 1:
                return None
            for c in measured:
                reading.add(own[k], k, c, measured, tuple(map(float, c.values[k : k + 3])))
                reading.labels[-1] |= {("column", f"{i} "): stems[k]} if any(stems) else {}
        return reading
    return None


def _has_axis(grid: CutSheet, row: int) -> bool:
    """Whether a row names an axis, or has no name at all."""
    texts = [grid.text(row, k) for k, f in enumerate(grid.figures[row]) if f is None]
    return not any(texts) or any(map(_LETTER.search, texts))


def _refuse_gaps(grid: CutSheet, rows: Sequence[int], columns: Sequence[FigureColumn]) -> None:
    """An error where few of the measured figures are missing: another column is not taken for them."""
    for c in columns:
        there = np.isfinite(c.values)
        if c.step < 1 and _MOST < there.mean() < 1:
            raise grid.no_value(rows[int(np.argmin(there))], c.i)


def _threes(labels: Sequence[Mapping[tuple[str, str], str]]) -> bool:
    """Whether every three rows have a name of their own, or the number of a point, and none names each otherwise."""
    named = any(map(str.isdigit, labels[0]["name", ""]))
    for key in labels[0]:
        own = [one.get(key, "") for one in labels]
        if [text.upper() for text in own[:3]] == ["X", "Y", "Z"]:
            continue  # the axis again
        of = hint(words_above(key), lengths=False)
        if key[0] == "column" and of in ("line", "point") and own[0] != own[1] != own[2]:
            return False  # lines along the axes
        counts = key[0] != "block" and of != "run" and (of is not None or not all(one.isdecimal() for one in own))
        named = named or (counts and own[::3] == own[1::3] == own[2::3] and (len({*own}) > 1 or len(own) == 3))
    return named
