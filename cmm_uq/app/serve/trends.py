"""How each value of a machine went: a small picture of SVG lines, so that no page waits for a plotting library, or a row.

Colours, weights and lettering are the style sheet's (``templates/serve/style.css``), by class; so a picture is dark on a dark
screen and black on paper. Points are joined by a line between two adjustments, never across one.
"""

from __future__ import annotations

import datetime as dt
from collections.abc import Iterable, Sequence
from math import ceil, floor, isfinite, log10
from typing import NamedTuple

from cmm_uq.app.serve.page import Cell, PageTable, columns, shown
from cmm_uq.base.messages import DASH, NOTHING, Text, Verbatim, day, number, say
from cmm_uq.certificate.document import Standing
from cmm_uq.laboratory.records.facts import RecordedMachine, RecordedValue
from cmm_uq.laboratory.records.listing import Course, CourseValue, courses
from cmm_uq.laboratory.records.store import Records
from cmm_uq.maths.uncertainty.quantity import rounded

WIDTH, HEIGHT = 340, 150
RIGHT, TOP, BOTTOM = 8, 8, 20
"""Of the picture and its margins, CSS pixels at its natural size; the left one is as wide as the figures in it."""

DIGIT = 6.8  # width of a figure of the lettering in the widest of the style sheet's faces, CSS pixels
IN_SIGHT = 0.2  # part of a limit that the values must come to for it to be drawn: a far one would flatten them
_STEPS = (1.0, 2.0, 5.0, 10.0, 20.0)


class TrendMark(NamedTuple):
    """Where one value and the ends of its interval lie; ``joined``: to the one before it."""

    x: float
    y: float
    lower: float
    upper: float
    interim: bool
    joined: bool


class TrendPicture:
    """One value of one machine over time: where its days and values lie in the picture.

    ``stated``: oldest first; ``adjusted``: days of adjustments, proleptic Gregorian ordinals; ``limit``: of its amount;
    ``None`` where none is set.
    """

    width, height, right, top, foot = WIDTH, HEIGHT, WIDTH - RIGHT, TOP, HEIGHT - BOTTOM

    def __init__(self, stated: Sequence[CourseValue], adjusted: Iterable[int] = (), limit: float | None = None) -> None:
        lowest, highest = min(one.lower for one in stated), max(one.upper for one in stated)
        reaches = () if limit is None else ((limit, highest), (-limit, -lowest))
        # in sight of the values: the upper one, the lower one, both or none
        self.limits = [value for value, reach in reaches if reach >= IN_SIGHT * abs(value)]
        low, high = min([lowest, *self.limits]), max([highest, *self.limits])
        room = 0.08 * (high - low) or 0.1 * abs(high) or 1.0
        self.low, self.high = low - room, high + room
        self.figures = list(zip(*ticks(self.low, self.high), strict=True))
        self.left = 10 + DIGIT * min(max((len(text) for _, text in self.figures), default=0), 15)
        self.first = stated[0].day.toordinal()
        self.last = max(stated[-1].day.toordinal(), self.first + 1)
        self.adjusted = [day for day in adjusted if self.first <= day <= self.last]
        before = [None, *stated[:-1]]
        self.marks = [
            TrendMark(self.x(one.day.toordinal()), self.y(one.value), self.y(one.lower), self.y(one.upper), one.interim,
                 last is not None and last.adjusted_since == one.adjusted_since)
            for last, one in zip(before, stated, strict=True)
        ]  # fmt: skip

    def x(self, day: float) -> float:
        span = self.last - self.first
        return self.left + (self.right - self.left) * (day - self.first + 0.03 * span) / (1.06 * span)

    def y(self, value: float) -> float:
        return TOP + (self.foot - TOP) * (self.high - value) / (self.high - self.low)

    @property
    def years(self) -> list[tuple[float, int]]:
        """Where years begin, if there is room for two; else the first and the last day are named."""
        years = [(self.x(day), year) for day, year in new_years(self.first, self.last)]
        return years if len(years) > 1 else []

    @property
    def days(self) -> list[str]:
        ends = (self.first, self.last) if self.last > self.first + 1 else (self.first,)
        return [dt.date.fromordinal(day).isoformat() for day in ends]


def ticks(low: float, high: float, most: int = 4) -> tuple[list[float], list[str]]:
    """Round figures inside a range, at most ``most``, and their texts.

    >>> ticks(-0.3, 1.1) ([0.0, 0.5, 1.0], ['0.0', '0.5', '1.0'])
    """
    span = high - low
    if not (isfinite(span) and span > 0):
        return [], []
    power = 10.0 ** floor(log10(span / most))
    step = next(m * power for m in _STEPS if floor(high / (m * power)) - ceil(low / (m * power)) < most)
    decimals = max(0, ceil(-log10(step) - 1e-9))
    values = [k * step for k in range(ceil(low / step), floor(high / step) + 1)]
    return values, [f"{value + 0.0:.{decimals}f}".replace("-", "−") for value in values]


