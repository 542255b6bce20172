"""ISO 10360-3:2000: four-axis errors FR, FT, FA of two spheres on a turning table, against their limits.

The ranges of a sphere's coordinates are those of the recording itself: its size and its place cancel. What stays uncertain is
what of spheres and fixture changes between the positions of the table.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

from cmm_uq.analysis.conformity.plans import Condition
from cmm_uq.analysis.conformity.standard import NOT_STATED, Characteristic, Test
from cmm_uq.analysis.conformity.statement import CHOSEN, ITS_RULE, Clause, Statement
from cmm_uq.analysis.conformity.uncertainty import REPEAT_LINES, u_of_repeats
from cmm_uq.base.messages import Text, Verbatim, say
from cmm_uq.base.points import Floats, Points
from cmm_uq.base.rotary import RotaryMachine
from cmm_uq.base.units import MICROMETRE
from cmm_uq.machine.model.artefact import Artefact

POSITIONS, TURN_DEG = 7, 720.0  # of the table in each sense, beside that at the start; and how far it turns
_SAME, _ALIKE, _OPPOSITE = 0.01, 0.1, 30.0  # °; part of the radius; ° from opposite sides
_GAP = 0.25  # of a turn, or of the travel where that is less, without a position, at most
_TITLES = {
    "FR": say("radial four-axis error"),
    "FT": say("tangential four-axis error"),
    "FA": say("axial four-axis error"),
}


def four_axis_error(test: Test, figure: str) -> Statement:
    points = test.artefact.points
    figures = test.artefact.figures(np.ones(len(points), dtype=bool))
    test.refuse_nothing_measured(figure in figures, "spheres at several positions of the table")
    found = figures[figure]
    radii = np.round(found.lengths, 2)
    u = np.array([u_of_repeats(radius, test.circumstances) for radius in radii.tolist()])
    test.refuse_without_uncertainty(float(u.min()), "u_repeat_um")
    items = test.each_decided(
        np.asarray(found.values) / MICROMETRE, np.where(u > 0, np.maximum(u, test.least_u(radii)), u), radii, signed=False,
        measurement=[int(points.measurement[rows[0]]) for rows in found.rows], position=found.names,
        set_aside=np.array([test.set_aside(rows[None]).any() for rows in found.rows], dtype=bool),
    )  # fmt: skip
    how = say("u is what of spheres and fixture changed between the positions.") if items[0].u_um > 0 else NOT_STATED
    return test.stated(_TITLES[figure], say("spheres"), items, [how], signed=False)


def conditions(artefact: Artefact, *, recorded: bool) -> tuple[Condition, ...]:
    """Two spheres on opposite sides and at different heights, at the positions of the table, out and back."""
    points, machine = artefact.points, artefact.points.machine
    what = say(
        "two spheres at 0 and at {positions} positions of the table over {turn:g}°, or over its travel, and back",
        positions=POSITIONS,
        turn=TURN_DEG,
    )
    if not isinstance(machine, RotaryMachine) or machine.fourth is None or machine.fourth.column not in points.columns:
        return (Condition(what, (what,)),)
    lacks = [
        text
        for number in np.unique(points.measurement).tolist()
        for text in _lacking(points.select(points.measurement == number), machine, number, recorded=recorded)
    ]
    return (Condition(what, tuple(lacks)),)


def _lacking(points: Points, machine: RotaryMachine, number: int, *, recorded: bool) -> Iterator[Text]:
    spheres = [points.select(points.point == point) for point in (1, 2)]
    if min(map(len, spheres)) == 0:
        yield say("measurement {number}: spheres A and B", number=number)
        return
    axis = machine.fourth or machine.rotary[0]
    whole = axis.travel_deg[1] - axis.travel_deg[0]
    far = TURN_DEG if np.isnan(whole) else min(TURN_DEG, float(whole))
    for name, sphere in zip("AB", spheres, strict=True):
        read = sphere.columns[axis.column][np.argsort(sphere.repeat, kind="stable")]
        steps = np.diff(read)
        senses = [int(np.sum(sense * steps > _SAME)) for sense in (1, -1)]
        gap, back = _widest(read, min(far, 360.0)), abs(read[0] - read[-1]) <= _SAME
        if min(senses) < POSITIONS or np.ptp(read) < far - _SAME or not back or gap > _GAP * min(far, 360.0) + _SAME:
            yield say(
                "measurement {number}, sphere {name}: {out} positions out and {back} back over {turn:g}°, {gap:.0f}° without",
                number=number, name=Verbatim(name), out=senses[0], back=senses[1], turn=float(np.ptp(read)), gap=gap,
            )  # fmt: skip
        if recorded and len(np.unique(sphere.xyz, axis=0)) < len(sphere):
            yield say("measurement {number}: centres that repeat another to the last digit", number=number)
    low, high = (sphere.xyz.mean(axis=0) - machine.pivot(axis) for sphere in spheres)
    across = [i for i in range(3) if i != axis.about]
    a, b = low[across], high[across]
    radii = float(np.hypot(*a)), float(np.hypot(*b))
    turn = np.degrees(np.arccos(np.clip(-a @ b / (radii[0] * radii[1]), -1, 1)))
    if abs(radii[0] - radii[1]) > _ALIKE * max(radii) or turn > _OPPOSITE:
        yield say("measurement {number}: spheres at the same radius on opposite sides of the axis", number=number)
    if abs(low[axis.about] - high[axis.about]) < _ALIKE * max(radii):
        yield say("measurement {number}: spheres at different heights", number=number)


def _widest(read: Floats, turn: float) -> float:
    """Widest part of the turn, °, or of a smaller travel, in which no position lies; a whole turn closes."""
    there = np.sort(np.mod(read, 360.0) if turn >= 360.0 else read)
    return float(np.diff(there, append=there[0] + 360.0 if turn >= 360.0 else there[-1]).max())


CHARACTERISTICS = tuple(
    Characteristic(one, one, partial(four_axis_error, figure=one), conditions, needs="u_repeat_um", lines=REPEAT_LINES)
    for one in _TITLES
)
NAME = "ISO 10360-3:2000"
CLAUSES = (
    Clause(
        "scope", say("scope"),
        "Machines with three axes for coordinates and a rotary table that orients the workpiece.",
        "its publisher's abstract", True,
    ),
    Clause(
        "errors", say("four-axis errors"),
        "Range of the coordinates of each sphere's centre on the table over all "
        "positions, along the radius (FR), the tangent (FT) and the axis (FA); spheres A and B each by itself.",
        "names and directions: a manufacturer's summary; that they are ranges of each sphere: as commonly reported",
    ),
    Clause(
        "directions", say("directions"),
        "Radius from the stated axis through the mean of the sphere. A coordinate system "
        "made of the spheres themselves, as the standard may ask, is not made: it is moved and turned by no more than the "
        "errors themselves, which changes a range by their square over the radius.",
        CHOSEN,
    ),
    Clause(
        "spheres", say("where the spheres stand"),
        "A low and B high, at one radius (within 10 %) on opposite sides (within "
        "30°). Radius and height difference are stated with the result; those for which the limits hold, and the load, are "
        "for the procedure to state.",
        CHOSEN,
    ),
    Clause(
        "positions", say("positions of the table"),
        "At 0, at seven more in one sense over 720° or all of the travel, and at seven back to the start; "
        "no quarter of a turn, or of the travel, without one.",
        "seven, out and back: as commonly reported, not verified; 720°, a quarter: this project, the stricter reading",
    ),
    Clause("again", say("measuring again"), "Nothing is measured again.", CHOSEN),
    Clause(
        "test_uncertainty", say("test uncertainty"),
        "What of spheres and fixture changes between the positions; form of the spheres where it does not repeat.",
        CHOSEN,
    ),
    ITS_RULE,
)  # fmt: skip
