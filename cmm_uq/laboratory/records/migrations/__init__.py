"""Revisions of the tables (Alembic): each brings records of the revision before it to its own, in one transaction.

Entries are never touched. A revision that changes what follows from them makes those tables again from the entries.
"""

from __future__ import annotations

import contextlib
import sqlite3
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from cmm_uq.laboratory.records.opening import KNOWN, REVISION, check_revision, engine_of, state_of
from cmm_uq.laboratory.records.place import told

if TYPE_CHECKING:
    from alembic.config import Config
    from sqlalchemy import Connection, Engine


def migrate(place: str | Path, *, to: str = REVISION) -> tuple[str, str]:
    """Bring records to a revision; revision before, and after."""
    engine = engine_of(place)
    try:
        with told(place), engine.connect() as connection:
            before = state_of(connection)
        if before not in KNOWN:
            check_revision(before, place)
        if before != to:
            with told(place), _transaction(engine) as connection:
                upgrade(connection, to)
        return before, to
    finally:
        engine.dispose()


def upgrade(connection: Connection, to: str = REVISION) -> None:
    """Run the revisions up to one, in the transaction of a connection."""
    from alembic import command

    command.upgrade(configuration(connection), to)


def configuration(connection: Connection) -> Config:
    from alembic.config import Config

    made = Config()
    made.set_main_option("script_location", str(Path(__file__).parent).replace("%", "%%"))
    made.attributes["connection"] = connection
    return made


@contextlib.contextmanager
def _transaction(engine: Engine) -> Iterator[Connection]:
    with engine.connect().execution_options(writing=True) as connection:
        raw = connection.connection.driver_connection
        if isinstance(raw, sqlite3.Connection):
            raw.execute("PRAGMA foreign_keys = OFF")  # tables are made anew under their old names
        with connection.begin():
            yield connection
