"""Which points belong together: numbers of measurement, point and repeat, as the file says them or as its names have them."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, Verbatim, commas, names, say
from cmm_uq.base.points import Floats
from cmm_uq.jobs.importing.keys import ImportKeys
from cmm_uq.jobs.importing.numerals import is_number, values_of
from cmm_uq.jobs.importing.sheet import Cell, Fact
from cmm_uq.jobs.importing.vocabulary import understood

MEASUREMENT, POINT, REPEAT = "measurement", "point", "repeat"
NUMBERS = (MEASUREMENT, POINT, REPEAT)
_DIGITS = re.compile(r"\d+")
_WORD = re.compile(r"([^\W\d_]*)[^\w]*_*\d+")
_BY_LETTER = {"m": MEASUREMENT, "p": POINT, "b": POINT, "k": POINT, "r": REPEAT, "bar": MEASUREMENT, "stab": MEASUREMENT,
              "barre": MEASUREMENT, "barra": MEASUREMENT, "pos": MEASUREMENT, "line": MEASUREMENT}  # fmt: skip
"""Short words in the names of features."""

_SHOWN = 6
_FIX = 'Say points_per_measurement = 2 (or "all"), or which columns number them: columns = { measurement = "…", point = "…" }'

At = Callable[[int], str]
"""Place of a cell of a column by the index of its row."""


def numbered(cells: Sequence[Cell], sign: str, at: At) -> tuple[Floats, Text | None]:
    """Numbers (n,) of a column that numbers measurements, points or repeats; names are numbered as they first appear.

    Returns and what names became which numbers, where they are names.
    """
    if cells and is_number(cells[0]):
        return values_of(cells, sign, at), None
    empty = next((row for row, cell in enumerate(cells) if cell == ""), None)
    if empty is not None:
        raise CmmUqError("no value", where=at(empty), fix="Complete the row")
    odd = next((row for row, cell in enumerate(cells) if is_number(cell)), None)
    if odd is not None:
        raise CmmUqError(
            f"{cells[odd]!r} among names such as {cells[0]!r}", where=at(odd), fix="Number all, or name all"
        )
    known: dict[str, int] = {}
    values = [known.setdefault(str(cell), len(known) + 1) for cell in cells]
    shown = commas(
        [say("{name} is {number}", name=Verbatim(name), number=i) for name, i in list(known.items())[:_SHOWN]]
    )
    return np.array(values, dtype=np.float64), shown if len(known) <= _SHOWN else say("{shown}, …", shown=shown)


def completed(
    given: Mapping[str, Floats], labels: Sequence[str] | None, count: int, keys: ImportKeys, place: str
) -> tuple[dict[str, Floats], list[Fact]]:
    """Numbers of every point, where the file leaves some out.

    ``given``: columns that the file has, each (n,).
    """
    found = dict(given)
    if MEASUREMENT in found:
        if POINT in found:
            return found, []
        return {**found, POINT: _within(found)}, [_fact(say("numbered as they follow in their measurement"), POINT)]
    if keys.points_per_measurement is not None:
        return _in_turn(found, count, keys.points_per_measurement, place)
    named = None if labels is None or POINT in found else _of_names(labels)
    if named is None or labels is None:
        raise CmmUqError("nothing says which points belong to one measurement", where=place, fix=_FIX)
    first = commas([say("{column} {number:g}", column=Verbatim(column), number=float(numbers[0]))
                    for column, numbers in named.items()])  # fmt: skip
    how = say("from names: {name} is {first}", name=Verbatim(labels[0]), first=first)
    return {**found, **named}, [Fact("numbering", say("Numbering"), how)]


def _fact(how: Text, *columns: str) -> Fact:
    return Fact("numbering", say("Numbering"), say("{columns} {how}", columns=commas(names(columns)), how=how))


def _within(found: Mapping[str, Floats]) -> Floats:
    """1, 2, … in each (measurement, repeat)."""
    ones = np.ones(len(found[MEASUREMENT]))
    last: dict[tuple[float, float], int] = {}
    values = []
    for key in zip(found[MEASUREMENT].tolist(), found.get(REPEAT, ones).tolist(), strict=True):
        last[key] = last.get(key, 0) + 1
        values.append(last[key])
    return np.array(values, dtype=np.float64)


def _in_turn(found: dict[str, Floats], count: int, each: int | str, place: str) -> tuple[dict[str, Floats], list[Fact]]:
    """So many rows in turn are one measurement."""
    size = count if isinstance(each, str) else each
    if count % size:
        raise CmmUqError(f"{count} points are no whole number of measurements of {size}", where=place,
                         fix="Mend points_per_measurement, or the table: a point is missing, or one too many")  # fmt: skip
    rows = np.arange(count)
    found[MEASUREMENT] = (rows // size + 1).astype(np.float64)
    how = say("{size} rows in turn are one measurement", size=size)
    if POINT not in found:
        found[POINT] = (rows % size + 1).astype(np.float64)
    return found, [Fact("numbering", say("Numbering"), how)]


def _of_names(labels: Sequence[str]) -> dict[str, Floats] | None:
    """Measurement, point (and repeat) from names that are alike but for two (or three) numbers.

    The word before a number says what it numbers; where none is known, they stand in this order.
    """
    if not labels:
        return None
    form = _DIGITS.sub("0", labels[0])
    parts = form.count("0")
    if parts not in (2, 3) or any(_DIGITS.sub("0", label) != form for label in labels):
        return None
    numbers = np.array([[float(digits) for digits in _DIGITS.findall(label)] for label in labels])
    columns = _in_words(_WORD.findall(labels[0]), NUMBERS[:parts])
    return None if columns is None else {column: numbers[:, columns.index(column)] for column in NUMBERS[:parts]}


def _in_words(words: Sequence[str], columns: Sequence[str]) -> list[str] | None:
    """What each number of a name numbers, by the word before it; ``None`` where two of them claim the same."""
    known = [_BY_LETTER.get(word.casefold()) or understood(word).column for word in words]
    known = [column if column in columns else None for column in known]
    claimed = [column for column in known if column]
    if len(set(claimed)) < len(claimed):
        return None
    left = iter([column for column in columns if column not in claimed])
    return [column or next(left) for column in known]
