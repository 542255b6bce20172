"""One machine: how it stands, how each of its values went, and its certificates."""

from __future__ import annotations

from http import HTTPStatus
from itertools import pairwise

from cmm_uq.documents.document import Standing
from cmm_uq.errors import CmmUqError
from cmm_uq.messages import Text, Verbatim, commas, day, number, say
from cmm_uq.records.facts import Machine
from cmm_uq.records.listing import Choice, Course, Stated, chosen, courses
from cmm_uq.serving.drawing import Trend, drawn
from cmm_uq.serving.exchange import Asked, Refused
from cmm_uq.serving.machines_page import due_cell
from cmm_uq.serving.overview import GROUPS, Stands
from cmm_uq.serving.page import Block, Cell, Chart, Charts, Facts, Links, Notice, Page, Paragraph, Section, address
from cmm_uq.serving.view import View, certificate_cell, certificates_table, problem_of
from cmm_uq.serving.words import DECISIONS, shown
from cmm_uq.uncertainty.rounding import rounded

DRAWN = 200
"""Certificates whose values are drawn, the newest."""

FIGURES = "performance:"
"""What the name of a figure of performance begins with: on these a standard decides."""

LISTED = 10
"""Certificates that are listed here; a list of its own has all."""


def machine_page(view: View, asked: Asked) -> Page:
    """The machine that the address names, by serial or by name.

    Raises
    ------
    Refused : it is not known.
    """
    asked.only(("serial",))
    serial = asked.text("serial")
    if not serial:
        raise Refused(HTTPStatus.NOT_FOUND, say("the address names no machine"))
    try:
        machine = view.records.machine(serial)
    except CmmUqError as error:
        problem, fix = problem_of(error)
        raise Refused(HTTPStatus.NOT_FOUND, problem, fix) from None
    stands = next((one for one in view.machines if one.serial == machine.serial), None)
    listed, count = chosen(view.records, Choice(machine=machine.serial), LISTED)
    caption = say("The newest {shown} of {count}", shown=number(len(listed)), count=number(count, ",d"))
    every = Cell(say("All certificates of this machine"), address("/certificates", machine=machine.serial))
    table = certificates_table(listed, caption, say("No measured certificate is recorded."), machine=False)
    return Page(
        _title(machine), "/",
        lead=_lead(machine),
        above=(Cell(say("Machines"), "/"),),
        blocks=(*_notice(stands), _facts(machine, stands)),
        sections=(
            Section(say("Trends"), _trends(view, machine)),
            Section(say("Certificates"), (table, Links((every,)))),
        ),
    )  # fmt: skip


def _title(machine: Machine) -> Text:
    return Verbatim(machine.name or machine.serial)


def _lead(machine: Machine) -> Text:
    if machine.by_name:
        return say("Recognised by its name: its jobs state no serial number.")
    return say("Serial number {serial}", serial=Verbatim(machine.serial))


def _notice(stands: Stands | None) -> tuple[Notice, ...]:
    if stands is None:
        return ()
    head, *lines = (_told(stands, name) for name in stands.groups)
    return (Notice(head, GROUPS[stands.groups[0]].standing, tuple(Cell(line) for line in lines)),)


def _told(stands: Stands, name: str) -> Text:
    """A group of a machine, with the date or the decision that put it there."""
    due, certificate = stands.due, stands.newest.certificate
    if due is not None and due.day is not None:
        date = day(due.day)
        dated = {"overdue": say("Overdue since {day}", day=date), "due": say("Due soon, on {day}", day=date),
                 "order": say("In order, due on {day}", day=date)}  # fmt: skip
        if name in dated:
            return dated[name]
    if certificate is not None and name in ("failing", "open"):
        decision = DECISIONS.get(certificate.decision, (Verbatim(certificate.decision), None))[0]
        return say("{what}: its newest certificate says {decision:small}", what=GROUPS[name].word, decision=decision)
    return GROUPS[name].word


def _facts(machine: Machine, stands: Stands | None) -> Facts:
    rows = [
        (say("Manufacturer"), Cell(shown(machine.manufacturer))), (say("Model"), Cell(shown(machine.model))),
        (say("Place"), Cell(shown(machine.place))),
    ]  # fmt: skip
    if machine.adjusted:
        rows.append((say("Adjusted on"), Cell(commas(day(one) for one in machine.adjusted))))
    if stands is not None:
        rows.append((say("Due"), due_cell(stands)))
        if (newest := stands.newest.certificate) is not None:
            rows.append((say("Newest certificate"), certificate_cell(newest)))
    return Facts(tuple(rows))


def _trends(view: View, machine: Machine) -> tuple[Block, ...]:
    found = courses(view.records, machine, DRAWN)
    if not found:
        return (Paragraph(say("No value is recorded of this machine."), "note"),)
    adjusted = tuple(one.toordinal() for one in machine.adjusted)
    ordered = sorted(found, key=lambda one: (not one.name.startswith(FIGURES), one.stated[-1].limit is None))
    notes = (
        say("Newest value with its stated 95 % interval, and all measured values that stand: neither withdrawn nor replaced. "
            "A line is broken where the machine was adjusted; an open mark is an interim check."),
    )  # fmt: skip
    return (Charts(tuple(_chart(one, adjusted) for one in ordered), notes),)


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
