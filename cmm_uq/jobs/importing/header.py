"""Where the table of a sheet begins, and which of its columns is which of a recording's.

Which columns a table must have: of a recording its coordinates, of an artefact's certificate its certified values. What
laboratories call them stands in words.toml. A heading is a word for a column of a
recording, or a letter of an axis among words that leave it a coordinate; any word that is not known here makes it another
column, which is left out and named as such.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Callable, Mapping, Sequence
from functools import cache, lru_cache
from itertools import pairwise

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import AXES
from cmm_uq.base.values import dataclass, field
from cmm_uq.jobs.columns import COORDINATES, OPTIONAL, READINGS, REQUIRED
from cmm_uq.jobs.importing import format as formats
from cmm_uq.jobs.importing.cells.encodings import is_number
from cmm_uq.jobs.importing.format import Cell, ImportKeys, NotReadError, Sheet, WrittenUnit, sources_of, unit_named

_LAST_SPACED = "\u2e7f"  # ahead of Chinese, Japanese and Korean characters
NAME = "name"  # of the point or feature, by which it may be numbered; no column of a recording


@lru_cache(maxsize=4096)
def plain_words(text: str) -> tuple[str, ...]:
    plain = text.casefold()
    if not plain.isascii():
        plain = unicodedata.normalize("NFKD", plain.translate(_SAME))
        plain = unicodedata.normalize("NFC", "".join(c for c in plain if not unicodedata.combining(c)))
    return tuple(_WORDS.findall(plain))


def unspaced(word: str) -> bool:
    """Whether a word is of a script that sets none apart, so that others may stand in it."""
    return word[-1:] > _LAST_SPACED


def numbered_words(text: str) -> tuple[tuple[str, ...], list[int]]:
    """Words of a heading, and its numbers; a letter counts as one after a word for a point or ahead of an axis."""
    named: list[str] = []
    indices: list[int] = []
    words = plain_words(text)
    for word, after in zip(words, [*words, ""][1:], strict=True):
        follows = after in AXES or (named and named[-1] in _POINT and not {*AXES}.isdisjoint(words))
        letter = len(word) == 1 and word in "abcdefgh" and follows
        if word.isdigit() or letter:
            indices.append(int(word) if word.isdigit() else ord(word) - ord("a") + 1)
        else:
            named.append(word)
    return tuple(named), indices


@cache
def printed_words(table: str) -> Mapping[str, tuple[str, ...]]:
    """Phrases of a table of ``words.toml`` by name."""
    return {name: tuple(phrase.strip() for phrase in text.split(",")) for name, text in formats.TABLES[table].items()}


@cache
def words_of(table: str) -> Mapping[str, frozenset[str]]:
    """The same as :func:`plain_words` makes them of a heading."""
    return {name: frozenset(" ".join(plain_words(one)) for one in of) for name, of in printed_words(table).items()}


# Japanese and Korean beside a letter is a word of its own
_WORDS = re.compile(r"[^\W\d_\u3040-\u9fff\uac00-\ud7a3]+|[\u3040-\u9fff\uac00-\ud7a3]+|\d+")
# letters that are none with an accent, characters in their simplified form; signs after a number
_TRADITIONAL = "標稱準測誤實際長線軸點對対參極負數離徑圓値單単復環規階週塊處間終檢"
_SIMPLIFIED = "标称准测误实际长线轴点对对参极负数离径圆值单单复环规阶周块处间终检"
_SAME = str.maketrans(f"łøđı{_TRADITIONAL}", f"lodi{_SIMPLIFIED}", "ªº°")
_COLUMNS = {phrase: column for column, phrases in words_of("columns").items() for phrase in phrases}
_AXIS = words_of("axis")  # words beside the letter of an axis, those that leave it a coordinate among them
_NOMINAL, _SMALL, _POINT = _AXIS["nominal"], _AXIS["small"], words_of("columns")["point"]
_LONGEST = 120  # characters of a heading; longer text is none

# coverage factor in a heading, as ``U (µm), k = 2``
COVERAGE = re.compile(r"[\[(,;]?\s*\bk\s*=\s*(\d+(?:[.,]\d+)?)\s*[\])]?", re.IGNORECASE)
_AS_WRITTEN = re.compile(r"(?i)[dmyajt]+([-/.])[dmyajt]+\1[dmyajt]+|hh?:mm(:ss)?|°")  # of dates, times and angles
# what certificates print above a column, beside its unit or its coverage factor
_SYMBOLS: Mapping[str, str] = {"U": "reference_U_um", "U95": "reference_U_um", "u": "reference_u_um"}
WORD = re.compile(r"[^\W\d_]+")
_FIGURES = frozenset("0123456789+-−.,")
_BALL = "ball"  # column of scanned balls: which of its bar
_OWN = frozenset((*REQUIRED, *OPTIONAL, *READINGS))
_IN_BRACKETS = re.compile(r"\s*[\[(<{]\s*([^\])>}]*?)\s*[\])>}]\s*$")
_AFTER_SIGN = re.compile(r"\s*(?:/|\bin\b|,|:)\s*([^\s/,:]+)\s*$", re.IGNORECASE)
_AT_THE_END = re.compile(r"[\s_]+([^\s_]+)\s*$")


@dataclass(frozen=True)
class Heading:
    """A column's heading, understood; ``index``: number of the point in a row; ``odd_unit``: brackets that name none."""

    column: str | None = None
    index: int | None = None
    unit: WrittenUnit | None = None
    odd_unit: str = ""


