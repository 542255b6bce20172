"""The records of a scheduled run: opened so that they can be written, and asked what is due."""

from __future__ import annotations

import contextlib
import datetime as dt
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from cmm_uq.app.commands.due import due_in
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Verbatim
from cmm_uq.laboratory.due.history import machine_history
from cmm_uq.laboratory.records.place import is_url
from cmm_uq.laboratory.schedule.notices import Notice, of_drift, of_due

if TYPE_CHECKING:
    from cmm_uq.laboratory.records.store import Records

_AHEAD = dt.timedelta(days=1)
"""By how much the newest entry may be of the future: clocks of two computers differ, and so do their zones."""


@contextlib.contextmanager
def opened(place: str | Path | None, *, dry: bool) -> Iterator[Records | None]:
    """The records, made where there are none; ``None`` where there are to be none, or a dry run would make them.

    Parameters
    ----------
    place : file or URL.
    dry : whether they are only read.

    Raises
    ------
    CmmUqError : they are another program's, or of another version.
    OutputError : they cannot be written to: better told before the first job than after each.
    """
    if place is None or (dry and not is_url(place) and not Path(place).exists()):
        yield None
        return
    from cmm_uq.laboratory.records.opening import open_records

    with open_records(place, create=not dry, read_only=dry) as records:
        if not dry:
            with records.writing():
                pass
        yield records


def due_notices(records: Records | None, on: dt.date, within: dt.timedelta) -> Iterable[Notice]:
    """What is to be calibrated soon, or should have been.

    Parameters
    ----------
    records : that say so; nothing is due without them.
    on : today.
    within : how long before its day something is told.

    Raises
    ------
    CmmUqError : the clock is behind the records.
    """
    if records is None:
        return
    _check_clock(records, on)
    if not records.head()[0]:
        return
    for one in due_in(records, (), on):
        if one.due is not None and one.due <= on + within:
            yield of_due(one.item, one.serial, one.due, on, one.why, beyond=one.beyond)


def drift_notices(records: Records | None, job: str, on: dt.date) -> Iterable[Notice]:
    """Whether a machine changed by more than chance since the recording before that of a job.

    Parameters
    ----------
    records : that hold both.
    job : id of the job that was recorded last.
    on : today.
    """
    newest = [] if records is None else records.certificates(job=job, limit=1, values=False)
    if records is None or not newest:
        return
    machine = records.machine(newest[-1].machine)
    history = machine_history(
        machine, records.certificates(machine.serial, values=False), records.series(machine.serial), on
    )
    changed = [Verbatim(one.series.quantity) for one in history.values if history.significant(one)
               and int(one.series.entry[-1]) == newest[-1].entry]  # fmt: skip
    if changed:
        yield of_drift(machine.serial, changed, newest[-1].entry)


def _check_clock(records: Records, on: dt.date) -> None:
    number, _ = records.head()
    if not number:
        return
    newest = dt.datetime.fromisoformat(next(records.entries(number)).at).date()
    if newest > on + _AHEAD:
        raise CmmUqError(f"the newest entry is of {newest}, and the clock says {on}: what is due is not said", where="records",
                         fix="Set the clock")  # fmt: skip