def new_years(first: int, last: int, most: int = 9) -> list[tuple[int, int]]:
    """Days on which years begin, with their years, at most ``most`` of them, inside a range of days."""
    begin, end = dt.date.fromordinal(first), dt.date.fromordinal(last)
    years = range(begin.year + (begin > dt.date(begin.year, 1, 1)), end.year + 1)
    step = max(1, ceil(len(years) / most))
    return [(dt.date(year, 1, 1).toordinal(), year) for year in years if year % step == 0]


VALUE_COLUMNS = columns(
    say("Quantity"), (say("Value"), "number"), (say("95 % interval"), "number"), (say("Limit"), "number"), say("Unit")
)


def values_table(
    caption: Text, rows: Iterable[tuple[str, str, RecordedValue | CourseValue]], empty: Text, *, heard: bool = False
) -> PageTable:
    """A row for each; a value beyond its limit is marked."""
    return PageTable(caption, VALUE_COLUMNS, tuple(_row(*row) for row in rows), empty, heard=heard)


def _row(quantity: str, unit: str, one: RecordedValue | CourseValue) -> tuple[Cell, ...]:
    half = 0.5 * (one.upper - one.lower)
    value, lower, upper = (rounded(figure, half)[0] for figure in (one.value, one.lower, one.upper))
    beyond = one.limit is not None and abs(one.value) > one.limit
    return (
        Cell(Verbatim(quantity)), Cell(value, standing="bad" if beyond else None),
        Cell(say("{lower} to {upper}", lower=lower, upper=upper)), Cell(DASH if one.limit is None else number(one.limit, "g")),
        Cell(shown(unit)),
    )  # fmt: skip


DRAWN = 200  # certificates whose values are drawn, the newest
FIGURES = "performance:"  # what the name of a figure of performance begins with: on these a standard decides


def trends(records: Records, machine: RecordedMachine) -> tuple[list[Chart], PageTable]:
    """Figures of performance first, then what has a limit; what was stated once so far as a table."""
    found = courses(records, machine, DRAWN)
    ordered = sorted(found, key=lambda one: (not one.name.startswith(FIGURES), one.stated[-1].limit is None))
    adjusted = tuple(one.toordinal() for one in machine.adjusted)
    once = [(one.quantity, one.unit, one.stated[0]) for one in ordered if len(one.stated) == 1]
    charts = [_chart(one, adjusted) for one in ordered if len(one.stated) > 1]
    return charts, values_table(say("Stated once so far"), once, NOTHING)


class Chart(NamedTuple):
    """A picture with the sentence that replaces it for whoever cannot see it."""

    title: Text
    told: Text
    picture: TrendPicture
    alternative: Text
    standing: Standing | None = None


def _chart(course: Course, adjusted: tuple[int, ...]) -> Chart:
    stated = course.stated
    limit = next((one.limit for one in reversed(stated) if one.limit is not None), None)
    newest = stated[-1]
    told = with_interval(newest, course.unit)
    beyond = limit is not None and abs(newest.value) > limit
    standing: Standing | None = "bad" if beyond else None
    if limit is not None:
        allowed = say("limit {limit} {unit}", limit=number(limit, "g"), unit=Verbatim(course.unit))
        told = say("{value}, {limit}", value=told, limit=allowed)
    picture = TrendPicture(stated, adjusted, limit)
    return Chart(Verbatim(course.quantity), told, picture, _in_words(course, told, beyond=beyond), standing)


def _in_words(course: Course, newest: Text, *, beyond: bool) -> Text:
    values = [one.value for one in course.stated]
    low, high = (number(value, ".4g") for value in (min(values), max(values)))
    first, last = course.stated[0].day, course.stated[-1].day
    told = say(
        "{quantity}, {count} values from {first} to {last}, between {low} and {high} {unit}; the newest is {newest}",
        quantity=Verbatim(course.quantity), count=number(len(values)), first=day(first), last=day(last), low=low, high=high,
        unit=Verbatim(course.unit), newest=newest,
    )  # fmt: skip
    return say("{told}: beyond it", told=told) if beyond else told


def with_interval(one: CourseValue, unit: str) -> Text:
    """A value with its interval: ``5.2 ± 0.6 µm``, or both ends where it does not lie in the middle of them."""
    half = 0.5 * (one.upper - one.lower)
    value, shown_half = rounded(one.value, half)
    if abs(0.5 * (one.upper + one.lower) - one.value) > 0.05 * half:
        lower, upper = (rounded(end, half)[0] for end in (one.lower, one.upper))
        told = say("{value} [{lower}, {upper}]", value=value, lower=lower, upper=upper)
    else:
        told = say("{value} ± {half}", value=value, half=shown_half)
    return say("{told} {unit}", told=told, unit=Verbatim(unit)) if unit not in ("", "1") else told
