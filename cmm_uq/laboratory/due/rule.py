"""A machine's next calibration by its rule (``[machine] calibrate``), the intervals that ended, and interim checks between.

Only what was found before an adjustment counts; a certificate made after one begins an interval and ends none. A value
is compared with its limit as it is, without a guard band: a reliability is that of the machines, not of a decision rule.

A change: both values carry the error of the artefact. Where it was the same artefact, that part is in both, and cancels in
their difference: u²(d) = u₁² + u₂² − 2·u_a1·u_a2 (JCGM 100:2008, 5.2.2, with correlation 1 of what comes from the artefact).
Where all of an uncertainty comes from the artefact, as a test uncertainty does, nothing is stated of how the machine
repeats; then nothing cancels either, or every change would be called significant.

Checks: a control chart of each value about what the calibration found (ILAC-G24, method 4). The rule, for each check in turn,
on the difference of every value from the calibration, in units of its standard uncertainty (in which the artefact that both
share does not count):

- *action*: a value beyond its action limit, or beyond its warning limit on the same side in two checks one after the other, or
  beyond its limit of tolerance. The machine is to be calibrated at once.
- *warning*: a value beyond its warning limit. The check is to be repeated.
- *nothing compared*: it has no value in common with the calibration, as one of another kind may not.
- *in control*: none of these.

For one value the warning and action limits are 2 and 3 standard uncertainties, as on Shewhart's chart; for several they are so
much wider that no more false alarms come of more values (Šidák). Two checks in a row beyond the warning limit come by chance
oftener than by the square of one: both carry the calibration's error (docs/records/due.md says how often). Runs of more than
two, and moving averages, are left out: all checks are compared with the same calibration, so that their differences from it
are not independent, as such rules assume.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cache
from hashlib import sha256
from importlib.metadata import version
from itertools import pairwise
from pathlib import Path
from statistics import NormalDist
from typing import Any, Literal

from cmm_uq import __version__
from cmm_uq.base.messages import Text, plural, say
from cmm_uq.base.values import dataclass, fields, replace
from cmm_uq.jobs.verdicts import BEYOND
from cmm_uq.laboratory.records.facts import RecordedCertificate, RecordedValue


@cache
def program() -> str:
    """What computes days: another program may come to others."""
    folders = (Path(__file__).parent, Path(__file__).parents[1] / "records")
    sources = b"".join(file.read_bytes() for folder in folders for file in sorted(folder.glob("*.py")))
    return " ".join((__version__, sha256(sources).hexdigest(), *map(version, ("numpy", "scipy"))))


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
    def pooled(self) -> bool:
        """Whether it takes what calibrations of other machines of the model found."""
        return self.method in ("A3", "S2")

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


def two_sided(z: float) -> float:
    """Probability of a deviate at least as far from zero as ``z``."""
    return math.erfc(abs(z) / math.sqrt(2))


_NOTHING = 1e-9  # part of a variance that is none
FAMILY = 0.05  # probability that anything at all is called significant where nothing changed


@dataclass(frozen=True)
class ComparedValue:
    """A value of a certificate: estimate, standard uncertainty, the part of it from the artefact, and which artefact."""

    value: float
    u: float
    u_artefact: float
    artefact: str


@dataclass(frozen=True)
class ValueChange:
    value: float
    u: float

    @property
    def ratio(self) -> float:
        """The difference in units of its standard uncertainty; infinite where something changed that nothing can have."""
        if self.u > 0:
            return self.value / self.u
        return math.copysign(math.inf, self.value) if self.value else 0.0

    @property
    def chance(self) -> float:
        """Probability of a difference at least as large where nothing changed (two-sided)."""
        return two_sided(self.ratio)

    def significant(self, compared: int, family: float = FAMILY) -> bool:
        """Whether it is more than chance among ``compared`` differences (Šidák)."""
        return self.chance < each_of(compared, family)


def each_of(count: int, family: float) -> float:
    """Probability for each of several comparisons that gives ``family`` for all, at most (Šidák 1967)."""
    return -math.expm1(math.log1p(-family) / max(count, 1))


def common_part(u: float, u_artefact: float) -> float:
    """Part of a standard uncertainty that cancels against another value of the same artefact; 0 where it is the whole."""
    return u_artefact if u**2 - u_artefact**2 > _NOTHING * u**2 else 0.0


def change(before: ComparedValue, now: ComparedValue) -> ValueChange:
    same = bool(before.artefact) and before.artefact == now.artefact
    common = common_part(before.u, before.u_artefact) * common_part(now.u, now.u_artefact) if same else 0.0
    return ValueChange(now.value - before.value, math.sqrt(max(before.u**2 + now.u**2 - 2 * common, 0.0)))


Standing = Literal["in control", "warning", "action", "nothing compared"]
WARNING, ACTION = 2.0, 3.0  # limits of a chart of one value, in standard uncertainties


@dataclass(frozen=True)
class InterimCheck:
    certificate: RecordedCertificate
    standing: Standing  # by the rule
    worst: str  # the value that is furthest out, as it is called; empty where nothing could be compared
    ratio: float  # its difference from the calibration in units of the difference's standard uncertainty
    warning: float
    action: float
    proves: bool  # whether it shows, with its uncertainty, all that the calibration limits to be within: see :func:`_proves`


def limit_for(count: int, single: float) -> float:
    """Limit for each of several values with the rate of false alarms that ``single`` has for one."""
    return -NormalDist().inv_cdf(each_of(count, two_sided(single)) / 2)


def check_standings(calibration: RecordedCertificate, checks: Sequence[RecordedCertificate]) -> list[InterimCheck]:
    """Each check since the calibration, by day and without an adjustment between, by the rule."""
    own = [one for one in calibration.values if is_of_machine(one.unit)]
    stated, limits = {one.name: _stated(one, calibration) for one in own}, {one.name: one.limit for one in own}
    found: list[InterimCheck] = []
    before: dict[str, ValueChange] = {}
    last: object = None
    for given in checks:
        if (recording := (given.job, given.day)) == last:  # reported again: no second check after the first
            before = {}
        # a check is held to the limits of the calibration too, whatever wider ones, or none, it states
        least = ((one, [each for each in (one.limit, limits.get(one.name)) if each]) for one in given.values)
        limited = tuple(replace(one, limit=min(both, default=None)) for one, both in least)
        check = replace(given, values=limited)
        known = (one for one in check.values if one.name in stated)
        changes = {one.name: change(stated[one.name], _stated(one, check)) for one in known}
        found.append(replace(_checked(check, changes, before), proves=_proves(own, check)))
        before, last = changes, recording
    return found


def _proves(calibrated: Sequence[RecordedValue], check: RecordedCertificate) -> bool:
    """Whether a check shows, with U, all values within that the calibration limits; without limits, all half as well as it."""
    there = {one.name: one for one in check.values}
    asked = [one for one in calibrated if one.limit] or calibrated
    return all(
        (now := there.get(one.name)) is not None
        and (abs(now.value) + WARNING * now.u <= one.limit if one.limit else now.u <= 2 * one.u)
        for one in asked
    )


def _checked(
    check: RecordedCertificate, changes: dict[str, ValueChange], before: dict[str, ValueChange]
) -> InterimCheck:
    warning, action = limit_for(len(changes), WARNING), limit_for(len(changes), ACTION)
    titles = {one.name: one.quantity for one in check.values}
    worst = max(changes, key=lambda name: abs(changes[name].ratio), default="")
    furthest = changes[worst].ratio if worst else 0.0
    twice = any(
        abs(one.ratio) > warning and name in before and abs(before[name].ratio) > warning
        and (one.ratio > 0) == (before[name].ratio > 0)
        for name, one in changes.items()
    )  # fmt: skip
    used = part_used(check)
    beyond = (used is not None and used > 1) or check.decision in BEYOND
    standing: Standing = "in control" if changes else "nothing compared"
    if abs(furthest) > action or twice or beyond:
        standing = "action"
    elif abs(furthest) > warning:
        standing = "warning"
    return InterimCheck(check, standing, titles.get(worst, ""), furthest, warning, action, proves=False)


def _stated(value: RecordedValue, certificate: RecordedCertificate) -> ComparedValue:
    return ComparedValue(value.value, value.u, value.u_artefact, certificate.artefact)
