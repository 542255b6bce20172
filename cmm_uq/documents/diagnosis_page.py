"""A diagnosis as a document, and its results.json."""

from __future__ import annotations

from typing import Any

import numpy as np

from cmm_uq.conformity.accuracy import TITLES, UNITS
from cmm_uq.documents.against import corrections, simulation_section
from cmm_uq.documents.diagnosis_costs import costs_section
from cmm_uq.documents.diagnosis_next import next_section
from cmm_uq.documents.diagnosis_unseen import unseen_section
from cmm_uq.documents.diagnosis_words import (
    VERDICT_WORDS,
    lines,
    noise_words,
    sentences_of,
    stated_um,
    summary_of,
    verdict_of,
)
from cmm_uq.documents.document import Block, Column, Document, Facts, Paragraph, Section, Table
from cmm_uq.documents.improvement_table import improvement_table
from cmm_uq.documents.origin import came_about
from cmm_uq.documents.outcome import Outcome
from cmm_uq.documents.plots import curve_with_band, length_plot
from cmm_uq.documents.program import program
from cmm_uq.documents.result import Diagnosed
from cmm_uq.documents.results_file import diagnosis_data, head
from cmm_uq.documents.withheld import sentences as withheld_sentences
from cmm_uq.documents.wording import OUTCOME_WORDS, expanded, probability
from cmm_uq.documents.working_page import working_page
from cmm_uq.messages import Text, Verbatim, commas, day, names, number, say
from cmm_uq.uncertainty.degrees_of_freedom import factor_of_noise
from cmm_uq.units import MICROMETRE, unit


def diagnosis_results(found: Diagnosed) -> dict[str, Any]:
    """results.json of a diagnosis."""
    posterior = found.diagnosis.posterior
    return {
        **head(found.job),
        "sampling": {
            "sampler": posterior.sampler, "seed": posterior.seed, "ess_min": posterior.ess_min,
            "rhat_max": posterior.rhat_max, "converged": posterior.converged,
        },
        "diagnosis": diagnosis_data(found),
    }  # fmt: skip


def diagnosis_document(found: Diagnosed) -> Document:
    """The page of a diagnosis."""
    facts, d = found.job.facts, found.diagnosis
    return working_page(
        facts,
        say("Diagnosis"),
        say("{came_about} {date}", came_about=came_about(found.job), date=day(facts.job.date)),
        particulars=(
            Facts(
                (
                    (say("Verdict"), VERDICT_WORDS[d.verdict]),
                    (say("p-value of “nothing is missing”"), number(d.p_value, ".2g")),
                    (say("False-alarm rate"), say("{alpha:g} %", alpha=100 * d.alpha)),
                )
            ),
            Facts(
                (
                    (say("Machine"), Verbatim(facts.machine.name)),
                    (say("Artefact"), d.before.artefact.title),
                    _explained_by(found),
                )
            ),
        ),
        warnings=(say("{why:capital}.", why=f.why) for f in found.findings),
        sections=diagnosis_sections(found),
        produced_by=say(
            "{program}, {sampler}, seed {seed}",
            program=program(found.job),
            sampler=Verbatim(d.posterior.sampler),
            seed=d.posterior.seed,
        ),
    )


def diagnosis_sections(found: Diagnosed) -> tuple[Section, ...]:
    """What a diagnosis says, as sections of any document."""
    noise = noise_words(found.diagnosis, stated_um(found))
    sections = (
        Section(say("What was left out"), _left_out(found)),
        *_simulation(found),
        Section(say("Before and after"), _before_after(found)),
        Section(say("What a correction would change"), _consequences(found)),
        costs_section(found),
        Section(say("Where the mismatch lives"), _where(found)),
        Section(say("Candidate explanations"), (_rivals(found),)),
        unseen_section(found),
        Section(say("Noise"), tuple(Paragraph(text) for text in noise)),
        next_section(found),
    )  # fmt: skip
    return tuple(section for section in sections if section.blocks)


