"""Whether a ballbar was put in as many places and directions as a standard wants."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from cmm_uq.conformity.measurement_lines import PARALLELS, position_of
from cmm_uq.conformity.plans import BarPlan, Condition
from cmm_uq.messages import Text, at_key, commas, number, plural, say
from cmm_uq.model.artefact import Artefact
from cmm_uq.points import Floats, Points


def bar_positions(plan: BarPlan, artefact: Artefact, copies: Mapping[int, int]) -> tuple[Condition, ...]:
    """How many different positions, and in which directions; ``copies`` are groups that do not count."""
    points = artefact.points
    travel = points.machine.travel_mm
    known = bool(np.all(np.isfinite(travel)))
    wanted = plan.positions_in(np.ptp(travel, axis=1)) if known else plan.positions
    numbers, ends = _one_a_measurement(artefact)
    same = _same_places(plan, points, numbers, ends, copies)
    distinct = [i for i, number in enumerate(numbers) if number not in same]
    count = len(distinct)
    missing = _lacking(wanted, count, _in_words(same)) if count < wanted else ()
    unknown = () if known else (
        say("the travel of all three axes{key}, by whose proportions the number of positions goes",
            key=at_key("[machine] travel_mm")),
    )  # fmt: skip
    taken = {position_of(ends[i, 1] - ends[i, 0]) for i in distinct}
    directions = tuple(say("position {along}", along=_along(d)) for d in plan.directions if d not in taken)
    return (
        Condition(
            say("at least {wanted} positions of the bar: {count}", wanted=wanted, count=count), (*missing, *unknown)
        ),
        Condition(_directions(directions), directions),
    )


def _lacking(wanted: int, count: int, same: Sequence[Text]) -> tuple[Text, ...]:
    lack = say("{lack} of {wanted} positions: {count} distinct", lack=wanted - count, wanted=wanted, count=count)
    return (commas((lack, *same)),)


def _directions(missing: tuple[Text, ...]) -> Text:
    if not missing:
        return say("along the axes, and the face and space diagonals of the volume")
    return say(
        "along the axes, and the face and space diagonals of the volume; missing: {missing}", missing=commas(missing)
    )


def _along(position: Text) -> Text:
    return position if position in PARALLELS else say("along {position}", position=position)


def _one_a_measurement(artefact: Artefact) -> tuple[list[int], Floats]:
    """Numbers of the measurements, and the ends (q, 2, 3) of the first bar of each."""
    numbers, rows = np.unique(artefact.measurement, return_index=True)
    return numbers.tolist(), np.asarray(artefact.points.xyz[artefact.rows[rows]], dtype=np.float64)


def _same_places(
    plan: BarPlan, points: Points, numbers: Sequence[int], ends: Floats, copies: Mapping[int, int]
) -> dict[int, tuple[float | None, int]]:
    """Measurements that are no further position: within how many mm of which other, or a copy of it."""
    found: dict[int, tuple[float | None, int]] = {}
    for later, original in copies.items():
        (one, _), (two, _) = points.run_of(original), points.run_of(later)
        if one != two:
            found[two] = None, one
    kept: list[int] = []
    for i, own in enumerate(numbers):
        if own in found:
            continue
        near = next((j for j in kept if _apart(ends[i], ends[j]) < plan.apart_mm), None)
        if near is None:
            kept.append(i)
        else:
            found[own] = plan.apart_mm, numbers[near]
    return found


def _in_words(same: dict[int, tuple[float | None, int]]) -> list[Text]:
    """One sentence for all that are the same of one other; copies come first."""
    pairs = sorted(set(same.values()), key=lambda pair: (pair[1], pair[0] is not None))
    return [
        _is_no_further(apart, other, sorted(own for own, pair in same.items() if pair == (apart, other)))
        for apart, other in pairs
    ]


def _is_no_further(apart: float | None, other: int, numbers: Sequence[int]) -> Text:
    which = _listed(numbers)
    if apart is None:
        return plural(
            len(numbers),
            one=say("measurement {which} is a copy of {other}", which=which, other=other),
            many=say("measurements {which} are copies of {other}", which=which, other=other),
        )
    return plural(
        len(numbers),
        one=say("measurement {which} is within {apart:g} mm of {other}", which=which, apart=apart, other=other),
        many=say("measurements {which} are within {apart:g} mm of {other}", which=which, apart=apart, other=other),
    )


def _listed(numbers: Sequence[int]) -> Text:
    """Numbers in ascending order, those that follow each other as from 2 to 20."""
    runs: list[list[int]] = []
    for one in numbers:
        if runs and runs[-1][-1] == one - 1:
            runs[-1].append(one)
        else:
            runs.append([one])
    return commas(part for run in runs for part in _run(run))


def _run(numbers: Sequence[int]) -> list[Text]:
    if len(numbers) > 2:
        return [say("{first} to {last}", first=numbers[0], last=numbers[-1])]
    return [number(one) for one in numbers]


def _apart(one: Floats, two: Floats) -> float:
    """Larger distance of the ends (2, 3) of two bars, whichever way round they lie, mm."""
    return float(min(np.linalg.norm(one - turned, axis=1).max() for turned in (two, two[::-1])))
