"""Opens records: found, made, recognised as this program's and of this version, with every refusal in words."""

from __future__ import annotations

import contextlib
import os
import sqlite3
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cmm_uq.base.errors import CmmUqError, OutputError
from cmm_uq.laboratory.records.place import APPLICATION, ENVIRONMENT, NONE, is_url, place_of, shown, told

if TYPE_CHECKING:
    from sqlalchemy import Connection, Engine

    from cmm_uq.laboratory.records.store import Records

PATIENCE_S = 15.0  # how long to wait for another process that writes
_TURNS = 150
REVISION = "0004"  # newest revision of the tables; see :func:`cmm_uq.laboratory.records.backup.migrate`
KNOWN = ("0001", "0002", "0003", "0004")  # all revisions, oldest first


def open_records(where: str | Path | None = None, *, create: bool = False, read_only: bool = False) -> Records:
    """Open the history.

    Parameters
    ----------
    where : SQLite file, or URL of a PostgreSQL database; ``None`` for what the environment names, else
        ``reports/records.db``.
    create : make it where there is none.
    read_only : nothing is written, not even what a crash left is completed.

    Returns
    -------
    the records; a context manager that closes them.

    Raises
    ------
    CmmUqError : there are none, or they are another program's, of a newer or older version, locked or damaged.
    OutputError : they cannot be written to.
    """
    from cmm_uq.laboratory.records.store import Records

    place = place_of(where)
    if place is None:
        raise CmmUqError("no records are asked for", where=f"--records {NONE}", fix="Name a file or a URL")
    engine = engine_of(place, create=create, read_only=read_only)
    records = Records(engine, place, read_only=read_only)
    try:
        with told(place), engine.connect() as connection:
            state = state_of(connection)
        if state == "" and create and not read_only:
            _make(records)
        else:
            check_revision(state, place)
        if not read_only:
            records.settle()
    except BaseException:
        records.close()
        raise
    return records


def engine_of(place: str | Path, *, create: bool = False, read_only: bool = False) -> Engine:
    return _server(str(place), read_only) if is_url(place) else _file(Path(place), create, read_only)


def _file(path: Path, create: bool, read_only: bool) -> Engine:
    from sqlalchemy import create_engine, event
    from sqlalchemy.pool import QueuePool

    _check_file(path, create)
    mode = "ro" if read_only else "rwc" if create else "rw"
    if read_only and not os.access(path.parent, os.W_OK):
        log, shared = (Path(f"{path}-{end}") for end in ("wal", "shm"))
        if not log.exists() or not log.stat().st_size:
            # without its -shm file a database in WAL mode can only be read as one that nobody writes
            mode = "ro&immutable=1"
        elif not shared.exists():
            problem, fix = f"newest entries are in {log.name} still", "Copy both into a folder that can be written to"
            raise CmmUqError(problem, where=str(path), fix=fix)
    uri = f"{path.absolute().as_uri()}?mode={mode}"

    def connect() -> sqlite3.Connection:
        made = sqlite3.connect(uri, uri=True, timeout=PATIENCE_S, isolation_level=None, check_same_thread=False)
        with contextlib.suppress(sqlite3.Error):  # what is wrong with the file is told when it is first read
            made.execute("PRAGMA foreign_keys = ON")
            made.execute("PRAGMA synchronous = FULL")
            made.execute("PRAGMA recursive_triggers = ON")
            made.execute("PRAGMA cache_size = -65536")  # in KiB: pages of the indexes of 10⁵ certificates
        return made

    engine = create_engine("sqlite://", creator=connect, poolclass=QueuePool)

    @event.listens_for(engine, "begin")
    def begin(connection: Connection) -> None:
        writing = connection.get_execution_options().get("writing")
        connection.exec_driver_sql("BEGIN IMMEDIATE" if writing else "BEGIN")

    return engine


def _check_file(path: Path, create: bool) -> None:
    """The file itself is not looked into: closing it would drop SQLite's locks of this process on it."""
    if os.path.isdir(path):  # noqa: PTH112 - raises nothing below a folder that is closed
        raise CmmUqError("is a folder, and records are a file", where=str(path), fix="Name a file in it: records.db")
    if os.path.exists(path) and not path.is_file():  # noqa: PTH110 - a pipe would be waited for; raises nothing
        raise CmmUqError("is no file, and records are one", where=str(path), fix="Name a file: records.db")
    try:
        if not path.exists():
            if not create:
                fix = f"Name them with --records or {ENVIRONMENT}, or begin them: cmm-uq records import FOLDER"
                raise CmmUqError("there are no records", where=str(path), fix=fix)
            path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"cannot be opened: {error.strerror}", where=str(path), fix="Mend the permissions") from error