@lru_cache(maxsize=4096)
def understood(heading: str) -> Heading:
    if heading in _OWN:
        return Heading(heading)
    if heading[:1] in _FIGURES or len(heading) > _LONGEST:
        return Heading()
    without = COVERAGE.sub(" ", heading)
    text, unit, odd = without_unit(without)
    if text.strip() in _SYMBOLS and (unit is not None or without != heading):
        return Heading(_SYMBOLS[text.strip()], None, unit, odd)
    named, indices = numbered_words(text)
    index = indices[0] if len(indices) == 1 else None
    if len(indices) > 1 or not named:
        return Heading(NAME, unit=unit) if text.strip() in ("#", "n°", "N°") else Heading(None, None, unit, odd)
    return Heading(_column(named), index, unit, odd)


def without_unit(heading: str) -> tuple[str, WrittenUnit | None, str]:
    if match := _IN_BRACKETS.search(heading):
        unit = unit_named(match[1])
        return heading[: match.start()], unit, "" if unit else match[1]
    for pattern in (_AFTER_SIGN, _AT_THE_END):
        match = pattern.search(heading)
        if match and match.start() > 0 and (unit := unit_named(match[1])):
            ahead = heading[: match.start()]
            if match[1] == "F" and ahead.rstrip()[-1:].isdigit():  # as ``Run 1 F``, forwards
                continue
            return ahead, unit, ""
    return heading, None, ""


def _column(words: tuple[str, ...]) -> str | None:
    axes = [word for word in words if word in ("x", "y", "z")]
    if len(axes) == 1:
        others = {*words} - {axes[0]}
        fitting = (column for known, column in _AXIS_COLUMNS if others <= known)
        return None if others & (_NOMINAL | _AXIS["deviation"]) else next(fitting, "").format(axis=axes[0]) or None
    return _COLUMNS.get(" ".join(words)) or _COLUMNS.get(" ".join(word for word in words if word not in _SMALL))


_AXIS_COLUMNS = (
    (_AXIS["coordinate"], "{axis}_mm"), (_AXIS["coordinate"] | _AXIS["certified"], "reference_{axis}_mm"),
    (_AXIS["coordinate"] | _AXIS["approach"], "approach_{axis}"), (_AXIS["normal"], "n{axis}"),
    (_AXIS["temperature"], "temp_{axis}_c"), (_AXIS["tip"] | _AXIS["coordinate"], "tip_{axis}_mm"),
)  # fmt: skip


LINES_BEFORE = 2000  # lines of text before a table that are searched for its header
POINTS = (COORDINATES,)
REFERENCES = (*POINTS, ("reference_mm",), ("reference_x_mm", "reference_y_mm", "reference_z_mm"))
_SHOWN = 12  # headings in a message


