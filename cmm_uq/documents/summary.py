"""A result in a few lines, for the end of a command; its decisions in a line each, for the first page of a certificate."""

from __future__ import annotations

from collections.abc import Iterable

from cmm_uq.conformity.accuracy import TITLES
from cmm_uq.conformity.statement import Statement
from cmm_uq.documents.result import Result
from cmm_uq.documents.wording import OUTCOME_WORDS, expanded, measured, probability, title_of
from cmm_uq.messages import Text, Verbatim, lines, say


def summary(result: Result, warnings: Iterable[str]) -> list[tuple[str, str, str]]:
    """Rows of what, figure and remark: what was measured, the figures, the decisions, the warnings."""
    facts, free = result.job.facts, {key for combination in result.undetermined for key in combination}
    rows = [(
        "Measured", f"{facts.machine.name}, {result.artefact.title.lower()}, {len(result.residuals)} observations",
        facts.job.date.isoformat(),
    )]  # fmt: skip
    for name, quantity in result.accuracy.items():
        value, U, k = expanded(quantity)
        rows.append((TITLES[name], f"{value} ± {U} {quantity.unit}", f"k = {k}"))
    for size in result.artefact.sizes:
        if size.role == "sought":
            value, U, k = expanded(result.sizes[size.name])
            rows.append((size.title, f"{value} ± {U} {size.unit}", f"k = {k}"))
    for effect in result.model.effects:
        for name, quantity in result.parameters[effect.name].items():
            value, U, k = expanded(quantity)
            known = (effect.name, name) not in free
            rows.append((
                title_of((effect.name, name), result), f"{value} ± {U} {quantity.unit}" if known else "not determined",
                f"k = {k}" if known else "",
            ))  # fmt: skip
    rows += [(each.facts.standard, each.outcome.upper(), _remark(each)) for each in result.statements]
    return rows + [("Warning", text, "") for text in warnings]


def in_short(result: Result) -> Text:
    """What each statement comes to, a line each, for the first page."""
    return lines(
        say("{standard}, {what}: {outcome}", standard=Verbatim(one.facts.standard), what=Verbatim(one.characteristic),
            outcome=OUTCOME_WORDS[one.outcome])
        for one in result.statements
    )  # fmt: skip


def _remark(statement: Statement) -> str:
    """Value, limit and probability of a statement; what its test lacks."""
    value, _ = measured(statement)
    chance = statement.decision.probability_conforming
    told = [f"{value} µm against {statement.limit_um:.4g} µm"]
    if chance is not None:
        told.append(f"conforming with {_chance(chance)}")
    if statement.outcome == "incomplete":
        told = [f"the {statement.measured} measured conform ({', '.join(told)})"]
    if statement.missing:
        told.append(f"missing: {'; '.join(statement.missing)}")
    return "; ".join(told)


def _chance(p: float) -> str:
    return probability(p).replace("<", "less than").replace(">", "more than")
