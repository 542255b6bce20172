"""From entries to the tables that follow from them, and everything compared with the chain: entries, tables, files."""

from __future__ import annotations

import datetime as dt
import json
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial
from itertools import zip_longest
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sqlalchemy import ColumnElement, Connection, Table, create_engine, delete, event, func, insert, select, update
from sqlalchemy.pool import StaticPool

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.output import read_manifest, sha256_of
from cmm_uq.laboratory.records import facts, tables
from cmm_uq.laboratory.records.facts import ChainFinding, Entry, called, spelled
from cmm_uq.laboratory.records.tables import INDEX, artefacts, certificates, entries, machines

if TYPE_CHECKING:
    from cmm_uq.laboratory.records.store import Records

Row = dict[str, Any]
STATE_AFTER = {"withdrawal": "withdrawn", "replacement": "replaced"}
_FILLED = ("calibrate", *facts.OF_CERTIFICATE)  # columns that an older entry fills where they are empty
MOST = 1000  # findings after which no more are looked for
_BLOCK = 5000  # entries that are read or written together


class Indexer:
    """Adds the rows of entries, one after the other; :meth:`flush` writes them."""

    def __init__(self, connection: Connection) -> None:
        self.connection = connection
        self._rows: dict[Table, list[Row]] = {table: [] for table in INDEX}
        self._recognised: dict[Table, dict[str, Row]] = {machines: {}, artefacts: {}}
        self._called: set[str] = set()  # names of machines that are new
        self._same: dict[str, dict[int, Row]] = {}  # machines of one serial number, by the numbers of their rows
        self._quantities: dict[tuple[str, str, str], int] = {}
        self._certificates: dict[int, Row] = {}
        self._counts: dict[Table, int] = {}
        self._adjusted: set[tuple[int, str]] = set()

    def all(self, new: Iterable[Entry], *, chain: bool) -> list[Entry]:
        """Write the rows of entries, block by block, and with ``chain`` the entries themselves."""
        added: list[Entry] = []
        written = 0
        for entry in new:
            self.add(entry)
            added.append(entry)
            if len(added) - written == _BLOCK:
                self._block(added[written:], chain=chain)
                written = len(added)
        self._block(added[written:], chain=chain)
        return added

    def _block(self, block: list[Entry], *, chain: bool) -> None:
        if chain and block:
            rows = [{name: getattr(entry, name) for name in Entry.__slots__} for entry in block]
            self.connection.execute(insert(entries), rows)
        self.flush()

    def add(self, entry: Entry) -> None:
        """Add what an entry says."""
        data, day = entry.data, entry.at[:10]
        try:
            if entry.kind in facts.CERTIFIED:
                self._certificate(entry, data)
            elif entry.kind == "machine":
                self._machine(data, str(data.get("day") or day), entry.number)
            elif entry.kind == "artefact":
                self._artefact(data, str(data.get("kind") or ""), str(data.get("day") or day), entry.number)
            elif entry.kind == "adjustment":
                self._adjustment(self._machine(data["machine"], "", entry.number), data["day"], entry.number)
            elif entry.kind in ("release", "withdrawal", "replacement"):
                self._signature(entry, data)
        except (KeyError, TypeError, ValueError, AttributeError, OverflowError) as error:
            raise CmmUqError(f"cannot be recorded as {entry.kind}: {error!r} is missing or no such thing",
                             where=f"entry {entry.number}") from error  # fmt: skip

    def flush(self) -> None:
        for table, rows in self._rows.items():
            if rows:
                try:
                    self.connection.execute(insert(table), rows)
                except OverflowError as error:  # SQLite takes no integer of more than 64 bits
                    fix = "cmm-uq records verify says which entry"
                    raise CmmUqError(
                        "a number in an entry is too large", where=f"table {table.name}", fix=fix
                    ) from error
                self._rows[table] = []
        self._certificates.clear()

    def _certificate(self, entry: Entry, data: Mapping[str, Any]) -> None:
        day, used, since = str(data["day"]), data.get("artefact") or {}, data.get("adjusted_since")
        command = data.get("command", "report")
        of_part = command == facts.PART
        machine = self._machine(data["machine"], "" if of_part else day, entry.number, of_part=of_part)
        artefact = self._artefact(used, str(data["kind"]), day, entry.number)
        if since:
            self._adjustment(machine, since, entry.number)
        row = {
            "entry": entry.number, "machine": machine, "artefact": artefact, "command": command,
            "job": data["job"], "number": data.get("number") or data["job"], "kind": data["kind"],
            "origin": data["origin"], "day": day, "at": entry.at, "adjusted_since": since or None, "state": "draft",
            "decision": data.get("decision") or "none", "diagnosis": data.get("diagnosis") or "",
            "interim": bool(data.get("interim")) or entry.kind == "check", "folder": data.get("folder") or "",
            "version": data.get("version") or "", "results_sha256": data.get("results_sha256") or "",
            "artefact_due": used.get("due") or None,
        }  # fmt: skip
        self._rows[certificates].append(row)
        self._certificates[entry.number] = row
        names = ("value", "u", "lower", "upper", "u_artefact", "at_most")
        self._rows[tables.figures] += [
            {"certificate": entry.number, "place": place, "quantity": self._quantity((name, quantity, unit)),
             **dict(zip(names, stated, strict=True))}
            for place, (name, quantity, unit, *stated) in enumerate(data.get("values") or ())
        ]  # fmt: skip
        if together := data.get("covariance"):
            names_of = json.dumps(together["names"], ensure_ascii=False)
            row = {"certificate": entry.number, "names": names_of, "lower": json.dumps(together["lower"])}
            self._rows[tables.covariances].append(row)

    def _machine(self, said: Mapping[str, Any], day: str, entry: int, *, of_part: bool = False) -> int:
        """Of a part's report, which knows no manufacturer, the one machine that is called so."""
        names = ("name", "manufacturer", "model", "place")
        row: Row = {name: text for name in names if (text := called(said, name))}  # what is not said changes nothing
        if "name" in row:
            row["named"] = spelled(row["name"])
        if said.get("calibrate"):
            row["calibrate"] = json.dumps(said["calibrate"], sort_keys=True)

        def first() -> Row:
            known = {"called": self._name_of(said), "spelled": own}
            return {**dict.fromkeys(("named", *names), ""), "calibrate": None, **known}

        own, key = spelled(called(said, "serial", "name")), facts.machine_key(said)
        known = self._known(machines, key)
        alike = known or self._alike(own, row.get("named", ""), of_part=of_part)
        if alike is not None and of_part:
            return int(alike["id"])
        if alike is not None and known is None:
            self._change(machines, alike, {"recognised": key})  # it is of the records from now on
        return self._thing(machines, f"{facts.BY_PART}{key}" if of_part else key, row, first, day, entry)

    def _alike(self, own: str, named: str, *, of_part: bool) -> Row | None:
        """The one machine of that serial number, of several that of the name; without ``of_part`` of those of parts alone."""
        if (found := self._same.get(own)) is None:
            query = select(machines).where(machines.c.spelled == own)
            stored = self.connection.execute(query).mappings()  # all: none is made before this is asked
            found = self._same[own] = {row["id"]: dict(row) for row in stored}
        rows = [row for row in found.values() if of_part or row["recognised"].startswith(facts.BY_PART)]
        rows = [row for row in rows if row["named"] == named] if len(found) > 1 else rows
        return rows[0] if len(rows) == 1 else None

    def _name_of(self, said: Mapping[str, Any]) -> str:
        """As it is asked for: its serial, and where another has the same, what tells them apart behind it."""
        name = called(said, "serial", "name") or "unnamed"
        further = (called(said, "manufacturer", "name") or "other", *range(2, 100))
        for candidate in (name, *(f"{name} ({end})" for end in further)):
            there = select(machines.c.called).where(machines.c.called == candidate)
            if candidate not in self._called and not self.connection.execute(there).first():
                self._called.add(candidate)
                return candidate
        raise ValueError(name)

    def _artefact(self, said: Mapping[str, Any], kind: str, day: str, entry: int) -> int | None:
        if not (key := facts.artefact_key(said)):
            return None
        known = self._known(artefacts, key) or {}
        own: Row = {name: called(said, name) for name in ("certificate", "laboratory")}
        own |= {name: said.get(name) or None for name in ("calibrated", "due")}
        after = facts.certificate_after(known, own)
        # what an older entry says of the same certificate, and no newer one does
        if known and day < known["day"] and facts.another_certificate(known, own):
            after = {}
        texts = {name: after[name] or "" for name in ("certificate", "laboratory") if after}
        row: Row = {"kind": kind, **after, **texts}
        return self._thing(artefacts, key, row, lambda: {"called": called(said, "serial", "certificate", "name")}, day,
                           entry)  # fmt: skip

    def _thing(self, table: Table, key: str, said: Row, first: Callable[[], Row], day: str, entry: int) -> int:
        """Number of the row that is recognised by a key: made, or changed by what is no older than the row.

        What is older says of rule and certificate what nobody said since.
        """
        row = self._known(table, key)
        if row is None:
            row = {"id": self._next(table), "recognised": key, **first(), **said, "day": day, "entry": entry}
            self._rows[table].append(row)
        elif changed := {
            name: value for name, value in said.items()
            if value != row[name] and (day >= row["day"] or (not row[name] and name in _FILLED))
        }:  # fmt: skip
            self._change(table, row, changed | ({"day": day, "entry": entry} if day >= row["day"] else {}))
        self._remember(table, row)
        return int(row["id"])

    def _remember(self, table: Table, row: Row) -> None:
        self._recognised[table][row["recognised"]] = row
        if table is machines and row["spelled"] in self._same:
            self._same[row["spelled"]][row["id"]] = row

    def _known(self, table: Table, key: str) -> Row | None:
        return self._recognised[table].get(key) or self._stored(table, table.c.recognised == key)

    def _change(self, table: Table, row: Row, changed: Row) -> None:
        row.update(changed)
        self._remember(table, row)
        waiting = self._rows[table]
        if not waiting or row["id"] < waiting[0]["id"]:  # it is written already: rows are numbered as they come
            self.connection.execute(update(table).where(table.c.id == row["id"]).values(**changed))

    def _adjustment(self, machine: int, day: str, entry: int) -> None:
        c = tables.adjustments.c
        there = select(c.entry).where(c.machine == machine, c.day == day)
        if (machine, day) in self._adjusted or self.connection.execute(there).first():
            return
        self._adjusted.add((machine, day))
        self._rows[tables.adjustments].append({"machine": machine, "day": day, "entry": entry})

    def _signature(self, entry: Entry, data: Mapping[str, Any]) -> None:
        number = int(data["certificate"])
        row = self._certificates.get(number) or self._stored(certificates, certificates.c.entry == number)
        if row is None:
            raise ValueError(f"certificate {number}")
        # why, and what was said of a certificate that states no pass
        despite = f"{data['outcome']}: {data['despite']}" if data.get("despite") else ""
        self._rows[tables.signatures].append({
            "entry": entry.number, "certificate": number, "what": entry.kind, "by": data["by"],
            "reason": "; ".join(filter(None, (data.get("reason"), despite))), "at": entry.at,
            "replaced_by": data.get("replaced_by"),
        })  # fmt: skip
        state = STATE_AFTER.get(entry.kind, "released" if data.get("complete", True) else row["state"])
        if state == "released" and row["state"] not in facts.STANDING:
            raise ValueError(f"the certificate {number}, {row['state']},")
        if number in self._certificates:
            row["state"] = state
        else:
            self.connection.execute(update(certificates).where(certificates.c.entry == number).values(state=state))

    def _quantity(self, key: tuple[str, str, str]) -> int:
        if key not in self._quantities:
            c = tables.quantities.c
            there = select(c.id).where(c.name == key[0], c.quantity == key[1], c.unit == key[2])
            number = self.connection.execute(there).scalar()
            if number is None:
                number = self._next(tables.quantities)
                self._rows[tables.quantities].append(dict(zip(c.keys(), (number, *key), strict=True)))
            self._quantities[key] = number
        return self._quantities[key]

    def _stored(self, table: Table, where: ColumnElement[bool]) -> Row | None:
        found = self.connection.execute(select(table).where(where)).mappings().first()
        return None if found is None else dict(found)

    def _next(self, table: Table) -> int:
        if table not in self._counts:
            self._counts[table] = self.connection.execute(select(func.coalesce(func.max(table.c.id), 0))).scalar_one()
        self._counts[table] += 1
        return self._counts[table]


