"""Fleets for tests of what is said of them: learnt from one and two machines, and one of thousands whose figures are set."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from cmm_uq.laboratory.due.crossing import DAYS, Crossings
from cmm_uq.laboratory.due.fleet import Estimates, FleetMember, FleetResult, FleetValue, UsualRate, fit_fleet, judged
from tests.laboratory.due.histories import FIRST, machine

LIMIT = 4.0
BEYOND, CROSSING, ODD, MODELS = 20, 2000, 40, 30


@cache
def alone() -> FleetResult:
    """One machine, all its certificates of one day, and no limit."""
    only = FleetMember("7", "", "", machine([0, 0], [1.0, 1.2]))
    return judged([("a.ppm", "Scale", "ppm", (only,), fit_fleet([only]), 2)], 1)


@cache
def two() -> FleetResult:
    """One machine within its limit, one beyond it."""
    both = tuple(
        FleetMember(name, "", "", machine([0, 1, 2], [level] * 3, 0.1), LIMIT)
        for name, level in (("in", 0.0), ("out", 9.0))
    )
    return judged([("a.ppm", "Scale", "ppm", both, fit_fleet(both), 0)], 1)


def many(count: int = 3000) -> FleetResult:
    """Machines 0, 1, 2, … whose last certificates are all of day 0, ordinal ``FIRST``.

    The first twenty are beyond the limit, each farther than the one before; the others up to number 1999 cross it, number
    1999 within the first day and each a day after its successor; those after them never. The last forty do not belong, the
    last most clearly. Of thirty models, model m has m machines.
    """
    of = two().values[0]
    seen = machine([-1, 0], [0.0, 0.0])
    members = tuple(FleetMember(f"{i}", f"{i % MODELS}", "Hall", seen, LIMIT) for i in range(count))
    at = np.arange(count)
    probability = np.zeros((count, len(DAYS)))
    probability[:CROSSING, 1:] = 0.999
    probability[:BEYOND] = 1.0
    last = FIRST + np.where(at < BEYOND, 0.0, np.clip(CROSSING - 1.0 - at, 0.0, None))
    level = np.where(at < BEYOND, LIMIT + 1.0 + at, 0.0)
    one = np.ones(count)
    estimates = Estimates(
        one, one, one, one, 0.1 / (1.0 + at), Crossings(last, DAYS, probability, level, one, one, one)
    )
    usual = (
        UsualRate("fleet", "", count, 0.5, 0.1, 0.3, 0.7),
        *(UsualRate("model", f"{m}", m, 0.5, 0.1, 0.3, 0.7) for m in range(1, MODELS + 1)),
        UsualRate("place", "Hall", count, 0.5, 0.1, 0.3, 0.7),
    )
    names = tuple(member.machine for member in members)
    fleet = replace(of.fleet, estimates=estimates, usual=usual, machines=names)
    return FleetResult((FleetValue(of.name, of.quantity, of.unit, members, fleet, at < count - ODD, 0),), 1)
