"""Measurements that repeat others to the last digit: copies, which are no measurements."""

from __future__ import annotations

from cmm_uq.points import Points

_NAMED = 5
"""Copies that are named one by one."""


def copies_in_words(points: Points) -> str:
    """Which measurements are copies of which; empty when none is."""
    told = []
    for later, original in points.copies.items():
        (one, first), (two, repeat) = points.run_of(original), points.run_of(later)
        told.append((one, first, two, repeat))
    said = [
        f"measurement {two}, repeat {repeat} of measurement {one}, repeat {first}"
        for one, first, two, repeat in sorted(told)
    ]
    more = f" and {len(said) - _NAMED} more" if len(said) > _NAMED else ""
    return f"Copies to the last digit, which do not count: {'; '.join(said[:_NAMED])}{more}." if said else ""
