"""What the columns of a block are, by words and by arithmetic: each says what the other leaves open, and neither may deny it.

Lengths stand in columns that are alike row by row; a deviation is measured minus reference to the printed digit, a mean the
mean of its runs. Coordinates stand below the letters X, Y, Z or beside them; where a nominal value and a deviation stand
beside a third figure, that one is measured.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from cmm_uq.base.points import Floats
from cmm_uq.jobs.columns import OPTIONAL
from cmm_uq.jobs.importing import header
from cmm_uq.jobs.importing.blocks import DATED, SMALL, Block, CutSheet, unit_of
from cmm_uq.jobs.importing.factors import LINE, RUN, Label, hint
from cmm_uq.jobs.importing.format import LENGTH, UNITS, Cell, WrittenUnit, converted, sort_of, unit_named
from cmm_uq.jobs.importing.header import plain_words, understood, unspaced, without_unit, words_of

SUMMARY, DEVIATION, MEASURED, REFERENCE, NOMINAL, TARGET = (
    "summary",
    "deviation",
    "measured",
    "reference",
    "nominal",
    "target",
)
_ROLES = {
    "reference_mm": REFERENCE,
    "nominal_mm": REFERENCE,
    "length_mm": MEASURED,
    "deviation_um": DEVIATION,
    "deviation_mm": DEVIATION,
}
_CLAIMS = {REFERENCE: {REFERENCE, NOMINAL, TARGET}, MEASURED: {MEASURED, DEVIATION}, DEVIATION: {DEVIATION, MEASURED}}
_SEVERAL = re.compile(r"([+-]?\d+[.,]\d+\s+){1,}[+-]?\d+[.,]\d+")
_ABBREVIATED = re.compile(r"[^\W\d_]{4,}(?=\.)")
_FURTHER = tuple(name for name in OPTIONAL if name != "repeat" and not name.startswith("reference"))


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
    labels: list[dict[tuple[str, str], str]] = field(default_factory=list)  # by sort and words
    figures: list[tuple[float, ...]] = field(default_factory=list)  # reference, measured; x, y, z; target, deviation
    taken: dict[str, Sequence[FigureColumn]] = field(default_factory=dict)  # by column of a recording
    unused: list[str] = field(default_factory=list)
    positions: bool = False  # of runs: whether they are what positions were reached less their targets
    covariates: dict[str, list[float]] = field(default_factory=dict)  # further columns of a recording, in their units
    blank: list[tuple[int, int]] = field(default_factory=list)  # row and column of measured values that are not there
    bare: Sequence[int] = ()  # numbers of columns that no head names
    others: Sequence[int] = ()  # rows that belong to it
    beside: list[dict[tuple[str, str], str]] = field(default_factory=list)  # labels of each row
    further: Mapping[str, Floats] = field(default_factory=dict)

    @property
    def columns(self) -> set[int]:
        return {c.i for name, own in self.taken.items() for c in own if name not in ("reference_mm", "target")}

    def collect(
        self, grid: CutSheet, rows: Sequence[int], columns: Sequence[FigureColumn], more: Sequence[int] = ()
    ) -> None:
        """What stands beside the columns that are taken."""
        used = {c.i for own in self.taken.values() for c in own} | {*more}
        self.further = further_of([c for c in columns if c.i not in used])
        self.beside = _beside(grid, rows, used)
        names = ((c.i, c.heading) for c in columns if understood(c.heading).column not in self.further)
        self.unused = [name for i, name in names if i not in used and name and not hint(name, lengths=True)]

    def add(
        self, row: int, k: int, column: FigureColumn, beside: Sequence[FigureColumn], figures: tuple[float, ...]
    ) -> None:
        """An observation: row ``k`` of the columns, in ``column`` of those side by side."""
        self.rows.append(row)
        self.labels.append({**self.beside[k], **heads_of(column, beside)})
        self.figures.append(figures)
        for name, values in self.further.items():
            self.covariates.setdefault(name, []).append(float(values[k]))


def further_of(columns: Sequence[FigureColumn]) -> dict[str, Floats]:
    """Columns such as temperatures and directions of approach, which a recording has beside its coordinates."""
    found = {}
    for c in columns:
        meaning = understood(c.heading)
        sort = sort_of(meaning.column or "")
        if meaning.column in _FURTHER and c.full and not (sort and c.unit and sort[0] != c.unit.sort):
            found[meaning.column] = converted(c.values, c.unit, meaning.column) if c.unit and sort else c.values
    return found


def known(word: str, role: str) -> bool:
    """Whether a word is one for a role, or, in a language without blanks, has one in it."""
    words = words_of("lengths")[role]
    return word in words or (unspaced(word) and any(len(one) > 1 and one in word for one in words))


def said(path: Sequence[str]) -> str | None:
    """The role that the words above a column say: that of a mean ahead of what it is of, in Asian words the longest."""
    texts = [without_unit(text.replace("\n", " "))[0] for text in path]
    words = [word for text in texts for word in plain_words(text)]
    short = [own[-1] for text in texts for part in _ABBREVIATED.findall(text) if (own := plain_words(part))]
    of, roles = words_of("lengths"), (SUMMARY, DEVIATION, REFERENCE, MEASURED, TARGET, NOMINAL)
    exact = (role for role in roles if not of[role].isdisjoint(words))
    abbreviated = (role for role in roles if any(one.startswith(part) for part in short for one in of[role]))
    if (role := next(exact, None) or next(abbreviated, None)) is not None:
        return role
    asian = [word for word in words if unspaced(word)]
    fits = [(len(one), role) for role in roles for one in of[role] if any(one in word for word in asian)]
    return max(fits)[1] if fits and max(fits)[0] > 1 else None


def heading(path: Sequence[str]) -> str:
    return " ".join(dict.fromkeys(" ".join(text.split()) for text in path if text))


@dataclass
class FigureColumn:
    i: int
    path: list[str]
    values: Floats
    step: float
    unit: WrittenUnit | None
    role: str | None

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


def columns_in(grid: CutSheet, blocks: Sequence[Block], rows: Sequence[int]) -> list[FigureColumn]:
    """Columns with figures; a figure that stands in the first of its rows alone is that of all."""
    found, claimed = [], {one for name in grid.keys if name in _ROLES for one in _CLAIMS[_ROLES[name]]}
    for i in range(grid.width):
        path = blocks[0].paths[i] if i < len(blocks[0].paths) else [""]
        values, steps = grid.column(rows, i)
        if not np.isfinite(values).any():
            continue
        role = said(path) or (MEASURED if any(hint(text, lengths=True) == "run" for text in path) else None)
        unit, name = unit_of(path) or grid.unit_in(rows, i), grid.named(i, path)
        if grid.keys:
            role = _ROLES.get(name, SUMMARY if name or role in claimed else role)
            unit = unit or (UNITS[name[-2:]] if name.startswith("deviation_") else None)
        found.append(FigureColumn(i, path, values, float(min(steps[np.isfinite(values)])), unit, role))
    return found


def like(a: Floats, b: Floats, far: float = 0.04) -> bool:
    """Whether two columns are one length each, row by row, to a part of 0.002 or ``far``."""
    both = np.isfinite(a) & np.isfinite(b)
    return bool(both.any()) and bool((np.abs(a - b)[both] <= np.maximum(0.002 * np.abs(a), far)[both]).all())


_COARSE = 0.05  # mm: figures printed no finer than this are nominal, and exact


def agrees(deviation: FigureColumn, measured: FigureColumn, reference: FigureColumn, factor: float) -> bool:
    """Whether a column is measured minus reference to the last printed digits."""
    step = deviation.step * factor + sum(one.step for one in (measured, reference) if one.step < _COARSE)
    away = np.abs(measured.values - reference.values - deviation.values * factor)
    away = away[np.isfinite(away)]
    return away.size > 0 and bool((away <= 0.525 * step + 1e-9).all())


def _counts_with(a: FigureColumn, b: FigureColumn) -> bool:
    """Whether the heads of two columns are alike but for their numbers."""
    heads = [re.sub(r"\d+", "0", one.heading) for one in (a, b)]
    return heads[0] == heads[1] and a.heading != b.heading


def mean_of(column: FigureColumn, others: Sequence[FigureColumn], *, worst: bool = False) -> bool:
    """Whether a column is the mean, range or standard deviation of others; with ``worst`` also the largest of them.

    One whose head counts as theirs do is another run, though the last printed digit would let it be their mean.
    """
    if len(others) < 2 or any(_counts_with(column, one) for one in others):
        return False
    own = np.column_stack([one.values for one in others])
    if not np.isfinite(own).all() or not column.full:
        return False
    step = column.step / 2 + max(one.step for one in others) / 2
    far = own[np.arange(len(own)), np.abs(own).argmax(axis=1)]
    sums = [own.mean(axis=1), np.ptp(own, axis=1), own.std(axis=1, ddof=1)]
    sums += [own.max(axis=1), own.min(axis=1), far, np.abs(far)] if worst else []
    return any(bool((np.abs(column.values - one) <= 1.05 * step + 1e-9).all()) for one in sums)


def said_by(name: str, columns: Sequence[FigureColumn], more: str) -> str:
    """How a message asks for columns."""
    quoted = [f'"{c.heading}"' for c in columns]
    listed = quoted[0] if len(quoted) == 1 else f"[{', '.join(quoted)}]"
    return f"Say which: columns = {{ {name} = {listed} }}{more}"


def down(values: Floats) -> Floats:
    filled = np.flatnonzero(np.isfinite(values))
    return values[filled[np.searchsorted(filled, np.arange(len(values)), side="right") - 1]]


def factors(deviation: FigureColumn, length: FigureColumn) -> tuple[float, ...]:
    """By what a deviation is multiplied to be in the unit of lengths."""
    if deviation.unit is not None and length.unit is not None and deviation.unit.sort == length.unit.sort == LENGTH:
        return ((deviation.unit.up / deviation.unit.down) / (length.unit.up / length.unit.down),)
    return (1.0, 1e-3, 1e-6)


def heads_of(column: FigureColumn, beside: Sequence[FigureColumn]) -> dict[tuple[str, str], str]:
    """Labels by the head of a column, a level each, where columns beside it differ."""
    found = {}
    for level in range(len(column.path)):
        whole = [c.path[level].strip() for c in beside]
        texts = [without_unit(text)[0].strip() for text in whole]
        texts = texts if len({*texts}) == len({*whole}) else whole  # as Run 1 (+)
        if len({*texts}) > 1 and not unit_named(texts[0]):
            found["head", f"{level}"] = texts[[c.i for c in beside].index(column.i)]
    if len(beside) > 1 and not found:
        found["head", "0"] = f"{[c.i for c in beside].index(column.i) + 1}"
    return found


def _beside(grid: CutSheet, rows: Sequence[int], used: set[int]) -> list[dict[tuple[str, str], str]]:
    """Names and numbers that stand beside rows, and titles above them."""
    of_row = {row: (block, n) for block in grid.blocks for n, row in enumerate(block.rows)}
    out: list[dict[tuple[str, str], str]] = [{} for _ in rows]
    paths = of_row[rows[0]][0].paths
    for i in sorted({*range(len(paths))} - used):
        cells = [grid.text(row, i) for row in rows]
        numbers = [grid.figures[row][i] if i < len(grid.figures[row]) else None for row in rows]
        said_to_be = grid.named(i, paths[i])
        name = "run" if said_to_be == "repeat" else said_to_be or heading(paths[i])
        of_line = hint(name, lengths=True) == "line"
        if of_line and not cells[0]:
            out[0]["unnamed", grid.at(rows[0], i)] = name
        decimals = any(n is not None and n[1] < 1 for n in numbers) and not of_line
        if decimals or not cells[0] or any(DATED.search(cell) for cell in cells[:3]):
            continue
        last = ""
        for k, cell in enumerate(cells):
            last = cell or last
            out[k]["column", f"{i} {name}"] = last
    for k, row in enumerate(rows):
        block, n = of_row[row]
        out[k] |= {("title", first): text for first, text in block.titles[n].items()}
        out[k]["block", ""] = f"{block.number}"
    return out


def unit_beside(grid: CutSheet, rows: Sequence[int]) -> WrittenUnit | None:
    """The unit that a column names in every row."""
    for i in range(grid.width):
        named = {u.name if (u := unit_named(grid.text(row, i))) else "" for row in rows if not grid.other_quantity(row)}
        if len(named) == 1 and len(name := named.pop()) > 1 and name in UNITS and UNITS[name].sort == LENGTH:
            return UNITS[name]
    return None


def joined(readings: Sequence[SheetReading]) -> SheetReading:
    """Readings of several blocks or sheets as one."""
    whole = replace(readings[0], checked=sum(one.checked for one in readings))
    for one in readings[1:]:
        whole.lines, whole.labels = whole.lines + one.lines, whole.labels + one.labels
        whole.figures = whole.figures + one.figures
    alike = [name for name in whole.covariates if all(name in one.covariates for one in readings)]
    whole.covariates = {name: [value for one in readings for value in one.covariates[name]] for name in alike}
    return whole


def labels_of(reading: SheetReading) -> list[Label]:
    """Labels of all observations; those that are not there for each have none."""
    keys = dict.fromkeys(key for own in reading.labels for key in own if key[0] != "place")
    keys = dict.fromkeys(sorted(keys, key=lambda key: key[0] != "sheet"))
    words = {key: key[1].partition(" ")[2] if key[0] == "column" else key[1] for key in keys}
    return [Label(words[key], tuple(own.get(key, "") for own in reading.labels), key[0]) for key in keys]


def each(grid: CutSheet) -> Iterator[tuple[list[Block], list[int]]]:
    """Blocks below the same head, with their rows."""
    by_head: dict[tuple[tuple[str, ...], ...], list[Block]] = {}
    for block in grid.blocks:
        by_head.setdefault(tuple(map(tuple, block.paths)), []).append(block)
    for blocks in by_head.values():
        yield blocks, [row for block in blocks for row in block.rows]


def is_void(row: Sequence[Cell], *tables: str) -> bool:
    """Whether a cell of a row says that it is no measured point or length."""
    known = frozenset().union(*(words_of("rows")[table] for table in tables))
    return any(isinstance(cell, str) and " ".join(plain_words(cell)) in known for cell in row)


def rows_left_out(readings: Sequence[SheetReading], grid: CutSheet) -> list[str] | None:
    """Rows with figures beside those that are read of a sheet; ``None`` where one of them may be measured."""
    rows, columns = {r for one in readings for r in one.rows}, {i for one in readings for i in one.columns}
    taken = rows | {r for one in readings for r in one.others}
    heads, last = {row for block in grid.blocks for row in block.head}, max(taken)
    if any(
        isinstance(cell, str) and _SEVERAL.fullmatch(cell.strip()) for row in taken for cell in grid.sheet.rows[row]
    ):
        return None  # cells that were not cut apart
    told = []
    for row in range(min(taken), len(grid.sheet.rows)):
        if grid.kinds[row] == "text" and row < last and row not in heads and not _counts(grid, row):
            told.append(header.shown(grid.sheet, row, header.REMARK))
        if row in taken or grid.kinds[row] != "figures":
            continue
        figures = [k for k, f in enumerate(grid.figures[row]) if f is not None and (f[1] < 1 or k in columns)]
        within = row < last or grid.sheet.lines[row] - grid.sheet.lines[last] == row - last  # without a gap
        if figures and within and not _explained(grid, row, figures, rows, columns):
            return None
        told += [header.shown(grid.sheet, row, header.SUMMARY)] if figures else []
    blank = [cell for one in readings for cell in one.blank]
    if any(map(str.isdigit, "".join(grid.text(row, i) for row, i in blank))):
        return None
    places = (grid.sheet.at("", row, i, heading(grid.path(row, i))) for row, i in blank)
    return told + [f"{place.removeprefix(': ').strip()}: nothing in the cell" for place in places]


def _counts(grid: CutSheet, row: int) -> bool:
    """Whether a row of text is the title of a line or a run."""
    texts = [grid.text(row, k) for k in range(len(grid.sheet.rows[row])) if grid.text(row, k)]
    return any(hint(text, lengths=True) in (LINE, RUN) for text in texts[:1])


def _explained(
    grid: CutSheet, row: int, figures: Sequence[int], rows: Collection[int], columns: Collection[int]
) -> bool:
    """Whether a row is void or a summary by its words or by arithmetic, or has none of the columns that are read."""
    cells = grid.sheet.rows[row]
    if (
        header.is_summary(cells)
        or is_void(cells, "void", "feature")
        or said([grid.text(row, k) for k in range(len(cells)) if k not in figures]) == "summary"
    ):
        return True
    alone = len(figures) < 2 or {*grid.of_block(row)}.isdisjoint(rows)
    if (alone and {*columns}.isdisjoint(figures)) or grid.other_quantity(row):
        return True
    heads = [text for k in figures for text in grid.path(row, k)]
    if alone and is_void(heads, "feature"):
        return True
    for k in {*figures} & {*columns}:
        above = [
            f[0] for r in grid.of_block(row) if r in rows and k < len(grid.figures[r]) and (f := grid.figures[r][k])
        ]
        value, step = grid.figures[row][k] or (0.0, 1.0)
        sums = (np.mean(above), max(above), min(above), np.ptp(above), np.std(above, ddof=1)) if len(above) > 1 else ()
        if not any(abs(value - one) <= 1.05 * step for one in sums):
            return False
    return True
