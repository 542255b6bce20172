"""What certificates say of the intervals that they ended: how long each was, and how much of its limits was then used up.

Only what was found before an adjustment counts; a certificate made after one begins an interval and ends none. A value
is compared with its limit as it is, without a guard band: a reliability is that of the machines, not of a decision rule.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise

from cmm_uq.laboratory.records.facts import RecordedCertificate

_DECIDED = {"pass": 0.0, "conditional pass": 1.0, "conditional fail": 2.0, "fail": 2.0}
"""Part of the limits where only a decision is known: well within, just within, or beyond."""


@dataclass(frozen=True)
class CompletedInterval:
    """An interval that a certificate ended."""

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
