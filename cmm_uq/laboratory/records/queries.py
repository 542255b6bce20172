"""What is asked of the records, each in a few indexed queries."""

from __future__ import annotations

import datetime as dt
import json
import os
from bisect import bisect_left
from collections import defaultdict
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sqlalchemy import ColumnElement, Connection, Select, and_, func, or_, select

from cmm_uq.base.errors import CmmUqError, suggestion
from cmm_uq.laboratory.records.facts import (
    BY_NAME,
    STANDING,
    ArtefactRow,
    RecordedCertificate,
    RecordedMachine,
    RecordedValue,
    ReleaseSignature,
    Series,
    spelled,
)
from cmm_uq.laboratory.records.tables import (
    adjustments,
    artefacts,
    certificates,
    covariances,
    figures,
    machines,
    quantities,
    signatures,
)

if TYPE_CHECKING:
    import pandas as pd

_TOGETHER = 2000
"""Certificates whose values are asked for in one query."""

_COLUMNS = (
    certificates, machines.c.called.label("machine_called"), func.coalesce(artefacts.c.called, "").label("artefact_called"),
)  # fmt: skip
_JOINED = certificates.join(machines).outerjoin(artefacts, artefacts.c.id == certificates.c.artefact)


@dataclass(frozen=True)
class CertificateQuery:
    """Which certificates; see :meth:`cmm_uq.laboratory.records.store.Records.certificates`."""

    machine: str | None = None
    origin: str | None = "measured"
    states: Collection[str] | None = None
    artefact: str | None = None
    since: dt.date | None = None
    command: str | None = "report"
    job: str | None = None


def machines_of(connection: Connection) -> list[RecordedMachine]:
    """All, by serial."""
    days: dict[int, list[dt.date]] = defaultdict(list)
    for row in connection.execute(select(adjustments.c.machine, adjustments.c.day).order_by(adjustments.c.day)):
        days[row.machine].append(dt.date.fromisoformat(row.day))
    rows = connection.execute(select(machines).order_by(machines.c.called)).mappings()
    return [_machine(row, days.get(row["id"], ())) for row in rows]


def machine_of(connection: Connection, serial: str) -> RecordedMachine:
    """One; see :meth:`cmm_uq.laboratory.records.store.Records.machine`."""
    number = machine_id(connection, serial)
    row = connection.execute(select(machines).where(machines.c.id == number)).mappings().one()
    return _machine(row, [dt.date.fromisoformat(day) for day in _adjusted(connection, [number])[number]])


def _machine(row: Mapping[Any, Any], adjusted: Iterable[dt.date]) -> RecordedMachine:
    return RecordedMachine(
        row["called"], row["name"], row["manufacturer"], row["model"], row["place"], tuple(adjusted),
        row["recognised"].startswith(BY_NAME),
        json.loads(row["calibrate"]) if row["calibrate"] else None,
    )  # fmt: skip


def machine_id(connection: Connection, serial: str) -> int:
    """Number of the machine of a serial, or of a name."""
    for column, said in (
        (machines.c.called, serial), (machines.c.spelled, spelled(serial)), (machines.c.named, spelled(serial)),
    ):  # fmt: skip
        rows = connection.execute(select(machines.c.id, machines.c.called).where(column == said)).all()
        if len(rows) == 1:
            return int(rows[0].id)
        if rows:
            names = " or ".join(repr(row.called) for row in rows[:5])
            raise CmmUqError(f"{len(rows)} machines are called {serial!r}", where="records", fix=f"Say {names}")
    known = connection.execute(select(machines.c.called, machines.c.name).limit(2000)).all()
    near = {name for row in known for name in row if name}
    raise CmmUqError(f"no machine {serial!r} is recorded", where="records",
                     fix=suggestion(serial, near) if near else "No machine is recorded yet")  # fmt: skip


def artefacts_of(connection: Connection) -> list[ArtefactRow]:
    """All, by serial."""
    rows = connection.execute(select(artefacts).order_by(artefacts.c.called))
    return [
        ArtefactRow(row.called, row.kind, row.certificate, row.laboratory, _day(row.calibrated), _day(row.due))
        for row in rows
    ]


