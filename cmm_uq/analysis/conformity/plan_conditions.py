"""Whether a plan or a recording is a complete test with bars and test spheres.

A plan and a recording are held to the same conditions. Of a recording alone, what repeats another measurement to the last
digit does not count: that is a copy, where in a plan it is a wish.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from itertools import groupby

import numpy as np

from cmm_uq.analysis.conformity.length_conditions import lengths_measured
from cmm_uq.analysis.conformity.plans import PARALLELS, BarPlan, Condition, LengthPlan, Plan, SpherePlan, position_of
from cmm_uq.base.messages import Text, at_key, commas, number, plural, say
from cmm_uq.base.points import Floats, Points
from cmm_uq.machine.model.artefact import Artefact

_SEARCHED = 60  # Bars that hang together, each near another of them
_DIRECTIONS = 400  # On a hemisphere, at which the reach of its points is looked at


def bar_positions(plan: BarPlan, artefact: Artefact, copies: Mapping[int, int]) -> tuple[Condition, ...]:
    """How many different positions, and in which directions; ``copies`` are groups that do not count."""
    points, travel = artefact.points, artefact.points.machine.travel_mm
    known = bool(np.all(np.isfinite(travel)))
    wanted = plan.positions_in(np.ptp(travel, axis=1)) if known else plan.positions
    first = np.unique(artefact.measurement, return_index=True)[1]  # bar of each measurement, with its ends (q, 2, 3)
    numbers, ends = artefact.measurement[first].tolist(), np.asarray(points.xyz[artefact.rows[first]], dtype=np.float64)
    # Measurements that are no further position: within how many mm of which other, or a copy of it
    found: dict[int, tuple[float | None, int]] = {}
    for later, original in copies.items():
        (one, _), (two, _) = points.run_of(original), points.run_of(later)
        if one != two:
            found[two] = None, one
    left = [i for i, own in enumerate(numbers) if own not in found]
    near = {i: {j for j in left if j != i and _apart(ends[i], ends[j]) < plan.apart_mm} for i in left}
    kept = most_apart(near)
    same = found | {numbers[i]: (plan.apart_mm, numbers[min(near[i] & kept)]) for i in left if i not in kept}
    count = sum(number not in same for number in numbers)
    missing: list[Text] = []
    if count < wanted:
        lack = say("{lack} of {wanted} positions: {count} distinct", lack=wanted - count, wanted=wanted, count=count)
        missing.append(commas((lack, *_in_words(same))))
    if not known:
        missing.append(say("the travel of all three axes{key}, by whose proportions the number of positions goes",
                           key=at_key("[machine] travel_mm")))  # fmt: skip
    copied = {number for number, (apart, _) in same.items() if apart is None}
    taken = {position_of(b - a) for (a, b), number in zip(ends, numbers, strict=True) if number not in copied}
    absent = [d if d in PARALLELS else say("along {position}", position=d) for d in plan.directions if d not in taken]
    lines = tuple(say("position {along}", along=along) for along in absent)
    asked = say("along the axes, and the face and space diagonals of the volume")
    if lines:
        asked = say("along the axes, and the face and space diagonals of the volume; missing: {missing}",
                    missing=commas(lines))  # fmt: skip
    positions = say("at least {wanted} positions of the bar: {count}", wanted=wanted, count=count)
    return Condition(positions, tuple(missing)), Condition(asked, lines)


def most_apart(near: Mapping[int, Collection[int]]) -> set[int]:
    """A largest set of which none is near another, of equally large ones that with the earlier members.

    A choice in the order of the recording, by which groups of more than ``_SEARCHED`` are chosen from all the same, could grow
    when one is taken away that lies between two others.
    """
    left, chosen = set(near), set[int]()
    while left:
        group, further = set[int](), {min(left)}
        while further:
            group |= further
            further = {j for i in further for j in near[i]} - group
        chosen |= _largest(near, group) if len(group) <= _SEARCHED else _in_order(near, group)
        left -= group
    return chosen


def _largest(near: Mapping[int, Collection[int]], group: set[int]) -> set[int]:
    left, chosen = set(group), set[int]()
    while left:
        degree = {i: len(left.intersection(near[i])) for i in sorted(left)}
        single = next((i for i, count in degree.items() if count <= 1), None)
        if single is None:
            most = max(degree, key=lambda i: degree[i])
            with_it, without = (_largest(near, left - {most, *gone}) for gone in (near[most], ()))
            return chosen | ({most, *with_it} if len(with_it) + 1 >= len(without) else without)
        chosen.add(single)
        left -= {single, *near[single]}
    return chosen


def _in_order(near: Mapping[int, Collection[int]], group: set[int]) -> set[int]:
    chosen = set[int]()
    for i in sorted(group):
        if chosen.isdisjoint(near[i]):
            chosen.add(i)
    return chosen


def _in_words(same: dict[int, tuple[float | None, int]]) -> list[Text]:
    """One sentence for all that are the same of one other; copies come first."""
    told: list[Text] = []
    for apart, other in sorted(set(same.values()), key=lambda pair: (pair[1], pair[0] is not None)):
        numbers = sorted(own for own, pair in same.items() if pair == (apart, other))
        which = _listed(numbers)
        if apart is None:
            one = say("measurement {which} is a copy of {other}", which=which, other=other)
            many = say("measurements {which} are copies of {other}", which=which, other=other)
        else:
            one = say("measurement {which} is within {apart:g} mm of {other}", which=which, apart=apart, other=other)
            many = say("measurements {which} are within {apart:g} mm of {other}", which=which, apart=apart, other=other)
        told.append(plural(len(numbers), one=one, many=many))
    return told


def _listed(numbers: Sequence[int]) -> Text:
    """Numbers in ascending order, those that follow each other as from 2 to 20."""
    told: list[Text] = []
    for _, run in groupby(enumerate(numbers), key=lambda pair: pair[1] - pair[0]):
        own = [value for _, value in run]
        told += [say("{first} to {last}", first=own[0], last=own[-1])] if len(own) > 2 else map(number, own)
    return commas(told)


def _apart(one: Floats, two: Floats) -> float:
    """Larger distance of the ends (2, 3) of two bars, whichever way round they lie, mm."""
    return float(min(np.linalg.norm(one - turned, axis=1).max() for turned in (two, two[::-1])))


def sphere_points(
    plan: SpherePlan, points: Points, directions: Floats, copies: Mapping[int, int]
) -> tuple[Condition, ...]:
    """How many points on each sphere, and whether they cover it; ``directions`` (n, 3) outward from its middle."""
    wanted, reach, lacking, bare = plan.points, plan.reach_deg, [], []
    for group, rows in enumerate(points.rows_of_groups):
        if group in copies:
            continue
        count = len(np.unique(points.xyz[rows] + 0.0, axis=0))
        name = say("measurement {number}", number=points.run_of(group)[0])
        if count < wanted:
            lacking.append(say("{points} points on the sphere of {name} ({recorded} recorded, {different} different)",
                               points=wanted, name=name, recorded=len(rows), different=count))  # fmt: skip
        elif (gap := _farthest(directions[rows])) > reach:
            bare.append(say("points over a hemisphere on the sphere of {name} (part of it {gap:.0f}° from the nearest point)",
                            name=name, gap=gap))  # fmt: skip
    over = say("every direction of a hemisphere within {reach_deg:g}° of a point", reach_deg=reach)
    points_over = say("{points} points over the sphere", points=wanted)
    return Condition(points_over, tuple(lacking)), Condition(over, tuple(bare))


def _farthest(normals: Floats) -> float:
    """Largest angle, °, of a direction of the hemisphere about the mean of some normals (n, 3) to the nearest of them."""
    pole = normals.mean(axis=0)
    pole = pole / np.linalg.norm(pole) if np.linalg.norm(pole) > 1e-9 else np.array([0.0, 0.0, 1.0])
    height = (np.arange(_DIRECTIONS) + 0.5) / _DIRECTIONS
    turn, radius = np.pi * (1 + np.sqrt(5)) * np.arange(_DIRECTIONS), np.sqrt(1 - height**2)
    across = np.linalg.svd(pole[None])[2][1:]
    grid = np.column_stack([radius * np.cos(turn), radius * np.sin(turn), height]) @ np.vstack([across, pole])
    return float(np.degrees(np.arccos(np.clip((grid @ normals.T).max(axis=1), -1.0, 1.0)).max()))


def conditions(plan: Plan, artefact: Artefact, *, recorded: bool) -> tuple[Condition, ...]:
    copies = artefact.points.copies if recorded else {}
    if isinstance(plan, LengthPlan):
        return lengths_measured(plan, artefact, copies)
    if isinstance(plan, BarPlan):
        return bar_positions(plan, artefact, copies)
    forms = artefact.forms()
    return () if forms is None else sphere_points(plan, artefact.points, forms.directions, copies)


def best_of(plans: Sequence[Plan], artefact: Artefact, *, recorded: bool) -> tuple[Condition, ...]:
    """Conditions of the one of several plans that lacks least."""
    each = [conditions(plan, artefact, recorded=recorded) for plan in plans]
    return min(each, key=lambda found: sum(len(condition.missing) for condition in found))
