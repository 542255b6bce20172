"""What is asked of the records, each in a few indexed queries."""

from __future__ import annotations

import contextlib
import datetime as dt
import json
import os
from bisect import bisect_left
from collections import defaultdict
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from operator import itemgetter
from pathlib import Path
from typing import Any

from sqlalchemy import ColumnElement, Connection, Engine, Select, Table, func, select

from cmm_uq.base.errors import CmmUqError, suggestion
from cmm_uq.laboratory.records import facts, tables
from cmm_uq.laboratory.records.place import told
from cmm_uq.laboratory.records.tables import artefacts, certificates, entries, figures, machines, quantities

_TOGETHER = 2000  # certificates whose values are asked for in one query
_C = certificates.c
_CALLED = func.coalesce(artefacts.c.called, "")
_CERTIFICATES = select(
    certificates, machines.c.called.label("machine_called"), _CALLED.label("artefact_called")
).select_from(certificates.join(machines).outerjoin(artefacts, artefacts.c.id == _C.artefact))


Serials = Collection[str] | None
"""Machines that are asked about, as the records call them; ``None`` for all."""

RECORDED = ~machines.c.recognised.startswith(facts.BY_PART)
"""Machines of the records: what only reports of parts name is none until a certificate or an entry does."""


def measured(c: Any, origin: str = "measured", command: str = "report") -> tuple[ColumnElement[bool], ...]:
    """Reports of an origin that stand."""
    return c.command == command, c.origin == origin, c.state.in_(facts.STANDING)


