"""Decision rules: from a value, its uncertainty and a limit to a statement of conformity."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from scipy import special

from cmm_uq.jobs.job import FalseAccept, GuardBand, Rule

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
    probability_conforming : that the quantity is within the limit, for a normal distribution about the value.
    guard_band : how far the acceptance limit lies inside the limit, same unit.
    rule : in words.
    """

    outcome: Outcome
    probability_conforming: float
    guard_band: float
    rule: str


def decide(value: float, u: float, limit: float, rule: Rule) -> Decision:
    """Decide whether a quantity with an upper limit conforms.

    Parameters
    ----------
    value, u : measured value and its standard uncertainty.
    limit : the upper limit, same unit.
    rule : ``simple`` (JCGM 106:2012, 8.2.1), ``ISO 14253-1`` (guard band of 1.64 u on either side for 95 %), a guard band
        of so many expanded uncertainties with k = 2, or a largest probability of false acceptance (JCGM 106:2012, 9.5).
    """
    probability = float(special.ndtr((limit - value) / u)) if u > 0 else float(value <= limit)
    band, words = _guard_band(u, rule)
    if value <= limit - band:
        outcome: Outcome = "pass"
    elif band == 0 or value >= limit + band:
        outcome = "fail"
    else:
        outcome = "undecided"
    return Decision(outcome, probability, band, words)


def _guard_band(u: float, rule: Rule) -> tuple[float, str]:
    if rule == "simple":
        return 0.0, "simple acceptance (JCGM 106:2012, 8.2.1)"
    if isinstance(rule, GuardBand):
        return rule.guard_band * COVERAGE_FACTOR * u, f"guard band {rule.guard_band:g} U, k = 2 (ILAC-G8:09/2019)"
    if isinstance(rule, FalseAccept):
        factor = max(0.0, -float(special.ndtri(rule.max_false_accept)))
        return factor * u, f"probability of false acceptance at most {rule.max_false_accept:g} (JCGM 106:2012, 9.5)"
    factor = float(special.ndtri(CONFORMANCE_PROBABILITY))
    return factor * u, f"ISO 14253-1:2017, guard band {factor:.3g} u (95 %)"


def rule_name(rule: Rule) -> str:
    """The rule as job.toml names it."""
    if isinstance(rule, GuardBand):
        return f"guard_band = {rule.guard_band:g}"
    return f"max_false_accept = {rule.max_false_accept:g}" if isinstance(rule, FalseAccept) else rule