def in_blocks(block: Callable[[int], list[Entry]], first: int = 1) -> Iterator[Entry]:
    """All entries from a number on, read by a function that gives those from a number on, as many as belong together."""
    while found := block(first):
        yield from found
        first = found[-1].number + 1


def entry_block(connection: Connection, first: int, kind: str | None = None) -> list[Entry]:
    """Entries from a number on, of one kind or all, as many as are read together."""
    query = select(entries).where(entries.c.number >= first).order_by(entries.c.number).limit(_BLOCK)
    return [Entry(*row) for row in connection.execute(query if kind is None else query.where(entries.c.kind == kind))]


def verified(records: Records, head: str | None, *, files: bool) -> list[ChainFinding]:
    """What is wrong; see :meth:`cmm_uq.laboratory.records.store.Records.verify`."""
    with records.reading() as connection:  # one transaction: one state, whoever writes meanwhile
        found = chain(connection, head)
        broken = any(finding.kind == "chain" for finding in found)
        schema = list(tables.schema_findings(connection))
        if not broken and not any(finding.problem.startswith(_UNREADABLE) for finding in schema):
            found += _tables(connection)
        found += schema
        if files and not any(finding.kind == "chain" for finding in found):
            found += _files(connection, records.home)
    return found[:MOST]


_UNREADABLE = ("the table ", "the column ")  # what begins a finding that rows cannot be compared beside
_CLOCKS = dt.timedelta(minutes=10)  # by which the clocks of several computers may differ


