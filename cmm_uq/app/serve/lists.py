"""Lists of machines, certificates, diagnoses, parts and artefacts, chosen by what a reader asks, and the page of a machine."""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping, Sequence
from http import HTTPStatus
from typing import Any

from cmm_uq.app.serve import page as p, view as v
from cmm_uq.app.serve.exchange import RefusedRequest, WebRequest, bad
from cmm_uq.app.serve.trends import trends
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import DASH, NOTHING, Text, Verbatim, commas, day, listed, number, plural, say
from cmm_uq.jobs.verdicts import DIAGNOSES
from cmm_uq.laboratory.records import facts
from cmm_uq.laboratory.records.facts import ArtefactRow
from cmm_uq.laboratory.records.listing import CertificateFilter, chosen

_KEYS = ("text", "machine", "artefact", "origin", "state", "decision", "since", "until", "page")


def _list(template: str, request: WebRequest, rows: p.PageTable, total: int, **further: Any) -> p.WebPage:
    """A page of a list: what narrows it (``chosen``, by name), its rows, and where in it the reader is."""
    narrowed, pager = _narrowed(request), v.pager(request, total, rows.caption)
    return p.page(template, request.path, chosen=request.text, narrowed=narrowed, rows=rows, pager=pager, **further)


def _narrowed(request: WebRequest) -> bool:
    return any(request.text(name) for name in request.query if name != "page")


def _options(words: Mapping[str, p.Word]) -> list[tuple[str, Text]]:
    return [(name, text) for name, (text, _) in words.items()]


def _days(request: WebRequest) -> tuple[dt.date | None, dt.date | None]:
    since, until = request.day("since"), request.day("until")
    if since is not None and until is not None and since > until:
        raise bad(say("the list would end before it begins"), say("Exchange the two dates"))
    return since, until


def certificates_page(view: v.SiteView, request: WebRequest) -> p.WebPage:
    request.only(_KEYS)
    choice = _choice(request, "report")
    rows, total = v.paged(view.records, choice, request)
    count = plural(total, one=say("1 certificate"), many=say("{count} certificates", count=number(total, ",d")))
    none = say("No certificate of a measurement is recorded yet.")
    table = v.certificates_table(rows, count, say("No certificate is as chosen.") if _narrowed(request) else none)
    return _list("certificates.html", request, table, total, **_choices(choice.origin))


def _choice(request: WebRequest, command: str) -> CertificateFilter:
    text, machine, artefact = (request.text(name) for name in ("text", "machine", "artefact"))
    origin = request.one_of("origin", tuple(p.ORIGINS)) or "measured"
    state = request.one_of("state", facts.STATES)
    decision = request.one_of("decision", tuple(p.DECISIONS))
    since, until = _days(request)
    return CertificateFilter(
        text=text, machine=machine, artefact=artefact, origin=origin, command=command, states=(state,) if state else (),
        decisions=(decision,) if decision else (), since=since, until=until,
    )  # fmt: skip


def _choices(origin: str) -> dict[str, Any]:
    """What can be chosen, and a warning where nobody measured."""
    return {
        "origin": origin,
        "warning": p.NOT_MEASURED.get(origin),
        "states": _options(p.STATES),
        "decisions": _options(p.DECISIONS),
        "origins": p.ORIGINS.items(),
    }


def diagnoses_page(view: v.SiteView, request: WebRequest) -> p.WebPage:
    """Verdicts of certificates and of diagnoses on whether a recording agrees with its model."""
    request.only(("text", "verdict", "since", "until", "page"))
    verdict = request.one_of("verdict", (*p.VERDICTS, "all"))
    verdicts = {"": DIAGNOSES[1:], "all": tuple(p.VERDICTS)}.get(verdict, (verdict,))
    since, until = _days(request)
    choice = CertificateFilter(text=request.text("text"), command="", verdicts=verdicts, since=since, until=until)
    rows, total = v.paged(view.records, choice, request)
    count = plural(total, one=say("1 recording"), many=say("{count} recordings", count=number(total, ",d")))
    cells = tuple(
        (v.certificate_cell(one), p.cell_of(p.VERDICTS, one.diagnosis), v.machine_cell(one.machine, one.machine_name),
         p.day_cell(one.day),
         p.cell_of(p.STATES, one.state) if one.command == "report" else p.Cell(DASH))
        for one in rows
    )  # fmt: skip
    headings = p.columns(
        say("Certificate or diagnosis"), say("Verdict"), say("Machine"), (say("Measured on"), "day"), say("State")
    )
    table = p.PageTable(count, headings, cells, say("There is none."))
    return _list("diagnoses.html", request, table, total, verdicts=_options(p.VERDICTS))


