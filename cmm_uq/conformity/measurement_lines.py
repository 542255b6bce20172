"""Where ISO 10360-2:2009 wants a length measured: seven lines through the volume, and how long they must be."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from cmm_uq.points import AXES, Floats, Machine

ALIGNED = np.sin(np.radians(10.0))
"""A direction cosine below this does not count: the line is as good as square to that axis."""

LEAST_SHARE = 0.66
"""The longest length on a line over the travel along it (ISO 10360-2:2009, 6.3.2)."""

PARALLELS = tuple(f"parallel to {a.upper()}" for a in AXES)
SPACE_DIAGONALS = tuple(f"space diagonal {x}X {y}Y +Z" for x in "+−" for y in "+−")
SEVEN_LINES = (*SPACE_DIAGONALS, *PARALLELS)
"""The four space diagonals, and by default the three axes (ISO 10360-2:2009, 6.3.3)."""


def position_of(direction: Floats) -> str:
    """Position of a line in words, from its direction (3,), either way along it."""
    u = direction / np.linalg.norm(direction)
    counts = np.abs(u) > ALIGNED
    taken = [a.upper() for a, counted in zip(AXES, counts, strict=True) if counted]
    if len(taken) == 1:
        return f"parallel to {taken[0]}"
    signs = np.sign(u) * np.sign(u[counts][-1])
    named = [
        f"{'+' if s > 0 else '−'}{a.upper()}" for a, s, counted in zip(AXES, signs, counts, strict=True) if counted
    ]
    return f"{'space' if len(taken) == 3 else 'face'} diagonal {' '.join(named)}"


def missing_lines(directions: Iterable[Floats]) -> tuple[str, ...]:
    """Which of the seven positions none of these lines has."""
    found = {position_of(direction) for direction in directions}
    return tuple(line for line in SEVEN_LINES if line not in found)


def share_of_travel(machine: Machine, middle: Floats, direction: Floats, length: float) -> float | None:
    """Length over the travel along a line through ``middle`` (3,), mm in the recorded frame; ``None`` without travel."""
    travel = machine.travel_mm
    if not np.all(np.isfinite(travel)):
        return None
    place = middle + machine.origin_mm
    moving = np.abs(direction) > 1e-9
    ends = (travel - place[:, None])[moving] / direction[moving, None]
    available = float(ends.max(axis=1).min() - ends.min(axis=1).max())
    return length / available if available > 0 else None
