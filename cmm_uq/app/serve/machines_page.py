"""Pages of machines: all by their state, the most urgent first, and one with its values and certificates."""

from __future__ import annotations

from collections import Counter
from http import HTTPStatus

from cmm_uq.app.serve.exchange import RefusedRequest, WebRequest
from cmm_uq.app.serve.overview import GROUPS, MachineStanding
from cmm_uq.app.serve.page import (
    DECISIONS,
    Cell,
    Chooser,
    Count,
    FormField,
    Links,
    PageFacts,
    PageNotice,
    PageSection,
    PageTable,
    Tally,
    WebPage,
    address,
    cell_of,
    columns,
    day_cell,
    shown,
)
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
from cmm_uq.laboratory.records.facts import RecordedMachine
from cmm_uq.laboratory.records.listing import CertificateFilter, chosen

MOST_PLACES = 40  # places that are offered to choose from; more are searched for by name
MOST_NAMED = 4  # artefacts that are named; a page of its own has all

COLUMNS = columns(
    say("Machine"),
    say("State"),
    (say("Due"), "day"),
    say("Newest certificate"),
    (say("Measured on"), "day"),
    say("Decision"),
    say("Model"),
    say("Place"),
)


def machines_page(view: SiteView, asked: WebRequest) -> WebPage:
    """All machines, or those that were chosen."""
    asked.only(("text", "state", "place", "page"))
    text, state, place = asked.text("text"), asked.one_of("state", tuple(GROUPS)), asked.text("place")
    page = asked.count("page")
    found = [one for one in view.machines if _has(one, text.casefold(), state, place)]
    rows = tuple(_row(one) for one in found[(page - 1) * PER_PAGE : page * PER_PAGE])
    count = plural(len(found), one=say("1 machine"), many=say("{count} machines", count=number(len(found), ",d")))
    empty = say("No machine is recorded yet.") if not view.machines else say("No machine is as chosen.")
    return WebPage(
        say("Machines"), "/",
        lead=say("On {day}, the most urgent first.", day=day(view.today)),
        blocks=(
            _tally(view, state),
            *_artefacts(view),
            _chooser(view, text, state, place),
            PageTable(count, COLUMNS, rows, empty),
            *pager(asked, len(found), page, count),
        ),
    )  # fmt: skip


def _has(one: MachineStanding, text: str, state: str, place: str) -> bool:
    machine = one.newest.machine
    names = (machine.serial, machine.name, machine.manufacturer, machine.model, machine.place)
    return (
        (not state or state in one.groups)
        and (not place or place == machine.place)
        and (not text or any(text in name.casefold() for name in names))
    )


def _tally(view: SiteView, state: str) -> Tally:
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


def _artefacts(view: SiteView) -> tuple[PageNotice, ...]:
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
    return (PageNotice(head, "bad", (Cell(listed([*named, *more])), Cell(say("All artefacts"), "/artefacts"))),)


def _chooser(view: SiteView, text: str, state: str, place: str) -> Chooser:
    places = sorted({one.newest.machine.place for one in view.machines} - {""})
    fields = [FormField("text", say("Serial, name, model or place"), text)]
    states = (("", say("Any")), *((name, group.word) for name, group in GROUPS.items()))
    fields.append(FormField("state", say("State"), state, states, "select"))
    if 1 < len(places) <= MOST_PLACES:
        options = (("", say("Any")), *((one, Verbatim(one)) for one in places))
        fields.append(FormField("place", say("Place"), place, options, "select"))
    clear = Cell(say("Show all"), "/") if text or state or place else None
    return Chooser(say("Choose machines"), "/", tuple(fields), say("Show"), clear)


def state_cell(one: MachineStanding) -> Cell:
    """The most urgent group of a machine; the others below."""
    first, *others = (GROUPS[name] for name in one.groups)
    return Cell(first.word, standing=first.standing, note=commas(group.word for group in others))


def due_cell(one: MachineStanding, *, why: bool = True) -> Cell:
    """When a machine is due, and why."""
    if one.due is None or one.due.day is None:
        told: Text = one.due.why if one.due is not None else NOTHING
        return Cell(DASH, note=told if why else NOTHING)
    return Cell(day(one.due.day), note=one.due.why if why else NOTHING)


def _row(one: MachineStanding) -> tuple[Cell, ...]:
    machine, certificate = one.newest.machine, one.newest.certificate
    kept = (Cell(NOTHING), Cell(NOTHING), Cell(NOTHING)) if certificate is None else (
        certificate_cell(certificate), day_cell(certificate.day), cell_of(DECISIONS, certificate.decision)
    )  # fmt: skip
    return (
        machine_cell(machine.serial, machine.name), state_cell(one), due_cell(one, why=False), *kept,
        Cell(shown(" ".join(filter(None, (machine.manufacturer, machine.model))))), Cell(shown(machine.place)),
    )  # fmt: skip


LISTED = 10  # certificates that are listed here; a list of its own has all


def machine_page(view: SiteView, asked: WebRequest) -> WebPage:
    """The machine that the address names, by serial or by name."""
    asked.only(("serial",))
    serial = asked.text("serial")
    if not serial:
        raise RefusedRequest(HTTPStatus.NOT_FOUND, say("the address names no machine"))
    try:
        machine = view.records.machine(serial)
    except CmmUqError as error:
        problem, fix = problem_of(error)
        raise RefusedRequest(HTTPStatus.NOT_FOUND, problem, fix) from None
    stands = next((one for one in view.machines if one.serial == machine.serial), None)
    listed, count = chosen(view.records, CertificateFilter(machine=machine.serial), LISTED)
    caption = say("The newest {shown} of {count}", shown=number(len(listed)), count=number(count, ",d"))
    every = Cell(say("All certificates of this machine"), address("/certificates", machine=machine.serial))
    table = certificates_table(listed, caption, say("No measured certificate is recorded."), machine=False)
    return WebPage(
        _title(machine), "/",
        lead=_lead(machine),
        above=(Cell(say("Machines"), "/"),),
        blocks=(*_notice(stands), _facts(machine, stands)),
        sections=(
            PageSection(say("Trends"), trends(view.records, machine)),
            PageSection(say("Certificates"), (table, Links((every,)))),
        ),
    )  # fmt: skip


def _title(machine: RecordedMachine) -> Text:
    return Verbatim(machine.name or machine.serial)


def _lead(machine: RecordedMachine) -> Text:
    if machine.by_name:
        return say("Recognised by its name: its jobs state no serial number.")
    return say("Serial number {serial}", serial=Verbatim(machine.serial))


def _notice(stands: MachineStanding | None) -> tuple[PageNotice, ...]:
    if stands is None:
        return ()
    head, *lines = (_told(stands, name) for name in stands.groups)
    return (PageNotice(head, GROUPS[stands.groups[0]].standing, tuple(Cell(line) for line in lines)),)


def _told(stands: MachineStanding, name: str) -> Text:
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


def _facts(machine: RecordedMachine, stands: MachineStanding | None) -> PageFacts:
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
    return PageFacts(tuple(rows))