def _explained_by(found: Diagnosed) -> tuple[Text, Text]:
    """What the recording is compared with, in short."""
    if found.simulated is None:
        return say("Effects that the job names"), commas(names(found.job.facts.model.effects)) or say("none")
    return say("Compared with the simulation"), commas(names(found.simulated.files))


def _simulation(found: Diagnosed) -> tuple[Section, ...]:
    if found.simulated is None:
        return ()
    d = found.diagnosis
    return (simulation_section(found.simulated, corrections(found.simulated, d.after, d.posterior)),)


def _left_out(found: Diagnosed) -> tuple[Block, ...]:
    d = found.diagnosis
    blocks: list[Block] = [Paragraph(verdict_of(found))]
    blocks += [Paragraph(text) for text in (*sentences_of(found), *withheld_sentences(d.withheld))]
    blocks += [
        Paragraph(say("This recording cannot tell apart: {effects}.", effects=commas(names(group))), tone="warning")
        for group in d.indistinguishable
    ]
    return tuple(blocks)


def _before_after(found: Diagnosed) -> tuple[Block, ...]:
    d = found.diagnosis
    before, after = (
        model.residuals(model.estimate().least_squares.value) / MICROMETRE for model in (d.before, d.after)
    )
    k = factor_of_noise(d.noise.coordinate)
    expanded = k * d.noise.coordinate.value * d.before.artefact.noise_scale
    odd = {m for f in found.findings for m in f.measurements}
    gain = d.improvement
    plot = length_plot(
        d.before.artefact.measurement.astype(np.float64),
        before,
        after,
        expanded_before_um=expanded,
        expanded_after_um=expanded,
        reference=say("no residual"),
        flagged=np.isin(d.before.artefact.measurement, list(odd)),
        before_label=say("Residuals of the job's model")
        if found.simulated is None
        else say("Recorded minus predicted"),
        after_label=say("With what was left out"),
        caption=say(
            "Residual of each observation before and after, with U (k = {k}) from the noise.", k=number(k, ".2f")
        ),
        alternative=say(
            "Residual rms {rms_before_um:.1f} µm before and {rms_after_um:.1f} µm after.",
            rms_before_um=gain.rms_before_um,
            rms_after_um=gain.rms_after_um,
        ),
    )
    changes = _changes(found)
    table = improvement_table(
        gain, say("Residual rms"), say("Rms on held-out {unseen}", unseen=gain.unseen),
        say("{unseen:capital} are left out with all their repeats; ± is one standard error.", unseen=gain.unseen),
    )  # fmt: skip
    return (plot, table, changes) if changes else (plot, table)


def _changes(found: Diagnosed) -> Table | None:
    """Estimates of the effects that the job names, before and after: how biased they were."""
    d = found.diagnosis
    if not d.effects:
        return None
    before, after = (model.estimate().least_squares for model in (d.before, d.after))
    late = {u.key: value for u, value in zip(after.unknowns, after.value, strict=True)}
    rows = tuple(
        (
            say("{owner}, {parameter}", owner=Verbatim(u.key[0]), parameter=Verbatim(u.key[1])),
            number(value, ".4g"),
            number(late[u.key], ".4g"),
            u.unit,
        )
        for u, value, known in zip(before.unknowns, before.value, before.determined, strict=True)
        if known and not u.known
    )
    heads = (
        Column(say("Parameter"), numeric=False),
        Column(say("Before")),
        Column(say("After")),
        Column(say("Unit"), numeric=False),
    )
    return Table(say("What it changes in the estimates (least squares)"), heads, rows) if rows else None


