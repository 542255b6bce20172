"""Decision rules: from a value, its uncertainty and a limit to the decision on that one quantity.

A quantity with a sign, as an error of indication, is limited on both sides (−limit to +limit); a range or a form, which is
never negative, on one. Without a prior the probability of conforming is that of a normal distribution about the value, with
nothing known of the quantity beforehand (JCGM 106:2012, 7.2): what the measurement alone says, which is too sure of itself
where the limit is near; with a prior it is that of the posterior distribution.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import hypot, isfinite
from typing import Literal

from scipy import special

from cmm_uq.analysis.conformity.risk import Known, acceptance_limit
from cmm_uq.base.messages import Text, say
from cmm_uq.jobs.conformity import (
    FalseAccept,
    GuardBand,
    PosteriorProbability,
    Rule,
    UncertaintyRatio,
    UnconditionalRisk,
)
from cmm_uq.maths.inference.root import root

Outcome = Literal["pass", "conditional pass", "undecided", "conditional fail", "fail"]

CONFORMANCE_PROBABILITY = 0.95
"""Default of ISO 14253-1:2017, 5.2: conformity or nonconformity is proved with 95 %."""

COVERAGE_FACTOR = 2.0
"""k of the expanded uncertainty that a guard band is a multiple of (ILAC-G8:09/2019, 4.2.2)."""

RATIO = 4.0
"""Zone of the specification over the uncertainty interval, where ASME B89.7.3.1 is named without another."""

UNCONDITIONAL = 0.02
"""Largest share of wrongly accepted items (ANSI/NCSL Z540.3-2006, 5.3 b)."""


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


def decide(
    value: float, u: float, limit: float, rule: Rule, *, signed: bool, prior: Known | None = None, unstated: float = 0.0
) -> Decision:  # fmt: skip
    """Decide whether a quantity conforms.

    Conformity is proved by a value inside the limits only, nonconformity by a value outside only, however large u is. The
    binary rule of ILAC-G8 alone rejects inside them. No larger size has a better outcome, and what has no value is outside.

    Parameters
    ----------
    value, u : measured value and its standard uncertainty; u = 0 says that none is known.
    limit : same unit, positive.
    rule : ``simple`` (JCGM 106:2012, 8.2.1); the same where the zone of the specification is so many times as wide as the
        uncertainty interval (ASME B89.7.3.1-2001, N : 1); ``ISO 14253-1`` (conformity proved with a probability of at least
        95 %, nonconformity where that of conforming is at most 5 %); a guard band of so many expanded uncertainties with
        k = 2; ILAC-G8:09/2019 with a guard band of one such, binary (4.2.2) or non-binary (4.2.3); a largest probability of
        false acceptance of this item (JCGM 106:2012, 9.5.2; as large a one of false rejection); a least probability of
        conforming with the prior (JCGM 106:2012, 8.3; as large a one of not conforming for nonconformity); a largest share of
        wrongly accepted items (ANSI/NCSL Z540.3-2006, 5.3 b).
    signed : whether the limit holds on both sides of zero.
    prior : what is known of the quantity beforehand.
    unstated : standard uncertainty of what is not stated: by ISO 14253-1 it counts before nonconformity is proved.

    Raises
    ------
    ValueError : the rule needs an uncertainty or a prior, and there is none.
    """
    if u <= 0 and needs_uncertainty(rule):
        raise ValueError(f"the rule {rule_name(rule)} needs an uncertainty")
    size = abs(value) if signed else value
    if not isfinite(size):
        return Decision("fail", None, None, 0.0, rule_words(rule))
    if u <= 0:
        return Decision("pass" if size <= limit else "fail", None, None, 0.0, rule_words(rule))
    beyond = _beyond(size, u, limit, signed)
    within = _within(size, u, limit, signed, beyond)
    known = None if prior is None else prior.after(value, u)
    if known is None:
        outcome, band = _decided(size, u, limit, rule, signed, beyond, unstated)
    else:
        within, beyond = known.within(limit, signed=signed), known.beyond(limit, signed=signed)
        outcome, band = _decided_knowing(value, u, limit, rule, signed, prior or known, unstated)
    return Decision(outcome, within, beyond, band, rule_words(rule, None if band is None else band / u))


def _decided(
    size: float, u: float, limit: float, rule: Rule, signed: bool, beyond: float, unstated: float
) -> tuple[Outcome, float | None]:
    """Outcome and guard band, by rules that need no prior."""
    if (ratio := least_ratio(rule)) is not None:
        wide = (2 if signed else 1) * limit >= ratio * 2 * COVERAGE_FACTOR * u
        return (_by_band(size, limit, 0.0), 0.0) if wide else ("undecided", None)
    if (risk := largest_risk(rule)) is not None:
        # Beyond the nearer limit by the guard band: to lie anywhere else than between two limits is no proof, for u large.
        doubt = hypot(u, unstated) if isinstance(rule, str) else u
        within = float(special.ndtr((limit - size) / doubt))
        return _by_probability(size, limit, within, beyond, risk), _guard_band(u, limit, risk, signed)
    width = guard_width(rule) * COVERAGE_FACTOR * u
    band = width if width <= limit else None
    if "non-binary" in rule_name(rule):
        return _in_four(size, limit, width), band
    if "binary" in rule_name(rule):
        return "pass" if size <= limit - width else "fail", band
    return _by_band(size, limit, width), band


def _decided_knowing(
    value: float, u: float, limit: float, rule: Rule, signed: bool, prior: Known, unstated: float
) -> tuple[Outcome, float | None]:
    """The same with a prior, of which rules that need none take no account.

    A prior that leans to one side makes a small error of the other sign less likely to conform than a large one: the outcome
    is that of the less favourable sign.
    """
    size = abs(value) if signed else value
    if (share := largest_share(rule)) is not None:
        accepted = acceptance_limit(share, limit, u, prior, signed=signed)
        if accepted is not None and size <= accepted:
            return "pass", limit - accepted
        return "fail" if size > limit else "undecided", None if accepted is None else limit - accepted
    if (least := least_probability(rule)) is None:
        return _decided(size, u, limit, rule, signed, _beyond(size, u, limit, signed), unstated)
    both = [prior.after(side * value, u) for side in ((1, -1) if signed and prior.mean else (1,))]
    within = min(known.within(limit, signed=signed) for known in both)
    beyond = max(known.beyond(limit, signed=signed) for known in both)
    outcome = _by_probability(size, limit, within, beyond, 1 - least)
    side = -1.0 if signed and value < 0 else 1.0
    return outcome, _posterior_band(u, limit, 1 - least, signed, prior, side)


def largest_risk(rule: Rule) -> float | None:
    """Largest probability of a wrong acceptance, and of a wrong rejection; ``None`` for rules that do not go by it."""
    if isinstance(rule, FalseAccept):
        return rule.max_false_accept
    return 1 - CONFORMANCE_PROBABILITY if rule_name(rule).startswith("ISO 14253-1") else None


def least_ratio(rule: Rule) -> float | None:
    """N of an N : 1 rule."""
    if isinstance(rule, UncertaintyRatio):
        return rule.uncertainty_ratio
    return RATIO if rule_name(rule).startswith("ASME B89.7.3.1") else None


def least_probability(rule: Rule) -> float | None:
    """Least posterior probability of conforming."""
    if isinstance(rule, PosteriorProbability):
        return rule.posterior_probability
    return CONFORMANCE_PROBABILITY if rule_name(rule).startswith("JCGM 106") else None


def largest_share(rule: Rule) -> float | None:
    """Largest share of wrongly accepted items."""
    if isinstance(rule, UnconditionalRisk):
        return rule.max_unconditional_false_accept
    return UNCONDITIONAL if "Z540.3" in rule_name(rule) else None


def guard_width(rule: Rule) -> float:
    """Guard band in expanded uncertainties."""
    if isinstance(rule, GuardBand):
        return rule.guard_band
    return 1.0 if rule_name(rule).startswith("ILAC-G8") else 0.0


def needs_uncertainty(rule: Rule) -> bool:
    """Whether a rule says nothing without an uncertainty: every one but simple acceptance."""
    return rule != "simple"


def rule_name(rule: Rule) -> str:
    """The rule as job.toml names it."""
    if isinstance(rule, str):
        return rule
    ((key, value),) = rule.model_dump().items()
    return f"{key} = {value:g}"


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


def _in_four(size: float, limit: float, band: float) -> Outcome:
    """ILAC-G8:09/2019, 4.2.3."""
    if size <= limit:
        return "pass" if size <= limit - band else "conditional pass"
    return "fail" if size > limit + band else "conditional fail"


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
    return limit - root(lambda v: _beyond(v, u, limit, signed) - risk, 0.0, limit, 1e-12 * limit)


def _posterior_band(u: float, limit: float, risk: float, signed: bool, prior: Known, side: float) -> float | None:
    """The same with a prior, on the side of the value."""

    def excess(size: float) -> float:
        return prior.after(side * size, u).beyond(limit, signed=signed) - risk

    if excess(limit) <= 0:
        return 0.0
    return None if excess(0.0) > 0 else limit - root(excess, 0.0, limit, 1e-12 * limit)


@lru_cache(maxsize=1024)  # the lengths of a test have one rule, and mostly one guard band
def rule_words(rule: Rule, band: float | None = None) -> Text:
    """A rule in words; ``band`` is its guard band in standard uncertainties."""
    if rule == "simple":
        return say("simple acceptance (JCGM 106:2012, 8.2.1)")
    if (ratio := least_ratio(rule)) is not None:
        return say("simple acceptance with an uncertainty ratio of {ratio:g} : 1 (ASME B89.7.3.1-2001)", ratio=ratio)
    if isinstance(rule, GuardBand):
        return say("guard band {guard_band:g} U, k = 2 (ILAC-G8:09/2019)", guard_band=rule.guard_band)
    if isinstance(rule, FalseAccept):
        return say(
            "probability of false acceptance at most {max_false_accept:g} (JCGM 106:2012, 9.5)",
            max_false_accept=rule.max_false_accept,
        )
    if (least := least_probability(rule)) is not None:
        return say("posterior probability of conforming at least {least:g} (JCGM 106:2012, 8.3)", least=least)
    if (share := largest_share(rule)) is not None:
        return say("at most {share:g} of all items wrongly accepted (ANSI/NCSL Z540.3-2006, 5.3 b)", share=share)
    if rule_name(rule).startswith("ILAC-G8"):
        if "non-binary" in rule_name(rule):
            return say("non-binary, guard band U, k = 2 (ILAC-G8:09/2019, 4.2.3)")
        return say("binary, guard band U, k = 2 (ILAC-G8:09/2019, 4.2.2)")
    if band is None:
        return say("ISO 14253-1:2017 (95 %)")
    return say("ISO 14253-1:2017, guard band {band:.3g} u (95 %)", band=band)
