"""How each value of a machine went: a picture where there are two or more of it, a row of a table where there is one."""

from __future__ import annotations

from itertools import pairwise

from cmm_uq.app.serve.drawing import Trend, drawn
from cmm_uq.app.serve.page import Block, Chart, Charts, Paragraph
from cmm_uq.app.serve.values import values_table
from cmm_uq.base.messages import NOTHING, Text, Verbatim, day, number, say
from cmm_uq.certificate.document import Standing
from cmm_uq.laboratory.records.facts import Machine
from cmm_uq.laboratory.records.listing import Course, Stated, courses
from cmm_uq.laboratory.records.store import Records
from cmm_uq.maths.uncertainty.rounding import rounded

DRAWN = 200
"""Certificates whose values are drawn, the newest."""

FIGURES = "performance:"
"""What the name of a figure of performance begins with: on these a standard decides."""

_NOTE = say(
    "Newest value with its stated 95 % interval, and the measured values that stand: neither withdrawn nor replaced. A line "
    "is broken where the machine was adjusted; an open mark is an interim check."
)


def trends(records: Records, machine: Machine) -> tuple[Block, ...]:
    """Figures of performance first, then what has a limit.

    Raises
    ------
    CmmUqError : the records are damaged or locked.
    """
    found = courses(records, machine, DRAWN)
    if not found:
        return (Paragraph(say("No value is recorded of this machine."), "note"),)
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
    """The sentence in place of the picture."""
    values = [one.value for one in course.stated]
    low, high = (number(value, ".4g") for value in (min(values), max(values)))
    first, last = course.stated[0].day, course.stated[-1].day
    told = say(
        "{quantity}, {count} values from {first} to {last}, between {low} and {high} {unit}; the newest is {newest}",
        quantity=Verbatim(course.quantity), count=number(len(values)), first=day(first), last=day(last), low=low, high=high,
        unit=Verbatim(course.unit), newest=newest,
    )  # fmt: skip
    return say("{told}: beyond it", told=told) if beyond else told


def with_interval(one: Stated, unit: str) -> Text:
    """A value with its interval: ``5.2 ± 0.6 µm``, or both ends where it does not lie in the middle of them."""
    half = 0.5 * (one.upper - one.lower)
    value, shown_half = rounded(one.value, half)
    if abs(0.5 * (one.upper + one.lower) - one.value) > 0.05 * half:
        lower, upper = (rounded(end, half)[0] for end in (one.lower, one.upper))
        told = say("{value} [{lower}, {upper}]", value=value, lower=lower, upper=upper)
    else:
        told = say("{value} ± {half}", value=value, half=shown_half)
    return say("{told} {unit}", told=told, unit=Verbatim(unit)) if unit not in ("", "1") else told
