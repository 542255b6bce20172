"""A sheet cut into blocks: rows of figures, the head above them (one to four rows, units among them), and their titles.

A head holds until another one stands above figures; titles hold until another one that begins with the same word. Nothing is
read here: which column is what follows from words and figures together (:mod:`~cmm_uq.jobs.importing.roles`).
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import pairwise

import numpy as np

from cmm_uq.base.points import Floats
from cmm_uq.base.values import dataclass, field
from cmm_uq.jobs.importing import format as formats
from cmm_uq.jobs.importing.cells.figures import figure, sign_of, unit_of
from cmm_uq.jobs.importing.factors import LINE, RUN, begun, counts_pages, hint, says_role
from cmm_uq.jobs.importing.format import LENGTH, UNITS, NotReadError, Sheet, WrittenUnit, apart, unit_named
from cmm_uq.jobs.importing.header import COVERAGE, WORD, named_alike, without_unit
from cmm_uq.jobs.importing.lengths import places
from cmm_uq.jobs.importing.lengths.place_columns import place_columns

_RULE = re.compile(r"[-=_*+|.\s]*")
DATED = re.compile(r"\d{4}[./-]\d{1,2}[./-]\d{1,2}|\d{1,2}[./-]\d{1,2}[./-]\d{2,4}|\d:\d\d|年")
_PRINTED, _BRACKETS = re.compile(r"\d[.,]\d"), re.compile(r"\([^)]*\)")
_FORMULA = re.compile(r"(?s)(?<=\S)(?<![XYZxyz])(?<![(\[ ,;]k)\s*[=＝](?=.*[^\W\d]).*")  # how a column was computed
_LETTERED = re.compile(r"(?:\b[Xx] [Yy] [Zz]|\b[Ii] [Jj] [Kk])$")
_WITH_VALUE = re.compile(r":\s*[-+]?\d+[.,]\d+\s*°")
_SPREAD = re.compile(r"\d\s?[sσ]")  # above a column, and no figure
_PAIRS = re.compile(r"\s+(?=[^\W\d_]+\.?\s*:\s)")  # between titles in one row, as ``Position : XY  Run : 1``
DEEPEST = 4  # rows of a head
_ROLES = 2  # columns of a head that are called measured, nominal or deviations
_TITLES = 3  # between a head and its figures, at most
_SEVERAL = 3  # places in a row, more than a line has


def heading(path: Sequence[str]) -> str:
    return " ".join(dict.fromkeys(" ".join(text.split()) for text in path if text))


@dataclass
class Block:
    """Rows of figures below one head: ``paths`` are the texts of each column's head, from above."""

    paths: list[list[str]]
    rows: list[int] = field(default_factory=list)  # indices in the sheet
    titles: dict[int, dict[str, str]] = field(default_factory=dict)  # of each row
    above: list[int] = field(default_factory=list)  # rows of text and of other figures since the block before
    number: int = 0
    head: list[int] = field(default_factory=list)