def parts_page(view: v.SiteView, request: WebRequest) -> p.WebPage:
    """Reports of parts, with the machine that measured each and its certificate."""
    request.only(tuple(name for name in _KEYS if name != "artefact"))
    choice = _choice(request, facts.PART)
    rows, total = v.paged(view.records, choice, request)
    count = plural(
        total, one=say("1 report of a part"), many=say("{count} reports of parts", count=number(total, ",d"))
    )
    table = v.parts_table(view.records, rows, count, say("There is none."))
    return _list("parts.html", request, table, total, **_choices(choice.origin))


ARTEFACT_COLUMNS = p.columns(
    say("Artefact"), say("State"), (say("Due"), "day"), (say("Calibrated on"), "day"), say("Certificate"),
    say("Laboratory"), say("Used for"), say("Certificates made with it"),
)  # fmt: skip


def artefacts_page(view: v.SiteView, request: WebRequest) -> p.WebPage:
    request.only(("text", "page"))
    folded = request.text("text").casefold()
    known = sorted(view.records.artefacts(view.today), key=lambda one: (one.due or dt.date.max, one.serial))
    found = [
        one for one in known if any(folded in name.casefold() for name in (one.serial, one.certificate, one.laboratory))
    ]
    count = plural(len(found), one=say("1 artefact"), many=say("{count} artefacts", count=number(len(found), ",d")))
    rows = tuple(
        (p.Cell(p.shown(one.serial)), _state(one, view.today), p.day_cell(one.due), p.day_cell(one.calibrated),
         p.Cell(p.shown(one.certificate)), p.Cell(p.shown(one.laboratory)), p.Cell(p.shown(one.kind)),
         p.Cell(say("Show them"), p.address("/certificates", artefact=one.serial)))
        for one in v.on_page(found, request)
    )  # fmt: skip
    empty = say("No artefact is as chosen.") if known else say("No artefact is recorded yet.")
    table = p.PageTable(count, ARTEFACT_COLUMNS, rows, empty)
    return _list("artefacts.html", request, table, len(found), today=day(view.today), known=known)


def _state(one: ArtefactRow, today: dt.date) -> p.Cell:
    if one.due is None:
        note = NOTHING if one.certificate else say("no certificate is recorded of it")
        return p.Cell(say("No due date stated"), standing="open", note=note)
    if one.due < today:
        return p.Cell(say("Out of date"), standing="bad")
    if one.due <= today + v.SOON:
        return p.Cell(say("Due soon"), standing="open")
    return p.Cell(say("Valid"), standing="good")


MOST_PLACES = 40  # places that are offered to choose from; more are searched for by name
MOST_NAMED = 4  # artefacts that are named; a page of its own has all
LISTED = 10  # certificates that are listed here; a list of its own has all

COLUMNS = p.columns(
    say("Machine"), say("State"), (say("Due"), "day"), say("Newest certificate"), (say("Measured on"), "day"),
    say("Decision"), say("Model"), say("Place"),
)  # fmt: skip


def machines_page(view: v.SiteView, request: WebRequest) -> p.WebPage:
    request.only(("text", "state", "place", "page"))
    text, state, place = request.text("text"), request.one_of("state", tuple(v.GROUPS)), request.text("place")
    request.count("page")  # refused before anything is worked out
    overview, folded = view.standing(), text.casefold()
    machines, counts, places = overview.machines, overview.counts, overview.places
    found: Sequence[v.MachineStanding] = machines
    if text or state or place:
        found = [
            one for one in machines
            if folded in one.names and (not state or state in one.groups) and place in ("", one.newest.machine.place)
        ]  # fmt: skip
    tally = [
        {"number": counts[name], "what": group.count, "address": "/" if name == state else p.address("/", state=name),
         "standing": group.standing, "chosen": name == state}
        for name, group in v.GROUPS.items() if counts[name] or name in ("overdue", "failing", "due", "order")
    ]  # fmt: skip
    rows = tuple(_row(one) for one in v.on_page(found, request))
    count = plural(len(found), one=say("1 machine"), many=say("{count} machines", count=number(len(found), ",d")))
    empty = say("No machine is as chosen.") if machines else say("No machine is recorded yet.")
    return _list(
        "machines.html", request, p.PageTable(count, COLUMNS, rows, empty), len(found), today=day(view.today), counts=tally,
        overdue=_overdue_artefacts(view), states=[(name, group.word) for name, group in v.GROUPS.items()],
        places=[(one, Verbatim(one)) for one in places] if 1 < len(places) <= MOST_PLACES else [],
    )  # fmt: skip


