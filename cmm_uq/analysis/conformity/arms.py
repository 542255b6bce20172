"""Articulated arms by ISO 10360-12 and ASME B89.4.22.

Neither was at hand; what follows is as manufacturers and papers describe the tests, and the clauses say which figure is
this project's own. Places are those from the base of the arm, whose reach the job states: without it no test is complete.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from functools import partial

import numpy as np
from numpy.typing import NDArray

from cmm_uq.analysis.conformity import decided, own_rule
from cmm_uq.analysis.conformity.as_recorded import repeats_of_gauge, supplemented
from cmm_uq.analysis.conformity.own_rule import figure_of, form_unstated
from cmm_uq.analysis.conformity.plan_conditions import most_apart, neighbours, nominals, sphere_points
from cmm_uq.analysis.conformity.plans import ISO_10360_2, Condition, SpherePlan
from cmm_uq.analysis.conformity.standard import (
    NOT_STATED,
    Characteristic,
    Standard,
    Test,
    diameter_allowed,
    length_unstated,
)
from cmm_uq.analysis.conformity.statement import CHOSEN, ITS_RULE, REPORTED, Clause, Statement
from cmm_uq.analysis.conformity.uncertainty import FORM_LINES, LENGTH_LINES, SIZE_LINES, causes_of_lengths
from cmm_uq.base.arm import Arm
from cmm_uq.base.messages import Text, Verbatim, say
from cmm_uq.base.points import Floats, Points
from cmm_uq.base.units import MICROMETRE
from cmm_uq.base.values import dataclass, replace
from cmm_uq.machine.model.artefact import Artefact, Indications
from cmm_uq.machine.model.kind import FORMS, LENGTHS

NAMES = ("ISO 10360-12:2016", "ASME B89.4.22-2004")
SPHERE = SpherePlan(25, 45.0, (10.0, 51.0))
DIAMETER = SpherePlan(9, 60.0, (10.0, 50.0))
ORIENTATIONS, ORIENTED_POINTS = 5, 5
LINES, ON_LINE, REPEATS, LONGEST = 7, 5, 3, 0.66  # of lengths; the longest over the measuring range, twice the reach
BARS, EITHER, SHORT, LONG = 20, 6, (0.5, 0.75), (1.2, 1.5)  # positions; of either bar; its length over the reach
READINGS, ZONES = 10, ((0.0, 0.2), (0.2, 0.8), (0.8, np.inf))  # in each seat; its distance from the base over the reach
_OTHERWISE = 10.0  # ° (mm) by which some joint stands otherwise in another orientation
_FAR = 0.25  # of the reach, from which on two places are two
_SAME_MM = 100.0  # lines nearer than this, and within 10°, are one
_ALONG = np.cos(np.radians(10.0))


def _reach(artefact: Artefact) -> tuple[float, Condition]:
    machine = artefact.points.machine
    reach = machine.reach_mm if isinstance(machine, Arm) else np.nan
    what = say("the reach of the arm, by which places and lengths go")
    return reach, Condition(what, () if reach > 0 else (what,), Verbatim("[machine.arm] reach_mm"))


def _up(artefact: Artefact) -> Floats:
    machine = artefact.points.machine
    return machine.up if isinstance(machine, Arm) else np.array([0.0, 0.0, 1.0])


def asked(what: Text, wanted: int, count: int) -> Condition:
    return Condition(what, () if count >= wanted else (say("{what} ({count})", what=what, count=count),))


def _groups(points: Points, *, recorded: bool, least: int = 1) -> dict[int, list[int]]:
    """By measurement its repeats, as groups, that are no copies and have so many different points."""
    found: dict[int, list[int]] = {}
    for group, rows in enumerate(points.rows_of_groups):
        if not (recorded and group in points.copies) and len(np.unique(points.xyz[rows], axis=0)) >= least:
            found.setdefault(points.run_of(group)[0], []).append(group)
    return found


def _turned(points: Points, groups: list[int]) -> Collection[int]:
    """Of groups those between which some joint turned; all of them where no joints were read."""
    if not (isinstance(points.machine, Arm) and points.machine.joints):
        return groups
    read = np.column_stack([points.readings[joint] for joint in points.machine.joints])
    at = {group: read[points.rows_of_groups[group]].mean(axis=0) for group in groups}
    return most_apart({i: {j for j in at if j != i and np.abs(at[i] - at[j]).max() < _OTHERWISE} for i in at})


def _two_places(artefact: Artefact, what: Text, repeats: int, least: int, *, recorded: bool) -> Condition:
    """That what is measured in one place was measured in another, so far from it as counts."""
    points, reach = artefact.points, _reach(artefact)[0]
    every = _groups(points, recorded=recorded, least=least).values()
    whole = [own for own in every if len(own if repeats == 1 else _turned(points, own)) >= repeats]
    middles = [np.mean([points.xyz[points.rows_of_groups[g]].mean(axis=0) for g in own], axis=0) for own in whole]
    far = max((float(np.linalg.norm(a - b)) for a in middles for b in middles), default=0.0)
    return asked(what, 2, 2 if far >= _FAR * reach else min(len(whole), 1))


def spheres(
    plan: SpherePlan, repeats: int, places: int, artefact: Artefact, *, recorded: bool
) -> tuple[Condition, ...]:
    """Enough points over every sphere, as often in one place, and two places where so many are asked for."""
    forms, points = artefact.forms(), artefact.points
    if forms is None:
        return ()
    found = [*sphere_points(plan, points, forms.directions, points.copies if recorded else {})]
    if repeats > 1:
        most = max(map(len, _groups(points, recorded=recorded, least=plan.points).values()), default=0)
        found.append(asked(say("{repeats} measurements of one sphere", repeats=repeats), repeats, most))
    if places > 1:
        what = say("two places of the sphere, a quarter of the reach apart")
        found += [_two_places(artefact, what, 1, plan.points, recorded=recorded), _reach(artefact)[1]]
    return tuple(found)


def oriented(artefact: Artefact, *, recorded: bool) -> tuple[Condition, ...]:
    """Five orientations of five points each, in two places of the sphere."""
    what = say("{orientations} orientations of {points} points each, in two places a quarter of the reach apart",
               orientations=ORIENTATIONS, points=ORIENTED_POINTS)  # fmt: skip
    return (_two_places(artefact, what, ORIENTATIONS, ORIENTED_POINTS, recorded=recorded), _reach(artefact)[1])


def seats(artefact: Artefact, *, recorded: bool) -> tuple[Condition, ...]:
    """Ten readings in each of three seats: near the base, in the middle of the reach, and far out."""
    points, (reach, stated) = artefact.points, _reach(artefact)
    whole = [own for own in _groups(points, recorded=recorded).values() if len(_turned(points, own)) >= READINGS]
    away = [float(np.linalg.norm(points.machine_xyz[np.isin(points.group, own)].mean(axis=0))) / reach for own in whole]
    lacks = [
        say(
            "{readings} readings of a seat {low:.0f} to {high:.0f} % of the reach from the base",
            readings=READINGS,
            low=100 * low,
            high=min(100 * high, 100.0),
        )
        for low, high in ZONES
        if not any(low <= one < high for one in away)
    ]
    what = say("{readings} readings in each of three seats: near, in the middle and far out", readings=READINGS)
    return (Condition(what, tuple(lacks)), stated)


def _steepness(along: Floats, up: Floats) -> int:
    """0 of a horizontal direction, 2 of a vertical one, 1 of any other."""
    rise = abs(float(along @ up)) / float(np.linalg.norm(along))
    return 2 if rise > _ALONG else 1 if rise > np.sin(np.arccos(_ALONG)) else 0


_STEEP = (say("a horizontal one"), say("an oblique one"), say("a vertical one"))


def _directions(along: list[Floats], up: Floats) -> Condition:
    there = {_steepness(one, up) for one in along}
    return Condition(
        say("of them a horizontal, an oblique and a vertical one"),
        tuple(one for i, one in enumerate(_STEEP) if i not in there),
    )


@dataclass(frozen=True, eq=False)
class _Line:
    point: Floats
    along: Floats

    def holds(self, points: Floats, along: Floats) -> NDArray[np.bool_]:
        """Which of some lengths, by a point on their line and its direction (m, 3) each, lie on this one."""
        beside = points - self.point
        off = np.linalg.norm(beside - (beside @ self.along)[:, None] * self.along, axis=1)
        return np.asarray((np.abs(along @ self.along) > _ALONG) & (off < _SAME_MM))


def arm_lengths(chosen: decided.Chosen, artefact: Artefact, *, recorded: bool) -> tuple[Condition, ...]:
    """Seven lines of five lengths, each three times; the longest over two thirds of the measuring range."""
    found, points, (reach, stated) = artefact.indications(), artefact.points, _reach(artefact)
    whole: dict[int, _Line] = {}  # lines with enough lengths, each by a measurement on it
    longest = 0.0
    if found is not None:
        group, number = (of[found.rows[:, 0]] for of in (points.group, points.measurement))
        own = np.flatnonzero(chosen(artefact, found) & ~np.isin(group, list(points.copies) if recorded else []))
        middles, along = (of[own] for of in artefact.lines_of(found.rows))
        along = along / np.linalg.norm(along, axis=1)[:, None]
        each = np.unique(np.column_stack([nominals(found.lengths)[own], group[own], own]), axis=0)
        for measurement in np.unique(number[own]).tolist():
            first = int(np.flatnonzero(number[own] == measurement)[0])
            line = _Line(middles[first], along[first])
            here = np.isin(each[:, 2], own[line.holds(middles, along)])
            of, times = np.unique(np.unique(each[here, :2], axis=0)[:, 0], return_counts=True)
            if len(often := of[times >= REPEATS]) >= ON_LINE:
                whole[measurement] = line
                longest = max(longest, float(found.lengths[each[here & (each[:, 0] == often[-1]), 2]].max()))
    near = {
        i: {j for j, other in whole.items() if j != i and line.holds(other.point[None], other.along[None])[0]}
        for i, line in whole.items()
    }
    taken = most_apart(near)
    what = say("{lines} lines of {count} lengths, each {repeats} times", lines=LINES, count=ON_LINE, repeats=REPEATS)
    least = say("longest length at least {share:.0f} % of the measuring range, twice the reach", share=100 * LONGEST)
    lacks = say("{least} ({length:.0f} mm)", least=least, length=longest)
    return (
        asked(what, LINES, len(taken)),
        _directions([line.along for line in whole.values()], _up(artefact)),
        Condition(least, () if longest >= 2 * LONGEST * reach else (lacks,)),
        *_known_sides(artefact, found),
        stated,
    )


def _known_sides(artefact: Artefact, found: Indications | None) -> Iterator[Condition]:
    if found is not None and artefact.bidirectional(found.rows) is None:
        what = say("from which side each end was reached")
        yield Condition(what, (what,), Verbatim("columns approach_x, approach_y, approach_z"))


def of_sides(both: bool) -> decided.Chosen:
    """Lengths whose ends were reached from opposite sides, or from one; where nobody knows, all."""

    def chosen(artefact: Artefact, found: Indications) -> NDArray[np.bool_]:
        known = artefact.bidirectional(found.rows)
        return np.ones(len(found.rows), dtype=bool) if known is None else np.asarray(known == both)

    return chosen


def bars(artefact: Artefact, *, recorded: bool) -> tuple[Condition, ...]:
    """Twenty positions of a short and a long bar, in three inclinations."""
    found, points, (reach, stated) = artefact.indications(), artefact.points, _reach(artefact)
    ends: dict[int, tuple[Floats, int]] = {}  # of each measurement its bar, and whether it is the short or the long one
    if found is not None:
        for rows, length in zip(found.rows, found.lengths, strict=True):
            which = next((i for i, (low, high) in enumerate((SHORT, LONG)) if low <= length / reach <= high), None)
            if which is not None and not (recorded and int(points.group[rows[0]]) in points.copies):
                ends[int(points.measurement[rows[0]])] = points.xyz[rows], which
    taken = most_apart(neighbours({i: bar for i, (bar, _) in ends.items()}, 10.0))
    counts = [sum(ends[i][1] == which for i in taken) for which in (0, 1)]
    return (
        asked(say("{count} positions of the bars", count=BARS), BARS, len(taken)),
        *(
            asked(
                say(
                    "{count} of them of a bar of {low:.0f} to {high:.0f} % of the reach",
                    count=EITHER,
                    low=100 * low,
                    high=100 * high,
                ),
                EITHER,
                count,
            )
            for (low, high), count in zip((SHORT, LONG), counts, strict=True)
        ),
        _directions([ends[i][0][1] - ends[i][0][0] for i in taken], _up(artefact)),
        stated,
    )


def twice_rms(test: Test) -> Statement:
    """Twice the root mean square of the errors of all lengths, n − 1; u is what no correlation of them exceeds."""
    found = test.indications()
    own = own_rule.counting(test.recorded.points)[found.rows].all(axis=1)
    test.refuse_nothing_measured(int(own.sum()) > 1, "two lengths or more")
    u = causes_of_lengths(found, test.artefact, test.circumstances).at_least(test.least_u(found.lengths)).u[own]
    test.refuse_without_uncertainty(float(u.min()), "u_um")
    value, whole = (2 * float(np.sqrt(np.sum(x**2) / (own.sum() - 1))) for x in (found.errors[own] / MICROMETRE, u))
    length = float(found.lengths[own].mean())
    aside, limit = bool(test.set_aside(found.rows[own]).any()), test.limit_um(length)
    item = test.decided(value, whole, limit, signed=False, length_mm=length, set_aside=aside)
    what = say("u is twice the root mean square of those of the lengths, which no correlation of them exceeds.")
    remark = what if whole > 0 else NOT_STATED
    return test.stated(
        say("twice the root mean square of the errors of length"), say("figures"), (item,), [remark], signed=False
    )


def _gauge(test: Test) -> tuple[Condition, ...]:
    beside = test.circumstances.short_gauge
    return repeats_of_gauge(beside, test.indications(), REPEATS, ISO_10360_2.shortest_mm) if beside else ()


def _of_sphere(
    name: str,
    errors: Callable[[Test], Statement],
    lines: tuple[str, ...],
    plan: SpherePlan,
    repeats: int,
    places: int,
    *also: str,
) -> Characteristic:
    unstated = form_unstated if lines == FORM_LINES else length_unstated
    whole, allowed = partial(spheres, plan, repeats, places), partial(diameter_allowed, plan=plan)
    return Characteristic(name, FORMS, errors, whole, unstated, allowed, also, lines=lines)


def _lengths(name: str, both: bool) -> Characteristic:
    chosen = of_sides(both)
    errors, whole = partial(decided.errors_of_indication, chosen=chosen), partial(arm_lengths, chosen)
    one = Characteristic(name, LENGTHS, errors, whole, length_unstated, lines=LENGTH_LINES)
    return replace(one, asks=_gauge, beside=supplemented) if both else one


_ISO_10360_12, _B89_4_22 = NAMES
_SEATS = "a seat that was read again"
STANDARDS = (
    Standard(_ISO_10360_12, (
        _of_sphere("P_Form.Sph.1x25::Tact.AArm", decided.form_error, FORM_LINES, SPHERE, 1, 2, "P_Form"),
        _of_sphere("P_Size.Sph.1x25::Tact.AArm", decided.size_error, SIZE_LINES, SPHERE, 1, 2, "P_Size"),
        figure_of("L_Dia.5x5:Art:Tact.AArm", say("diameter of the sphere about the centres of all orientations"),
                "a sphere measured in several orientations of the arm (repeat)", oriented, "L_Dia"),
        _lengths("E_Uni", both=False), _lengths("E_Bi", both=True),
    ), sensing="contacting"),
    Standard(_B89_4_22, (
        *(Characteristic(f"volumetric performance{of}", LENGTHS, decides, bars, length_unstated, lines=LENGTH_LINES)
          for of, decides in (("", decided.errors_of_indication), (" 2 RMS", twice_rms))),
        _of_sphere("effective diameter", decided.size_error, SIZE_LINES, DIAMETER, 3, 1),
        figure_of("SPAT", say("twice the standard deviation of the readings of one seat"), _SEATS, seats),
        figure_of("SPAT maximum", say("largest distance of a reading from the mean of its seat"), _SEATS, seats),
    ), sensing="contacting"),
)  # fmt: skip

_MAKER = "a manufacturer's summary (Kreon)"
CLAUSES = {
    _ISO_10360_12: (
        Clause("scope", say("scope"), "Articulated arms with contacting probes; line scanners (its annex E) are not tested.",
               "its publisher's abstract", True),
        Clause("ball", say("form and size of a sphere"), "25 points on a sphere in two places, about the least-squares "
               "sphere; each place is decided.", _MAKER),
        Clause("places", say("places of the sphere"), "A quarter of the reach apart at least; points over a hemisphere within "
               "45°; sphere of 10 to 51 mm.", CHOSEN),
        Clause("articulated", say("articulated location error"), "Five points in each of five orientations of the arm, "
               "numbered by repeat; the diameter of the smallest sphere that holds the five centres, in two places.",
               f"{_MAKER}: five points, the probe pointing one way, and the name 5x5; that it is the smallest sphere: the "
               "figure is called a diameter; two places: this project"),
        Clause("orientations", say("orientations"), "Where joints are read, each turns some joint by 10° from every "
               "other, else that they differ is for the procedure; the centre is that of the least-squares sphere"
               " of free diameter.", CHOSEN),
        Clause("lengths", say("lengths"), "Seven lines (10° or 100 mm apart) of five lengths, each three times; a horizontal, "
               "a vertical and an oblique line; the longest at least 66 % of the measuring range.", "105 lengths: as commonly "
               "reported of the series; the rest: this project, the stricter reading", of=("E_Uni", "E_Bi")),
        Clause("sides", say("unidirectional and bidirectional lengths"), "Ends approached in one sense, or in opposite ones; "
               "distances of balls are bidirectional with a short gauge beside them.", REPORTED, of=("E_Uni", "E_Bi")),
        Clause("again", say("measuring again"), "Nothing is measured again.", CHOSEN),
        Clause("test_uncertainty", say("test uncertainty"), "That of the artefact alone.", CHOSEN),
        ITS_RULE,
    ),
    _B89_4_22: (
        Clause("scope", say("scope"), "Arms of up to seven joints, moved by hand, with contacting probes; performance is "
               "effective diameter, single-point articulation and volumetric performance.", "its publisher's abstract", True),
        Clause("diameter", say("effective diameter"), "A sphere of 10 to 50 mm, nine points over a hemisphere within 60°, "
               "three times; each diameter against the certified one.", "nine points, three times: as commonly reported; the "
               "rest: this project", of=("effective diameter",)),
        Clause("articulation", say("single-point articulation"), "Ten readings of a seat in each of three zones, up to 20 %, "
               "to 80 % and beyond 80 % of the reach, each with some joint turned by 10° from every other where joints are "
               "read, else that they differ is for the procedure; twice the standard deviation of the distances from their "
               "mean, n − 1, and the largest distance.", "two standard deviations: a manufacturer's words; the rest: as "
               "commonly reported",
               of=("SPAT", "SPAT maximum")),
        Clause("volumetric", say("volumetric performance"), "Twenty positions of two bars, of 50 to 75 % and of 120 to 150 % "
               "of the reach; each deviation, and twice their root mean square, n − 1.", REPORTED,
               of=("volumetric performance", "volumetric performance 2 RMS")),
        Clause("positions", say("positions of the bars"), "Six at least of either bar; a horizontal, a vertical and an "
               "oblique one; an end 10 mm from those of every other. In which octants they lie is for the procedure.", CHOSEN,
               of=("volumetric performance", "volumetric performance 2 RMS")),
        Clause("test_uncertainty", say("test uncertainty"), "That of the artefact alone.", CHOSEN),
        ITS_RULE,
    ),
}  # fmt: skip
