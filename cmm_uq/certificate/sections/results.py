"""Results of a certificate, its first page, and the summary on the terminal: every figure and every decision."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, Protocol

from cmm_uq.analysis.conformity.accuracy import TITLES
from cmm_uq.analysis.conformity.decision import rule_words
from cmm_uq.analysis.conformity.own_rule import titled
from cmm_uq.analysis.conformity.statement import NOT_DETERMINED, Statement
from cmm_uq.base import messages
from cmm_uq.base.messages import (
    NOTHING,
    Text,
    Verbatim,
    commas,
    holding,
    listed,
    names,
    number,
    plural,
    say,
    semicolons,
)
from cmm_uq.base.units import unit
from cmm_uq.certificate import document as doc, wording
from cmm_uq.certificate.document import Block, Plot, Section, Table, section
from cmm_uq.certificate.plots.residuals import tolerance_plot
from cmm_uq.certificate.result import Result
from cmm_uq.certificate.sections.conformity import has_picture, named, picture
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.verdicts import GRAVEST, NONE, Verdict, Verdicts, gravest, standing_of
from cmm_uq.maths.uncertainty.quantity import Quantity, limit_in_full, rounded, significant


def stated_table(
    caption: Text, named: Iterable[tuple[Text, Quantity]], notes: tuple[Text, ...] = (), *, what: Text = say("Quantity"),
    value: Text = say("Value"),
) -> Table:  # fmt: skip
    heads = (what, doc.Column(value), doc.Column(say("U")), doc.Column(say("k")), say("Unit"))
    each = tuple(named)
    rows = tuple((name, *wording.stated(one), one.unit) for name, one in each)
    return Table(caption, doc.columns(heads), rows, (*notes, *wording.skewed_note(one for _, one in each)))


def error_factors(result: Result) -> Section:
    """Error factors: what is determined with its uncertainty, what is not with what is known of it instead."""
    ls = result.least_squares
    contradicted = {*result.denied, *(one.key for one in result.contradictions)}
    fitted = {unknown.key: value for unknown, value in zip(ls.unknowns, ls.value, strict=True)}
    rows: list[tuple[Text, ...]] = []
    for key, quantity in reported(result):
        figures: tuple[Text, ...] = (say("not determined"), NOTHING, NOTHING, NOTHING)
        if key in contradicted:
            figures = (say("not given"), *figures[1:])
        elif key not in result.not_given:
            least = rounded(float(fitted[key]), quantity.expanded)[0] if key in fitted else NOTHING
            figures = (*wording.stated(quantity), least)
        rows.append((wording.title_of(key, result), *figures, quantity.unit))
    least_squares = say("Least squares, named model") if result.averaged else say("Least squares")
    columns = map(doc.Column, (say("Estimate"), say("U"), say("k"), least_squares))
    skewed = wording.skewed_note(one for key, one in reported(result) if key not in result.not_given)
    factors = doc.table(say("Error factors of the machine"), (say("Error factor"), *columns, say("Unit")), rows, wording.SIGN,
                        wording.UNCERTAINTY, *skewed)  # fmt: skip
    free = (block for combination in result.undetermined for block in _free_combination(result, combination))
    return section(say("Error factors"), factors, *free)


def reported(result: Result) -> Iterator[tuple[tuple[str, str], Quantity]]:
    for effect in result.model.effects:
        yield from (((effect.name, name), quantity) for name, quantity in result.parameters[effect.name].items())


def _free_combination(result: Result, combination: tuple[tuple[str, str], ...]) -> list[Block]:
    """A combination that no such recording determines, and the differences inside it that this one does."""
    titles = listed([wording.title_of(key, result) for key in combination])
    differences = result.differences(combination)
    words = say(
        "{titles} can change without changing any observation: the recording determines none of it by itself.",
        titles=titles,
    )
    if differences:
        words = say(
            "{titles} can change together without changing any observation: the recording does not "
            "determine their common part. A certified length of the artefact would.", titles=titles,
        )  # fmt: skip
    named = [
        (say("{second} − {first}", second=wording.title_of(one.second, result), first=wording.title_of(one.first, result)),
         one.quantity)
        for one in differences
    ]  # fmt: skip
    caption = say("Differences that are determined")
    stated = [stated_table(caption, named, what=say("Difference"), value=say("Estimate"))] if named else []
    return [doc.Paragraph(words), *stated]


Left = tuple[str, str, Text, Quantity]  # group and name of a quantity in results.json, its title, and what it is now.


def as_found_section(job: Job, left: Iterable[Left], verdicts: Iterable[Verdict] = ()) -> Section:
    """Quantities and decisions as found beside those ``left`` (lengths: ``accuracy``); no blocks where nothing is as found."""
    title, found = say("As found and as left"), job.as_found
    if found is None:
        return section(title)
    date = say(", measured on {date}", date=messages.day(found.job.date)) if found.job.date else NOTHING
    told = say("As found: {job}{date}, before the machine was adjusted. As left: this measurement.",
               job=Verbatim(found.job.id), date=date)  # fmt: skip
    rows = []
    for group, name, quantity, now in left:
        if (before := found.figure(group, name)) is not None:
            low, high = before.interval95
            then = Quantity(before.value, before.u, (low, high), now.unit)
            rows.append((quantity, *wording.stated(then)[:2], *wording.stated(now)[:2], now.unit))
    figures = (doc.Column(head) for head in (say("As found"), say("U"), say("As left"), say("U")))
    note = say("U is the expanded uncertainty for a coverage probability of 95 %.")
    heads = (say("Statement"), say("As found"), say("As left"))
    decided = (
        (subject_of(now), *(wording.OUTCOME_WORDS.get(name, Verbatim(name)) for name in (before.outcome, now.outcome)))
        for now in verdicts for before in found.stated if (before.by, before.name) == (now.by, now.name)
    )  # fmt: skip
    return section(
        title,
        doc.Paragraph(told),
        doc.table(say("The machine as found and as left"), (say("Quantity"), *figures, say("Unit")), rows, note),
        doc.table(say("Statements of conformity as found and as left"), heads, decided),
    )


def quantities_left(result: Result) -> list[Left]:
    """Of a result: the figures of the lengths, and the error factors that it determines."""
    left: list[Left] = [("accuracy", name, TITLES[name], quantity) for name, quantity in result.accuracy.items()]
    left += [
        (effect, name, wording.title_of((effect, name), result), quantity)
        for effect, found in result.parameters.items() if effect not in result.free for name, quantity in found.items()
    ]  # fmt: skip
    return left


def as_found_data(job: Job) -> dict[str, Any]:
    """For results.json, where the job names something as found."""
    if job.as_found is None:
        return {}
    found = job.as_found.model_dump(mode="json", include={"job", "estimates", "accuracy_uncertainty", "conformity"})
    return {"as_found": found}


def tolerance_sections(result: Result) -> list[Section]:
    """Every parameter with a tolerance; none when the job sets none."""
    toleranced, title = tolerances_of(result), say("Tolerances by parameter")
    left_out = sorted(one.name.partition(".")[0] for one in toleranced if one.value is None)
    free, aside = (
        listed(names(name for name in left_out if (name in result.free) == known)) for known in (True, False)
    )
    not_judged = holding(
        (free, say("Not determined by this recording, so not judged: {left_out}.", left_out=free)),
        (aside, say("Not judged, since the laboratory set measurements aside, which are not in the estimate: {left_out}.",
                    left_out=aside)),
    )  # fmt: skip
    judged = [one for one in toleranced if one.value is not None]
    if not judged:
        return [section(title, *map(doc.Paragraph, not_judged))] if left_out else []
    rows, ratios = [], []
    for one in judged:
        effect, _, parameter = one.name.partition(".")
        quantity, tolerance = result.parameters[effect][parameter], result.job.facts.model.tolerances[effect]
        value, U, _ = wording.stated(quantity)
        rows.append((one.title, value, U, number(tolerance, "g"), one.unit, wording.OUTCOME_WORDS[one.outcome]))
        part = quantity.times(1 / tolerance, unit("1"))
        ratios.append((part.value, *part.interval95))
    out = listed([one.title for one in judged if one.outcome == "fail"])
    plot = tolerance_plot(
        [one.title for one in judged],
        *map(list, zip(*ratios, strict=True)),
        caption=say("Each parameter over its tolerance, with its 95 % interval."),
        alternative=say("Out of tolerance: {out}.", out=out) if out else say("No parameter is out of tolerance."),
    )
    figures = map(doc.Column, (say("Estimate"), say("U"), say("Tolerance")))
    heads: tuple[Text | doc.Column, ...] = (say("Parameter"), *figures, say("Unit"), say("Decision"))
    inside = say("Pass or fail: the whole 95 % interval lies within the tolerance, or outside it; undecided otherwise.")
    return [section(title, plot, doc.table(say("Parameters and tolerances"), heads, rows, inside, *not_judged))]


def summary(result: Result, warnings: Iterable[Text]) -> wording.Summary:
    facts, artefact = result.job.facts, result.artefact
    machine = Verbatim(facts.machine.name)
    subject = say("{machine}, {artefact:small}, {count} observations",
                  machine=machine, artefact=artefact.title, count=len(result.residuals))  # fmt: skip
    figures = [wording.figure_row(TITLES[name], quantity) for name, quantity in result.accuracy.items()]
    sought = (size for size in artefact.sizes if size.role == "sought")
    figures += [wording.figure_row(size.title, result.sizes[size.name]) for size in sought]
    figures += [
        wording.figure_row(wording.title_of(key, result), one, known=key not in result.not_given)
        for key, one in reported(result)
    ]
    return wording.Summary(
        subject, messages.day(facts.job.date), headlines(result), tuple(figures), warnings=tuple(warnings)
    )


class Stating(Protocol):
    """What states whether something conforms."""

    @property
    def statements(self) -> tuple[Statement, ...]:
        """By standards, or the laboratory's own rule."""

    @property
    def verdicts(self) -> Verdicts:
        """The same, then parameters with a tolerance."""


