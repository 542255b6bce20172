"""Numbers of measurement, point and repeat, by columns of a file, by names, or by what stands beside places."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, Verbatim, commas, say
from cmm_uq.base.points import Floats
from cmm_uq.jobs.importing.cells.encodings import is_number, values_of
from cmm_uq.jobs.importing.factors import RUN, Label, codes, counted, in_turn, numbered_runs, parts_of, together
from cmm_uq.jobs.importing.format import Cell, Fact, ImportKeys, NotReadError
from cmm_uq.jobs.importing.grouping import points_told_apart

MEASUREMENT, POINT, REPEAT = "measurement", "point", "repeat"
NUMBERS = (MEASUREMENT, POINT, REPEAT)
_DIGITS = re.compile(r"\d+")
_NAMED = 6
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
    return _named([str(cell) for cell in cells])


def _named(texts: Sequence[str]) -> tuple[Floats, Text]:
    """Numbers of names: those that they have, where they are alike but for them, else as they first appear."""
    found = [_DIGITS.findall(text) for text in texts]
    alike = len({_DIGITS.sub("0", text) for text in texts}) == 1 and len(found[0]) == 1
    if alike and len({*texts}) == len({int(one[0]) for one in found}):
        first_ = say("{name} is {number}", name=Verbatim(texts[0]), number=int(found[0][0]))
        return np.array([float(one[0]) for one in found]), say("{shown}, …", shown=first_)
    known: dict[str, int] = {}
    values = [known.setdefault(str(cell), len(known) + 1) for cell in texts]
    first = list(known.items())[:_NAMED]
    shown = commas([say("{name} is {number}", name=Verbatim(name), number=i) for name, i in first])
    return np.array(values, dtype=np.float64), shown if len(known) <= _NAMED else say("{shown}, …", shown=shown)


def completed(
    columns: Mapping[str, Floats], labels: Sequence[Label], xyz: Floats, keys: ImportKeys, place: str
) -> tuple[dict[str, Floats], list[Fact]]:
    """Numbers (n,) of every point (n, 3), where the columns of the file leave some out or let two points be one."""
    count = len(xyz)
    both = {MEASUREMENT, POINT} <= {*columns}
    if both and len({*zip(*(own.tolist() for own in columns.values()), strict=True)}) == count:
        return dict(columns), []
    if {MEASUREMENT, REPEAT} <= {*columns} and POINT not in columns:  # then names count the points of each
        each = codes([*zip(columns[MEASUREMENT].tolist(), columns[REPEAT].tolist(), strict=True)])
        most = np.bincount(each).max()
        for label in (*labels, *(part for one in labels for part in parts_of(one))):
            own = codes(label.values)
            if own.max() < most and together(each, own).max() + 1 == count:
                points, told = _named(label.values)
                return {**columns, POINT: points}, [
                    Fact("point_names", say("Names in {column}", column=Verbatim(POINT)), told)
                ]
    every = [*(Label(name, tuple(f"{one:g}" for one in values)) for name, values in columns.items()), *labels]
    try:
        found, facts = numbered_points(every, xyz, keys, place)
    except NotReadError:
        if both:
            return dict(columns), []  # of which two rows are one, as is said where they are taken
        raise
    return {**found, **(columns if keys.points_per_measurement is not None else {})}, facts


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
    named = points_told_apart(labels, xyz)
    if named is None:
        raise NotReadError("nothing says which points belong to one measurement", where=place, fix=_FIX)
    facts = []
    for name, texts in named.items():
        whole = all(text.isdecimal() for text in texts)
        numbers[name], told = (np.array([float(text) for text in texts]), None) if whole else _named(texts)
        if told is not None:
            facts.append(Fact(f"{name}_names", say("Names in {column}", column=Verbatim(name)), told))
    return numbers, facts


def refuse_uneven(columns: Mapping[str, Floats], where: str) -> None:
    """Numbers that contradict each other as a whole: points that come again very unequally, repeats that nothing has."""
    own = np.column_stack([columns[name] for name in (MEASUREMENT, POINT)])
    often = np.unique(own, axis=0, return_counts=True)[1]
    numbers, most, least = len(np.unique(columns[REPEAT])), int(often.max()), int(often.min())
    what = ""
    if most > 2 * least and 2 * np.bincount(often).max() <= len(often):  # and no point to which all came back
        what = f"its points come again {least} to {most} times, as styli and other things do that are no repeats"
    elif numbers > 2 * most:
        what = f"its repeats have {numbers} numbers, and no point was measured more than {most} times"
    if what:
        raise NotReadError(what, where=where, fix=_FIX)


def _within(columns: Mapping[str, Floats]) -> Floats:
    """1, 2, … in each (measurement, repeat)."""
    keys = (columns[name].tolist() for name in (MEASUREMENT, REPEAT) if name in columns)
    return in_turn(codes([*zip(*keys, strict=True)])).astype(np.float64)
