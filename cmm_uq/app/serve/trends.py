"""How each value of a machine went: a small picture of SVG lines, so that no page waits for a plotting library, or a row.

Colours, weights and lettering are the style sheet's (``templates/serve/style.css``), by class; so a picture is dark on a dark
screen and black on paper. Points are joined by a line between two adjustments, never across one.
"""

from __future__ import annotations

import datetime as dt
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape
from itertools import pairwise
from math import ceil, floor, isfinite, log10

from cmm_uq.app.serve.page import CHART, Block, Cell, Chart, Charts, PageParagraph, PageTable, columns, shown
from cmm_uq.base.messages import DASH, NOTHING, Text, Verbatim, day, number, say
from cmm_uq.certificate.document import Standing
from cmm_uq.laboratory.records.facts import RecordedMachine, RecordedValue
from cmm_uq.laboratory.records.listing import Course, CourseValue, courses
from cmm_uq.laboratory.records.store import Records
from cmm_uq.maths.uncertainty.quantity import rounded

WIDTH, HEIGHT = CHART
RIGHT, TOP, BOTTOM = 8, 8, 20
"""Of the picture and its margins, CSS pixels at its natural size; the left one is as wide as the figures in it."""

DIGIT = 6.8  # width of a figure of the lettering in the widest of the style sheet's faces, CSS pixels
IN_SIGHT = 0.2  # part of a limit that the values must come to for it to be drawn: a far one would flatten them
_STEPS = (1.0, 2.0, 5.0, 10.0, 20.0)


@dataclass(frozen=True)
class PlotFrame:
    """Where days (``first`` and ``last`` at its ends) and values lie in the picture."""

    first: float
    last: float
    low: float
    high: float

    @property
    def left(self) -> float:
        longest = max((len(text) for text in ticks(self.low, self.high)[1]), default=0)
        return 10 + DIGIT * min(longest, 15)

    def x(self, day: float) -> float:
        return self.left + (WIDTH - self.left - RIGHT) * (day - self.first) / (self.last - self.first)

    def y(self, value: float) -> float:
        return TOP + (HEIGHT - TOP - BOTTOM) * (self.high - value) / (self.high - self.low)


@dataclass(frozen=True)
class Trend:
    """One value of one machine over time.

    ``days``: of the measurements, ascending, proleptic Gregorian ordinals; ``values, lower, upper``: in the unit,
    with the stated interval; ``interim``: whether each is of an interim check; ``parted``: whether the machine was
    adjusted between each and the next, one fewer; ``adjusted``: days of adjustments; ``limit``: of its amount;
    ``None`` where none is set.
    """

    days: Sequence[int]
    values: Sequence[float]
    lower: Sequence[float]
    upper: Sequence[float]
    interim: Sequence[bool]
    parted: Sequence[bool] = ()
    adjusted: Sequence[int] = ()
    limit: float | None = None

    @property
    def limits(self) -> list[float]:
        """Limits that are in sight of the values: the upper one, the lower one, both or none."""
        if self.limit is None:
            return []
        return [sign * self.limit for sign, reach in ((1, max(self.upper)), (-1, -min(self.lower)))
                if reach >= IN_SIGHT * self.limit]  # fmt: skip


def drawn(trend: Trend, limit_word: Text, adjusted_word: Text) -> str:
    """The picture's elements, without the ``svg`` around them."""
    first, last = trend.days[0], max(trend.days[-1], trend.days[0] + 1)
    room = 0.03 * (last - first)
    frame = PlotFrame(first - room, last + room, *_range([*trend.lower, *trend.upper, *trend.limits]))
    x, y, left, right = frame.x, frame.y, frame.left, WIDTH - RIGHT
    parts = _axes(frame, first, last)
    parts += [f'<path class="limit" d="M{left:.1f} {y(value):.1f}H{right}"/>' for value in trend.limits]
    if trend.limits:
        place = y(trend.limits[0]) + (-4 if trend.limits[0] < 0 else 11)
        parts.append(f'<text class="limit" x="{right}" y="{place:.1f}" text-anchor="end">{escape(limit_word)}</text>')
    inside = [day for day in trend.adjusted if first <= day <= last]
    parts += [f'<path class="adjusted" d="M{x(day - 0.5):.1f} {TOP}V{HEIGHT - BOTTOM}"/>' for day in inside]
    if inside:
        at = x(inside[-1])
        anchor, shift = ("start", 3) if at < WIDTH / 2 else ("end", -3)
        height = TOP + 9 if min(trend.limits, default=0.0) < 0 else HEIGHT - BOTTOM - 4
        parts.append(f'<text x="{at + shift:.1f}" y="{height}" text-anchor="{anchor}">{escape(adjusted_word)}</text>')
    rows = list(zip(trend.days, trend.values, trend.lower, trend.upper, trend.interim, strict=True))
    joined = "".join(
        f"{'M' if i == 0 or any(trend.parted[i - 1 : i]) else 'L'}{x(day):.1f} {y(value):.1f}"
        for i, (day, value, *_) in enumerate(rows)
    )
    parts.append(f'<path class="line" d="{joined}"/>')
    bars = "".join(f"M{x(day):.1f} {y(below):.1f}V{y(above):.1f}" for day, _, below, above, _ in rows)
    parts.append(f'<path class="interval" d="{bars}"/>')
    radius = 3 if len(rows) <= 40 else 1.75
    parts += [
        f'<circle class="{"interim" if interim else "point"}" cx="{x(day):.1f}" cy="{y(value):.1f}" r="{radius}"/>'
        for day, value, _, _, interim in rows
    ]
    return "".join(parts)


