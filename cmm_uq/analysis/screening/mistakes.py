"""What people and programs do to coordinates, undone: a unit, a sign, two columns or rows exchanged, a column shifted.

Screening applies each to what does not fit the artefact; the one that makes it fit is what happened.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from cmm_uq.analysis.screening.shape import ArtefactShape
from cmm_uq.base.messages import Text, Verbatim, commas, plural, say
from cmm_uq.base.points import AXES, Floats, Ints

UNITS = ((25.4, say("inches")), (1e3, say("metres")), (1e-3, say("micrometres")), (10.0, say("centimetres")))
"""Millimetres in what the recording may hold instead."""

TWICE = ((1 / 25.4, say("inches converted twice")),)
COORDINATES = tuple(f"{a}_mm" for a in AXES)


@dataclass(frozen=True, eq=False)
class Mistake:
    """One mistake, undone.

    ``kind`` of finding; ``what`` the mistake, as a sentence without its full stop; ``fix`` what to do; ``columns`` that
    it concerns; ``apply`` coordinates (k, 3) and references (k, j) as they would be without it; ``edges`` rows that it
    cannot mend.
    """

    kind: str
    what: Text
    fix: Text
    columns: tuple[str, ...]
    apply: Callable[[Floats, Floats], tuple[Floats, Floats]]
    edges: int = 0


def row_mistakes(shape: ArtefactShape) -> tuple[Mistake, ...]:
    """Every mistake that may concern a single row as well as many, the commoner first."""
    found = [*_units(COORDINATES, of_references=False), *_signs(COORDINATES, of_references=False)]
    found += _exchanges(COORDINATES, of_references=False)
    if shape.names and shape.names[0].endswith("_mm"):
        found += _units(shape.names, of_references=True)
    elif shape.names:
        found += [*_signs(shape.names, of_references=True), *_exchanges(shape.names, of_references=True)]
    return (*found, *_units(COORDINATES, of_references=False, units=TWICE))


def block_mistakes(shape: ArtefactShape) -> tuple[Mistake, ...]:
    """Mistakes that concern many rows together, or none: columns that slipped by a row, faces counted from the other end."""
    found = []
    for by, way in ((-1, say("down")), (1, say("up"))):
        found += [_shift((i,), (name,), by, way, of_references=False) for i, name in enumerate(COORDINATES)]
        if shape.names:
            found.append(_shift(tuple(range(len(shape.names))), shape.names, by, way, of_references=True))
        if len(shape.names) > 1:
            found += [_shift((i,), (name,), by, way, of_references=True) for i, name in enumerate(shape.names)]
    if shape.names == ("reference_mm",):
        found.append(
            Mistake(
                "swapped",
                say("its faces seem counted from the other end"),
                say("Turn the order of reference_mm round"),
                shape.names,
                _on(True, _from_the_other_end),
            )
        )
    return tuple(found)


def _units(
    names: tuple[str, ...], *, of_references: bool, units: tuple[tuple[float, Text], ...] = UNITS
) -> Iterator[Mistake]:
    for factor, unit in units:
        for chosen in (tuple(range(len(names))), *((i,) for i in range(len(names)) if len(names) > 1)):
            concerned = tuple(names[i] for i in chosen)
            scale = np.where(np.isin(np.arange(len(names)), chosen), factor, 1.0)
            yield Mistake(
                "unit", plural(
                    len(concerned),
                    one=say("{columns} looks like {unit}, not mm", columns=_named(concerned), unit=unit),
                    many=say("{columns} look like {unit}, not mm", columns=_named(concerned), unit=unit),
                ), say("Convert to mm (times {factor:g})", factor=factor), concerned,
                _on(of_references, _times(scale)),
            )  # fmt: skip


def _signs(names: tuple[str, ...], *, of_references: bool) -> Iterator[Mistake]:
    several = [(0, 1, 2)] if of_references else []
    for chosen in (*((i,) for i in range(3)), *several):
        concerned = tuple(names[i] for i in chosen)
        sign = np.where(np.isin(np.arange(3), chosen), -1.0, 1.0)
        yield Mistake("sign", plural(
            len(concerned),
            one=say("{columns} seems to have the wrong sign", columns=_named(concerned)),
            many=say("{columns} seem to have the wrong sign", columns=_named(concerned)),
        ), say("Turn the sign round"), concerned,
                     _on(of_references, _times(sign)))  # fmt: skip


def _exchanges(names: tuple[str, ...], *, of_references: bool) -> Iterator[Mistake]:
    for i, j in combinations(range(3), 2):
        order = np.arange(3)
        order[[i, j]] = j, i
        yield Mistake(
            "exchanged coordinates",
            say("{one} and {other} seem exchanged", one=Verbatim(names[i]), other=Verbatim(names[j])),
            say("Exchange them"),
            (names[i], names[j]),
            _on(of_references, _reordered(order)),
        )


def _shift(chosen: tuple[int, ...], names: tuple[str, ...], by: int, way: Text, *, of_references: bool) -> Mistake:
    def shifted(values: Floats) -> Floats:
        values = values.copy()
        values[:, chosen] = np.roll(values[:, chosen], by, axis=0)
        return values

    return Mistake(
        "shifted column",
        plural(
            len(names),
            one=say(
                "{columns} seems shifted {way} by one row against the other columns", columns=_named(names), way=way
            ),
            many=say(
                "{columns} seem shifted {way} by one row against the other columns", columns=_named(names), way=way
            ),
        ),
        say("Move the column back beside the others"),
        names,
        _on(of_references, shifted),
        1,
    )


def _from_the_other_end(reference: Floats) -> Floats:
    """The certified distance of the first face for the last, of the second for the last but one, and so on."""
    faces, rank = np.unique(reference, return_inverse=True)
    return np.asarray(faces[::-1][rank].reshape(reference.shape), dtype=np.float64)


def _named(columns: tuple[str, ...]) -> Text:
    return commas(Verbatim(column) for column in columns)


def _times(factors: Floats) -> Callable[[Floats], Floats]:
    return lambda values: values * factors


def _reordered(order: Ints) -> Callable[[Floats], Floats]:
    return lambda values: values[:, order]


def _on(of_references: bool, what: Callable[[Floats], Floats]) -> Callable[[Floats, Floats], tuple[Floats, Floats]]:
    if of_references:
        return lambda xyz, reference: (xyz, what(reference))
    return lambda xyz, reference: (what(xyz), reference)
