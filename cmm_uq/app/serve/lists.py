"""Lists of certificates, of diagnoses, and of artefacts: chosen by what a reader asks, a page at a time."""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping

from cmm_uq.app.serve import page as p
from cmm_uq.app.serve.exchange import WebRequest, bad
from cmm_uq.app.serve.overview import SOON
from cmm_uq.app.serve.page import Cell, Chooser, FormField, WebPage
from cmm_uq.app.serve.view import PER_PAGE, SiteView, certificate_cell, certificates_table, machine_cell, paged, pager
from cmm_uq.base.messages import DASH, NOTHING, Text, Verbatim, day, number, plural, say
from cmm_uq.laboratory.records import facts
from cmm_uq.laboratory.records.facts import ArtefactRow
from cmm_uq.laboratory.records.listing import CertificateFilter

_ANY = ("", say("Any"))
_KEYS = ("text", "machine", "artefact", "origin", "state", "decision", "since", "until", "page")


def certificates_page(view: SiteView, request: WebRequest) -> WebPage:
    """Certificates and interim checks."""
    request.only(_KEYS)
    text, machine, artefact = (request.text(name) for name in ("text", "machine", "artefact"))
    origin = request.one_of("origin", tuple(p.ORIGINS)) or "measured"
    state = request.one_of("state", facts.STATES)
    decision = request.one_of("decision", tuple(p.DECISIONS))
    since, until = _dates(request)
    choice = CertificateFilter(
        text=text, machine=machine, artefact=artefact, origin=origin, states=(state,) if state else (),
        decisions=(decision,) if decision else (), since=since, until=until,
    )  # fmt: skip
    page = request.count("page")
    rows, total = paged(view.records, choice, page)
    count = plural(total, one=say("1 certificate"), many=say("{count} certificates", count=number(total, ",d")))
    fields = (
        FormField("text", say("Number, job or machine"), text),
        FormField("state", say("State"), state, (_ANY, *_options(p.STATES)), "select"),
        FormField("decision", say("Decision"), decision, (_ANY, *_options(p.DECISIONS)), "select"),
        FormField("origin", say("Recording"), origin, tuple(p.ORIGINS.items()), "select"),
        *_date_fields(request),
    )
    kept = tuple((name, request.text(name)) for name in ("machine", "artefact") if request.text(name))
    narrowed = any(request.text(name) for name in _KEYS if name != "page")
    clear = Cell(say("Show all"), "/certificates") if narrowed else None
    empty = say("No certificate is as chosen.") if narrowed else say("No certificate of a measurement is recorded yet.")
    lead = say("Newest first.")
    if machine:
        lead = say("Of machine {serial}, newest first.", serial=Verbatim(machine))
    elif artefact:
        lead = say("Made with artefact {serial}, newest first.", serial=Verbatim(artefact))
    warning = p.NOT_MEASURED.get(origin)
    return WebPage(
        say("Certificates"), "/certificates", lead=lead,
        blocks=(
            Chooser(say("Choose certificates"), "/certificates", fields, say("Show"), clear, kept),
            *((p.PageNotice(warning, "open"),) if warning else ()),
            certificates_table(rows, count, empty),
            *pager(request, total, page, count),
        ),
    )  # fmt: skip