def _overdue_artefacts(view: v.SiteView) -> tuple[Text, Text] | None:
    """How many are out of date, and which."""
    known = view.records.artefacts(view.today)
    overdue = [(one.serial, one.due) for one in known if one.due is not None and one.due < view.today]
    if not overdue:
        return None
    count = len(overdue)
    head = plural(
        count,
        one=say("1 artefact is out of date: no certificate can rest on it"),
        many=say("{count} artefacts are out of date: no certificate can rest on them", count=number(count)),
    )
    named = [say("{serial} since {day}", serial=p.shown(serial), day=day(due)) for serial, due in overdue[:MOST_NAMED]]
    more = [say("{count} more", count=number(count - MOST_NAMED))] if count > MOST_NAMED else []
    return head, listed([*named, *more])


def due_cell(one: v.MachineStanding, *, why: bool = True) -> p.Cell:
    if one.due is None:
        return p.Cell(DASH)
    return p.Cell(DASH if one.due.due is None else day(one.due.due), note=one.due.why if why else NOTHING)


def _row(one: v.MachineStanding) -> tuple[p.Cell, ...]:
    machine, certificate = one.newest.machine, one.newest.certificate
    first, *others = (v.GROUPS[name] for name in one.groups)
    newest = (p.Cell(NOTHING), p.Cell(NOTHING), p.Cell(NOTHING)) if certificate is None else (
        v.certificate_cell(certificate), p.day_cell(certificate.day), p.cell_of(p.DECISIONS, certificate.decision)
    )  # fmt: skip
    return (
        v.machine_cell(machine.serial, machine.name),
        p.Cell(first.word, standing=first.standing, note=commas(group.word for group in others)),
        due_cell(one, why=False), *newest,
        p.Cell(p.shown(" ".join(filter(None, (machine.manufacturer, machine.model))))), p.Cell(p.shown(machine.place)),
    )  # fmt: skip


def machine_page(view: v.SiteView, request: WebRequest) -> p.WebPage:
    """The machine that the address names, by serial or by name."""
    request.only(("serial",))
    serial = request.text("serial")
    if not serial:
        raise RefusedRequest(HTTPStatus.NOT_FOUND, say("the address names no machine"))
    try:
        machine = view.records.machine(serial)
    except CmmUqError as error:
        raise RefusedRequest(HTTPStatus.NOT_FOUND, *v.problem_of(error)) from None
    standing = next((one for one in view.standing().machines if one.serial == machine.serial), None)
    newest = None if standing is None else standing.newest.certificate
    listed, count = chosen(view.records, CertificateFilter(machine=machine.serial), LISTED)
    caption = say("The newest {shown} of {count}", shown=number(len(listed)), count=number(count, ",d"))
    table = v.certificates_table(listed, caption, say("No measured certificate is recorded."), machine=False)
    measured, parts = chosen(view.records, CertificateFilter(machine=machine.serial, command=facts.PART), LISTED)
    caption = say("The newest {shown} of {count}", shown=number(len(measured)), count=number(parts, ",d"))
    parts_table = v.parts_table(view.records, measured, caption, say("No report of a part is recorded."), machine=False)
    charts, once = trends(view.records, machine)
    return p.page(
        "machine.html", "/", machine=machine, charts=charts, once=once, certificates=table,
        parts=parts_table if measured else None, due=None if standing is None else due_cell(standing),
        newest=None if newest is None else v.certificate_cell(newest),
        adjusted=commas(day(one) for one in machine.adjusted),
        words=[] if standing is None else [_group_words(standing, name) for name in standing.groups],
        standing=None if standing is None else v.GROUPS[standing.groups[0]].standing,
    )  # fmt: skip


def _group_words(one: v.MachineStanding, name: str) -> Text:
    """A group of a machine, with the date or the decision that put it there."""
    due, certificate = one.due, one.newest.certificate
    if due is not None and due.due is not None:
        date = day(due.due)
        dated = {"overdue": say("Overdue since {day}", day=date), "due": say("Due soon, on {day}", day=date),
                 "order": say("In order, due on {day}", day=date)}  # fmt: skip
        if name in dated:
            return dated[name]
    if certificate is not None and name in ("failing", "open"):
        decision = p.DECISIONS.get(certificate.decision, (Verbatim(certificate.decision), None))[0]
        return say("{what}: its newest certificate says {decision:small}", what=v.GROUPS[name].word, decision=decision)
    return v.GROUPS[name].word
