"""As found and as left: what the machine showed before it was adjusted, beside what it shows now (7.8.4.1 d)."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from cmm_uq.analysis.conformity.accuracy import TITLES
from cmm_uq.base.messages import NOTHING, Text, Verbatim, day, say
from cmm_uq.certificate.document import Block, Column, Paragraph, Section, Table
from cmm_uq.certificate.result import Result
from cmm_uq.certificate.summary import subject_of
from cmm_uq.certificate.wording import OUTCOME_WORDS, expanded, title_of
from cmm_uq.jobs.as_found import Figure
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.verdicts import Verdict
from cmm_uq.maths.uncertainty.quantity import Quantity

Left = tuple[str, str, Text, Quantity]
"""Group and name of a quantity in results.json, its title, and what it is now."""


def as_found_section(job: Job, left: Iterable[Left], verdicts: Iterable[Verdict] = ()) -> Section:
    """Every quantity and every decision of both, side by side; without blocks where the job names nothing as found.

    Parameters
    ----------
    left : quantities as left; the group of the figures of the lengths is ``accuracy``.
    verdicts : what is stated of conformity, as left.
    """
    title, found = say("As found and as left"), job.as_found
    if found is None:
        return Section(title, ())
    told = say(
        "As found: {job}{date}, before the machine was adjusted. As left: this measurement.",
        job=Verbatim(found.job.id), date=say(", measured on {date}", date=day(found.job.date)) if found.job.date else NOTHING,
    )  # fmt: skip
    blocks: list[Block] = [Paragraph(told)]
    rows = tuple(
        (title_, *expanded(_quantity(before, now))[:2], *expanded(now)[:2], now.unit)
        for group, name, title_, now in left
        if (before := found.figure(group, name)) is not None
    )
    if rows:
        heads = (
            Column(say("Quantity"), numeric=False), Column(say("As found")), Column(say("U")), Column(say("As left")),
            Column(say("U")), Column(say("Unit"), numeric=False),
        )  # fmt: skip
        note = say("U is the expanded uncertainty for a coverage probability of 95 %.")
        blocks.append(Table(say("The machine as found and as left"), heads, rows, (note,)))
    decided = tuple(
        (subject_of(now), _outcome(before.outcome), _outcome(now.outcome))
        for now in verdicts for before in found.stated if (before.by, before.name) == (now.by, now.name)
    )  # fmt: skip
    if decided:
        columns = tuple(Column(one, numeric=False) for one in (say("Statement"), say("As found"), say("As left")))
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


def _quantity(figure: Figure, now: Quantity) -> Quantity:
    low, high = figure.interval95
    return Quantity(figure.value, figure.u, (low, high), now.unit)


def _outcome(name: str) -> Text:
    return OUTCOME_WORDS.get(name, Verbatim(name))
