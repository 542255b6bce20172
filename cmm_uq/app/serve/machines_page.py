"""Pages of machines: all by their state, the most urgent first, and one with its values and certificates."""

from __future__ import annotations

from collections import Counter
from http import HTTPStatus

from cmm_uq.app.serve import page as p
from cmm_uq.app.serve.exchange import RefusedRequest, WebRequest
from cmm_uq.app.serve.overview import GROUPS, MachineStanding
from cmm_uq.app.serve.page import Cell, Chooser, FormField, PageNotice, PageSection, WebPage, address
from cmm_uq.app.serve.trends import trends
from cmm_uq.app.serve.view import (
    PER_PAGE,
    SiteView,
    certificate_cell,
    certificates_table,
    machine_cell,
    pager,
    problem_of,
)
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import DASH, NOTHING, Text, Verbatim, commas, day, listed, number, plural, say
from cmm_uq.laboratory.records.listing import CertificateFilter, chosen

MOST_PLACES = 40  # places that are offered to choose from; more are searched for by name
MOST_NAMED = 4  # artefacts that are named; a page of its own has all
LISTED = 10  # certificates that are listed here; a list of its own has all

COLUMNS = p.columns(
    say("Machine"), say("State"), (say("Due"), "day"), say("Newest certificate"), (say("Measured on"), "day"),
    say("Decision"), say("Model"), say("Place"),
)  # fmt: skip


def machines_page(view: SiteView, request: WebRequest) -> WebPage:
    """All machines, or those that were chosen."""
    request.only(("text", "state", "place", "page"))
    text, state, place = request.text("text"), request.one_of("state", tuple(GROUPS)), request.text("place")
    page, machines = request.count("page"), view.standing()
    found = [one for one in machines if _has(one, text.casefold(), state, place)]
    counts = Counter(group for one in machines for group in one.groups)
    tally = tuple(
        p.Count(counts[name], group.count, "/" if name == state else address("/", state=name), group.standing, name == state)
        for name, group in GROUPS.items() if counts[name] or name in ("overdue", "failing", "due", "order")
    )  # fmt: skip
    rows = tuple(_row(one) for one in found[(page - 1) * PER_PAGE : page * PER_PAGE])
    count = plural(len(found), one=say("1 machine"), many=say("{count} machines", count=number(len(found), ",d")))
    empty = say("No machine is as chosen.") if machines else say("No machine is recorded yet.")
    places = sorted({one.newest.machine.place for one in machines} - {""})
    states = (("", say("Any")), *((name, group.word) for name, group in GROUPS.items()))
    fields = [
        FormField("text", say("Serial, name, model or place"), text),
        FormField("state", say("State"), state, states, "select"),
    ]
    if 1 < len(places) <= MOST_PLACES:
        options = (("", say("Any")), *((one, Verbatim(one)) for one in places))
        fields.append(FormField("place", say("Place"), place, options, "select"))
    clear = Cell(say("Show all"), "/") if text or state or place else None
    return WebPage(
        say("Machines"), "/",
        lead=say("On {day}, the most urgent first.", day=day(view.today)),
        blocks=(
            p.Tally(say("By state"), tally),
            *_overdue_artefacts(view),
            Chooser(say("Choose machines"), "/", tuple(fields), say("Show"), clear),
            p.PageTable(count, COLUMNS, rows, empty),
            *pager(request, len(found), page, count),
        ),
    )  # fmt: skip


def _has(one: MachineStanding, text: str, state: str, place: str) -> bool:
    machine = one.newest.machine
    names = (machine.serial, machine.name, machine.manufacturer, machine.model, machine.place)
    chosen = (not state or state in one.groups) and (not place or place == machine.place)
    return chosen and (not text or any(text in name.casefold() for name in names))


def _overdue_artefacts(view: SiteView) -> tuple[PageNotice, ...]:
    overdue = [
        (one.serial, one.due) for one in view.records.artefacts() if one.due is not None and one.due < view.today
    ]
    if not overdue:
        return ()
    count = len(overdue)
    head = plural(
        count, one=say("1 artefact is out of date: no certificate can rest on it"),
        many=say("{count} artefacts are out of date: no certificate can rest on them", count=number(count)),
    )  # fmt: skip
    named = [say("{serial} since {day}", serial=p.shown(serial), day=day(due)) for serial, due in overdue[:MOST_NAMED]]
    more = [say("{count} more", count=number(count - MOST_NAMED))] if count > MOST_NAMED else []
    return (PageNotice(head, "bad", (Cell(listed([*named, *more])), Cell(say("All artefacts"), "/artefacts"))),)