def chain(connection: Connection, head: str | None = None) -> list[ChainFinding]:
    """What is wrong with the entries by themselves, and with the clock that they were written by."""
    found: list[ChainFinding] = []
    clocks: list[ChainFinding] = []
    before: dt.datetime | None = None
    number, previous, met = 0, facts.BEGINNING, head is None
    for entry in in_blocks(partial(entry_block, connection)):
        if entry.number != number + 1:
            one = entry.number == number + 2
            gap = f"entry {number + 1} is" if one else f"entries {number + 1} to {entry.number - 1} are"
            found.append(ChainFinding("chain", f"{gap} missing", number + 1))
        elif entry.previous != previous:
            found.append(ChainFinding("chain", "does not follow the entry before it", entry.number))
        if not entry.true:
            found.append(ChainFinding("chain", "was altered", entry.number))
        elif (moment := facts.instant(entry.at)) is None:
            found.append(ChainFinding("chain", f"is of no time: {entry.at!r}", entry.number))
        else:
            if before is not None and moment < before - _CLOCKS and len(clocks) < MOST:
                problem = f"is of {entry.at}, and the entry before it of {facts.moment_of(before)}: a clock was wrong"
                clocks.append(ChainFinding("clock", problem, entry.number))
            before = moment
        number, previous, met = entry.number, entry.hash, met or entry.hash == head
        if len(found) >= MOST:
            return found
    if not met:
        problem = f"no entry has the hash {head}: the last are missing, or all were written anew"
        found.append(ChainFinding("chain", problem))
    return [*found, *clocks]


