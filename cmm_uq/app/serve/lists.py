"""Lists of certificates, of diagnoses, and of artefacts: chosen by what a reader asks, a page at a time."""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping

from cmm_uq.app.serve.exchange import WebRequest, bad
from cmm_uq.app.serve.overview import SOON
from cmm_uq.app.serve.page import (
    DECISIONS,
    NOT_MEASURED,
    ORIGINS,
    STATES,
    VERDICTS,
    Cell,
    Chooser,
    FormField,
    PageNotice,
    Pager,
    PageTable,
    WebPage,
    Word,
    address,
    cell_of,
    columns,
    day_cell,
    shown,
)
from cmm_uq.app.serve.view import PER_PAGE, SiteView, certificate_cell, certificates_table, machine_cell, paged, pager
from cmm_uq.base.messages import DASH, NOTHING, Text, Verbatim, day, number, plural, say
from cmm_uq.laboratory.records import facts
from cmm_uq.laboratory.records.facts import ArtefactRow
from cmm_uq.laboratory.records.listing import CertificateFilter

ANY = ("", say("Any"))
_KEYS = ("text", "machine", "artefact", "origin", "state", "decision", "since", "until", "page")


def certificates_page(view: SiteView, asked: WebRequest) -> WebPage:
    """Certificates and interim checks."""
    asked.only(_KEYS)
    choice = CertificateFilter(
        text=asked.text("text"), machine=asked.text("machine"), artefact=asked.text("artefact"),
        origin=asked.one_of("origin", tuple(ORIGINS)) or "measured",
        states=_some(asked.one_of("state", facts.STATES)),
        decisions=_some(asked.one_of("decision", tuple(DECISIONS))), since=asked.day("since"), until=asked.day("until"),
    )  # fmt: skip
    _in_order(choice)
    page = asked.count("page")
    rows, total = paged(view.records, choice, page)
    count = plural(total, one=say("1 certificate"), many=say("{count} certificates", count=number(total, ",d")))
    fields = (
        FormField("text", say("Number, job or machine"), choice.text),
        FormField("state", say("State"), asked.text("state"), (ANY, *_options(STATES)), "select"),
        FormField("decision", say("Decision"), asked.text("decision"), (ANY, *_options(DECISIONS)), "select"),
        FormField("origin", say("Recording"), choice.origin, tuple(ORIGINS.items()), "select"),
        FormField("since", say("From"), asked.text("since"), sort="date"),
        FormField("until", say("To"), asked.text("until"), sort="date"),
    )
    kept = tuple((name, asked.text(name)) for name in ("machine", "artefact") if asked.text(name))
    narrowed = any(asked.text(name) for name in _KEYS if name != "page")
    clear = Cell(say("Show all"), "/certificates") if narrowed else None
    empty = say("No certificate is as chosen.") if narrowed else say("No certificate of a measurement is recorded yet.")
    warning = NOT_MEASURED.get(choice.origin)
    return WebPage(
        say("Certificates"), "/certificates", lead=_of(choice),
        blocks=(
            Chooser(say("Choose certificates"), "/certificates", fields, say("Show"), clear, kept),
            *((PageNotice(warning, "open"),) if warning else ()),
            certificates_table(rows, count, empty),
            *pager(asked, total, page, count),
        ),
    )  # fmt: skip


def diagnoses_page(view: SiteView, asked: WebRequest) -> WebPage:
    """Verdicts of certificates and of diagnoses on whether a recording agrees with its model."""
    asked.only(("text", "verdict", "since", "until", "page"))
    verdict = asked.one_of("verdict", (*VERDICTS, "all"))
    wanted = tuple(VERDICTS) if verdict == "all" else (verdict,) if verdict else ("explained", "partial", "unexplained")
    choice = CertificateFilter(
        text=asked.text("text"), command="", verdicts=wanted, since=asked.day("since"), until=asked.day("until")
    )
    _in_order(choice)
    page = asked.count("page")
    rows, total = paged(view.records, choice, page)
    count = plural(total, one=say("1 recording"), many=say("{count} recordings", count=number(total, ",d")))
    cells = tuple(
        (certificate_cell(one), cell_of(VERDICTS, one.diagnosis), machine_cell(one.machine, one.machine_name),
         day_cell(one.day),
         cell_of(STATES, one.state) if one.command == "report" else Cell(DASH))
        for one in rows
    )  # fmt: skip
    headings = columns(
        say("Certificate or diagnosis"), say("Verdict"), say("Machine"), (say("Measured on"), "day"), say("State")
    )
    options = (("", say("Not consistent")), *_options(VERDICTS), ("all", say("All")))
    fields = (
        FormField("text", say("Number, job or machine"), choice.text),
        FormField("verdict", say("Verdict"), verdict, options, "select"),
        FormField("since", say("From"), asked.text("since"), sort="date"),
        FormField("until", say("To"), asked.text("until"), sort="date"),
    )
    narrowed = any(asked.text(name) for name in ("text", "verdict", "since", "until"))
    clear = Cell(say("Show what is not consistent"), "/diagnoses") if narrowed else None
    return WebPage(
        say("Diagnoses"), "/diagnoses",
        lead=say("Measured recordings that contradict the model of their machine, newest first.") if not verdict else NOTHING,
        blocks=(
            Chooser(say("Choose diagnoses"), "/diagnoses", fields, say("Show"), clear),
            PageTable(count, headings, cells, say("There is none.")),
            *pager(asked, total, page, count),
        ),
    )  # fmt: skip


