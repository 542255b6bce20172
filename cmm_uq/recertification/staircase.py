"""Automatic adjustment, or staircase (ILAC-G24 / OIML D 10:2022, method 1): each calibration changes the interval.

A calibration that finds the machine well within its limits (to 80 %, as the guide suggests) lengthens the next interval by a
step up; one that finds it beyond a limit shortens it by a step down; between, it stays. The guide leaves the steps open. Here
the step down follows from the step up and the reliability R that is wanted: where R of the calibrations go up and 1 − R down,
the logarithm of the interval does not move, R·ln(1 + a) + (1 − R)·ln(1 − b) = 0.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from cmm_uq.recertification.changing import USUAL, Changing

WELL_WITHIN = 0.8
"""Part of the limit up to which the interval is lengthened (ILAC-G24 / OIML D 10:2022, 6.2)."""

STEP_UP = 0.1
"""Part by which an interval is lengthened."""


@dataclass(frozen=True)
class Staircase:
    """Where the staircase has come to.

    Parameters
    ----------
    interval : days.
    up, kept, down : calibrations that lengthened it, left it, and shortened it.
    """

    interval: float
    up: int
    kept: int
    down: int


def step_down(reliability: float, up: float = STEP_UP) -> float:
    """Factor of an interval after a calibration out of tolerance, at which the target keeps the balance."""
    return float((1 + up) ** (-reliability / (1 - reliability)))


def staircase(used: Iterable[float], interval: float, reliability: float, changing: Changing = USUAL) -> Staircase:
    """Climb from a first interval.

    Parameters
    ----------
    used : for each calibration in turn, the largest part of a limit that was found used up.
    interval : first interval, days.
    reliability : wanted at the end of an interval.
    changing : bounds of the interval, and the most that it shrinks by at once.
    """
    down_by = max(step_down(reliability), 1 / changing.factor)
    counts = [0, 0, 0]
    for part in used:
        step = 0 if part <= WELL_WITHIN else 1 if part <= 1 else 2
        counts[step] += 1
        interval = changing.bounded(interval * (1 + STEP_UP, 1.0, down_by)[step])
    return Staircase(interval, *counts)
