"""Intervals that follow from a history: each method with what it takes of the certificates, and its reason in words."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, Verbatim, foreign, number, say
from cmm_uq.laboratory.due.crossing import crossing
from cmm_uq.laboratory.due.drift import DriftPrior
from cmm_uq.laboratory.due.intervals import LastValue, fitted_drift, interval_of_reliability, interval_test, staircase
from cmm_uq.laboratory.due.reliability import grouped, reliability_regression
from cmm_uq.laboratory.due.rule import (
    Pool,
    Rule,
    adjusted_between,
    calibrations,
    ended_intervals,
    is_of_machine,
    months_of,
)
from cmm_uq.laboratory.records.facts import RecordedCertificate, Series


def series_from(certificates: Sequence[RecordedCertificate], name: str) -> Series:
    """One value over certificates of one machine, by day, as the records give it."""
    rows = [(one, value) for one in certificates for value in one.values if value.name == name]
    last = rows[-1][1]
    return Series.of(name, last.quantity, last.unit, [value.limit for _, value in rows], [
        (one.day, value.value, value.u, value.u_artefact, one.artefact, one.entry, one.adjusted_since, one.interim)
        for one, value in rows
    ])  # fmt: skip


def drift_interval(
    certificates: Sequence[RecordedCertificate], reliability: float, priors: Mapping[str, DriftPrior]
) -> tuple[float, str, bool]:
    """Days from the last calibration until the first of the errors may have crossed its limit, and which one it is.

    Infinite beyond the model's horizon; last, whether its prior is a fleet's. Interim checks count: the model takes all that
    was seen, as its history does.
    """
    last = calibrations(certificates)[-1]
    stated = (series_from(certificates, one.name) for one in last.values if is_of_machine(one.unit))
    limited = [(one, one.limit) for one in stated if one.limit]
    if not limited:
        raise CmmUqError(say("its certificate has no limits"))
    found: list[tuple[float, str, bool]] = []
    refused: CmmUqError | None = None
    for one, limit in limited:
        try:
            crossed = crossing(one, limit, priors.get(one.name)).quantile(1 - reliability)
        except CmmUqError as error:
            refused = error
            continue
        days = float("inf") if crossed is None else float((crossed - last.day).days)
        found.append((days, one.quantity, one.name in priors))
    if not found:
        raise refused or CmmUqError(say("nothing in its history can be followed"))
    return min(found)


LIKE_DAYS, LIKE_PART = 56.0, 0.5
"""An interval is like the assigned one where it differs by no more than eight weeks, nor by half of it (as suncal has it)."""

Priors = Mapping[str, DriftPrior]

Method = Callable[[Rule, Sequence[RecordedCertificate], Pool, Priors], tuple[float, Text]]
"""Days and the reason, from the rule, certificates, intervals of the model and priors of the fleet; refuses in words."""


def _a3(rule: Rule, certificates: Sequence[RecordedCertificate], pool: Pool, priors: Priors) -> tuple[float, Text]:
    assigned = rule.days
    near = min(LIKE_DAYS, LIKE_PART * assigned)
    like = [one for one in pool() if abs(one.days - assigned) <= near]
    if not like:
        raise CmmUqError(say("no interval of about {months} has ended with known limits", months=months_of(rule)))
    passed = sum(one.in_tolerance for one in like)
    found = interval_test(passed, len(like), assigned, rule.reliability, rule.changing)
    return found.recommended, say(
        "method A3: {passed} of {tested} intervals of about {months} ended within the limits, {target} % wanted; rejected "
        "with a confidence of {rejection} %",
        passed=passed, tested=len(like), months=months_of(rule), target=_percent(rule.reliability),
        rejection=_percent(found.rejection),
    )  # fmt: skip


def _s2(rule: Rule, certificates: Sequence[RecordedCertificate], pool: Pool, priors: Priors) -> tuple[float, Text]:
    ended = pool()
    if not ended:
        raise CmmUqError(say("no interval has ended with known limits"))
    data = grouped([one.days for one in ended], [one.in_tolerance for one in ended])
    found = reliability_regression(data, rule.reliability)
    why = say(
        "method S2: after {days} days {target} % of {tested} intervals end within the limits ({model} model; 95 %: {low} to "
        "{high} days)",
        days=number(found.interval, ".0f"), target=_percent(rule.reliability), tested=len(ended),
        model=found.best.name, low=number(found.low, ".0f"),
        high=number(found.high, ".0f") if np.isfinite(found.high) else say("more than all observed"),
    )  # fmt: skip
    return rule.changing.bounded(found.interval), why


def _staircase(
    rule: Rule, certificates: Sequence[RecordedCertificate], pool: Pool, priors: Priors
) -> tuple[float, Text]:
    ended = ended_intervals(certificates)
    if not ended:
        raise CmmUqError(say("no interval of this machine has ended with known limits"))
    found = staircase([one.used for one in ended], rule.days, rule.reliability, rule.changing)
    return found.interval, say(
        "staircase from {months}: {up} up, {kept} kept, {down} down", months=months_of(rule),
        up=found.up, kept=found.kept, down=found.down,
    )  # fmt: skip


def _control_chart(
    rule: Rule, certificates: Sequence[RecordedCertificate], pool: Pool, priors: Priors
) -> tuple[float, Text]:
    """The least of the intervals after which each value is within its limit with the reliability."""
    done = calibrations(certificates)
    pairs = [(a, b) for a, b in pairwise(done) if b.day > a.day and not adjusted_between(a, b)]
    limited = [one for one in done[-1].values if one.limit]
    if not limited:
        raise CmmUqError(say("its certificate has no limits"))
    shortest: tuple[float, Text] | None = None
    for one in limited:
        changes = [
            ((b.day - a.day).days, now.value - then.value)
            for a, b in pairs for then in a.values for now in b.values if then.name == now.name == one.name
        ]  # fmt: skip
        if len(changes) < 2:
            continue
        days, differences = np.transpose(changes)
        start, limit = LastValue(one.value, one.u), one.limit
        length = interval_of_reliability(fitted_drift(days, differences), start, rule.reliability, -(limit or 0), limit)
        if shortest is None or length < shortest[0]:
            shortest = length, foreign(one.quantity)
    if shortest is None:
        raise CmmUqError(say("it needs three calibrations without an adjustment between"))
    length, name = shortest
    why = say("control chart: {name} stays within its limit with {target} % for {reached}", name=name,
              target=_percent(rule.reliability), reached=_lasting(length))  # fmt: skip
    return rule.changing.bounded(length), why


def _drift(rule: Rule, certificates: Sequence[RecordedCertificate], pool: Pool, priors: Priors) -> tuple[float, Text]:
    length, name, learnt = drift_interval(certificates, rule.reliability, priors)
    why = say("{model}: {name} has not crossed its limit with {target} % for {reached}", name=Verbatim(name),
              model=say("drift model with its fleet") if learnt else say("drift model without a fleet"),
              target=_percent(rule.reliability), reached=_lasting(length))  # fmt: skip
    return rule.changing.bounded(length), why


def _lasting(days: float) -> Text:
    return say("{days} days", days=number(days, ".0f")) if np.isfinite(days) else say("longer than can be foreseen")


def _percent(part: float) -> Text:
    return number(100 * part, ".3g")


METHODS: Mapping[str, Method] = {
    "A3": _a3,
    "S2": _s2,
    "staircase": _staircase,
    "control chart": _control_chart,
    "drift": _drift,
}
