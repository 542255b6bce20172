"""Where the records are, a file or the URL of a database, and what a database refuses, in one line of words."""

from __future__ import annotations

import contextlib
import json
import os
import sqlite3
from collections.abc import Iterator
from pathlib import Path

from cmm_uq.base.errors import CmmUqError, OutputError

APPLICATION = 0x434D4D55  # ``application_id`` of the SQLite file: CMMU
ENVIRONMENT = "CMM_UQ_RECORDS"  # variable that names the records where no option does
NONE = "none"  # in place of a file or URL: no records
FILE = "records.db"
DEFAULT = Path("reports") / FILE  # of the working folder


def is_url(where: str | Path) -> bool:
    """Whether it is the URL of a database, and no file."""
    return "://" in str(where)


def place_of(where: str | Path | None, default: Path = DEFAULT) -> str | Path | None:
    """The records that an option names, else the environment, else the default; ``None`` where there are to be none."""
    given = where if where is not None and str(where) else os.environ.get(ENVIRONMENT) or default
    if str(given) == NONE:
        return None
    return str(given) if is_url(given) else Path(given)


def beside(folder: Path) -> Path:
    """The records beside a report's folder."""
    return folder.parent / FILE


def of_folder(out: Path | None) -> Path:
    """The records of a report, wherever it is written to: ``reports/records.db`` of the working folder.

    Those beside its folder, which versions up to 0.15 made, go on where they are there; else they are only made where nothing
    can be written in the working folder.
    """
    if out is None:
        return DEFAULT
    former, there = beside(out.absolute()), next(path for path in (DEFAULT, *DEFAULT.parents) if path.exists())
    return former if former.is_file() or not os.access(there, os.W_OK) else DEFAULT


def shown(where: str | Path) -> str:
    """For messages: a URL without its password."""
    text = str(where)
    if not is_url(text):
        return text
    scheme, _, rest = text.partition("://")
    login, at, host = rest.rpartition("@")
    return f"{scheme}://{login.partition(':')[0]}{at}{host.partition('?')[0]}"


@contextlib.contextmanager
def told(place: str | Path, *, rows: bool = False) -> Iterator[None]:
    """What a database refuses, in one line; ``rows``: and that what is read of it is not what records write."""
    from sqlalchemy.exc import DBAPIError, SQLAlchemyError

    try:
        yield
    except DBAPIError as error:
        raise _in_words(str(error.orig), shown(place)) from error
    except SQLAlchemyError as error:
        raise OutputError(f"the database fails: {_first_line(str(error))}", where=shown(place)) from error
    except sqlite3.Error as error:
        raise _in_words(str(error), shown(place)) from error
    except (json.JSONDecodeError, RecursionError) as error:  # altered, perhaps to thousands of lists in each other
        fix = "cmm-uq records verify says which entry"
        raise CmmUqError("an entry is not as it was recorded: it is no JSON", where=shown(place), fix=fix) from error
    except (ValueError, TypeError, LookupError, AttributeError, ArithmeticError) as error:
        if not rows:
            raise
        fix = "cmm-uq records verify says which entry; where it finds them sound, please report it"
        raise CmmUqError("a row is not as it was recorded", where=shown(place), fix=fix) from error


_MEND, _RESTORE = "Mend the permissions of the file and its folder", "Restore a backup: cmm-uq records restore FILE"
_NO_SERVER = "the server of the records cannot be reached"
_WORDS: tuple[tuple[str, str, str, type[CmmUqError]], ...] = (
    ("database is locked", "another program keeps the records locked", "Wait until it is done, or end it", OutputError),
    ("readonly", "the records cannot be written to", _MEND, OutputError),
    ("read-only transaction", "the records were opened to be read only", "Name others with --records", OutputError),
    ("disk is full", "the disk of the records is full", "Free it; nothing was recorded", OutputError),
    ("disk I/O error", "the disk of the records fails", "Free or mend it; nothing was recorded", OutputError),
    ("unable to open", "cannot be opened", _MEND, OutputError),
    ("connection failed", _NO_SERVER, "Start it, or mend host and port", OutputError),
    ("connection to server", _NO_SERVER, "Start it, or mend the URL", OutputError),
    ("password", "the server of the records refuses the login", "Mend user and password", OutputError),
    ("not a database", "is no database", "Name the file of the records, or restore a backup", CmmUqError),
    ("decode to UTF-8", "a text in the records is none any more", _RESTORE, CmmUqError),
    ("malformed", "the file of the records is damaged", _RESTORE, CmmUqError),
    ("never changed", "entries are never changed", "Record what is right as a new entry", CmmUqError),
    ("no such table", "tables of the records are missing", _RESTORE, CmmUqError),
)


def _in_words(problem: str, where: str) -> CmmUqError:
    for sign, words, fix, error in _WORDS:
        if sign in problem:
            return error(words, where=where, fix=fix)
    return OutputError(f"the database fails: {_first_line(problem)}", where=where, fix="Mend it, or name other records")


def _first_line(text: str) -> str:
    return text.strip().partition("\n")[0]
