"""Screening of a recording: what damages much of it is refused, single rows and columns left out, all reported."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from functools import partial
from itertools import groupby

import numpy as np
import scipy
from numpy.typing import NDArray

from cmm_uq.analysis.screening.columns import SENSORS, Finding, about_whole_column, column_findings, finding, span
from cmm_uq.analysis.screening.damage import coordinate_findings, outside_travel
from cmm_uq.analysis.screening.shape import COORDINATES, Screening
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import NOTHING, Text, Verbatim, comma_or, say
from cmm_uq.base.points import AXES, Floats, Ints, Points
from cmm_uq.base.values import dataclass, replace
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.machine.model.kind import Observe
from cmm_uq.maths.inference.linear_model import LinearModel


def copied_measurements(points: Points) -> dict[int, int]:
    """Groups that repeat one of another measurement to the last digit, with that other (see :attr:`Points.copies`)."""
    run, copies = points.run_of, points.copies.items()
    return {later: original for later, original in copies if run(later)[0] != run(original)[0]}


def counted_with(points: Points, set_aside: Collection[int] = ()) -> Ints:
    """For every point, a row of the group that it counts with: its own, or that of which it is a copy, (n,)."""
    first = np.unique(points.group, return_index=True)[1]
    counts = np.arange(len(first))
    for later, original in copied_measurements(points).items():
        if points.run_of(original)[0] not in set_aside:
            counts[later] = original
    return first[counts[points.group]]


GROSS = 1e-3  # probability, over all observations together, that noise alone makes one look like an outlier
REVERSED = "reversed"  # kind of a finding whose rows are sound, but not what was recorded beside them
_UNIT_LENGTH = 0.02
_REFUSED_WHOLE = ("unit", "sign", "shifted column")


@dataclass(frozen=True, eq=False)
class ScreenedRecording:
    """A recording that may be fitted, and what screening found in it."""

    points: Points  # without the rows and columns that are left out
    findings: tuple[Finding, ...]


def screen_recording(
    points: Points, facts: ArtefactFacts, screening: Screening | None, observe: Observe, *, needed: Collection[str],
    set_aside: Collection[int], where: str,
) -> ScreenedRecording:  # fmt: skip
    shape = screening.shape_of(facts, points) if screening else None
    made = partial(observe, facts, where=where)
    damaged = coordinate_findings(points, shape, made, set_aside, where) if shape else []
    balls = screening is not None and screening.balls
    odd = screen(points, needed=needed, set_aside=set_aside, where=where, balls=balls)
    if shape and shape.together:
        damaged = [_reversal(found, points, needed) for found in damaged]
    lines = {line for found in damaged for line in found.lines}
    coordinates = [f for f in odd if f.kind == "impossible" and f.column in COORDINATES and set(f.lines) <= lines]
    findings = (*damaged, *(_left_out(f) for f in odd if f not in coordinates))
    lost = sorted({row for found in findings for row in found.rows})
    left = points.select(np.delete(np.arange(len(points)), lost)) if lost else points
    return ScreenedRecording(with_sound_sensors(left, findings), findings)


def with_sound_sensors(points: Points, findings: Sequence[Finding]) -> Points:
    """The same points without columns of sensors that cannot be trusted."""
    gone = {found.column for found in findings if found.set_aside and found.column in SENSORS}
    return replace(points, columns={name: values for name, values in points.columns.items() if name not in gone})


def screen(
    points: Points, *, needed: Collection[str], set_aside: Collection[int], where: str, balls: bool = False
) -> tuple[Finding, ...]:
    """All that is odd in a recording without regard to its artefact's shape. ``where`` the recording's name, for messages."""
    impossible = impossible_values(points, balls=balls)
    for found in impossible:
        line = f" line {found.lines[0]}" if found.lines else ""
        if found.column in needed:
            raise CmmUqError(found.why, where=f"{where}{line}, column {found.column}",
                             fix="The model uses this column: mend it, or leave out the effect that needs it")  # fmt: skip
        if found.kind in _REFUSED_WHOLE and about_whole_column(found, points):
            place = f"{where}{line}, column {found.column}"
            raise CmmUqError(found.why, where=place, fix="Mend the column, or remove it")
    odd = (*impossible, *repeated_figures(points))
    return tuple(replace(f, set_aside=_aside(f, set_aside)) for f in odd)


def impossible_values(points: Points, *, balls: bool = False) -> list[Finding]:
    """Values that cannot be: one finding a column, and one an axis whose readings leave the machine's travel."""
    found = column_findings(points, balls=balls)
    if all(f"n{a}" in points.columns for a in AXES):
        norm = np.linalg.norm([points.columns[f"n{a}"] for a in AXES], axis=0)
        if np.any(rows := np.abs(norm - 1) > _UNIT_LENGTH):
            found.append(finding("impossible", points, rows, say("the normal nx, ny, nz has no unit length"), "nx"))
    for i, (axis, rows) in enumerate(zip(AXES, outside_travel(points).T, strict=True)):
        if np.any(rows):
            low, high = points.machine.travel_mm[i]
            why = say(
                "scale readings of {axis} ({column}_mm + origin) of {span} mm lie outside the travel {low:g} "
                "to {high:g} mm{hint}",
                axis=Verbatim(axis.upper()), column=Verbatim(axis), span=span(points.readings[axis][rows]), low=low,
                high=high, hint=_hint(points, i) if rows.mean() >= 0.5 else NOTHING,
            )  # fmt: skip
            found.append(finding("impossible", points, rows, why, f"{axis}_mm"))
    return found