@dataclass(frozen=True)
class Header:
    """A header, understood: indices of the columns of each column of a recording, several where a row holds several points.

    ``row``: its index in the sheet, or that of the first row of figures where there is none; ``first``: that row's index.
    """

    row: int
    first: int
    headings: Sequence[str]
    columns: Mapping[str, tuple[int, ...]]
    units: Mapping[int, WrittenUnit] = field(default_factory=dict)
    odd_units: Mapping[int, str] = field(default_factory=dict)

    @property
    def points(self) -> int:
        return max(map(len, self.columns.values()))

    @property
    def unused(self) -> list[int]:
        """Columns with a heading that are not taken."""
        used = {i for columns in self.columns.values() for i in columns}
        return [i for i, heading in enumerate(self.headings) if heading and i not in used]


def header_of(sheet: Sheet, keys: ImportKeys, where: str, wanted: Sequence[Sequence[str]]) -> Header | None:
    """The header of a sheet: the first row that names the wanted columns; ``None`` where no row does."""
    named = {name: sources_of(given) for name, given in keys.columns.items()}
    numbers = {name: tuple(one - 1 for one in own if isinstance(one, int)) for name, own in named.items()}
    if any(set(columns) <= set(named) for columns in wanted) and all(len(numbers[n]) == len(named[n]) for n in named):
        return _first_figures(sheet, numbers)
    for row, cells in enumerate(sheet.rows[:LINES_BEFORE]):
        if len(cells) < 2 and not keys.columns:
            continue
        headings = [*map(text_of, cells)]
        found = assigned(headings, named)
        if found is not None and any(set(columns) <= set(found) for columns in wanted):
            points = len({index for index, _ in found.get("x_mm", ())} - {None})
            return with_units(sheet, row, headings, unambiguous(found, headings, sheet.at(where, row), points))
    return None


def _first_figures(sheet: Sheet, columns: Mapping[str, tuple[int, ...]]) -> Header | None:
    """A table whose columns are named by number: it begins with the first row of figures in all of them."""
    every = [i for own in columns.values() for i in own]
    needed = [i for name in COORDINATES for i in columns.get(name, ())] or every
    for row, cells in enumerate(sheet.rows[:LINES_BEFORE]):
        if len(cells) > max(needed) and all(cells[i] != "" and is_number(cells[i]) for i in needed):
            return Header(row, row, [f"{i + 1}" for i in range(len(cells))], columns)
    return None


Assigned = dict[str, list[tuple[int | None, int]]]
"""Of each column of a recording: index of the point in a row, and index of the column."""


def assigned(
    headings: Sequence[str], named: Mapping[str, Sequence[str | int]], meaning_of: Callable[[str], Heading] = understood
) -> Assigned | None:
    """What the headings of a row are; ``None`` where one that the job names is not among them."""
    columns: Assigned = {}
    for name, sources in named.items():
        places = [_place(source, headings) for source in sources]
        if None in places:
            return None
        indices = range(1, len(places) + 1) if len(places) > 1 else [None]
        columns[name] = [(i, place) for i, place in zip(indices, places, strict=True) if place is not None]
    taken = {place for own in columns.values() for _, place in own}
    for i, heading in enumerate(headings):
        meaning = meaning_of(heading.strip()) if heading else Heading()
        if heading.strip() == _BALL and "point" in headings:  # then it is no other word for the points of its scan
            meaning = Heading(_BALL)
        if meaning.column and meaning.column not in named and i not in taken:
            columns.setdefault(meaning.column, []).append((meaning.index, i))
    return columns


def _place(source: str | int, headings: Sequence[str]) -> int | None:
    """Index of the column that a job names by heading or number."""
    if isinstance(source, int):
        return source - 1 if source <= len(headings) else None
    source = " ".join(source.split("\n")).strip()
    for name, among in ((source, headings), (source.casefold(), [h.casefold() for h in headings])):
        if name in among:
            return list(among).index(name)
    return None


