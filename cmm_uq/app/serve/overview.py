"""How every machine stands: overdue, due soon, not conforming, not released; the most urgent first."""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

from cmm_uq.app.commands.laboratory.due import due_in
from cmm_uq.app.serve.page import DECISIONS, VERDICTS
from cmm_uq.base.messages import Text, say
from cmm_uq.certificate.document import Standing
from cmm_uq.laboratory.records.listing import Newest, standing_of_all
from cmm_uq.laboratory.records.store import Records

SOON = dt.timedelta(days=60)  # what is due within it is shown before it is late


class DueDate(NamedTuple):
    """On which ``day`` a machine is due, ``None`` where no rule gives one, and why.

    ``beyond``: whether its last certificate finds it beyond its limits: it is overdue from that day on.
    """

    day: dt.date | None
    why: Text
    beyond: bool = False


DueDates = Callable[[Records, dt.date], Mapping[str, DueDate]]  # on a day, by serial, of machines that have one


def by_rule(records: Records, today: dt.date) -> dict[str, DueDate]:
    """Of all machines, each by its own rule, its interim checks and its adjustments."""
    found = due_in(records, (), today) if records.head()[0] else []
    return {one.serial: DueDate(one.due, one.why, one.beyond) for one in found if one.item == "machine"}


@dataclass(frozen=True)
class MachineGroup:
    """Machines of which the same is true, what a number of them is called, and how that is to be taken."""

    word: Text
    count: Text
    standing: Standing


GROUPS: Mapping[str, MachineGroup] = {  # the most urgent first; by the words of an address
    "overdue": MachineGroup(say("Overdue"), say("overdue"), "bad"),
    "failing": MachineGroup(say("Does not conform"), say("not conforming"), "bad"),
    "due": MachineGroup(say("Due soon"), say("due within {days} days", days=SOON.days), "open"),
    "open": MachineGroup(say("Not decided"), say("not decided"), "open"),
    "diagnosis": MachineGroup(say("Contradicts its model"), say("contradict their model"), "open"),
    "draft": MachineGroup(say("Not released"), say("not released"), "open"),
    "never": MachineGroup(say("No certificate"), say("without certificate"), "open"),
    "order": MachineGroup(say("In order"), say("in order"), "good"),
}
_URGENCY = {name: place for place, name in enumerate(GROUPS)}


class MachineStanding(NamedTuple):
    """A machine with its newest certificate, when it is due, and its groups, the most urgent first."""

    newest: Newest
    due: DueDate | None
    groups: tuple[str, ...]

    @property
    def serial(self) -> str:
        return self.newest.machine.serial


def overview(records: Records, due: DueDates, today: dt.date) -> tuple[MachineStanding, ...]:
    """Every machine, the most urgent first, then by due date."""
    newest, days = standing_of_all(records), due(records, today)
    dated = ((one, days.get(one.machine.serial)) for one in newest)
    return in_order([MachineStanding(one, date, groups(one, date, today)) for one, date in dated])


def in_order(machines: Sequence[MachineStanding]) -> tuple[MachineStanding, ...]:
    """The most urgent first, then by due date and serial."""

    def urgency(one: MachineStanding) -> tuple[int, dt.date, str]:
        due = one.due.day if one.due is not None and one.due.day is not None else dt.date.max
        return _URGENCY[one.groups[0]], due, one.serial

    return tuple(sorted(machines, key=urgency))


def groups(newest: Newest, due: DueDate | None, today: dt.date) -> tuple[str, ...]:
    """To which groups a machine belongs, the most urgent first."""
    found: tuple[str, ...] = ()
    if due is not None and due.day is not None:
        found = ("overdue",) if due.beyond or due.day < today else ("due",) if due.day <= today + SOON else ()
    certificate = newest.certificate
    if certificate is None:
        found += ("never",)
    else:
        found += _of_certificate(certificate.decision, certificate.diagnosis, certificate.state)
    return tuple(sorted(found, key=_URGENCY.__getitem__)) if len(found) > 1 else found or ("order",)


@lru_cache(1000)
def _of_certificate(decision: str, diagnosis: str, state: str) -> tuple[str, ...]:
    conforms = DECISIONS.get(decision, (None, "open"))[1]
    found = ["failing"] if conforms == "bad" else ["open"] if conforms == "open" else []
    if diagnosis and VERDICTS.get(diagnosis, (None, "open"))[1] != "good":
        found.append("diagnosis")
    return tuple(found + ["draft"] * (state == "draft"))
