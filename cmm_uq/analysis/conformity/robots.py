"""Robots by ISO 9283: accuracy and repeatability of poses that were commanded again and again, places and orientations."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from math import comb

import numpy as np
from numpy.typing import NDArray

from cmm_uq.analysis.conformity import own_rule
from cmm_uq.analysis.conformity.arms import asked
from cmm_uq.analysis.conformity.own_rule import ORIENTATION_LINES, TURNING_LINES
from cmm_uq.analysis.conformity.plans import Condition
from cmm_uq.analysis.conformity.standard import Characteristic, Standard, Test, length_unstated
from cmm_uq.analysis.conformity.statement import CHOSEN, ITS_RULE, REPORTED, Clause, Statement
from cmm_uq.analysis.conformity.uncertainty import LENGTH_LINES, REPEAT_LINES
from cmm_uq.base.arm import Arm
from cmm_uq.base.messages import NOTHING, Text, Verbatim, say, semicolons
from cmm_uq.base.points import AXES, Floats, Points, last_digit
from cmm_uq.base.units import METRE
from cmm_uq.machine.model.artefact import Artefact

NAME = "ISO 9283:1998"
POSES, CYCLES = 5, 30
METRE_ARC = METRE  # mm; angles are arcs over it
ANGLES = "abc"
_FLAT = 0.02  # of the extent of five poses, by which they may lie beside a plane, and one of them beside their middle
# of their extent that of the narrower side at least, and of the reach, or the way from the base where that is not stated or
# is longer, the extent itself: five poses on a line, or side by side, are none of a cube
_NARROW, _NEAR = 0.3, 0.1
_CHANCE = 1e-3  # probability of as many equal readings by rounding, below which they are copies
_PLACES = tuple(f"reference_{axis}_mm" for axis in AXES)
_AT_ONCE = 4096  # pairs of places that are looked at together
_NAMED = 5  # copies that are named one by one


def _readings(points: Points, *, angles: bool) -> Floats | None:
    """(n, 3) what the reference instrument found: angles, °, where asked for and recorded, else places, mm."""
    for names in (tuple(f"reference_{angle}_deg" for angle in ANGLES) if angles else (), _PLACES):
        if names and all(name in points.columns for name in names):
            return np.column_stack([points.columns[name] for name in names])
    return None


def copied(points: Points, *, angles: bool = False) -> dict[int, int]:
    """By row of readings that equal an earlier one of their pose to the last digit, that row; none where rounding explains it.

    Two readings are equal by chance with the probability of each coordinate, its last digit over 2·√π standard deviations,
    multiplied; whole cycles that are copied are those of ``points.copies``.
    """
    read = _readings(points, angles=angles)
    if read is None or not len(points):
        return {}
    tips = [points.columns.get(f"tip_{axis}_mm", np.zeros(len(points))) for axis in AXES]
    places = np.column_stack([points.measurement, points.point, *tips])
    _, of = np.unique(places, axis=0, return_inverse=True)
    order = np.lexsort((points.repeat, of.ravel()))
    poses = np.split(order, np.cumsum(np.bincount(of.ravel()))[:-1])
    found, pairs, equal = dict[int, int](), 0, 0
    for rows in poses:
        alike: dict[bytes, list[int]] = {}
        for row in rows.tolist():
            alike.setdefault((read[row] + 0.0).tobytes(), []).append(row)
        for original, *later in alike.values():
            found |= dict.fromkeys(later, original)
            equal += comb(len(later) + 1, 2)
        pairs += comb(len(rows), 2)
    if not found:
        return {}
    from scipy.special import gammainc

    sd = np.median([read[rows].std(axis=0, ddof=1) for rows in poses if len(rows) > 1], axis=0)
    step = np.array([last_digit(read[:, k]) for k in range(3)])
    with np.errstate(divide="ignore", invalid="ignore"):
        chance = np.where(step > 0, np.minimum(1.0, step / (2 * np.sqrt(np.pi) * sd)), 0.0)
    by_rounding = float(gammainc(equal, pairs * float(np.prod(chance))))  # so many or more, of a Poisson distribution
    return {} if by_rounding >= _CHANCE else found


def counting(points: Points, *, angles: bool = False) -> NDArray[np.bool_]:
    """Which readings (n,) are of no copied cycle, and copied from no other cycle of their pose."""
    counts = own_rule.counting(points)
    counts[list(copied(points, angles=angles))] = False
    return counts


def poses(figure: str, artefact: Artefact, *, recorded: bool) -> tuple[Condition, ...]:
    """Five poses, one in the middle of four, all in one plane, each thirty times in one measurement, as figures are of one."""
    points, turned = artefact.points, figure[-1] in ANGLES
    counts = counting(points, angles=turned) if recorded else np.ones(len(points), dtype=bool)
    cycles: dict[tuple[int, int], list[Floats]] = {}
    each = artefact.figures(counts).get(figure)
    least: dict[tuple[int, int], int] = {}
    for rows in () if each is None else each.rows:
        of = int(points.measurement[rows[0]]), int(points.point[rows[0]])
        least[of] = min(least.get(of, CYCLES), len(np.unique(points.repeat[rows])))
        cycles.setdefault(of, []).append(points.xyz[np.unique(rows)].mean(axis=0))
    whole: dict[int, list[Floats]] = {}
    for (measurement, pose), at in cycles.items():
        if least[measurement, pose] >= CYCLES:
            whole.setdefault(measurement, []).append(at[0])
    what = say("{poses} poses, each commanded {cycles} times", poses=POSES, cycles=CYCLES)
    if turned:
        what = say(
            "{poses} poses, each with its orientation, by angles or by three reflectors and b not within 10° of ±90°, "
            "{cycles} times",
            poses=POSES,
            cycles=CYCLES,
        )
    found = [asked(what, POSES, max(map(len, whole.values()), default=0))]
    plane = say("a pose in the middle of four others, all in one plane, over a tenth of the reach")
    machine = points.machine
    reach = machine.reach_mm if isinstance(machine, Arm) else np.nan
    flat = any(five_in_a_plane(np.array(at), reach) for at in whole.values())
    found.append(Condition(plane, () if flat else (plane,)))
    return tuple(found)


def five_in_a_plane(at: Floats, reach: float = np.nan) -> bool:
    """Whether five of some places (n, 3) lie in a plane, one of them in the middle of the four others, wide enough.

    Two pairs have their middle at a place when their sums add to four times it: neighbours in a tree of all sums.
    """
    if len(at) < POSES:
        return False
    from scipy.spatial import cKDTree

    ends = np.column_stack(np.triu_indices(len(at), 1))
    sums, apart = at[ends].sum(axis=1), 4 * _FLAT * float(np.ptp(at, axis=0).max()) * (1 + 1e-9)
    tree = cKDTree(sums)
    for middle, place in enumerate(at):
        for pairs in np.split(np.arange(len(sums)), np.arange(_AT_ONCE, len(sums), _AT_ONCE)):
            near = tree.query_ball_point(4 * place - sums[pairs], apart, return_sorted=False)
            first = np.repeat(pairs, [len(others) for others in near])
            second = np.concatenate([np.array(others, dtype=np.int64) for others in near])
            four = np.hstack([ends[first], ends[second]])[first < second]
            four = four[np.all(four != middle, axis=1) & np.all(four[:, :2, None] != four[:, None, 2:], axis=(1, 2))]
            if np.any(_in_a_plane(at[np.insert(four, 0, middle, axis=1)], reach)):
                return True
    return False


def _in_a_plane(at: Floats, reach: float) -> NDArray[np.bool_]:
    """Of fives (m, 5, 3), the first of them the middle one."""
    extent = np.ptp(at, axis=1).max(axis=1)
    middle = np.linalg.norm(at[:, 0] - at[:, 1:].mean(axis=1), axis=1) <= _FLAT * extent
    near, size = at[middle], extent[middle]
    sides = np.linalg.svd(near - near.mean(axis=1, keepdims=True), compute_uv=False)
    away = np.fmax(reach, np.linalg.norm(near[:, 0], axis=1))
    wide = (sides[:, 1] >= _NARROW * sides[:, 0]) & (size >= _NEAR * away)
    return np.asarray(wide & (sides[:, 2] <= _FLAT * size))


_AGAIN = "poses that were commanded again and again"
_IN_BASE = 'seen in the frame of the base (frame = "base" in [artefact])'


def pose_error(test: Test, *, figure: str, title: Text, what: str, lines: tuple[str, ...]) -> Statement:
    """A figure of every pose against its limit; readings that are copies of another of their pose do not count."""
    points, angles = test.recorded.points, figure[-1] in ANGLES
    figures = test.artefact.figures(counting(points, angles=angles))
    test.refuse_nothing_measured(figure in figures, what)
    signed = angles and figure.startswith("AP")
    found = own_rule.figure_decided(test, figures[figure], title, say("places"), lines, of_two_sides=signed)
    said = copies_in_words(points, copied(points, angles=angles))
    return replace(found, remarks=(*found.remarks, said)) if said else found


def copies_in_words(points: Points, copies: Mapping[int, int]) -> Text:
    """Which readings are copies of which, that are of no copied cycle; empty when none is."""
    rows = [row for row in sorted(copies) if own_rule.counting(points)[row]]
    numbers = ((int(points.point[row]), *(int(points.repeat[i]) for i in (row, copies[row]))) for row in rows)
    each = [say("pose {pose}, cycle {later} of cycle {first}", pose=p, later=i, first=j) for p, i, j in numbers]
    if not each:
        return NOTHING
    named, more = semicolons(each[:_NAMED]), len(each) - _NAMED
    if more <= 0:
        return say("Readings copied to the last digit, which do not count: {copies}.", copies=named)
    return say(
        "Readings copied to the last digit, which do not count: {copies} and {count} more.", copies=named, count=more
    )


def _figure(name: str, title: Text, what: str, lines: tuple[str, ...], needs: str | None = None) -> Characteristic:
    decides = partial(pose_error, figure=name, title=title, what=what, lines=lines)
    unstated = length_unstated if lines == LENGTH_LINES else lambda artefact: None
    return Characteristic(
        name, name, decides, partial(poses, name), unstated, needs=needs, lines=lines, angle=name[-1] in ANGLES
    )


_TURNED = (
    "poses commanded again and again whose orientation was recorded (three reflectors, or reference_a_deg, …_b_, …_c_)"
)
STANDARD = Standard(
    NAME,
    (
        _figure(
            "RP",
            say("pose repeatability: mean distance from the barycentre and three standard deviations"),
            _AGAIN,
            REPEAT_LINES,
            "u_repeat_um",
        ),
        _figure(
            "AP",
            say("pose accuracy: distance of the barycentre from the commanded place"),
            f"{_AGAIN}, {_IN_BASE}",
            LENGTH_LINES,
        ),
        *(
            _figure(
                f"RP_{angle}",
                say(
                    "repeatability of the angle {angle}, about {axis} of the base: three standard deviations, as an arc over "
                    "a metre",
                    angle=Verbatim(angle),
                    axis=Verbatim(axis),
                ),
                _TURNED,
                TURNING_LINES,
                "u_repeat_arcsec",
            )
            for angle, axis in zip(ANGLES, AXES, strict=True)
        ),
        *(
            _figure(
                f"AP_{angle}",
                say(
                    "accuracy of the angle {angle}, about {axis} of the base: mean less the commanded one, as an arc over "
                    "a metre",
                    angle=Verbatim(angle),
                    axis=Verbatim(axis),
                ),
                f"{_TURNED} and commanded, {_IN_BASE}",
                ORIENTATION_LINES,
                "u_orientation_arcsec",
            )
            for angle, axis in zip(ANGLES, AXES, strict=True)
        ),
    ),
    (say("RP and AP are of positions, RP_a to AP_c of angles; nothing else that ISO 9283 characterises is tested."),),
)
CLAUSES = (
    Clause(
        "accuracy",
        say("pose accuracy"),
        "AP = distance of the barycentre of the places attained from the commanded one, of each pose.",
        REPORTED,
        of=("AP",),
    ),
    Clause(
        "repeatability",
        say("pose repeatability"),
        "RP = l̄ + 3·S of the distances l from the barycentre, n − 1, of each pose.",
        REPORTED,
        of=("RP",),
    ),
    Clause(
        "orientation",
        say("orientation"),
        "AP_a = mean of the angles attained less the one commanded, with its sign, RP_a = 3·S of them, n − 1; b and c "
        "likewise. a, b, c turn about x, y, z of the base, in this order; measured, or of three or more reflectors by least "
        "squares.",
        "the figures: as commonly reported; the order of the turns, and that poses with b within 10° of ±90° have none: this "
        "project",
        of=tuple(f"{of}_{angle}" for of in ("RP", "AP") for angle in ANGLES),
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
        of=("AP", *(f"AP_{angle}" for angle in ANGLES)),
    ),
    Clause(
        "copies",
        say("copied cycles"),
        "A reading that equals another of its pose to the last digit is no cycle, where rounding explains it less often than "
        "once in a thousand.",
        CHOSEN,
    ),
    Clause(
        "test_uncertainty",
        say("test uncertainty"),
        "Of AP the reference instrument's, with alignment to the base; of RP what of it changes between cycles; of angles "
        "likewise, stated as angles.",
        CHOSEN,
    ),
    ITS_RULE,
)
