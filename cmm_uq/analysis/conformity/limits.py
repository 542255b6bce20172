"""Limits of a characteristic, and the decision on a value against them.

The error need not be normal, and a limit may stand on either side or on one. The draws say what the measurement alone says of
the true value (JCGM 106:2012, 7.2); with a prior each is weighted by it (JCGM 106:2012, 7.2.2, 8.3). Tails that the draws are
too few for are those of a normal distribution where these are larger.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf, isfinite

import numpy as np
import scipy

from cmm_uq.analysis.conformity import decision
from cmm_uq.analysis.conformity.decision import COVERAGE_FACTOR, Outcome, PriorKnowledge, guard_width, rule_name
from cmm_uq.base.messages import Text
from cmm_uq.base.points import Floats
from cmm_uq.base.values import dataclass, field, replace
from cmm_uq.jobs.tables.conformity import Rule

RARE = 50  # Draws beyond a limit, from which on their share is taken for the probability
FEWEST = 500  # Effective draws of a weighted sample; with fewer the posterior is that of normal distributions
SCARCE = 0.05  # share of draws, below which those possible say nothing of a zone: it is taken as large as its error
# smallest and largest value that a rule accepts; None of a side without a limit
Ends = tuple[float | None, float | None]
_GRID, _HALVINGS, _NODES, _REACH = 33, 30, 2000, 8.0


@dataclass(frozen=True)
class LimitDecision:
    lower: float | None
    upper: float | None
    outcome: Outcome | None  # None where nothing was measured
    # probability, beyond: that the true value conforms, and the rest of it, which keeps its digits
    probability: float | None
    beyond: float | None
    # smallest and largest value that the rule accepts, None of a side without a limit, and as a whole where it accepts
    # none, or where a zone was measured so much better than its errors that even this value proves nothing
    accepted: Ends | None
    rule: Text
    share_of_prior: float | None = None  # of its weight in what is known of the value; None without a prior

    @property
    def not_passing(self) -> LimitDecision:
        """The same, undecided where it would be a pass, conditional or not."""
        return replace(self, outcome="undecided") if self.outcome in ("pass", "conditional pass") else self


@dataclass(frozen=True, eq=False)
class Limits:
    """Limits of a drawing, and what is known of errors of measurement."""

    lower: float | None  # lower, upper: limits, one at least
    upper: float | None
    errors: Floats  # (N,) draws of the error of a value, less their mean, ascending
    # whether the value is a width that is never negative: probabilities are those given that it is not, or, where
    # fewer than one draw in twenty leaves it so, those of a width as large as the error
    zone: bool = False
    prior: PriorKnowledge | None = None  # what is known of the true value beforehand; of a zone the part above zero
    u: float = field(init=False)
    low: float = field(init=False)  # low, high: the limits, infinite where there is none
    high: float = field(init=False)

    def __post_init__(self) -> None:
        errors, low, high = np.sort(self.errors), self.lower, self.upper
        known = {"errors": errors, "u": float(np.sqrt(np.mean(errors**2))), "low": -inf if low is None else low,
                 "high": inf if high is None else high}  # fmt: skip
        for name, value in known.items():
            object.__setattr__(self, name, value)

    @property
    def width(self) -> float:
        """Of the zone that the limits leave; infinite where it is open."""
        return self.high - (0.0 if self.zone and self.lower is None else self.low)

    def inside(self, value: float) -> bool:
        return self.low <= value <= self.high

    def beyond(self, value: float) -> float:
        """Probability of the true value outside, by what the measurement alone says."""
        above = self._below(value - self.high)
        if self._scarce(value):
            return min(1.0, above + self._above(value + self.high))
        return min(1.0, (above + self._above(value - self.low)) / self._possible(value))

    def within(self, value: float) -> float:
        """Probability of the true value inside, with its digits where it is small."""
        if self.zone:
            if self.lower is not None or value <= self.high or self._scarce(value):
                return 1.0 - self.beyond(value)
            return max(0.0, self._above(value - self.high) - self._above(value)) / self._possible(value)
        if self.inside(value):
            return 1.0 - self.beyond(value)
        if value > self.high:
            return max(0.0, self._above(value - self.high) - self._above(value - self.low))
        return max(0.0, self._below(value - self.low) - self._below(value - self.high))

    def _scarce(self, value: float) -> bool:
        return self.zone and self.lower is None and self._below(value) < SCARCE

    def _possible(self, value: float) -> float:
        return max(self._below(value), np.finfo(np.float64).tiny) if self.zone else 1.0

    def _below(self, error: float) -> float:
        count = int(np.searchsorted(self.errors, error, "left"))
        return self._tail(count, error / self.u if self.u else np.inf * error)

    def _above(self, error: float) -> float:
        count = len(self.errors) - int(np.searchsorted(self.errors, error, "right"))
        return self._tail(count, -error / self.u if self.u else -np.inf * error)

    def _tail(self, count: int, deviations: float) -> float:
        drawn = count / len(self.errors)
        if count >= RARE or np.isnan(deviations):
            return drawn
        return max(drawn, min(float(scipy.special.ndtr(deviations)), RARE / len(self.errors)))

    def knowing(self, value: float) -> tuple[float, float]:
        """Probabilities of the true value inside and outside, with what the prior says."""
        prior = self.prior
        if prior is None:
            return self.within(value), self.beyond(value)
        true = np.abs(value - self.errors) if self._scarce(value) else value - self.errors
        weight = np.exp(-0.5 * ((true - prior.mean) / prior.sd) ** 2)
        if self.zone:
            weight = np.where(true < 0, 0.0, weight)
        total = float(weight.sum())
        if total**2 < FEWEST * float(np.sum(weight**2)) or not total:
            known = prior.after(value, self.u)
            least = float(scipy.special.ndtr(-known.mean / known.sd)) if self.zone else 0.0
            low, high = (float(scipy.special.ndtr((limit - known.mean) / known.sd)) for limit in (self.low, self.high))
            inside = max(0.0, high - max(least, low)) / max(1.0 - least, np.finfo(np.float64).tiny)
            return min(1.0, inside), max(0.0, 1.0 - inside)
        outside = (true > self.high) | (true < self.low)
        return float(weight[~outside].sum()) / total, float(weight[outside].sum()) / total

    def doubt(self, value: float) -> float:
        """Probability of the true value outside with what the prior says, by the least favourable of errors up to these."""
        if self.prior is None or not self.inside(value):
            return self.knowing(value)[1]
        known, up = self.prior, value - self.high >= self.low - value
        side, limit = (1.0, self.high) if up else (-1.0, -self.low)
        least = replace(known, mean=side * known.mean).least_favourable(side * value, self.u, limit)
        narrower = self if least >= self.u else replace(self, errors=self.errors * (least / self.u))
        return narrower.knowing(value)[1]

    def wrongly_accepted(self, guard: float) -> float:
        """Share of all items that lie outside and are accepted, with acceptance so far inside the limits."""
        prior = self.prior
        if prior is None:
            raise ValueError("the share of wrongly accepted items needs a prior")
        reach, found = _REACH * np.hypot(prior.sd, self.u), 0.0
        for limit, side in ((self.low, -1.0), (self.high, 1.0)):
            if isfinite(limit):
                true = limit + side * reach * (np.arange(_NODES) + 0.5) / _NODES
                density = np.exp(-0.5 * ((true - prior.mean) / prior.sd) ** 2) / (prior.sd * np.sqrt(2 * np.pi))
                high = np.searchsorted(self.errors, self.high - guard - true, "right")
                low = np.searchsorted(self.errors, self.low + guard - true, "left")
                accepted = high / len(self.errors) - low / len(self.errors)
                found += float(np.sum(density * np.maximum(0.0, accepted))) * reach / _NODES
        return found / (float(scipy.special.ndtr(prior.mean / prior.sd)) if self.zone else 1.0)


def judge(limits: Limits, rule: Rule, value: float | None) -> LimitDecision:
    """Decide whether a value, less the mean error, conforms; ``None`` where nothing was measured."""
    accepted, words = accepted_by(limits, rule), decision.rule_words(rule)
    if value is None:
        return LimitDecision(limits.lower, limits.upper, None, None, None, accepted, words)
    if limits.zone:
        accepted = _accepted_near_zero(limits, rule, value, accepted)
    outcome = outcome_of(limits, rule, value, accepted)
    share = None if limits.prior is None else limits.prior.share(limits.u)
    return LimitDecision(limits.lower, limits.upper, outcome, *limits.knowing(value), accepted, words, share)


def outcome_of(limits: Limits, rule: Rule, value: float, accepted: Ends | None) -> Outcome:
    """What a rule makes of a value, where it is known which values it accepts."""
    inside, taken = limits.inside(value), _between(value, accepted) and _safe(limits, rule, value)
    if "non-binary" in rule_name(rule):
        if inside:
            return "pass" if taken else "conditional pass"
        return "fail" if _off(limits, value) > guard_width(rule) * COVERAGE_FACTOR * limits.u else "conditional fail"
    if taken and inside:
        return "pass"
    return "fail" if "binary" in rule_name(rule) or (not inside and _proved(limits, rule, value)) else "undecided"


def _accepted_near_zero(limits: Limits, rule: Rule, value: float, accepted: Ends | None) -> Ends | None:
    """What a rule accepts of a zone, where it may have been measured better than its errors: see :func:`_safe`."""
    if not _safe(limits, rule, value):
        return None if _between(value, accepted) else accepted
    proves = decision.largest_risk(rule) is not None or decision.least_probability(rule) is not None
    return (None, 0.0) if proves and accepted is None and value < 0 and limits.lower is None else accepted


def _safe(limits: Limits, rule: Rule, value: float) -> bool:
    """Whether a value below the acceptance limit conforms as probably as the rule asks."""
    if not limits.zone:
        return True
    if (least := decision.least_probability(rule)) is not None:
        return limits.doubt(value) <= 1 - least
    if (risk := decision.largest_risk(rule)) is None and (guard := guard_width(rule)):
        risk = float(scipy.special.ndtr(-guard * COVERAGE_FACTOR))
    return risk is None or limits.beyond(value) <= risk


def _proved(limits: Limits, rule: Rule, value: float) -> bool:
    if decision.least_ratio(rule) is not None:
        return _wide(limits, rule)
    if (risk := decision.largest_risk(rule)) is not None:
        return limits.within(value) <= risk
    if (least := decision.least_probability(rule)) is not None:
        return limits.knowing(value)[0] <= 1 - least
    if decision.largest_share(rule) is not None:
        return True
    return _off(limits, value) >= guard_width(rule) * COVERAGE_FACTOR * limits.u


def _off(limits: Limits, value: float) -> float:
    return float(max(value - limits.high, limits.low - value))


def _wide(limits: Limits, rule: Rule) -> bool:
    """Whether the limits are so many times as far apart as the uncertainty interval; open ones always are."""
    return limits.width >= (decision.least_ratio(rule) or 0.0) * 2 * COVERAGE_FACTOR * limits.u


def accepted_by(limits: Limits, rule: Rule) -> Ends | None:
    if decision.least_ratio(rule) is not None:
        return (limits.lower, limits.upper) if _wide(limits, rule) else None
    if (risk := decision.largest_risk(rule)) is not None:
        return _where(limits, lambda value: limits.beyond(value) <= risk)
    share, least = decision.largest_share(rule), decision.least_probability(rule)
    alone = share if least is None else 1 - least
    if alone is not None and _where(limits, lambda value: limits.beyond(value) <= alone) is None:
        return None  # what makes it likely is the prior, whatever was measured
    if least is not None:
        return _where(limits, lambda value: limits.doubt(value) <= 1 - least)
    if share is not None:
        return _inwards(limits, _smallest_guard(limits, share))
    return _inwards(limits, guard_width(rule) * COVERAGE_FACTOR * limits.u)


def _inwards(limits: Limits, guard: float | None) -> Ends | None:
    if guard is None:
        return None
    low, high = limits.low + guard, limits.high - guard
    if low > high or (limits.zone and high < 0):
        return None
    return None if limits.lower is None else low, None if limits.upper is None else high


def _smallest_guard(limits: Limits, share: float) -> float | None:
    if limits.wrongly_accepted(0.0) <= share:
        return 0.0
    largest = limits.width if limits.lower is None else 0.5 * limits.width
    largest = largest if isfinite(largest) else _REACH * limits.u
    if limits.wrongly_accepted(largest) > share:
        return None
    return _edge(lambda guard: limits.wrongly_accepted(guard) <= share, largest, 0.0)


def _where(limits: Limits, holds: Callable[[float], bool]) -> Ends | None:
    span = _REACH * max(limits.u, float(np.ptp(limits.errors)))
    low = limits.lower if limits.lower is not None else (limits.upper or 0.0) - span
    high = limits.upper if limits.upper is not None else (limits.lower or 0.0) + span
    if limits.zone and limits.lower is None:
        low = min(0.0, high)
    good = [value for value in np.linspace(low, high, _GRID).tolist() if holds(value)]
    if not good:
        return None
    first, last = good[0], good[-1]
    if limits.lower is not None and first > low:
        first = _edge(holds, first, low)
    if limits.upper is not None and last < high:
        last = _edge(holds, last, high)
    return None if limits.lower is None else first, None if limits.upper is None else last


def _edge(holds: Callable[[float], bool], good: float, bad: float) -> float:
    for _ in range(_HALVINGS):
        middle = 0.5 * (good + bad)
        if middle in (good, bad):
            break
        good, bad = (middle, bad) if holds(middle) else (good, middle)
    return good


def _between(value: float, accepted: Ends | None) -> bool:
    if accepted is None:
        return False
    low, high = accepted
    return (low is None or value >= low) and (high is None or value <= high)
