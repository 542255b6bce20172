"""What a list of the records shows: where each machine stands, and certificates by what a reader chooses, a page at a time.

Few columns, no values: a list of 10⁵ certificates is counted and paged by the database.
"""

from __future__ import annotations

import datetime as dt
import json
from collections.abc import Callable, Collection, Iterator, Mapping
from typing import Any, NamedTuple

from sqlalchemy import ColumnElement, Connection, func, or_, select, union

from cmm_uq.base.values import dataclass
from cmm_uq.jobs.verdicts import Verdicts, gravest
from cmm_uq.laboratory.records import facts, queries, tables
from cmm_uq.laboratory.records.facts import BY_NAME, PART, PERFORMANCE, STANDING, Entry, RecordedMachine
from cmm_uq.laboratory.records.place import told
from cmm_uq.laboratory.records.queries import RECORDED, Serials, adjusted_before, blocks, newest_of_machine
from cmm_uq.laboratory.records.store import Records
from cmm_uq.laboratory.records.tables import artefacts, certificates, entries, figures, machines, quantities


class ListedCertificate(NamedTuple):
    """In a list, fields as in ``RecordedCertificate``; a tuple is made in a tenth of a dataclass's time."""

    entry: int
    job: str
    number: str
    machine: str
    machine_name: str
    artefact: str
    kind: str
    origin: str
    day: dt.date
    state: str
    decision: str
    diagnosis: str
    interim: bool
    command: str


class Newest(NamedTuple):
    """A machine and its newest measured certificate that stands; ``None`` where it has none."""

    machine: RecordedMachine
    certificate: ListedCertificate | None


@dataclass(frozen=True)
class CertificateFilter:
    """Which certificates are listed; what is empty or ``None`` leaves all."""

    text: str = ""  # in the job's id, the certificate's number, or the machine's serial or name; capitals do not matter
    machine: str = ""  # and artefact: as they are called in the records
    artefact: str = ""
    origin: str = "measured"
    command: str = "report"
    states: Collection[str] = ()  # and decisions, verdicts: of the certificate, its statements, its diagnosis
    decisions: Collection[str] = ()
    verdicts: Collection[str] = ()
    interim: bool | None = None  # whether interim checks, or certificates
    since: dt.date | None = None  # and until: first and last day
    until: dt.date | None = None


COMMANDS = ("report", "diagnose")  # that make what is listed; named, so that the database finds its index
_C = certificates.c
_COLUMNS = (
    _C.entry, _C.job, _C.number, machines.c.called.label("machine"), machines.c.name.label("machine_name"),
    func.coalesce(artefacts.c.called, "").label("artefact"), _C.kind, _C.origin, _C.day, _C.state, _C.decision,
    _C.diagnosis, _C.interim, _C.command,
)  # fmt: skip
_JOINED = certificates.join(machines).outerjoin(artefacts, artefacts.c.id == _C.artefact)


def standing_of_all(records: Records, of: Serials = None) -> list[Newest]:
    """Every machine, or those of some serials, with its newest certificate, in the order in which they were first recorded."""
    m = machines.c
    query = (
        select(m.called, m.name.label("of_name"), m.manufacturer, m.model, m.place, m.recognised, *_COLUMNS)
        .select_from(machines.outerjoin(certificates, _C.entry == newest_of_machine())
                     .outerjoin(artefacts, artefacts.c.id == _C.artefact))
        .where(RECORDED).order_by(m.id)
    )  # fmt: skip
    with records.reading() as connection:
        rows = [row for own in queries.named(of) for row in connection.execute(query.where(*own))]
    return [
        Newest(RecordedMachine(*row[:5], (), row[5].startswith(BY_NAME)), None if row[6] is None else _listed(row[6:]))
        for row in rows
    ]


