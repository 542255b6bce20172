"""What the certificates of shifted artefacts have in common: figures, summary, the artefact, how the sampling went."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from cmm_uq.artefacts.shifting.facts import shift_facts
from cmm_uq.base.messages import Text, Verbatim, day, number, say
from cmm_uq.certificate.document import Block, Facts, Paragraph, Section
from cmm_uq.certificate.origin import file_name
from cmm_uq.certificate.sections.results import SIGN, Left, stated_table
from cmm_uq.certificate.sections.traceability import artefact_rows, certificate_rows, traceability_section
from cmm_uq.certificate.wording import Summary, figure_row
from cmm_uq.jobs.job import Job
from cmm_uq.maths.inference.ensembles import Chains
from cmm_uq.maths.uncertainty.quantity import nominal, significant

Named = Sequence[Left]
"""Quantities that are stated, each with its place in results.json and its name."""


def table_file(job: Job) -> str:
    """Name of the correction table, an error map, beside the certificate."""
    return file_name("correction_table.csv", job.origin)


def figures_section(caption: Text, named: Named, meaning: Text) -> Section:
    """Figures of performance.

    Parameters
    ----------
    caption : of their table.
    named : the figures.
    meaning : what they are figures of.
    """
    notes = (
        SIGN,
        meaning,
        say("U is the expanded uncertainty for a coverage probability of 95 %, from the posterior distribution."),
    )
    return Section(
        say("Figures of performance"),
        (stated_table(caption, [(name, quantity) for _, _, name, quantity in named], notes),),
    )


def summary_of(job: Job, what: Text, named: Named, warnings: Iterable[Text]) -> Summary:
    """What was measured, its figures and warnings, for the end of a command."""
    figures = tuple(figure_row(name, quantity) for _, _, name, quantity in named)
    return Summary(what, day(job.facts.job.date), figures=figures, warnings=tuple(warnings))


def artefact_section(
    job: Job, otherwise: Text, points: Text, shifts: tuple[tuple[Text, Text], ...], *further: Block
) -> Section:
    """The artefact, what of it is known, and to what that makes the results traceable.

    Parameters
    ----------
    otherwise : what an artefact without a name is.
    points : what a known length lies between, in the plural.
    shifts : rows on how it was shifted.
    further : blocks on its own dimensions.
    """
    facts = shift_facts(job)
    rows = artefact_rows(job, otherwise)
    if (known := facts.known) is not None:
        told = say(
            "{points} {first} to {last}: {length} mm, U = {U} µm (k = 2)",
            points=points, first=known.from_point, last=known.to_point, length=nominal(known.length_mm),
            U=significant(2 * known.u_um),
        )  # fmt: skip
        rows.append((say("Known length"), told))
    return traceability_section(job, (*rows, *certificate_rows(facts.certificate), *shifts), *further)


def method_section(text: Text, readings: int, chains: Chains, seed: int, *further: Block) -> Section:
    """How the readings were fitted, and how the sampling went.

    Parameters
    ----------
    text : what was fitted.
    readings : how many.
    """
    reached = say(
        "{reached}: {ess:.0f} effective samples, R-hat {rhat:.4f}, autocorrelation time {time:.1f} of {steps} steps",
        reached=say("reached") if chains.converged else say("NOT reached"),
        ess=chains.ess_min,
        rhat=chains.rhat_max,
        time=chains.autocorrelation_time,
        steps=chains.steps,
    )
    rows = (
        (say("Readings (means)"), number(readings)),
        (say("Sampler"), say("{sampler}, seed {seed}", sampler=Verbatim(chains.sampler), seed=seed)),
        (say("Convergence"), reached),
    )
    return Section(say("Method"), (Paragraph(text), Facts(rows), *further))
