"""The uncertainty budget of a measurement model, as a page."""

from __future__ import annotations

from typing import TYPE_CHECKING

from cmm_uq.base.messages import Text, Verbatim, commas, foreign, say
from cmm_uq.certificate.document import Block, Column, Document, Facts, Paragraph, Section, Table, program_page
from cmm_uq.certificate.plots.residuals import budget_bars
from cmm_uq.maths.uncertainty.budget import HEADINGS, Budget
from cmm_uq.maths.uncertainty.budget_results import COMPARISON, SUMMARY, comparison_rows, statement, summary_rows

if TYPE_CHECKING:
    from cmm_uq.maths.uncertainty.evaluation import Evaluation, OutputResult as Stated
    from cmm_uq.maths.uncertainty.models.model_file import ModelFile
    from cmm_uq.maths.uncertainty.models.ready import ReadyBudget

_TEXT = {"Quantity", "Unit", "Distribution", "Origin", "Method", "Interval"}


def budget_document(file: ModelFile | ReadyBudget, evaluation: Evaluation, name: str) -> Document:
    asked = evaluation.request
    note = say("Intervals are for a coverage probability of {coverage:g} %; the shortest one where the method is Monte Carlo.",
               coverage=100 * asked.coverage)  # fmt: skip
    summary = Table(say("Results"), _columns(SUMMARY), tuple(summary_rows(evaluation)), (note,))
    expressions = Facts(tuple(
        (Verbatim(output), say("{output} = {text}", output=Verbatim(output), text=Verbatim(expression.text)))
        for output, expression in file.expressions.items()
    ))  # fmt: skip
    described = Facts(tuple((foreign(what), foreign(text)) for what, text in file.descriptions.items()))
    model: tuple[Block, ...] = tuple(facts for facts in (expressions, described) if facts.rows)
    sections = [Section(say("Measurement model"), model), Section(say("Results"), (summary,))]
    sections += [
        Section(say("Budget of {output}", output=Verbatim(output)), _budget(evaluation, output, stated))
        for output, stated in evaluation.stated.items()
    ]
    return program_page(
        say("Uncertainty budget"), Verbatim(file.title), say("Evaluated {how} from {name}", how=file.how, name=Verbatim(name)),
        sections, name, "results.json", seed=asked.seed, end=say("End of budget"),
        particulars=(Facts(((say("File"), Verbatim(name)), (say("SHA-256"), Verbatim(file.sha256)))),),
    )  # fmt: skip


def _budget(evaluation: Evaluation, output: str, stated: Stated) -> tuple[Block, ...]:
    budget, reason, name = stated.budget, stated.reason, Verbatim(output)
    sentence = (
        say("{reason:capital}", reason=reason) if reason.endswith(".") else say("{reason:capital}.", reason=reason)
    )
    texts = (sentence, budget.statement) if budget.statement else (sentence,)
    blocks: list[Block] = [Paragraph(text, tone="note") for text in texts]
    blocks += budget_blocks(name, budget)
    rows = tuple(comparison_rows(evaluation, output))
    if len(rows) > 1:
        title = say("The methods beside each other for {output}", output=name)
        blocks.append(Table(title, _columns(COMPARISON), rows))
    return (*blocks, Paragraph(statement(evaluation, output)))


def budget_blocks(measurand: Text, budget: Budget, *notes: Text) -> list[Block]:
    """A budget as a table, and as a picture when it has more than one line."""
    caption = say("Contributions to {measurand}", measurand=measurand)
    table = Table(caption, _columns(HEADINGS), tuple(budget.as_text()), notes)
    shares = [(line.name, share) for depth, line, share in budget.flat() if depth == 0 and share]
    if len(shares) < 2:
        return [table]
    told = commas(say("{name} {share:.0f} %", name=name, share=100 * share) for name, share in shares)
    caption = say("Share of each contribution in the variance of {measurand}.", measurand=measurand)
    names, parts = zip(*shares, strict=True)
    return [table, budget_bars(names, parts, caption=caption, alternative=say("Shares: {shares}.", shares=told))]


def _columns(headings: tuple[Text, ...]) -> tuple[Column, ...]:
    return tuple(Column(heading, numeric=heading not in _TEXT) for heading in headings)
