"""One machine: how it stands, how each of its values went, and its certificates."""

from __future__ import annotations

from http import HTTPStatus

from cmm_uq.app.serve.exchange import Asked, Refused
from cmm_uq.app.serve.machines_page import due_cell
from cmm_uq.app.serve.overview import GROUPS, Stands
from cmm_uq.app.serve.page import Cell, Facts, Links, Notice, Page, Section, address
from cmm_uq.app.serve.trends import trends
from cmm_uq.app.serve.view import View, certificate_cell, certificates_table, problem_of
from cmm_uq.app.serve.words import DECISIONS, shown
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, Verbatim, commas, day, number, say
from cmm_uq.laboratory.records.facts import Machine
from cmm_uq.laboratory.records.listing import Choice, chosen

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
            Section(say("Trends"), trends(view.records, machine)),
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