def certificates_of(
    connection: Connection, wanted: CertificateQuery, limit: int | None, offset: int, *, values: bool, home: Path | None
) -> list[RecordedCertificate]:
    """By day, then entry; see :meth:`cmm_uq.laboratory.records.store.Records.certificates`."""
    c = certificates.c
    query = select(*_COLUMNS).select_from(_JOINED).where(*_conditions(connection, wanted))
    query = query.order_by(c.day.desc(), c.entry.desc()).limit(limit).offset(offset or None)
    return _certificates(connection, query, values=values, home=home)[::-1]


def _conditions(connection: Connection, wanted: CertificateQuery) -> list[ColumnElement[bool]]:
    c = certificates.c
    found: list[ColumnElement[bool]] = [
        column == value
        for column, value in ((c.command, wanted.command), (c.origin, wanted.origin), (c.job, wanted.job))
        if value is not None
    ]
    if wanted.machine is not None:
        found.append(c.machine == machine_id(connection, wanted.machine))
    if wanted.states is not None:
        found.append(c.state.in_(tuple(wanted.states)))
    if wanted.artefact is not None:
        key = spelled(wanted.artefact)
        ids = connection.execute(
            select(artefacts.c.id).where(
                or_(artefacts.c.called == wanted.artefact, artefacts.c.recognised.in_((key, f"certificate:{key}")))
            )
        ).scalars()
        found.append(c.artefact.in_(tuple(ids)))
    if wanted.since is not None:
        found.append(c.day >= wanted.since.isoformat())
    return found


def certificate_of(connection: Connection, entry: int, home: Path | None) -> RecordedCertificate:
    """One; see :meth:`cmm_uq.laboratory.records.store.Records.certificate`."""
    query = select(*_COLUMNS).select_from(_JOINED).where(certificates.c.entry == entry)
    found = _certificates(connection, query, values=True, home=home)
    if not found:
        raise CmmUqError(f"entry {entry} is no certificate", where="records")
    return found[0]


def named(connection: Connection, name: str, home: Path | None) -> list[RecordedCertificate]:
    """By number, job, hash or entry; see :meth:`cmm_uq.laboratory.records.store.Records.named`."""
    c = certificates.c
    ways = [c.number == name, c.job == name, c.results_sha256 == name, c.folder == name]
    if name.isascii() and name.isdigit() and len(name) < 16:
        ways.insert(0, c.entry == int(name))
    for way in ways:
        query = select(*_COLUMNS).select_from(_JOINED).where(way).order_by(c.day, c.entry)
        if found := _certificates(connection, query, values=False, home=home):
            return found
    return []


def latest_of(
    connection: Connection, home: Path | None, until: dt.date | None = None, *, values: bool = True
) -> list[RecordedCertificate]:
    """Newest of each machine; see :meth:`cmm_uq.laboratory.records.store.Records.latest`."""
    newest = certificates.alias()
    of_machine = (
        select(newest.c.entry)
        .where(newest.c.machine == machines.c.id, newest.c.command == "report", newest.c.origin == "measured",
               newest.c.state.in_(STANDING), newest.c.interim.is_(False),
               *((newest.c.day <= until.isoformat(),) if until else ()))
        .order_by(newest.c.day.desc(), newest.c.entry.desc()).limit(1).correlate(machines).scalar_subquery()
    )  # fmt: skip
    found = connection.execute(select(of_machine).select_from(machines)).scalars()
    entries = sorted(entry for entry in found if entry is not None)
    rows: list[RecordedCertificate] = []
    for block in blocks(entries):
        query = select(*_COLUMNS).select_from(_JOINED).where(certificates.c.entry.in_(block))
        rows += _certificates(connection, query, values=values, home=home)
    return sorted(rows, key=lambda one: (one.machine, one.entry))


def checks_of(connection: Connection, home: Path | None) -> list[RecordedCertificate]:
    """Interim checks of all machines; see :meth:`cmm_uq.laboratory.records.store.Records.checks`."""
    c = certificates.c
    query = select(*_COLUMNS).select_from(_JOINED).where(
        c.command == "report", c.origin == "measured", c.interim.is_(True), c.state.in_(STANDING)
    )  # fmt: skip
    return _certificates(connection, query.order_by(c.day, c.entry), values=True, home=home)


def limited_of(connection: Connection, entries: Sequence[int]) -> set[int]:
    """Those with a limit; see :meth:`cmm_uq.laboratory.records.store.Records.limited`."""
    f, found = figures.c, set[int]()
    for block in blocks(entries):
        query = select(f.certificate).distinct().where(f.certificate.in_(block), f.at_most.is_not(None))
        found.update(connection.execute(query).scalars())
    return found


