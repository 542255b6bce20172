"""A result in a few lines, for the end of a command; its decisions in a line each, for the first page of a certificate."""

from __future__ import annotations

from collections.abc import Iterable

from cmm_uq.analysis.conformity.accuracy import TITLES
from cmm_uq.analysis.conformity.statement import Statement
from cmm_uq.base.messages import Text, Verbatim, commas, day, number, say, semicolons
from cmm_uq.certificate.in_short import Summary, Verdict, figure_row
from cmm_uq.certificate.result import Result
from cmm_uq.certificate.wording import CERTAIN, measured, probability, title_of
from cmm_uq.jobs.verdicts import Verdict as Stated
from cmm_uq.maths.uncertainty.rounding import limit_in_full, rounded, significant


def summary(result: Result, warnings: Iterable[Text]) -> Summary:
    """What was measured, the decisions, the figures, the warnings."""
    facts = result.job.facts
    subject = say(
        "{machine}, {artefact:small}, {count} observations",
        machine=Verbatim(facts.machine.name), artefact=result.artefact.title, count=len(result.residuals),
    )  # fmt: skip
    figures = [figure_row(TITLES[name], quantity) for name, quantity in result.accuracy.items()]
    figures += [
        figure_row(size.title, result.sizes[size.name]) for size in result.artefact.sizes if size.role == "sought"
    ]
    for effect in result.model.effects:
        for name, quantity in result.parameters[effect.name].items():
            key = (effect.name, name)
            figures.append(figure_row(title_of(key, result), quantity, known=key not in result.not_given))
    remarks = (*map(_remarks, result.statements), *map(_tolerance_remarks, tolerances_of(result)))
    decided = tuple(
        Verdict(one.outcome.upper(), one.standing, subject_of(one), tuple(told))
        for one, told in zip(result.verdicts, remarks, strict=True)
    )
    return Summary(subject, day(facts.job.date), decided, tuple(figures), warnings=tuple(warnings))


def subject_of(one: Stated) -> Text:
    """What is decided: standard and characteristic, or a parameter with its tolerance."""
    if one.by:
        return say("{standard}, {what}", standard=Verbatim(one.by), what=Verbatim(one.name))
    return say(
        "{title}, tolerance {limit} {unit}", title=one.title, limit=limit_in_full(one.limit or 0.0), unit=one.unit
    )


def tolerances_of(result: Result) -> list[Stated]:
    """Statements by tolerances."""
    return [one for one in result.verdicts if not one.by]


def _tolerance_remarks(one: Stated) -> list[Text]:
    if one.value is None or one.U is None:
        return list(one.missing)
    value, U = rounded(one.value, one.U)
    return [say("{value} ± {u} {unit}", value=value, u=U, unit=one.unit)]


def _remarks(statement: Statement) -> list[Text]:
    """Value, limit, uncertainty and probability of a statement; what its test lacks."""
    value, _ = measured(statement)
    chance = statement.decision.probability_conforming
    told: list[Text] = [say("{value} µm against {limit} µm", value=value, limit=limit_in_full(statement.limit_um))]
    if statement.u_um > 0:
        told.append(say("test uncertainty U = {u} µm (k = 2)", u=significant(2 * statement.u_um)))
    if chance is not None:
        told.append(say("conforming with {chance}", chance=_chance(chance)))
    if statement.outcome == "incomplete":
        told = [say("the {measured} measured conform ({figures})", measured=statement.measured, figures=commas(told))]
    if statement.missing:
        told.append(say("missing: {what}", what=semicolons(statement.missing)))
    return told


def _chance(p: float) -> Text:
    if p < CERTAIN:
        return say("less than\u00a0{p}\u00a0%", p=number(100 * CERTAIN, "g"))
    if p > 1 - CERTAIN:
        return say("more than\u00a0{p}\u00a0%", p=number(100 * (1 - CERTAIN), "g"))
    return probability(p)
