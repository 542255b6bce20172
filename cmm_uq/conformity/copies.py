"""Measurements that repeat others to the last digit: copies, which are no measurements."""

from __future__ import annotations

import numpy as np

from cmm_uq.messages import NOTHING, Text, say, semicolons
from cmm_uq.points import Points

_NAMED = 5
"""Copies that are named one by one."""


def copied(points: Points) -> dict[int, int]:
    """Groups that repeat another to the last digit, with that other: the one of the lowest measurement and repeat."""
    found: dict[int, int] = {}
    for groups in points.twins:
        original, *later = sorted(groups, key=lambda group: run_of(points, group))
        found |= dict.fromkeys(later, original)
    return found


def copies_in_words(points: Points) -> Text:
    """Which measurements are copies of which; empty when none is."""
    told = []
    for later, original in copied(points).items():
        (one, first), (two, repeat) = run_of(points, original), run_of(points, later)
        told.append((one, first, two, repeat))
    said = [
        say(
            "measurement {two}, repeat {repeat} of measurement {one}, repeat {first}",
            two=two,
            repeat=repeat,
            one=one,
            first=first,
        )
        for one, first, two, repeat in sorted(told)
    ]
    if not said:
        return NOTHING
    if len(said) <= _NAMED:
        return say("Copies to the last digit, which do not count: {copies}.", copies=semicolons(said))
    return say(
        "Copies to the last digit, which do not count: {copies} and {count} more.",
        copies=semicolons(said[:_NAMED]), count=len(said) - _NAMED,
    )  # fmt: skip


def run_of(points: Points, group: int) -> tuple[int, int]:
    """Measurement and repeat of a group."""
    row = int(np.argmax(points.group == group))
    return int(points.measurement[row]), int(points.repeat[row])