class RecordQueries:
    """Records as they are read; each method sees one state of them, whoever writes meanwhile."""

    engine: Engine
    place: str | Path

    @property
    def home(self) -> Path | None:
        """Folder of the file: folders of reports inside it are recorded relative to it; ``None`` for a server."""
        return self.place.absolute().parent if isinstance(self.place, Path) else None

    @property
    def _before(self) -> str:
        """What stands before a recorded folder that is relative."""
        return "" if self.home is None else f"{self.home}{os.sep}"

    @contextlib.contextmanager
    def reading(self) -> Iterator[Connection]:
        """A connection; what the database refuses is said in words."""
        with told(self.place, rows=True), self.engine.connect() as connection:
            yield connection

    def machines(self, on: dt.date | None = None, of: Serials = None) -> list[facts.RecordedMachine]:
        """All machines, or those of some serials, by serial, with the rules that are stated up to a day."""
        with self.reading() as connection:
            rows = [row for own in named(of) for row in _known_on(connection, machines, _RULE, on, RECORDED, *own)]
            days = _adjusted(connection, [row["id"] for row in rows])
            return [_machine(row, days[row["id"]]) for row in rows]

    def machine(self, serial: str, on: dt.date | None = None) -> facts.RecordedMachine:
        """One machine, by serial however it is spelled, or by name."""
        with self.reading() as connection:
            number = _machine_id(connection, serial)
            (row,) = _known_on(connection, machines, _RULE, on, machines.c.id == number)
            return _machine(row, _adjusted(connection, [number])[number])

    def artefacts(self, on: dt.date | None = None) -> list[facts.ArtefactRow]:
        """All artefacts, by serial, with the newest certificate that is stated up to a day."""
        with self.reading() as connection:
            rows = _known_on(connection, artefacts, _ARTEFACT[2:], on)
        return [
            facts.ArtefactRow(called, kind, certificate or "", laboratory or "", _day(calibrated), _day(due))
            for called, kind, certificate, laboratory, calibrated, due in map(itemgetter(*_ARTEFACT), rows)
        ]

    def certificates(
        self, machine: str | None = None, *, origin: str | None = "measured", states: Collection[str] | None = None,
        command: str | None = "report", job: str | None = None, limit: int | None = None, values: bool = True,
    ) -> list[facts.RecordedCertificate]:  # fmt: skip
        """Certificates and interim checks, by day, then entry, ``limit`` newest at most; ``None`` for all."""
        wanted = ((_C.command, command), (_C.origin, origin), (_C.job, job))
        where = [column == value for column, value in wanted if value is not None]
        with self.reading() as connection:
            if machine is not None:
                where.append(_C.machine == _machine_id(connection, machine))
            if states is not None:
                where.append(_C.state.in_(tuple(states)))
            query = _CERTIFICATES.where(*where).order_by(_C.day.desc(), _C.entry.desc()).limit(limit)
            return self._certificates(connection, query, values=values)[::-1]

    def certificate(self, entry: int) -> facts.RecordedCertificate:
        """One certificate, by the number of its entry."""
        with self.reading() as connection:
            found = self._certificates(connection, _CERTIFICATES.where(_C.entry == entry))
        if not found:
            raise CmmUqError(f"entry {entry} is no certificate", where="records")
        return found[0]

    def named(self, certificate: str) -> list[facts.RecordedCertificate]:
        """Certificates by number, id of the job, folder, hash of results.json, or entry; by day, without values."""
        ways = [column == certificate for column in (_C.number, _C.job, _C.results_sha256, _C.folder)]
        if certificate.isascii() and certificate.isdigit() and len(certificate) < 16:
            ways.insert(0, _C.entry == int(certificate))
        with self.reading() as connection:
            for way in ways:
                query = _CERTIFICATES.where(way).order_by(_C.day, _C.entry)
                if found := self._certificates(connection, query, values=False):
                    return found
        return []

    def latest(
        self, until: dt.date | None = None, *, values: bool = True, states: Collection[str] = facts.STANDING,
        of: Serials = None,
    ) -> list[facts.RecordedCertificate]:  # fmt: skip
        """Newest measured and standing certificate of each machine, none later than a day, by serial; no checks."""
        rows: list[facts.RecordedCertificate] = []
        newest = select(newest_of_machine(until, states)).select_from(machines)
        with self.reading() as connection:
            found = [entry for own in named(of) for entry in connection.execute(newest.where(*own)).scalars()]
            for block in blocks(sorted(entry for entry in found if entry is not None)):
                rows += self._certificates(connection, _CERTIFICATES.where(_C.entry.in_(block)), values=values)
        return sorted(rows, key=lambda one: (one.machine, one.entry))

    def checks(self, of: Serials = None) -> list[facts.RecordedCertificate]:
        """Measured interim checks, neither withdrawn nor replaced, by day, then entry."""
        query = _CERTIFICATES.where(*measured(_C), _C.interim.is_(True))
        with self.reading() as connection:
            each = (
                query.where(*(_C.machine.in_(select(machines.c.id).where(one)) for one in own)) for own in named(of)
            )
            found = [one for own in each for one in self._certificates(connection, own)]
        return sorted(found, key=lambda one: (one.day, one.entry))

    def limited(self, entries: Sequence[int]) -> set[int]:
        """Those of the certificates, by the numbers of their entries, that set a limit to any value."""
        f, found = figures.c, set[int]()
        with self.reading() as connection:
            for block in blocks(entries):
                query = select(f.certificate).distinct().where(f.certificate.in_(block), f.at_most.is_not(None))
                found.update(connection.execute(query).scalars())
        return found

    def dated_after(self, day: dt.date) -> dict[str, dt.date]:
        """Machines with measured certificates or interim checks dated after a day, and the last such date of each."""
        query = select(machines.c.called, func.max(_C.day)).select_from(certificates.join(machines))
        query = query.where(*measured(_C), _C.day > day.isoformat()).group_by(machines.c.called)
        with self.reading() as connection:
            return {row[0]: dt.date.fromisoformat(row[1]) for row in connection.execute(query)}

    def parts(self, machine: str) -> list[facts.MeasuredPart]:
        """Standing reports of parts that were measured on a machine, by day, then entry."""
        e = tables.entries.c
        query = select(e.content, e.number, _C.day, _C.folder, _C.number.label("called"), _C.decision)
        query = query.join(certificates, e.number == _C.entry).order_by(_C.day, _C.entry)
        with self.reading() as connection:
            ours = query.where(_C.machine == _machine_id(connection, machine), *measured(_C, command=facts.PART))
            each = ((json.loads(row.content), row) for row in connection.execute(ours))
            return [
                facts.MeasuredPart.of(
                    said["part"],
                    said["certificate"]["calibrated"],
                    said["certificate"]["number"],
                    day=row.day,
                    folder=_opened(self._before, row.folder),
                    number=row.called,
                    outcome=row.decision,
                    entry=row.number,
                )
                for said, row in each
                if said["measured"]
            ]

    def signatures(self, certificate: int) -> list[facts.ReleaseSignature]:
        """Who released, withdrew or replaced a certificate, in order."""
        table = tables.signatures
        query = select(table).where(table.c.certificate == certificate).order_by(table.c.entry)
        with self.reading() as connection:
            rows = connection.execute(query).all()
        moment = dt.datetime.fromisoformat
        return [facts.ReleaseSignature(entry, of, what, by, reason, moment(at), replaced_by)
                for entry, of, what, by, reason, at, replaced_by in rows]  # fmt: skip

    def has_results(self, results_sha256: str) -> int | None:
        """Number of the entry that recorded these very results; ``None`` where none did."""
        with self.reading() as connection:
            return entry_of_results(connection, results_sha256)

    def series(
        self, machine: str, names: Collection[str] | None = None, origin: str = "measured"
    ) -> dict[str, facts.Series]:
        """Each value of a machine over its standing certificates and interim checks."""
        with self.reading() as connection:
            number = _machine_id(connection, machine)
            return _series(connection, _stated(names, origin).where(_C.machine == number))[number]

    def all_series(
        self, names: Collection[str] | None = None, origin: str = "measured"
    ) -> dict[str, dict[str, facts.Series]]:
        """The same of all machines, by serial."""
        with self.reading() as connection:
            called = {row.id: row.called for row in connection.execute(select(machines.c.id, machines.c.called))}
            found = _series(connection, _stated(names, origin))
        return {called[number]: found[number] for number in sorted(found, key=called.__getitem__)}

    def _certificates(
        self, connection: Connection, query: Select[Any], *, values: bool = True
    ) -> list[facts.RecordedCertificate]:
        rows = connection.execute(query).all()
        entries = [row.entry for row in rows]
        stated = _values(connection, entries) if values else {}
        together = _covariances(connection, entries) if values else {}
        adjusted = _adjusted(connection, {row.machine for row in rows})
        before = self._before
        day_of, moment_of = dt.date.fromisoformat, dt.datetime.fromisoformat
        return [
            facts.RecordedCertificate(
                entry, job, machine_called, artefact_called, kind, origin, day_of(day), moment_of(at),
                adjusted_before(since, day, adjusted[machine]), state, decision, diagnosis, bool(interim),
                _opened(before, folder), version, results, number, command, _day(due), tuple(stated.get(entry, ())),
                together.get(entry),
            )
            for (entry, machine, _, command, job, number, kind, origin, day, at, since, state, decision, diagnosis, interim,
                 folder, version, results, due, machine_called, artefact_called) in rows
        ]  # fmt: skip