def repeated_figures(points: Points) -> list[Finding]:
    """Measurements whose coordinates repeat, digit for digit, those of another measurement; runs of them as one block."""
    copies = sorted(copied_measurements(points).items())
    blocks = groupby(enumerate(copies), key=lambda pair: (pair[1][0] - pair[0], pair[1][1] - pair[0]))
    return [_copied(points, [(original, later) for _, (later, original) in block]) for _, block in blocks]


def gross_outliers(linear: LinearModel, measurement: NDArray[np.int64], least: float = 0.0) -> list[tuple[int, float]]:
    """Observations (index, times of their standard deviation) that noise would hardly ever put so far off.

    Externally studentised residuals against their t distribution, times the number of observations (Bonferroni; Barnett &
    Lewis 1994, 8.2); the worst is taken out and the rest tested again. ``least`` mm is noise they have at least.
    """
    reduced = linear.reduced
    keep = np.ones(len(reduced.observed), dtype=bool)
    found: list[tuple[int, float]] = []
    scale = np.array([u.scale for u in linear.unknowns])
    for _ in range(max(1, len(keep) // 10)):
        U, s, _ = scipy.linalg.svd(reduced.design[keep] * scale, full_matrices=False)
        U = U[:, s > 1e-9 * s[0]] if s.size else U
        dof = reduced.count - (~keep).sum() - U.shape[1] - 1
        if dof < 3:
            break
        residual = reduced.observed[keep] - U @ (U.T @ reduced.observed[keep])
        free = np.maximum(1 - np.einsum("ij,ij->i", U, U), 1e-12)
        rest = np.maximum(residual @ residual - residual**2 / free, 0.0)
        with np.errstate(divide="ignore"):
            t = np.where(rest > 0, np.abs(residual) / np.sqrt(free * np.maximum(rest / dof, least**2)), 0.0)
        worst = int(np.argmax(t))
        if 2 * scipy.special.stdtr(dof, -t[worst]) * len(measurement) > GROSS:
            break
        index = int(np.flatnonzero(keep)[worst])
        found.append((index, float(t[worst])))
        keep[index] = False
    return found


def _copied(points: Points, run: Sequence[tuple[int, int]]) -> Finding:
    originals, later = zip(*run, strict=True)
    both = np.isin(points.group, (*originals, *later))
    ends = (later[0], later[-1], originals[0], originals[-1])
    first, last, original, final = (points.run_of(group)[0] for group in ends)
    if len(run) == 1:
        why = say(
            "measurement {b} repeats the coordinates of measurement {a} to the last digit: a copy, not a measurement, and "
            "counts once",
            b=first,
            a=original,
        )
        return replace(finding("duplicate", points, both, why), measurements=(original, first))
    block = say(
        "measurements {first} to {last} repeat the coordinates of measurements {original} to {final} to the last digit: a "
        "block pasted twice, whose copies say nothing: remove them, or record what was measured",
        first=first, last=last, original=original, final=final,
    )  # fmt: skip
    rows = tuple(np.flatnonzero(np.isin(points.group, later)).tolist())
    return replace(finding("repeated block", points, both, block), rows=rows)


def _aside(item: Finding, set_aside: Collection[int]) -> bool:
    *others, last = item.measurements
    return last in set_aside or (item.kind == "duplicate" and not any(other in set_aside for other in others))


def _reversal(item: Finding, points: Points, needed: Collection[str]) -> Finding:
    if item.kind != "swapped" or item.rows:
        return item
    rows = np.flatnonzero(np.isin(points.lines, item.lines)) if len(points.lines) else np.zeros(0, dtype=np.int64)
    for name in needed:
        if any(np.ptp(points.column(name)[points.group == group]) > 0 for group in np.unique(points.group[rows])):
            used = Verbatim(name)
            why = say(
                "{why}; the model uses {differing}: number the balls as in the other repeats",
                why=item.why,
                differing=used,
            )
            return replace(item, kind=REVERSED, set_aside=True, rows=tuple(rows.tolist()), why=why)
    return item


def _left_out(item: Finding) -> Finding:
    return replace(item, set_aside=item.set_aside or bool(item.rows) or item.column in SENSORS)


def _hint(points: Points, axis: int) -> Text:
    """Where to look if an axis leaves its travel more often than not."""
    (low, high), origin = points.machine.travel_mm[axis], points.machine.origin_mm

    def inside(readings: Floats) -> bool:
        return bool(np.mean((readings >= low) & (readings <= high)) > 0.95)

    own = Verbatim(COORDINATES[axis])
    hints = [say("a missing origin_mm")]
    if inside(origin[axis] - points.xyz[:, axis]):
        hints.append(say("{column} with the wrong sign", column=own))
    others = [COORDINATES[j] for j in range(3) if j != axis and inside(origin[axis] + points.xyz[:, j])]
    hints += [say("{column} exchanged with {other}", column=own, other=Verbatim(other)) for other in others]
    return say(": look for {hints}", hints=comma_or(hints))


LEAST = 3  # points that follow one another; two may be neighbours by chance
_SHARE = 2 / 3  # of the points from the first to the last outlier of a repeat, from which on they are one stretch


def moved_stretches(points: Points, outliers: Ints) -> list[Ints]:
    """Outliers of one repeat that are most of the points from the first to the last of them."""
    found = []
    for group in np.unique(points.group[outliers]):
        run = np.flatnonzero(points.group == group)
        run = run[np.argsort(points.point[run], kind="stable")]
        (places,) = np.nonzero(np.isin(run, outliers))
        whole = len(places) == len(run)
        if len(places) >= LEAST and not whole and len(places) >= _SHARE * (places[-1] - places[0] + 1):
            found.append(run[places])
    return found


def stretch_words(points: Points, stretch: Ints, times: Sequence[float]) -> Text:
    measurement, repeat = points.run_of(int(points.group[stretch[0]]))
    return say(
        "points {first} to {last} of measurement {measurement}, repeat {repeat} are {low:.1f} to {high:.1f} of their "
        "standard deviations off what the others say, one after the other: the artefact, the probe or its stylus moved "
        "during this repeat; measure it again",
        first=int(points.point[stretch[0]]), last=int(points.point[stretch[-1]]), measurement=measurement,
        repeat=repeat, low=min(times), high=max(times),
    )  # fmt: skip


def recurring_points(points: Points, outliers: Ints) -> list[Ints]:
    """Outliers of points that are off in most of their readings, and in several set-ups."""
    found = []
    for point in np.unique(points.point[outliers]):
        rows = outliers[points.point[outliers] == point]
        set_ups, readings = len(np.unique(points.measurement[rows])), np.count_nonzero(points.point == point)
        if set_ups >= LEAST and len(rows) >= _SHARE * readings:
            found.append(rows)
    return found


def point_words(points: Points, rows: Ints, times: Sequence[float]) -> Text:
    point = int(points.point[rows[0]])
    return say(
        "point {point} is {low:.1f} to {high:.1f} of its standard deviations off what the others say in {count} of its "
        "{all} readings, in set-ups of different places: no gross error, but something that belongs to this point; on an "
        "artefact, look whether it is where its reference says",
        point=point, low=min(times), high=max(times), count=len(rows), all=int(np.count_nonzero(points.point == point)),
    )  # fmt: skip
