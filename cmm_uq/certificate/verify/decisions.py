"""Statements of conformity and decisions on a part made again from ``results.json``.

Statements of conformity decided again from what ``results.json`` says: values, uncertainties, limits, rule and prior.

Every quantity is decided by the package's own rules (``conformity``), and what follows for the test from these.

Decisions on a part made again from value, u, limits and rule as its ``results.json`` states them.

The draws behind the probabilities are not in the file. What the rule makes of value, u, accepted values and probabilities is
decided by the package's own rules; that a probability can be is shown by a bound that holds whatever the distribution of the
errors (Cantelli's inequality); the figure itself follows from computing again alone.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import isclose
from typing import Any

import numpy as np

from cmm_uq.analysis.conformity.decision import (
    Decision,
    PriorKnowledge,
    decide,
    global_risks,
    largest_risk,
    largest_share,
    least_probability,
)
from cmm_uq.analysis.conformity.limits import Limits, accepted_by, outcome_of
from cmm_uq.analysis.conformity.standards import BUILT_IN
from cmm_uq.analysis.conformity.statement import Decided, Statement
from cmm_uq.base.messages import NOTHING, Verbatim
from cmm_uq.certificate.verify.figures import is_zone
from cmm_uq.certificate.verify.found import Inquiry
from cmm_uq.jobs.tables.conformity import (
    ConformityFacts,
    FalseAccept,
    GuardBand,
    PosteriorProbability,
    Rule,
    UncertaintyRatio,
    UnconditionalRisk,
)
from cmm_uq.jobs.verdicts import gravest

_SAME = 2e-6
"""Relative difference of what follows from numbers of ten digits: a probability far in a tail loses some of them."""

_NAMED: Mapping[str, Any] = {
    "guard_band": GuardBand, "max_false_accept": FalseAccept, "uncertainty_ratio": UncertaintyRatio,
    "posterior_probability": PosteriorProbability, "max_unconditional_false_accept": UnconditionalRisk,
}  # fmt: skip


def check_decisions(inquiry: Inquiry, data: Mapping[str, Any], file: str) -> None:
    """Keep every decision that does not follow."""
    for i, entry in enumerate(data.get("conformity") or ()):
        path = f"conformity[{i}]"
        try:
            found = list(_entry(entry))
        except (KeyError, TypeError, ValueError, IndexError, AttributeError) as error:
            inquiry.wrong("decisions", file, path, f"is no statement of conformity ({type(error).__name__}: {error})")
            continue
        inquiry.looked("decisions", 1 + len(entry["errors"]))
        if found and entry["standard"] not in BUILT_IN:
            why = "the standard comes from another package, which decides otherwise"
            inquiry.left(f"decision by {entry['standard']}", why)
            continue
        for place, problem, stands, should in found:
            inquiry.wrong("decisions", file, f"{path}{place}", problem, stands, should)


Wrong = tuple[str, str, object, object]


def rule_of(name: str) -> Rule:
    """The rule that results.json names, as ``guard_band = 0.8`` or by its name."""
    key, equals, value = name.partition(" = ")
    found: Rule = _NAMED[key](**{key: float(value)}) if equals else name  # type: ignore[assignment]
    return found


def _entry(entry: Mapping[str, Any]) -> Iterator[Wrong]:
    errors = entry["errors"]
    rule, prior = rule_of(entry["rule"]), entry["prior"]
    if not errors:
        yield ".errors", "holds nothing that was decided", "", ""
        return
    unstated = any(text.startswith("uncertainty: ") for text in entry["missing"])
    found, signed = _best(errors, rule, prior, unstated=unstated)
    for i, (error, decided) in enumerate(zip(errors, found, strict=True)):
        for key, problem, stands, should in _error(error, decided, entry):
            yield f".errors[{i}].{key}", problem, stands, should
    yield from _whole(entry, found, signed, prior)


def _best(errors: list[Any], rule: Rule, prior: Any, *, unstated: bool) -> tuple[list[Decided], bool]:
    """Decided with limits on both sides of zero, or on one: whichever agrees with what is said; a sign asks for both."""
    both = [_decided(error, rule, prior, signed=True, unstated=unstated) for error in errors]
    if any(error["error_um"] < 0 for error in errors) or _wrong_in(errors, both) == 0:
        return both, True
    one = [_decided(error, rule, prior, signed=False, unstated=unstated) for error in errors]
    return (one, False) if _wrong_in(errors, one) < _wrong_in(errors, both) else (both, True)


def _wrong_in(errors: list[Any], found: list[Decided]) -> int:
    return sum(
        error["outcome"] != decided.decision.outcome
        or not _same(error["probability_conforming"], decided.decision.probability_conforming)
        or not _same(error["guard_band_um"], decided.decision.guard_band, error["limit_um"])
        for error, decided in zip(errors, found, strict=True)
    )  # fmt: skip


def _decided(error: Mapping[str, Any], rule: Rule, prior: Any, *, signed: bool, unstated: bool) -> Decided:
    """What follows; a nonconformity that would be proved were the uncertainty whole may be undecided where it is not."""
    value, u, limit = error["error_um"], error["u_um"], error["limit_um"]
    decision: Decision = decide(value, u, limit, rule, signed=signed, prior=_known(prior, limit))
    if unstated and (decision.outcome, error["outcome"]) == ("fail", "undecided"):
        decision = replace(decision, outcome="undecided")
    return Decided(value, u, limit, decision, error["measurement"], error["repeat"], error["length_mm"],
                   standing=error["standing"], set_aside=error.get("set_aside", False))  # fmt: skip


def _known(prior: Any, limit: float) -> PriorKnowledge | None:
    if prior is None:
        return None
    return PriorKnowledge(prior["mean_um"], prior["sd_um"] or (prior["share_of_limit"] or 0.0) * limit)


def _error(error: Mapping[str, Any], decided: Decided, entry: Mapping[str, Any]) -> Iterator[Wrong]:
    """One value."""
    decision = decided.decision
    if error["outcome"] != decision.outcome and not _at_its_edge(decided):
        yield "outcome", "does not follow from value, uncertainty, limit and rule", error["outcome"], decision.outcome
    if not _same(error["U_um"], 2 * error["u_um"]):
        yield "U_um", "is not twice u_um", error["U_um"], f"{2 * error['u_um']:.10g}"
    if not _same(error["probability_conforming"], decision.probability_conforming):
        yield ("probability_conforming", "does not follow from value, uncertainty and limit",
               error["probability_conforming"], decision.probability_conforming)  # fmt: skip
    if not _same(error["guard_band_um"], decision.guard_band, error["limit_um"]):
        yield "guard_band_um", "does not follow from the rule", error["guard_band_um"], decision.guard_band
    limit = _limit(entry["mpe"], error["length_mm"])
    if limit is not None and not _same(error["limit_um"], limit):
        yield "limit_um", "does not follow from the maximum permissible error", error["limit_um"], f"{limit:.10g}"


def _limit(mpe: Any, length: float | None) -> float | None:
    """A + L/K, at most B; ``None`` where there is no formula, or it asks for a length that is not said."""
    if mpe is None:
        return None
    most = float("inf") if mpe["b_um"] is None else float(mpe["b_um"])
    if mpe["a_um"] is None or mpe["k"] is None:
        return most
    return None if length is None else min(float(mpe["a_um"] + length / mpe["k"]), most)


def _whole(entry: Mapping[str, Any], found: list[Decided], signed: bool, prior: Any) -> Iterator[Wrong]:
    """What the statement as a whole says."""
    missing = tuple(Verbatim(text) for text in entry["missing"])
    facts = ConformityFacts.model_construct(standard=entry["standard"])
    whole = Statement(facts, entry["characteristic"], NOTHING, NOTHING, tuple(found), missing, (), signed,
                      outside=tuple(Verbatim(text) for text in entry.get("outside", ())))  # fmt: skip
    named = whole.named
    if not any(
        _same(abs(one.error_um), entry["value_um"]) and _same(one.u_um, entry["u_um"])
        and _same(one.limit_um, entry["limit_um"]) for one in found
    ):  # fmt: skip
        yield "", "names a value that was not decided", entry["value_um"], whole.value_um
    elif not _same(entry["probability_conforming"], named.decision.probability_conforming):
        yield (".probability_conforming", "is not that of the least favourable value", entry["probability_conforming"],
               named.decision.probability_conforming)  # fmt: skip
    elif not _same(entry["value_um"], whole.value_um) and named.decision.probability_conforming not in (0.0, None):
        yield ".value_um", "is not the least favourable", entry["value_um"], whole.value_um
    if not _same(entry["guard_band_um"], named.decision.guard_band, entry["limit_um"]):
        yield ".guard_band_um", "is not that of the named value", entry["guard_band_um"], named.decision.guard_band
    if entry["decision"] != whole.outcome and not any(map(_at_its_edge, found)):
        yield ".decision", "does not follow from what was decided", entry["decision"], whole.outcome
    if entry["scope"] != whole.scope:
        yield ".scope", "does not follow from what is missing", entry["scope"], whole.scope
    joint = entry["probability_all_conform"]
    if joint is not None and not -1e-9 <= joint <= 1 + 1e-9:
        yield ".probability_all_conform", "is no probability", joint, ""
    yield from _risks(entry, named, signed, prior)
    budget = entry["test_uncertainty"]
    if budget is not None and budget.get("k") is not None and not _same(budget["U"], budget["k"] * budget["u"]):
        yield ".test_uncertainty.U", "is not k times u", budget["U"], budget["k"] * budget["u"]


def _risks(entry: Mapping[str, Any], named: Decided, signed: bool, prior: Any) -> Iterator[Wrong]:
    """Of all machines alike."""
    said, known = entry["global_risks"], _known(prior, named.limit_um)
    if (said is None) != (known is None or named.u_um <= 0):
        yield ".global_risks", "are said without a prior, or not with one", said, ""
    if said is None or known is None or named.u_um <= 0:
        return
    band = named.decision.guard_band
    accepted = -20.0 * named.u_um if band is None else named.limit_um - band
    should = global_risks(accepted, named.limit_um, named.u_um, known, signed=signed)
    for key, value in (("consumer", should.consumer), ("producer", should.producer)):
        if not isclose(said[key], value, rel_tol=1e-5, abs_tol=1e-12):
            yield f".global_risks.{key}", "does not follow from the prior", said[key], f"{value:.10g}"


def _at_its_edge(one: Decided) -> bool:
    """Whether the tenth digit decides: size and an end of a zone are the same within it."""
    band, size = one.decision.guard_band or 0.0, abs(one.error_um)
    return any(isclose(size, one.limit_um + side * band, rel_tol=1e-9) for side in (-1, 0, 1))


def _same(a: float | None, b: float | None, scale: float = 0.0) -> bool:
    if a is None or b is None:
        return a is b
    return isclose(a, b, rel_tol=_SAME, abs_tol=max(1e-15, 1e-9 * scale))


DRAWN = 0.03
"""Relative difference of u from that of the draws by which was decided: six standard errors of 100 000 normal draws are a
hundredth, and errors with heavier tails scatter more."""

_TOGETHER = 0.02  # by how much a probability of draws may be off those whose tails are smoothed


Ends = tuple[float | None, float | None]  # smallest and largest value that a rule accepts


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
    """Keep every decision that does not follow."""
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