def _series(connection: Connection, query: Select[Any]) -> dict[int, dict[str, facts.Series]]:
    """Of each machine, by the number of its row, the values by name."""
    each: dict[tuple[int, str], list[Any]] = defaultdict(list)
    for row in connection.execute(query):
        "".join((row.name, row.quantity, row.unit))  # raises of bytes, which SQLite lets somebody put there
        each[row.machine, row.name].append(row)
    adjusted = _adjusted(connection, {machine for machine, _ in each})
    found: dict[int, dict[str, facts.Series]] = defaultdict(dict)
    for (machine, name), rows in each.items():
        found[machine][name] = facts.Series.of(name, rows[-1].quantity, rows[-1].unit, [row.limit for row in rows], [
            (dt.date.fromisoformat(row.day), row.value, row.u, row.u_artefact, row.artefact, row.entry,
             adjusted_before(row.adjusted_since, row.day, adjusted[machine]), bool(row.interim)) for row in rows
        ])  # fmt: skip
    return found


def newest_of_machine(until: dt.date | None = None, states: Collection[str] = facts.STANDING) -> Any:
    """Entry of each machine's newest measured certificate that stands, as a subquery of ``machines``."""
    c = certificates.alias().c
    query = select(c.entry).where(c.machine == machines.c.id, *measured(c), c.interim.is_(False), c.state.in_(states))
    if until:
        query = query.where(c.day <= until.isoformat())
    return query.order_by(c.day.desc(), c.entry.desc()).limit(1).correlate(machines).scalar_subquery()


