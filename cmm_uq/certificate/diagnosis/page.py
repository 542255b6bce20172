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
from cmm_uq.certificate.diagnosis import overview as words
from cmm_uq.certificate.diagnosis.sections import costs_section, next_section, unseen_section
from cmm_uq.certificate.document import (
    Block,
    Column,
    Document,
    Facts,
    Paragraph,
    Section,
    Table,
    columns,
    section,
    table,
    working_page,
)
from cmm_uq.certificate.origin import came_about, program
from cmm_uq.certificate.plots.residuals import length_plot, residual_plot
from cmm_uq.certificate.plots.style import lettered_in
from cmm_uq.certificate.result import JobDiagnosis, Outcome
from cmm_uq.certificate.results.contents import corrections, diagnosis_data, head
from cmm_uq.certificate.sections import findings
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


def diagnosed_outcome(result: JobDiagnosis) -> Outcome:
    d = result.diagnosis
    short = words.summary_of(result.job.facts, d.verdict, words.summary_lines(result), result.findings)
    with lettered_in(result.job.facts.job.language):
        document = diagnosis_document(result)
    consistent = d.verdict == "consistent"
    return Outcome(result, lambda: document, diagnosis_results(result), short, document.warnings, in_order=consistent)


def diagnosis_results(result: JobDiagnosis) -> dict[str, Any]:
    posterior = result.diagnosis.posterior
    sampling = ("sampler", "seed", "ess_min", "rhat_max", "converged")
    return {
        **head(result.job),
        "sampling": {name: getattr(posterior, name) for name in sampling},
        "diagnosis": diagnosis_data(result),
    }


def diagnosis_document(result: JobDiagnosis) -> Document:
    facts, d, simulated = result.job.facts, result.diagnosis, result.simulated
    explained = say("Effects that the job names"), commas(titles(facts.model.effects)) or say("none")
    if simulated is not None:
        explained = say("Compared with the simulation"), commas(names(simulated.files))
    particulars = (
        (say("Machine"), Verbatim(facts.machine.name)), (say("Artefact"), d.before.artefact.title),
        (say("p-value of “nothing is missing”"), number(d.p_value, ".2g")),
        (say("False-alarm rate"), say("{alpha:g} %", alpha=100 * d.alpha)),
    )  # fmt: skip
    sampler, seed = Verbatim(d.posterior.sampler), d.posterior.seed
    return working_page(
        facts, say("Diagnosis"),
        say("{came_about} {date}", came_about=came_about(result.job), date=day(facts.job.date)),
        overview=words.overview_of(result), particulars=(Facts(particulars), Facts((explained,))),
        warnings=(say("{why:capital}.", why=f.why) for f in result.findings), sections=_sections(result),
        produced_by=say("{program}, {sampler}, seed {seed}", program=program(result.job), sampler=sampler, seed=seed),
        attachments=(*names(result.job.inputs), Verbatim("results.json")),
    )  # fmt: skip


def diagnosis_sections(result: JobDiagnosis) -> tuple[Section, ...]:
    """What a diagnosis says, as sections of any document, the overview first."""
    return (section(say("Diagnosis"), words.overview_of(result)), *_sections(result))


def _sections(result: JobDiagnosis) -> tuple[Section, ...]:
    d, simulated = result.diagnosis, result.simulated
    noise = words.noise_words(d, words.stated_um(result))
    compared = () if simulated is None else (findings.simulation_section(simulated, corrections(result, simulated)),)
    sections = (
        Section(say("What was left out"), _left_out(result)), findings.where_section(d),
        Section(say("What remains"), _consistent(result)), next_section(result),
        Section(say("Before and after"), _before_after(result)),
        section(say("What a correction would change"), *_consequences(result)),
        costs_section(result), unseen_section(result), *compared,
        section(say("Noise"), *map(Paragraph, noise)), section(say("Candidate explanations"), _rivals(d)),
    )  # fmt: skip
    return tuple(section for section in sections if section.blocks)


def _left_out(result: JobDiagnosis) -> tuple[Block, ...]:
    d = result.diagnosis
    if d.verdict == "consistent":
        return ()
    alike = (
        Paragraph(words.ambiguous(titles(group, d.after.effects)), tone="warning") for group in d.indistinguishable
    )
    withheld = map(Paragraph, findings.withheld_words(d.withheld))
    return Paragraph(words.verdict_of(result)), *(_effect(result, item) for item in d.effects), *withheld, *alike


def _effect(result: JobDiagnosis, item: OmittedEffect) -> Facts:
    d = result.diagnosis
    size = say("{size:capital}.", size=size_of(effect_of(item.effect, d.after.effects), item.parameters))
    told = (size, findings.other_periods(item), findings.contained(result.simulated, item.effect))
    return Facts((
        (say("Effect"), item.title),
        (say("Size"), sentences(filter(None, told))),
        (say("Look at"), say("{what:capital}.", what=item.points_to)),
        (say("How sure"), say("{sure:capital}.", sure=words.sure(item))),
        (say("Gain"), say("{gain:capital}.", gain=words.held_out(d.improvement))),
    ))  # fmt: skip