def rebuild(connection: Connection) -> None:
    """Make the tables that follow from the entries again, in a transaction that writes."""
    for table in reversed(INDEX):
        connection.execute(delete(table))
    Indexer(connection).all(in_blocks(partial(entry_block, connection)), chain=False)


def _tables(connection: Connection) -> list[ChainFinding]:
    """Rows that are not what the entries say."""
    engine = create_engine("sqlite://", poolclass=StaticPool)
    event.listen(engine, "connect", lambda raw, _: raw.execute("PRAGMA foreign_keys = OFF"))
    try:
        tables.META.create_all(engine, tables=list(INDEX))
        with engine.connect() as fresh:
            try:
                Indexer(fresh).all(in_blocks(partial(entry_block, connection)), chain=False)
            except CmmUqError as error:
                return [ChainFinding("index", str(error))]
            return [finding for table in INDEX for finding in _compared(table, connection, fresh)][:MOST]
    finally:
        engine.dispose()


def _compared(table: Table, stored: Connection, fresh: Connection) -> Iterator[ChainFinding]:
    about = next((name for name in ("entry", "certificate") if name in table.c), None)
    for there, wanted in zip_longest(_rows(table, stored), _rows(table, fresh)):
        if there != wanted:
            row: Any = dict(zip(table.c.keys(), wanted or there, strict=True))
            number = row[about] if about else None
            yield ChainFinding("index", f"the table {table.name} is not what the entries say", number)
            return  # after a row that is too many or missing every one would differ


def _rows(table: Table, connection: Connection) -> Iterator[tuple[Any, ...]]:
    query = select(table).order_by(*table.primary_key.columns)
    for block in connection.execute(query).partitions(_BLOCK):
        yield from (tuple(row) for row in block)


def _files(connection: Connection, home: Path | None) -> list[ChainFinding]:
    """Files of the newest set in each folder that were altered, and what is not there any more."""
    c, retained = certificates.c, select(entries).where(entries.c.kind == "retained")
    removed = {int(one) for row in connection.execute(retained) for one in Entry(*row).data.get("certificates", ())}
    rows = connection.execute(select(c.folder, c.entry, c.results_sha256).order_by(c.entry))
    newest = {folder: (entry, results) for folder, entry, results in rows if folder}
    found: list[ChainFinding] = []
    for folder, (entry, results) in newest.items():
        if entry not in removed and len(found) < MOST:
            found += _of_folder(home / folder if home else Path(folder), entry, results)
    return found


def _of_folder(folder: Path, entry: int, results: str) -> Iterator[ChainFinding]:
    digest = sha256_of(folder / "results.json")
    if digest is None:
        yield ChainFinding("missing", f"{folder} does not hold its results.json any more", entry)
        return
    if digest != results:
        yield ChainFinding("file", f"{folder / 'results.json'} is not what was recorded", entry)
    manifest = read_manifest(folder)
    for name, wanted in (manifest.files if manifest else {}).items():
        if name != "results.json" and sha256_of(folder / name) != wanted:
            yield ChainFinding("file", f"{folder / name} was altered or removed", entry)