def entry_of_results(connection: Connection, results_sha256: str, *, standing: bool = False) -> int | None:
    """Number of the first entry that recorded them, of those that count where ``standing`` says so."""
    query = select(func.min(_C.entry)).where(_C.results_sha256 == results_sha256)
    found = connection.execute(query.where(_C.state.in_(facts.STANDING)) if standing else query).scalar()
    return None if found is None else int(found)


def adjusted_before(stated: str | None, day: str, adjusted: Sequence[str]) -> dt.date | None:
    """The adjustment before a recording: stated with it, or the last known before its day.

    On the day itself only what is stated counts: a machine is recorded as found and as left on one day.
    """
    if stated:
        return dt.date.fromisoformat(stated)
    before = bisect_left(adjusted, day)
    return dt.date.fromisoformat(adjusted[before - 1]) if before else None


def blocks(numbers: Sequence[Any]) -> Iterable[Sequence[Any]]:
    """So many at a time as a query takes."""
    return (numbers[i : i + _TOGETHER] for i in range(0, len(numbers), _TOGETHER))


def named(of: Serials) -> Iterable[tuple[ColumnElement[bool], ...]]:
    """Conditions of queries that together find the machines of some serials, each once; one, of nothing, for all."""
    return [()] if of is None else [(machines.c.called.in_(block),) for block in blocks(sorted(of))]


_RULE, _ARTEFACT = ("calibrate",), ("called", "kind", "certificate", "laboratory", "calibrated", "due")


def _known_on(
    connection: Connection, table: Table, names: Sequence[str], on: dt.date | None, *where: ColumnElement[bool]
) -> list[dict[str, Any]]:
    """Rows of machines or artefacts, by name; what a recording of after a day changed as those before that have it."""
    part, until = table.name.removesuffix("s"), (on or dt.date.max).isoformat()
    before = select(entries.c.content).join(certificates, _C.entry == entries.c.number).where(_C.day <= until)
    before = before.order_by(_C.day, _C.entry)
    rows = [dict(row) for row in connection.execute(select(table).where(*where).order_by(table.c.called)).mappings()]
    for row in rows:
        if row["day"] > until:
            row |= dict.fromkeys(names)
            for content in connection.execute(before.where(_C[part] == row["id"])).scalars():
                said = json.loads(content)[part]
                if table is artefacts:
                    row |= facts.certificate_after(row, said)
                elif said.get("calibrate"):
                    row["calibrate"] = json.dumps(said["calibrate"])
    return rows


def _machine(row: Mapping[Any, Any], adjusted: Iterable[str]) -> facts.RecordedMachine:
    days = tuple(map(dt.date.fromisoformat, adjusted))
    rule = json.loads(row["calibrate"]) if row["calibrate"] else None
    named = row["called"], row["name"], row["manufacturer"], row["model"], row["place"]
    return facts.RecordedMachine(*named, days, row["recognised"].startswith(facts.BY_NAME), rule)


