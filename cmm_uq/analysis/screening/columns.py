"""What screening reports, and what is odd beside the coordinates: values that cannot be, units, columns stuck or slipped."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from cmm_uq.base.messages import Text, Verbatim, alternatives, commas, listed, number, say
from cmm_uq.base.points import AXES, Floats, Ints, Points
from cmm_uq.base.values import dataclass


@dataclass(frozen=True)
class Finding:
    # impossible, duplicate, repeated block, swapped, reversed, unit, sign, exchanged coordinates, shifted column, stuck
    # or outlier
    kind: str
    measurements: tuple[int, ...]
    lines: tuple[int, ...]
    why: Text  # in words, and how to mend it
    column: str | None = None
    set_aside: bool = False  # whether the estimates leave these rows, or this column, out
    rows: tuple[int, ...] = ()  # of the recording, from 0, that are left out with it


def finding(kind: str, points: Points, rows: NDArray[np.bool_] | Ints, why: Text, column: str | None = None) -> Finding:
    lines = tuple(points.lines[rows].tolist()) if len(points.lines) else ()
    return Finding(kind, tuple(dict.fromkeys(points.measurement[rows].tolist())), lines, why, column)


def span(values: Floats) -> Text:
    """One value, or the lowest and the highest."""
    low, high = float(values.min()), float(values.max())
    return number(low, "g") if low == high else say("{low:g} to {high:g}", low=low, high=high)


def at_lines(points: Points, rows: Ints) -> Text:
    """``line 12``, ``lines 12 to 15`` or ``lines 3, 9 and 17``; rows from 1 where there is no file."""
    known = bool(len(points.lines))
    numbers = sorted(points.lines[rows].tolist()) if known else sorted((rows + 1).tolist())
    if len(numbers) == 1:
        return say("line {n}", n=numbers[0]) if known else say("row {n}", n=numbers[0])
    which = _which(numbers)
    return say("lines {which}", which=which) if known else say("rows {which}", which=which)


def _which(numbers: Sequence[int]) -> Text:
    if len(numbers) > 2 and numbers[-1] - numbers[0] == len(numbers) - 1:
        return say("{first} to {last}", first=numbers[0], last=numbers[-1])
    shown = [number(n) for n in numbers[:6]]
    if len(numbers) > 6:
        return say("{shown} and {count} more", shown=commas(shown), count=len(numbers) - 6)
    return listed(shown)


Rows = NDArray[np.bool_]
SCALES = tuple(f"temp_{a}_c" for a in AXES)
TEMPERATURES = (*SCALES, "temp_artefact_c", "temp_table_top_c", "temp_table_bottom_c", "temp_air_c")
# s between points of one set-up that no operator waits, and that no machine probes a ball in
LONGEST_PAUSE, SHORTEST_BALL = 6 * 3600.0, 0.6
_STUCK_ROWS, _STUCK_PART, _MOVING = 8, 0.15, 0.9
WAYS = ((-1, say("down")), (1, say("up")))  # that a column slipped by a row, and how to roll it back


@dataclass(frozen=True)
class Bounds:
    low: float
    high: float
    why: Text
    units: tuple[tuple[Text, float, float], ...] = ()

    def wrong(self, values: Floats) -> Rows:
        """(n,) outside the bounds."""
        return np.asarray((values < self.low) | (values > self.high))

    def unit(self, values: Floats) -> Text | None:
        """The unit in which all these values are plausible: value · factor + offset."""
        plausible = (name for name, factor, off in self.units if not np.any(self.wrong(factor * values + off)))
        return next(plausible, None)


_TEMPERATURE = Bounds(
    -30.0,
    55.0,
    say("no measuring room is so cold or hot; is it in °C?"),
    ((say("kelvin"), 1.0, -273.15), (Verbatim("°F"), 5 / 9, -160 / 9), (say("thousandths of °C"), 1e-3, 0.0)),
)

# What each column may hold
BOUNDS: Mapping[str, Bounds] = {
    "radius_mm": Bounds(1e-9, np.inf, say("a radius is positive")),
    "fit_rms_um": Bounds(0.0, np.inf, say("an rms is not negative")),
    "n_points": Bounds(1.0, np.inf, say("a fit needs points")),
    "humidity_pct": Bounds(0.0, 100.0, say("relative humidity lies between 0 and 100 %")),
    "pressure_hpa": Bounds(
        500.0, 1100.0, say("air pressure lies between 500 and 1100 hPa; is it in hPa?"),
        tuple((Verbatim(name), factor, 0.0) for name, factor in (("Pa", 1e-2), ("kPa", 10.0), ("bar", 1e3), ("inHg", 33.86))),
    ),
    "speed_mm_s": Bounds(0.0, np.inf, say("a speed is not negative")),
    **dict.fromkeys(TEMPERATURES, _TEMPERATURE),
}  # fmt: skip

SENSORS = (*BOUNDS, "time_s")  # columns that are left out where they cannot be trusted


def column_findings(points: Points, *, balls: bool) -> list[Finding]:
    of_values, of_time = (*_impossible(points), *_fraction(points)), _time(points, balls)
    return [*of_values, *of_time, *_stuck(points), *_slipped(points), *_approach(points)]


def _impossible(points: Points) -> Iterator[Finding]:
    for column, bounds in BOUNDS.items():
        if column in points.columns and np.any(rows := bounds.wrong(points.columns[column])):
            values = points.columns[column][rows]
            why = say("{column} = {span}: {why}", column=Verbatim(column), span=span(values), why=bounds.why)
            if (unit := bounds.unit(values)) is not None:
                why = say("{told} It looks like {unit}: convert it", told=why, unit=unit)
            yield finding("impossible" if unit is None else "unit", points, rows, why, column)


def _fraction(points: Points) -> Iterator[Finding]:
    humidity = points.columns.get("humidity_pct", np.zeros(0))
    if np.any(humidity > 0) and np.all(humidity <= 1):
        why = say(
            "humidity_pct = {span}: no air is so dry; it looks like a fraction of 1, not %: multiply by 100",
            span=span(humidity),
        )
        yield finding("unit", points, _every(points), why, "humidity_pct")


def _time(points: Points, balls: bool) -> Iterator[Finding]:
    """A clock in other units, seen by the time from point to point of one set-up; single moments out of their order."""
    if "time_s" not in points.columns or points.in_seconds:
        return
    time = points.columns["time_s"]
    steps = np.abs(np.diff(time))[np.diff(points.group) == 0]
    usual = float(np.median(steps)) if len(steps) else 0.0
    if usual > LONGEST_PAUSE:
        why = say("time_s: {usual:.3g} s from point to point of one set-up is longer than anybody waits; it "
                  "looks like milliseconds: divide by 1000", usual=usual)  # fmt: skip
    elif balls and 0 < usual < SHORTEST_BALL:
        why = say("time_s: {usual:.3g} s from ball to ball is shorter than a machine can probe one; it looks "
                  "like minutes or hours: give seconds", usual=usual)  # fmt: skip
    else:
        yield from _moments(points, time)
        return
    yield finding("unit", points, _every(points), why, "time_s")


def _moments(points: Points, time: Floats) -> Iterator[Finding]:
    if len(time) < 8:
        return
    before, after = np.maximum.accumulate(time), np.minimum.accumulate(time[::-1])[::-1]
    broken = np.flatnonzero((time[1:-1] > after[2:]) | (time[1:-1] < before[:-2])) + 1
    for row in broken.tolist():
        low, now, high = time[row - 1 : row + 2]
        if not low <= high or low <= now <= high or np.any(np.diff(np.delete(time, row)) < 0):
            continue
        for factor, unit in ((1e-3, say("milliseconds")), (60.0, say("minutes")), (3600.0, say("hours"))):
            if low <= factor * now * (1 + 1e-9) and factor * now <= high * (1 + 1e-9):
                rows = np.array([row])
                why = say("{at_lines}: time_s = {time:g} between {low:g} and {high:g} looks like {unit}: give seconds",
                          at_lines=at_lines(points, rows), time=now, low=low, high=high, unit=unit)  # fmt: skip
                yield finding("unit", points, rows, why, "time_s")
                break


def _stuck(points: Points) -> Iterator[Finding]:
    for column, values in _measured(points):
        firsts = _firsts(points.group) if _constant_in_groups(points.group, values) else np.arange(len(values))
        sequence = values[firsts]
        starts = np.concatenate([[0], np.flatnonzero(np.diff(sequence)) + 1])
        lengths = np.diff([*starts, len(sequence)])
        longest = int(np.argmax(lengths))
        start, length = int(starts[longest]), int(lengths[longest])
        outside = np.concatenate([np.diff(sequence[: start + 1]), np.diff(sequence[start + length - 1 :])])
        if length < max(_STUCK_ROWS, _STUCK_PART * len(sequence)) or len(outside) < _STUCK_ROWS:
            continue
        if np.mean(outside != 0) >= _MOVING:
            rows = np.arange(firsts[start], [*firsts, len(values)][start + length])
            why = say(
                "{column} is stuck at {values:g} in {at_lines}, where it changed from set-up to set-up "
                "before or after: look at the sensor",
                column=Verbatim(column),
                values=values[rows[0]],
                at_lines=at_lines(points, rows),
            )
            yield finding("stuck", points, rows, why, column)


def _slipped(points: Points) -> Iterator[Finding]:
    firsts = _firsts(points.group)
    sizes = np.diff([*firsts, len(points)])
    if len(firsts) < _STUCK_ROWS or sizes.min() < 2 or len(firsts) != len(np.unique(points.group)):
        return
    for column, values in _measured(points):
        if _constant_in_groups(points.group, values):
            continue
        if ways := [way for by, way in WAYS if _of_placings(np.roll(values, by), firsts, sizes)]:
            why = say(
                "{column} changes inside every set-up and would be the same for all points of each if it "
                "were moved back: it is shifted {ways} by one row against the other columns: move it back",
                column=Verbatim(column),
                ways=alternatives(ways),
            )
            yield finding("shifted column", points, _every(points), why, column)


def _of_placings(values: Floats, firsts: Ints, sizes: Ints) -> bool:
    constant = [np.ptp(values[a : a + k]) == 0 for a, k in zip(firsts, sizes, strict=True)]
    return bool(np.sum(constant) >= len(firsts) - 1 and np.mean(np.diff(values[firsts]) != 0) >= _MOVING)


def _approach(points: Points) -> Iterator[Finding]:
    names = [f"approach_{a}" for a in AXES]
    if not all(name in points.columns for name in (*names, "nx", "ny", "nz")):
        return
    travel = np.column_stack([points.columns[name] for name in names])
    normals = np.column_stack([points.columns[f"n{a}"] for a in AXES])
    outward = np.einsum("ni,ni->n", travel, normals) > 0.3
    for by, way in WAYS if outward.mean() > 0.1 else ():
        if np.count_nonzero(np.einsum("ni,ni->n", np.roll(travel, by, axis=0), normals) > 0.3) <= 1:
            why = say(
                "approach_x, approach_y, approach_z are shifted {way} by one row against the normals: move them back",
                way=way,
            )
            yield finding("shifted column", points, _every(points), why, "approach_x")
            return
    if outward.mean() > 0.95:
        why = say(
            "approach_x, approach_y, approach_z point along the outward normal: no probe reaches a "
            "surface from inside: turn their signs round"
        )
        yield finding("sign", points, outward, why, "approach_x")


def _every(points: Points) -> Rows:
    return np.ones(len(points), dtype=bool)


def _measured(points: Points) -> Iterator[tuple[str, Floats]]:
    for column in (*TEMPERATURES, "pressure_hpa", "humidity_pct"):
        if column in points.columns:
            yield column, points.columns[column]


def _firsts(group: Ints) -> Ints:
    """First row of every run of rows of one (measurement, repeat)."""
    return np.concatenate([[0], np.flatnonzero(np.diff(group)) + 1])


def _constant_in_groups(group: Ints, values: Floats) -> bool:
    return bool(np.all(np.diff(values)[np.diff(group) == 0] == 0))


def about_whole_column(item: Finding, points: Points) -> bool:
    """Whether half a column or more is concerned."""
    concerned = np.isin(points.lines, item.lines) if item.lines else np.isin(points.measurement, item.measurements)
    return item.column in points.columns and 2 * int(concerned.sum()) >= len(points)