class CutSheet:
    """Cells of a sheet as figures, cut into blocks."""

    def __init__(self, sheet: Sheet, keys: Mapping[str, formats.Sources] | None = None, where: str = "") -> None:
        self.sheet, self.keys, self.where = sheet, dict(keys or {}), where
        self.sign = sheet.decimal or sign_of(sheet.rows)
        self.width = max(map(len, sheet.rows), default=0)
        self.figures = [[None if c == "" else figure(c, self.sign) for c in row] for row in sheet.rows]
        self.matched: set[str] = set()  # of what the job calls columns, what is there
        self.above: dict[int, list[str]] = {}  # of each row of figures, the title of its line and what follows it
        self.places: dict[int, dict[str, list[int]]] = {}  # of coordinates of lines, by block
        self.touched: dict[int, float] = {}  # to which step starts and ends are printed, where they were measured
        self.blocks = self._titled(list(self._blocks()))
        self.block_of = {row: block for block in self.blocks for row in block.rows}
        self.ends = {row for block in self.blocks for row in block.rows[named_alike(self.sheet.rows, block.rows) :]}

    def at(self, row: int, i: int | None = None) -> str:
        """Place of a row or a cell, for messages."""
        return self.sheet.at(self.where, row, i, "" if i is None else " ".join(self.path(row, i)))

    def no_value(self, row: int, i: int) -> NotReadError:
        return NotReadError("no value", where=self.at(row, i), fix="Complete the row, or take it out")

    def text(self, row: int, column: int) -> str:
        cells = self.sheet.rows[row]
        cell = cells[column] if column < len(cells) else ""
        return cell.strip() if isinstance(cell, str) else f"{cell:g}"

    def figure(self, row: int, i: int) -> tuple[float, float] | None:
        """Value and step of a cell; ``None`` where there is no figure."""
        return self.figures[row][i] if i < len(self.figures[row]) else None

    def column(self, rows: Sequence[int], i: int) -> tuple[Floats, Floats]:
        """Values and steps of a column; NaN where there is no figure."""
        own = [self.figure(row, i) or (np.nan, 0.0) for row in rows]
        return np.array([value for value, _ in own]), np.array([step for _, step in own])

    def place(self, i: int) -> bool:
        """Whether a row says the place of a line."""
        return places.said_in([self.line(i)], self.sign).whole

    def line(self, row: int) -> str:
        return " ".join(self.text(row, k) for k in range(len(self.sheet.rows[row]))).strip()

    def unit_in(self, rows: Sequence[int], i: int) -> WrittenUnit | None:
        """The unit that every cell of a column has after its figure."""
        parts = [apart(self.text(row, i).lstrip("±")) for row in rows if self.text(row, i)]
        return parts[0][1] if parts and parts[0] and all(part and part[1] == parts[0][1] for part in parts) else None

    def other_quantity(self, row: int) -> bool:
        """Whether a row names a unit that is none of lengths."""
        return any(self._of_another(row, k) for k in range(len(self.figures[row])))

    def _of_another(self, row: int, k: int) -> bool:
        text = self.text(row, k)
        bare = self.figures[row][k] is None
        unit = unit_named(text) if bare else (apart(text) or ("", None))[1]
        unit = without_unit(text)[1] if bare and unit is None and "°" in text else unit
        return unit is not None and unit.sort != LENGTH

    def unit_beside(self, rows: Sequence[int]) -> WrittenUnit | None:
        """The unit that a column names in every row."""
        rows = [row for row in rows if not self.other_quantity(row)]
        for i in range(self.width):
            named = {u.name if (u := unit_named(self.text(row, i))) else "" for row in rows}
            if len(named) == 1 and len(name := named.pop()) > 1 and name in UNITS and UNITS[name].sort == LENGTH:
                return UNITS[name]
        return None

    def named(self, i: int, path: Sequence[str]) -> str:
        """What the job says that a column is."""
        whole = " ".join(" ".join(text.split()) for text in path if text)
        own = {f"{i + 1}", *(text.strip().casefold() for text in (whole, *path) if text)}
        every = ((name, str(one)) for name, sources in self.keys.items() for one in formats.sources_of(sources))
        found = [(name, one) for name, one in every if one.replace("\n", " ").strip().casefold() in own]
        self.matched |= {one for _, one in found}
        return found[0][0] if found else ""

    def path(self, row: int, i: int) -> list[str]:
        """Texts above a cell."""
        return self.block_of[row].paths[i] if row in self.block_of else []

    def names_line(self, row: int) -> bool:
        """Whether a row begins what is said of a line, and is no direction below its start."""
        text = self.line(row)
        directed = places.role_among(self.text(row, 0)) == places.DIRECTION and places.says_figures(text)
        return hint(text, lengths=True) == LINE and not directed

    def lettered(self, i: int) -> bool:
        """Whether a row has a letter of an axis a cell, then its figures: ``Start X | Y | Z | 140 | 120 | -640``."""
        filled = [k for k, cell in enumerate(self.sheet.rows[i]) if cell != ""]
        numbers = [k for k in filled if self.figures[i][k] is not None]
        ahead = " ".join(self.text(i, k) for k in filled[:-3])
        return numbers == filled[-3:] == [*range(3, 6)] and _LETTERED.search(ahead) is not None

    def _place_within(self, i: int, numbers: Sequence[int], beside: Sequence[Sequence[int]]) -> bool:
        """Whether figures of a row are of the place of a line, and no text of it alone says that."""
        if (len(numbers) not in (1, 2, 3, 6) and numbers in beside) or not self.place(i):
            return False
        texts = [self.text(i, k) for k in range(len(self.figures[i])) if k not in numbers]
        return not places.said_in(texts, self.sign).whole

    def _is_head(self, i: int) -> bool:
        """Whether a row with figures counts columns, as ``1 2 3 1 2 3``."""
        own = [f for f in self.figures[i] if f is not None]
        counted = [int(f[0]) for f in own if f[1] >= 1 and f[0] == int(f[0])]
        if len(counted) < len(own) or len(own) < 2:
            return False
        steps = [(b - a, b) for a, b in pairwise(counted)]
        runs = hint(self.text(i, 0), lengths=True) == RUN  # as ``Run 1 1 2 2``
        each = all(s == 1 or b in (0, 1) or (runs and s == 0) for s, b in steps)
        return counted[0] in (0, 1) and any(s == 1 for s, _ in steps) and each

    def _kind(self, i: int) -> str:
        """``figures``, ``text``, or ``rule`` of a row."""
        row = self.sheet.rows[i]
        filled = [k for k, cell in enumerate(row) if cell != ""]
        if all(isinstance(row[k], str) and _RULE.fullmatch(row[k]) for k in filled):  # type: ignore[arg-type]
            return "rule"
        numbers = [k for k in filled if self.figures[i][k] is not None and not _SPREAD.fullmatch(self.text(i, k))]
        near = [j for j in (i - 1, i + 1) if 0 <= j < len(self.figures)]
        beside = [[k for k, f in enumerate(self.figures[j]) if f is not None] for j in near]
        if not numbers or self._place_within(i, numbers, beside):
            return "text"
        if self.lettered(i):
            return "text"
        counted = len(filled) == 2 and numbers == filled[1:] and (self.figures[i][filled[1]] or (0, 0))[1] >= 1
        turned = numbers[0] > filled[0] and all(self._of_another(i, k) for k in numbers)
        if (counted or turned) and hint(self.text(i, filled[0]), lengths=True) in (LINE, RUN):
            return "text"  # as Position;1 above a block, or Position 1 | 90 deg
        if self._is_head(i) and i + 1 < len(self.sheet.rows):
            own = [str(cell).strip("[]()<>{} ") for cell in self.sheet.rows[i + 1] if cell != ""]
            below = next((j for j in range(i + 1, min(len(self.figures), i + DEEPEST)) if any(self.figures[j])), i + 1)
            if any((self.figure(below, k) or (0, 1))[1] < 1 for k in numbers) or (own and all(map(unit_named, own))):
                return "text"
        texts = {k for k in filled if k not in numbers and unit_named(self.text(i, k)) is None}
        alike = [j for j, own in zip(near, beside, strict=True) if numbers == own]
        lined = len(texts) > 2 and hint(self.text(i, 0), lengths=True) == LINE  # as ``Axis X | Runs 3 | Targets | 6``
        if lined:
            alike = [j for j in alike if hint(self.text(j, 0), lengths=True) == LINE]
        named = all(k - 1 in texts for k in numbers) and (lined or len(numbers) > 1)
        return "text" if named and not alike else "figures"

    def _blocks(self) -> Iterator[Block]:
        pending: list[int] = []
        titles: dict[str, str] = {}
        last: list[str] = []
        block: Block | None = None
        self.kinds = [self._kind(i) for i in range(len(self.sheet.rows))]
        self._ruled = {self.sheet.lines[i] for i, kind in enumerate(self.kinds) if kind == "rule"}
        kinds = [kind for kind in self.kinds if kind != "rule"]
        most = max(2, sum(two == ("text", "figures") for two in pairwise(kinds)) // 2)
        texts = Counter(self.line(i) for i, kind in enumerate(self.kinds) if kind == "text")
        self._always = {text for text, count in texts.items() if count > most}  # above nearly all figures
        for i, kind in enumerate(self.kinds):
            if kind == "text":
                pending.append(i)
            if kind != "figures":
                continue
            head = self._head(pending, [k for k, f in enumerate(self.figures[i]) if f is not None]) if pending else []
            head = self._without_names(head, block)
            above, pending = [row for row in pending if row not in head], []
            for row in above:
                titles = {**titles, **self._titles(row)}
            if head or block is None:
                if block is not None:
                    yield block
                paths, number = self._paths(head), 1 if block is None else block.number + 1
                if block is not None and paths == block.paths and any(counts_pages(self.line(k)) for k in above):
                    number = block.number  # it goes on
                block = Block(paths, number=number, head=head)
            block.above += above
            block.rows.append(i)
            block.titles[i] = titles
            if above:
                lined = [k for k, row in enumerate(above) if self.names_line(row)]
                told = [self.line(row) for row in above[lined[-1] if lined else max(0, len(above) - DEEPEST) :]]
                told = told if lined or any(hint(text, lengths=True) != RUN for text in told) else last
                last = told
            self.above[i] = last
        if block is not None:
            yield block

    def _without_names(self, head: list[int], block: Block | None) -> list[int]:
        """A head without a row below it that names a feature, as ``Ball 1 | 9 points | outside``, and no column."""
        above = head[:-1] or (block.head if block is not None else [])
        named = sum(says_role(text) for row in above for text in self.sheet.rows[row])
        cells = [str(cell) for cell in self.sheet.rows[head[-1]] if cell != ""] if head else []
        first = bool(cells) and self.text(head[-1], 0) == cells[0] and any(map(str.isdigit, cells[0]))
        if named < _ROLES or not first or len(cells) < 2 or not all(WORD.search(cell) for cell in cells):
            return head
        return head if any(says_role(cell) or unit_of([cell]) for cell in cells) else head[:-1]

    def _titled(self, blocks: list[Block]) -> list[Block]:
        """Blocks, upper rows of whose heads are titles, for they differ where the rows below them are the same."""
        alike: dict[tuple[str, ...], list[Block]] = {}
        for block in blocks:
            if len(block.head) > 1:
                alike.setdefault(tuple(map(str, self.sheet.rows[block.head[-1]])), []).append(block)
        for same in alike.values():
            deep = min(len(block.head) for block in same)
            rows = [{tuple(map(str, self.sheet.rows[block.head[-n]])) for block in same} for n in range(1, deep + 1)]
            kept = next((n for n, own in enumerate(rows) if len(own) == len(same) > 1), deep)
            for block in same if kept < deep else ():
                titles = {key: text for row in block.head[:-kept] for key, text in self._titles(row).items()}
                block.titles = {row: {**own, **titles} for row, own in block.titles.items()}
                block.head = block.head[-kept:]
                block.paths = self._paths(block.head)
        before, last = dict[str, str](), dict[str, str]()
        for block in blocks:  # titles of a head hold on
            for row, own in block.titles.items():
                last |= {key: text for key, text in own.items() if before.get(key) != text}
                block.titles[row], before = {**own, **last}, own
        return blocks

    def columns_of_places(self, row: int) -> dict[str, list[int]]:
        """Columns of starts, ends and directions of lines, in the block of a row."""
        if (block := self.block_of[row]).number not in self.places:
            self.places[block.number] = place_columns(self, block)
        return self.places[block.number]

    def says(self, row: int) -> tuple[str, ...]:
        """What may say where the line of a row lies: titles above it, texts beside it, columns of starts and ends."""
        block, texts = self.block_of[row], [*self.above.get(row, ())]
        columns = self.columns_of_places(row)
        for i, own in enumerate(self.figures[row]):
            if own is None and (text := self.text(row, i)):
                role = places.role_among(heading(block.paths[i]) if i < len(block.paths) else "")
                texts.append(f"{role} {text}" if role in (places.START, places.END) else text)
        first = min((i for own in columns.values() for i in own), default=0)
        values = {role: self._held(row, own, first) for role, own in columns.items()}
        if here := values.pop("", []):
            ahead = (self.text(row, first - 1), *block.paths[first - 1]) if first else ()
            values |= dict.fromkeys([*filter(None, map(places.role_among, ahead))][:1], here)
        if all(values.get(angle) for angle in places.ANGLES):
            azimuth, elevation = (np.radians(values.pop(angle)[0]) for angle in places.ANGLES)
            across = np.cos(elevation)
            values[places.DIRECTION] = [across * np.cos(azimuth), across * np.sin(azimuth), np.sin(elevation)]
        # what was touched lies elsewhere each time
        digits = max(1, round(-np.log10(1000 * self.touched.get(block.number, 1e-13))))
        said = {of: "; ".join(f"{one:.{digits}f}".rstrip("0").rstrip(".") for one in own) for of, own in values.items()}
        whole = {of: len(own) == 3 for of, own in values.items() if len(own) == 3 or of in {*"XYZ"}}
        texts += [f"{of} ({said[of]})" if three else f"{of} = {said[of]}" for of, three in whole.items()]
        return tuple(texts)

    def _held(self, row: int, columns: Sequence[int], first: int) -> list[float]:
        """Figures of a row in columns, or of the row above that they hold on from, where nothing stands ahead of ``first``."""
        rows = self.block_of[row].rows
        for k in range(rows.index(row), -1, -1):
            found = [f[0] for i in columns if (f := self.figure(rows[k], i))]
            if found or any(self.text(rows[k], i) for i in range(first)):
                return found
        return []

    def placed(self, rows: Iterable[int]) -> bool:
        """Whether all rows say where their lines lie."""
        return all(places.said_in(self.says(row), self.sign).whole for row in rows)

    def _titles(self, row: int) -> dict[str, str]:
        """Titles in a row of text, by the word that each begins with; without one where it has nothing else."""
        cells = [str(cell) for cell in self.sheet.rows[row] if cell != ""]
        text = self.line(row)
        if placed := self.place(row):
            text = places.without_place(text, self.sign)
        pairs = _PAIRS.split(text)
        parts = pairs if all(":" in pair for pair in pairs) else [text]
        parts = cells if len(cells) > 1 and all(hint(cell, lengths=True) for cell in cells) else parts
        if any(counts_pages(part) for part in parts):
            return {}
        titles = {(begun(first[0]) if (first := WORD.search(part)) else part): part for part in parts}
        return {**titles, "": text} if placed or (len(cells) == 1 and text not in self._always) else titles

    def _head(self, pending: Sequence[int], numbers: Sequence[int]) -> list[int]:
        """Rows of a head at the end of rows of text, above a row with figures in these columns."""
        head: list[int] = []
        for row in reversed(pending):
            filled = [k for k, cell in enumerate(self.sheet.rows[row]) if cell != ""]
            alone = len(filled) == 1 and (filled == [0] or ": " in self.text(row, filled[0]))
            alone = alone or (len(filled) < 3 and _WITH_VALUE.search(self.line(row)) is not None)
            if not head and alone and len(numbers) > 1:  # a title below its head
                if pending[-1] - row < _TITLES:
                    continue
                break
            between = range(self.sheet.lines[row] + 1, self.sheet.lines[head[0]] if head else 0)
            texts = [self.text(row, k) for k in filled]
            few = [text for text in texts if "=" in COVERAGE.sub("", text)] if len(filled) < 4 else []
            odd = any(not (says_role(text) or places.says_figures(text)) for text in few)
            odd |= any(len(text) > 60 or len(_PRINTED.findall(_BRACKETS.sub("", text))) > 1 for text in texts)
            odd = odd or 0 < sum(DATED.search(text) is not None for text in texts) < 3 or counts_pages(self.line(row))
            over = [k for k in filled if k in numbers]
            said = sum(map(places.says_figures, texts))
            each = (over == filled or not said) and len(over) + 1 >= len(numbers)  # then they stand above columns
            placed = self.place(row) and not each and said < _SEVERAL
            if len(head) == DEEPEST or odd or not self._ruled.issuperset(between) or placed:
                break
            apart = not head and (len(filled) < 2 or not over) and filled != over
            # the last of them stands over all that follow
            below = self.text(head[0], 0) if head and 0 in numbers else "."
            first = unit_named(below.strip("()[]")) or (not below and unit_of(texts[:1]))  # named there alone
            grouped = filled == [*range(len(filled))] and (first or len(filled) > 2)
            ahead = head and ((2 * filled[-1] < numbers[-1] and not grouped) or texts[0].endswith(":") or filled == [0])
            if apart or ahead or any(f is not None and f[1] < 1 for f in self.figures[row]):
                break
            if head and self._titles_above(row, filled, head, numbers):
                break
            head.insert(0, row)
        return head

    def _titles_above(self, row: int, filled: Sequence[int], head: Sequence[int], numbers: Sequence[int]) -> bool:
        """Whether a row is of titles (``Axis: Y``, or in the first cells alone) above heads that name each column."""
        paths = self._paths(head)
        each = [self.text(row, k) for k in filled]
        named = len(filled) > 1 and len({heading(paths[k]) for k in numbers} - {""}) == len(numbers)
        packed = filled == [*range(len(filled))] and len(filled) < sum(map(any, paths))
        known = all(says_role(text) or unit_of([text]) or hint(text, lengths=True) for text in each)
        return named and ((packed and not known) or all(":" in text[:-1] for text in each))

    def _paths(self, head: Sequence[int]) -> list[list[str]]:
        """Texts above each column; a text of an upper row stands over the columns up to the next one of it or above it."""
        levels, begun = [], [False] * self.width
        for depth, row in enumerate(head):
            texts = [_FORMULA.sub("", self.text(row, k)) for k in range(self.width)]
            for k, parts in enumerate(text.split() for text in texts):  # abbreviations in one cell, of a column each
                alone = 1 < len(parts) <= self.width - k and all(part.endswith(".") for part in parts)
                if alone and not any(self.text(own, i) for own in head for i in range(k + 1, k + len(parts))):
                    texts[k : k + len(parts)] = parts
            begun = [before or bool(text) for before, text in zip(begun, texts, strict=True)]
            if depth < len(head) - 1:
                below = [any(self.text(lower, k) for lower in head[depth + 1 :]) for k in range(self.width)]
                for k in range(1, self.width):
                    texts[k] = texts[k] or (texts[k - 1] if below[k] and not begun[k] else "")
            levels.append(texts)
        return [[level[k] for level in levels] for k in range(self.width)]
