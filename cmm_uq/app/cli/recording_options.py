"""Options of the commands that read the records: where they are, and the day asked about."""

from __future__ import annotations

import datetime as dt
import re
from pathlib import Path
from typing import Annotated

import typer

from cmm_uq.base.errors import CmmUqError

Records = Annotated[
    str | None,
    typer.Option(
        "--records",
        help="The records: a file, or the URL of a PostgreSQL database.",
        metavar="WHERE",
        show_default="CMM_UQ_RECORDS, or reports/records.db",
    ),
]
On = Annotated[
    str | None,
    typer.Option(
        "--on", help="The day asked about; later recordings do not count.", metavar="DATE", show_default="today"
    ),
]

Fleet = Annotated[
    Path | None,
    typer.Option(
        "--fleet", help="fleet.json of the fleet that the drift model takes as prior.", metavar="FILE",
        show_default="a prior without a fleet",
    ),
]  # fmt: skip

_DAYS = {"d": 1, "w": 7, "m": 30, "y": 365}
_LONGEST = 36_500


def day_of(text: str | None) -> dt.date | None:
    """The day of ``--on``.

    Raises
    ------
    CmmUqError : it is no date.
    """
    if text is None:
        return None
    try:
        return dt.date.fromisoformat(text)
    except ValueError:
        raise CmmUqError(f"{text!r} is no date", where="--on", fix="Write it as 2026-11-22") from None


def time_of(text: str | None) -> dt.timedelta | None:
    """The time of ``--within``: a number of days, or one with d, w, m (30 days) or y (365 days) behind it.

    Raises
    ------
    CmmUqError : it is none.
    """
    if text is None:
        return None
    found = re.fullmatch(r"(\d{1,5})\s*([dwmy]?)", text.strip(), re.ASCII)
    days = int(found[1]) * _DAYS[found[2] or "d"] if found else _LONGEST + 1
    if days > _LONGEST:
        raise CmmUqError(f"{text!r} is no time", where="--within", fix="Write it as 90d, 12w, 3m or 1y")
    return dt.timedelta(days=days)
