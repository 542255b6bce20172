"""Intervals from what calibrations found: by the numbers in tolerance (method A3, staircase), and by how values drift.

Each method of a rule with what it takes of the certificates, and its reason in words.

A3 (NCSLI RP-1): the numbers in and out of tolerance at the end of like intervals are binomial. The interval is changed where
its reliability differs from the target with enough confidence, and by no more than a factor either way.

Staircase (ILAC-G24 / OIML D 10:2022, method 1): a calibration that finds the machine well within its limits (to 80 %)
lengthens the next interval by a step up; one that finds it beyond a limit shortens it by a step down; between, it stays.
The steps follow from the reliability R that is wanted: where R of the calibrations go up and 1 − R down, the logarithm of
the interval does not move, R·ln(1 + a) + (1 − R)·ln(1 − b) = 0. A step up is a tenth, or less where a step down would
then be more than an interval may shrink by at once.

Values (method V1 of NCSLI RP-1; control chart, ILAC-G24 / OIML D 10:2022, method 2): what a value changed by over each
interval is fitted by a polynomial through zero. The interval ends where the probability that the value still lies within its
limits falls to the target. Source: suncal 1.7.1 and its tests, which quote NASA-HDBK-8739.19-5, chapter 7.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from hashlib import sha256
from itertools import pairwise

import numpy as np
import scipy

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, Verbatim, foreign, number, say
from cmm_uq.base.points import Floats
from cmm_uq.base.values import dataclass
from cmm_uq.laboratory.due import rule as rules
from cmm_uq.laboratory.due.crossing import FINE, crossings
from cmm_uq.laboratory.due.drift import HORIZON, YEAR, DriftHistory, DriftPrior, default_prior, history, side_by_side
from cmm_uq.laboratory.due.drift_filter import filtered
from cmm_uq.laboratory.due.reliability import grouped, reliability_regression
from cmm_uq.laboratory.due.rule import USUAL, IntervalBounds, Pool, Rule, calibrations, months_of
from cmm_uq.laboratory.records.facts import RecordedCertificate, Series


@dataclass(frozen=True)
class IntervalTest:
    """What the test of an interval found; ``low`` and ``high`` bound its true reliability (Clopper–Pearson)."""

    in_tolerance: int  # and tested: calibrations found in tolerance at the end of the interval, and all of them
    tested: int
    observed: float
    low: float
    high: float
    rejection: float  # confidence with which the interval is rejected, 0 to 1
    calculated: float  # interval that the method computes, days
    recommended: float


def interval_test(
    in_tolerance: int, tested: int, interval: float, target: float, changing: IntervalBounds = USUAL
) -> IntervalTest:
    """Test an interval, days, against the reliability wanted at its end.

    With the observed reliability R₀ of n calibrations, of which x were in tolerance, and the target R, the rejection
    confidence is that of the two-sided binomial test, Q = 1 − 2 P(X ≤ x) below the target and 1 − 2 P(X ≥ x) above
    it, and 1 − P(X = x) where all or none were in tolerance. The new interval is I·10^((R₀ − R)·Q) below the target
    and I·10^((R₀ − R)/(1 − Q)) above it.
    """
    if not 0 <= in_tolerance <= tested or tested == 0:
        raise CmmUqError(say("a test of an interval needs at least one calibration at its end"))
    observed = in_tolerance / tested
    rejection = _rejection(in_tolerance, tested, target)
    if observed > target:
        power = (observed - target) / (1 - rejection) if rejection < 1 else float("inf")
        ratio = min(10 ** min(power, 300.0), changing.factor)
    else:
        ratio = max(10 ** ((observed - target) * rejection), 1 / changing.factor)
    calculated = interval * ratio
    changed = rejection > changing.confidence and abs(calculated - interval) >= changing.least_days
    low, high = reliability_range(in_tolerance, tested, changing.confidence)
    recommended = changing.bounded(calculated) if changed else interval
    return IntervalTest(in_tolerance, tested, observed, low, high, rejection, calculated, recommended)


def _rejection(passed: int, tested: int, target: float) -> float:
    """Confidence with which the target is not the true reliability."""
    if passed == tested:
        return float(1 - target**tested)
    if passed == 0:
        return float(1 - (1 - target) ** tested)
    below = passed / tested <= target
    tail = scipy.special.bdtr(passed, tested, target) if below else 1 - scipy.special.bdtr(passed - 1, tested, target)
    return max(float(1 - 2 * tail), 0.0)


def reliability_range(passed: int, tested: int, confidence: float) -> tuple[float, float]:
    """Bounds of the true reliability (Clopper–Pearson), one-sided where all or none were in tolerance."""
    if passed == 0:
        return 0.0, float(1 - (1 - confidence) ** (1 / tested))
    if passed == tested:
        return float((1 - confidence) ** (1 / tested)), 1.0
    low = scipy.special.betaincinv(passed, tested - passed + 1, (1 - confidence) / 2)
    high = scipy.special.betaincinv(passed + 1, tested - passed, (1 + confidence) / 2)
    return float(low), float(high)


WELL_WITHIN = 0.8
"""Part of the limit up to which the interval is lengthened; remembered of ILAC-G24 / OIML D 10, not checked against it."""

STEP_UP = 0.1  # part by which an interval is lengthened at most


@dataclass(frozen=True)
class Staircase:
    interval: float  # days
    up: int  # and kept, down: calibrations that lengthened it, left it, and shortened it
    kept: int
    down: int


def steps(reliability: float, factor: float = USUAL.factor) -> tuple[float, float]:
    """Factors of an interval after a calibration well within the limits, and after one beyond them, in balance."""
    odds = reliability / (1 - reliability)
    up = min(1 + STEP_UP, factor ** (1 / odds))
    return float(up), float(up**-odds)


def staircase(
    used: Iterable[float], interval: float, reliability: float, changing: IntervalBounds = USUAL
) -> Staircase:
    """Climb from a first interval, days, by the parts of the limits that calibrations found used up."""
    up_by, down_by = steps(reliability, changing.factor)
    counts = [0, 0, 0]
    for part in used:
        step = 0 if part <= WELL_WITHIN else 1 if part <= 1 else 2
        counts[step] += 1
        interval = changing.bounded(interval * (up_by, 1.0, down_by)[step])
    return Staircase(interval, *counts)


_FAR, _STEPS = 100.0, 4000  # times, in units of the longest observed interval, within which an interval is sought
_AT_ONCE = 4  # errors that are followed together: as many as a core's cache holds


@dataclass(frozen=True)
class DriftPolynomial:
    """A polynomial through zero, fitted by least squares."""

    coefficients: Floats  # (m,) of t, t², …
    covariance: Floats  # (m, m) of them, from the scatter about the curve
    scatter: float  # standard deviation about the curve
    freedoms: int  # degrees of freedom of it
    longest: float  # interval that was observed, days

    def change(self, days: Floats) -> Floats:
        """Expected after times (n,)."""
        return np.asarray(_powers(days, len(self.coefficients)) @ self.coefficients)

    def u_change(self, days: Floats) -> Floats:
        """Standard uncertainty of the same (n,), from the fit."""
        powers = _powers(days, len(self.coefficients))
        return np.asarray(np.sqrt(np.einsum("ij,jk,ik->i", powers, self.covariance, powers)))


@dataclass(frozen=True)
class LastValue:
    """A value when it was last calibrated: the value, its standard uncertainty and that one's degrees of freedom."""

    value: float
    u: float
    freedoms: float = np.inf