def _consistent(result: JobDiagnosis) -> tuple[Block, ...]:
    d = result.diagnosis
    if d.verdict != "consistent":
        return ()
    plot = residual_plot(
        d.before.artefact.measurement.astype(np.float64), _residuals(d.before),
        expanded_um=_expanded(d), reference=say("no residual"), flagged=_odd(result),
        position_label=d.before.artefact.set_up, label=_label_before(result),
        caption=say(
            "Residual of each observation, with U (k = {k}) from the noise.",
            k=number(factor_of_noise(d.noise.coordinate), ".2f"),
        ),
        alternative=say("Residuals of {rms} µm rms.", rms=alike(d.improvement.rms_before_um)[0]),
    )  # fmt: skip
    return Paragraph(words.verdict_of(result)), plot


def _before_after(result: JobDiagnosis) -> tuple[Block, ...]:
    d, gain = result.diagnosis, result.diagnosis.improvement
    if not d.effects:
        return ()
    before, after = alike(gain.rms_before_um, gain.rms_after_um)
    plot = length_plot(
        d.before.artefact.measurement.astype(np.float64), _residuals(d.before), _residuals(d.after),
        expanded_before_um=_expanded(d), expanded_after_um=_expanded(d), reference=say("no residual"), flagged=_odd(result),
        position_label=d.before.artefact.set_up, before_label=_label_before(result),
        after_label=say("With what was left out"),
        caption=say(
            "Residual of each observation before and after, with U (k = {k}) from the noise.",
            k=number(factor_of_noise(d.noise.coordinate), ".2f"),
        ),
        alternative=say("Residual rms {before} µm before and {after} µm after.", before=before, after=after),
    )  # fmt: skip
    improved = findings.improvement_table(
        gain, say("Residual rms"), say("Rms on held-out {unseen}", unseen=gain.unseen),
        say("{unseen:capital} are left out with all their repeats; ± is one standard error.", unseen=gain.unseen),
    )  # fmt: skip
    changes = _changes(d)
    return (plot, improved, changes) if changes else (plot, improved)


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


def _changes(d: Diagnosis) -> Table | None:
    before, after = (model.estimate().least_squares for model in (d.before, d.after))
    late = {u.key: value for u, value in zip(after.unknowns, after.value, strict=True)}
    rows = []
    for u, value, known in zip(before.unknowns, before.value, before.determined, strict=True):
        if known and not u.known:
            digits = 10 if u.key[0] == ARTEFACT else 4
            rows.append((_title_of(u.key, d.before), figure(value, digits), figure(late[u.key], digits), u.unit))
    heads = (say("Parameter"), Column(say("Before")), Column(say("After")), say("Unit"))
    return table(say("What it changes in the estimates (least squares)"), heads, rows)


def _title_of(key: tuple[str, str], model: RecordingModel) -> Text:
    owner, name = key
    if owner == ARTEFACT:
        return next(size.title for size in model.artefact.sizes if size.name == name)
    return parameter_title(owner, name, model.effects)


def _consequences(result: JobDiagnosis) -> tuple[Table | None, ...]:
    changed = result.consequences
    if changed is None:
        return ()
    rows = (
        (TITLES[name], with_uncertainty(before), with_uncertainty(after), UNITS[name])
        for name, (before, after) in changed.figures.items()
    )
    heads = (say("Figure"), Column(say("As recorded")), Column(say("Corrected")), say("Unit"))
    note = say(
        "± is the expanded uncertainty for 95 %, for repetitions of the recording with the correction as it stands."
    )
    known = say(
        "What was found repeats as it is and is no noise here, neither as recorded nor corrected. A certificate is of the "
        "job's own model: what that leaves out counts as noise in its uncertainties of the same figures."
    )
    decisions = (
        (say("{standard}, {quantity}", standard=Verbatim(before.facts.standard), quantity=before.quantity),
         OUTCOME_WORDS[before.outcome], OUTCOME_WORDS[after.outcome])
        for before, after in changed.statements
    )  # fmt: skip
    stated = (say("Statement"), say("As recorded"), say("Corrected"))
    return (
        table(say("Figures of performance"), heads, rows, note, known),
        table(say("Statements of conformity"), stated, decisions),
    )


def _rivals(d: Diagnosis) -> Table:
    notes: list[Text] = [say("Nothing missing has the rest.")]
    some, every = d.compared, int(d.before.used.sum())
    if some < every:
        notes.append(say(
            "Explanations were compared on {some} of {every} observations, drawn at random; what is asserted was then "
            "estimated from all. An error much smaller than the noise, which only all together would show, can go unnoticed.",
            some=some, every=every,
        ))  # fmt: skip
    heads = columns((say("Explanation"), Column(say("Probability"))))
    rows = tuple((effect_title(name), probability(p)) for name, p in d.rivals)
    return Table(say("Model comparison: one explanation alone"), heads, rows, tuple(notes))
