"""When machines are due: asked of a callable, so that this room knows no statistics.

Whoever serves says how due dates are found; without that, a fixed interval after the newest certificate, said to be so.
"""

from __future__ import annotations

import calendar
import datetime as dt
from collections.abc import Mapping, Sequence
from typing import NamedTuple, Protocol

from cmm_uq.messages import Text, number, say
from cmm_uq.records.listing import Newest
from cmm_uq.records.store import Records

MONTHS = 12
"""Of the interval where nothing else is known."""

SOON = dt.timedelta(days=60)
"""What is due within it is shown before it is late."""


class Due(NamedTuple):
    """When a machine is due.

    Parameters
    ----------
    day : on which; ``None`` where no rule gives one.
    why : the rule, a few words.
    """

    day: dt.date | None
    why: Text


class DueDates(Protocol):
    """Finds due dates of all machines at once."""

    def __call__(self, records: Records, newest: Sequence[Newest], today: dt.date) -> Mapping[str, Due]:
        """Due dates by serial; a machine that is not in it has none.

        Parameters
        ----------
        records : open, to be read.
        newest : of each machine.
        today : the day for which they are asked.
        """


class FixedInterval:
    """So many months after the newest certificate.

    Parameters
    ----------
    months : of the interval.
    """

    def __init__(self, months: int = MONTHS) -> None:
        self.months = months

    def __call__(self, records: Records, newest: Sequence[Newest], today: dt.date) -> Mapping[str, Due]:
        """See :class:`DueDates`."""
        why = say("{months} months after its newest certificate", months=number(self.months))
        return {one.machine.serial: Due(months_after(one.certificate.day, self.months), why)
                for one in newest if one.certificate is not None}  # fmt: skip


def months_after(day: dt.date, months: int) -> dt.date:
    """The same day of a later month, or its last one.

    Examples
    --------
    >>> months_after(dt.date(2026, 1, 31), 13)
    datetime.date(2027, 2, 28)
    """
    years, month = divmod(day.month - 1 + months, 12)
    year = day.year + years
    last = 28 if day.day <= 28 else calendar.monthrange(year, month + 1)[1]
    return dt.date(year, month + 1, min(day.day, last))
