"""Limits of a characteristic, and the decision on a value against them.

The error need not be normal, and a limit may stand on either side or on one. The draws say what the measurement alone says of
the true value (JCGM 106:2012, 7.2); with a prior each is weighted by it (JCGM 106:2012, 7.2.2, 8.3). Tails that the draws are
too few for are those of a normal distribution where these are larger.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from scipy import special

from cmm_uq.analysis.conformity.decision import (
    COVERAGE_FACTOR,
    Outcome,
    PriorKnowledge,
    guard_width,
    largest_risk,
    largest_share,
    least_probability,
    least_ratio,
    rule_name,
    rule_words,
)
from cmm_uq.base.messages import Text
from cmm_uq.base.points import Floats
from cmm_uq.jobs.tables.conformity import Rule

RARE = 50  # Draws beyond a limit, from which on their share is taken for the probability
FEWEST = 500  # Effective draws of a weighted sample; with fewer the posterior is that of normal distributions
SCARCE = 0.05  # share of draws, below which those possible say nothing of a zone: it is taken as large as its error
_GRID, _HALVINGS, _NODES, _REACH = 33, 30, 2000, 8.0


@dataclass(frozen=True)
class LimitDecision:
    """What follows from a value between limits."""

    lower: float | None
    upper: float | None
    outcome: Outcome | None  # None where nothing was measured
    # probability, beyond: that the true value conforms, and the rest of it, which keeps its digits
    probability: float | None
    beyond: float | None
    # smallest and largest value that the rule accepts, None of a side without a limit, and as a whole where it accepts
    # none, or where a zone was measured so much better than its errors that even this value proves nothing
    accepted: tuple[float | None, float | None] | None
    rule: Text


@dataclass(frozen=True, eq=False)
class Limits:
    """Limits of a drawing, and what is known of errors of measurement."""

    lower: float | None  # lower, upper: limits, one at least
    upper: float | None
    errors: Floats  # (N,) draws of the error of a value, less their mean, ascending
    # whether the value is a width that is never negative: probabilities are those given that it is not, or, where;
    # fewer than one draw in twenty leaves it so, those of a width as large as the error
    zone: bool = False
    prior: PriorKnowledge | None = None  # what is known of the true value beforehand; of a zone the part above zero
    u: float = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "errors", np.sort(self.errors))
        object.__setattr__(self, "u", float(np.sqrt(np.mean(self.errors**2))))

    @property
    def width(self) -> float | None:
        """Of the zone that the limits leave; ``None`` where it is open."""
        low = 0.0 if self.zone and self.lower is None else self.lower
        return None if low is None or self.upper is None else self.upper - low

    def inside(self, value: float) -> bool:
        return (self.lower is None or value >= self.lower) and (self.upper is None or value <= self.upper)

    def beyond(self, value: float) -> float:
        """Probability of the true value outside, by what the measurement alone says."""
        found = 0.0
        if self.upper is not None:
            found += self._below(value - self.upper)
            if self._scarce(value):
                return min(1.0, found + self._above(value + self.upper))
        if self.lower is not None:
            found += self._above(value - self.lower)
        return min(1.0, found / self._possible(value))

    def within(self, value: float) -> float:
        """Probability of the true value inside, with its digits where it is small."""
        if self.zone:
            if self.upper is None or self.lower is not None or value <= self.upper or self._scarce(value):
                return 1.0 - self.beyond(value)
            return max(0.0, self._above(value - self.upper) - self._above(value)) / self._possible(value)
        if self.inside(value):
            return 1.0 - self.beyond(value)
        if self.upper is None or self.lower is None:
            low = self.lower or 0.0
            return min(1.0, self._below(value - low) if self.upper is None else self._above(value - self.upper))
        if value > self.upper:
            return max(0.0, self._above(value - self.upper) - self._above(value - self.lower))
        return max(0.0, self._below(value - self.lower) - self._below(value - self.upper))

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
        return max(drawn, min(float(special.ndtr(deviations)), RARE / len(self.errors)))

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
            least = float(special.ndtr(-known.mean / known.sd)) if self.zone else 0.0
            high = 1.0 if self.upper is None else float(special.ndtr((self.upper - known.mean) / known.sd))
            low = least if self.lower is None else max(least, float(special.ndtr((self.lower - known.mean) / known.sd)))
            inside = max(0.0, high - low) / max(1.0 - least, np.finfo(np.float64).tiny)
            return min(1.0, inside), max(0.0, 1.0 - inside)
        outside = np.zeros(len(true), dtype=bool)
        if self.upper is not None:
            outside |= true > self.upper
        if self.lower is not None:
            outside |= true < self.lower
        return float(weight[~outside].sum()) / total, float(weight[outside].sum()) / total

    def wrongly_accepted(self, guard: float) -> float:
        """Share of all items that lie outside and are accepted, with acceptance so far inside the limits."""
        prior = self.prior
        if prior is None:
            raise ValueError("the share of wrongly accepted items needs a prior")
        reach = _REACH * np.hypot(prior.sd, self.u)
        found = 0.0
        for limit, side in ((self.lower, -1.0), (self.upper, 1.0)):
            if limit is None:
                continue
            true = limit + side * reach * (np.arange(_NODES) + 0.5) / _NODES
            density = np.exp(-0.5 * ((true - prior.mean) / prior.sd) ** 2) / (prior.sd * np.sqrt(2 * np.pi))
            high = np.full(len(true), np.inf) if self.upper is None else self.upper - guard - true
            low = np.full(len(true), -np.inf) if self.lower is None else self.lower + guard - true
            counts = np.searchsorted(self.errors, high, "right"), np.searchsorted(self.errors, low, "left")
            accepted = counts[0] / len(self.errors) - counts[1] / len(self.errors)
            found += float(np.sum(density * np.maximum(0.0, accepted))) * reach / _NODES
        return found / (float(special.ndtr(prior.mean / prior.sd)) if self.zone else 1.0)


def judge(limits: Limits, rule: Rule, value: float | None) -> LimitDecision:
    """Decide whether a value, less the mean error, conforms; ``None`` where nothing was measured."""
    accepted = accepted_by(limits, rule)
    if value is None:
        return LimitDecision(limits.lower, limits.upper, None, None, None, accepted, rule_words(rule))
    within, beyond = limits.knowing(value)
    if limits.zone:
        accepted = _accepted_near_zero(limits, rule, value, accepted)
    outcome = outcome_of(limits, rule, value, accepted)
    return LimitDecision(limits.lower, limits.upper, outcome, within, beyond, accepted, rule_words(rule))


def outcome_of(limits: Limits, rule: Rule, value: float, accepted: tuple[float | None, float | None] | None) -> Outcome:
    """What a rule makes of a value, where it is known which values it accepts."""
    inside = limits.inside(value)
    taken = accepted is not None and _between(value, accepted) and _safe(limits, rule, value)
    if "non-binary" in rule_name(rule):
        if inside:
            return "pass" if taken else "conditional pass"
        return "fail" if _off(limits, value) > guard_width(rule) * COVERAGE_FACTOR * limits.u else "conditional fail"
    if taken and inside:
        return "pass"
    if "binary" in rule_name(rule):
        return "fail"
    return "fail" if not inside and _proved(limits, rule, value) else "undecided"


def _accepted_near_zero(
    limits: Limits, rule: Rule, value: float, accepted: tuple[float | None, float | None] | None
) -> tuple[float | None, float | None] | None:
    """What a rule accepts of a zone, where it may have been measured better than its errors: see :func:`_safe`."""
    if not _safe(limits, rule, value):
        return None if accepted is not None and _between(value, accepted) else accepted
    proves = largest_risk(rule) is not None or least_probability(rule) is not None
    return (None, 0.0) if proves and accepted is None and value < 0 and limits.lower is None else accepted


def _safe(limits: Limits, rule: Rule, value: float) -> bool:
    """Whether a value below the acceptance limit conforms as probably as the rule asks."""
    if not limits.zone:
        return True
    if (least := least_probability(rule)) is not None:
        return limits.knowing(value)[1] <= 1 - least
    if (risk := largest_risk(rule)) is None and (guard := guard_width(rule)):
        risk = float(special.ndtr(-guard * COVERAGE_FACTOR))
    return risk is None or limits.beyond(value) <= risk


def _proved(limits: Limits, rule: Rule, value: float) -> bool:
    if least_ratio(rule) is not None:
        return _wide(limits, rule)
    if (risk := largest_risk(rule)) is not None:
        return limits.within(value) <= risk
    if (least := least_probability(rule)) is not None:
        return limits.knowing(value)[0] <= 1 - least
    if largest_share(rule) is not None:
        return True
    return _off(limits, value) >= guard_width(rule) * COVERAGE_FACTOR * limits.u


def _off(limits: Limits, value: float) -> float:
    above = -np.inf if limits.upper is None else value - limits.upper
    return float(max(above, -np.inf if limits.lower is None else limits.lower - value))


def _wide(limits: Limits, rule: Rule) -> bool:
    """Whether the limits are so many times as far apart as the uncertainty interval; open ones always are."""
    ratio, width = least_ratio(rule) or 0.0, limits.width
    return width is None or width >= ratio * 2 * COVERAGE_FACTOR * limits.u


def accepted_by(limits: Limits, rule: Rule) -> tuple[float | None, float | None] | None:
    """Smallest and largest value that a rule accepts; see :class:`LimitDecision`."""
    if least_ratio(rule) is not None:
        return (limits.lower, limits.upper) if _wide(limits, rule) else None
    if (risk := largest_risk(rule)) is not None:
        return _where(limits, lambda value: limits.beyond(value) <= risk)
    if (least := least_probability(rule)) is not None:
        return _where(limits, lambda value: limits.knowing(value)[1] <= 1 - least)
    if (share := largest_share(rule)) is not None:
        return _inwards(limits, _smallest_guard(limits, share))
    return _inwards(limits, guard_width(rule) * COVERAGE_FACTOR * limits.u)


def _inwards(limits: Limits, guard: float | None) -> tuple[float | None, float | None] | None:
    if guard is None:
        return None
    low = None if limits.lower is None else limits.lower + guard
    high = None if limits.upper is None else limits.upper - guard
    if low is not None and high is not None and low > high:
        return None
    return None if limits.zone and high is not None and high < 0 else (low, high)


def _smallest_guard(limits: Limits, share: float) -> float | None:
    if limits.wrongly_accepted(0.0) <= share:
        return 0.0
    width = limits.width
    largest = _REACH * limits.u if width is None else width if limits.lower is None else 0.5 * width
    if limits.wrongly_accepted(largest) > share:
        return None
    return _edge(lambda guard: limits.wrongly_accepted(guard) <= share, largest, 0.0)


def _where(limits: Limits, holds: Callable[[float], bool]) -> tuple[float | None, float | None] | None:
    span = _REACH * max(limits.u, float(np.ptp(limits.errors)))
    low = limits.lower if limits.lower is not None else (limits.upper or 0.0) - span
    high = limits.upper if limits.upper is not None else (limits.lower or 0.0) + span
    if limits.zone and limits.lower is None:
        low = min(0.0, high)
    grid = np.linspace(low, high, _GRID).tolist()
    good = [value for value in grid if holds(value)]
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


def _between(value: float, accepted: tuple[float | None, float | None]) -> bool:
    low, high = accepted
    return (low is None or value >= low) and (high is None or value <= high)
