"""Decision rules: what follows from a measured value, its uncertainty and a limit, and the risks of being wrong.

A prior is a normal distribution, of what is never negative the part above zero (JCGM 106:2012, 7.2 and 9.5); without one the
probability of conforming is what the measurement alone says. A quantity with a sign is limited on both sides of zero, a range
or a form on one. Integrals are Gauss–Legendre sums over panels that are narrow where the integrand bends.
"""

from __future__ import annotations

from functools import lru_cache, partial
from math import erfc, hypot, isfinite, sqrt
from statistics import NormalDist
from typing import Literal

import numpy as np
import scipy

from cmm_uq.base.messages import Text, say
from cmm_uq.base.values import dataclass
from cmm_uq.jobs.tables import conformity
from cmm_uq.jobs.tables.conformity import FalseAccept, GuardBand, Rule
from cmm_uq.maths.inference.slow import root

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(24)
_REACH = 9.0  # Standard deviations beyond which a normal distribution is nothing: 1e-19


def phi(z: float) -> float:
    return 0.5 * erfc(-z / sqrt(2.0))


@dataclass(frozen=True)
class PriorKnowledge:
    mean: float  # mean, sd: of the normal distribution
    sd: float

    def after(self, value: float, u: float) -> PriorKnowledge:
        """The same after a measurement of it: precisions add (JCGM 106:2012, formula (A.9))."""
        weight = 1.0 - self.share(u)
        return PriorKnowledge(self.mean + weight * (value - self.mean), u * float(np.sqrt(weight)))

    def share(self, u: float) -> float:
        """How much of the posterior mean is the prior's, the rest being the measurement's."""
        return u**2 / (self.sd**2 + u**2)

    def least_favourable(self, value: float, u: float, limit: float) -> float:
        """Of all u up to this one that by which least lies below ``limit``, where ``value`` does: the derivative's zero."""
        turn = 2 * value - self.mean - limit
        return min(u, self.sd * sqrt(max(limit - value, 1e-12 * abs(limit)) / turn)) if turn > 0 else u

    def within(self, limit: float, *, signed: bool) -> float:
        below, high = (phi((at - self.mean) / self.sd) for at in (-limit if signed else 0.0, limit))
        return max(0.0, high - below) / (1.0 if signed else 1.0 - below) if signed or below < 1.0 else 1.0

    def beyond(self, limit: float, *, signed: bool) -> float:
        """The rest, which keeps its digits where it is small."""
        high, above = phi((self.mean - limit) / self.sd), phi(self.mean / self.sd)
        if signed:
            return high + phi((-limit - self.mean) / self.sd)
        return high / above if above > 0.0 else 0.0


@dataclass(frozen=True)
class Risks:
    consumer: float  # that an item does not conform and is accepted
    producer: float  # that an item conforms and is not accepted


@lru_cache(maxsize=4096)
def global_risks(acceptance: float, limit: float, u: float, prior: PriorKnowledge, *, signed: bool) -> Risks:
    """Of accepting values up to ``acceptance``, negative where none is accepted (JCGM 106:2012, 9.5.3 and 9.5.4)."""
    low = max(prior.mean - _REACH * prior.sd, -np.inf if signed else 0.0)
    high = max(prior.mean, 0.0) + _REACH * prior.sd
    total = 1.0 if signed else phi(prior.mean / prior.sd)
    bends = [-limit, limit, *(at + k * u for at in (-acceptance, acceptance) for k in range(-8, 9)),
             *(prior.mean + k * prior.sd for k in range(-9, 10))]  # fmt: skip
    edges = np.array(sorted({low, high, *np.clip(bends, low, high).tolist()}))
    half, middle = 0.5 * np.diff(edges)[:, None], 0.5 * (edges[1:] + edges[:-1])[:, None]
    values, weights = (middle + half * _NODES).ravel(), (half * _WEIGHTS).ravel()
    density = weights * np.exp(-0.5 * ((values - prior.mean) / prior.sd) ** 2) / (prior.sd * np.sqrt(2 * np.pi) * total)
    accepted = scipy.special.ndtr((acceptance - values) / u)
    if signed:
        accepted = np.maximum(0.0, accepted - scipy.special.ndtr((-acceptance - values) / u))
    conforming = np.abs(values) <= limit
    wrongly, rejected = density[~conforming] @ accepted[~conforming], density[conforming] @ (1.0 - accepted[conforming])
    return Risks(float(wrongly), float(rejected))