def due_cell(one: MachineStanding, *, why: bool = True) -> Cell:
    """When a machine is due, and why."""
    if one.due is None:
        return Cell(DASH)
    return Cell(DASH if one.due.day is None else day(one.due.day), note=one.due.why if why else NOTHING)


def _row(one: MachineStanding) -> tuple[Cell, ...]:
    machine, certificate = one.newest.machine, one.newest.certificate
    first, *others = (GROUPS[name] for name in one.groups)
    newest = (Cell(NOTHING), Cell(NOTHING), Cell(NOTHING)) if certificate is None else (
        certificate_cell(certificate), p.day_cell(certificate.day), p.cell_of(p.DECISIONS, certificate.decision)
    )  # fmt: skip
    return (
        machine_cell(machine.serial, machine.name),
        Cell(first.word, standing=first.standing, note=commas(group.word for group in others)),
        due_cell(one, why=False), *newest,
        Cell(p.shown(" ".join(filter(None, (machine.manufacturer, machine.model))))), Cell(p.shown(machine.place)),
    )  # fmt: skip


def machine_page(view: SiteView, request: WebRequest) -> WebPage:
    """The machine that the address names, by serial or by name."""
    request.only(("serial",))
    serial = request.text("serial")
    if not serial:
        raise RefusedRequest(HTTPStatus.NOT_FOUND, say("the address names no machine"))
    try:
        machine = view.records.machine(serial)
    except CmmUqError as error:
        raise RefusedRequest(HTTPStatus.NOT_FOUND, *problem_of(error)) from None
    standing = next((one for one in view.standing() if one.serial == machine.serial), None)
    facts = [
        (say("Manufacturer"), Cell(p.shown(machine.manufacturer))), (say("Model"), Cell(p.shown(machine.model))),
        (say("Place"), Cell(p.shown(machine.place))),
    ]  # fmt: skip
    if machine.adjusted:
        facts.append((say("Adjusted on"), Cell(commas(day(one) for one in machine.adjusted))))
    notices: tuple[PageNotice, ...] = ()
    if standing is not None:
        head, *lines = (_group_words(standing, name) for name in standing.groups)
        notices = (PageNotice(head, GROUPS[standing.groups[0]].standing, tuple(map(Cell, lines))),)
        facts.append((say("Due"), due_cell(standing)))
        if (newest := standing.newest.certificate) is not None:
            facts.append((say("Newest certificate"), certificate_cell(newest)))
    listed, count = chosen(view.records, CertificateFilter(machine=machine.serial), LISTED)
    caption = say("The newest {shown} of {count}", shown=number(len(listed)), count=number(count, ",d"))
    every = Cell(say("All certificates of this machine"), address("/certificates", machine=machine.serial))
    table = certificates_table(listed, caption, say("No measured certificate is recorded."), machine=False)
    lead = say("Serial number {serial}", serial=Verbatim(machine.serial))
    if machine.by_name:
        lead = say("Recognised by its name: its jobs state no serial number.")
    return WebPage(
        Verbatim(machine.name or machine.serial), "/", lead=lead,
        above=(Cell(say("Machines"), "/"),),
        blocks=(*notices, p.PageFacts(tuple(facts))),
        sections=(
            PageSection(say("Trends"), trends(view.records, machine)),
            PageSection(say("Certificates"), (table, p.Links((every,)))),
        ),
    )  # fmt: skip


def _group_words(one: MachineStanding, name: str) -> Text:
    """A group of a machine, with the date or the decision that put it there."""
    due, certificate = one.due, one.newest.certificate
    if due is not None and due.day is not None:
        date = day(due.day)
        dated = {"overdue": say("Overdue since {day}", day=date), "due": say("Due soon, on {day}", day=date),
                 "order": say("In order, due on {day}", day=date)}  # fmt: skip
        if name in dated:
            return dated[name]
    if certificate is not None and name in ("failing", "open"):
        decision = p.DECISIONS.get(certificate.decision, (Verbatim(certificate.decision), None))[0]
        return say("{what}: its newest certificate says {decision:small}", what=GROUPS[name].word, decision=decision)
    return GROUPS[name].word