def _machine_id(connection: Connection, serial: str) -> int:
    m, key = machines.c, facts.spelled(serial)
    for way in (m.called == serial, m.spelled == key, m.named == key):
        rows = connection.execute(select(m.id, m.called).where(way, RECORDED)).all()
        if len(rows) == 1:
            return int(rows[0].id)
        if rows:
            names = " or ".join(repr(row.called) for row in rows[:5])
            raise CmmUqError(f"{len(rows)} machines are called {serial!r}", where="records", fix=f"Say {names}")
    near = {
        name for row in connection.execute(select(m.called, m.name).where(RECORDED).limit(2000)) for name in row if name
    }
    fix = suggestion(serial, near) if near else "No machine is recorded yet"
    raise CmmUqError(f"no machine {serial!r} is recorded", where="records", fix=fix)


def _values(connection: Connection, entries: Sequence[int]) -> dict[int, list[facts.RecordedValue]]:
    f, q = figures.c, quantities.c
    names = {row[0]: row[1:] for row in connection.execute(select(q.id, q.name, q.quantity, q.unit)).all()}
    found: dict[int, list[facts.RecordedValue]] = defaultdict(list)
    for block in blocks(entries):
        query = select(f.certificate, f.quantity, f.value, f.u, f.lower, f.upper, f.u_artefact, f.at_most)
        query = query.where(f.certificate.in_(block)).order_by(f.certificate, f.place)
        for certificate, quantity, value, u, lower, upper, common, limit in connection.execute(query).all():
            found[certificate].append(facts.RecordedValue(*names[quantity], value, u, lower, upper, common, limit))
    return found


def _covariances(
    connection: Connection, entries: Sequence[int]
) -> dict[int, tuple[tuple[str, ...], tuple[float, ...]]]:
    found = {}
    for block in blocks(entries):
        for row in connection.execute(select(tables.covariances).where(tables.covariances.c.certificate.in_(block))):
            found[row.certificate] = (tuple(json.loads(row.names)), tuple(json.loads(row.lower)))
    return found


def _adjusted(connection: Connection, of: Collection[int]) -> dict[int, list[str]]:
    found: dict[int, list[str]] = defaultdict(list)
    a = tables.adjustments.c
    for block in blocks(sorted(of)):
        for row in connection.execute(select(a.machine, a.day).where(a.machine.in_(block)).order_by(a.day)):
            found[row.machine].append(row.day)
    return found


def _stated(names: Collection[str] | None, origin: str) -> Select[Any]:
    """Values of standing certificates and interim checks, by day, entry; of drafts of one recording the newest alone.

    A draft beside a released certificate of the same recording counts for nothing: a value would change by nothing since.
    """
    f, q, later = figures.c, quantities.c, certificates.alias().c
    same = [later[name] == _C[name] for name in ("machine", "job", "day", "interim")]
    same.append(later.adjusted_since.is_not_distinct_from(_C.adjusted_since))
    instead = select(later.entry).where(*same, *measured(later, origin))
    instead = instead.where((later.state == "released") | (later.entry > _C.entry)).correlate(certificates)
    joined = certificates.join(figures, f.certificate == _C.entry).join(quantities, q.id == f.quantity)
    query = (
        select(
            _C.machine, _C.day, q.name, q.quantity, q.unit, f.value, f.u, f.u_artefact, _CALLED.label("artefact"),
            f.at_most.label("limit"), _C.entry, _C.adjusted_since, _C.interim,
        )
        .select_from(joined.outerjoin(artefacts, artefacts.c.id == _C.artefact))
        .where(*measured(_C, origin), (_C.state == "released") | ~instead.exists())
        .order_by(_C.day, _C.entry, f.place)
    )  # fmt: skip
    return query if names is None else query.where(q.name.in_(tuple(names)))


def _opened(before: str, folder: str) -> str:
    """A recorded folder as a path that can be opened."""
    absolute = folder[:1] in "/\\" or folder[1:2] == ":"
    return f"{before}{folder}" if folder and before and not absolute else folder


def _day(text: str | None) -> dt.date | None:
    return dt.date.fromisoformat(text) if text else None
