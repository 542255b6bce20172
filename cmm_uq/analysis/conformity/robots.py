"""Robots by ISO 9283: pose accuracy AP and repeatability RP of poses that were commanded again and again."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import numpy as np

from cmm_uq.analysis.conformity.arms import asked
from cmm_uq.analysis.conformity.own_rule import figure_of
from cmm_uq.analysis.conformity.plans import Condition
from cmm_uq.analysis.conformity.standard import Standard
from cmm_uq.analysis.conformity.statement import CHOSEN, ITS_RULE, REPORTED, Clause
from cmm_uq.analysis.conformity.uncertainty import LENGTH_LINES
from cmm_uq.base.arm import Arm
from cmm_uq.base.messages import say
from cmm_uq.base.points import Floats
from cmm_uq.machine.model.artefact import Artefact

NAME = "ISO 9283:1998"
POSES, CYCLES = 5, 30
_FLAT = 0.02  # of the extent of five poses, by which they may lie beside a plane, and one of them beside their middle
# of their extent that of the narrower side at least, and of the reach, or the way from the base where that is not stated or
# is longer, the extent itself: five poses on a line, or side by side, are none of a cube
_NARROW, _NEAR = 0.3, 0.1


def poses(artefact: Artefact, *, recorded: bool) -> tuple[Condition, ...]:
    """Five poses, one in the middle of four, all in one plane, each thirty times in one measurement, as figures are of one."""
    points = artefact.points
    copied = list(points.copies) if recorded else []
    cycles: dict[tuple[int, int], list[Floats]] = {}
    for row in np.flatnonzero(~np.isin(points.group, copied)).tolist():
        cycles.setdefault((int(points.measurement[row]), int(points.point[row])), []).append(points.xyz[row])
    whole: dict[int, list[Floats]] = {}
    for (measurement, _), each in cycles.items():
        if len(each) >= CYCLES:
            whole.setdefault(measurement, []).append(np.mean(each, axis=0))
    what = say("{poses} poses, each commanded {cycles} times", poses=POSES, cycles=CYCLES)
    found = [asked(what, POSES, max(map(len, whole.values()), default=0))]
    plane = say("a pose in the middle of four others, all in one plane, over a tenth of the reach")
    machine = points.machine
    reach = machine.reach_mm if isinstance(machine, Arm) else np.nan
    flat = any(_in_a_plane(five, reach) for at in whole.values() for five in _fives(at))
    found.append(Condition(plane, () if flat else (plane,)))
    return tuple(found)


def _fives(at: list[Floats]) -> Iterator[Floats]:
    """Every choice of five places, each of them first once."""
    for five in combinations(at, POSES):
        yield from (np.array([five[i], *five[:i], *five[i + 1 :]]) for i in range(POSES))


def _in_a_plane(at: Floats, reach: float) -> bool:
    extent, sides = float(np.ptp(at, axis=0).max()), np.linalg.svd(at - at.mean(axis=0))[1]
    off = max(np.linalg.norm(at[0] - at[1:].mean(axis=0)), sides[2])
    wide = sides[1] >= _NARROW * sides[0] and extent >= _NEAR * np.fmax(reach, np.linalg.norm(at[0]))
    return bool(wide and off <= _FLAT * extent)


_AGAIN = "poses that were commanded again and again"
STANDARD = Standard(
    NAME,
    (
        figure_of(
            "RP",
            say("pose repeatability: mean distance from the barycentre and three standard deviations"),
            _AGAIN,
            poses,
        ),
        figure_of(
            "AP",
            say("pose accuracy: distance of the barycentre from the commanded place"),
            f'{_AGAIN}, seen in the frame of the base (frame = "base" in [artefact])',
            poses,
            lines=LENGTH_LINES,
        ),
    ),
    (say("Of positions alone: the orientation of a pose, and all else that ISO 9283 characterises, are not tested."),),
)
CLAUSES = (
    Clause(
        "accuracy",
        say("pose accuracy"),
        "AP = distance of the barycentre of the places attained from the commanded "
        "one, of each pose; orientation is not evaluated.",
        REPORTED,
        of=("AP",),
    ),
    Clause(
        "repeatability",
        say("pose repeatability"),
        "RP = l̄ + 3·S of the distances l from the barycentre, n − 1, of each pose; orientation is not evaluated.",
        REPORTED,
        of=("RP",),
    ),
    Clause(
        "poses",
        say("poses and cycles"),
        "Five poses, one in the middle of the others, all in one plane (2 % of "
        "their extent) and not on a line (30 %), over a tenth of the reach at least; thirty cycles. That the plane is that of "
        "the cube, how large that is, and load, speed and warming up, are for the procedure.",
        "five, thirty: as commonly reported; 2, 30 %, a tenth: this project",
    ),
    Clause(
        "frame",
        say("frame of the reference instrument"),
        "Pose accuracy only where its places are in the frame "
        "of the base: placed by best fit they would hide a common offset.",
        CHOSEN,
        of=("AP",),
    ),
    Clause(
        "test_uncertainty",
        say("test uncertainty"),
        "Of AP the reference instrument's, with alignment to the base; of RP what of it changes between cycles.",
        CHOSEN,
    ),
    ITS_RULE,
)
