"""Lengths on lines, as tests after ISO 10360-2 and B89 are reported: nominal, several runs, without coordinates.

A length on a known line becomes two points a length apart, the first at the line's start, and is a measurement of its own: the
scatter of both ends stands at the second, so that it is right for their difference. Where the lines lie few tables say: it is
asked for.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cmm_uq.base.errors import CmmUqError, suggestion
from cmm_uq.base.messages import Verbatim, say, semicolons
from cmm_uq.base.points import Floats
from cmm_uq.jobs.columns import COORDINATES
from cmm_uq.jobs.importing.format import LINE_PLACE, Fact, ImportKeys

REFERENCE = "reference_mm"
LENGTHS_ALONE = (
    "line",
    "length_mm",
    "nominal_mm",
    "deviation_um",
    "deviation_mm",
)  # columns that no table of points has
COLUMNS = (*LENGTHS_ALONE, REFERENCE, "repeat")
"""Columns of a table of lengths, which a job may name."""


@dataclass
class MeasuredLengths:
    """Lengths of a sheet, of each its line by name, reference, run, measured value, mm, and line of the file."""

    names: list[str]
    reference: list[float | None]
    repeat: list[int]
    measured: list[float]
    lines: list[int]
    beside: dict[str, list[float]]
    sources: dict[str, str]
    facts: tuple[Fact, ...]
    left_out: tuple[str, ...]


def placed(
    tables: Sequence[MeasuredLengths], keys: ImportKeys, where: str
) -> tuple[dict[str, Floats], list[Fact], list[int]]:
    """Columns of a recording, (2n,): both ends of every length, where the job says that its line lies."""
    wanted = list(dict.fromkeys(name for one in tables for name in one.names))
    starts = {name: place_of(keys.lines[name]) for name in wanted if name in keys.lines}
    if lacking := [name for name in wanted if name not in starts]:
        one, which = lacking[0], ", ".join(map(repr, lacking))
        lie = f"lines {which} lie" if len(lacking) > 1 else f"line {one!r} lies"
        raise CmmUqError(
            f"nothing says where {lie}, along which lengths were measured",
            where=where,
            fix=f'Say it, with its start in mm: lines = {{ "{one}" = "along X from 100,200,300" }}',
        )
    if unknown := [name for name in keys.lines if name not in starts]:
        raise CmmUqError(f"has no line {unknown[0]!r}", where=where, fix=suggestion(unknown[0], wanted))
    number: dict[tuple[str, float | None], int] = {}
    columns: dict[str, list[float]] = {name: [] for name in ("measurement", "point", "repeat", *COORDINATES, REFERENCE)}
    beside = [name for name in tables[0].beside if all(name in one.beside for one in tables)]
    columns |= {name: [] for name in beside}
    lines: list[int] = []
    for table in tables:
        for i, name in enumerate(table.names):
            reference = table.reference[i]
            start, direction = starts[name]
            measurement = number.setdefault((name, reference), len(number) + 1)
            for point, (xyz, base) in enumerate(
                ((start, 0.0), (start + table.measured[i] * direction, reference or 0.0)), 1
            ):
                row = (measurement, point, table.repeat[i], *xyz, base, *(table.beside[one][i] for one in beside))
                for column, value in zip(columns.values(), row, strict=True):
                    column.append(value)
                lines.append(table.lines[i])
    bare = [reference is None for table in tables for reference in table.reference]
    if all(bare):
        columns.pop(REFERENCE)
    elif any(bare):
        raise CmmUqError(
            "a length has no nominal length, and others have one",
            where=f"{where} line {lines[2 * bare.index(True)]}",
            fix="Give it for all, or read the sheets one by one: sheet",
        )
    told = semicolons(
        [say("{name}: {place}", name=Verbatim(name), place=Verbatim(keys.lines[name])) for name in wanted]
    )
    facts = [Fact("lines", say("Lines"), told)]
    return {name: np.array(values) for name, values in columns.items()}, facts, lines


def place_of(text: str) -> tuple[Floats, Floats]:
    """Start (3,) and direction (3,) of a line."""
    parts = LINE_PLACE.fullmatch(text.strip())
    if parts is None:
        raise CmmUqError(f"{text!r} says no place", where="lines", fix='Write "along X from 100,200,300"')
    figures = [float(figure.replace("−", "-")) for figure in parts.groups()[2:] if figure]
    start = np.array(figures[:3])
    if parts[2]:
        direction = np.zeros(3)
        direction["xyz".index(parts[2].lower())] = 1.0 if parts[1] in ("", "+") else -1.0
    else:
        direction = np.array(figures[3:]) - start
        if not direction.any():
            raise CmmUqError(f"{text!r} begins where it ends", where="lines", fix="Say two places of the line")
        direction /= np.linalg.norm(direction)
    return start, direction
