"""Where the records are: a file, or the URL of a database."""

from __future__ import annotations

import os
from pathlib import Path

APPLICATION = 0x434D4D55
"""``application_id`` of the SQLite file: CMMU."""

ENVIRONMENT = "CMM_UQ_RECORDS"
"""Variable that names the records where no option does."""

NONE = "none"
"""In place of a file or URL: no records."""

FILE = "records.db"

DEFAULT = Path("reports") / FILE
"""Beside the folders of the reports."""


def is_url(where: str | Path) -> bool:
    """Whether it is the URL of a database, and no file."""
    return "://" in str(where)


def place_of(where: str | Path | None, default: Path = DEFAULT) -> str | Path | None:
    """The records that an option names, else the environment, else the default; ``None`` where there are to be none.

    Parameters
    ----------
    where : the option.
    default : a file.
    """
    given = where if where is not None and str(where) else os.environ.get(ENVIRONMENT) or default
    if str(given) == NONE:
        return None
    return str(given) if is_url(given) else Path(given)


def beside(folder: Path) -> Path:
    """The records beside a report's folder."""
    return folder.parent / FILE


def shown(where: str | Path) -> str:
    """For messages: a URL without its password."""
    text = str(where)
    if not is_url(text):
        return text
    scheme, _, rest = text.partition("://")
    login, at, host = rest.rpartition("@")
    return f"{scheme}://{login.partition(':')[0]}{at}{host.partition('?')[0]}"
