"""What people and programs do to coordinates, undone: a unit, a sign, two columns or rows exchanged, a column shifted.

Screening applies each to what does not fit the artefact; the one that makes it fit is what happened.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from itertools import combinations

import numpy as np

from cmm_uq.analysis.screening.shape import ArtefactShape
from cmm_uq.base.messages import Text, Verbatim, commas, plural, say
from cmm_uq.base.points import AXES, Floats

# millimetres in what the recording may hold instead
UNITS = ((25.4, say("inches")), (1e3, say("metres")), (1e-3, say("micrometres")), (10.0, say("centimetres")))
TWICE = ((1 / 25.4, say("inches converted twice")),)
COORDINATES = tuple(f"{a}_mm" for a in AXES)


@dataclass(frozen=True, eq=False)
class Mistake:
    """One mistake, and its undoing."""

    kind: str
    what: Text  # the mistake, as a sentence without its full stop
    fix: Text
    columns: tuple[str, ...]
    undo: Callable[[Floats], Floats]  # makes coordinates (k, 3), or references (k, j), as they would be without it
    of_references: bool = False
    edges: int = 0  # rows that it cannot mend

    def apply(self, xyz: Floats, reference: Floats) -> tuple[Floats, Floats]:
        return (xyz, self.undo(reference)) if self.of_references else (self.undo(xyz), reference)


def row_mistakes(shape: ArtefactShape) -> tuple[Mistake, ...]:
    """Every mistake that may concern a single row as well as many, the commoner first."""
    mistakes = [*_units(COORDINATES), *_signs(COORDINATES), *_exchanges(COORDINATES)]
    if shape.names and shape.names[0].endswith("_mm"):
        mistakes += _units(shape.names, of_references=True)
    elif shape.names:
        mistakes += [*_signs(shape.names, of_references=True), *_exchanges(shape.names, of_references=True)]
    return (*mistakes, *_units(COORDINATES, units=TWICE))


def block_mistakes(shape: ArtefactShape) -> tuple[Mistake, ...]:
    """Mistakes that concern many rows together, or none: columns that slipped by a row, faces counted from the other end."""
    mistakes = []
    for by, way in ((-1, say("down")), (1, say("up"))):
        mistakes += [_shift((i,), (name,), by, way) for i, name in enumerate(COORDINATES)]
        if shape.names:
            mistakes.append(_shift(tuple(range(len(shape.names))), shape.names, by, way, of_references=True))
        if len(shape.names) > 1:
            mistakes += [_shift((i,), (name,), by, way, of_references=True) for i, name in enumerate(shape.names)]
    if shape.names == ("reference_mm",):
        what = say("its faces seem counted from the other end")
        fix = say("Turn the order of reference_mm round")
        mistakes.append(Mistake("swapped", what, fix, shape.names, _from_the_other_end, of_references=True))
    return tuple(mistakes)


def _units(
    names: tuple[str, ...], *, of_references: bool = False, units: tuple[tuple[float, Text], ...] = UNITS
) -> Iterator[Mistake]:
    for factor, unit in units:
        for chosen in (tuple(range(len(names))), *((i,) for i in range(len(names)) if len(names) > 1)):
            concerned = tuple(names[i] for i in chosen)
            columns, scale = _named(concerned), np.where(np.isin(np.arange(len(names)), chosen), factor, 1.0)
            one = say("{columns} looks like {unit}, not mm", columns=columns, unit=unit)
            many = say("{columns} look like {unit}, not mm", columns=columns, unit=unit)
            what, fix = (
                plural(len(concerned), one=one, many=many),
                say("Convert to mm (times {factor:g})", factor=factor),
            )
            yield Mistake("unit", what, fix, concerned, partial(np.multiply, scale), of_references)


def _signs(names: tuple[str, ...], *, of_references: bool = False) -> Iterator[Mistake]:
    for chosen in (*((i,) for i in range(3)), *([(0, 1, 2)] if of_references else [])):
        concerned = tuple(names[i] for i in chosen)
        columns, sign = _named(concerned), np.where(np.isin(np.arange(3), chosen), -1.0, 1.0)
        one = say("{columns} seems to have the wrong sign", columns=columns)
        many = say("{columns} seem to have the wrong sign", columns=columns)
        what = plural(len(concerned), one=one, many=many)
        yield Mistake("sign", what, say("Turn the sign round"), concerned, partial(np.multiply, sign), of_references)


def _exchanges(names: tuple[str, ...], *, of_references: bool = False) -> Iterator[Mistake]:
    for i, j in combinations(range(3), 2):
        order = np.arange(3)
        order[[i, j]] = j, i
        what = say("{one} and {other} seem exchanged", one=Verbatim(names[i]), other=Verbatim(names[j]))
        undo = partial(np.take, indices=order, axis=1)
        yield Mistake("exchanged coordinates", what, say("Exchange them"), (names[i], names[j]), undo, of_references)


def _shift(
    chosen: tuple[int, ...], names: tuple[str, ...], by: int, way: Text, *, of_references: bool = False
) -> Mistake:
    def undo(values: Floats) -> Floats:
        values = values.copy()
        values[:, chosen] = np.roll(values[:, chosen], by, axis=0)
        return values

    columns, fix = _named(names), say("Move the column back beside the others")
    one = say("{columns} seems shifted {way} by one row against the other columns", columns=columns, way=way)
    many = say("{columns} seem shifted {way} by one row against the other columns", columns=columns, way=way)
    return Mistake("shifted column", plural(len(names), one=one, many=many), fix, names, undo, of_references, 1)


def _from_the_other_end(reference: Floats) -> Floats:
    faces, rank = np.unique(reference, return_inverse=True)
    return np.asarray(faces[::-1][rank].reshape(reference.shape), dtype=np.float64)


def _named(columns: tuple[str, ...]) -> Text:
    return commas(Verbatim(column) for column in columns)
