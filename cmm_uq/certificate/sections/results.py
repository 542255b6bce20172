"""Results of a certificate: figures of performance, error factors, the machine as found, tolerances."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from cmm_uq.analysis.conformity.accuracy import TITLES
from cmm_uq.base.messages import NOTHING, Text, Verbatim, day, listed, names, number, say
from cmm_uq.base.units import unit
from cmm_uq.certificate.document import Block, Paragraph, Section, Table, figure_columns, text_columns
from cmm_uq.certificate.plots.residuals import tolerance_plot
from cmm_uq.certificate.result import Result
from cmm_uq.certificate.sections.first_page import subject_of, tolerances_of
from cmm_uq.certificate.wording import OUTCOME_WORDS, expanded, title_of
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.verdicts import Verdict
from cmm_uq.maths.uncertainty.quantity import Quantity, rounded

SIGN = say("Sign rule: true coordinate = indicated coordinate + error.")

UNCERTAINTY = say(
    "U is the expanded uncertainty for a coverage probability of 95 %, from the 95 % coverage interval of the posterior "
    "distribution; k = U/u is its ratio to the standard uncertainty u."
)


def stated_table(
    caption: Text, named: Iterable[tuple[Text, Quantity]], notes: tuple[Text, ...] = (), *, what: Text = say("Quantity"),
    value: Text = say("Value"),
) -> Table:  # fmt: skip
    columns = (*text_columns(what), *figure_columns(value, say("U"), say("k")), *text_columns(say("Unit")))
    return Table(caption, columns, tuple((name, *expanded(one), one.unit) for name, one in named), notes)


def performance(result: Result) -> Section:
    """Figures of the lengths; without blocks for an artefact that has none."""
    title = say("Figures of performance")
    if not result.accuracy:
        return Section(title, ())
    measurand = say(
        "Each figure estimates what the machine would show on average if the recording were "
        "repeated; all recorded lengths count. The test value of a statement of conformity is another quantity, that of "
        "this recording alone, and its U is the test uncertainty."
    )
    named = [(TITLES[name], quantity) for name, quantity in result.accuracy.items()]
    return Section(title, (stated_table(title, named, (UNCERTAINTY, measurand)),))


def error_factors(result: Result) -> Section:
    """Error factors: what is determined with its uncertainty, what is not with what is known of it instead."""
    ls = result.least_squares
    contradicted = {one.key for one in result.contradictions}
    fitted = {unknown.key: value for unknown, value in zip(ls.unknowns, ls.value, strict=True)}
    rows: list[tuple[Text, ...]] = []
    for effect in result.model.effects:
        for name, quantity in result.parameters[effect.name].items():
            key = (effect.name, name)
            value, U, k = expanded(quantity)
            if key in result.not_given:
                why = say("not given") if key in contradicted else say("not determined")
                rows.append((title_of(key, result), why, NOTHING, NOTHING, NOTHING, quantity.unit))
                continue
            least = rounded(float(fitted[key]), quantity.expanded)[0] if key in fitted else NOTHING
            rows.append((title_of(key, result), value, U, k, least, quantity.unit))
    least_squares = say("Least squares, named model") if result.averaged else say("Least squares")
    columns = (
        *text_columns(say("Error factor")), *figure_columns(say("Estimate"), say("U"), say("k"), least_squares),
        *text_columns(say("Unit")),
    )  # fmt: skip
    notes = (SIGN, UNCERTAINTY)
    blocks: list[Block] = [Table(say("Error factors of the machine"), columns, tuple(rows), notes)] if rows else []
    for combination in result.undetermined:
        blocks += _free_combination(result, combination)
    return Section(say("Error factors"), tuple(blocks))


def _free_combination(result: Result, combination: tuple[tuple[str, str], ...]) -> list[Block]:
    """A combination that no such recording determines, and the differences inside it that this one does."""
    words = Paragraph(say(
        "{titles} can change together without changing any observation: the recording does not "
        "determine their common part. A certified length of the artefact would.",
        titles=listed([title_of(key, result) for key in combination]),
    ))  # fmt: skip
    named = [
        (say("{second} − {first}", second=title_of(one.second, result), first=title_of(one.first, result)), one.quantity)
        for one in result.differences(combination)
    ]  # fmt: skip
    if not named:
        return [words]
    caption = say("Differences that are determined")
    return [words, stated_table(caption, named, what=say("Difference"), value=say("Estimate"))]


Left = tuple[str, str, Text, Quantity]  # group and name of a quantity in results.json, its title, and what it is now.


def as_found_section(job: Job, left: Iterable[Left], verdicts: Iterable[Verdict] = ()) -> Section:
    """Quantities and decisions as found beside those ``left`` (lengths: ``accuracy``); no blocks where nothing is as found."""
    title, found = say("As found and as left"), job.as_found
    if found is None:
        return Section(title, ())
    told = say(
        "As found: {job}{date}, before the machine was adjusted. As left: this measurement.",
        job=Verbatim(found.job.id), date=say(", measured on {date}", date=day(found.job.date)) if found.job.date else NOTHING,
    )  # fmt: skip
    blocks: list[Block] = [Paragraph(told)]
    rows = []
    for group, name, quantity, now in left:
        if (before := found.figure(group, name)) is not None:
            low, high = before.interval95
            then = Quantity(before.value, before.u, (low, high), now.unit)
            rows.append((quantity, *expanded(then)[:2], *expanded(now)[:2], now.unit))
    if rows:
        heads = (*text_columns(say("Quantity")), *figure_columns(say("As found"), say("U"), say("As left"), say("U")),
                 *text_columns(say("Unit")))  # fmt: skip
        note = say("U is the expanded uncertainty for a coverage probability of 95 %.")
        blocks.append(Table(say("The machine as found and as left"), heads, tuple(rows), (note,)))
    decided = tuple(
        (subject_of(now), *(OUTCOME_WORDS.get(name, Verbatim(name)) for name in (before.outcome, now.outcome)))
        for now in verdicts for before in found.stated if (before.by, before.name) == (now.by, now.name)
    )  # fmt: skip
    if decided:
        columns = text_columns(say("Statement"), say("As found"), say("As left"))
        blocks.append(Table(say("Statements of conformity as found and as left"), columns, decided))
    return Section(title, tuple(blocks))


def quantities_left(result: Result) -> list[Left]:
    """Of a result: the figures of the lengths, and the error factors that it determines."""
    left: list[Left] = [("accuracy", name, TITLES[name], quantity) for name, quantity in result.accuracy.items()]
    left += [
        (effect, name, title_of((effect, name), result), quantity)
        for effect, found in result.parameters.items() if effect not in result.free for name, quantity in found.items()
    ]  # fmt: skip
    return left


def as_found_data(job: Job) -> dict[str, Any]:
    """For results.json, where the job names something as found."""
    if job.as_found is None:
        return {}
    found = job.as_found.model_dump(mode="json", include={"job", "estimates", "accuracy_uncertainty", "conformity"})
    return {"as_found": found}


_WORDS = {"pass": say("in"), "fail": say("out"), "undecided": say("open")}


def tolerance_sections(result: Result) -> list[Section]:
    """Every parameter with a tolerance; none when the job sets none."""
    toleranced = tolerances_of(result)
    left_out = sorted(one.name.partition(".")[0] for one in toleranced if one.value is None)
    unknown = say("Not determined by this recording, so not judged: {left_out}.", left_out=listed(names(left_out)))
    judged = [one for one in toleranced if one.value is not None]
    title = say("Tolerances by parameter")
    if not judged:
        return [Section(title, (Paragraph(unknown),))] if left_out else []
    rows, ratios = [], []
    for one in judged:
        effect, _, parameter = one.name.partition(".")
        quantity, tolerance = result.parameters[effect][parameter], result.job.facts.model.tolerances[effect]
        value, U, _ = expanded(quantity)
        rows.append((one.title, value, U, number(tolerance, "g"), one.unit, _WORDS[one.outcome]))
        part = quantity.times(1 / tolerance, unit("1"))
        ratios.append((part.value, *part.interval95))
    columns = (*text_columns(say("Parameter")), *figure_columns(say("Estimate"), say("U"), say("Tolerance")),
               *text_columns(say("Unit"), say("Verdict")))  # fmt: skip
    notes = (say("In or out: the whole 95 % interval is; otherwise open."), *((unknown,) if left_out else ()))
    out = [one.title for one in judged if one.outcome == "fail"]
    plot = tolerance_plot(
        [one.title for one in judged], *map(list, zip(*ratios, strict=True)),
        caption=say("Each parameter over its tolerance, with its 95 % interval."),
        alternative=say("Out of tolerance: {out}.", out=listed(out)) if out else say("No parameter is out of tolerance."),
    )  # fmt: skip
    return [Section(title, (plot, Table(say("Parameters and tolerances"), columns, tuple(rows), notes)))]