@lru_cache(maxsize=4096)
def acceptance_limit(risk: float, limit: float, u: float, prior: PriorKnowledge, *, signed: bool) -> float | None:
    """Largest acceptance limit with a consumer's global risk at most ``risk``; ``None`` where any value would exceed it."""

    def excess(acceptance: float) -> float:
        return global_risks(acceptance, limit, u, prior, signed=signed).consumer - risk

    if excess(limit) <= 0:
        return limit
    if excess(0.0) > 0:
        return None
    return root(excess, 0.0, limit, 1e-9 * limit)


Outcome = Literal["pass", "conditional pass", "undecided", "conditional fail", "fail"]
CONFORMANCE_PROBABILITY = 0.95  # Default of ISO 14253-1:2017, 5.2: conformity or nonconformity is proved with 95 %
COVERAGE_FACTOR = 2.0  # k of the expanded uncertainty that a guard band is a multiple of (ILAC-G8:09/2019, 4.2.2)
RATIO = 4.0  # Zone of the specification over the uncertainty interval, where ASME B89.7.3.1 is named without another
NOT_BY_PRIOR_ALONE = say(
    "By prior knowledge alone nothing is accepted: no value that a smaller uncertainty would not let pass, and none where the "
    "measurement by itself could prove none."
)
UNCONDITIONAL = 0.02  # Largest share of wrongly accepted items (ANSI/NCSL Z540.3-2006, 5.3 b)


@dataclass(frozen=True)
class Decision:
    outcome: Outcome  # undecided when neither conformity nor nonconformity is proved
    probability_conforming: float | None  # that the quantity is within its limits; None without an uncertainty
    probability_beyond: float | None  # the rest of it, kept apart since 1 − P loses what is small
    # how far the acceptance limit lies inside the limit, same unit; None when the uncertainty is too large for; any
    # value to be accepted
    guard_band: float | None
    rule: Text