def unambiguous(found: Assigned, headings: Sequence[str], place: str, points: int) -> dict[str, tuple[int, ...]]:
    """One column each, or one for each point or run of a row."""
    columns: dict[str, tuple[int, ...]] = {}
    for name, own in found.items():
        if name == NAME and len(own) > 1:  # a running number beside names
            own = [one for one in own if not {*plain_words(headings[one[1]])} <= _SMALL] or own
        indices = [index for index, _ in own]
        several = points > 1 and None not in indices and len(set(indices)) == len(indices)
        if len(own) > 1 and not several:
            shown, first = " and ".join(repr(headings[i]) for _, i in own[:3]), own[0][1]
            which = first + 1 if headings.count(headings[first]) > 1 else f'"{headings[first]}"'
            fix = f"Say which: columns = {{ {name} = {which} }}"
            raise NotReadError(f"columns {shown} could all be {name}", where=place, fix=fix)
        columns[name] = tuple(i for _, i in sorted(own, key=lambda pair: pair[0] or 0))
    count = max(map(len, columns.values()))
    odd = [name for name, own in columns.items() if len(own) not in (1, count)]
    odd += [name for name in COORDINATES if len(columns.get(name, ())) not in (0, count)]
    if odd:
        fix = f"Say which: columns = {{ {odd[0]} = [ … ] }}, one heading for each point"
        what = f"{count} points in a row, and {len(columns[odd[0]])} columns {odd[0]}"
        raise NotReadError(what, where=place, fix=fix)
    return columns


def with_units(sheet: Sheet, row: int, headings: Sequence[str], columns: Mapping[str, tuple[int, ...]]) -> Header:
    """The header with its units, which may stand in a row of their own."""
    meanings = {i: understood(heading.strip()) for i, heading in enumerate(headings) if heading}
    units = {i: meaning.unit for i, meaning in meanings.items() if meaning.unit}
    odd = {i: meaning.odd_unit for i, meaning in meanings.items() if meaning.odd_unit and not meaning.unit}
    below = sheet.rows[row + 1] if row + 1 < len(sheet.rows) else []
    filled = {i: cell for i, cell in enumerate(below) if cell not in ("", "()", "[]", "-")}
    texts = {i: cell.strip("[]()<>{} ") for i, cell in filled.items() if isinstance(cell, str)}
    alone = {i: unit for i, text in texts.items() if (unit := unit_named(text))}
    known = {*alone, *(i for i, text in texts.items() if _AS_WRITTEN.fullmatch(text))}
    whole = bool(alone) and len(known) == len(filled)
    return Header(row, row + 1 + whole, headings, columns, units | alone if whole else units, odd)


def names_axes(row: Sequence[Cell]) -> bool:
    """Whether a row is a head of coordinates, and no row of a table."""
    texts = [cell for cell in row if isinstance(cell, str) and cell]
    if len(texts) < 3 or len(texts) < sum(cell != "" for cell in row) or any(one[0] in _FIGURES for one in texts[-3:]):
        return False
    letters = [{*plain_words(text)} & {*AXES} for text in texts]
    return {*COORDINATES} <= {understood(text).column for text in texts} or all({axis} in letters for axis in AXES)


def no_header(sheets: Sequence[Sheet], keys: ImportKeys, where: str, wanted: Sequence[Sequence[str]]) -> CmmUqError:
    """Why no sheet has the columns that are needed."""
    texts = [source for given in keys.columns.values() for source in sources_of(given) if isinstance(source, str)]
    best: tuple[int, str, list[str]] = (0, "", [])
    for sheet in sheets:
        for row, cells in enumerate(sheet.rows[:LINES_BEFORE]):
            headings = [cell for cell in cells if isinstance(cell, str) and cell]
            score = sum(understood(heading).column is not None for heading in headings)
            score += sum(_place(source, headings) is not None for source in texts)
            if score > best[0]:
                best = (score, sheet.at(where, row), headings)
    score, place, headings = best
    if not score:
        given = f" ({', '.join(map(repr, texts))})" if keys.columns else ""
        lengths = ", or of lengths { nominal_mm = …, length_mm = … }" if "x_mm" in wanted[0] else ""
        of = "a table of points or lengths" if lengths else "a table of points"
        fix = f"Say which column is which: columns = {{ x_mm = …, y_mm = …, z_mm = … }}{lengths}"
        return NotReadError(f"no line names the columns{given} of {of}", where=where, fix=fix)
    named = keys.columns.items()
    lacking = [name for name, given in named if any(_place(one, headings) is None for one in sources_of(given))]
    known = {understood(heading).column for heading in headings} | set(keys.columns)
    missing = [*lacking, *(name for name in wanted[0] if name not in known), wanted[0][0]][0]
    listed = ", ".join(map(repr, headings[:_SHOWN])) + (" …" if len(headings) > _SHOWN else "")
    nominal = any(_NOMINAL & {*plain_words(without_unit(heading)[0])} for heading in headings)
    hint = " (nominal values are not taken for measured ones)" if nominal else ""
    fix = f'Say which: columns = {{ {missing} = "…" }}'
    return NotReadError(f"no column is {missing} among {listed}{hint}", where=place, fix=fix)


