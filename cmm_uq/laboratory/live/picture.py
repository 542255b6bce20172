"""A set-up in the machine's volume, drawn with characters: from above, and from the front."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cmm_uq.base.points import Floats, Machine
from cmm_uq.laboratory.live.lead import Step

WIDTH, HEIGHT = 30, 9
"""Characters of each of the two views, without its frame."""

_VIEWS = ((0, 1, "from above: x right, y up"), (0, 2, "from the front: x right, z up"))
_MOST = 36
"""Points that are drawn with their number; 1 to 9, then letters."""
_MARKS = "123456789abcdefghijklmnopqrstuvwxyz*"


def picture(machine: Machine, steps: Sequence[Step], ahead: Step | None) -> tuple[str, ...]:
    """Lines of both views side by side; the point that comes next is an ``X``, the others their numbers.

    Parameters
    ----------
    machine : whose travel is the frame; where it is not known, the points are.
    steps : of the set-up.
    ahead : the next of them.
    """
    if not steps:
        return ()
    readings = np.array([step.xyz for step in steps]) + machine.origin_mm
    drawn = [_view(machine, readings, steps, ahead, view) for view in _VIEWS]
    return tuple(f"{left}  {right}" for left, right in zip(*drawn, strict=True))


def _view(
    machine: Machine, readings: Floats, steps: Sequence[Step], ahead: Step | None, view: tuple[int, int, str]
) -> list[str]:
    across, up, title = view
    cells = [[" "] * WIDTH for _ in range(HEIGHT)]
    low, high = _frame(machine, readings)
    part = (readings - low) / np.where(high > low, high - low, 1.0)
    columns = np.clip(np.round(part[:, across] * (WIDTH - 1)), 0, WIDTH - 1).astype(int)
    rows = np.clip(np.round((1 - part[:, up]) * (HEIGHT - 1)), 0, HEIGHT - 1).astype(int)
    far = int(np.argmax(np.linalg.norm(readings - readings[0], axis=1)))
    for t in np.linspace(0, 1, 4 * WIDTH):
        at = part[0] + t * (part[far] - part[0])
        row, column = round((1 - float(at[up])) * (HEIGHT - 1)), round(float(at[across]) * (WIDTH - 1))
        if 0 <= row < HEIGHT and 0 <= column < WIDTH:
            cells[row][column] = "·"
    for step, row, column in zip(steps, rows, columns, strict=True):
        cells[row][column] = _MARKS[min(step.place[1] - 1, _MOST - 1)] if step.place[1] > 0 else "*"
    for step, row, column in zip(steps, rows, columns, strict=True):
        if ahead is not None and step.place == ahead.place:
            cells[row][column] = "X"
    return [title.ljust(WIDTH + 2), f"┌{'─' * WIDTH}┐", *(f"│{''.join(row)}│" for row in cells), f"└{'─' * WIDTH}┘"]


def _frame(machine: Machine, readings: Floats) -> tuple[Floats, Floats]:
    low, high = machine.travel_mm.T
    known = ~(np.isnan(low) | np.isnan(high))
    return np.where(known, low, readings.min(axis=0) - 1.0), np.where(known, high, readings.max(axis=0) + 1.0)
