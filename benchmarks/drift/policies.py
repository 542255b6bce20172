"""Ten years of calibrations by a rule, and what they cost: the staircase here, any other as a callable.

The cost function, stated before the sealed run: a calibration costs 1; every day that a machine is in use while its true
error is beyond the limit costs ``DAY_BEYOND``, so that twenty such days cost as much as a calibration.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from benchmarks.drift.generator import ADJUSTED_BEYOND, LIMIT, YEAR, Certificates, Machine, Surroundings, calibrate

DAY_BEYOND = 0.05
YEARS = 10
SHORTEST, LONGEST, USUAL = 30.0, 5 * YEAR, YEAR
"""Days between two calibrations by any rule; the staircase begins with a year."""

GROWTHS = (0.005, 0.01, 0.02, 0.05, 0.1, 0.15, 0.2, 0.3, 0.5, 0.8)
CUTS = (0.1, 0.2, 0.3, 0.45, 0.6, 0.75)
FIXED = (60, 90, 120, 180, 240, 365, 545, 730)


@dataclass
class Life:
    """What became of the machines under a rule."""

    calibrations: int = 0
    found_beyond: int = 0
    days_beyond: int = 0
    machine_years: float = 0.0

    @property
    def reliability(self) -> float:
        """Part of the calibrations that found the true error within the limit."""
        return 1 - self.found_beyond / self.calibrations

    @property
    def cost(self) -> float:
        """Per machine and year, in calibrations."""
        return (self.calibrations + DAY_BEYOND * self.days_beyond) / self.machine_years


Case = tuple[Machine, Surroundings, np.random.Generator]
Rule = Callable[[Sequence[int]], np.ndarray]
"""Days until the next calibration of some of the machines, from their certificates."""


def lived(cases: list[Case], rule: Rule) -> Life:
    """From today: each machine is calibrated when the rule says, adjusted beyond a part of the limit, certified as left."""
    life, end = Life(machine_years=YEARS * len(cases)), int(YEARS * YEAR)
    last = [machine.certificates.day[-1] for machine, _, _ in cases]
    since = np.zeros(len(cases), dtype=int)
    waiting = list(range(len(cases)))
    while waiting:
        due = np.clip(np.asarray(rule(waiting)), SHORTEST, LONGEST)
        still = []
        for i, days in zip(waiting, due, strict=True):
            machine, around, random = cases[i]
            day = max(last[i] + round(float(days)), 1)
            true = machine.offset + machine.raw[since[i] - machine.first : min(day, end) - machine.first]
            life.days_beyond += int((np.abs(true) > LIMIT).sum())
            if day >= end:
                continue
            life.calibrations += 1
            life.found_beyond += abs(machine.truth(day)) > LIMIT
            calibrate(machine, day, around, random, as_left=True)
            last[i] = since[i] = machine.certificates.day[-1]
            still.append(i)
        waiting = still
    return life


def as_found(certificates: Certificates) -> list[float]:
    """Values of all certificates but those made the day after an adjustment."""
    return [
        value
        for day, value, adjusted in zip(certificates.day, certificates.value, certificates.adjusted_since, strict=True)
        if not day - adjusted <= 1
    ]


def staircase(cases: list[Case], growth: float, cut: float) -> Rule:
    """ILAC-G24's automatic adjustment: longer after a value within a part of the limit, shorter after one beyond the limit.

    The past counts as if the rule had been in force: each value as found moved the interval.
    """

    def rule(which: Sequence[int]) -> np.ndarray:
        found = []
        for i in which:
            days = USUAL
            for value in as_found(cases[i][0].certificates):
                if abs(value) > LIMIT:
                    days *= 1 - cut
                elif abs(value) <= ADJUSTED_BEYOND * LIMIT:
                    days *= 1 + growth
                days = float(np.clip(days, SHORTEST, LONGEST))
            found.append(days)
        return np.array(found)

    return rule


def fixed(days: float) -> Rule:
    """The same interval for all machines."""
    return lambda which: np.full(len(which), float(days))


def at_reliability(lives: dict[tuple[float, float], Life], wanted: float) -> tuple[float, float, float] | None:
    """Lowest cost of any staircase at a reliability, and its growth and cut; None where none has it.

    Between neighbouring growths of one cut, cost and growth follow the reliability in straight lines.
    """
    best: tuple[float, float, float] | None = None
    for cut in CUTS:
        for one, other in pairwise(GROWTHS):
            a, b = lives[one, cut], lives[other, cut]
            low, high = sorted((a.reliability, b.reliability))
            if low <= wanted <= high and high > low:
                part = (wanted - a.reliability) / (b.reliability - a.reliability)
                here = (a.cost + part * (b.cost - a.cost), one + part * (other - one), cut)
                best = here if best is None else min(best, here)
    return best
