"""Interim checks between calibrations: a control chart of each value about what the calibration found (ILAC-G24, method 4).

The rule, for each check in turn, on the difference of every value from the calibration, in units of its standard uncertainty
(in which the artefact that both share does not count):

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

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from cmm_uq.jobs.verdicts import BEYOND
from cmm_uq.laboratory.due.change import ComparedValue, ValueChange, change, each_of, two_sided, two_sided_limit
from cmm_uq.laboratory.due.rule import is_of_machine, part_used
from cmm_uq.laboratory.records.facts import RecordedCertificate, RecordedValue

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