def fitted_drift(days: Floats, changes: Floats, order: int = 1) -> DriftPolynomial:
    """Fit what a value changed by over each interval, days, both (n,)."""
    days, changes = np.asarray(days, dtype=np.float64), np.asarray(changes, dtype=np.float64)
    if len(days) <= order or not (days > 0).all():
        raise CmmUqError(
            say("a drift of order {order} needs more than {order} intervals, none of them of no length", order=order)
        )
    longest = float(days.max())
    powers = _powers(days / longest, order)  # of the order of one, whatever the unit
    inverse = np.linalg.pinv(powers.T @ powers)
    coefficients = inverse @ powers.T @ changes
    freedoms = len(days) - order
    variance = float(((changes - powers @ coefficients) ** 2).sum() / freedoms)
    unit = longest ** -np.arange(1, order + 1, dtype=np.float64)
    return DriftPolynomial(
        coefficients * unit, variance * inverse * np.outer(unit, unit), float(np.sqrt(variance)), freedoms, longest
    )


def reliability_after(
    drift: DriftPolynomial, start: LastValue, days: Floats, low: float | None, high: float | None
) -> Floats:
    """Probability (n,) of lying within the limits after times (n,): Student's t, Welch–Satterthwaite degrees of freedom."""
    grown = drift.u_change(days)
    u = np.sqrt(grown**2 + start.u**2)
    with np.errstate(divide="ignore", invalid="ignore"):
        freedoms = u**4 / (grown**4 / drift.freedoms + start.u**4 / start.freedoms)
        freedoms = np.where(np.isfinite(freedoms), np.minimum(freedoms, 1e9), 1e9)
        middle = start.value + drift.change(days)
        above = 1.0 if high is None else _t(freedoms, high - middle, u)
        below = 0.0 if low is None else _t(freedoms, low - middle, u)
    return np.asarray(above - below)


def interval_of_reliability(
    drift: DriftPolynomial, start: LastValue, target: float, low: float | None, high: float | None
) -> float:
    """Days until the probability of lying within the limits falls to the target; infinite where it hardly does."""

    def excess(days: Floats) -> Floats:
        return reliability_after(drift, start, days, low, high) - target

    times = np.concatenate([[0.0], np.geomspace(1e-4, _FAR, _STEPS) * drift.longest])
    short = excess(times) < 0
    i = int(np.argmax(short))
    if not i:
        return 0.0 if short[0] else float("inf")
    return float(scipy.optimize.brentq(lambda t: float(excess(np.array([t]))[0]), times[i - 1], times[i]))


