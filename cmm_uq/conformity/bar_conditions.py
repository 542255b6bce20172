"""Whether a ballbar was put in as many places and directions as a standard wants."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from cmm_uq.conformity.measurement_lines import position_of
from cmm_uq.conformity.plans import BarPlan, Condition
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
    plan: BarPlan, points: Points, numbers: Sequence[int], ends: Floats, copies: Mapping[int, int]
) -> dict[int, tuple[str, int]]:
    """Measurements that are no further position: what each is instead, and of which other."""
    found: dict[int, tuple[str, int]] = {}
    for later, original in copies.items():
        (one, _), (two, _) = points.run_of(original), points.run_of(later)
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
            texts.append(f"measurements {_listed(numbers)} are {what.replace('a copy', 'copies')} of {of}")
    return texts


def _listed(numbers: Sequence[int]) -> str:
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
