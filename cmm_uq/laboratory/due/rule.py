"""The rule of a machine's next calibration (``[machine] calibrate``), and the intervals that its certificates ended.

Only what was found before an adjustment counts; a certificate made after one begins an interval and ends none. A value
is compared with its limit as it is, without a guard band: a reliability is that of the machines, not of a decision rule.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from itertools import pairwise
from typing import Any

from cmm_uq.base.messages import Text, plural, say
from cmm_uq.laboratory.records.facts import RecordedCertificate


@dataclass(frozen=True)
class IntervalBounds:
    """How far and how readily an interval is changed; the defaults are those of suncal."""

    confidence: float = 0.5  # least confidence of a rejection that changes the interval
    factor: float = 2.0  # most that an interval grows or shrinks by at once
    least_days: float = 5.0  # smaller changes are not worth making
    shortest_days: float = 14.0
    longest_days: float = 1826.0

    def bounded(self, days: float) -> float:
        return min(max(days, self.shortest_days), self.longest_days)


USUAL = IntervalBounds()  # as suncal has it


DAYS_A_MONTH = 365.2425 / 12
USUAL_MONTHS = 12  # interval of a machine whose job says nothing
USUAL_RELIABILITY = 0.95
LONGEST_MONTHS = 60  # longest interval that a method comes to where nothing is said: the five years of suncal


@dataclass(frozen=True)
class Rule:
    """A rule; see :class:`cmm_uq.jobs.tables.machine.Recalibration`."""

    method: str = "fixed"  # one of fixed, A3, S2, staircase, control chart, drift
    every_months: int = USUAL_MONTHS  # interval, or the one that a method begins with
    reliability: float = USUAL_RELIABILITY  # wanted at the end of an interval
    shortest_months: int = 1
    longest_months: int | None = None
    stated: bool = False  # whether the job says anything

    @classmethod
    def of(cls, said: Mapping[str, Any] | None) -> Rule:
        """From the table of a job, which was checked when it was read; ``None`` where it has none."""
        if said is None:
            return cls()
        known = {field.name for field in fields(cls)}
        given = {name: value for name, value in said.items() if value is not None and name in known}
        given.setdefault("method", "A3" if "reliability" in given else "fixed")
        return cls(**given, stated=True)

    @property
    def days(self) -> float:
        return self.every_months * DAYS_A_MONTH

    @property
    def changing(self) -> IntervalBounds:
        """Within which bounds a method changes it."""
        longest = max(self.longest_months or LONGEST_MONTHS, self.every_months)
        return IntervalBounds(shortest_days=self.shortest_months * DAYS_A_MONTH, longest_days=longest * DAYS_A_MONTH)


def months_of(rule: Rule) -> Text:
    """The interval that a rule begins with, in words."""
    count = rule.every_months
    return plural(count, one=say("one month"), many=say("{count} months", count=count))


_DECIDED = {"pass": 0.0, "conditional pass": 1.0, "conditional fail": 2.0, "fail": 2.0}
"""Part of the limits where only a decision is known: well within, just within, or beyond."""


@dataclass(frozen=True)
class CompletedInterval:
    days: int
    used: float  # largest part of a limit that was found used up at its end; more than 1 is out of tolerance

    @property
    def in_tolerance(self) -> bool:
        """Whether every value was within its limit."""
        return self.used <= 1


Pool = Callable[[], Sequence[CompletedInterval]]
"""Intervals of all machines of the model, this one's among them; asked for only by methods that pool."""


def part_used(certificate: RecordedCertificate) -> float | None:
    """Largest part of a limit that a certificate finds used up; ``None`` where it knows neither limits nor a decision."""
    parts = [abs(one.value) / one.limit for one in certificate.values if one.limit]
    return max(parts) if parts else _DECIDED.get(certificate.decision)


def is_of_machine(unit: str) -> bool:
    """Whether a value says something of the machine: one in mm is a size, of the artefact, and changes with it."""
    return unit != "mm"


def calibrations(certificates: Iterable[RecordedCertificate]) -> list[RecordedCertificate]:
    """Those that are no interim checks."""
    return [one for one in certificates if not one.interim]


def ended_intervals(certificates: Sequence[RecordedCertificate]) -> list[CompletedInterval]:
    """Intervals between the calibrations of one machine, sorted by day, whose ends are known."""
    ended = []
    for before, now in pairwise(calibrations(certificates)):
        used = part_used(now)
        if now.day > before.day and used is not None and not adjusted_between(before, now):
            ended.append(CompletedInterval((now.day - before.day).days, used))
    return ended


def adjusted_between(before: RecordedCertificate, now: RecordedCertificate) -> bool:
    """Whether the machine was adjusted after the one and before the other."""
    return now.adjusted_since is not None and now.adjusted_since != before.adjusted_since and (
        now.adjusted_since >= before.day)  # fmt: skip