def _consequences(found: Diagnosed) -> tuple[Block, ...]:
    """Figures and decisions of the recording, and of the same recording corrected for what was left out."""
    if found.consequences is None:
        return ()
    blocks: list[Block] = []
    rows = []
    for name, (before, after) in found.consequences.figures.items():
        (one, U_one, _), (two, U_two, _) = expanded(before), expanded(after)
        rows.append(
            (
                TITLES[name],
                say("{one} ± {u_one}", one=one, u_one=U_one),
                say("{two} ± {u_two}", two=two, u_two=U_two),
                UNITS[name],
            )
        )
    heads = (
        Column(say("Figure"), numeric=False),
        Column(say("As recorded")),
        Column(say("Corrected")),
        Column(say("Unit"), numeric=False),
    )
    if rows:
        note = say(
            "± is the expanded uncertainty for 95 %, for repetitions of the recording with the correction as it stands."
        )
        blocks.append(Table(say("Figures of performance"), heads, tuple(rows), (note,)))
    decisions = tuple(
        (
            say("{standard}, {quantity}", standard=Verbatim(before.facts.standard), quantity=before.quantity),
            OUTCOME_WORDS[before.outcome],
            OUTCOME_WORDS[after.outcome],
        )
        for before, after in found.consequences.statements
    )
    if decisions:
        columns = tuple(
            Column(title, numeric=False) for title in (say("Statement"), say("As recorded"), say("Corrected"))
        )
        blocks.append(Table(say("Statements of conformity"), columns, decisions))
    return tuple(blocks)


def _where(found: Diagnosed) -> tuple[Block, ...]:
    rows = tuple(
        (
            place.what,
            Verbatim(place.covariate),
            say("{low:.4g} … {high:.4g}", low=place.region[0], high=place.region[1]),
            number(place.amplitude_um, ".3g"),
            number(place.p_value, ".1g"),
        )
        for place in found.diagnosis.where
    )
    if not rows:
        return ()
    heads = (
        Column(say("Nonparametric term"), numeric=False),
        Column(say("Covariate"), numeric=False),
        Column(say("Region")),
        Column(say("Amplitude"), unit("µm")),
        Column(say("p")),
    )
    first = found.diagnosis.where[0]
    x, y, u = first.curve
    k = factor_of_noise(found.diagnosis.noise.coordinate)
    plot = curve_with_band(
        x, y, k * u, x_label=Verbatim(first.covariate), y_label=say("Error / µm"),
        caption=say("What the residuals show: {what}, with U (k = {k}).", what=first.what, k=number(k, ".2f")),
        alternative=say("A function with a largest value of {amplitude_um:.3g} µm.", amplitude_um=first.amplitude_um),
    )  # fmt: skip
    note = say(
        "p is corrected for having looked everywhere; the region is where the function exceeds half "
        "its largest value, or between which values it jumps. What the job's own model would absorb "
        "is no part of the function."
    )
    return (plot, Table(say("Covariates on which the residuals depend"), heads, rows, (note,)))


def _rivals(found: Diagnosed) -> Table:
    rows = tuple((name, probability(p)) for name, p in found.diagnosis.rivals)
    heads = (Column(say("Explanation"), numeric=False), Column(say("Probability")))
    notes: list[Text] = [say("Nothing missing has the rest.")]
    some, every = found.diagnosis.compared, int(found.diagnosis.before.used.sum())
    if some < every:
        notes.append(say(
            "Explanations were compared on {some} of {every} observations, drawn at random; what is asserted was then "
            "estimated from all. An error much smaller than the noise, which only all together would show, can go unnoticed.",
            some=some, every=every,
        ))  # fmt: skip
    return Table(say("Model comparison: one explanation alone"), heads, rows, tuple(notes))


def diagnosed_outcome(found: Diagnosed) -> Outcome:
    """What there is to write of a diagnosis."""
    short = summary_of(found.job.facts, found.diagnosis.verdict, found.diagnosis.p_value, lines(found), found.findings)
    document = diagnosis_document(found)
    consistent = found.diagnosis.verdict == "consistent"
    return Outcome(found, document, diagnosis_results(found), short, document.warnings, conforming=consistent)
