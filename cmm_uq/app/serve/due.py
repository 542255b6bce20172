"""When machines are due: by the rule of each, as ``cmm-uq due`` says it."""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable, Mapping
from typing import NamedTuple

from cmm_uq.app.commands.due import due_in
from cmm_uq.base.messages import Text
from cmm_uq.laboratory.records.store import Records

SOON = dt.timedelta(days=60)
"""What is due within it is shown before it is late."""


class Due(NamedTuple):
    """When a machine is due.

    Parameters
    ----------
    day : on which; ``None`` where no rule gives one.
    why : one sentence.
    beyond : whether its last certificate finds it beyond its limits: it is overdue from that day on.
    """

    day: dt.date | None
    why: Text
    beyond: bool = False


DueDates = Callable[[Records, dt.date], Mapping[str, Due]]
"""Due dates on a day, by serial; a machine that is not among them has none."""


def by_rule(records: Records, today: dt.date) -> dict[str, Due]:
    """Of all machines, each by its own rule, its interim checks and its adjustments.

    Parameters
    ----------
    records : open, to be read.
    today : the day for which they are asked.
    """
    found = due_in(records, (), today) if records.head()[0] else []
    return {one.serial: Due(one.due, one.why, one.beyond) for one in found if one.item == "machine"}