def _server(url: str, read_only: bool) -> Engine:
    from sqlalchemy import create_engine
    from sqlalchemy.engine import make_url
    from sqlalchemy.exc import ArgumentError, NoSuchModuleError

    try:
        made = make_url(url)
        if made.get_backend_name() == "postgresql" and "+" not in made.drivername:
            made = made.set(drivername="postgresql+psycopg")
        if made.get_backend_name() != "postgresql":
            fix = "Name a file, or postgresql://…"
            raise CmmUqError(f"{made.get_backend_name()} is no database for records", where=shown(url), fix=fix)
        options: dict[str, Any] = {"connect_args": {"connect_timeout": 10}}
        if read_only:
            options["connect_args"]["options"] = "-c default_transaction_read_only=on"
        return create_engine(made, pool_pre_ping=True, **options)
    except ModuleNotFoundError as error:
        fix = 'pip install "cmm-uq[postgres]"'
        raise CmmUqError(f"the driver {error.name} is not installed", where=shown(url), fix=fix) from error
    except (ArgumentError, NoSuchModuleError, ValueError) as error:
        fix = "postgresql://USER@HOST/DATABASE, or a file"
        raise CmmUqError("is no URL of a database", where=shown(url), fix=fix) from error


def state_of(connection: Connection) -> str:
    """Revision of the tables; empty where there are none yet."""
    from sqlalchemy import inspect

    sqlite = connection.dialect.name == "sqlite"
    application = connection.exec_driver_sql("PRAGMA application_id").scalar() if sqlite else None
    names = set(inspect(connection).get_table_names())
    ours = application == APPLICATION if sqlite else {"entries", "alembic_version"} <= names
    if not names and application in (None, 0, APPLICATION):
        return ""
    if not ours or "alembic_version" not in names:
        named = [row[2] for row in connection.exec_driver_sql("PRAGMA database_list")] if sqlite else []
        where = next(iter(named), connection.engine.url.render_as_string(hide_password=True))
        fix = "Name another file or database for the records"
        raise CmmUqError("is the database of another program", where=where, fix=fix)
    return str(connection.exec_driver_sql("SELECT version_num FROM alembic_version").scalar() or "")


def check_revision(state: str, place: str | Path) -> None:
    """Refuse tables that this version does not know."""
    if state == REVISION:
        return
    if state == "":
        raise CmmUqError("holds no records", where=shown(place), fix="Begin them: cmm-uq records import FOLDER")
    if state in KNOWN:
        fix = "Back them up, then: cmm-uq records migrate"
        raise CmmUqError("the records are of an older version", where=shown(place), fix=fix)
    fix = "Update cmm-uq; nothing was changed"
    raise CmmUqError(f"the records are of a newer version (revision {state})", where=shown(place), fix=fix)


def _make(records: Records) -> None:
    from sqlalchemy import text

    from cmm_uq.laboratory.records.tables import META, TRIGGERS, versions

    engine = records.engine
    with told(records.place):
        if engine.dialect.name == "sqlite":
            with engine.connect() as connection:
                raw = connection.connection.driver_connection
                connection.rollback()
                if isinstance(raw, sqlite3.Connection):
                    _write_ahead(raw)  # not possible inside a transaction
        with engine.connect().execution_options(writing=True) as connection, connection.begin():
            if engine.dialect.name == "postgresql":
                connection.execute(text("SELECT pg_advisory_xact_lock(:key)"), {"key": APPLICATION})
            if state_of(connection):
                return  # another process was faster
            META.create_all(connection)
            for trigger in TRIGGERS[engine.dialect.name]:
                connection.exec_driver_sql(trigger)
            versions.create(connection)
            connection.execute(versions.insert(), {"version_num": REVISION})
            if engine.dialect.name == "sqlite":
                connection.exec_driver_sql(f"PRAGMA application_id = {APPLICATION}")


def _write_ahead(raw: sqlite3.Connection) -> None:
    """Journal in WAL mode; who makes the same file at the same moment is waited for, which SQLite does not do here."""
    for turn in range(_TURNS):
        try:
            raw.execute("PRAGMA journal_mode = WAL")
            return
        except sqlite3.OperationalError as error:
            if "locked" not in str(error) or turn == _TURNS - 1:
                raise
        time.sleep(PATIENCE_S / _TURNS)
