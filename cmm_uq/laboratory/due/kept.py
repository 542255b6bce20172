"""What was found before of the same entries, in a file: intervals by drift, and the days on which machines are due."""

from __future__ import annotations

import datetime as dt
import json
import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from functools import cached_property
from pathlib import Path
from typing import Any

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.limits import TABLE_BYTES, content_of
from cmm_uq.laboratory.due.due import DueItem
from cmm_uq.laboratory.due.rule import Rule, program
from cmm_uq.laboratory.records.listing import changed_machines, unsettled_machines
from cmm_uq.laboratory.records.place import NONE
from cmm_uq.laboratory.records.store import Records

_PLACES = 10  # records of which days are kept
_WRONG = (CmmUqError, ValueError, TypeError, AttributeError, RuntimeError, KeyError)


def unsettled(records: Records, on: dt.date) -> set[str]:
    """Machines whose date may change though no entry speaks of them: with the day that is asked about, or by others."""
    return unsettled_machines(records, on, lambda said: Rule.of(said).pooled)


class KeptDates:
    """The file is ``CMM_UQ_DATES``, or ``~/.cache/cmm-uq/dates.json``, or ``none``; one that fails costs time alone."""

    def __init__(self) -> None:
        self._file = Path(os.environ.get("CMM_UQ_DATES") or "~/.cache/cmm-uq/dates.json")
        self._new: dict[str, dict[str, Any]] = {}
        self._own: dict[str, Any] | None = None
        self._unsettled: set[str] = set()

    @cached_property
    def _content(self) -> dict[str, dict[str, Any]]:
        found: dict[str, dict[str, Any]] = {"intervals": {}, "records": {}}
        with suppress(*_WRONG):
            if str(self._file) != NONE:
                read = json.loads(content_of(self._file.expanduser(), TABLE_BYTES, ""))
                found = {name: dict(read[name]) for name in found}
        return found

    @contextmanager
    def intervals(self) -> Iterator[None]:
        """Intervals by drift are those that were found of the same histories."""
        from cmm_uq.laboratory.due.intervals import KNOWN

        with suppress(*_WRONG):
            every = self._content["intervals"].items()
            KNOWN.update({key: (days, f"{name}", learnt is True) for key, (days, name, learnt) in every if days >= 0})
        before = len(KNOWN)
        yield
        if len(KNOWN) > before:
            self._new["intervals"] = KNOWN

    def near(self, records: Records, on: dt.date, last: int) -> set[str] | None:
        """Machines that may be due up to a day, by its ordinal, or of which nothing is known; ``None`` for all.

        What was found of a machine stands while no entry says anything of it, nothing of it is dated after the day that is
        asked about, and its rule takes nothing that others found.
        """
        kept, name = self._content["records"], records.shown
        self._own = {"program": program(), "head": list(records.head()), "days": {}}
        self._new["records"] = {**dict(list(kept.items())[-_PLACES:]), name: self._own}
        self._unsettled = unsettled(records, on)
        with suppress(*_WRONG):
            own = kept[name]
            changed = changed_machines(records, *own["head"]) if own["program"] == program() else None
            if changed is not None:
                self._own["days"] = days = {serial: int(day) for serial, day in own["days"].items()}
                return {*changed, *self._unsettled, *(serial for serial, day in days.items() if day <= last)}
        return None

    def write(self, found: Iterable[DueItem]) -> None:
        """Keep what is new, and the days of machines that were asked for because of :meth:`near`."""
        if self._own is not None:
            days = {one.serial: (one.due or dt.date.min).toordinal() for one in found}
            # what may be otherwise on another day, or by another machine, is never later than what is asked about
            self._own["days"] |= days | dict.fromkeys(self._unsettled, dt.date.min.toordinal())
        content = self._content | self._new if self._new else {}
        if not content or content == self._content or str(self._file) == NONE:
            return
        with suppress(OSError, RuntimeError):
            (file := self._file.expanduser()).parent.mkdir(parents=True, exist_ok=True)
            own = file.with_name(f"{file.name}.{os.getpid()}")
            try:
                own.write_text(json.dumps(content), encoding="utf-8")
                own.replace(file)
            finally:
                own.unlink(missing_ok=True)  # half of it, where the disk is full
