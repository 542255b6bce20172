"""By which rule a machine's next calibration is found, as its newest job says it (``[machine] calibrate``)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

from cmm_uq.base.messages import Text, plural, say


@dataclass(frozen=True)
class IntervalBounds:
    """How far and how readily an interval is changed; the defaults are those of suncal."""

    confidence: float = 0.5  # least confidence of a rejection that changes the interval
    factor: float = 2.0  # most that an interval grows or shrinks by at once
    least_days: float = 5.0  # smaller changes are not worth making
    shortest_days: float = 14.0
    longest_days: float = 1826.0

    def bounded(self, days: float) -> float:
        """The interval within its bounds."""
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
        """The interval that it begins with."""
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
