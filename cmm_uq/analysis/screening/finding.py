"""What screening reports: something odd in a recording, as what it is, where it stands, and what to do about it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cmm_uq.base.messages import Text, commas, listed, number, say
from cmm_uq.base.points import Floats, Ints, Points


@dataclass(frozen=True)
class Finding:
    """Something odd in a recording."""

    # impossible, duplicate, repeated block, swapped, reversed, unit, sign, exchanged coordinates, shifted column, stuck
    # or outlier
    kind: str
    measurements: tuple[int, ...]
    lines: tuple[int, ...]
    why: Text  # in words, and how to mend it
    column: str | None = None
    set_aside: bool = False  # whether the estimates leave these rows, or this column, out
    rows: tuple[int, ...] = ()  # of the recording, from 0, that are left out with it


def finding(kind: str, points: Points, rows: NDArray[np.bool_] | Ints, why: Text, column: str | None = None) -> Finding:
    lines = tuple(points.lines[rows].tolist()) if len(points.lines) else ()
    return Finding(kind, tuple(dict.fromkeys(points.measurement[rows].tolist())), lines, why, column)


def span(values: Floats) -> Text:
    """One value, or the lowest and the highest."""
    low, high = float(values.min()), float(values.max())
    return number(low, "g") if low == high else say("{low:g} to {high:g}", low=low, high=high)


def at_lines(points: Points, rows: Ints) -> Text:
    """``line 12``, ``lines 12 to 15`` or ``lines 3, 9 and 17``; rows from 1 where there is no file."""
    known = bool(len(points.lines))
    numbers = sorted(points.lines[rows].tolist()) if known else sorted((rows + 1).tolist())
    if len(numbers) == 1:
        return say("line {n}", n=numbers[0]) if known else say("row {n}", n=numbers[0])
    which = _which(numbers)
    return say("lines {which}", which=which) if known else say("rows {which}", which=which)


def _which(numbers: Sequence[int]) -> Text:
    if len(numbers) > 2 and numbers[-1] - numbers[0] == len(numbers) - 1:
        return say("{first} to {last}", first=numbers[0], last=numbers[-1])
    shown = [number(n) for n in numbers[:6]]
    if len(numbers) > 6:
        return say("{shown} and {count} more", shown=commas(shown), count=len(numbers) - 6)
    return listed(shown)