def headlines(result: Stating) -> tuple[wording.Headline, ...]:
    remarks = [_remarks(statement) for statement in result.statements]
    for one in tolerances_of(result):
        value, U = rounded(one.value or 0.0, one.U or 0.0)
        known = one.value is not None and one.U is not None
        remarks.append([say("{value} ± {u} {unit}", value=value, u=U, unit=one.unit)] if known else list(one.missing))
    return tuple(
        wording.Headline(one.outcome.upper(), one.standing, subject_of(one), tuple(told))
        for one, told in zip(result.verdicts, remarks, strict=True)
    )


def subject_of(one: Verdict) -> Text:
    """What is decided: standard and characteristic, or a parameter with its tolerance."""
    if one.by:
        return say("{standard}, {what}", standard=titled(one.by), what=Verbatim(one.name))
    limit = limit_in_full(one.limit or 0.0)
    return say("{title}, tolerance {limit} {unit}", title=one.title, limit=limit, unit=one.unit)


def tolerances_of(result: Stating) -> list[Verdict]:
    return [one for one in result.verdicts if not one.by]


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
_ROWS = {True: 26, False: 16}  # of a table that the first page has room for, without decisions and beside them

_WORDS: Mapping[str, Text] = {
    "fail": say("Does not conform"),
    "conditional fail": say("Conditionally rejected: beyond its limits, not with its uncertainty"),
    "remeasure": say("Not decided: the standard asks for further readings"),
    "undecided": say("Not decided: the value is nearer to its limit than its uncertainty"),
    "incomplete": say("Incomplete: conformity is not stated"),
    "conditional pass": say("Conditionally accepted: within its limits, not with its uncertainty"),
}


