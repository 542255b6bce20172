"""Whether placings, planned or recorded, are those that a standard asks for, and what is missing.

A plan and a recording are held to the same conditions. Of a recording alone, what repeats another measurement to the last
digit does not count: that is a copy, where in a plan it is a wish.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from cmm_uq.artefacts.artefact import Artefact
from cmm_uq.artefacts.sphere import Sphere
from cmm_uq.conformity.measurement_lines import crossed_travel, position_of, position_on
from cmm_uq.conformity.plans import BarPlan, LengthPlan, Plan, SpherePlan
from cmm_uq.points import Floats, Ints, Machine, Points

SAME_LENGTH_MM = 1.0
"""Lengths nearer to each other than this are one nominal length."""

_NAMED = 5
"""Copies that are named one by one."""

_DIRECTIONS = 400
"""On a hemisphere, at which the reach of its points is looked at."""


@dataclass(frozen=True)
class Condition:
    """One thing that a standard asks for.

    Parameters
    ----------
    what : it asks, and how much of it there is.
    missing : what is not there, each in words; nothing when the condition is met.
    """

    what: str
    missing: tuple[str, ...] = ()

    @property
    def met(self) -> bool:
        """Whether nothing is missing."""
        return not self.missing


def conditions(plan: Plan, artefact: Artefact, *, recorded: bool) -> tuple[Condition, ...]:
    """All that a standard asks for.

    Parameters
    ----------
    plan : of the standard.
    artefact : with the points that were planned or recorded.
    recorded : whether they were; then copies do not count.
    """
    copies = copied(artefact.points) if recorded else {}
    if isinstance(plan, LengthPlan):
        return _lengths(plan, artefact, copies)
    if isinstance(plan, BarPlan):
        return _bars(plan, artefact, copies)
    return _spheres(plan, artefact, copies) if isinstance(artefact, Sphere) else ()


def copied(points: Points) -> dict[int, int]:
    """Groups that repeat another to the last digit, with that other: the one of the lowest measurement and repeat."""
    found: dict[int, int] = {}
    for groups in points.twins:
        original, *later = sorted(groups, key=lambda group: run_of(points, group))
        found |= dict.fromkeys(later, original)
    return found


def copies_in_words(points: Points) -> str:
    """Which measurements are copies of which; empty when none is."""
    told = []
    for later, original in copied(points).items():
        (one, first), (two, repeat) = run_of(points, original), run_of(points, later)
        told.append((one, first, two, repeat))
    said = [
        f"measurement {two}, repeat {repeat} of measurement {one}, repeat {first}"
        for one, first, two, repeat in sorted(told)
    ]
    more = f" and {len(said) - _NAMED} more" if len(said) > _NAMED else ""
    return f"Copies to the last digit, which do not count: {'; '.join(said[:_NAMED])}{more}." if said else ""


def run_of(points: Points, group: int) -> tuple[int, int]:
    """Measurement and repeat of a group."""
    row = int(np.argmax(points.group == group))
    return int(points.measurement[row]), int(points.repeat[row])


def _lengths(plan: LengthPlan, artefact: Artefact, copies: dict[int, int]) -> tuple[Condition, ...]:
    measured: _Places = {}
    for found in _lines(plan, artefact, copies):
        measured.setdefault(found.position, []).append(found)
    absent = tuple(line for line in plan.positions if line not in measured)
    return (
        Condition(f"four space diagonals and three axes{'; missing: ' if absent else ''}{', '.join(absent)}", absent),
        _long_enough(plan, artefact.points.machine, measured),
        _different(plan, measured),
        _shortest(plan, measured),
        _repeated(plan, measured),
    )  # fmt: skip


@dataclass(frozen=True)
class _Measured:
    """All that was measured of one nominal length in one position."""

    position: str
    nominal: int
    length: float
    share: float | None
    repeats: int


def _lines(plan: LengthPlan, artefact: Artefact, copies: dict[int, int]) -> Iterator[_Measured]:
    """By position and nominal length."""
    found = artefact.indications()
    if found is None:
        return
    points = artefact.points
    group = points.group[found.rows[:, 0]]
    first, last = points.xyz[found.rows[:, 0]], points.xyz[found.rows[:, 1]]
    original = ~np.isin(group, list(copies))
    nominal = nominals(found.lengths)
    middles, along = 0.5 * (first + last), last - first
    positions = np.array([position_on(points.machine, m, d) for m, d in zip(middles, along, strict=True)], dtype=object)
    for position in plan.positions:
        for length in np.unique(nominal):
            at = np.flatnonzero(original & (positions == position) & (nominal == length))
            if not len(at):
                continue
            shares = [_share(points, middles[i], along[i], found.lengths[i]) for i in at]
            known = [share for share in shares if share is not None]
            yield _Measured(position, int(length), float(found.lengths[at].mean()), max(known, default=None),
                            len(np.unique(group[at])))  # fmt: skip


def _share(points: Points, middle: Floats, along: Floats, length: float) -> float | None:
    available = crossed_travel(points.machine, middle, along)
    return None if available is None else float(length / available) if available else 0.0


def nominals(lengths: Floats) -> Ints:
    """Which nominal length each of some lengths (m,), mm, is of, counted from the shortest, (m,)."""
    order = np.argsort(lengths, kind="stable")
    found = np.empty(len(lengths), dtype=np.int64)
    found[order] = np.cumsum(np.diff(lengths[order], prepend=lengths[order][:1]) > SAME_LENGTH_MM)
    return found


_Places = dict[str, list[_Measured]]


def _long_enough(plan: LengthPlan, machine: Machine, places: _Places) -> Condition:
    least = f"{100 * plan.least_share:.0f} %"
    what = f"longest length at least {least} of the travel along each line"
    if not np.all(np.isfinite(machine.travel_mm)):
        key = "[machine] travel_mm of all three axes, without which no length's share of the travel is known"
        return Condition(f"{what}: not known", (key,))
    shares = {line: max((m.share or 0.0 for m in found), default=0.0) for line, found in places.items()}
    missing = tuple(
        f"length of at least {least} of the travel along {line} ({100 * share:.0f} %)"
        for line, share in shares.items()
        if share < plan.least_share
    )
    return Condition(f"{what}: {_span([100 * share for share in shares.values()], ' %')}", missing)


def _span(figures: Sequence[float], unit: str = "") -> str:
    return f"{min(figures):.0f}{unit} to {max(figures):.0f}{unit}" if figures else "none"


def _different(plan: LengthPlan, places: _Places) -> Condition:
    counts = {line: len(found) for line, found in places.items()}
    missing = tuple(
        f"{plan.lengths} different lengths along {line} ({count})"
        for line, count in counts.items()
        if count < plan.lengths
    )
    return Condition(f"{plan.lengths} lengths on each line: {_span(list(counts.values()))}", missing)


def _shortest(plan: LengthPlan, places: _Places) -> Condition:
    shortest = {line: min(m.length for m in found) for line, found in places.items()}
    missing = tuple(
        f"length of at most {plan.shortest_mm:g} mm along {line} ({length:.4g} mm)"
        for line, length in shortest.items()
        if length > plan.shortest_mm
    )
    longest = f"{max(shortest.values()):.4g} mm" if shortest else "none"
    return Condition(f"shortest length at most {plan.shortest_mm:g} mm: {longest}", missing)


def _repeated(plan: LengthPlan, places: _Places) -> Condition:
    """Of the lengths in a position, as many as the plan asks for must be repeated as often as it asks."""
    repeats = {line: sorted((m.repeats for m in found), reverse=True) for line, found in places.items()}
    total = sum(sum(counts) for counts in repeats.values())
    lost = (f"{plan.total - total} of {plan.total} lengths",) if total < plan.total else ()
    missing = tuple(
        f"{plan.repeats} repetitions of each length along {line} ({counts[: plan.lengths][-1]})"
        for line, counts in repeats.items()
        if counts[: plan.lengths][-1] < plan.repeats
    )
    return Condition(f"{plan.repeats} repetitions of each, {plan.total} lengths in all: {total}", (*missing, *lost))


def _bars(plan: BarPlan, artefact: Artefact, copies: dict[int, int]) -> tuple[Condition, ...]:
    points = artefact.points
    travel = points.machine.travel_mm
    known = bool(np.all(np.isfinite(travel)))
    wanted = plan.positions_in(np.ptp(travel, axis=1)) if known else plan.positions
    numbers, ends = _one_a_measurement(artefact)
    same = _same_places(plan, points, numbers, ends, copies)
    distinct = [i for i, number in enumerate(numbers) if number not in same]
    count = len(distinct)
    lost = "".join(f", {text}" for text in _in_words(same))
    missing = (f"{wanted - count} of {wanted} positions: {count} distinct{lost}",) if count < wanted else ()
    unknown = (
        () if known else ("[machine] travel_mm of all three axes, by whose proportions the number of positions goes",)
    )
    taken = {position_of(ends[i, 1] - ends[i, 0]) for i in distinct}
    directions = tuple(f"position {_along(d)}" for d in plan.directions if d not in taken)
    return (
        Condition(f"at least {wanted} positions of the bar: {count}", (*missing, *unknown)),
        Condition("along the axes, and the face and space diagonals of the volume"
                  f"{'; missing: ' if directions else ''}{', '.join(directions)}", directions),
    )  # fmt: skip


def _along(position: str) -> str:
    return position if position.startswith("parallel") else f"along {position}"


def _one_a_measurement(artefact: Artefact) -> tuple[list[int], Floats]:
    """Numbers of the measurements, and the ends (q, 2, 3) of the first bar of each."""
    numbers, rows = np.unique(artefact.measurement, return_index=True)
    return numbers.tolist(), np.asarray(artefact.points.xyz[artefact.rows[rows]], dtype=np.float64)


def _same_places(
    plan: BarPlan, points: Points, numbers: Sequence[int], ends: Floats, copies: dict[int, int]
) -> dict[int, tuple[str, int]]:
    """Measurements that are no further position: what each is instead, and of which other."""
    found: dict[int, tuple[str, int]] = {}
    for later, original in copies.items():
        (one, _), (two, _) = run_of(points, original), run_of(points, later)
        if one != two:
            found[two] = "a copy", one
    kept: list[int] = []
    for i, number in enumerate(numbers):
        if number in found:
            continue
        near = next((j for j in kept if _apart(ends[i], ends[j]) < plan.apart_mm), None)
        if near is None:
            kept.append(i)
        else:
            found[number] = f"within {plan.apart_mm:g} mm", numbers[near]
    return found


def _in_words(same: dict[int, tuple[str, int]]) -> list[str]:
    """One sentence for all that are the same of one other."""
    texts = []
    for what, of in sorted(set(same.values()), key=lambda pair: pair[::-1]):
        numbers = sorted(number for number, pair in same.items() if pair == (what, of))
        if len(numbers) == 1:
            texts.append(f"measurement {numbers[0]} is {what} of {of}")
        else:
            texts.append(f"measurements {listed(numbers)} are {what.replace('a copy', 'copies')} of {of}")
    return texts


def listed(numbers: Sequence[int]) -> str:
    """Numbers in ascending order, those that follow each other as from 2 to 20."""
    runs: list[list[int]] = []
    for number in numbers:
        if runs and runs[-1][-1] == number - 1:
            runs[-1].append(number)
        else:
            runs.append([number])
    parts = [f"{run[0]} to {run[-1]}" if len(run) > 2 else ", ".join(map(str, run)) for run in runs]
    return ", ".join(parts)


def _apart(one: Floats, two: Floats) -> float:
    """Larger distance of the ends (2, 3) of two bars, whichever way round they lie, mm."""
    return float(min(np.linalg.norm(one - turned, axis=1).max() for turned in (two, two[::-1])))


def _spheres(plan: SpherePlan, sphere: Sphere, copies: dict[int, int]) -> tuple[Condition, ...]:
    points = sphere.points
    lacking, bare = [], []
    for group in range(int(points.group.max()) + 1):
        if group in copies:
            continue
        rows = np.flatnonzero(points.group == group)
        count = len(np.unique(points.xyz[rows] + 0.0, axis=0))
        name = f"measurement {run_of(points, group)[0]}"
        if not count == plan.points == len(rows):
            lacking.append(f"{plan.points} points on the sphere of {name} ({len(rows)} recorded, {count} different)")
        elif (gap := _farthest(sphere.directions(points.xyz)[rows])) > plan.reach_deg:
            bare.append(
                f"points over a hemisphere on the sphere of {name} (part of it {gap:.0f}° from the nearest point)"
            )
    return (
        Condition(f"{plan.points} points over the sphere", tuple(lacking)),
        Condition(f"every direction of a hemisphere within {plan.reach_deg:g}° of a point", tuple(bare)),
    )


def _farthest(normals: Floats) -> float:
    """Largest angle, °, of a direction of the hemisphere about the mean of some normals (n, 3) to the nearest of them."""
    pole = normals.mean(axis=0)
    pole = pole / np.linalg.norm(pole) if np.linalg.norm(pole) > 1e-9 else np.array([0.0, 0.0, 1.0])
    height = (np.arange(_DIRECTIONS) + 0.5) / _DIRECTIONS
    turn = np.pi * (1 + np.sqrt(5)) * np.arange(_DIRECTIONS)
    radius = np.sqrt(1 - height**2)
    across = np.linalg.svd(pole[None])[2][1:]
    grid = np.column_stack([radius * np.cos(turn), radius * np.sin(turn), height]) @ np.vstack([across, pole])
    return float(np.degrees(np.arccos(np.clip((grid @ normals.T).max(axis=1), -1.0, 1.0)).max()))
