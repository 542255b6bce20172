"""Records as a whole: backed up and checked, restored over nothing that still holds, brought to the newest tables."""

from __future__ import annotations

import contextlib
import os
import shutil
import sqlite3
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from sqlalchemy import select, text

from cmm_uq.base.errors import CmmUqError, OutputError
from cmm_uq.base.output.manifest import writing_to
from cmm_uq.base.output.staging import synced
from cmm_uq.laboratory.records import indexing
from cmm_uq.laboratory.records.facts import Entry
from cmm_uq.laboratory.records.opening import KNOWN, REVISION, check_revision, engine_of, open_records, state_of
from cmm_uq.laboratory.records.place import is_url, shown, told
from cmm_uq.laboratory.records.tables import entries

if TYPE_CHECKING:
    from cmm_uq.laboratory.records.store import Records

ADDED = {
    "0002": ("ALTER TABLE certificates ADD COLUMN artefact_due VARCHAR(10)", "ALTER TABLE machines ADD COLUMN calibrate TEXT"),
    "0003": (),  # what a job leaves unsaid stays as it was
    "0004": (),  # reports of parts are among the certificates
}  # fmt: skip
"""What a revision adds to the tables that follow from the entries; what stands in them is then made again from these."""

_MENDED = "Free the disk, mend the permissions, or name another file"
KEPT = ".before-restore"  # what restored records are put in place of is kept under its name with this behind it


def back_up(records: Records, out: Path) -> tuple[int, str]:
    """Write all entries, and what follows, into a new SQLite file; number and hash of the last one."""
    if os.path.lexists(out):
        raise OutputError("is there already", where=str(out), fix="Name another file; nothing is overwritten")
    with _temporary(out) as path:
        if isinstance(records.place, Path):
            with told(records.place), _raw(records.place) as source, _raw(path) as target:
                source.backup(target)
                target.execute("PRAGMA journal_mode = DELETE")  # one file, without a journal beside it
        else:
            _copied(records, path)
        head = _checked(path)
        _in_place(path, out)
    return head


def restore(file: Path, place: str | Path) -> tuple[int, str]:
    """Make records of a backup; records that are there are kept beside them; number and hash of the last entry."""
    head = _checked(file)
    if is_url(place):
        with open_records(place, create=True) as server, open_records(file, read_only=True) as source:
            if server.head()[0]:
                raise CmmUqError("holds entries already", where=shown(place), fix="Restore into an empty database")
            with server.writing() as writing:
                writing.copy(source.entries())
        return head
    target = Path(place)
    if target.is_dir():
        raise CmmUqError("is a folder, and records are a file", where=str(target), fix="Name a file in it: records.db")
    with writing_to(target, _MENDED):
        target.parent.mkdir(parents=True, exist_ok=True)
    with _temporary(target) as path:
        with writing_to(target, _MENDED):
            shutil.copyfile(file, path)
        _set_aside(target)
        _in_place(path, target)
    with _raw(target) as raw:
        raw.execute("PRAGMA journal_mode = WAL")
    return head


def migrate(place: str | Path, *, to: str = REVISION) -> tuple[str, str]:
    """Bring records to a revision in one transaction that touches no entry; revision before, and after."""
    engine = engine_of(place)
    try:
        with told(place), engine.connect() as connection:
            before = state_of(connection)
        if before not in KNOWN:
            check_revision(before, place)
        if before != to:
            with told(place), engine.connect().execution_options(writing=True) as connection, connection.begin():
                for revision in KNOWN[KNOWN.index(before) + 1 : KNOWN.index(to) + 1]:
                    for statement in ADDED[revision]:
                        connection.exec_driver_sql(statement)
                indexing.rebuild(connection)
                connection.execute(text("UPDATE alembic_version SET version_num = :to"), {"to": to})
        return before, to
    finally:
        engine.dispose()


def _set_aside(target: Path) -> None:
    """Keep the present file, with all that is still in its journal."""
    if not target.exists():
        return
    kept, number = target.with_name(target.name + KEPT), 1
    while os.path.lexists(kept):
        number += 1
        kept = target.with_name(f"{target.name}{KEPT}-{number}")
    with writing_to(target, _MENDED):
        with contextlib.suppress(sqlite3.Error), _raw(target) as raw:
            raw.execute("PRAGMA wal_checkpoint(TRUNCATE)")
        for end in ("", "-wal", "-shm"):
            if os.path.lexists(f"{target}{end}"):
                Path(f"{target}{end}").rename(f"{kept}{end}")


def _checked(path: Path) -> tuple[int, str]:
    with open_records(path, read_only=True) as records:
        with told(path), records.engine.connect() as connection:
            found = [one for one in indexing.chain(connection) if one.kind == "chain"]
        if found:
            fix = "cmm-uq records verify says all; a backup with a broken chain is none"
            raise CmmUqError(f"entry {found[0].entry}: {found[0].problem}", where=str(path), fix=fix)
        return records.head()


def _copied(records: Records, path: Path) -> None:
    path.unlink()
    with (
        open_records(path, create=True) as made, made.writing() as writing, told(records.place),
        records.engine.connect() as source,
    ):  # fmt: skip
        rows = source.execution_options(yield_per=2000).execute(select(entries).order_by(entries.c.number))
        writing.copy(Entry(*row) for row in rows)
    with _raw(path) as raw:
        raw.execute("PRAGMA journal_mode = DELETE")


@contextlib.contextmanager
def _raw(path: Path) -> Iterator[sqlite3.Connection]:
    raw = sqlite3.connect(path, isolation_level=None)
    try:
        yield raw
    finally:
        raw.close()


@contextlib.contextmanager
def _temporary(out: Path) -> Iterator[Path]:
    """An empty file beside another, gone afterwards."""
    with writing_to(out, _MENDED):
        descriptor, name = tempfile.mkstemp(dir=out.absolute().parent, prefix=".unfinished-")
        os.close(descriptor)
    path = Path(name)
    try:
        with writing_to(out, _MENDED):
            yield path
    finally:
        for end in ("", "-wal", "-shm", "-journal"):
            Path(f"{path}{end}").unlink(missing_ok=True)


def _in_place(path: Path, out: Path) -> None:
    with path.open("rb+") as file:
        os.fsync(file.fileno())
    path.rename(out)
    synced(out.absolute().parent)
