"""What the pages are made from: the records, opened for one request, and what the whole site knows."""

from __future__ import annotations

import datetime as dt
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from cmm_uq.app.serve.exchange import WebRequest
from cmm_uq.app.serve.overview import MachineStanding
from cmm_uq.app.serve.page import (
    DECISIONS,
    STATES,
    VERDICTS,
    Cell,
    Pager,
    PageTable,
    address,
    cell_of,
    columns,
    day_cell,
    shown,
)
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import NOTHING, Text, Verbatim, number, say
from cmm_uq.laboratory.records.facts import ArtefactRow, ChainFinding
from cmm_uq.laboratory.records.listing import CertificateFilter, ListedCertificate, chosen
from cmm_uq.laboratory.records.store import Records

MOST = 100  # findings that are shown
AT_ONCE_S = 1.0  # how long whoever asks waits for the result; a longer comparison goes on without him


@dataclass(frozen=True)
class ChainComparison:
    """A comparison that has ended.

    ``head``: number and hash of the last entry; ``files``: whether the files were compared too; ``findings``: what is
    wrong, the first hundred; ``failed``: why it could not be done; empty where it was.
    """

    at: dt.datetime
    head: tuple[int, str]
    files: bool
    findings: tuple[ChainFinding, ...] = ()
    count: int = 0
    failed: str = ""


class ChainComparing:
    """Compares on request."""

    def __init__(self, opened: Callable[[], Records]) -> None:
        self._opened, self._lock = opened, threading.Lock()
        self._running: threading.Thread | None = None
        self._since: dt.datetime | None = None
        self._last: ChainComparison | None = None

    @property
    def last(self) -> ChainComparison | None:
        """The comparison that ended last; ``None`` before the first."""
        return self._last

    @property
    def since(self) -> dt.datetime | None:
        """When the one that is under way began; ``None`` where none is."""
        return self._since

    def begin(self, *, files: bool) -> None:
        """Compare, unless that is under way already; returns when it is done, or after a second."""
        with self._lock:
            if self._since is None:
                self._since = dt.datetime.now(dt.UTC)
                self._running = threading.Thread(target=self._compare, args=(files,), name="verify", daemon=True)
                self._running.start()
        self.wait(AT_ONCE_S)

    def wait(self, seconds: float) -> None:
        """Until the comparison that is under way has ended, or so many seconds."""
        with self._lock:
            running = self._running
        if running is not None:
            running.join(seconds)

    def _compare(self, files: bool) -> None:
        head = (0, "")
        try:
            with self._opened() as records:
                head = records.head()
                findings = records.verify(files=files)
            found = ChainComparison(dt.datetime.now(dt.UTC), head, files, tuple(findings[:MOST]), len(findings))
        except CmmUqError as error:
            found = ChainComparison(dt.datetime.now(dt.UTC), head, files, failed=str(error))
        except Exception as error:  # whatever it is, the page says that nothing was compared
            found = ChainComparison(dt.datetime.now(dt.UTC), head, files, failed=f"{type(error).__name__}: {error}")
        with self._lock:
            self._last, self._since = found, None


PER_PAGE = 50


@dataclass(frozen=True)
class SiteView:
    """What a page is made from.

    ``today``: the day of the request; ``standing``: says how every machine stands; ``checking``: the last comparison
    of the records with their chain.
    """

    records: Records
    today: dt.date
    standing: Callable[[], Sequence[MachineStanding]]
    checking: ChainComparing

    @property
    def machines(self) -> Sequence[MachineStanding]:
        """How every machine stands, the most urgent first."""
        return self.standing()

    def overdue_artefacts(self) -> list[ArtefactRow]:
        """Artefacts whose own calibration is out of date."""
        return [one for one in self.records.artefacts() if one.due is not None and one.due < self.today]


def machine_cell(serial: str, name: str = "") -> Cell:
    """A machine by its serial, leading to its page; its name below where it is another."""
    note = Verbatim(name) if name and name != serial else NOTHING
    return Cell(shown(serial), address("/machine", serial=serial), note=note)


def certificate_cell(one: ListedCertificate) -> Cell:
    """A certificate by its number, leading to its page."""
    note = say("interim check") if one.interim else say("diagnosis") if one.command != "report" else NOTHING
    return Cell(shown(one.number or one.job), address("/certificate", entry=one.entry), note=note)


COLUMNS = columns(
    say("Certificate"),
    say("Machine"),
    (say("Measured on"), "day"),
    say("Artefact"),
    say("Decision"),
    say("Diagnosis"),
    say("State"),
)


def certificates_table(
    rows: Sequence[ListedCertificate], caption: Text, empty: Text, *, machine: bool = True
) -> PageTable:
    """Certificates as rows; without their machine where all are of one."""
    kept = [i for i in range(len(COLUMNS)) if machine or i != 1]
    cells = [
        (certificate_cell(one), machine_cell(one.machine, one.machine_name), day_cell(one.day), Cell(shown(one.artefact)),
         cell_of(DECISIONS, one.decision), cell_of(VERDICTS, one.diagnosis), cell_of(STATES, one.state))
        for one in rows
    ]  # fmt: skip
    shown_cells = tuple(tuple(row[i] for i in kept) for row in cells)
    return PageTable(caption, tuple(COLUMNS[i] for i in kept), shown_cells, empty)


def paged(records: Records, choice: CertificateFilter, page: int) -> tuple[list[ListedCertificate], int]:
    """The certificates of a page of a list, and how many there are on all."""
    return chosen(records, choice, PER_PAGE, (page - 1) * PER_PAGE)


def pager(asked: WebRequest, count: int, page: int, what: Text) -> tuple[Pager, ...]:
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
