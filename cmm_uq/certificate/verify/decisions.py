"""Statements of conformity and decisions on a part made again from ``results.json``, by the package's own rules.

Of a machine every quantity is decided again, and what follows for the test from these. Of a part the draws behind the
probabilities are not in the file: that a probability can be is shown by a bound that holds whatever the distribution of the
errors (Cantelli's inequality); the figure itself follows from computing again alone.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from math import isclose
from typing import Any

import numpy as np

from cmm_uq.analysis.conformity import decision as deciding
from cmm_uq.analysis.conformity.limits import Limits, accepted_by, outcome_of
from cmm_uq.analysis.conformity.standards import BUILT_IN
from cmm_uq.analysis.conformity.statement import Decided, Statement
from cmm_uq.base.messages import NOTHING, Verbatim
from cmm_uq.base.units import ARCSECOND, MICROMETRE
from cmm_uq.base.values import dataclass, replace
from cmm_uq.certificate.verify.figures import Wrong, inside_of, is_zone
from cmm_uq.certificate.verify.given import Inquiry
from cmm_uq.jobs.tables import conformity as table
from cmm_uq.jobs.tables.conformity import Rule
from cmm_uq.jobs.verdicts import gravest

_SAME = 2e-6  # relative difference of what follows from ten digits: a probability far in a tail loses some of them
DRAWN = 0.03
"""Relative difference of u from that of the draws by which was decided: six standard errors of 100 000 normal draws are a
hundredth, and errors with heavier tails scatter more."""

_TOGETHER = 0.02  # by how much a probability of draws may be off those whose tails are smoothed
_NAMED: Mapping[str, Any] = {
    "guard_band": table.GuardBand, "max_false_accept": table.FalseAccept, "uncertainty_ratio": table.UncertaintyRatio,
    "posterior_probability": table.PosteriorProbability, "max_unconditional_false_accept": table.UnconditionalRisk,
}  # fmt: skip
Ends = tuple[float | None, float | None]  # smallest and largest value that a rule accepts


def check_decisions(inquiry: Inquiry, data: Mapping[str, Any], file: str) -> None:
    for i, entry in enumerate(data.get("conformity") or ()):
        path = f"conformity[{i}]"
        try:
            problems = list(_entry(entry))
        except (KeyError, TypeError, ValueError, IndexError, AttributeError) as error:
            inquiry.wrong("decisions", file, path, f"is no statement of conformity ({type(error).__name__}: {error})")
            continue
        inquiry.looked("decisions", 1 + len(entry["errors"]))
        if problems and entry["standard"] not in BUILT_IN:
            why = "the standard comes from another package, which decides otherwise"
            inquiry.left(f"decision by {entry['standard']}", why)
            continue
        for place, problem, stands, should in problems:
            inquiry.wrong("decisions", file, f"{path}{place}", problem, stands, should)


def rule_of(name: str) -> Rule:
    """The rule that results.json names, as ``guard_band = 0.8`` or by its name."""
    key, equals, value = name.partition(" = ")
    rule: Rule = _NAMED[key](**{key: float(value)}) if equals else name  # type: ignore[assignment]
    return rule


def _entry(entry: Mapping[str, Any]) -> Iterator[Wrong]:
    errors, prior = entry["errors"], entry["prior"]
    rule = rule_of(entry["rule"])
    if not errors:
        yield ".errors", "holds nothing that was decided", "", ""
        return
    unstated = any(text.startswith("uncertainty: ") for text in entry["missing"])
    decided, signed = _decided_again(errors, rule, prior, unstated=unstated)
    for i, (error, again) in enumerate(zip(errors, decided, strict=True)):
        for key, problem, stands, should in _error(error, again, entry):
            yield f".errors[{i}].{key}", problem, stands, should
    yield from _whole(entry, decided, signed, prior)


def _decided_again(errors: list[Any], rule: Rule, prior: Any, *, unstated: bool) -> tuple[list[Decided], bool]:
    """With limits on both sides of zero, or on one: whichever agrees with what is said; a sign asks for both."""

    def decisions(*, signed: bool) -> tuple[list[Decided], int]:
        decided = [_decided(error, rule, prior, signed=signed, unstated=unstated) for error in errors]
        return decided, sum(
            error["outcome"] != again.decision.outcome
            or not _same(error["probability_conforming"], again.decision.probability_conforming)
            or not _same(error["guard_band_um"], again.decision.guard_band, error["limit_um"])
            for error, again in zip(errors, decided, strict=True)
        )

    both, wrong = decisions(signed=True)
    if any(error["error_um"] < 0 for error in errors) or wrong == 0:
        return both, True
    upper, wrong_of_upper = decisions(signed=False)
    return (upper, False) if wrong_of_upper < wrong else (both, True)


def _decided(error: Mapping[str, Any], rule: Rule, prior: Any, *, signed: bool, unstated: bool) -> Decided:
    """What follows; a nonconformity that would be proved were the uncertainty whole may be undecided where it is not."""
    value, u, limit = error["error_um"], error["u_um"], error["limit_um"]
    decision = deciding.decide(value, u, limit, rule, signed=signed, prior=_known(prior, limit))
    if unstated and (decision.outcome, error["outcome"]) == ("fail", "undecided"):
        decision = replace(decision, outcome="undecided")
    return Decided(value, u, limit, decision, error["measurement"], error["repeat"], error["length_mm"],
                   standing=error["standing"], set_aside=error.get("set_aside", False))  # fmt: skip


def _known(prior: Any, limit: float) -> deciding.PriorKnowledge | None:
    if prior is None:
        return None
    return deciding.PriorKnowledge(prior["mean_um"], prior["sd_um"] or (prior["share_of_limit"] or 0.0) * limit)


def _error(error: Mapping[str, Any], decided: Decided, entry: Mapping[str, Any]) -> Iterator[Wrong]:
    decision = decided.decision
    if error["outcome"] != decision.outcome and not _at_its_edge(decided):
        yield "outcome", "does not follow from value, uncertainty, limit and rule", error["outcome"], decision.outcome
    if not _same(error["U_um"], 2 * error["u_um"]):
        yield "U_um", "is not twice u_um", error["U_um"], f"{2 * error['u_um']:.10g}"
    stands, should = error["probability_conforming"], decision.probability_conforming
    if not _same(stands, should):
        yield "probability_conforming", "does not follow from value, uncertainty and limit", stands, should
    if not _same(error["guard_band_um"], decision.guard_band, error["limit_um"]):
        yield "guard_band_um", "does not follow from the rule", error["guard_band_um"], decision.guard_band
    angle = entry.get("limit_arcsec")
    limit = (
        _limit(entry["mpe"], error["length_mm"])
        if angle is None
        else angle * ARCSECOND * error["length_mm"] / MICROMETRE
    )
    if limit is not None and not _same(error["limit_um"], limit):
        what = "maximum permissible error" if angle is None else "limit of the angle"
        yield "limit_um", f"does not follow from the {what}", error["limit_um"], f"{limit:.10g}"


def _limit(mpe: Any, length: float | None) -> float | None:
    """A + L/K, at most B; ``None`` where there is no formula, or it asks for a length that is not said."""
    if mpe is None:
        return None
    most = float("inf") if mpe["b_um"] is None else float(mpe["b_um"])
    if mpe["a_um"] is None or mpe["k"] is None:
        return most
    return None if length is None else min(float(mpe["a_um"] + length / mpe["k"]), most)


def _whole(entry: Mapping[str, Any], decided: list[Decided], signed: bool, prior: Any) -> Iterator[Wrong]:
    missing, outside = (tuple(map(Verbatim, entry.get(key, ()))) for key in ("missing", "outside"))
    facts = table.ConformityFacts.model_construct(standard=entry["standard"])
    whole = Statement(facts, entry["characteristic"], NOTHING, NOTHING, tuple(decided), missing, (), signed,
                      outside=outside)  # fmt: skip
    named, chance = whole.named.decision, entry["probability_conforming"]
    if not any(
        _same(abs(each.error_um), entry["value_um"]) and _same(each.u_um, entry["u_um"])
        and _same(each.limit_um, entry["limit_um"]) for each in decided
    ):  # fmt: skip
        yield "", "names a value that was not decided", entry["value_um"], whole.value_um
    elif not _same(chance, named.probability_conforming):
        should = named.probability_conforming
        yield ".probability_conforming", "is not that of the least favourable value", chance, should
    elif not _same(entry["value_um"], whole.value_um) and named.probability_conforming not in (0.0, None):
        yield ".value_um", "is not the least favourable", entry["value_um"], whole.value_um
    if not _same(entry["guard_band_um"], named.guard_band, entry["limit_um"]):
        yield ".guard_band_um", "is not that of the named value", entry["guard_band_um"], named.guard_band
    if entry["decision"] != whole.outcome and not any(map(_at_its_edge, decided)):
        yield ".decision", "does not follow from what was decided", entry["decision"], whole.outcome
    if entry["scope"] != whole.scope:
        yield ".scope", "does not follow from what is missing", entry["scope"], whole.scope
    joint = entry["probability_all_conform"]
    if joint is not None and not -1e-9 <= joint <= 1 + 1e-9:
        yield ".probability_all_conform", "is no probability", joint, ""
    yield from _risks(entry["global_risks"], whole.named, signed, prior)
    budget = entry["test_uncertainty"]
    if budget is not None and budget.get("k") is not None and not _same(budget["U"], budget["k"] * budget["u"]):
        yield ".test_uncertainty.U", "is not k times u", budget["U"], budget["k"] * budget["u"]


def _risks(stated: Any, named: Decided, signed: bool, prior: Any) -> Iterator[Wrong]:
    """Of all machines alike."""
    known = _known(prior, named.limit_um) if named.u_um > 0 else None
    if (stated is None) != (known is None):
        yield ".global_risks", "are said without a prior, or not with one", stated, ""
    if stated is None or known is None:
        return
    band = named.decision.guard_band
    accepted = -20.0 * named.u_um if band is None else named.limit_um - band
    should = deciding.global_risks(accepted, named.limit_um, named.u_um, known, signed=signed)
    for key, value in (("consumer", should.consumer), ("producer", should.producer)):
        if not isclose(stated[key], value, rel_tol=1e-5, abs_tol=1e-12):
            yield f".global_risks.{key}", "does not follow from the prior", stated[key], f"{value:.10g}"


def _at_its_edge(decided: Decided) -> bool:
    """Whether the tenth digit decides: size and an end of a zone are the same within it."""
    band, size = decided.decision.guard_band or 0.0, abs(decided.error_um)
    return any(isclose(size, decided.limit_um + side * band, rel_tol=1e-9) for side in (-1, 0, 1))


def _same(a: float | None, b: float | None, scale: float = 0.0) -> bool:
    if a is None or b is None:
        return a is b
    return isclose(a, b, rel_tol=_SAME, abs_tol=max(1e-15, 1e-9 * scale))


@dataclass(frozen=True, eq=False)
class _StatedLimits(Limits):
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
    whole, wrong = data["decision"], partial(inquiry.wrong, "decisions", file)
    rule, prior, decisions = rule_of(whole["rule"]), whole["prior"], []
    for i, each in enumerate(data["characteristics"]):
        decision = each["decision"]
        if each["limits"] is None:
            if decision is not None:
                wrong(f"characteristics[{i}].decision", "is made without limits", decision)
            continue
        inquiry.looked("decisions", 3)
        problems = list(_accepted(each, rule))
        if decision is not None:
            decisions.append(decision)
            problems += _decision(each, rule, known=prior is not None, withheld=bool(whole.get("withheld")))
        elif each["value"] is not None:
            problems.append(("decision", "is missing, though there are a value and limits", None, ""))
        for key, problem, stands, should in problems:
            wrong(f"characteristics[{i}].{key}", problem, stands, should)
    left = ["incomplete"] if data["part"]["not_measured"] else []
    gravest_of_all = gravest([*(decision["outcome"] for decision in decisions), *left]) if decisions else None
    inquiry.compare("decisions", file, "decision.outcome", "is not the worst of the characteristics", whole["outcome"],
                    gravest_of_all)  # fmt: skip
    joint = whole["probability_all_conform"]
    if (joint is None) != (not decisions):
        wrong("decision.probability_all_conform", "is said of nothing, or not of what was decided")
    if joint is None or not decisions or prior is not None:  # a prior is in each and not in all together
        return
    # Fréchet's bounds
    most = min(decision["probability_conforming"] for decision in decisions)
    least = 1 - sum(decision["probability_beyond"] for decision in decisions)
    if not least - _TOGETHER <= joint <= most + _TOGETHER:
        wrong("decision.probability_all_conform", "is not between the bounds that the characteristics set", joint,
              f"{max(0.0, least):.4g} to {most:.4g}")  # fmt: skip


def _limits(each: Mapping[str, Any], u: float) -> _StatedLimits:
    decision, limits = each["decision"] or {}, each["limits"]
    errors = np.array([-u, u], dtype=np.float64)
    return _StatedLimits(limits["lower"], limits["upper"], errors, is_zone(each), None,
                         decision.get("probability_conforming", 0.0), decision.get("probability_beyond", 1.0))  # fmt: skip


def _accepted(each: Mapping[str, Any], rule: Rule) -> Iterator[Wrong]:
    """Within the limits; of a rule by a guard band, as far inside as u asks. Zones are decided by more than u."""
    stated, limits, u = each["limits"]["accepted"], each["limits"], each["u"]
    ends = [] if stated is None else [(stated[0], limits["lower"], 1), (stated[1], limits["upper"], -1)]
    for end, limit, side in ends:
        if end is not None and limit is not None and side * (end - limit) < -1e-9 * max(abs(end), abs(limit)):
            yield "limits.accepted", "reaches beyond a limit", stated, [limits["lower"], limits["upper"]]
    by_draws = any(
        of(rule) is not None for of in (deciding.largest_risk, deciding.least_probability, deciding.largest_share)
    )
    if is_zone(each) or by_draws or not u:
        return
    narrow, wide = (accepted_by(_limits(each, u * (1 + side * DRAWN)), rule) for side in (1, -1))
    if not _between(stated, narrow, wide):
        should = accepted_by(_limits(each, u), rule)
        yield "limits.accepted", "does not follow from limits, u and rule", stated, should


def _between(stated: Sequence[float | None] | None, narrow: Ends | None, wide: Ends | None) -> bool:
    """Whether accepted values lie between those of a larger and of a smaller u, which may accept none."""
    if stated is None or wide is None:
        return stated is None and narrow is None
    for end, most, least in zip(stated, wide, narrow or stated, strict=True):
        if end is None or most is None or least is None:
            if end is not most:
                return False
        elif not min(least, most) - 1e-9 * abs(most) <= end <= max(least, most) + 1e-9 * abs(most):
            return False
    return True


def _decision(each: Mapping[str, Any], rule: Rule, *, known: bool, withheld: bool) -> Iterator[Wrong]:
    decision, value, limits, u = each["decision"], each["value"], each["limits"], each["u"]
    inside, beyond = decision["probability_conforming"], decision["probability_beyond"]
    if not (0.0 <= inside <= 1.0 and 0.0 <= beyond <= 1.0) or abs(inside + beyond - 1.0) > 1e-3:
        yield "decision.probability_conforming", "and that of the rest are not one together", inside, 1.0 - beyond
    accepted = limits["accepted"]
    ends = None if accepted is None else (accepted[0], accepted[1])
    possible = {outcome_of(_limits(each, u * (1 + side * DRAWN)), rule, value, ends) for side in (-1, 0, 1)}
    if withheld:
        possible = {"undecided" if one in ("pass", "conditional pass") else one for one in possible}
    edges = [end for end in (limits["lower"], limits["upper"], *(accepted or ())) if end is not None]
    tenth_digit_decides = any(isclose(value, end, rel_tol=1e-9, abs_tol=1e-12) for end in edges)
    if decision["outcome"] not in possible and not tenth_digit_decides:
        should = " or ".join(sorted(possible))
        yield "decision.outcome", "does not follow from value, u, limits and rule", decision["outcome"], should
    risk, least = deciding.largest_risk(rule), deciding.least_probability(rule)
    risk = 1 - least if risk is None and least is not None else risk
    if risk is not None and _limits(each, u).inside(value):
        inner = zip(ends or (), (1, -1), strict=False)
        taken = ends is not None and all(end is None or side * (value - end) >= 0 for end, side in inner)
        if (taken > (beyond <= risk) if known else taken != (beyond <= risk)) and not tenth_digit_decides:
            yield "limits.accepted", "does not follow from the probability and the rule", accepted, f"{beyond:.4g}"
    if not known and not is_zone(each) and u > 0:
        yield from _bounded(limits, value, u * (1 + DRAWN), inside, beyond)


def _bounded(limits: Mapping[str, Any], value: float, u: float, inside: float, beyond: float) -> Iterator[Wrong]:
    """No distribution with this u has more beyond a limit than 1/(1 + m²), m standard deviations away."""
    sides = [distance / u for distance in inside_of(limits, value)]
    if min(sides) >= 0:
        most = sum(1 / (1 + side**2) for side in sides)
        if beyond > most:
            yield "decision.probability_beyond", "is larger than u allows", beyond, f"at most {most:.4g}"
    else:
        most = 1 / (1 + min(sides) ** 2)
        if inside > most:
            yield "decision.probability_conforming", "is larger than u allows", inside, f"at most {most:.4g}"
