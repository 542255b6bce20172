"""The results of a certificate: figures of performance and error factors, each with U, k and the coverage probability."""

from __future__ import annotations

from cmm_uq.analysis.conformity.accuracy import TITLES
from cmm_uq.base.messages import NOTHING, Text, listed, say
from cmm_uq.certificate.document import Block, Column, Paragraph, Section, Table
from cmm_uq.certificate.result import Result
from cmm_uq.certificate.stated import SIGN, UNCERTAINTY, stated_table
from cmm_uq.certificate.wording import expanded, title_of
from cmm_uq.maths.uncertainty.rounding import rounded


def performance(result: Result) -> Section:
    """Figures of the lengths; without blocks for an artefact that has none."""
    title = say("Figures of performance")
    if not result.accuracy:
        return Section(title, ())
    notes = (
        UNCERTAINTY,
        say(
            "Each figure estimates what the machine would show on average if the recording were "
            "repeated; all recorded lengths count. The test value of a statement of conformity is another quantity, that of "
            "this recording alone, and its U is the test uncertainty."
        ),
    )
    named = [(TITLES[name], quantity) for name, quantity in result.accuracy.items()]
    return Section(title, (stated_table(title, named, notes),))


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
    columns = (
        Column(say("Error factor"), numeric=False),
        Column(say("Estimate")),
        Column(say("U")),
        Column(say("k")),
        Column(say("Least squares, named model") if result.averaged else say("Least squares")),
        Column(say("Unit"), numeric=False),
    )
    notes = (SIGN, UNCERTAINTY)
    blocks: list[Block] = [Table(say("Error factors of the machine"), columns, tuple(rows), notes)] if rows else []
    for combination in result.undetermined:
        blocks += _free_combination(result, combination)
    return Section(say("Error factors"), tuple(blocks))


def _free_combination(result: Result, combination: tuple[tuple[str, str], ...]) -> list[Block]:
    """A combination that no such recording determines, and the differences inside it that this one does."""
    titles = [title_of(key, result) for key in combination]
    words = Paragraph(
        say(
            "{titles} can change together without changing any observation: the recording does not "
            "determine their common part. A certified length of the artefact would.",
            titles=listed(titles),
        )
    )
    named = [
        (
            say("{second} − {first}", second=title_of(one.second, result), first=title_of(one.first, result)),
            one.quantity,
        )
        for one in result.differences(combination)
    ]
    if not named:
        return [words]
    caption = say("Differences that are determined")
    return [words, stated_table(caption, named, what=say("Difference"), value=say("Estimate"))]
