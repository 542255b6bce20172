"""How every machine stands: overdue, due soon, not conforming, not released; the most urgent first.

Worked out once for each head of the records and day, since nothing else changes it.
"""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

from cmm_uq.app.serve.due import SOON, Due, DueDates
from cmm_uq.app.serve.words import DECISIONS, VERDICTS
from cmm_uq.base.messages import Text, say
from cmm_uq.certificate.document import Standing
from cmm_uq.laboratory.records.listing import Newest, standing_of_all
from cmm_uq.laboratory.records.store import Records


@dataclass(frozen=True)
class Group:
    """Machines of which the same is true.

    Parameters
    ----------
    word : of one machine.
    count : what a number of them is called.
    standing : how it is to be taken.
    """

    word: Text
    count: Text
    standing: Standing


GROUPS: Mapping[str, Group] = {
    "overdue": Group(say("Overdue"), say("overdue"), "bad"),
    "failing": Group(say("Does not conform"), say("not conforming"), "bad"),
    "due": Group(say("Due soon"), say("due within {days} days", days=SOON.days), "open"),
    "open": Group(say("Not decided"), say("not decided"), "open"),
    "diagnosis": Group(say("Contradicts its model"), say("contradict their model"), "open"),
    "draft": Group(say("Not released"), say("not released"), "open"),
    "never": Group(say("No certificate"), say("without certificate"), "open"),
    "order": Group(say("In order"), say("in order"), "good"),
}
"""The most urgent first; by the words of an address."""

_URGENCY = {name: place for place, name in enumerate(GROUPS)}


class Stands(NamedTuple):
    """How one machine stands.

    Parameters
    ----------
    newest : machine, with its newest certificate.
    due : when it is due, and why.
    groups : to which it belongs, the most urgent first.
    """

    newest: Newest
    due: Due | None
    groups: tuple[str, ...]

    @property
    def serial(self) -> str:
        """By which the machine is asked for."""
        return self.newest.machine.serial


def overview(records: Records, due: DueDates, today: dt.date) -> tuple[Stands, ...]:
    """Every machine, the most urgent first, then by due date.

    Raises
    ------
    CmmUqError : the records are damaged or locked.
    """
    newest = standing_of_all(records)
    days = due(records, today)
    return in_order(
        [Stands(one, days.get(one.machine.serial), groups(one, days.get(one.machine.serial), today)) for one in newest]
    )


def in_order(machines: Sequence[Stands]) -> tuple[Stands, ...]:
    """The most urgent first, then by due date and serial."""

    def urgency(one: Stands) -> tuple[int, dt.date, str]:
        due = one.due.day if one.due is not None and one.due.day is not None else dt.date.max
        return _URGENCY[one.groups[0]], due, one.serial

    return tuple(sorted(machines, key=urgency))


def groups(newest: Newest, due: Due | None, today: dt.date) -> tuple[str, ...]:
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
    """To which groups a machine belongs by what its newest certificate says."""
    conforms = DECISIONS.get(decision, (None, "open"))[1]
    found = ["failing"] if conforms == "bad" else ["open"] if conforms == "open" else []
    if diagnosis and VERDICTS.get(diagnosis, (None, "open"))[1] != "good":
        found.append("diagnosis")
    return tuple(found + ["draft"] * (state == "draft"))
