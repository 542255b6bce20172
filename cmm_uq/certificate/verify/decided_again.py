"""Statements of conformity decided again from what ``results.json`` says: values, uncertainties, limits, rule and prior.

Every quantity is decided by the package's own rules (``conformity``), and what follows for the test from these.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from math import isclose
from typing import Any

from cmm_uq.analysis.conformity.decision import Decision, PriorKnowledge, decide, global_risks
from cmm_uq.analysis.conformity.standards import BUILT_IN
from cmm_uq.analysis.conformity.statement import Decided, Statement
from cmm_uq.base.messages import NOTHING, Verbatim
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

_SAME = 2e-6
"""Relative difference of what follows from numbers of ten digits: a probability far in a tail loses some of them."""

_NAMED: Mapping[str, Any] = {
    "guard_band": GuardBand, "max_false_accept": FalseAccept, "uncertainty_ratio": UncertaintyRatio,
    "posterior_probability": PosteriorProbability, "max_unconditional_false_accept": UnconditionalRisk,
}  # fmt: skip


def check_decisions(inquiry: Inquiry, data: Mapping[str, Any], file: str) -> None:
    """Keep every decision that does not follow.

    Parameters
    ----------
    data : of results.json.
    file : its name.
    """
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