def changed_machines(records: Records, number: int, of: str) -> set[str] | None:
    """Machines of which later entries say anything; ``None`` where these records have no entry of that number and hash."""
    e, m, s, a = entries.c, machines.c, tables.signatures.c, tables.adjustments.c
    stated = select(e.content).where(e.kind == "machine", e.number > number)
    with records.reading() as connection:
        if connection.execute(select(e.hash).where(e.number == number)).scalar() != of:
            return None
        said = {facts.machine_key(json.loads(content)) for content in connection.execute(stated).scalars()}
        later = (
            select(_C.machine).where(_C.entry > number),
            select(_C.machine).join(tables.signatures, s.certificate == _C.entry).where(s.entry > number),
            select(a.machine).where(a.entry > number),
            select(m.id).where(or_(m.entry > number, m.recognised.in_(said))),
        )
        return set(connection.execute(select(m.called).where(m.id.in_(union(*later)))).scalars())


def unsettled_machines(records: Records, on: dt.date, pooled: Callable[[Mapping[str, Any]], bool]) -> set[str]:
    """Machines of which anything is dated after a day, or whose rule takes what others found."""
    m, after = machines.c, on.isoformat()
    with records.reading() as connection:
        rules = connection.execute(select(m.calibrate).distinct().where(m.calibrate.is_not(None))).scalars()
        common = [rule for rule in rules if pooled(json.loads(rule))]
        unsettled = (
            select(_C.machine).where(*queries.measured(_C), _C.day > after),
            select(tables.adjustments.c.machine).where(tables.adjustments.c.day > after),
            select(m.id).where(or_(m.day > after, m.calibrate.in_(common))),
        )
        return set(connection.execute(select(m.called).where(m.id.in_(union(*unsettled)))).scalars())


def chosen(
    records: Records, choice: CertificateFilter, most: int, left_out: int = 0
) -> tuple[list[ListedCertificate], int]:
    """Certificates, newest first, and how many there are."""
    with records.reading() as connection:
        where = _conditions(connection, choice)
        count = connection.execute(select(func.count()).select_from(certificates).where(*where)).scalar_one()
        wanted = select(_C.entry).where(*where).order_by(_C.day.desc(), _C.entry.desc()).limit(most).offset(left_out)
        page = connection.execute(wanted).scalars().all()  # from an index alone; names are looked up for these only
        rows = connection.execute(select(*_COLUMNS).select_from(_JOINED).where(_C.entry.in_(page))).all()
    found = {row.entry: _listed(row) for row in rows}
    return [found[entry] for entry in page], int(count)


def _listed(row: Any) -> ListedCertificate:
    *facts, day, state, decision, verdict, interim, command = row
    date = dt.date.fromisoformat(day)
    return ListedCertificate._make((*facts, date, state, decision, verdict, bool(interim), command))


def _conditions(connection: Connection, choice: CertificateFilter) -> list[ColumnElement[bool]]:
    found: list[ColumnElement[bool]] = [_C.command.in_(COMMANDS if not choice.command else (choice.command,))]
    if choice.origin:
        found.append(_C.origin == choice.origin)
    if choice.machine:
        found.append(_C.machine == select(machines.c.id).where(machines.c.called == choice.machine).scalar_subquery())
    if choice.artefact:
        found.append(_C.artefact.in_(select(artefacts.c.id).where(artefacts.c.called == choice.artefact)))
    several = ((_C.state, choice.states), (_C.decision, choice.decisions), (_C.diagnosis, choice.verdicts))
    found += [column.in_(tuple(values)) for column, values in several if values]
    if choice.interim is not None:
        found.append(_C.interim.is_(choice.interim))
    if choice.since is not None:
        found.append(_C.day >= choice.since.isoformat())
    if choice.until is not None:
        found.append(_C.day <= choice.until.isoformat())
    return [*found, _with_text(connection, choice.text)] if choice.text else found


def _with_text(connection: Connection, text: str) -> ColumnElement[bool]:
    """A text in the job's id or the certificate's number, or in the machine's serial or name however they are spelled."""
    key = facts.spelled(text)
    of_machine = or_(*(column.contains(key, autoescape=True) for column in (machines.c.spelled, machines.c.named)))
    escaped = "".join(f"/{c}" if c in "%_/" else c for c in text)
    sqlite = connection.dialect.name == "sqlite"  # whose LIKE takes capitals for small letters, and its lower() is slow
    named = ((column.like if sqlite else column.ilike)(f"%{escaped}%", escape="/") for column in (_C.job, _C.number))
    return or_(*named, _C.machine.in_(select(machines.c.id).where(of_machine)))