def diagnoses_page(view: SiteView, request: WebRequest) -> WebPage:
    """Verdicts of certificates and of diagnoses on whether a recording agrees with its model."""
    request.only(("text", "verdict", "since", "until", "page"))
    verdict, text = request.one_of("verdict", (*p.VERDICTS, "all")), request.text("text")
    verdicts: tuple[str, ...] = ("explained", "partial", "unexplained")
    if verdict:
        verdicts = tuple(p.VERDICTS) if verdict == "all" else (verdict,)
    since, until = _dates(request)
    choice = CertificateFilter(text=text, command="", verdicts=verdicts, since=since, until=until)
    page = request.count("page")
    rows, total = paged(view.records, choice, page)
    count = plural(total, one=say("1 recording"), many=say("{count} recordings", count=number(total, ",d")))
    cells = tuple(
        (certificate_cell(one), p.cell_of(p.VERDICTS, one.diagnosis), machine_cell(one.machine, one.machine_name),
         p.day_cell(one.day),
         p.cell_of(p.STATES, one.state) if one.command == "report" else Cell(DASH))
        for one in rows
    )  # fmt: skip
    headings = p.columns(
        say("Certificate or diagnosis"), say("Verdict"), say("Machine"), (say("Measured on"), "day"), say("State")
    )
    options = (("", say("Not consistent")), *_options(p.VERDICTS), ("all", say("All")))
    fields = (
        FormField("text", say("Number, job or machine"), text),
        FormField("verdict", say("Verdict"), verdict, options, "select"),
        *_date_fields(request),
    )
    narrowed = any(request.text(name) for name in ("text", "verdict", "since", "until"))
    clear = Cell(say("Show what is not consistent"), "/diagnoses") if narrowed else None
    return WebPage(
        say("Diagnoses"), "/diagnoses",
        lead=say("Measured recordings that contradict the model of their machine, newest first.") if not verdict else NOTHING,
        blocks=(
            Chooser(say("Choose diagnoses"), "/diagnoses", fields, say("Show"), clear),
            p.PageTable(count, headings, cells, say("There is none.")),
            *pager(request, total, page, count),
        ),
    )  # fmt: skip


def _options(words: Mapping[str, p.Word]) -> tuple[tuple[str, Text], ...]:
    return tuple((name, text) for name, (text, _) in words.items())


def _dates(request: WebRequest) -> tuple[dt.date | None, dt.date | None]:
    since, until = request.day("since"), request.day("until")
    if since is not None and until is not None and since > until:
        raise bad(say("the list would end before it begins"), say("Exchange the two dates"))
    return since, until


def _date_fields(request: WebRequest) -> tuple[FormField, ...]:
    ends = (("since", say("From")), ("until", say("To")))
    return tuple(FormField(name, label, request.text(name), sort="date") for name, label in ends)


ARTEFACT_COLUMNS = p.columns(
    say("Artefact"), say("State"), (say("Due"), "day"), (say("Calibrated on"), "day"), say("Certificate"),
    say("Laboratory"), say("Used for"), say("Certificates made with it"),
)  # fmt: skip


def artefacts_page(view: SiteView, request: WebRequest) -> WebPage:
    """All artefacts."""
    request.only(("text", "page"))
    text, page = request.text("text"), request.count("page")
    known = sorted(view.records.artefacts(), key=lambda one: (one.due or dt.date.max, one.serial))
    folded = text.casefold()
    found = [
        one for one in known if any(folded in name.casefold() for name in (one.serial, one.certificate, one.laboratory))
    ]
    count = plural(len(found), one=say("1 artefact"), many=say("{count} artefacts", count=number(len(found), ",d")))
    rows = tuple(
        (Cell(p.shown(one.serial)), _state(one, view.today), p.day_cell(one.due), p.day_cell(one.calibrated),
         Cell(p.shown(one.certificate)), Cell(p.shown(one.laboratory)), Cell(p.shown(one.kind)),
         Cell(say("Show them"), p.address("/certificates", artefact=one.serial)))
        for one in found[(page - 1) * PER_PAGE : page * PER_PAGE]
    )  # fmt: skip
    clear = Cell(say("Show all"), "/artefacts") if text else None
    field = FormField("text", say("Serial, certificate or laboratory"), text)
    chooser = (Chooser(say("Choose artefacts"), "/artefacts", (field,), say("Show"), clear),) if known else ()
    empty = say("No artefact is as chosen.") if known else say("No artefact is recorded yet.")
    table = p.PageTable(count, ARTEFACT_COLUMNS, rows, empty)
    lead = say("On {day}, first what is out of date: no certificate can rest on that.", day=day(view.today))
    return WebPage(
        say("Artefacts"), "/artefacts", lead=lead, blocks=(*chooser, table, *pager(request, len(found), page, count))
    )


def _state(one: ArtefactRow, today: dt.date) -> Cell:
    if one.due is None:
        note = NOTHING if one.certificate else say("no certificate is recorded of it")
        return Cell(say("No due date stated"), standing="open", note=note)
    if one.due < today:
        return Cell(say("Out of date"), standing="bad")
    if one.due <= today + SOON:
        return Cell(say("Due soon"), standing="open")
    return Cell(say("Valid"), standing="good")
