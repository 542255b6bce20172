"""Interim checks between calibrations, and what a value changed by between two certificates.

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
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import NormalDist
from typing import Literal

from cmm_uq.jobs.verdicts import BEYOND
from cmm_uq.laboratory.due.rule import is_of_machine, part_used
from cmm_uq.laboratory.records.facts import RecordedCertificate, RecordedValue


def two_sided(z: float) -> float:
    """Probability of a deviate at least as far from zero as ``z``."""
    return math.erfc(abs(z) / math.sqrt(2))


def two_sided_limit(probability: float) -> float:
    """The deviate that is exceeded on either side with a probability."""
    return -NormalDist().inv_cdf(probability / 2)


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


def limit_for(count: int, single: float) -> float:
    """Limit for each of several values with the rate of false alarms that ``single`` has for one."""
    return two_sided_limit(each_of(count, two_sided(single)))


def check_standings(calibration: RecordedCertificate, checks: Sequence[RecordedCertificate]) -> list[InterimCheck]:
    """Each check since the calibration, by day and without an adjustment between, by the rule."""
    stated = {one.name: _stated(one, calibration) for one in calibration.values if is_of_machine(one.unit)}
    found: list[InterimCheck] = []
    before: dict[str, ValueChange] = {}
    for check in checks:
        known = (one for one in check.values if one.name in stated)
        changes = {one.name: change(stated[one.name], _stated(one, check)) for one in known}
        found.append(_checked(check, changes, before))
        before = changes
    return found


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
    return InterimCheck(check, standing, titles.get(worst, ""), furthest, warning, action)


def _stated(value: RecordedValue, certificate: RecordedCertificate) -> ComparedValue:
    return ComparedValue(value.value, value.u, value.u_artefact, certificate.artefact)
