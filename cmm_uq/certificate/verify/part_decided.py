"""Decisions on a part made again from value, u, limits and rule as its ``results.json`` states them.

The draws behind the probabilities are not in the file. What the rule makes of value, u, accepted values and probabilities is
decided by the package's own rules; that a probability can be is shown by a bound that holds whatever the distribution of the
errors (Cantelli's inequality); the figure itself follows from computing again alone.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import isclose
from typing import Any

import numpy as np

from cmm_uq.analysis.conformity.decision import largest_risk, largest_share, least_probability
from cmm_uq.analysis.conformity.limits import Limits, accepted_by, outcome_of
from cmm_uq.certificate.verify.decided_again import rule_of
from cmm_uq.certificate.verify.found import Inquiry
from cmm_uq.certificate.verify.part_figures import Wrong, is_zone
from cmm_uq.jobs.tables.conformity import Rule
from cmm_uq.jobs.verdicts import gravest

DRAWN = 0.03
"""Relative difference of u from that of the draws by which was decided: six standard errors of 100 000 normal draws are a
hundredth, and errors with heavier tails scatter more."""

_TOGETHER = 0.02
"""By how much a probability of draws may be off those whose tails are smoothed."""


Ends = tuple[float | None, float | None]
"""Smallest and largest value that a rule accepts."""


@dataclass(frozen=True, eq=False)
class _Stated(Limits):
    """Limits, and probabilities as they are stated in place of those of draws."""

    probability: float = 0.0
    rest: float = 1.0

    def within(self, value: float) -> float:
        return self.probability

    def beyond(self, value: float) -> float:
        return self.rest

    def knowing(self, value: float) -> tuple[float, float]:
        return self.probability, self.rest


def check_part_decisions(inquiry: Inquiry, data: Mapping[str, Any], file: str) -> None:
    """Keep every decision that does not follow.

    Parameters
    ----------
    data : of results.json.
    file : its name.
    """
    rule, prior = rule_of(data["decision"]["rule"]), data["decision"]["prior"]
    outcomes, chances = [], []
    for i, one in enumerate(data["characteristics"]):
        if one["limits"] is None:
            if one["decision"] is not None:
                inquiry.wrong(
                    "decisions", file, f"characteristics[{i}].decision", "is made without limits", one["decision"]
                )
            continue
        inquiry.looked("decisions", 3)
        wrong = list(_accepted(one, rule))
        if one["decision"] is None:
            if one["value"] is not None:
                wrong.append(("decision", "is missing, though there are a value and limits", None, ""))
        else:
            outcomes.append(one["decision"]["outcome"])
            chances.append(one["decision"])
            wrong += _decision(one, rule, known=prior is not None)
        for key, problem, stands, should in wrong:
            inquiry.wrong("decisions", file, f"characteristics[{i}].{key}", problem, stands, should)
    inquiry.looked("decisions")
    whole = gravest(outcomes) if outcomes else None
    if data["decision"]["outcome"] != whole:
        inquiry.wrong("decisions", file, "decision.outcome", "is not the worst of the characteristics",
                      data["decision"]["outcome"], whole)  # fmt: skip
    _check_together(inquiry, data["decision"]["probability_all_conform"], chances, file, known=prior is not None)


def _check_together(inquiry: Inquiry, joint: Any, chances: list[Any], file: str, *, known: bool) -> None:
    """Between what the parts allow (Fréchet's bounds); a prior is in each and not in all together."""
    if (joint is None) != (not chances):
        inquiry.wrong(
            "decisions", file, "decision.probability_all_conform", "is said of nothing, or not of what was decided"
        )
    if joint is None or not chances or known:
        return
    most = min(one["probability_conforming"] for one in chances)
    least = 1 - sum(one["probability_beyond"] for one in chances)
    if not least - _TOGETHER <= joint <= most + _TOGETHER:
        inquiry.wrong("decisions", file, "decision.probability_all_conform",
                      "is not between the bounds that the characteristics set", joint,
                      f"{max(0.0, least):.4g} to {most:.4g}")  # fmt: skip


def _limits(one: Mapping[str, Any], u: float) -> _Stated:
    said, limits = one["decision"] or {}, one["limits"]
    errors = np.array([-u, u], dtype=np.float64)
    return _Stated(limits["lower"], limits["upper"], errors, is_zone(one), None,
                   said.get("probability_conforming", 0.0), said.get("probability_beyond", 1.0))  # fmt: skip


def _by_draws(rule: Rule) -> bool:
    """Whether a rule goes by probabilities, and not by u alone."""
    return any(of(rule) is not None for of in (largest_risk, least_probability, largest_share))


def _accepted(one: Mapping[str, Any], rule: Rule) -> Iterator[Wrong]:
    """Within the limits; of a rule by a guard band, as far inside as u asks. Zones are decided by more than u."""
    said, limits = one["limits"]["accepted"], one["limits"]
    ends = [] if said is None else [(said[0], limits["lower"], 1), (said[1], limits["upper"], -1)]
    for end, limit, side in ends:
        if end is not None and limit is not None and side * (end - limit) < -1e-9 * max(abs(end), abs(limit)):
            yield "limits.accepted", "reaches beyond a limit", said, [limits["lower"], limits["upper"]]
    if is_zone(one) or _by_draws(rule) or not one["u"]:
        return
    narrow, wide = (accepted_by(_limits(one, one["u"] * (1 + side * DRAWN)), rule) for side in (1, -1))
    if not _between(said, narrow, wide):
        should = accepted_by(_limits(one, one["u"]), rule)
        yield "limits.accepted", "does not follow from limits, u and rule", said, should


def _between(said: Sequence[float | None] | None, narrow: Ends | None, wide: Ends | None) -> bool:
    """Whether accepted values lie between those of a larger and of a smaller u, which may accept none."""
    if said is None or wide is None:
        return said is None and narrow is None
    for stands, most, least in zip(said, wide, narrow or said, strict=True):
        if stands is None or most is None or least is None:
            if stands is not most:
                return False
        elif not min(least, most) - 1e-9 * abs(most) <= stands <= max(least, most) + 1e-9 * abs(most):
            return False
    return True


def _decision(one: Mapping[str, Any], rule: Rule, *, known: bool) -> Iterator[Wrong]:
    said, value = one["decision"], one["value"]
    inside, beyond = said["probability_conforming"], said["probability_beyond"]
    if not (0.0 <= inside <= 1.0 and 0.0 <= beyond <= 1.0) or abs(inside + beyond - 1.0) > 1e-3:
        yield "decision.probability_conforming", "and that of the rest are not one together", inside, 1.0 - beyond
    accepted = one["limits"]["accepted"]
    ends = None if accepted is None else (accepted[0], accepted[1])
    possible = {outcome_of(_limits(one, one["u"] * (1 + side * DRAWN)), rule, value, ends) for side in (-1, 0, 1)}
    if said["outcome"] not in possible and not _at_an_end(value, accepted, one["limits"]):
        should = " or ".join(sorted(possible))
        yield "decision.outcome", "does not follow from value, u, limits and rule", said["outcome"], should
    if (risk := _risk(rule)) is not None and _limits(one, one["u"]).inside(value):
        taken = accepted is not None and all(
            end is None or side * (value - end) >= 0 for end, side in ((accepted[0], 1), (accepted[1], -1))
        )
        if taken != (beyond <= risk) and not _at_an_end(value, accepted, one["limits"]):
            yield "limits.accepted", "does not follow from the probability and the rule", accepted, f"{beyond:.4g}"
    if not known and not is_zone(one) and one["u"] > 0:
        yield from _bounded(one, inside, beyond)


def _risk(rule: Rule) -> float | None:
    """The largest probability beyond the limits that a rule accepts; ``None`` where it goes by none."""
    if (risk := largest_risk(rule)) is not None:
        return risk
    least = least_probability(rule)
    return None if least is None else 1 - least


def _bounded(one: Mapping[str, Any], inside: float, beyond: float) -> Iterator[Wrong]:
    """No distribution with this u has more beyond a limit than 1/(1 + m²), m standard deviations away."""
    limits, value, u = one["limits"], one["value"], one["u"] * (1 + DRAWN)
    sides = [(limits["upper"] - value) / u] if limits["upper"] is not None else []
    sides += [(value - limits["lower"]) / u] if limits["lower"] is not None else []
    if min(sides) >= 0:
        most = sum(1 / (1 + side**2) for side in sides)
        if beyond > most:
            yield "decision.probability_beyond", "is larger than u allows", beyond, f"at most {most:.4g}"
    else:
        most = 1 / (1 + min(sides) ** 2)
        if inside > most:
            yield "decision.probability_conforming", "is larger than u allows", inside, f"at most {most:.4g}"


def _at_an_end(value: float, accepted: Any, limits: Mapping[str, Any]) -> bool:
    """Whether the tenth digit decides."""
    ends = [limits["lower"], limits["upper"], *(accepted or ())]
    return any(end is not None and isclose(value, end, rel_tol=1e-9, abs_tol=1e-12) for end in ends)
