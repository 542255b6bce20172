"""What the pages are made from: the records, opened for one request, how every machine stands, and the last comparison."""

from __future__ import annotations

import datetime as dt
import threading
from bisect import insort
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from typing import NamedTuple, TypeVar

from cmm_uq.app.commands.laboratory.due import due_in
from cmm_uq.app.serve import page as p
from cmm_uq.app.serve.exchange import WebRequest
from cmm_uq.app.serve.page import DECISIONS, VERDICTS, Cell, PageTable, address
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import NOTHING, Text, Verbatim, number, say
from cmm_uq.base.values import dataclass
from cmm_uq.certificate.document import Standing
from cmm_uq.laboratory.due.due import DueItem
from cmm_uq.laboratory.due.kept import unsettled
from cmm_uq.laboratory.records.facts import ChainFinding
from cmm_uq.laboratory.records.listing import (
    CertificateFilter,
    ListedCertificate,
    ListedPart,
    Newest,
    changed_machines,
    chosen,
    parts_of,
    standing_of_all,
)
from cmm_uq.laboratory.records.queries import Serials
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
    standing: Callable[[], MachineOverview]
    checking: ChainComparing


def machine_cell(serial: str, name: str = "") -> Cell:
    """A machine by its serial, leading to its page; its name below where it is another."""
    note = Verbatim(name) if name and name != serial else NOTHING
    return Cell(p.shown(serial), address("/machine", serial=serial), note=note)


def certificate_cell(one: ListedCertificate) -> Cell:
    note = say("interim check") if one.interim else say("diagnosis") if one.command == "diagnose" else NOTHING
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
    shown = tuple(tuple(row[i] for i in columns) for row in cells)
    return PageTable(caption, tuple(COLUMNS[i] for i in columns), shown, empty)


PART_COLUMNS = p.columns(
    say("Report"),
    say("Part"),
    say("Machine"),
    (say("Measured on"), "day"),
    say("Certificate of the machine"),
    say("Decision"),
    say("State"),
)


def parts_table(
    records: Records, rows: Sequence[ListedCertificate], caption: Text, empty: Text, *, machine: bool = True
) -> PageTable:
    """Reports of parts as rows; without their machine where all are of one."""
    columns = [i for i in range(len(PART_COLUMNS)) if machine or i != 2]
    said = parts_of(records, [one.entry for one in rows])
    cells = [
        (
            certificate_cell(one),
            part_cell(said[one.entry]),
            machine_cell(one.machine, one.machine_name),
            p.day_cell(one.day),
            Cell(p.shown(said[one.entry].certificate)),
            p.cell_of(p.DECISIONS, one.decision),
            p.cell_of(p.STATES, one.state),
        )
        for one in rows
    ]
    shown = tuple(tuple(row[i] for i in columns) for row in cells)
    return PageTable(caption, tuple(PART_COLUMNS[i] for i in columns), shown, empty)


def part_cell(part: ListedPart) -> Cell:
    return Cell(p.shown(part.name), note=Verbatim(" ".join(filter(None, (part.serial, part.drawing)))))


Listed = TypeVar("Listed")


def on_page(found: Sequence[Listed], request: WebRequest) -> Sequence[Listed]:
    """Those of a list that stand on the page that is asked for."""
    first = (request.count("page") - 1) * PER_PAGE
    return found[first : first + PER_PAGE]


def paged(records: Records, choice: CertificateFilter, request: WebRequest) -> tuple[list[ListedCertificate], int]:
    return chosen(records, choice, PER_PAGE, (request.count("page") - 1) * PER_PAGE)


class Pager(NamedTuple):
    """Where in a long list the reader is, and the addresses of the pages before and after."""

    told: Text
    before: str
    after: str


