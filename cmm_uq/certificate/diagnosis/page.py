"""A diagnosis as a document, and its results.json."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from cmm_uq.analysis.conformity.accuracy import TITLES, UNITS
from cmm_uq.analysis.diagnosis.diagnosis import Diagnosis, OmittedEffect
from cmm_uq.base.messages import Text, Verbatim, commas, day, names, number, say, sentences
from cmm_uq.base.points import Floats
from cmm_uq.base.units import MICROMETRE
from cmm_uq.certificate.diagnosis.overview import (
    ambiguous,
    held_out,
    noise_words,
    overview_of,
    stated_um,
    summary_lines,
    summary_of,
    sure,
    verdict_of,
)
from cmm_uq.certificate.diagnosis.sections import costs_section, next_section, unseen_section
from cmm_uq.certificate.document import Block, Column, Document, Facts, Paragraph, Section, Table, working_page
from cmm_uq.certificate.origin import came_about, program
from cmm_uq.certificate.outcome import Outcome
from cmm_uq.certificate.plots.residuals import length_plot, residual_plot
from cmm_uq.certificate.plots.style import lettered_in
from cmm_uq.certificate.result import JobDiagnosis
from cmm_uq.certificate.results.contents import diagnosis_data, head
from cmm_uq.certificate.sections.findings import (
    contained,
    corrections,
    improvement_table,
    other_periods,
    sentences as withheld_sentences,
    simulation_section,
    where_section,
)
from cmm_uq.certificate.wording import (
    OUTCOME_WORDS,
    effect_of,
    effect_title,
    parameter_title,
    probability,
    size_of,
    titles,
    with_uncertainty,
)
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.model.measurement import ARTEFACT
from cmm_uq.maths.uncertainty.quantity import alike, figure
from cmm_uq.maths.uncertainty.type_a import factor_of_noise


def diagnosis_results(result: JobDiagnosis) -> dict[str, Any]:
    posterior = result.diagnosis.posterior
    return {
        **head(result.job),
        "sampling": {
            "sampler": posterior.sampler,
            "seed": posterior.seed,
            "ess_min": posterior.ess_min,
            "rhat_max": posterior.rhat_max,
            "converged": posterior.converged,
        },
        "diagnosis": diagnosis_data(result),
    }


def diagnosis_document(result: JobDiagnosis) -> Document:
    facts, d = result.job.facts, result.diagnosis
    return working_page(
        facts,
        say("Diagnosis"),
        say("{came_about} {date}", came_about=came_about(result.job), date=day(facts.job.date)),
        overview=overview_of(result),
        particulars=(
            Facts(
                (
                    (say("Machine"), Verbatim(facts.machine.name)),
                    (say("Artefact"), d.before.artefact.title),
                    (say("p-value of “nothing is missing”"), number(d.p_value, ".2g")),
                    (say("False-alarm rate"), say("{alpha:g} %", alpha=100 * d.alpha)),
                )
            ),
            Facts((_explained_by(result),)),
        ),
        warnings=(say("{why:capital}.", why=f.why) for f in result.findings),
        sections=_sections(result),
        produced_by=say(
            "{program}, {sampler}, seed {seed}",
            program=program(result.job),
            sampler=Verbatim(d.posterior.sampler),
            seed=d.posterior.seed,
        ),
        attachments=(*names(result.job.inputs), Verbatim("results.json")),
    )


def diagnosis_sections(result: JobDiagnosis) -> tuple[Section, ...]:
    """What a diagnosis says, as sections of any document, the overview first."""
    return (Section(say("Diagnosis"), (overview_of(result),)), *_sections(result))


def _sections(result: JobDiagnosis) -> tuple[Section, ...]:
    noise = noise_words(result.diagnosis, stated_um(result))
    sections = (
        Section(say("What was left out"), _left_out(result)),
        where_section(result.diagnosis),
        Section(say("What remains"), _consistent(result)),
        next_section(result),
        Section(say("Before and after"), _before_after(result)),
        Section(say("What a correction would change"), _consequences(result)),
        costs_section(result),
        unseen_section(result),
        *_simulation(result),
        Section(say("Noise"), tuple(Paragraph(text) for text in noise)),
        Section(say("Candidate explanations"), (_rivals(result),)),
    )
    return tuple(section for section in sections if section.blocks)


def _explained_by(result: JobDiagnosis) -> tuple[Text, Text]:
    if result.simulated is None:
        return say("Effects that the job names"), commas(titles(result.job.facts.model.effects)) or say("none")
    return say("Compared with the simulation"), commas(names(result.simulated.files))


def _simulation(result: JobDiagnosis) -> tuple[Section, ...]:
    if result.simulated is None:
        return ()
    d = result.diagnosis
    return (simulation_section(result.simulated, corrections(result.simulated, d.after, d.posterior)),)


def _left_out(result: JobDiagnosis) -> tuple[Block, ...]:
    d = result.diagnosis
    if d.verdict == "consistent":
        return ()
    blocks: list[Block] = [Paragraph(verdict_of(result))]
    blocks += [_effect(result, item) for item in d.effects]
    blocks += [Paragraph(text) for text in withheld_sentences(d.withheld)]
    blocks += [Paragraph(ambiguous(titles(group, d.after.effects)), tone="warning") for group in d.indistinguishable]
    return tuple(blocks)


def _effect(result: JobDiagnosis, item: OmittedEffect) -> Facts:
    d = result.diagnosis
    size = size_of(effect_of(item.effect, d.after.effects), item.parameters)
    told = (say("{size:capital}.", size=size), other_periods(item), contained(result.simulated, item.effect))
    return Facts((
        (say("Effect"), item.title),
        (say("Size"), sentences(filter(None, told))),
        (say("Look at"), say("{what:capital}.", what=item.points_to)),
        (say("How sure"), say("{sure:capital}.", sure=sure(item))),
        (say("Gain"), say("{gain:capital}.", gain=held_out(d.improvement))),
    ))  # fmt: skip


def _consistent(result: JobDiagnosis) -> tuple[Block, ...]:
    d = result.diagnosis
    if d.verdict != "consistent":
        return ()
    left, expanded, odd = _residuals(d.before), _expanded(d), _odd(result)
    plot = residual_plot(
        d.before.artefact.measurement.astype(np.float64), left,
        expanded_um=expanded, reference=say("no residual"), flagged=odd, position_label=d.before.artefact.set_up,
        label=_label_before(result),
        caption=say(
            "Residual of each observation, with U (k = {k}) from the noise.",
            k=number(factor_of_noise(d.noise.coordinate), ".2f"),
        ),
        alternative=say("Residuals of {rms} µm rms.", rms=alike(d.improvement.rms_before_um)[0]),
    )  # fmt: skip
    return Paragraph(verdict_of(result)), plot


def _before_after(result: JobDiagnosis) -> tuple[Block, ...]:
    d = result.diagnosis
    if not d.effects:
        return ()
    expanded, gain = _expanded(d), d.improvement
    left = alike(gain.rms_before_um, gain.rms_after_um)
    plot = length_plot(
        d.before.artefact.measurement.astype(np.float64),
        _residuals(d.before),
        _residuals(d.after),
        expanded_before_um=expanded,
        expanded_after_um=expanded,
        reference=say("no residual"),
        flagged=_odd(result),
        position_label=d.before.artefact.set_up,
        before_label=_label_before(result),
        after_label=say("With what was left out"),
        caption=say(
            "Residual of each observation before and after, with U (k = {k}) from the noise.",
            k=number(factor_of_noise(d.noise.coordinate), ".2f"),
        ),
        alternative=say("Residual rms {before} µm before and {after} µm after.", before=left[0], after=left[1]),
    )
    table = improvement_table(
        gain, say("Residual rms"), say("Rms on held-out {unseen}", unseen=gain.unseen),
        say("{unseen:capital} are left out with all their repeats; ± is one standard error.", unseen=gain.unseen),
    )  # fmt: skip
    changes = _changes(result)
    return (plot, table, changes) if changes else (plot, table)


def _residuals(model: RecordingModel) -> Floats:
    """(m,) µm."""
    return model.residuals(model.estimate().least_squares.value) / MICROMETRE


def _expanded(d: Diagnosis) -> Floats:
    """(m,) expanded uncertainty of each observation, µm."""
    return factor_of_noise(d.noise.coordinate) * d.noise.coordinate.value * d.before.artefact.noise_scale


def _odd(result: JobDiagnosis) -> NDArray[np.bool_]:
    """(m,) whether the screening found the measurement odd."""
    return np.isin(result.diagnosis.before.artefact.measurement, [m for f in result.findings for m in f.measurements])


def _label_before(result: JobDiagnosis) -> Text:
    return say("Residuals of the job's model") if result.simulated is None else say("Recorded minus predicted")


def _changes(result: JobDiagnosis) -> Table | None:
    d = result.diagnosis
    if not d.effects:
        return None
    before, after = (model.estimate().least_squares for model in (d.before, d.after))
    late = {u.key: value for u, value in zip(after.unknowns, after.value, strict=True)}
    rows = tuple(
        (
            _title_of(u.key, d.before),
            figure(value, 10 if u.key[0] == ARTEFACT else 4),
            figure(late[u.key], 10 if u.key[0] == ARTEFACT else 4),
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


def _title_of(key: tuple[str, str], model: RecordingModel) -> Text:
    owner, name = key
    if owner == ARTEFACT:
        return next(size.title for size in model.artefact.sizes if size.name == name)
    return parameter_title(owner, name, model.effects)


def _consequences(result: JobDiagnosis) -> tuple[Block, ...]:
    if result.consequences is None:
        return ()
    blocks: list[Block] = []
    rows = []
    for name, (before, after) in result.consequences.figures.items():
        rows.append((TITLES[name], with_uncertainty(before), with_uncertainty(after), UNITS[name]))
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
        known = say(
            "What was found repeats as it is and is no noise here, neither as recorded nor corrected. A certificate is of the "
            "job's own model: what that leaves out counts as noise in its uncertainties of the same figures."
        )
        blocks.append(Table(say("Figures of performance"), heads, tuple(rows), (note, known)))
    decisions = tuple(
        (
            say("{standard}, {quantity}", standard=Verbatim(before.facts.standard), quantity=before.quantity),
            OUTCOME_WORDS[before.outcome],
            OUTCOME_WORDS[after.outcome],
        )
        for before, after in result.consequences.statements
    )
    if decisions:
        columns = tuple(
            Column(title, numeric=False) for title in (say("Statement"), say("As recorded"), say("Corrected"))
        )
        blocks.append(Table(say("Statements of conformity"), columns, decisions))
    return tuple(blocks)


def _rivals(result: JobDiagnosis) -> Table:
    rows = tuple((effect_title(name), probability(p)) for name, p in result.diagnosis.rivals)
    heads = (Column(say("Explanation"), numeric=False), Column(say("Probability")))
    notes: list[Text] = [say("Nothing missing has the rest.")]
    some, every = result.diagnosis.compared, int(result.diagnosis.before.used.sum())
    if some < every:
        notes.append(say(
            "Explanations were compared on {some} of {every} observations, drawn at random; what is asserted was then "
            "estimated from all. An error much smaller than the noise, which only all together would show, can go unnoticed.",
            some=some, every=every,
        ))  # fmt: skip
    return Table(say("Model comparison: one explanation alone"), heads, rows, tuple(notes))


def diagnosed_outcome(result: JobDiagnosis) -> Outcome:
    short = summary_of(result.job.facts, result.diagnosis.verdict, summary_lines(result), result.findings)
    with lettered_in(result.job.facts.job.language):
        document = diagnosis_document(result)
    consistent = result.diagnosis.verdict == "consistent"
    return Outcome(result, lambda: document, diagnosis_results(result), short, document.warnings, in_order=consistent)
