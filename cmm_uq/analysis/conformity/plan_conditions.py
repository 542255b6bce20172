"""Whether a plan or a recording is a complete test with lengths, bars and test spheres; copies count in a plan alone."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterator, Mapping, Sequence
from itertools import groupby, product

import numpy as np
from numpy.typing import NDArray

from cmm_uq.analysis.conformity import plans
from cmm_uq.analysis.conformity.plans import BarPlan, Condition, LengthPlan, Plan, SpherePlan, position_of
from cmm_uq.base.messages import NOTHING, Text, Verbatim, at_key, commas, number, plural, say, semicolons
from cmm_uq.base.points import AXES, Floats, Ints, Machine, Points
from cmm_uq.base.values import dataclass
from cmm_uq.machine.model.artefact import Artefact
from cmm_uq.maths.uncertainty.quantity import nominal

SAME_LENGTH_MM = 1.0  # Lengths no farther from each other than this are one nominal length
# Of the distance between equally spaced lengths, how far each may lie from its place: gauges have the lengths that they
# have. This project's figure.
SPACING = 0.75


def lengths_measured(plan: LengthPlan, artefact: Artefact, copies: Mapping[int, int]) -> tuple[Condition, ...]:
    """Positions, longest, different and shortest lengths, and repeats; ``copies`` are groups that do not count."""
    places: _Places = defaultdict(list)
    for one in _lines(plan, artefact, copies):
        places[one.position].append(one)
    often = {line: _as_often(plan, found) for line, found in places.items()}
    absent, wanted = tuple(line for line in plan.positions if line not in places), plan.lengths
    asked, counts = commas(plan.positions), {line: len(found) for line, found in places.items()}
    if set(plan.positions) == {*plans.SPACE_DIAGONALS, *plans.PARALLELS}:
        asked = say("four space diagonals and three axes")
    missing = tuple(
        say("{lengths} different lengths ({line}: {count})", lengths=wanted, line=line, count=count)
        for line, count in counts.items()
        if count < wanted
    )
    lines = list(_first_lines(artefact, copies)) if absent else []
    too_short = tuple(plans.too_short(line, artefact.points.machine, lines) for line in absent)
    every = list(counts.values())
    span = say("{low:.0f} to {high:.0f}", low=min(every), high=max(every)) if every else say("none")
    return (
        Condition(
            say("{asked}; missing: {absent}", asked=asked, absent=commas(absent)) if absent else asked, too_short
        ),
        _long_enough(plan, artefact.points.machine, often),
        Condition(say("{lengths} lengths on each line: {span}", lengths=wanted, span=span), missing),
        _spread(plan, often),
        _shortest(plan, often),
        _repeated(plan, places),
        *_both_sides(plan, often),
        *_offset(plan, artefact),
    )


def _first_lines(artefact: Artefact, copies: Mapping[int, int]) -> Iterator[tuple[int, Floats, Floats]]:
    """Of each measurement that is no copy its number, with the middle and the direction of its line."""
    if (found := artefact.indications()) is not None:
        group, (middles, along) = artefact.points.group[found.rows[:, 0]], artefact.lines_of(found.rows)
        numbers = artefact.points.measurement[found.rows[:, 0]]
        first = (i for i in np.unique(group, return_index=True)[1] if group[i] not in copies)
        yield from ((int(numbers[i]), middles[i], along[i]) for i in first)


def with_offset(points: Points, rows: Ints, offset_mm: float | None) -> NDArray[np.bool_]:
    """Lengths (m,) with the tip so far across the ram at both ends; none recorded is none, ``None`` asks for no offset."""
    if offset_mm is None or (tips := tip_offsets(points)) is None:
        return np.full(len(rows), not offset_mm)
    across = np.linalg.norm(tips, axis=1)[rows]
    return np.asarray(np.all(np.abs(across - offset_mm) <= plans.OFFSET_TOLERANCE_MM, axis=1))


def tip_offsets(points: Points) -> Floats | None:
    """Stylus tip offset across the ram, (n, 3) mm, zero along it and without a column; ``None`` where none is recorded."""
    recorded = [points.columns.get(f"tip_{a}_mm") for a in AXES]
    if all(one is None for one in recorded):
        return None
    tips = np.column_stack([np.zeros(len(points)) if one is None else one for one in recorded])
    tips[:, AXES.index(points.machine.chain.replace("F", "")[-1].lower())] = 0.0
    return np.asarray(tips, dtype=np.float64)


def _offset(plan: LengthPlan, artefact: Artefact) -> tuple[Condition, ...]:
    if not plan.offset_mm:
        return ()
    found, key = artefact.indications(), at_key("tip_x_mm, tip_y_mm, tip_z_mm")
    what = say("stylus tip {offset_mm:g} mm across the ram{key}", key=key, offset_mm=plan.offset_mm)
    there = found is not None and with_offset(artefact.points, found.rows, plan.offset_mm).any()
    return (Condition(what, () if there else (what,)),)


def _both_sides(plan: LengthPlan, places: _Places) -> tuple[Condition, ...]:
    if not plan.bidirectional or not places:
        return ()
    what, remedy = say("ends of each length reached from opposite sides"), NOTHING
    known = [one.bidirectional for found in places.values() for one in found if one.bidirectional is not None]
    counts = {line: sum(bool(one.bidirectional) for one in found) for line, found in places.items()}
    missing = tuple(
        say("{lengths} bidirectional lengths ({line}: {count})", lengths=plan.lengths, line=line, count=count)
        for line, count in counts.items()
        if count < min(plan.lengths, len(places[line]))
    )
    if not known:
        missing = (say("bidirectional lengths: from which side each end was reached is not recorded"),)
        remedy = Verbatim("columns approach_x, approach_y, approach_z")
    elif not any(known):
        missing = (
            say(
                "bidirectional lengths: these are not, and no short gauge reached from both sides was measured beside them"
            ),
        )
    return (Condition(what, missing, remedy),)


@dataclass(frozen=True)
class _Measured:
    position: Text
    length: float
    share: float | None
    repeats: int
    bidirectional: bool | None


def _lines(plan: LengthPlan, artefact: Artefact, copies: Mapping[int, int]) -> Iterator[_Measured]:
    found, points = artefact.indications(), artefact.points
    if found is None:
        return
    group, both, of = points.group[found.rows[:, 0]], artefact.bidirectional(found.rows), nominals(found.lengths)
    original = ~np.isin(group, list(copies)) & with_offset(points, found.rows, plan.offset_mm)
    lines = list(zip(*artefact.lines_of(found.rows), strict=True))
    positions = np.array([plans.position_on(points.machine, *line) for line in lines], dtype=object)
    for position in plan.positions:
        for length in np.unique(of):
            at = np.flatnonzero(original & (positions == position) & (of == length))
            if not len(at):
                continue
            if plan.bidirectional and both is not None and both[at].any():
                at = at[both[at]]
            travel = [(i, plans.crossed_travel(points.machine, *lines[i])) for i in at]
            shares = [float(found.lengths[i] / t) if t else 0.0 for i, t in travel if t is not None]
            yield _Measured(position, float(found.lengths[at].mean()), max(shares, default=None),
                            len(np.unique(group[at])), None if both is None else bool(both[at].any()))  # fmt: skip


def nominals(lengths: Floats) -> Ints:
    """Which nominal length each of some lengths (m,), mm, is of, counted from the shortest, (m,)."""
    order = np.argsort(lengths, kind="stable")
    found = np.empty(len(lengths), dtype=np.int64)
    found[order] = np.cumsum(np.diff(lengths[order], prepend=lengths[order][:1]) > SAME_LENGTH_MM)
    return found


_Places = dict[Text, list[_Measured]]


def _as_often(plan: LengthPlan, found: list[_Measured]) -> list[_Measured]:
    """Those that are repeated as often as the plan asks, or as so many of them as it asks for are."""
    counts = sorted((one.repeats for one in found), reverse=True)[: plan.lengths]
    return [one for one in found if one.repeats >= min(plan.repeats, counts[-1])]


def _long_enough(plan: LengthPlan, machine: Machine, places: _Places) -> Condition:
    least = say("{least_share:.0f} %", least_share=100 * plan.least_share)
    what = say("longest length at least {least} of the travel along each line", least=least)
    if not np.all(np.isfinite(machine.travel_mm)):
        travel = say(
            "the travel of all three axes{key}, without which no length's share of it is known",
            key=at_key("[machine] travel_mm"),
        )
        return Condition(say("{what}: not known", what=what), (travel,))
    shares = {line: 100 * max((m.share or 0.0 for m in found), default=0.0) for line, found in places.items()}
    missing = tuple(
        say("length of at least {least} of the travel ({line}: {share:.0f} %)", least=least, line=line, share=share)
        for line, share in shares.items()
        if share < 100 * plan.least_share
    )
    every = list(shares.values())
    span = say("{low:.0f} % to {high:.0f} %", low=min(every), high=max(every)) if every else say("none")
    return Condition(say("{what}: {span}", what=what, span=span), missing)


def _spread(plan: LengthPlan, places: _Places) -> Condition:
    """That lengths of each line are spaced equally as nearly as their gauge allows; fewer of them are missing otherwise."""
    missing = tuple(
        say("lengths spread over the range ({line}: {lengths} mm)", line=line,
            lengths=semicolons(number(length, ".4g") for length in sorted(one.length for one in found)))
        for line, found in places.items() if len(found) >= plan.lengths and not _any_spread(plan, found)
    )  # fmt: skip
    return Condition(say("{lengths} lengths spread over the range on each line", lengths=plan.lengths), missing)


def _any_spread(plan: LengthPlan, found: Sequence[_Measured]) -> bool:
    lengths = np.sort([one.length for one in found])
    starts = lengths[lengths <= plan.shortest_mm]
    ends = np.array([one.length for one in found if one.share is not None and one.share >= plan.least_share])
    pairs = product(starts if len(starts) else lengths[:1], ends if len(ends) else lengths[-1:])
    return any(_spaced(lengths, np.linspace(start, end, plan.lengths)) for start, end in pairs if end > start)


def _spaced(lengths: Floats, equally: Floats) -> bool:
    """Whether each of some equally spaced lengths has one of its own (sorted) near it."""
    reach, at = SPACING * float(equally[1] - equally[0]), -1
    for wanted in equally:
        near = np.flatnonzero((np.abs(lengths - wanted) <= reach) & (np.arange(len(lengths)) > at))
        if not len(near):
            return False
        at = int(near[0])
    return True


def _shortest(plan: LengthPlan, places: _Places) -> Condition:
    most, shortest = plan.shortest_mm, {line: min(m.length for m in found) for line, found in places.items()}
    missing = tuple(
        say("length of at most {shortest_mm:g} mm ({line}: {length} mm)", shortest_mm=most, line=line, length=nominal(length))
        for line, length in shortest.items() if length > most
    )  # fmt: skip
    longest = say("{shortest} mm", shortest=nominal(max(shortest.values()))) if shortest else say("none")
    what = say("shortest length at most {shortest_mm:g} mm: {longest}", shortest_mm=most, longest=longest)
    return Condition(what, missing)


def _repeated(plan: LengthPlan, places: _Places) -> Condition:
    """Of the lengths in a position, as many as the plan asks for must be repeated as often as it asks; more do not help."""
    wanted = plan.repeats
    repeats = {line: sorted((m.repeats for m in found), reverse=True)[: plan.lengths] for line, found in places.items()}
    total = sum(min(count, wanted) for counts in repeats.values() for count in counts)
    missing: list[Text] = [
        say("{repeats} repetitions of each length ({line}: {counts})", repeats=wanted, line=line, counts=counts[-1])
        for line, counts in repeats.items()
        if counts[-1] < wanted
    ]
    if total < plan.total:
        missing.append(say("{lack} of {total} lengths", lack=plan.total - total, total=plan.total))
    what = say("{repeats} repetitions of each, {wanted} lengths in all: {total}",
               repeats=wanted, wanted=plan.total, total=total)  # fmt: skip
    return Condition(what, tuple(missing))


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
    pairs = [(points.run_of(later)[0], points.run_of(original)[0]) for later, original in copies.items()]
    same: dict[int, tuple[float | None, int]] = {later: (None, one) for later, one in pairs if later != one}
    copied = set(same)
    left = [i for i, own in enumerate(numbers) if own not in copied]
    near = neighbours({i: ends[i] for i in left}, plan.apart_mm)
    chosen = most_apart(near)
    same |= {numbers[i]: (plan.apart_mm, numbers[min(near[i] & chosen)]) for i in left if i not in chosen}
    count, missing = sum(number not in same for number in numbers), list[Text]()
    if count < wanted:
        lack = say("{lack} of {wanted} positions: {count} distinct", lack=wanted - count, wanted=wanted, count=count)
        missing.append(commas((lack, *_in_words(same))))
    if not known:
        missing.append(say("the travel of all three axes{key}, by whose proportions the number of positions goes",
                           key=at_key("[machine] travel_mm")))  # fmt: skip
    taken = {position_of(b - a) for (a, b), number in zip(ends, numbers, strict=True) if number not in copied}
    absent = [line for line in plan.directions if line not in taken]
    absent = [line if line in plans.PARALLELS else say("along {position}", position=line) for line in absent]
    lines = tuple(say("position {along}", along=along) for along in absent)
    asked = say("along the axes, and the face and space diagonals of the volume")
    if lines:
        asked = say(
            "along the axes, and the face and space diagonals of the volume; missing: {missing}", missing=commas(lines)
        )
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
        if len(group) <= _SEARCHED:
            chosen |= _largest(near, group)
        else:
            for i in sorted(group):
                if chosen.isdisjoint(near[i]):
                    chosen.add(i)
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


def _in_words(same: dict[int, tuple[float | None, int]]) -> Iterator[Text]:
    """One sentence for all that are the same of one other; copies come first."""
    for apart, other in sorted(set(same.values()), key=lambda pair: (pair[1], pair[0] is not None)):
        numbers = sorted(own for own, pair in same.items() if pair == (apart, other))
        which, off = _listed(numbers), apart or 0.0
        one = say("measurement {which} is within {apart:g} mm of {other}", which=which, apart=off, other=other)
        many = say("measurements {which} are within {apart:g} mm of {other}", which=which, apart=off, other=other)
        if apart is None:
            one = say("measurement {which} is a copy of {other}", which=which, other=other)
            many = say("measurements {which} are copies of {other}", which=which, other=other)
        yield plural(len(numbers), one=one, many=many)


def _listed(numbers: Sequence[int]) -> Text:
    """Numbers in ascending order, those that follow each other as from 2 to 20."""
    words: list[Text] = []
    for _, run in groupby(enumerate(numbers), key=lambda pair: pair[1] - pair[0]):
        own = [value for _, value in run]
        words += [say("{first} to {last}", first=own[0], last=own[-1])] if len(own) > 2 else map(number, own)
    return commas(words)


def neighbours(ends: Mapping[int, Floats], within_mm: float) -> dict[int, set[int]]:
    """Of bars, with the ends (2, 3) of each, mm, those others whose ends are all nearer, whichever way round they lie."""
    numbers, ways = np.array(list(ends)), np.array([(bar, bar[::-1]) for bar in ends.values()])
    apart = ((i, np.linalg.norm(own - ways, axis=3).max(axis=2).min(axis=1)) for i, own in ends.items())
    return {i: {*numbers[far < within_mm].tolist()} - {i} for i, far in apart}


def sphere_points(
    plan: SpherePlan, points: Points, directions: Floats, copies: Mapping[int, int]
) -> tuple[Condition, ...]:
    """How many points on each sphere, and whether they cover it; ``directions`` (n, 3) outward from its middle."""
    wanted, reach, lacking, bare, mixed = plan.points, plan.reach_deg, list[Text](), list[Text](), list[Text]()
    tips = tip_offsets(points)
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
        if tips is not None and np.ptp(tips[rows], axis=0).max() > plans.OFFSET_TOLERANCE_MM:
            mixed.append(say("one stylus on the sphere of {name}: tips of several were recorded", name=name))
    over = say("every direction of a hemisphere within {reach_deg:g}° of a point", reach_deg=reach)
    enough = say("{points} points over the sphere", points=wanted)
    single = Condition(say("one stylus on each sphere"), tuple(mixed))
    return Condition(enough, tuple(lacking)), Condition(over, tuple(bare)), *([single] if mixed else ())


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
