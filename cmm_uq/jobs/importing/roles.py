"""What the columns of a block are, by words and by arithmetic: each says what the other leaves open, and neither may deny it.

A deviation is measured minus reference to the printed digit, a mean the mean of its runs.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cache, lru_cache
from itertools import pairwise
from typing import Literal

import numpy as np

from cmm_uq.base.points import Floats
from cmm_uq.base.values import dataclass, field, replace
from cmm_uq.jobs.columns import COORDINATES, OPTIONAL
from cmm_uq.jobs.importing.blocks import DATED, Block, CutSheet, heading
from cmm_uq.jobs.importing.cells.figures import SMALL, unit_of
from cmm_uq.jobs.importing.factors import LINE, Label, hint
from cmm_uq.jobs.importing.format import LENGTH, UNITS, NotReadError, WrittenUnit, converted, sort_of, unit_named
from cmm_uq.jobs.importing.header import WORD, Header, plain_words, understood, unspaced, without_unit, words_of
from cmm_uq.jobs.importing.lengths.places import DIRECTION

Role = Literal["summary", "deviation", "reference", "measured", "target", "nominal"]
_IN_TURN: tuple[Role, ...] = ("summary", "deviation", "reference", "measured", "target", "nominal")
# roles that a column has by its name in the job, and which words then give no other column
_OF_NAMES: Mapping[Role, str] = {
    "reference": "reference_mm nominal_mm", "measured": "length_mm", "deviation": "deviation_um deviation_mm"
}  # fmt: skip
_ROLES = {name: role for role, names in _OF_NAMES.items() for name in names.split()}
_CLAIMS: Mapping[Role, tuple[Role, ...]] = {"reference": ("reference", "nominal", "target")}
_ABBREVIATED = re.compile(r"[^\W\d_]{4,}(?=\.)")
_DEGREES, _SECONDS = re.compile(r"°(?![CFcf])|\bdeg\b"), re.compile(r"[\[(][\"″][\])]|\barc ?sec")
_RELATIVE = re.compile(
    r"(?i)(?<![^\W_])ppm(?![^\W_])|[µμu]m ?/ ?m(?![^\W_])|мкм ?/ ?м(?![^\W_])"
)  # to a length, and none itself
_FURTHER = tuple(name for name in OPTIONAL if name != "repeat" and not name.startswith("reference"))
_NUMBERED = 0.05  # lines may be 1.1 and 1.2, and are no finer figures
_INFLECTED = 7  # letters of a word of which the last may be another
_FINER = 50  # times, that lengths are printed finer than the places where they were measured
_COARSE = 0.05  # mm: figures printed no finer than this are nominal, and exact
Labels = dict[tuple[str, str], str]  # what stands beside an observation, by sort and words


def like(a: Floats, b: Floats, far: float = 0.04) -> bool:
    """Whether two columns are one length each, row by row, to a part of 0.002 or ``far``."""
    both = np.isfinite(a) & np.isfinite(b)
    return bool(both.any()) and bool((np.abs(a - b)[both] <= np.maximum(0.002 * np.abs(a), far)[both]).all())


@dataclass
class FigureColumn:
    i: int
    path: list[str]
    values: Floats
    step: float
    unit: WrittenUnit | None
    role: Role | None
    stated: bool = False  # whether the job says the role

    @property
    def full(self) -> bool:
        return bool(np.isfinite(self.values).all())

    @property
    def may_be_length(self) -> bool:
        return self.unit is None or self.unit.sort == LENGTH

    @property
    def minute(self) -> bool:
        """Whether it is in a unit of deviations."""
        return self.unit is not None and self.unit.name in SMALL

    @property
    def heading(self) -> str:
        return heading(self.path)

    @property
    def counts(self) -> bool:
        """Whether its figures are 1, 2, 3 and on, or begin with 0."""
        own = np.unique(self.values[np.isfinite(self.values)])
        return bool(own[0] in (0, 1) and np.array_equal(own, np.arange(own[0], own[0] + len(own))))

    @property
    def round(self) -> bool:
        """Whether its figures are whole, to two digits behind the point at most in none of them."""
        own = self.values[np.isfinite(self.values)]
        return bool(np.all(np.abs(own - np.round(own, 1)) < 1e-6))

    @property
    def counted(self) -> set[str]:
        """Its head, and the lowest part of it, with one figure for each number; nothing where it has none."""
        texts = (self.heading, *(text for text in self.path[-1:] if any(map(str.isdigit, text))))
        return {re.sub(r"\d+", "0", text.strip()) for text in texts}

    @property
    def downwards(self) -> Floats:
        """Each figure in the rows below it too that have none."""
        there = np.flatnonzero(np.isfinite(self.values))
        return self.values[there[np.searchsorted(there, np.arange(len(self.values)), side="right") - 1]]

    @property
    def is_length(self) -> bool:
        """Whether words call it a length."""
        return names_length(self.path)

    @property
    def deviates(self) -> bool:
        """Whether it says that it holds deviations."""
        return self.role == "deviation" or (self.role in (None, "measured") and self.minute)

    @property
    def named(self) -> bool:
        """Whether words say what it is."""
        return bool(self.role or self.is_length or any(hint(without_unit(one)[0], lengths=True) for one in self.path))

    def factors(self, length: FigureColumn) -> tuple[float, ...]:
        """By what deviations are multiplied to be in the unit of lengths."""
        if self.unit is not None and length.unit is not None and self.unit.sort == length.unit.sort == LENGTH:
            return ((self.unit.up / self.unit.down) / (length.unit.up / length.unit.down),)
        return (1.0, 1e-3, 1e-4, 1e-6, *((1 / 25.4, 1 / 25400) if length.unit is None or self.unit is None else ()))

    def slack(self, measured: FigureColumn, reference: FigureColumn, factor: float) -> float:
        """By what deviations differ from measured minus reference where all are rounded to their printed digits."""
        step = self.step * factor + sum(one.step for one in (measured, reference) if one.step < _COARSE)
        return 0.525 * step + 1e-9

    def agrees(self, measured: FigureColumn, reference: FigureColumn, factor: float) -> bool:
        """Whether deviations are measured minus reference to the last printed digits."""
        away = np.abs(measured.values - reference.values - self.values * factor)
        away = away[np.isfinite(away)]
        return away.size > 0 and bool((away <= self.slack(measured, reference, factor)).all())

    def sums_up(self, others: Sequence[FigureColumn], *, worst: bool = False) -> bool:
        """Whether it is the mean, range or standard deviation of others; with ``worst`` also the largest of them.

        One whose head counts as theirs do is another run, though the last printed digit would let it be their mean.
        """
        alike = any(self.counted & o.counted and o.heading != self.heading for o in others)
        own = np.column_stack([one.values for one in others]) if len(others) > 1 and not alike else np.array([np.nan])
        if not np.isfinite(own).all() or not self.full:
            return False
        step = self.step / 2 + max(one.step for one in others) / 2
        far = own[np.arange(len(own)), np.abs(own).argmax(axis=1)]
        sums = [own.mean(axis=1), np.ptp(own, axis=1), own.std(axis=1, ddof=1)]
        sums += [own.max(axis=1), own.min(axis=1), far, np.abs(far)] if worst else []
        return any(bool((np.abs(self.values - one) <= 1.05 * step + 1e-9).all()) for one in sums)


@dataclass
class SheetReading:
    """Observations of a sheet, in order: labels beside each, and figures in the units of the file."""

    kind: str  # lengths, points or runs
    unit: WrittenUnit | None = None
    small: WrittenUnit | None = None  # of deviations
    checked: int = 0  # columns that arithmetic confirms
    deviations: bool = False  # whether measured lengths are references and deviations together
    rows: list[int] = field(default_factory=list)  # of the sheet
    lines: list[int] = field(default_factory=list)  # of the file
    labels: list[Labels] = field(default_factory=list)
    figures: list[tuple[float, ...]] = field(default_factory=list)  # reference, measured; x, y, z; target, deviation
    taken: dict[str, Sequence[FigureColumn]] = field(default_factory=dict)  # by column of a recording
    read: set[int] = field(default_factory=set)  # numbers of columns beside those taken that are in it
    positions: bool = False  # of runs: whether they are what positions were reached less their targets
    covariates: dict[str, list[float]] = field(default_factory=dict)  # further columns of a recording, in their units
    blank: list[tuple[int, int]] = field(default_factory=list)  # row and column of measured values that are not there
    bare: Sequence[int] = ()  # numbers of columns that no head names
    others: Sequence[int] = ()  # rows that belong to it
    passed: Sequence[str] = ()  # of runs: heads of columns, and titles of rows, of other errors of the axis
    beside_lengths: bool = False  # whether they are places beside something else, as where a length was measured
    planned: bool = False  # whether lengths beside them say so
    summaries: list[int] = field(default_factory=list)  # rows of another table, of means of this one
    beside: list[Labels] = field(default_factory=list)  # of each row
    further: dict[str, Floats] = field(default_factory=dict)
    told: Sequence[str] = ()  # of rows that are left out: where, and why

    @property
    def source(self) -> list[FigureColumn]:
        """Columns of what was measured."""
        return [c for name, own in self.taken.items() for c in own if name not in ("reference_mm", "target")]

    @property
    def called(self) -> bool:
        """Whether words say which columns are references or targets."""
        return any(c.role for name in ("reference_mm", "target") for c in self.taken.get(name, ()))

    @property
    def on_lines(self) -> bool:
        """Whether a column beside its figures names lines."""
        return any(k[0] == "column" and hint(words_above(k), lengths=True) == "line" for k in self.beside[0])

    @property
    def every_label(self) -> list[Label]:
        """Labels of all observations; those that are not there for each have none."""
        keys = dict.fromkeys(key for own in self.labels for key in own if key[0] != "place")
        ordered = sorted(keys, key=lambda key: key[0] != "sheet")
        return [Label(words_above(key), tuple(own.get(key, "") for own in self.labels), key[0]) for key in ordered]

    def collect(
        self, grid: CutSheet, rows: Sequence[int], columns: Sequence[FigureColumn], more: Sequence[int] = ()
    ) -> None:
        """What stands beside the columns that are taken: labels, and such as temperatures and directions of approach."""
        used = {c.i for own in self.taken.values() for c in own} | {*more}
        called = {c.i: grid.named(c.i, c.path) or understood(c.heading).column or "" for c in columns}
        for c in columns:
            name, sort = called[c.i], sort_of(called[c.i])
            way = self.kind == "lengths" and name in ("nx", "ny", "nz")  # of the line, and no normal of a surface
            other = sort and c.unit and sort[0] != c.unit.sort
            if c.i not in used and name in _FURTHER and c.full and not (way or other):
                self.further[name] = converted(c.values, c.unit, name) if c.unit and sort else c.values
        of_way = [] if self.kind != "lengths" else grid.columns_of_places(rows[0]).get(DIRECTION, [])  # and no names
        used |= {*of_way} if len(of_way) == len(COORDINATES) else set()
        self.beside = _beside(grid, rows, used | {c.i for c in columns if c.role == "deviation" and c.minute})
        self.read |= {c.i for c in columns if called[c.i] in self.further and c.i not in used}

    def unused(self, grid: CutSheet, head: Header, used: Sequence[str], *, placed: bool = False) -> list[str]:
        """Heads of columns with anything in the rows that are read, neither taken nor in what tells observations apart."""
        words = {word.casefold() for word in used}
        places = grid.places[grid.block_of[self.rows[0]].number] if placed else {}
        beside = self.read.union(*(three for three in places.values() if len(three) == len(COORDINATES)))
        for (sort, name), text in ((key, text) for labels in self.labels for key, text in labels.items()):
            i, _, above = name.partition(" ")
            if sort == "column" and not words.isdisjoint((above.strip().casefold(), *WORD.findall(text.casefold()))):
                beside.add(int(i))
        left = [i for i in head.unused if i not in beside and any(grid.text(row, i) for row in self.rows)]
        return list(dict.fromkeys(head.headings[i].strip() for i in left))

    def add(
        self, row: int, k: int, column: FigureColumn, beside: Sequence[FigureColumn], figures: tuple[float, ...]
    ) -> None:
        """An observation: row ``k`` of the columns, in ``column`` of those side by side."""
        self.rows.append(row)
        self.labels.append({**self.beside[k], **_heads_of(column, beside)})
        self.figures.append(figures)
        for name, values in self.further.items():
            self.covariates.setdefault(name, []).append(float(values[k]))


def at_places(columns: Iterable[tuple[str | None, float]], coarse: float) -> bool:
    """Whether calibrated and measured lengths, columns by role and step, are far finer than the places beside them."""
    roles = {role for role, step in columns if step * _FINER <= coarse}
    return not roles.isdisjoint({"reference", "nominal"}) and not roles.isdisjoint({"measured", "run"})


def names_length(path: Sequence[str]) -> bool:
    """Whether words above a column call it a length; in a language without blanks a word may have another in it."""
    known, every = words_of("lengths")["length"], [without_unit(text)[0] for text in path]
    words = [word for text in every for word in plain_words(text)]
    parts = [one for one in known if len(one) > 1]
    return any(word in known or (unspaced(word) and any(one in word for one in parts)) for word in words)


@lru_cache(maxsize=4096)  # thousands of cells have the same words
def said(*path: str) -> Role | None:
    """The role that the words above a column say: that of a mean ahead of what it is of, in Asian words the longest."""
    texts = [without_unit(text.replace("\n", " "))[0] for text in path]
    # ``Line E`` is no error
    texts = [" ".join(own for own in t.split() if len(own) > 1) if hint(t, lengths=True) == LINE else t for t in texts]
    words = [word for text in texts for word in plain_words(text)]
    short = [own[-1] for text in texts for part in _ABBREVIATED.findall(text) if (own := plain_words(part))]
    of = words_of("lengths")
    inflected = {word[:-1] for word in words if len(word) >= _INFLECTED}
    exact = (role for role in _IN_TURN if not of[role].isdisjoint(words) or not _stems(role).isdisjoint(inflected))
    abbreviated = (role for role in _IN_TURN if any(one.startswith(part) for part in short for one in of[role]))
    if (role := next(exact, None) or next(abbreviated, None)) is not None:
        return role
    asian = [word for word in words if unspaced(word)]
    fits = [(len(one), role) for role in _IN_TURN if asian for one in of[role] if any(one in w for w in asian)]
    return max(fits)[1] if fits and max(fits)[0] > 1 else None


@cache
def _stems(role: Role) -> frozenset[str]:
    """Words of a role without the last letter, which is another in other genders and numbers."""
    return frozenset(word[:-1] for word in words_of("lengths")[role] if len(word) >= _INFLECTED)


def columns_in(grid: CutSheet, blocks: Sequence[Block], rows: Sequence[int]) -> list[FigureColumn]:
    """Columns with figures; a figure that stands in the first of its rows alone is that of all."""
    roles, found = [_ROLES[name] for name in grid.keys if name in _ROLES], []
    claimed = {one for role in roles for one in _CLAIMS.get(role, ("measured", "deviation"))}
    for i in range(grid.width):
        path = blocks[0].paths[i] if i < len(blocks[0].paths) else [""]
        values, steps = grid.column(rows, i)
        if not np.isfinite(values).any():
            continue
        role = said(*path) or ("measured" if any(hint(text, lengths=True) == "run" for text in path) else None)
        relative = UNITS["ppm"] if any(map(_RELATIVE.search, path)) else None
        unit, name = relative or unit_of(path) or grid.unit_in(rows, i), grid.named(i, path)
        if grid.keys:
            role = _ROLES.get(name, "summary" if name or role in claimed else role)
            unit = unit or (UNITS[name[-2:]] if name.startswith("deviation_") else None)
        found.append(FigureColumn(i, path, values, float(min(steps[np.isfinite(values)])), unit, role, name in _ROLES))
    heads = [" ".join(one.path) for one in found]
    if heads and not grid.keys and _DEGREES.search(heads[0]) and any(map(_SECONDS.search, heads)):
        what = "angles in ° beside readings in seconds of arc: of a rotary table or an angular run, and no lengths"
        fix = "Write them as a recording of a polygon (docs/reference/columns.md); where they are inches, say it by columns"
        raise NotReadError(what, where=grid.at(rows[0]), fix=fix)
    _deny_summaries(found)
    for c, after in pairwise(found):  # below one head over several columns
        alike = (
            after.i == c.i + 1 and c.role in ("measured", "deviation") and (c.step, c.full) == (after.step, after.full)
        )
        if alike and any(c.path) and not any(after.path):
            after.path, after.role, after.unit = c.path, c.role, c.unit
    return found


def _deny_summaries(columns: Sequence[FigureColumn]) -> None:
    """Columns that are alike row by row and all called a summary, as by a word that is also one for a diameter, are none."""
    fine = [c for c in columns if not c.minute and not c.counts and np.nanmedian(np.abs(c.values)) > 1]
    for c in (one for one in fine if one.role == "summary"):
        alike = [o for o in fine if like(c.values, o.values)]
        if len(alike) > 1 and all(o.role == "summary" for o in alike):
            for o in alike:
                words = [" ".join(word for word in plain_words(t) if said(word) != "summary") for t in o.path]
                o.role = said(*words)


def said_by(name: str, columns: Sequence[FigureColumn], more: str) -> str:
    """How a message asks for columns."""
    quoted = ", ".join(f'"{c.heading}"' for c in columns)
    return f"Say which: columns = {{ {name} = {quoted if len(columns) == 1 else f'[{quoted}]'} }}{more}"


def _heads_of(column: FigureColumn, beside: Sequence[FigureColumn]) -> Labels:
    """Labels by the head of a column, a level each, where columns beside it differ."""
    found, place = Labels(), [c.i for c in beside].index(column.i)
    for level in range(len(column.path)):
        whole = [c.path[level].strip() for c in beside]
        texts = [without_unit(text)[0].strip() for text in whole]
        texts = texts if len({*texts}) == len({*whole}) else whole  # as Run 1 (+)
        if len({*texts}) > 1 and not unit_named(texts[0]):
            found["head", f"{level}"] = texts[place]
    return found or ({("head", "0"): f"{place + 1}"} if len(beside) > 1 else {})


def _beside(grid: CutSheet, rows: Sequence[int], used: set[int]) -> list[Labels]:
    """Names and numbers that stand beside rows, and titles above them."""
    out: list[Labels] = [{} for _ in rows]
    paths = grid.block_of[rows[0]].paths
    lined = named = False
    bare: dict[int, str] = {}
    for i in sorted({*range(len(paths))} - used):
        cells = [grid.text(row, i) for row in rows]
        said_to_be = grid.named(i, paths[i])
        name = "run" if said_to_be == "repeat" else said_to_be or heading(paths[i])
        of_line = hint(name, lengths=True) == "line"
        if of_line and not cells[0]:
            bare[i] = name
            lined |= any(cells)
        named |= bool(cells[0]) and (of_line or (len({*cells}) > 1 and not all(map(str.isdecimal, cells))))
        finest = min((n[1] for n in (grid.figure(row, i) for row in rows) if n is not None), default=1.0)
        decimals = finest < (_NUMBERED if of_line else 1)
        if decimals or not cells[0] or any(DATED.search(cell) for cell in cells[:3]):
            continue
        last = ""
        for labels, cell in zip(out, cells, strict=True):
            labels["column", f"{i} {name}"] = last = cell or last
    out[0] |= {("unnamed", grid.at(rows[0], i)): name for i, name in bare.items() if lined or not named}
    for labels, row in zip(out, rows, strict=True):
        block = grid.block_of[row]
        labels |= {("title", first): text for first, text in block.titles[row].items()}
        labels["block", ""] = f"{block.number}"
    return out


def joined(readings: Sequence[SheetReading]) -> SheetReading:
    """Readings of several blocks or sheets as one."""
    whole = replace(readings[0], checked=sum(one.checked for one in readings))
    for one in readings[1:]:
        whole.lines, whole.labels = whole.lines + one.lines, whole.labels + one.labels
        whole.figures = whole.figures + one.figures
    alike = [name for name in whole.covariates if all(name in one.covariates for one in readings)]
    whole.covariates = {name: [value for one in readings for value in one.covariates[name]] for name in alike}
    return whole


def words_above(key: tuple[str, str]) -> str:
    """Of a label, by its key."""
    return key[1].partition(" ")[2] if key[0] == "column" else key[1]


def each(grid: CutSheet) -> Iterator[tuple[list[Block], list[int]]]:
    """Blocks below the same head, with their rows; units in a row of their own hold on below a head that comes again."""
    by_head: dict[tuple[object, ...], list[Block]] = {}
    for block in grid.blocks:
        own = [unit.name if (unit := unit_of(path)) else "" for path in block.paths]
        heads = [[t for t in path if t and not unit_named(t.strip("[]()<>{} "))] for path in block.paths]
        keys = [key for key in by_head if key[0] == str(heads)] if not any(own) else []
        by_head.setdefault(keys[-1] if keys else (str(heads), *own), []).append(block)
    for blocks in by_head.values():
        yield blocks, [row for block in blocks for row in block.rows]
