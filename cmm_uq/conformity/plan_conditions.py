"""Whether a plan meets what its standard asks for, before anyone measures it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cmm_uq.conformity.measurement_lines import LEAST_SHARE, missing_lines, share_of_travel
from cmm_uq.conformity.standards import (
    B89_LENGTHS,
    ISO_10360_2_LENGTHS,
    ISO_10360_2_NOMINALS,
    ISO_10360_5_POINTS,
)
from cmm_uq.points import Machine, Points

SHORTEST_MM = 30.0
"""Largest that the shortest of the five lengths may be (ISO 10360-2 by Harris 2004, 2.6.3)."""

REPETITIONS = 3


@dataclass(frozen=True)
class Condition:
    """One thing that a standard asks for, and whether a plan has it."""

    what: str
    met: bool


def conditions(name: str, placings: Sequence[Points], machine: Machine) -> tuple[Condition, ...]:
    """Conditions of the standard that a ready plan is named after; none for a plan of no standard.

    Parameters
    ----------
    name : of the ready plan.
    placings : points of each.
    machine : whose travel counts.
    """
    if name == "ASME B89.4.1":
        return _ballbar(placings)
    if name == "ISO 10360-2":
        return _lengths(placings, machine)
    if name == "ISO 10360-5":
        counts = {int(np.sum(points.repeat == points.repeat.min())) for points in placings}
        return (Condition(f"{ISO_10360_5_POINTS} points over the sphere", counts == {ISO_10360_5_POINTS}),)
    return ()


def _ballbar(placings: Sequence[Points]) -> tuple[Condition, ...]:
    return (
        Condition(f"at least {B89_LENGTHS} positions of the bar: {len(placings)}", len(placings) >= B89_LENGTHS),
    )  # fmt: skip


def _lengths(placings: Sequence[Points], machine: Machine) -> tuple[Condition, ...]:
    lines: dict[str, tuple[list[float], float, int]] = {}
    directions = []
    for points in placings:
        along = points.xyz[int(np.argmax(np.linalg.norm(points.xyz - points.xyz[0], axis=1)))] - points.xyz[0]
        length = float(np.linalg.norm(along))
        directions.append(along / length)
        sign = directions[-1][np.flatnonzero(np.abs(directions[-1]) > 1e-6)[0]]
        key = str(np.round(directions[-1] * np.sign(sign), 3).tolist())
        middle = points.xyz[0] + 0.5 * along
        share = share_of_travel(machine, middle, directions[-1], length) or 0.0
        references = np.unique(np.round(points.columns["reference_mm"], 6))
        found, longest, repeats = lines.get(key, ([], 0.0, REPETITIONS))
        found += references[references > 0].tolist()
        lines[key] = found, max(longest, share), min(repeats, len(np.unique(points.repeat)))
    missing = missing_lines(directions)
    shares = [share for _, share, _ in lines.values()]
    counts = [len(set(found)) for found, _, _ in lines.values()]
    shortest = max(min(found) for found, _, _ in lines.values())
    total = sum(len(set(found)) * repeats for found, _, repeats in lines.values())
    return (
        Condition(f"four space diagonals and three axes{'; missing: ' if missing else ''}{', '.join(missing)}", not missing),
        Condition(
            f"longest length at least {100 * LEAST_SHARE:.0f} % of the travel along each line: {100 * min(shares):.0f} % to "
            f"{100 * max(shares):.0f} %", min(shares) >= LEAST_SHARE,
        ),
        Condition(f"{ISO_10360_2_NOMINALS} lengths on each line: {min(counts)} to {max(counts)}",
                  min(counts) >= ISO_10360_2_NOMINALS),
        Condition(f"shortest length at most {SHORTEST_MM:g} mm: {shortest:g} mm", shortest <= SHORTEST_MM),
        Condition(f"{REPETITIONS} repetitions of each, {ISO_10360_2_LENGTHS} lengths in all: {total}",
                  total >= ISO_10360_2_LENGTHS),
    )  # fmt: skip