def dated_after_of(connection: Connection, day: dt.date) -> dict[str, dt.date]:
    """By machine; see :meth:`cmm_uq.laboratory.records.store.Records.dated_after`."""
    c = certificates.c
    query = select(machines.c.called, func.max(c.day)).select_from(certificates.join(machines)).where(
        c.command == "report", c.origin == "measured", c.state.in_(STANDING), c.day > day.isoformat()
    )  # fmt: skip
    return {row[0]: dt.date.fromisoformat(row[1]) for row in connection.execute(query.group_by(machines.c.called))}


def signatures_of(connection: Connection, certificate: int) -> list[ReleaseSignature]:
    query = select(signatures).where(signatures.c.certificate == certificate).order_by(signatures.c.entry)
    return [
        ReleaseSignature(
            row.entry, row.certificate, row.what, row.by, row.reason, dt.datetime.fromisoformat(row.at), row.replaced_by
        )
        for row in connection.execute(query)
    ]  # fmt: skip


def entry_of_results(connection: Connection, results_sha256: str, *, standing: bool = False) -> int | None:
    """Number of the first entry that recorded them, of those that count where ``standing`` says so."""
    query = select(func.min(certificates.c.entry)).where(certificates.c.results_sha256 == results_sha256)
    if standing:
        query = query.where(certificates.c.state.in_(STANDING))
    found = connection.execute(query).scalar()
    return None if found is None else int(found)


def _certificates(
    connection: Connection, query: Select[Any], *, values: bool, home: Path | None
) -> list[RecordedCertificate]:
    rows = connection.execute(query).all()
    entries = [row.entry for row in rows]
    stated = _values(connection, entries) if values else {}
    together = _together(connection, entries) if values else {}
    adjusted = _adjusted(connection, {row.machine for row in rows})
    base, day_of, moment_of = _folder(home), dt.date.fromisoformat, dt.datetime.fromisoformat
    return [
        RecordedCertificate(
            entry, job, machine_called, artefact_called, kind, origin, day_of(day), moment_of(at),
            adjusted_before(since, day, adjusted[machine]), state, decision, diagnosis, bool(interim), base(folder), version,
            results, number, command, _day(due), tuple(stated.get(entry, ())), together.get(entry),
        )
        for (entry, machine, _, command, job, number, kind, origin, day, at, since, state, decision, diagnosis, interim,
             folder, version, results, due, machine_called, artefact_called) in rows
    ]  # fmt: skip


def _values(connection: Connection, entries: Sequence[int]) -> dict[int, list[RecordedValue]]:
    f, q = figures.c, quantities.c
    names = {row[0]: row[1:] for row in connection.execute(select(q.id, q.name, q.quantity, q.unit)).all()}
    found: dict[int, list[RecordedValue]] = defaultdict(list)
    for block in blocks(entries):
        query = select(f.certificate, f.quantity, f.value, f.u, f.lower, f.upper, f.u_artefact, f.at_most)
        query = query.where(f.certificate.in_(block)).order_by(f.certificate, f.place)
        for certificate, quantity, value, u, lower, upper, common, limit in connection.execute(query).all():
            found[certificate].append(RecordedValue(*names[quantity], value, u, lower, upper, common, limit))
    return found


def _together(connection: Connection, entries: Sequence[int]) -> dict[int, tuple[tuple[str, ...], tuple[float, ...]]]:
    c, found = covariances.c, {}
    for block in blocks(entries):
        for row in connection.execute(select(covariances).where(c.certificate.in_(block))):
            found[row.certificate] = (tuple(json.loads(row.names)), tuple(json.loads(row.lower)))
    return found


def _adjusted(connection: Connection, of: Collection[int]) -> dict[int, list[str]]:
    """Days on which machines were adjusted, sorted."""
    found: dict[int, list[str]] = defaultdict(list)
    a = adjustments.c
    for block in blocks(sorted(of)):
        for row in connection.execute(select(a.machine, a.day).where(a.machine.in_(block)).order_by(a.day)):
            found[row.machine].append(row.day)
    return found


