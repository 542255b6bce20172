"""What a database refuses, in one line of words."""

from __future__ import annotations

import contextlib
import sqlite3
from collections.abc import Iterator
from pathlib import Path

from cmm_uq.base.errors import CmmUqError, OutputError
from cmm_uq.laboratory.records.place import shown


@contextlib.contextmanager
def told(place: str | Path) -> Iterator[None]:
    """What a database refuses, in one line.

    Raises
    ------
    CmmUqError : it is damaged, locked, or no database.
    OutputError : it cannot be written to, or not be reached.
    """
    from sqlalchemy.exc import DBAPIError, SQLAlchemyError

    try:
        yield
    except DBAPIError as error:
        raise _in_words(str(error.orig), shown(place)) from error
    except SQLAlchemyError as error:
        raise OutputError(f"the database fails: {_first_line(str(error))}", where=shown(place)) from error
    except sqlite3.Error as error:
        raise _in_words(str(error), shown(place)) from error


_WORDS: tuple[tuple[str, str, str, type[CmmUqError]], ...] = (
    ("database is locked", "another program keeps the records locked", "Wait until it is done, or end it", OutputError),
    ("readonly", "the records cannot be written to", "Mend the permissions of the file and its folder", OutputError),
    ("read-only transaction", "the records were opened to be read only", "Name others with --records", OutputError),
    ("disk is full", "the disk of the records is full", "Free it; nothing was recorded", OutputError),
    ("disk I/O error", "the disk of the records fails", "Free or mend it; nothing was recorded", OutputError),
    ("unable to open", "cannot be opened", "Mend the permissions of the file and its folder", OutputError),
    (
        "connection failed",
        "the server of the records cannot be reached",
        "Start it, or mend host and port",
        OutputError,
    ),
    ("connection to server", "the server of the records cannot be reached", "Start it, or mend the URL", OutputError),
    ("password", "the server of the records refuses the login", "Mend user and password", OutputError),
    ("not a database", "is no database", "Name the file of the records, or restore a backup", CmmUqError),
    (
        "decode to UTF-8",
        "a text in the records is none any more",
        "Restore a backup: cmm-uq records restore FILE",
        CmmUqError,
    ),
    ("malformed", "the file of the records is damaged", "Restore a backup: cmm-uq records restore FILE", CmmUqError),
    ("never changed", "entries are never changed", "Record what is right as a new entry", CmmUqError),
    ("no such table", "tables of the records are missing", "Restore a backup: cmm-uq records restore FILE", CmmUqError),
)


def _in_words(problem: str, where: str) -> CmmUqError:
    for sign, words, fix, error in _WORDS:
        if sign in problem:
            return error(words, where=where, fix=fix)
    return OutputError(f"the database fails: {_first_line(problem)}", where=where, fix="Mend it, or name other records")


def _first_line(text: str) -> str:
    return text.strip().partition("\n")[0]