def _some(word: str) -> tuple[str, ...]:
    return (word,) if word else ()


def _options(words: Mapping[str, Word]) -> tuple[tuple[str, Text], ...]:
    return tuple((name, text) for name, (text, _) in words.items())


def _in_order(choice: CertificateFilter) -> None:
    if choice.since is not None and choice.until is not None and choice.since > choice.until:
        raise bad(say("the list would end before it begins"), say("Exchange the two dates"))


def _of(choice: CertificateFilter) -> Text:
    if choice.machine:
        return say("Of machine {serial}, newest first.", serial=Verbatim(choice.machine))
    if choice.artefact:
        return say("Made with artefact {serial}, newest first.", serial=Verbatim(choice.artefact))
    return say("Newest first.")


ARTEFACT_COLUMNS = columns(
    say("Artefact"),
    say("State"),
    (say("Due"), "day"),
    (say("Calibrated on"), "day"),
    say("Certificate"),
    say("Laboratory"),
    say("Used for"),
    say("Certificates made with it"),
)


def artefacts_page(view: SiteView, asked: WebRequest) -> WebPage:
    """All artefacts."""
    asked.only(("text", "page"))
    text, page = asked.text("text"), asked.count("page")
    known = sorted(view.records.artefacts(), key=lambda one: (one.due or dt.date.max, one.serial))
    folded = text.casefold()
    found = [
        one for one in known if any(folded in name.casefold() for name in (one.serial, one.certificate, one.laboratory))
    ]
    count = plural(len(found), one=say("1 artefact"), many=say("{count} artefacts", count=number(len(found), ",d")))
    rows = tuple(_row(one, view.today) for one in found[(page - 1) * PER_PAGE : page * PER_PAGE])
    clear = Cell(say("Show all"), "/artefacts") if text else None
    field = FormField("text", say("Serial, certificate or laboratory"), text)
    chooser = (Chooser(say("Choose artefacts"), "/artefacts", (field,), say("Show"), clear),) if known else ()
    pages: tuple[Pager, ...] = pager(asked, len(found), page, count)
    empty = say("No artefact is as chosen.") if known else say("No artefact is recorded yet.")
    return WebPage(
        say("Artefacts"), "/artefacts",
        lead=say("On {day}, first what is out of date: no certificate can rest on that.", day=day(view.today)),
        blocks=(*chooser, PageTable(count, ARTEFACT_COLUMNS, rows, empty), *pages),
    )  # fmt: skip


def _row(one: ArtefactRow, today: dt.date) -> tuple[Cell, ...]:
    return (
        Cell(shown(one.serial)), _state(one, today), day_cell(one.due), day_cell(one.calibrated),
        Cell(shown(one.certificate)), Cell(shown(one.laboratory)), Cell(shown(one.kind)),
        Cell(say("Show them"), address("/certificates", artefact=one.serial)),
    )  # fmt: skip


def _state(one: ArtefactRow, today: dt.date) -> Cell:
    if one.due is None:
        note = NOTHING if one.certificate else say("no certificate is recorded of it")
        return Cell(say("No due date stated"), standing="open", note=note)
    if one.due < today:
        return Cell(say("Out of date"), standing="bad")
    if one.due <= today + SOON:
        return Cell(say("Due soon"), standing="open")
    return Cell(say("Valid"), standing="good")
