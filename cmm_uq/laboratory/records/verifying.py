"""Everything compared with the chain: entries with each other, tables with entries, files with what was recorded of them."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import zip_longest
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sqlalchemy import Connection, Table, create_engine, delete, event, select
from sqlalchemy.pool import StaticPool

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.output import read_manifest, sha256_of
from cmm_uq.laboratory.records.entries import BEGINNING, Entry
from cmm_uq.laboratory.records.facts import ChainFinding
from cmm_uq.laboratory.records.indexing import Indexer
from cmm_uq.laboratory.records.tables import INDEX, META, certificates, entries

if TYPE_CHECKING:
    from cmm_uq.laboratory.records.store import Records

MOST = 1000  # findings after which no more are looked for
_BLOCK = 2000


def verified(records: Records, head: str | None, *, files: bool) -> list[ChainFinding]:
    """What is wrong; see :meth:`cmm_uq.laboratory.records.store.Records.verify`."""
    with records.reading() as connection:  # one transaction: one state, whoever writes meanwhile
        found = chain(connection, head)
        if not found:
            found += _tables(connection)
        if files and not any(finding.kind == "chain" for finding in found):
            found += _files(connection, records.home)
    return found[:MOST]


def chain(connection: Connection, head: str | None = None) -> list[ChainFinding]:
    """What is wrong with the entries by themselves."""
    found: list[ChainFinding] = []
    number, previous, met = 0, BEGINNING, head is None
    for entry in _entries(connection):
        if entry.number != number + 1:
            one = entry.number == number + 2
            gap = f"entry {number + 1} is" if one else f"entries {number + 1} to {entry.number - 1} are"
            found.append(ChainFinding("chain", f"{gap} missing", number + 1))
        elif entry.previous != previous:
            found.append(ChainFinding("chain", "does not follow the entry before it", entry.number))
        if not entry.true:
            found.append(ChainFinding("chain", "was altered", entry.number))
        number, previous, met = entry.number, entry.hash, met or entry.hash == head
        if len(found) >= MOST:
            return found
    if not met:
        problem = f"no entry has the hash {head}: the last are missing, or all were written anew"
        found.append(ChainFinding("chain", problem))
    return found


def rebuild(connection: Connection) -> None:
    """Make the tables that follow from the entries again, in a transaction that writes."""
    for table in reversed(INDEX):
        connection.execute(delete(table))
    _index(connection, connection)


def _index(source: Connection, target: Connection) -> None:
    indexer = Indexer(target)
    for count, entry in enumerate(_entries(source), 1):
        indexer.add(entry)
        if count % _BLOCK == 0:
            indexer.flush()
    indexer.flush()


def _entries(connection: Connection) -> Iterator[Entry]:
    number = 0
    while True:
        query = select(entries).where(entries.c.number > number).order_by(entries.c.number).limit(_BLOCK)
        rows = connection.execute(query).all()
        yield from (Entry(*row) for row in rows)
        if len(rows) < _BLOCK:
            return
        number = rows[-1].number


def _tables(connection: Connection) -> list[ChainFinding]:
    """Rows that are not what the entries say."""
    engine = create_engine("sqlite://", poolclass=StaticPool)
    event.listen(engine, "connect", lambda raw, _: raw.execute("PRAGMA foreign_keys = OFF"))
    try:
        META.create_all(engine, tables=list(INDEX))
        with engine.connect() as fresh:
            try:
                _index(connection, fresh)
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
