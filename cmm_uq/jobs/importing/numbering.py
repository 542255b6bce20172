"""Numbers of measurement, point and repeat, by columns of a file, by names, or by what stands beside places."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, Verbatim, commas, say
from cmm_uq.base.points import Floats
from cmm_uq.jobs.importing.encodings import is_number, values_of
from cmm_uq.jobs.importing.factors import RUN, Label, codes, counted, in_turn, numbered_runs, places, points_of_names
from cmm_uq.jobs.importing.format import Cell, Fact, ImportKeys, NotReadError
from cmm_uq.jobs.importing.header import understood

MEASUREMENT, POINT, REPEAT = "measurement", "point", "repeat"
NUMBERS = (MEASUREMENT, POINT, REPEAT)
_DIGITS = re.compile(r"\d+")
_WORD = re.compile(r"([^\W\d_]*)[^\w]*_*\d+")
_LETTER = re.compile(r"(?<![^\W\d_])[A-Ha-h](?![^\W_])")
# short words in the names of features
_BY_LETTER = {"m": MEASUREMENT, "p": POINT, "b": POINT, "k": POINT, "r": REPEAT, "bar": MEASUREMENT, "stab": MEASUREMENT,
              "barre": MEASUREMENT, "barra": MEASUREMENT, "pos": MEASUREMENT, "line": MEASUREMENT,
              "pass": REPEAT, "trial": REPEAT, "durchgang": REPEAT, "passage": REPEAT}  # fmt: skip
_NAMED = 6
_COMPARED = 5000  # points of which the places are compared
_FIX = (
    'Say how many rows in turn are one, points_per_measurement = N (or "all"), or which columns number them: '
    'columns = { measurement = "…", point = "…" }'
)


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
            raise CmmUqError(f"{cell!r} among names such as {cells[0]!r}", where=at(row), fix="Number all, or name all")
    known: dict[str, int] = {}
    values = [known.setdefault(str(cell), len(known) + 1) for cell in cells]
    first = list(known.items())[:_NAMED]
    shown = commas([say("{name} is {number}", name=Verbatim(name), number=i) for name, i in first])
    return np.array(values, dtype=np.float64), shown if len(known) <= _NAMED else say("{shown}, …", shown=shown)


def completed(
    columns: Mapping[str, Floats], labels: Sequence[str] | None, xyz: Floats, keys: ImportKeys, place: str
) -> tuple[dict[str, Floats], list[Fact]]:
    """Numbers (n,) of every point (n, 3), where the columns of the file leave some out."""
    numbers, count, how = dict(columns), len(xyz), None
    if MEASUREMENT in numbers and POINT in numbers:
        return numbers, []
    if MEASUREMENT in numbers:
        follow = say("numbered as they follow in their measurement")
        how, numbers[POINT] = say("{columns} {how}", columns=Verbatim(POINT), how=follow), _within(numbers)
    elif keys.points_per_measurement is None and labels and POINT not in numbers:
        again = count <= _COMPARED and places(xyz).max() + 1 < count  # then what differs at one place is a repeat
        if not again and (named := _of_names(labels)) is not None:
            first = commas([say("{column} {number:g}", column=Verbatim(column), number=float(values[0]))
                            for column, values in named.items()])  # fmt: skip
            how, numbers = say("from names: {name} is {first}", name=Verbatim(labels[0]), first=first), numbers | named
    if how is not None:
        return numbers, [Fact("numbering", say("Numbering"), how)]
    every = [Label("name", tuple(labels))] if labels else []
    every += [Label(name, tuple(f"{one:g}" for one in values)) for name, values in numbers.items()]
    found, facts = numbered_points(every, xyz, keys, place)
    return {**found, **(numbers if keys.points_per_measurement is not None else {})}, facts


def numbered_points(
    labels: Sequence[Label], xyz: Floats, keys: ImportKeys, place: str
) -> tuple[dict[str, Floats], list[Fact]]:
    """Numbers (n,) of measurement, point and repeat of places (n, 3) by what stands beside them."""
    numbers, count = dict[str, Floats](), len(xyz)
    if keys.points_per_measurement is not None:
        size = count if isinstance(keys.points_per_measurement, str) else keys.points_per_measurement
        if count % size:
            raise CmmUqError(f"{count} points are no whole number of measurements of {size}", where=place,
                             fix="Mend points_per_measurement, or the table: a point is missing, or one too many")  # fmt: skip
        rows, how = np.arange(count), say("{size} rows in turn are one measurement", size=size)
        numbers[MEASUREMENT] = (rows // size + 1).astype(np.float64)
        run = next((one for one in labels if len({*one.values}) > 1 and counted(one, lengths=False) == RUN), None)
        numbers |= {} if run is None else {REPEAT: numbered_runs(run.values).astype(np.float64)}
        numbers[POINT] = (rows % size + 1).astype(np.float64) if run is None else _within(numbers)
        return numbers, [Fact("numbering", say("Numbering"), how)]
    named = points_of_names(labels, xyz) if count <= _COMPARED else None
    if named is None:
        raise NotReadError("nothing says which points belong to one measurement", where=place, fix=_FIX)
    facts = []
    for name, texts in named.items():
        numbers[name], told = numbered(texts, ".", lambda row: place)
        if told is not None:
            facts.append(Fact(f"{name}_names", say("Names in {column}", column=Verbatim(name)), told))
    return numbers, facts


def _within(columns: Mapping[str, Floats]) -> Floats:
    """1, 2, … in each (measurement, repeat)."""
    keys = (columns[name].tolist() for name in (MEASUREMENT, REPEAT) if name in columns)
    return in_turn(codes([*zip(*keys, strict=True)])).astype(np.float64)


def split_names(labels: Sequence[str]) -> tuple[list[str | None], Floats] | None:
    """What the words of names say that their two or three numbers number, and the numbers (n, k); ``None`` of other names."""
    form = _DIGITS.sub("0", labels[0])
    parts = form.count("0")
    if parts not in (2, 3) or any(_DIGITS.sub("0", label) != form for label in labels):
        return None
    known = [_BY_LETTER.get(word.casefold()) or understood(word).column for word in _WORD.findall(labels[0])]
    return known, np.array([[float(digits) for digits in _DIGITS.findall(label)] for label in labels])


def _of_names(labels: Sequence[str]) -> dict[str, Floats] | None:
    """Measurement, point (and repeat) from names that are alike but for two (or three) numbers.

    The word before a number says what it numbers; where none is known, they stand in this order. A letter from A to H that
    stands alone, or after a number, tells balls apart: then ``P`` numbers positions, ``M`` measurements at one.
    """
    letters = [_LETTER.findall(label) for label in labels]
    if all(len(one) == 1 for one in letters) and len({one[0] for one in letters}) > 1:
        labels = [_LETTER.sub(lambda of: f"_ball{ord(of[0].upper()) - ord('A') + 1}", label) for label in labels]
    if (split := split_names(labels)) is None:
        return None
    known, numbers = split
    for i, word in enumerate(_WORD.findall(labels[0])):
        if known.count(known[i]) > 1:
            known[i] = {"p": MEASUREMENT, "m": REPEAT}.get(word.casefold(), known[i])
    columns = NUMBERS[: len(known)]
    claimed = [column for column in known if column in columns]
    left = iter([column for column in columns if column not in claimed])
    if len(set(claimed)) < len(claimed):
        return None
    order = [column if column in columns else next(left) for column in known]
    return {column: numbers[:, order.index(column)] for column in columns}