def decide(
    value: float, u: float, limit: float, rule: Rule, *, signed: bool, prior: PriorKnowledge | None = None,
    unstated: float = 0.0,
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
    beyond, within = _beyond(size, u, limit, signed), phi((limit - size) / u)
    if signed:
        within = max(0.0, 1.0 - beyond) if size <= limit else within - phi((-limit - size) / u)
    if prior is None:
        outcome, band = _decided(size, u, limit, rule, signed, beyond, unstated)
    else:
        known = prior.after(value, u)
        within, beyond = known.within(limit, signed=signed), known.beyond(limit, signed=signed)
        outcome, band = _decided_knowing(value, u, limit, rule, signed, prior, unstated)
    return Decision(outcome, within, beyond, band, rule_words(rule, None if band is None else band / u))


def _decided(
    size: float, u: float, limit: float, rule: Rule, signed: bool, beyond: float, unstated: float
) -> tuple[Outcome, float | None]:
    if (ratio := least_ratio(rule)) is not None:
        wide = (2 if signed else 1) * limit >= ratio * 2 * COVERAGE_FACTOR * u
        return (_by_band(size, limit, 0.0), 0.0) if wide else ("undecided", None)
    if (risk := largest_risk(rule)) is not None:
        # Beyond the nearer limit by the guard band: to lie anywhere else than between two limits is no proof, for u large.
        doubt = hypot(u, unstated) if isinstance(rule, str) else u
        within = phi((limit - size) / doubt)
        return _by_probability(size, limit, within, beyond, risk), _guard_band(u, limit, risk, signed)
    width = guard_width(rule) * COVERAGE_FACTOR * u
    band = width if width <= limit else None
    if "non-binary" in rule_name(rule):
        return _in_four(size, limit, width), band
    if "binary" in rule_name(rule):
        return "pass" if size <= limit - width else "fail", band
    return _by_band(size, limit, width), band


def _decided_knowing(
    value: float, u: float, limit: float, rule: Rule, signed: bool, prior: PriorKnowledge, unstated: float
) -> tuple[Outcome, float | None]:
    """The same with a prior, of which rules that need none take no account.

    What it makes likely is no pass by a measurement of which alone no value would be one, nor by an u that is larger than one
    by which the value would not be accepted.
    """
    size, sides = abs(value) if signed else value, (1.0, -1.0) if signed and prior.mean else (1.0,)
    share, least = largest_share(rule), least_probability(rule)
    risk = share if least is None else 1 - least
    if risk is None:
        return _decided(size, u, limit, rule, signed, _beyond(size, u, limit, signed), unstated)
    alone = _guard_band(u, limit, risk, signed)
    proves = alone is not None and alone <= limit
    if least is None:
        accepted = acceptance_limit(risk, limit, u, prior, signed=signed) if proves else None
        outside = True
    else:
        either = [PriorKnowledge(side * prior.mean, prior.sd) for side in sides]

        def excess(size: float) -> float:
            known = [each.after(size, each.least_favourable(size, u, limit)) for each in either]
            return max(each.beyond(limit, signed=signed) for each in known) - risk

        accepted = root(excess, 0.0, limit, 1e-12 * limit) if proves and excess(0.0) <= 0 else None
        outside = min(each.after(size, u).within(limit, signed=signed) for each in either) <= risk
    band = None if accepted is None else limit - accepted
    if size > limit:
        return "fail" if outside else "undecided", band
    return "pass" if accepted is not None and size <= accepted else "undecided", band


def _figure(rule: Rule, of: type, name: str, usual: float) -> float | None:
    """The figure that a rule is given with, or the usual one of a rule of a name; ``None`` of other rules."""
    if not isinstance(rule, str) and isinstance(rule, of):
        (value,) = rule.model_dump().values()
        return float(value)
    return usual if name in rule_name(rule) else None


# Largest probability of a wrong acceptance, and of a wrong rejection; None, as of the next three, for rules that go by another
largest_risk = partial(_figure, of=FalseAccept, name="ISO 14253-1", usual=1 - CONFORMANCE_PROBABILITY)
least_ratio = partial(_figure, of=conformity.UncertaintyRatio, name="ASME B89.7.3.1", usual=RATIO)
least_probability = partial(_figure, of=conformity.PosteriorProbability, name="JCGM 106", usual=CONFORMANCE_PROBABILITY)
largest_share = partial(_figure, of=conformity.UnconditionalRisk, name="Z540.3", usual=UNCONDITIONAL)


def guard_width(rule: Rule) -> float:
    return _figure(rule, GuardBand, "ILAC-G8", 1.0) or 0.0


def needs_uncertainty(rule: Rule) -> bool:
    """Whether a rule says nothing without an uncertainty: every one but simple acceptance."""
    return rule != "simple"


def rule_name(rule: Rule) -> str:
    if isinstance(rule, str):
        return rule
    ((key, value),) = rule.model_dump().items()
    return f"{key} = {value:g}"


def _beyond(size: float, u: float, limit: float, signed: bool) -> float:
    return phi((size - limit) / u) + (phi((-limit - size) / u) if signed else 0.0)


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
    one_sided = max(0.0, -NormalDist().inv_cdf(risk)) * u
    if not signed or _beyond(limit - one_sided, u, limit, signed) <= risk * (1 + 1e-12):
        return one_sided
    if _beyond(0.0, u, limit, signed) > risk:
        return None
    return limit - root(lambda v: _beyond(v, u, limit, signed) - risk, 0.0, limit, 1e-12 * limit)


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
        risk = rule.max_false_accept
        return say(
            "probability of false acceptance at most {max_false_accept:g} (JCGM 106:2012, 9.5)", max_false_accept=risk
        )
    if (least := least_probability(rule)) is not None:
        return say("posterior probability of conforming at least {least:g} (JCGM 106:2012, 8.3)", least=least)
    if (share := largest_share(rule)) is not None:
        return say("at most {share:g} of all items wrongly accepted (ANSI/NCSL Z540.3-2006, 5.3 b)", share=share)
    if "non-binary" in rule_name(rule):
        return say("non-binary, guard band U, k = 2 (ILAC-G8:09/2019, 4.2.3)")
    if rule_name(rule).startswith("ILAC-G8"):
        return say("binary, guard band U, k = 2 (ILAC-G8:09/2019, 4.2.2)")
    if band is None:
        return say("ISO 14253-1:2017 (95 %)")
    return say("ISO 14253-1:2017, guard band {band:.3g} u (95 %)", band=band)