def overview_of(result: Stating) -> doc.Overview | None:
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
    # the first of what statements lack, and how much more there is
    if lacking := list(dict.fromkeys(what for one in verdicts if one.value is not None for what in one.missing)):
        shown, more = semicolons(lacking[:2]), len(lacking) - 2
        if more > 0:
            shown = say("{shown}; {count} more behind this page", shown=shown, count=more)
        rows.append((say("Missing"), shown))
    rules = [rule_words(one.facts.rule) for one in result.statements]
    if len(verdicts) > len(result.statements):
        rules.append(say("tolerances: the whole 95 % interval must lie within"))
    rows.append((say("Decision rule"), semicolons(dict.fromkeys(rules))))
    return doc.Overview(_verdict(verdicts, result.statements), standing_of(verdicts.overall), tuple(rows))


def _gravity(outcome: str) -> int:
    return GRAVEST.index(outcome) if outcome in GRAVEST else GRAVEST.index("undecided")


def _verdict(verdicts: Sequence[Verdict], statements: Sequence[Statement]) -> Text:
    overall, count = gravest(one.outcome for one in verdicts), len(verdicts)
    if overall == "pass":
        many = say("Conforms: all {count} statements of conformity", count=count)
        return plural(count, one=say("Conforms"), many=many)
    words, alike = _WORDS.get(overall, say("Not decided")), sum(one.outcome == overall for one in verdicts)
    undecided = [one.decision for one in statements if one.outcome == "undecided"]
    if overall == "undecided" and any(one.guard_band is None for one in undecided):
        words = wording.TOO_UNCERTAIN
    elif overall == "undecided" and all(one.value is None for one in verdicts if one.outcome == overall):
        words = say("Not decided")
    several = say("{words}: {alike} of {count} statements of conformity", words=words, alike=alike, count=count)
    return words if count == 1 else several


def _row(one: Verdict, *, signed: bool) -> Text:
    if one.value is None:
        outcome = wording.OUTCOME_WORDS.get(one.outcome, say("undecided"))
        if one.missing and NOT_DETERMINED not in one.missing:
            return say("{outcome}: {why}", outcome=outcome, why=semicolons(one.missing))
        return say("{outcome}: not determined by this recording", outcome=outcome)
    value = wording.stated_value(one.value, one.U, signed=signed)
    return wording.stated_row(one.outcome, value, one.unit, one.limit if one.by else None)


def with_first(result: Result, sections: Sequence[Section]) -> list[Section]:
    """Sections, with the first page's: the picture of the gravest statement, else of the tolerances, else the main figures."""
    shown = min((s for s in result.statements if has_picture(s)), key=lambda s: _gravity(s.outcome), default=None)
    plot, title = None, say("Tolerances by parameter")
    if shown is not None:
        plot = picture(shown)
    elif len(result.verdicts) > len(result.statements):
        plot = next((b for s in sections if s.title == title for b in s.blocks if isinstance(b, Plot)), None)
    if plot is None:
        first, *others = (section for section in sections if section.blocks)
        rows = sum(len(block.rows) for block in first.blocks if isinstance(block, Table))
        return [replace(first, first=rows <= _ROWS[result.verdicts.overall == NONE]), *others]
    rest = [replace(section, blocks=tuple(b for b in section.blocks if not (isinstance(b, Plot) and b.svg == plot.svg)))
            for section in sections]  # fmt: skip
    what = title if shown is None else named(shown)
    return [Section(say("{what} against the limits", what=what), (plot,), first=True), *rest]