_FEW = 3  # rows, which say nothing of others
_TOLD = 40  # characters of a row that is left out
SUMMARY, REMARK = "a summary", "a remark"


def text_of(cell: Cell) -> str:
    return cell if isinstance(cell, str) else f"{cell:g}"


@cache
def _words_of_sums() -> tuple[frozenset[str], frozenset[str]]:
    """Words for figures of others, as ``mean``, and those together with what they may be of."""
    of = words_of("lengths")
    sums = frozenset(word for word in of["summary"] if len(word) > len("sd"))
    return sums, sums | of["length"] | of["deviation"]


def is_summary(row: Sequence[Cell]) -> bool:
    """Whether one of the first two cells is a word for a figure of other rows, or the first has a unit: ``Form (µm)``."""
    labels = [cell for cell in row if cell != ""][:2]
    texts = [re.sub(r"(?<=\w\w\w)\s*(?:[(\[].*|[:=].*$)", "", c) for c in labels if isinstance(c, str)]
    words = [plain_words(text) for text in texts if not text[-1:].isdigit()]
    sums, others = _words_of_sums()
    known = words_of("rows")["summary"]
    begun = {own[0] for own in words if own and len(own[0]) > len("ok") and not any(map(str.isdigit, own))}
    whole = any(" ".join(own) in known or (not sums.isdisjoint(own) and others.issuperset(own)) for own in words)
    if whole or not begun.isdisjoint(known - words_of("lengths")["run"]):
        return True
    label = text_of(labels[0]) if labels else ""
    return label.endswith((")", "]")) and not re.search(r"\d", label) and without_unit(label)[1] is not None


def named_alike(rows: Sequence[Sequence[Cell]], of: Sequence[int]) -> int:
    """How many rows come ahead of those, at the end, whose names have no number as all others have: results below points.

    Rows that a further word calls what those are go on.
    """
    numbered = [any(map(str.isdigit, text_of(next((cell for cell in rows[i] if cell != ""), "")))) for i in of]
    count = sum(numbered)
    if count <= _FEW or not all(numbered[:count]):
        return len(of)
    words = {word for i in of[:count] for word in _further_words(rows[i])}
    return next((n for n in range(count, len(of)) if words.isdisjoint(_further_words(rows[of[n]]))), len(of))


def _further_words(row: Sequence[Cell]) -> set[tuple[int, Cell]]:
    words = (one for one in enumerate(row) if isinstance(one[1], str) and WORD.search(one[1]))
    return {one for one in [*words][1:] if not unit_named(str(one[1]))}


def shown(sheet: Sheet, i: int, why: str) -> str:
    """A row that is left out, with its place and why."""
    text = " ".join(text_of(cell) for cell in sheet.rows[i] if cell != "")
    return f"{sheet.at('', i).removeprefix(': ').strip()}: {text[:_TOLD]!r}, {why}"


def filled_down(cells: Sequence[Cell]) -> Sequence[Cell]:
    """Labels of all rows, where each stands in the first row of those that it is of; else the cells as they are."""
    places = [i for i, cell in enumerate(cells) if cell != ""]
    if len(places) == len(cells) or not places or places[0] or any(cells[a] == cells[b] for a, b in pairwise(places)):
        return cells
    return [cells[a] for a, b in pairwise([*places, len(cells)]) for _ in range(a, b)]
