"""Automatic adjustment, or staircase (ILAC-G24 / OIML D 10:2022, method 1): each calibration changes the interval.

A calibration that finds the machine well within its limits (to 80 %) lengthens the next interval by a
step up; one that finds it beyond a limit shortens it by a step down; between, it stays. The steps
follow from the reliability R that is wanted: where R of the calibrations go up and 1 − R down, the logarithm of the
interval does not move, R·ln(1 + a) + (1 − R)·ln(1 − b) = 0. A step up is a tenth, or less where a step down would then be
more than an interval may shrink by at once.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from cmm_uq.laboratory.due.changing import USUAL, Changing

WELL_WITHIN = 0.8
"""Part of the limit up to which the interval is lengthened; remembered of ILAC-G24 / OIML D 10, not checked against it."""

STEP_UP = 0.1
"""Part by which an interval is lengthened at most."""


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


def steps(reliability: float, factor: float = USUAL.factor) -> tuple[float, float]:
    """Factors of an interval after a calibration well within the limits, and after one beyond them, in balance.

    Parameters
    ----------
    reliability : at which the interval stands still.
    factor : most that an interval shrinks by at once.
    """
    odds = reliability / (1 - reliability)
    up = min(1 + STEP_UP, factor ** (1 / odds))
    return float(up), float(up**-odds)


def staircase(used: Iterable[float], interval: float, reliability: float, changing: Changing = USUAL) -> Staircase:
    """Climb from a first interval.

    Parameters
    ----------
    used : for each calibration in turn, the largest part of a limit that was found used up.
    interval : first interval, days.
    reliability : wanted at the end of an interval.
    changing : bounds of the interval, and the most that it shrinks by at once.
    """
    up_by, down_by = steps(reliability, changing.factor)
    counts = [0, 0, 0]
    for part in used:
        step = 0 if part <= WELL_WITHIN else 1 if part <= 1 else 2
        counts[step] += 1
        interval = changing.bounded(interval * (up_by, 1.0, down_by)[step])
    return Staircase(interval, *counts)