def pager(request: WebRequest, count: int, what: Text) -> Pager | None:
    page = request.count("page")
    if count <= PER_PAGE and page == 1:
        return None
    last = max(1, -(-count // PER_PAGE))
    place = say("{what}: page {page} of {last}", what=what, page=number(page), last=number(last, ",d"))

    def to(target: int) -> str:
        return address(request.path, **{**request.query, "page": target if target > 1 else None})

    return Pager(place, to(min(page - 1, last)) if page > 1 else "", to(page + 1) if page < last else "")


def problem_of(error: CmmUqError) -> tuple[Text, Text]:
    """What went wrong, and what to do, as the page says it."""
    problem = Verbatim(f"{error.where}: {error.problem}" if error.where else error.problem)
    return problem, Verbatim(error.fix or "")


SOON = dt.timedelta(days=60)  # what is due within it is shown before it is late


DueDates = Callable[[Records, dt.date, Serials], Mapping[str, DueItem]]
"""Of machines that have a date, by serial, on a day."""


def by_rule(records: Records, today: dt.date, of: Serials = None) -> dict[str, DueItem]:
    """Of all machines, or some, each by its own rule, its interim checks and its adjustments."""
    found = due_in(records, of or (), today) if records.head()[0] and of != set() else []
    return {one.serial: one for one in found if one.item == "machine"}


@dataclass(frozen=True)
class MachineGroup:
    """Machines of which the same is true, what a number of them is called, and how that is to be taken."""

    word: Text
    count: Text
    standing: Standing


GROUPS: Mapping[str, MachineGroup] = {  # the most urgent first; by the words of an address
    "overdue": MachineGroup(say("Overdue"), say("overdue"), "bad"),
    "failing": MachineGroup(say("Does not conform"), say("not conforming"), "bad"),
    "due": MachineGroup(say("Due soon"), say("due within {days} days", days=SOON.days), "open"),
    "open": MachineGroup(say("Not decided"), say("not decided"), "open"),
    "diagnosis": MachineGroup(say("Contradicts its model"), say("contradict their model"), "open"),
    "draft": MachineGroup(say("Not released"), say("not released"), "open"),
    "never": MachineGroup(say("No certificate"), say("without certificate"), "open"),
    "order": MachineGroup(say("In order"), say("in order"), "good"),
}
_URGENCY = {name: place for place, name in enumerate(GROUPS)}


class MachineStanding(NamedTuple):
    """A machine with its newest certificate, when it is due, and its groups, the most urgent first."""

    newest: Newest
    due: DueItem | None
    groups: tuple[str, ...]
    names: str  # by which it is searched for

    @property
    def serial(self) -> str:
        return self.newest.machine.serial

    @classmethod
    def of(cls, newest: Newest, due: DueItem | None, today: dt.date) -> MachineStanding:
        machine = newest.machine
        names = (machine.serial, machine.name, machine.manufacturer, machine.model, machine.place)
        return cls(newest, due, groups(newest, due, today), "\n".join(names).casefold())


@dataclass(frozen=True)
class MachineOverview:
    """How every machine stands on a day, the most urgent first, with the last entry of the records."""

    head: tuple[int, str]
    today: dt.date
    machines: Sequence[MachineStanding]
    artefacts: Mapping[str, dt.date | None]  # by serial, until when its calibration is valid
    counts: Mapping[str, int]  # of machines in a group
    places: tuple[str, ...]


MOST_ANEW = 1000  # machines of which each is looked up by itself: of more, all are


def overview(records: Records, due: DueDates, today: dt.date, before: MachineOverview | None = None) -> MachineOverview:
    """Every machine; of those of which nothing was entered since, and no artefact is due otherwise, as before."""
    head, artefacts = records.head(), {one.serial: one.due for one in records.artefacts(today)}
    changed: set[str] | None = None
    if before is not None and before.today == today and (later := changed_machines(records, *before.head)) is not None:
        other = {serial for serial, _ in artefacts.items() ^ before.artefacts.items()}
        with_other = {one.serial for one in before.machines if one.due is not None and one.due.artefact in other}
        changed = later | with_other | unsettled(records, today)
        changed = changed if len(changed) <= MOST_ANEW else None
    newest, days = standing_of_all(records, changed), due(records, today, changed)
    found = [MachineStanding.of(one, days.get(one.machine.serial), today) for one in newest]
    if before is None or changed is None:
        machines = in_order(found)
    else:
        machines = [one for one in before.machines if one.serial not in changed]
        for one in found:
            insort(machines, one, key=_urgency)
    counts = Counter(group for one in machines for group in one.groups)
    places = {one.newest.machine.place for one in machines} - {""}
    return MachineOverview(head, today, machines, artefacts, counts, tuple(sorted(places)))


def in_order(machines: Sequence[MachineStanding]) -> list[MachineStanding]:
    """The most urgent first, then by due date and serial."""
    return sorted(machines, key=_urgency)


def _urgency(one: MachineStanding) -> tuple[int, dt.date, str]:
    due = one.due.due if one.due is not None and one.due.due is not None else dt.date.max
    return _URGENCY[one.groups[0]], due, one.serial


def groups(newest: Newest, due: DueItem | None, today: dt.date) -> tuple[str, ...]:
    """To which groups a machine belongs, the most urgent first."""
    found: tuple[str, ...] = ()
    if due is not None and due.due is not None:
        found = ("overdue",) if due.beyond or due.due < today else ("due",) if due.due <= today + SOON else ()
    certificate = newest.certificate
    if certificate is None:
        found += ("never",)
    else:
        found += _of_certificate(certificate.decision, certificate.diagnosis, certificate.state)
    return tuple(sorted(found, key=_URGENCY.__getitem__)) if len(found) > 1 else found or ("order",)


@lru_cache(1000)
def _of_certificate(decision: str, diagnosis: str, state: str) -> tuple[str, ...]:
    conforms = DECISIONS.get(decision, (None, "open"))[1]
    found = ["failing"] if conforms == "bad" else ["open"] if conforms == "open" else []
    if diagnosis and VERDICTS.get(diagnosis, (None, "open"))[1] != "good":
        found.append("diagnosis")
    return tuple(found + ["draft"] * (state == "draft"))
