"""Measuring again: what follows where one of the repeats of a length lies outside.

ISO 10360-2:2009 lets at most five of the 35 lengths have one of their three values outside, and each of these is measured ten
times more at its place; all ten must lie inside (the clause is known here from others, see docs/standards.md). Two of three,
or a sixth length, fail. Further repeats of the same measurement are those ten.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from cmm_uq.analysis.conformity.statement import Decided, Standing
from cmm_uq.base.points import Ints

OUTSIDE = ("fail", "conditional fail")
"""Outcomes of a value that lies outside."""

NOT_INSIDE = (*OUTSIDE, "undecided", "conditional pass")
"""Outcomes of one that lies outside the zone of conformance: further readings stand for it, too, where they were made, or a
larger error would pass where a smaller one does not."""


@dataclass(frozen=True)
class Again:
    """What a standard lets be measured again.

    Parameters
    ----------
    repeats : of each length in the test itself.
    outside : of these may lie outside.
    lengths : may have as many outside.
    readings : more of each, all of which must lie inside.
    """

    repeats: int
    outside: int
    lengths: int
    readings: int


def with_standing(items: Sequence[Decided], nominal: Ints, again: Again) -> tuple[Decided, ...]:
    """The same, each with what it counts for.

    Parameters
    ----------
    items : decided lengths; a length met twice in a repeat is outside there where either is.
    nominal : (m,) which nominal length each is of.
    again : what may be measured again.
    """
    sets: dict[tuple[int | None, int], list[int]] = {}
    for i, item in enumerate(items):
        sets.setdefault((item.measurement, int(nominal[i])), []).append(i)
    standing: dict[int, Standing] = {}
    for not_inside in (OUTSIDE, NOT_INSIDE):
        eligible = {
            key: found for key, rows in sets.items() if (found := _one(items, rows, again, not_inside)) is not None
        }
        failed = {key for key, rows in sets.items() if any(items[i].outcome in OUTSIDE for i in rows)}
        if not_inside is OUTSIDE and failed - set(eligible):
            break  # the test fails, whatever more is measured
        if len(eligible) > again.lengths:
            break
        for outside, further in eligible.values():
            if further and any(items[i].outcome in OUTSIDE for i in further):
                continue
            if len({items[i].repeat for i in further}) >= again.readings:
                standing |= dict.fromkeys(outside, "replaced")
            elif not_inside is OUTSIDE:
                standing |= dict.fromkeys(outside, "again")
    return tuple(replace(item, standing=standing.get(i, "counts")) for i, item in enumerate(items))


def _one(
    items: Sequence[Decided], rows: Sequence[int], again: Again, not_inside: Collection[str]
) -> tuple[list[int], list[int]] | None:
    """Those not inside among the repeats of the test, and the further readings; ``None`` where the clause does not apply."""
    repeats = np.unique([items[i].repeat or 0 for i in rows])
    if len(repeats) < again.repeats:
        return None
    test = [i for i in rows if (items[i].repeat or 0) in repeats[: again.repeats]]
    outside = [i for i in test if items[i].outcome in not_inside]
    beyond = [i for i in test if abs(items[i].error_um) > items[i].limit_um]  # proved or not
    if not outside or len({items[i].repeat for i in (*outside, *beyond)}) > again.outside:
        return None
    return outside, [i for i in rows if i not in test]