def _powers(days: Floats, order: int) -> Floats:
    return np.asarray(np.asarray(days, dtype=np.float64)[:, None] ** np.arange(1, order + 1))


def _t(freedoms: Floats, distance: Floats, u: Floats) -> Floats:
    """Student's distribution function of ``distance/u``; a step where nothing is uncertain."""
    return np.asarray(np.where(u > 0, scipy.special.stdtr(freedoms, distance / np.where(u > 0, u, 1.0)), distance >= 0))


def series_from(certificates: Sequence[RecordedCertificate], name: str) -> Series:
    """One value over certificates of one machine, by day, as the records give it."""
    rows = [(one, value) for one in certificates for value in one.values if value.name == name]
    last = rows[-1][1]
    return Series.of(name, last.quantity, last.unit, [value.limit for _, value in rows], [
        (one.day, value.value, value.u, value.u_artefact, one.artefact, one.entry, one.adjusted_since, one.interim)
        for one, value in rows
    ])  # fmt: skip


DriftInterval = tuple[float, str, bool]
KNOWN: dict[str, DriftInterval] = {}
"""What was found by drift, by the hash of what it came from, for whoever keeps it: only new histories take time then."""


def drift_interval(
    certificates: Sequence[RecordedCertificate], reliability: float, priors: Mapping[str, DriftPrior]
) -> DriftInterval:
    """Days from the last calibration until the first of the errors may have crossed its limit, and which one it is.

    Infinite beyond the model's horizon; last, whether its prior is a fleet's. Interim checks count: the model takes all that
    was seen, as its history does.
    """
    last = calibrations(certificates)[-1]
    stated = (series_from(certificates, one.name) for one in last.values if rules.is_of_machine(one.unit))
    limited = [(one, one.limit) for one in stated if one.limit]
    if not limited:
        raise CmmUqError(say("its certificate has no limits"))
    limited.sort(key=lambda each: -abs(each[0].value[-1]) / each[1])  # how soon the first crosses says how far to look
    together: dict[tuple[float, str, int], list[tuple[Series, DriftHistory, float]]] = {}
    refused: CmmUqError | None = None
    for i, (one, limit) in enumerate(limited):  # in units of its limit all that no fleet tells of have one prior
        learnt = one.name if one.name in priors else ""
        try:
            own = history(one).in_units(1.0 if learnt else limit)
        except CmmUqError as error:
            refused = error
            continue
        together.setdefault((own.day[-1], learnt, i // _AT_ONCE), []).append((one, own, limit if learnt else 1.0))
    begin, part = last.day.toordinal(), 1 - reliability
    found: list[DriftInterval] = []
    for (day, learnt, _), each in together.items():
        machines, prior = side_by_side([own for _, own, _ in each]), priors.get(learnt) or default_prior(1.0)
        until = min(found, default=(HORIZON * YEAR,))[0] + begin - day + 1
        limits = np.array([limit for *_, limit in each])
        crossed = crossings(machines, prior, filtered(machines, prior), limits, until=until, days=FINE, enough=part)
        days = np.floor(crossed.quantile(part)) + day - begin
        found += [(float(after), one.quantity, bool(learnt)) for after, (one, *_) in zip(days, each, strict=True)]
    if not found:
        raise refused or CmmUqError(say("nothing in its history can be followed"))
    return min(found)


LIKE_DAYS, LIKE_PART = 56.0, 0.5
"""An interval is like the assigned one where it differs by no more than eight weeks, nor by half of it (as suncal has it)."""

Priors = Mapping[str, DriftPrior]


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
    ended = rules.ended_intervals(certificates)
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
    pairs = [(a, b) for a, b in pairwise(done) if b.day > a.day and not rules.adjusted_between(a, b)]
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
    key = sha256(repr((rules.program(), certificates, rule.reliability)).encode()).hexdigest()
    kept: dict[str, DriftInterval] = {} if priors else KNOWN  # a fleet learns with every entry
    length, name, learnt = kept[key] = kept.get(key) or drift_interval(certificates, rule.reliability, priors)
    why = say("{model}: {name} has not crossed its limit with {target} % for {reached}", name=Verbatim(name),
              model=say("drift model with its fleet") if learnt else say("drift model without a fleet"),
              target=_percent(rule.reliability), reached=_lasting(length))  # fmt: skip
    return rule.changing.bounded(length), why


def _lasting(days: float) -> Text:
    return say("{days} days", days=number(days, ".0f")) if np.isfinite(days) else say("longer than can be foreseen")


def _percent(part: float) -> Text:
    return number(100 * part, ".3g")


METHODS = {"A3": _a3, "S2": _s2, "staircase": _staircase, "control chart": _control_chart, "drift": _drift}
"""Days and the reason, from the rule, certificates, intervals of the model and priors of the fleet; refuses in words."""