def _range(values: Sequence[float]) -> tuple[float, float]:
    low, high = min(values), max(values)
    room = 0.08 * (high - low) or 0.1 * abs(high) or 1.0
    return low - room, high + room


def _axes(frame: PlotFrame, first: int, last: int) -> list[str]:
    """Round figures at the left; below, the first and the last day, or where there is room the years."""
    x, left, right = frame.x, frame.left, WIDTH - RIGHT
    parts = [
        f'<path class="axis" d="M{left:.1f} {frame.y(value):.1f}H{right}"/>'
        f'<text x="{left - 6:.1f}" y="{frame.y(value) + 4:.1f}" text-anchor="end">{text}</text>'
        for value, text in zip(*ticks(frame.low, frame.high), strict=True)
    ]
    below = HEIGHT - 5
    years = [(x(day), year) for day, year in new_years(first, last)]
    if len(years) >= 2:
        parts += [
            f'<path class="axis" d="M{at:.1f} {HEIGHT - BOTTOM}v4"/>'
            f'<text x="{min(at, right - 12):.1f}" y="{below}" text-anchor="middle">{year}</text>'
            for at, year in years
        ]
    else:
        one, other = dt.date.fromordinal(first), dt.date.fromordinal(last)
        parts.append(f'<text x="{x(first):.1f}" y="{below}">{one.isoformat()}</text>')
        if other - one > dt.timedelta(days=1):
            parts.append(f'<text x="{right}" y="{below}" text-anchor="end">{other.isoformat()}</text>')
    parts.append(f'<path class="axis" d="M{left:.1f} {HEIGHT - BOTTOM}H{right}"/>')
    return parts


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

_NOTE = say(
    "Newest value with its stated 95 % interval, and the measured values that stand: neither withdrawn nor replaced. A line "
    "is broken where the machine was adjusted; an open mark is an interim check."
)


def trends(records: Records, machine: RecordedMachine) -> tuple[Block, ...]:
    """Figures of performance first, then what has a limit."""
    found = courses(records, machine, DRAWN)
    if not found:
        return (PageParagraph(say("No value is recorded of this machine."), "note"),)
    ordered = sorted(found, key=lambda one: (not one.name.startswith(FIGURES), one.stated[-1].limit is None))
    adjusted = tuple(one.toordinal() for one in machine.adjusted)
    several = tuple(_chart(one, adjusted) for one in ordered if len(one.stated) > 1)
    once = [(one.quantity, one.unit, one.stated[0]) for one in ordered if len(one.stated) == 1]
    charts = (Charts(several, (_NOTE,)),) if several else ()
    return (*charts, values_table(say("Stated once so far"), once, NOTHING)) if once else charts


def _chart(course: Course, adjusted: tuple[int, ...]) -> Chart:
    stated = course.stated
    limit = next((one.limit for one in reversed(stated) if one.limit is not None), None)
    trend = Trend(
        [one.day.toordinal() for one in stated], [one.value for one in stated], [one.lower for one in stated],
        [one.upper for one in stated], [one.interim for one in stated],
        [before.adjusted_since != one.adjusted_since for before, one in pairwise(stated)], adjusted, limit,
    )  # fmt: skip
    newest = stated[-1]
    told = with_interval(newest, course.unit)
    beyond = limit is not None and abs(newest.value) > limit
    standing: Standing | None = "bad" if beyond else None
    if limit is not None:
        allowed = say("limit {limit} {unit}", limit=number(limit, "g"), unit=Verbatim(course.unit))
        told = say("{value}, {limit}", value=told, limit=allowed)
    return Chart(Verbatim(course.quantity), told, drawn(trend, say("limit"), say("adjusted")),
                 _in_words(course, told, beyond=beyond), standing)  # fmt: skip


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
