"""What the pages are made from: the records, opened for one request, and what the whole site knows."""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from cmm_uq.app.serve.checking import Checking
from cmm_uq.app.serve.exchange import Asked
from cmm_uq.app.serve.overview import Stands
from cmm_uq.app.serve.page import Cell, Column, Pager, Table, address
from cmm_uq.app.serve.words import DECISIONS, STATES, VERDICTS, cell_of, day_cell, shown
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import NOTHING, Text, Verbatim, number, say
from cmm_uq.laboratory.records.facts import ArtefactRow
from cmm_uq.laboratory.records.listing import Choice, Listed, chosen
from cmm_uq.laboratory.records.store import Records

PER_PAGE = 50


@dataclass(frozen=True)
class View:
    """What a page is made from.

    Parameters
    ----------
    records : open, to be read.
    today : the day of the request.
    standing : says how every machine stands.
    checking : the last comparison of the records with their chain.
    """

    records: Records
    today: dt.date
    standing: Callable[[], Sequence[Stands]]
    checking: Checking

    @property
    def machines(self) -> Sequence[Stands]:
        """How every machine stands, the most urgent first."""
        return self.standing()

    def overdue_artefacts(self) -> list[ArtefactRow]:
        """Artefacts whose own calibration is out of date."""
        return [one for one in self.records.artefacts() if one.due is not None and one.due < self.today]


def machine_cell(serial: str, name: str = "") -> Cell:
    """A machine by its serial, leading to its page; its name below where it is another."""
    note = Verbatim(name) if name and name != serial else NOTHING
    return Cell(shown(serial), address("/machine", serial=serial), note=note)


def certificate_cell(one: Listed) -> Cell:
    """A certificate by its number, leading to its page."""
    note = say("interim check") if one.interim else say("diagnosis") if one.command != "report" else NOTHING
    return Cell(shown(one.number or one.job), address("/certificate", entry=one.entry), note=note)


COLUMNS = (
    Column(say("Certificate")), Column(say("Machine")), Column(say("Measured on"), sort="day"), Column(say("Artefact")),
    Column(say("Decision")), Column(say("Diagnosis")), Column(say("State")),
)  # fmt: skip


def certificates_table(rows: Sequence[Listed], caption: Text, empty: Text, *, machine: bool = True) -> Table:
    """Certificates as rows; without their machine where all are of one."""
    kept = [i for i in range(len(COLUMNS)) if machine or i != 1]
    cells = [
        (certificate_cell(one), machine_cell(one.machine, one.machine_name), day_cell(one.day), Cell(shown(one.artefact)),
         cell_of(DECISIONS, one.decision), cell_of(VERDICTS, one.diagnosis), cell_of(STATES, one.state))
        for one in rows
    ]  # fmt: skip
    shown_cells = tuple(tuple(row[i] for i in kept) for row in cells)
    return Table(caption, tuple(COLUMNS[i] for i in kept), shown_cells, empty)


def paged(records: Records, choice: Choice, page: int) -> tuple[list[Listed], int]:
    """The certificates of a page of a list, and how many there are on all.

    Raises
    ------
    CmmUqError : the records are damaged or locked.
    """
    return chosen(records, choice, PER_PAGE, (page - 1) * PER_PAGE)


def pager(asked: Asked, count: int, page: int, what: Text) -> tuple[Pager, ...]:
    """Where in the list the reader is; nothing where there is only one page."""
    if count <= PER_PAGE and page == 1:
        return ()
    last = max(1, -(-count // PER_PAGE))
    told = say("{what}: page {page} of {last}", what=what, page=number(page), last=number(last, ",d"))

    def to(target: int, text: Text) -> Cell:
        return Cell(text, address(asked.path, **{**asked.query, "page": target if target > 1 else None}))

    before = to(min(page - 1, last), say("Previous page")) if page > 1 else None
    after = to(page + 1, say("Next page")) if page < last else None
    return (Pager(say("Pages"), told, before, after),)


def problem_of(error: CmmUqError) -> tuple[Text, Text]:
    """What went wrong, and what to do, as the page says it."""
    problem = Verbatim(f"{error.where}: {error.problem}" if error.where else error.problem)
    return problem, Verbatim(error.fix or "")
