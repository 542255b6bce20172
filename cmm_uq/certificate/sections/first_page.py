"""The first page of a certificate and the summary on the terminal: every decision in a few lines."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

from cmm_uq.analysis.conformity.accuracy import TITLES
from cmm_uq.analysis.conformity.decision import rule_words
from cmm_uq.analysis.conformity.statement import Statement
from cmm_uq.base.messages import Text, Verbatim, commas, day, number, plural, say, semicolons
from cmm_uq.certificate import wording
from cmm_uq.certificate.document import Overview, Plot, Section, Table
from cmm_uq.certificate.result import Result
from cmm_uq.certificate.sections.conformity import has_picture, named, picture
from cmm_uq.jobs.verdicts import GRAVEST, NONE, Verdict, gravest, standing_of
from cmm_uq.maths.uncertainty.quantity import limit_in_full, rounded, significant


def summary(result: Result, warnings: Iterable[Text]) -> wording.Summary:
    facts, artefact = result.job.facts, result.artefact
    machine = Verbatim(facts.machine.name)
    subject = say("{machine}, {artefact:small}, {count} observations",
                  machine=machine, artefact=artefact.title, count=len(result.residuals))  # fmt: skip
    figures = [wording.figure_row(TITLES[name], quantity) for name, quantity in result.accuracy.items()]
    figures += [
        wording.figure_row(size.title, result.sizes[size.name]) for size in artefact.sizes if size.role == "sought"
    ]
    for effect in result.model.effects:
        for name, quantity in result.parameters[effect.name].items():
            key = (effect.name, name)
            figures.append(
                wording.figure_row(wording.title_of(key, result), quantity, known=key not in result.not_given)
            )
    remarks = (*map(_remarks, result.statements), *map(_tolerance_remarks, tolerances_of(result)))
    decided = tuple(
        wording.Headline(one.outcome.upper(), one.standing, subject_of(one), tuple(told))
        for one, told in zip(result.verdicts, remarks, strict=True)
    )
    return wording.Summary(subject, day(facts.job.date), decided, tuple(figures), warnings=tuple(warnings))


def subject_of(one: Verdict) -> Text:
    """What is decided: standard and characteristic, or a parameter with its tolerance."""
    if one.by:
        return say("{standard}, {what}", standard=Verbatim(one.by), what=Verbatim(one.name))
    limit = limit_in_full(one.limit or 0.0)
    return say("{title}, tolerance {limit} {unit}", title=one.title, limit=limit, unit=one.unit)


def tolerances_of(result: Result) -> list[Verdict]:
    return [one for one in result.verdicts if not one.by]


def _tolerance_remarks(one: Verdict) -> list[Text]:
    if one.value is None or one.U is None:
        return list(one.missing)
    value, U = rounded(one.value, one.U)
    return [say("{value} ± {u} {unit}", value=value, u=U, unit=one.unit)]


def _remarks(statement: Statement) -> list[Text]:
    """Value, limit, uncertainty and probability of a statement; what its test lacks."""
    value, _ = wording.measured(statement)
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
    if p < wording.CERTAIN:
        return say("less than\u00a0{p}\u00a0%", p=number(100 * wording.CERTAIN, "g"))
    if p > 1 - wording.CERTAIN:
        return say("more than\u00a0{p}\u00a0%", p=number(100 * (1 - wording.CERTAIN), "g"))
    return wording.probability(p)


_MOST = 8  # statements in the box; of more the gravest, all are behind the page
_ROWS = 16  # of a table that the first page has room for

_WORDS: Mapping[str, Text] = {
    "fail": say("Does not conform"),
    "conditional fail": say("Does not conform, within the uncertainty of the measurement"),
    "remeasure": say("Not decided: the standard asks for further readings"),
    "undecided": say("Not decided: the value is nearer to its limit than its uncertainty"),
    "incomplete": say("Incomplete: conformity is not stated"),
    "conditional pass": say("Conforms, within the uncertainty of the measurement"),
}


def overview_of(result: Result) -> Overview | None:
    """The verdict on the whole and each statement behind it; nothing where nothing is stated."""
    verdicts = result.verdicts
    if verdicts.overall == NONE:
        return None
    signed = {i: statement.signed for i, statement in enumerate(result.statements)}
    rows = [(subject_of(one), _row(one, signed=signed.get(i, True))) for i, one in enumerate(verdicts)]
    if (more := len(rows) - _MOST) > 0:
        order = sorted(range(len(rows)), key=lambda i: _gravity(verdicts[i].outcome))[:_MOST]
        further = say("Further statements"), say("{count}, behind this page", count=more)
        rows = [*(rows[i] for i in sorted(order)), further]
    return Overview(_verdict(verdicts), standing_of(verdicts.overall), (*rows, *_lacking(verdicts), *_rules(result)))


def _gravity(outcome: str) -> int:
    return GRAVEST.index(outcome) if outcome in GRAVEST else GRAVEST.index("undecided")


def _verdict(verdicts: Sequence[Verdict]) -> Text:
    overall, count = gravest(one.outcome for one in verdicts), len(verdicts)
    if overall == "pass":
        many = say("Conforms: all {count} statements of conformity", count=count)
        return plural(count, one=say("Conforms"), many=many)
    words = _WORDS.get(overall, wording.OUTCOME_WORDS.get(overall, say("Not decided")))
    if count == 1:
        return words
    alike = sum(one.outcome == overall for one in verdicts)
    return say("{words}: {alike} of {count} statements of conformity", words=words, alike=alike, count=count)


def _row(one: Verdict, *, signed: bool) -> Text:
    if one.value is None:
        outcome = wording.OUTCOME_WORDS.get(one.outcome, say("undecided"))
        return say("{outcome}: not determined by this recording", outcome=outcome)
    value = wording.stated_value(one.value, one.U, signed=signed)
    return wording.stated_row(one.outcome, value, one.unit, one.limit if one.by else None)


def _lacking(verdicts: Sequence[Verdict]) -> list[tuple[Text, Text]]:
    """The first of what statements lack, and how much more there is."""
    lacking = list(dict.fromkeys(what for one in verdicts if one.value is not None for what in one.missing))
    if not lacking:
        return []
    shown, more = semicolons(lacking[:2]), len(lacking) - 2
    return [(say("Missing"),
             say("{shown}; {count} more behind this page", shown=shown, count=more) if more > 0 else shown)]  # fmt: skip


def _rules(result: Result) -> list[tuple[Text, Text]]:
    told = [rule_words(one.facts.rule) for one in result.statements]
    if len(result.verdicts) > len(result.statements):
        told.append(say("tolerances: the whole 95 % interval must lie within"))
    return [(say("Decision rule"), semicolons(dict.fromkeys(told)))]


def with_first(result: Result, sections: Sequence[Section]) -> list[Section]:
    """Sections, with the first page's: the picture of the gravest statement, else of the tolerances, else the main figures."""
    shown = min((s for s in result.statements if has_picture(s)), key=lambda s: _gravity(s.outcome), default=None)
    plot: Plot | None = None
    if shown is not None:
        plot = picture(shown)
    elif len(result.verdicts) > len(result.statements):
        plot = next((b for s in sections if s.title == _TOLERANCES for b in s.blocks if isinstance(b, Plot)), None)
    if plot is None:
        first, *others = (section for section in sections if section.blocks)
        rows = sum(len(block.rows) for block in first.blocks if isinstance(block, Table))
        return [replace(first, first=rows <= _ROWS), *others]
    rest = [replace(section, blocks=tuple(b for b in section.blocks if not (isinstance(b, Plot) and b.svg == plot.svg)))
            for section in sections]  # fmt: skip
    title = named(shown) if isinstance(shown, Statement) else _TOLERANCES
    return [Section(say("{what} against the limits", what=title), (plot,), first=True), *rest]


_TOLERANCES = say("Tolerances by parameter")
