"""The first page: every machine by its state, the most urgent first; what is out of date before anything else."""

from __future__ import annotations

from collections import Counter

from cmm_uq.app.serve.exchange import Asked
from cmm_uq.app.serve.overview import GROUPS, Stands
from cmm_uq.app.serve.page import Cell, Chooser, Column, Count, Field, Notice, Page, Table, Tally, address
from cmm_uq.app.serve.view import PER_PAGE, View, certificate_cell, machine_cell, pager
from cmm_uq.app.serve.words import DECISIONS, cell_of, day_cell, shown
from cmm_uq.base.messages import DASH, NOTHING, Text, Verbatim, commas, day, listed, number, plural, say

MOST_PLACES = 40
"""Places that are offered to choose from; more are searched for by name."""

MOST_NAMED = 4
"""Artefacts that are named; a page of its own has all."""

COLUMNS = (
    Column(say("Machine")), Column(say("State")), Column(say("Due"), sort="day"), Column(say("Newest certificate")),
    Column(say("Measured on"), sort="day"), Column(say("Decision")), Column(say("Model")), Column(say("Place")),
)  # fmt: skip


def machines_page(view: View, asked: Asked) -> Page:
    """All machines, or those that were chosen.

    Raises
    ------
    Refused : the address asks for something that the page does not know.
    """
    asked.only(("text", "state", "place", "page"))
    text, state, place = asked.text("text"), asked.one_of("state", tuple(GROUPS)), asked.text("place")
    page = asked.count("page")
    found = [one for one in view.machines if _has(one, text.casefold(), state, place)]
    rows = tuple(_row(one) for one in found[(page - 1) * PER_PAGE : page * PER_PAGE])
    count = plural(len(found), one=say("1 machine"), many=say("{count} machines", count=number(len(found), ",d")))
    empty = say("No machine is recorded yet.") if not view.machines else say("No machine is as chosen.")
    return Page(
        say("Machines"), "/",
        lead=say("On {day}, the most urgent first.", day=day(view.today)),
        blocks=(
            _tally(view, state),
            *_artefacts(view),
            _chooser(view, text, state, place),
            Table(count, COLUMNS, rows, empty),
            *pager(asked, len(found), page, count),
        ),
    )  # fmt: skip


def _has(one: Stands, text: str, state: str, place: str) -> bool:
    machine = one.newest.machine
    names = (machine.serial, machine.name, machine.manufacturer, machine.model, machine.place)
    return (
        (not state or state in one.groups)
        and (not place or place == machine.place)
        and (not text or any(text in name.casefold() for name in names))
    )


def _tally(view: View, state: str) -> Tally:
    """Every group that has a machine, and always what is overdue, due soon, not conforming, and in order."""
    counts = Counter(group for one in view.machines for group in one.groups)
    always = ("overdue", "failing", "due", "order")
    return Tally(
        say("By state"),
        tuple(
            Count(counts[name], group.count, "/" if name == state else address("/", state=name), group.standing,
                  name == state)
            for name, group in GROUPS.items() if counts[name] or name in always
        ),
    )  # fmt: skip


def _artefacts(view: View) -> tuple[Notice, ...]:
    overdue = view.overdue_artefacts()
    if not overdue:
        return ()
    count = len(overdue)
    head = plural(
        count, one=say("1 artefact is out of date: no certificate can rest on it"),
        many=say("{count} artefacts are out of date: no certificate can rest on them", count=number(count)),
    )  # fmt: skip
    named = [say("{serial} since {day}", serial=shown(one.serial), day=day(one.due))
             for one in overdue[:MOST_NAMED] if one.due is not None]  # fmt: skip
    more = [say("{count} more", count=number(count - MOST_NAMED))] if count > MOST_NAMED else []
    return (Notice(head, "bad", (Cell(listed([*named, *more])), Cell(say("All artefacts"), "/artefacts"))),)


def _chooser(view: View, text: str, state: str, place: str) -> Chooser:
    places = sorted({one.newest.machine.place for one in view.machines} - {""})
    fields = [Field("text", say("Serial, name, model or place"), text)]
    states = (("", say("Any")), *((name, group.word) for name, group in GROUPS.items()))
    fields.append(Field("state", say("State"), state, states, "select"))
    if 1 < len(places) <= MOST_PLACES:
        options = (("", say("Any")), *((one, Verbatim(one)) for one in places))
        fields.append(Field("place", say("Place"), place, options, "select"))
    clear = Cell(say("Show all"), "/") if text or state or place else None
    return Chooser(say("Choose machines"), "/", tuple(fields), say("Show"), clear)


def state_cell(one: Stands) -> Cell:
    """The most urgent group of a machine; the others below."""
    first, *others = (GROUPS[name] for name in one.groups)
    return Cell(first.word, standing=first.standing, note=commas(group.word for group in others))


def due_cell(one: Stands, *, why: bool = True) -> Cell:
    """When a machine is due, and why."""
    if one.due is None or one.due.day is None:
        told: Text = one.due.why if one.due is not None else NOTHING
        return Cell(DASH, note=told if why else NOTHING)
    return Cell(day(one.due.day), note=one.due.why if why else NOTHING)


def _row(one: Stands) -> tuple[Cell, ...]:
    machine, certificate = one.newest.machine, one.newest.certificate
    kept = (Cell(NOTHING), Cell(NOTHING), Cell(NOTHING)) if certificate is None else (
        certificate_cell(certificate), day_cell(certificate.day), cell_of(DECISIONS, certificate.decision)
    )  # fmt: skip
    return (
        machine_cell(machine.serial, machine.name), state_cell(one), due_cell(one, why=False), *kept,
        Cell(shown(" ".join(filter(None, (machine.manufacturer, machine.model))))), Cell(shown(machine.place)),
    )  # fmt: skip
