"""The time of a signature: now, or ``SOURCE_DATE_EPOCH``, so that a signature can be made again to the byte."""

from __future__ import annotations

import datetime as dt
import os

from cmm_uq.base.errors import CmmUqError

EPOCH = "SOURCE_DATE_EPOCH"


def signing_time() -> dt.datetime:
    """Whole seconds, in UTC.

    Raises
    ------
    CmmUqError : the variable is no number of seconds since 1970.
    """
    given = os.environ.get(EPOCH, "")
    if not given:
        return dt.datetime.now(dt.UTC).replace(microsecond=0)
    try:
        return dt.datetime.fromtimestamp(int(given), dt.UTC)
    except (ValueError, OverflowError, OSError):
        raise CmmUqError(f"{given!r} is no number of seconds since 1970", where=EPOCH, fix="Mend or unset it") from None