def adjusted_before(stated: str | None, day: str, adjusted: Sequence[str]) -> dt.date | None:
    """The adjustment before a recording: stated with it, or the last known before its day.

    On the day itself only what is stated counts: a machine is recorded as found and as left on one day.
    """
    if stated:
        return dt.date.fromisoformat(stated)
    before = bisect_left(adjusted, day)
    return dt.date.fromisoformat(adjusted[before - 1]) if before else None


def series_of(connection: Connection, machine: str, names: Collection[str] | None, origin: str) -> dict[str, Series]:
    import numpy as np

    number = machine_id(connection, machine)
    rows = connection.execute(_stated(names, origin).where(certificates.c.machine == number)).all()
    adjusted = _adjusted(connection, [number])[number]
    by_name: dict[str, list[Any]] = defaultdict(list)
    for row in rows:
        by_name[row.name].append(row)
    found = {}
    for name, of_name in by_name.items():
        limits = [row.limit for row in of_name if row.limit is not None]
        since = (adjusted_before(row.adjusted_since, row.day, adjusted) for row in of_name)
        found[name] = Series(
            name, of_name[-1].quantity, of_name[-1].unit, limits[-1] if limits else None,
            np.array([dt.date.fromisoformat(row.day).toordinal() for row in of_name]),
            np.array([row.value for row in of_name], dtype=float), np.array([row.u for row in of_name], dtype=float),
            np.array([row.u_artefact for row in of_name], dtype=float), np.array([row.artefact for row in of_name]),
            np.array([row.entry for row in of_name]), np.array([day.toordinal() if day else 0 for day in since]),
            np.array([bool(row.interim) for row in of_name]),
        )  # fmt: skip
    return found


def _stated(names: Collection[str] | None, origin: str) -> Select[Any]:
    """Values of standing certificates and interim checks, by day, entry."""
    c, f, q = certificates.c, figures.c, quantities.c
    joined = (
        certificates.join(figures, f.certificate == c.entry).join(quantities, q.id == f.quantity)
        .outerjoin(artefacts, artefacts.c.id == c.artefact)
    )  # fmt: skip
    query = (
        select(c.machine, c.day, q.name, q.quantity, q.unit, f.value, f.u, f.u_artefact,
               func.coalesce(artefacts.c.called, "").label("artefact"), f.at_most.label("limit"), c.entry,
               c.adjusted_since, c.interim)
        .select_from(joined)
        .where(and_(c.command == "report", c.origin == origin, c.state.in_(STANDING)))
        .order_by(c.day, c.entry, f.place)
    )  # fmt: skip
    return query if names is None else query.where(q.name.in_(tuple(names)))


def all_series_of(connection: Connection, names: Collection[str] | None, origin: str) -> pd.DataFrame:
    import pandas as pd

    rows = connection.execute(_stated(names, origin)).all()
    known = {row.id: row for row in connection.execute(select(machines))}
    adjusted = _adjusted(connection, set(known))
    ordinal = {day: dt.date.fromisoformat(day).toordinal() for day in {row.day for row in rows}}
    since = [adjusted_before(row.adjusted_since, row.day, adjusted[row.machine]) for row in rows]
    frame = pd.DataFrame(
        {
            "machine": [known[row.machine].called for row in rows],
            "model": [known[row.machine].model for row in rows],
            "place": [known[row.machine].place for row in rows],
            "day": [ordinal[row.day] for row in rows],
            **{name: [getattr(row, name) for row in rows]
               for name in ("name", "value", "u", "u_artefact", "artefact", "limit", "entry")},
            "adjusted_since": [day.toordinal() if day else 0 for day in since],
            "interim": [bool(row.interim) for row in rows],
        }
    )  # fmt: skip
    frame["limit"] = frame["limit"].astype(float)
    return frame.sort_values(["machine", "name", "day", "entry"], kind="stable", ignore_index=True)


def _folder(home: Path | None) -> Callable[[str], str]:
    """A recorded folder as a path that can be opened."""
    before = "" if home is None else f"{home}{os.sep}"
    return lambda folder: f"{before}{folder}" if folder and before and not _is_absolute(folder) else folder


def _is_absolute(folder: str) -> bool:
    return folder[:1] in "/\\" or folder[1:2] == ":"


def _day(text: str | None) -> dt.date | None:
    return dt.date.fromisoformat(text) if text else None


def blocks(numbers: Sequence[int]) -> Iterable[Sequence[int]]:
    """So many at a time as a query takes."""
    return (numbers[i : i + _TOGETHER] for i in range(0, len(numbers), _TOGETHER))
