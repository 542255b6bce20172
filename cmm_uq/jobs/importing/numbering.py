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
# short words in the names of features
_BY_LETTER = {"m": MEASUREMENT, "p": POINT, "b": POINT, "k": POINT, "r": REPEAT, "bar": MEASUREMENT, "stab": MEASUREMENT,
              "barre": MEASUREMENT, "barra": MEASUREMENT, "pos": MEASUREMENT, "line": MEASUREMENT}  # fmt: skip
_SHOWN = 6
_FIX = 'Say points_per_measurement = 2 (or "all"), or which columns number them: columns = { measurement = "…", point = "…" }'


def numbered(cells: Sequence[Cell], sign: str, at: Callable[[int], str]) -> tuple[Floats, Text | None]:
    """Numbers (n,) of a column that numbers measurements, points or repeats; names are numbered as they first appear.

    Returns also what names became which numbers, where they are names. ``at``: place of a cell by the index of its row.
    """
    if cells and is_number(cells[0]):
        return values_of(cells, sign, at), None
    if "" in cells:
        raise CmmUqError("no value", where=at(list(cells).index("")), fix="Complete the row")
    for row, cell in enumerate(cells):
        if is_number(cell):
            problem = f"{cell!r} among names such as {cells[0]!r}"
            raise CmmUqError(problem, where=at(row), fix="Number all, or name all")
    known: dict[str, int] = {}
    values = [known.setdefault(str(cell), len(known) + 1) for cell in cells]
    shown = commas(
        [say("{name} is {number}", name=Verbatim(name), number=i) for name, i in list(known.items())[:_SHOWN]]
    )
    return np.array(values, dtype=np.float64), shown if len(known) <= _SHOWN else say("{shown}, …", shown=shown)


def completed(
    columns: Mapping[str, Floats], labels: Sequence[str] | None, count: int, keys: ImportKeys, place: str
) -> tuple[dict[str, Floats], list[Fact]]:
    """Numbers (count,) of every point, where the columns of the file leave some out."""
    numbers = dict(columns)
    if MEASUREMENT in numbers:
        if POINT in numbers:
            return numbers, []
        how = say(
            "{columns} {how}", columns=commas(names((POINT,))), how=say("numbered as they follow in their measurement")
        )
        numbers[POINT] = _within(numbers)
    elif keys.points_per_measurement is not None:
        size = count if isinstance(keys.points_per_measurement, str) else keys.points_per_measurement
        if count % size:
            raise CmmUqError(f"{count} points are no whole number of measurements of {size}", where=place,
                             fix="Mend points_per_measurement, or the table: a point is missing, or one too many")  # fmt: skip
        rows, how = np.arange(count), say("{size} rows in turn are one measurement", size=size)
        numbers[MEASUREMENT] = (rows // size + 1).astype(np.float64)
        numbers.setdefault(POINT, (rows % size + 1).astype(np.float64))
    else:
        named = _of_names(labels) if labels and POINT not in numbers else None
        if named is None or labels is None:
            raise CmmUqError("nothing says which points belong to one measurement", where=place, fix=_FIX)
        first = commas([say("{column} {number:g}", column=Verbatim(column), number=float(values[0]))
                        for column, values in named.items()])  # fmt: skip
        how = say("from names: {name} is {first}", name=Verbatim(labels[0]), first=first)
        numbers |= named
    return numbers, [Fact("numbering", say("Numbering"), how)]


def _within(columns: Mapping[str, Floats]) -> Floats:
    """1, 2, … in each (measurement, repeat)."""
    ones = np.ones(len(columns[MEASUREMENT]))
    last: dict[tuple[float, float], int] = {}
    values = []
    for key in zip(columns[MEASUREMENT].tolist(), columns.get(REPEAT, ones).tolist(), strict=True):
        last[key] = last.get(key, 0) + 1
        values.append(last[key])
    return np.array(values, dtype=np.float64)


def _of_names(labels: Sequence[str]) -> dict[str, Floats] | None:
    """Measurement, point (and repeat) from names that are alike but for two (or three) numbers.

    The word before a number says what it numbers; where none is known, they stand in this order.
    """
    form = _DIGITS.sub("0", labels[0])
    parts = form.count("0")
    if parts not in (2, 3) or any(_DIGITS.sub("0", label) != form for label in labels):
        return None
    columns = NUMBERS[:parts]
    known = [_BY_LETTER.get(word.casefold()) or understood(word).column for word in _WORD.findall(labels[0])]
    claimed = [column for column in known if column in columns]
    if len(set(claimed)) < len(claimed):
        return None
    left = iter([column for column in columns if column not in claimed])
    order = [column if column in columns else next(left) for column in known]
    numbers = np.array([[float(digits) for digits in _DIGITS.findall(label)] for label in labels])
    return {column: numbers[:, order.index(column)] for column in columns}
