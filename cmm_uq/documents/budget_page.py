"""An uncertainty budget as a document."""

from __future__ import annotations

from cmm_uq import __version__
from cmm_uq.documents.document import Block, Column, Document, Facts, Paragraph, Section, Table
from cmm_uq.documents.plots import budget_bars
from cmm_uq.uncertainty.budget import HEADINGS, Budget
from cmm_uq.uncertainty.budget_results import COMPARISON, SUMMARY, comparison_rows, statement, summary_rows
from cmm_uq.uncertainty.evaluation import Evaluation, Stated
from cmm_uq.uncertainty.model_file import ModelFile
from cmm_uq.uncertainty.ready_budget import ReadyBudget

_TEXT = {"Quantity", "Unit", "Distribution", "Origin", "Method", "Interval"}


def budget_document(file: ModelFile | ReadyBudget, evaluation: Evaluation, name: str) -> Document:
    """The page of an evaluated model file.

    Parameters
    ----------
    file, evaluation : what was asked and what was found.
    name : of the file.
    """
    asked = evaluation.request
    summary = Table("Results", _columns(SUMMARY), tuple(summary_rows(evaluation)), (
        f"Intervals are for a coverage probability of {100 * asked.coverage:g} %; the shortest one where the method is "
        "Monte Carlo.",
    ))  # fmt: skip
    expressions = Facts(tuple((output, f"{output} = {text}") for output, text in _expressions(file).items()))
    described = Facts(tuple(file.descriptions.items()))
    model: tuple[Block, ...] = tuple(facts for facts in (expressions, described) if facts.rows)
    sections = [Section("Measurement model", model), Section("Results", (summary,))]
    sections += [
        Section(f"Budget of {output}", _budget(evaluation, output, stated))
        for output, stated in evaluation.stated.items()
    ]
    return Document(
        title="Uncertainty budget",
        number=file.title,
        subject=f"Evaluated {file.how} from {name}",
        issuer=(),
        particulars=(Facts((("File", name), ("SHA-256", file.sha256))),),
        warnings=(),
        sections=tuple(sections),
        statements=(),
        signatures=(),
        attachments=(name, "results.json"),
        produced_by=f"cmm-uq {__version__}, seed {asked.seed}",
        end="End of budget",
    )


def _expressions(file: ModelFile | ReadyBudget) -> dict[str, str]:
    return {output: expression.text for output, expression in file.expressions.items()}


def _budget(evaluation: Evaluation, output: str, stated: Stated) -> tuple[Block, ...]:
    budget = stated.budget
    blocks: list[Block] = [Paragraph(f"{stated.reason[0].upper()}{stated.reason[1:]}.".replace("..", "."), tone="note")]
    if budget.statement:
        blocks.append(Paragraph(budget.statement, tone="note"))
    blocks += budget_blocks(output, budget)
    rows = tuple(comparison_rows(evaluation, output))
    if len(rows) > 1:
        blocks.append(Table(f"The methods beside each other for {output}", _columns(COMPARISON), rows))
    return (*blocks, Paragraph(statement(evaluation, output)))


def budget_blocks(measurand: str, budget: Budget) -> list[Block]:
    """A budget as a table, and as a picture when it has more than one line."""
    table = Table(f"Contributions to {measurand}", _columns(HEADINGS), tuple(budget.as_text()))
    shares = [(line.name, share) for depth, line, share in budget.flat() if depth == 0 and share]
    if len(shares) < 2:
        return [table]
    names = ", ".join(f"{name} {100 * share:.0f} %" for name, share in shares)
    picture = budget_bars(
        [name for name, _ in shares], [share for _, share in shares],
        caption=f"Share of each contribution in the variance of {measurand}.", alternative=f"Shares: {names}.",
    )  # fmt: skip
    return [table, picture]


def _columns(headings: tuple[str, ...]) -> tuple[Column, ...]:
    return tuple(Column(heading, numeric=heading not in _TEXT) for heading in headings)
