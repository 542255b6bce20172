"""Measurements that repeat others to the last digit: copies, which are no measurements."""

from __future__ import annotations

from cmm_uq.base.messages import NOTHING, Text, say, semicolons
from cmm_uq.base.points import Points

_NAMED = 5
"""Copies that are named one by one."""


def copies_in_words(points: Points) -> Text:
    """Which measurements are copies of which; empty when none is."""
    told = []
    for later, original in points.copies.items():
        (one, first), (two, repeat) = points.run_of(original), points.run_of(later)
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
