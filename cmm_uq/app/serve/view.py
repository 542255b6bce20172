"""What the pages are made from: the records, opened for one request, and what the whole site knows."""

from __future__ import annotations

import datetime as dt
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from cmm_uq.app.serve import page as p
from cmm_uq.app.serve.exchange import WebRequest
from cmm_uq.app.serve.overview import MachineStanding
from cmm_uq.app.serve.page import Cell, PageTable, address
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import NOTHING, Text, Verbatim, number, say
from cmm_uq.laboratory.records.facts import ChainFinding
from cmm_uq.laboratory.records.listing import CertificateFilter, ListedCertificate, chosen
from cmm_uq.laboratory.records.store import Records

MOST = 100  # findings that are shown
AT_ONCE_S = 1.0  # how long whoever asks waits for the result; a longer comparison goes on without him
PER_PAGE = 50


@dataclass(frozen=True)
class ChainComparison:
    """A comparison that has ended, at a ``head`` (number and hash of the last entry), with the first hundred findings.

    ``files``: whether the files were compared too; ``failed``: why it could not be done; empty where it was.
    """

    at: dt.datetime
    head: tuple[int, str]
    files: bool
    findings: tuple[ChainFinding, ...] = ()
    count: int = 0
    failed: str = ""


class ChainComparing:
    """Compares on request; ``last`` ended last, ``since`` when one is under way: ``None`` where there is none."""

    def __init__(self, opened: Callable[[], Records]) -> None:
        self._opened, self._lock = opened, threading.Lock()
        self._running: threading.Thread | None = None
        self.since: dt.datetime | None = None
        self.last: ChainComparison | None = None

    def begin(self, *, files: bool) -> None:
        """Compare, unless that is under way already; returns when it is done, or after a second."""
        with self._lock:
            if self.since is None:
                self.since = dt.datetime.now(dt.UTC)
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
        head, findings, failed = (0, ""), list[ChainFinding](), ""
        try:
            with self._opened() as records:
                head = records.head()
                findings = list(records.verify(files=files))
        except CmmUqError as error:
            failed = str(error)
        except Exception as error:  # whatever it is, the page says that nothing was compared
            failed = f"{type(error).__name__}: {error}"
        now = dt.datetime.now(dt.UTC)
        with self._lock:
            self.last = ChainComparison(now, head, files, tuple(findings[:MOST]), len(findings), failed)
            self.since = None


@dataclass(frozen=True)
class SiteView:
    """What a page is made from, on the day of the request; ``standing`` says how every machine stands."""

    records: Records
    today: dt.date
    standing: Callable[[], Sequence[MachineStanding]]
    checking: ChainComparing


def machine_cell(serial: str, name: str = "") -> Cell:
    """A machine by its serial, leading to its page; its name below where it is another."""
    note = Verbatim(name) if name and name != serial else NOTHING
    return Cell(p.shown(serial), address("/machine", serial=serial), note=note)


def certificate_cell(one: ListedCertificate) -> Cell:
    """A certificate by its number, leading to its page."""
    note = say("interim check") if one.interim else say("diagnosis") if one.command != "report" else NOTHING
    return Cell(p.shown(one.number or one.job), address("/certificate", entry=one.entry), note=note)


COLUMNS = p.columns(
    say("Certificate"), say("Machine"), (say("Measured on"), "day"), say("Artefact"), say("Decision"), say("Diagnosis"),
    say("State"),
)  # fmt: skip


def certificates_table(
    rows: Sequence[ListedCertificate], caption: Text, empty: Text, *, machine: bool = True
) -> PageTable:
    """Certificates as rows; without their machine where all are of one."""
    columns = [i for i in range(len(COLUMNS)) if machine or i != 1]
    cells = [
        (certificate_cell(one), machine_cell(one.machine, one.machine_name), p.day_cell(one.day), Cell(p.shown(one.artefact)),
         p.cell_of(p.DECISIONS, one.decision), p.cell_of(p.VERDICTS, one.diagnosis), p.cell_of(p.STATES, one.state))
        for one in rows
    ]  # fmt: skip
    return PageTable(
        caption, tuple(COLUMNS[i] for i in columns), tuple(tuple(row[i] for i in columns) for row in cells), empty
    )


def paged(records: Records, choice: CertificateFilter, page: int) -> tuple[list[ListedCertificate], int]:
    """The certificates of a page of a list, and how many there are on all."""
    return chosen(records, choice, PER_PAGE, (page - 1) * PER_PAGE)


def pager(request: WebRequest, count: int, page: int, what: Text) -> tuple[p.Pager, ...]:
    """Where in the list the reader is; nothing where there is only one page."""
    if count <= PER_PAGE and page == 1:
        return ()
    last = max(1, -(-count // PER_PAGE))
    place = say("{what}: page {page} of {last}", what=what, page=number(page), last=number(last, ",d"))

    def to(target: int, text: Text) -> Cell:
        return Cell(text, address(request.path, **{**request.query, "page": target if target > 1 else None}))

    before = to(min(page - 1, last), say("Previous page")) if page > 1 else None
    after = to(page + 1, say("Next page")) if page < last else None
    return (p.Pager(say("Pages"), place, before, after),)


def problem_of(error: CmmUqError) -> tuple[Text, Text]:
    """What went wrong, and what to do, as the page says it."""
    problem = Verbatim(f"{error.where}: {error.problem}" if error.where else error.problem)
    return problem, Verbatim(error.fix or "")
