"""Artefacts by when their own calibration ends, first what is out of date."""

from __future__ import annotations

import datetime as dt

from cmm_uq.app.serve.due import SOON
from cmm_uq.app.serve.exchange import Asked
from cmm_uq.app.serve.page import Cell, Chooser, Column, Field, Page, Pager, Table, address
from cmm_uq.app.serve.view import PER_PAGE, View, pager
from cmm_uq.app.serve.words import day_cell, shown
from cmm_uq.base.messages import NOTHING, day, number, plural, say
from cmm_uq.laboratory.records.facts import ArtefactRow

COLUMNS = (
    Column(say("Artefact")), Column(say("State")), Column(say("Due"), sort="day"), Column(say("Calibrated on"), sort="day"),
    Column(say("Certificate")), Column(say("Laboratory")), Column(say("Used for")), Column(say("Certificates made with it")),
)  # fmt: skip


def artefacts_page(view: View, asked: Asked) -> Page:
    """All artefacts.

    Raises
    ------
    Refused : the address asks for something that the page does not know.
    """
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
    field = Field("text", say("Serial, certificate or laboratory"), text)
    chooser = (Chooser(say("Choose artefacts"), "/artefacts", (field,), say("Show"), clear),) if known else ()
    pages: tuple[Pager, ...] = pager(asked, len(found), page, count)
    empty = say("No artefact is as chosen.") if known else say("No artefact is recorded yet.")
    return Page(
        say("Artefacts"), "/artefacts",
        lead=say("On {day}, first what is out of date: no certificate can rest on that.", day=day(view.today)),
        blocks=(*chooser, Table(count, COLUMNS, rows, empty), *pages),
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
