"""Decision rules: from a value, its uncertainty and a limit to the decision on that one quantity.

A quantity with a sign, as an error of indication, is limited on both sides (−limit to +limit); a range or a form, which is
never negative, on one. The probability of conforming is that of a normal distribution about the value, with nothing known
of the quantity beforehand (JCGM 106:2012, 7.2): it is what the measurement alone says.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from scipy import optimize, special

from cmm_uq.jobs.conformity import FalseAccept, GuardBand, Rule
from cmm_uq.messages import NOTHING, Text, say

Outcome = Literal["pass", "fail", "undecided"]

CONFORMANCE_PROBABILITY = 0.95
"""Default of ISO 14253-1:2017, 5.2: conformity or nonconformity is proved with 95 %."""

COVERAGE_FACTOR = 2.0
"""k of the expanded uncertainty that a guard band is a multiple of (ILAC-G8:09/2019, 4.2.2)."""


@dataclass(frozen=True)
class Decision:
    """What follows from a value and a limit under a rule.

    Parameters
    ----------
    outcome : ``undecided`` when neither conformity nor nonconformity is proved.
    probability_conforming : that the quantity is within its limits; ``None`` without an uncertainty.
    probability_beyond : the rest of it, kept apart since 1 − P loses what is small.
    guard_band : how far the acceptance limit lies inside the limit, same unit; ``None`` when the uncertainty is too large for
        any value to be accepted.
    rule : in words.
    """

    outcome: Outcome
    probability_conforming: float | None
    probability_beyond: float | None
    guard_band: float | None
    rule: Text


def decide(value: float, u: float, limit: float, rule: Rule, *, signed: bool) -> Decision:
    """Decide whether a quantity conforms.

    Conformity is proved by a value inside the limits only, nonconformity by a value outside only, however large u is.

    Parameters
    ----------
    value, u : measured value and its standard uncertainty; u = 0 says that none is known.
    limit : same unit, positive.
    rule : ``simple`` (JCGM 106:2012, 8.2.1), ``ISO 14253-1`` (conformity proved with a probability of at least 95 %,
        nonconformity where that of conforming is at most 5 %), a guard band of so many expanded uncertainties with k = 2, or
        a largest probability of false acceptance of this item (JCGM 106:2012, 9.5; as large a one of false rejection).
    signed : whether the limit holds on both sides of zero.

    Raises
    ------
    ValueError : the rule needs an uncertainty and there is none.
    """
    if u <= 0 and needs_uncertainty(rule):
        raise ValueError(f"the rule {rule_name(rule)} needs an uncertainty")
    size = abs(value) if signed else value
    beyond = _beyond(size, u, limit, signed) if u > 0 else None
    within = None if beyond is None else _within(size, u, limit, signed, beyond)
    risk = _risk(rule)
    if risk is None or within is None or beyond is None:
        width = rule.guard_band * COVERAGE_FACTOR * u if isinstance(rule, GuardBand) else 0.0
        band = width if width <= limit else None
        outcome = _by_band(size, limit, width)
    else:
        band = _guard_band(u, limit, risk, signed)
        outcome = _by_probability(size, limit, within, beyond, risk)
    return Decision(outcome, within, beyond, band, _words(rule, band, u))


def _risk(rule: Rule) -> float | None:
    """Largest probability of a wrong acceptance, and of a wrong rejection; ``None`` for rules that do not go by it."""
    if isinstance(rule, FalseAccept):
        return rule.max_false_accept
    return 1 - CONFORMANCE_PROBABILITY if rule == "ISO 14253-1" else None


def needs_uncertainty(rule: Rule) -> bool:
    """Whether a rule says nothing without an uncertainty: every one but simple acceptance."""
    return rule != "simple"


def rule_name(rule: Rule) -> str:
    """The rule as job.toml names it."""
    if isinstance(rule, GuardBand):
        return f"guard_band = {rule.guard_band:g}"
    return f"max_false_accept = {rule.max_false_accept:g}" if isinstance(rule, FalseAccept) else rule


def _within(size: float, u: float, limit: float, signed: bool, beyond: float) -> float:
    """Probability of the quantity within its limits, without loss of digits where it is small."""
    nearer = float(special.ndtr((limit - size) / u))
    if not signed:
        return nearer
    return nearer - float(special.ndtr((-limit - size) / u)) if size > limit else max(0.0, 1.0 - beyond)


def _beyond(size: float, u: float, limit: float, signed: bool) -> float:
    """Probability of the quantity outside its limits: beyond the nearer one, and with a sign also beyond the other."""
    nearer = float(special.ndtr((size - limit) / u))
    return nearer + float(special.ndtr((-limit - size) / u)) if signed else nearer


def _by_band(size: float, limit: float, band: float) -> Outcome:
    if size <= limit - band:
        return "pass"
    return "fail" if size >= limit + band else "undecided"


def _by_probability(size: float, limit: float, within: float, beyond: float, risk: float) -> Outcome:
    if size <= limit and beyond <= risk:
        return "pass"
    return "fail" if size > limit and within <= risk else "undecided"


def _guard_band(u: float, limit: float, risk: float, signed: bool) -> float | None:
    """Distance of the largest acceptable value from the limit; ``None`` when no value is acceptable."""
    one_sided = max(0.0, -float(special.ndtri(risk))) * u
    if not signed or _beyond(limit - one_sided, u, limit, signed) <= risk * (1 + 1e-12):
        return one_sided
    if _beyond(0.0, u, limit, signed) > risk:
        return None
    return limit - float(optimize.brentq(lambda v: _beyond(v, u, limit, signed) - risk, 0.0, limit, xtol=1e-12 * limit))


def _words(rule: Rule, band: float | None, u: float) -> Text:
    if rule == "simple":
        return say("simple acceptance (JCGM 106:2012, 8.2.1)")
    if isinstance(rule, GuardBand):
        return say("guard band {guard_band:g} U, k = 2 (ILAC-G8:09/2019)", guard_band=rule.guard_band)
    if isinstance(rule, FalseAccept):
        return say(
            "probability of false acceptance at most {max_false_accept:g} (JCGM 106:2012, 9.5)",
            max_false_accept=rule.max_false_accept,
        )
    told = NOTHING if band is None else say("guard band {band:.3g} u ", band=band / u)
    return say("ISO 14253-1:2017, {told}(95 %)", told=told)