class CourseValue(NamedTuple):
    """One value as one certificate or interim check states it."""

    entry: int
    day: dt.date
    value: float  # and lower, upper: with the ends of the stated interval
    lower: float
    upper: float
    limit: float | None  # of its amount; ``None`` where none is set
    interim: bool  # whether it is of an interim check
    adjusted_since: dt.date | None  # the last adjustment of the machine before it


@dataclass(frozen=True, slots=True)
class Course:
    """One value of one machine over its newest certificates and interim checks, oldest first."""

    name: str
    quantity: str
    unit: str
    stated: list[CourseValue]


def courses(records: Records, machine: RecordedMachine, most: int) -> list[Course]:
    """What a machine's measured certificates and checks state, as far as they stand, in the order of the newest."""
    newest = (
        select(_C.entry, _C.day, _C.interim, _C.adjusted_since)
        .where(_C.machine == select(machines.c.id).where(machines.c.called == machine.serial).scalar_subquery(),
               _C.command == "report", _C.origin == "measured", _C.state.in_(STANDING))
        .order_by(_C.day.desc(), _C.entry.desc()).limit(most).subquery()
    )  # fmt: skip
    f, q = figures.c, quantities.c
    query = (
        select(newest, q.name, q.quantity, q.unit, f.value, f.lower, f.upper, f.at_most)
        .select_from(newest.join(figures, f.certificate == newest.c.entry).join(quantities, q.id == f.quantity))
        .order_by(newest.c.day.desc(), newest.c.entry.desc(), f.place)
    )
    found: dict[tuple[str, str], Course] = {}
    adjusted = [day.isoformat() for day in machine.adjusted]
    with records.reading() as connection:
        rows = connection.execute(query).all()
    for row in rows:
        course = found.setdefault((row.name, row.unit), Course(row.name, row.quantity, row.unit, []))
        since = adjusted_before(row.adjusted_since, row.day, adjusted)
        day, interim = dt.date.fromisoformat(row.day), bool(row.interim)
        stated = CourseValue(row.entry, day, row.value, row.lower, row.upper, row.at_most, interim, since)
        course.stated.insert(0, stated)
    return list(found.values())


def outcomes_of(records: Records, numbers: Collection[int]) -> dict[int, dict[str, str]]:
    """What certificates state of each of their values, by entry; nothing of entries of versions that did not keep it.

    Values have the names that the records give them; where several statements are of one, the gravest counts.
    """
    found: dict[int, dict[str, str]] = {}
    for number, content in contents(records, numbers):
        outcomes = found[number] = {}
        for one in Verdicts.of_results(content):
            name = PERFORMANCE + (one.name or one.by) if one.by else one.name
            if one.by and name in outcomes:
                name = f"{name} ({one.by})"
            outcomes[name] = gravest((one.outcome, outcomes.get(name, one.outcome)))
    return found


def contents(records: Records, numbers: Collection[int]) -> Iterator[tuple[int, dict[str, Any]]]:
    """What entries say, by their numbers."""
    with records.reading() as connection:
        for block in blocks(sorted(numbers)):
            query = select(entries.c.number, entries.c.content).where(entries.c.number.in_(block))
            yield from ((int(number), json.loads(content)) for number, content in connection.execute(query))


class ListedPart(NamedTuple):
    """Which part a report is of, and the certificate of the machine that it stands on."""

    name: str
    serial: str
    drawing: str
    certificate: str
    calibrated: str


def parts_of(records: Records, numbers: Collection[int]) -> dict[int, ListedPart]:
    """Of the entries of reports of parts among some, by their numbers."""
    with told(records.place, rows=True):
        return {
            number: ListedPart._make(
                str(one)
                for one in (
                    *(said["part"][name] for name in ("name", "serial", "drawing")),
                    *(said["certificate"][name] for name in ("number", "calibrated")),
                )
            )
            for number, said in contents(records, numbers)
            if said.get("command") == PART
        }


def entry_of(records: Records, number: int) -> Entry | None:
    """One entry; ``None`` where there is none of that number."""
    with records.reading() as connection:
        row = connection.execute(select(entries).where(entries.c.number == number)).first()
    return None if row is None else Entry(*row)
