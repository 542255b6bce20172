"""Lists of certificates, and of diagnoses: chosen by what a reader asks, a page at a time, newest first."""

from __future__ import annotations

from collections.abc import Mapping

from cmm_uq.app.serve.exchange import Asked, bad
from cmm_uq.app.serve.page import Cell, Chooser, Column, Field, Notice, Page, Table
from cmm_uq.app.serve.view import View, certificate_cell, certificates_table, machine_cell, paged, pager
from cmm_uq.app.serve.words import DECISIONS, NOT_MEASURED, ORIGINS, STATES, VERDICTS, Word, cell_of, day_cell
from cmm_uq.base.messages import DASH, NOTHING, Text, Verbatim, number, plural, say
from cmm_uq.laboratory.records.facts import STATES as KNOWN_STATES
from cmm_uq.laboratory.records.listing import Choice

ANY = ("", say("Any"))

_KEYS = ("text", "machine", "artefact", "origin", "state", "decision", "since", "until", "page")


def certificates_page(view: View, asked: Asked) -> Page:
    """Certificates and interim checks.

    Raises
    ------
    Refused : the address asks for something that the page does not know.
    """
    asked.only(_KEYS)
    choice = Choice(
        text=asked.text("text"), machine=asked.text("machine"), artefact=asked.text("artefact"),
        origin=asked.one_of("origin", tuple(ORIGINS)) or "measured",
        states=_some(asked.one_of("state", KNOWN_STATES)),
        decisions=_some(asked.one_of("decision", tuple(DECISIONS))), since=asked.day("since"), until=asked.day("until"),
    )  # fmt: skip
    _in_order(choice)
    page = asked.count("page")
    rows, total = paged(view.records, choice, page)
    count = plural(total, one=say("1 certificate"), many=say("{count} certificates", count=number(total, ",d")))
    fields = (
        Field("text", say("Number, job or machine"), choice.text),
        Field("state", say("State"), asked.text("state"), (ANY, *_options(STATES)), "select"),
        Field("decision", say("Decision"), asked.text("decision"), (ANY, *_options(DECISIONS)), "select"),
        Field("origin", say("Recording"), choice.origin, tuple(ORIGINS.items()), "select"),
        Field("since", say("From"), asked.text("since"), sort="date"),
        Field("until", say("To"), asked.text("until"), sort="date"),
    )  # fmt: skip
    kept = tuple((name, asked.text(name)) for name in ("machine", "artefact") if asked.text(name))
    narrowed = any(asked.text(name) for name in _KEYS if name != "page")
    clear = Cell(say("Show all"), "/certificates") if narrowed else None
    empty = say("No certificate is as chosen.") if narrowed else say("No certificate of a measurement is recorded yet.")
    warning = NOT_MEASURED.get(choice.origin)
    return Page(
        say("Certificates"), "/certificates", lead=_of(choice),
        blocks=(
            Chooser(say("Choose certificates"), "/certificates", fields, say("Show"), clear, kept),
            *((Notice(warning, "open"),) if warning else ()),
            certificates_table(rows, count, empty),
            *pager(asked, total, page, count),
        ),
    )  # fmt: skip


def diagnoses_page(view: View, asked: Asked) -> Page:
    """Verdicts of certificates and of diagnoses on whether a recording agrees with its model.

    Raises
    ------
    Refused : the address asks for something that the page does not know.
    """
    asked.only(("text", "verdict", "since", "until", "page"))
    verdict = asked.one_of("verdict", (*VERDICTS, "all"))
    wanted = tuple(VERDICTS) if verdict == "all" else (verdict,) if verdict else ("explained", "partial", "unexplained")
    choice = Choice(
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
    columns = (
        Column(say("Certificate or diagnosis")), Column(say("Verdict")), Column(say("Machine")),
        Column(say("Measured on"), sort="day"), Column(say("State")),
    )  # fmt: skip
    options = (("", say("Not consistent")), *_options(VERDICTS), ("all", say("All")))
    fields = (
        Field("text", say("Number, job or machine"), choice.text),
        Field("verdict", say("Verdict"), verdict, options, "select"),
        Field("since", say("From"), asked.text("since"), sort="date"),
        Field("until", say("To"), asked.text("until"), sort="date"),
    )
    narrowed = any(asked.text(name) for name in ("text", "verdict", "since", "until"))
    clear = Cell(say("Show what is not consistent"), "/diagnoses") if narrowed else None
    return Page(
        say("Diagnoses"), "/diagnoses",
        lead=say("Measured recordings that contradict the model of their machine, newest first.") if not verdict else NOTHING,
        blocks=(
            Chooser(say("Choose diagnoses"), "/diagnoses", fields, say("Show"), clear),
            Table(count, columns, cells, say("There is none.")),
            *pager(asked, total, page, count),
        ),
    )  # fmt: skip


def _some(word: str) -> tuple[str, ...]:
    return (word,) if word else ()


def _options(words: Mapping[str, Word]) -> tuple[tuple[str, Text], ...]:
    return tuple((name, text) for name, (text, _) in words.items())


def _in_order(choice: Choice) -> None:
    if choice.since is not None and choice.until is not None and choice.since > choice.until:
        raise bad(say("the list would end before it begins"), say("Exchange the two dates"))


def _of(choice: Choice) -> Text:
    if choice.machine:
        return say("Of machine {serial}, newest first.", serial=Verbatim(choice.machine))
    if choice.artefact:
        return say("Made with artefact {serial}, newest first.", serial=Verbatim(choice.artefact))
    return say("Newest first.")
