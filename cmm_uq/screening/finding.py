"""What screening reports: something odd in a recording, as what it is, where it stands, and what to do about it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cmm_uq.points import Floats, Ints, Points


@dataclass(frozen=True)
class Finding:
    """Something odd in a recording.

    Parameters
    ----------
    kind : ``impossible``, ``duplicate``, ``repeated block``, ``swapped``, ``unit``, ``sign``, ``exchanged coordinates``,
        ``shifted column``, ``stuck`` or ``outlier``.
    measurements : that it concerns.
    lines : of the file.
    why : in words, and how to mend it.
    column : that it concerns, if one.
    set_aside : whether the estimates leave these rows, or this column, out.
    rows : of the recording, from 0, that are left out with it.
    """

    kind: str
    measurements: tuple[int, ...]
    lines: tuple[int, ...]
    why: str
    column: str | None = None
    set_aside: bool = False
    rows: tuple[int, ...] = ()


def finding(kind: str, points: Points, rows: NDArray[np.bool_] | Ints, why: str, column: str | None = None) -> Finding:
    """A finding about some rows of a recording."""
    lines = tuple(points.lines[rows].tolist()) if len(points.lines) else ()
    return Finding(kind, tuple(dict.fromkeys(points.measurement[rows].tolist())), lines, why, column)


def span(values: Floats) -> str:
    """One value, or the lowest and the highest."""
    low, high = float(values.min()), float(values.max())
    return f"{low:g}" if low == high else f"{low:g} to {high:g}"


def at_lines(points: Points, rows: Ints) -> str:
    """``line 12``, ``lines 12 to 15`` or ``lines 3, 9 and 17``; rows from 1 where there is no file."""
    numbers = sorted(points.lines[rows].tolist()) if len(points.lines) else sorted((rows + 1).tolist())
    word = "line" if len(points.lines) else "row"
    if len(numbers) == 1:
        return f"{word} {numbers[0]}"
    if len(numbers) > 2 and numbers[-1] - numbers[0] == len(numbers) - 1:
        return f"{word}s {numbers[0]} to {numbers[-1]}"
    shown = [str(n) for n in numbers[:6]]
    rest = f" and {len(numbers) - 6} more" if len(numbers) > 6 else ""
    return f"{word}s {', '.join(shown)}{rest}" if rest else f"{word}s {', '.join(shown[:-1])} and {shown[-1]}"
