"""A diagnosis as a document, and its results.json."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from cmm_uq.analysis.conformity.accuracy import TITLES, UNITS
from cmm_uq.analysis.diagnosis.asserted import OmittedEffect
from cmm_uq.analysis.diagnosis.diagnosis import Diagnosis
from cmm_uq.analysis.diagnosis.held_out import Improvement
from cmm_uq.analysis.diagnosis.simulated import SimulatedTwin
from cmm_uq.analysis.planning.set_up import odds_words
from cmm_uq.base import messages
from cmm_uq.base.messages import NOTHING, Text, Verbatim, commas, names, number, say, together
from cmm_uq.base.units import MICROMETRE, unit
from cmm_uq.certificate import document as doc, wording
from cmm_uq.certificate.diagnosis import overview as words
from cmm_uq.certificate.diagnosis.empirical import contained, empirical_section, mistakes_section
from cmm_uq.certificate.diagnosis.sections import costs_section, next_section, unseen_section, where_section
from cmm_uq.certificate.document import Column, Paragraph, Section, Table, columns, section, table
from cmm_uq.certificate.origin import attributes, came_about, program
from cmm_uq.certificate.plots.residuals import length_plot
from cmm_uq.certificate.plots.style import lettered_in
from cmm_uq.certificate.result import JobDiagnosis, Outcome
from cmm_uq.certificate.results.contents import corrections, diagnosis_data, head
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.model.measurement import ARTEFACT
from cmm_uq.maths.uncertainty.quantity import Quantity, alike, figure
from cmm_uq.maths.uncertainty.type_a import factor_of_noise


def diagnosed_outcome(result: JobDiagnosis) -> Outcome:
    d = result.diagnosis
    short = words.summary_of(result.job.facts, d.verdict, words.summary_lines(result), result.findings)
    with lettered_in(result.job.facts.job.language):
        document = diagnosis_document(result)
    sampling = attributes(d.posterior, "sampler", "seed", "ess_min", "rhat_max", "converged")
    data = {**head(result.job), "sampling": sampling, "diagnosis": diagnosis_data(result)}
    return Outcome(result, lambda: document, data, short, document.warnings, in_order=d.agrees)


def diagnosis_document(result: JobDiagnosis) -> doc.Document:
    facts, d, simulated = result.job.facts, result.diagnosis, result.simulated
    explained = say("Effects that the job names"), commas(wording.titles(facts.model.effects)) or say("none")
    if simulated is not None:
        explained = say("Compared with the simulation"), commas(names(simulated.files))
    particulars = (
        (say("Machine"), Verbatim(facts.machine.name)),
        (say("Artefact"), d.before.artefact.title),
        (say("p-value of “nothing is missing”"), number(d.p_value, ".2g")),
        (say("False-alarm rate"), say("{alpha:g} %", alpha=100 * d.alpha)),
    )
    sampler, seed = Verbatim(d.posterior.sampler), d.posterior.seed
    return doc.working_page(
        facts, say("Diagnosis"),
        say("{came_about} {date}", came_about=came_about(result.job), date=messages.day(facts.job.date)),
        overview=words.overview_of(result),
        particulars=(doc.Facts(particulars), doc.Facts((explained, *wording.stated_physics()))),
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
    compared: tuple[Section, ...] = ()
    if simulated is not None:
        compared = (simulation_section(simulated, corrections(result, simulated)), mistakes_section(result.mistakes))
    return tuple(section for section in (
        Section(say("What was left out"), _left_out(result)), where_section(d),
        empirical_section(d, _improved),
        Section(say("What remains"), _consistent(result)), next_section(result),
        section(say("Before and after"), *_before_after(result)),
        section(say("What a correction would change"), *_consequences(result)),
        costs_section(result), unseen_section(result), *compared,
        section(say("Noise"), *map(doc.Paragraph, noise)), section(say("Candidate explanations"), _rivals(d)),
    ) if section.blocks)  # fmt: skip


def _left_out(result: JobDiagnosis) -> tuple[doc.Block, ...]:
    d = result.diagnosis
    if d.agrees:
        return ()
    groups = (wording.titles(group, d.after.effects) for group in d.indistinguishable)
    alike = (doc.Paragraph(words.ambiguous(group), tone="warning") for group in groups)
    withheld = map(doc.Paragraph, words.withheld_words(d.withheld))
    effects, others = (_effect(result, item) for item in d.effects), _alternatives(d)
    return doc.Paragraph(words.verdict_of(result)), *effects, *((others,) if others else ()), *withheld, *alike


def _alternatives(d: Diagnosis) -> doc.Table | None:
    """Everything that could stand in the place of what was found, the most probable first, and where to look for it."""
    rows: dict[tuple[Text, Text], tuple[Text, ...]] = {}
    for item in d.effects:
        sets = sorted(item.alternatives, key=lambda one: one.odds * one.prior_odds)
        single = (((item.effect,), (name,), NOTHING, NOTHING) for name in words.besides(d, item))
        told = ((one.instead_of, one.effects, odds_words(one.odds), odds_words(one.prior_odds)) for one in sets)
        for of, instead, *odds in (*single, *told):
            found, other = (together(wording.titles(each, d.after.effects)) for each in (of, instead))
            acting = (wording.effect_of(name, d.after.effects) for name in instead)
            look = messages.semicolons(dict.fromkeys(effect.points_to for effect in acting if effect is not None))
            rows.setdefault((found, other), (found, other, *odds, look))
    if len(rows) <= words.INLINE:
        return None
    ratio, prior = Column(say("Likelihood ratio")), Column(say("Odds beforehand"))
    note = say(
        "Both of what was found over the other. The likelihood ratio is by the readings alone, with all as large beforehand "
        "in what they show; the odds beforehand are by how often such causes act. Where there are none, the two were compared "
        "with what is known beforehand only."
    )
    heads = (say("Found"), say("It could as well be"), ratio, prior, say("Look at"))
    return table(say("What could stand in its place"), heads, rows.values(), note)


def _effect(result: JobDiagnosis, item: OmittedEffect) -> doc.Facts:
    d = result.diagnosis
    effect = wording.effect_of(item.effect, d.after.effects)
    size = say("{size:capital}.", size=wording.size_of(effect, item.parameters))
    told = (size, words.other_periods(item), contained(result.simulated, item.effect))
    return doc.Facts((
        (say("Effect"), item.title),
        (say("Size"), messages.sentences(filter(None, told))),
        (say("Look at"), say("{what:capital}.", what=item.points_to)),
        (say("How sure"), say("{sure:capital}.", sure=words.sure(item))),
        (say("Gain"), say("{gain:capital}.", gain=words.held_out(d.improvement))),
    ))  # fmt: skip


def _consistent(result: JobDiagnosis) -> tuple[doc.Block, ...]:
    d = result.diagnosis
    if not d.agrees:
        return ()
    plot = _residuals(
        result, d.before, caption=say("Residual of each observation, with U (k = {k}) from the noise.", k=_factor(d)),
        alternative=say("Residuals of {rms} µm rms.", rms=alike(d.improvement.rms_before_um)[0]),
    )  # fmt: skip
    return doc.Paragraph(words.verdict_of(result)), plot


def _before_after(result: JobDiagnosis) -> tuple[doc.Block | None, ...]:
    d, gain = result.diagnosis, result.diagnosis.improvement
    if not d.effects:
        return ()
    before, after = alike(gain.rms_before_um, gain.rms_after_um)
    plot = _residuals(
        result, d.before, d.after,
        caption=say("Residual of each observation before and after, with U (k = {k}) from the noise.", k=_factor(d)),
        alternative=say("Residual rms {before} µm before and {after} µm after.", before=before, after=after),
    )  # fmt: skip
    return plot, _improved(gain), _changes(d)


def _improved(gain: Improvement) -> doc.Table:
    return improvement_table(
        gain, say("Residual rms"), say("Rms on held-out {unseen}", unseen=gain.unseen),
        say("{unseen:capital} are left out with all their repeats; ± is one standard error.", unseen=gain.unseen),
    )  # fmt: skip


def _factor(d: Diagnosis) -> Text:
    return number(factor_of_noise(d.noise.coordinate), ".2f")


def _residuals(result: JobDiagnosis, *models: RecordingModel, caption: Text, alternative: Text) -> doc.Plot:
    """Residuals (m,) of each model with U from the noise; rings where the screening found the measurement odd."""
    artefact, noise = result.diagnosis.before.artefact, result.diagnosis.noise.coordinate
    expanded = factor_of_noise(noise) * noise.value * artefact.noise_scale
    return length_plot(
        artefact.measurement.astype(np.float64),
        *(model.residuals(model.estimate().least_squares.value) / MICROMETRE for model in models),
        expanded_before_um=expanded, reference=say("no residual"),
        flagged=np.isin(artefact.measurement, [m for f in result.findings for m in f.measurements]),
        position_label=artefact.set_up, after_label=say("With what was left out"),
        before_label=say("Recorded minus predicted") if result.simulated else say("Residuals of the job's model"),
        caption=caption, alternative=alternative,
    )  # fmt: skip


def _changes(d: Diagnosis) -> doc.Table | None:
    before, after = (model.estimate().least_squares for model in (d.before, d.after))
    late = {u.key: value for u, value in zip(after.unknowns, after.value, strict=True)}
    rows = []
    for u, value, known in zip(before.unknowns, before.value, before.determined, strict=True):
        if known and not u.known:
            digits = 10 if u.key[0] == ARTEFACT else 4
            owner, name = u.key
            sizes = (size.title for size in d.before.artefact.sizes if owner == ARTEFACT and size.name == name)
            title = next(sizes, None) or wording.parameter_title(owner, name, d.before.effects)
            rows.append((title, figure(value, digits), figure(late[u.key], digits), u.unit))
    heads = (say("Parameter"), doc.Column(say("Before")), doc.Column(say("After")), say("Unit"))
    return table(say("What it changes in the estimates (least squares)"), heads, rows)


def _consequences(result: JobDiagnosis) -> tuple[doc.Table | None, ...]:
    changed = result.consequences
    if changed is None:
        return ()
    rows = (
        (TITLES[name], wording.with_uncertainty(before), wording.with_uncertainty(after), UNITS[name])
        for name, (before, after) in changed.figures.items()
    )
    heads = (say("Figure"), doc.Column(say("As recorded")), doc.Column(say("Corrected")), say("Unit"))
    note = say(
        "± is the expanded uncertainty for 95 %, for repetitions of the recording with the correction as it stands."
    )
    known = say(
        "What was found repeats as it is and is no noise here, neither as recorded nor corrected. A certificate is of the "
        "job's own model: what that leaves out counts as noise in its uncertainties of the same figures."
    )
    decisions = (
        (say("{standard}, {quantity}", standard=Verbatim(before.facts.standard), quantity=before.quantity),
         wording.OUTCOME_WORDS[before.outcome], wording.OUTCOME_WORDS[after.outcome])
        for before, after in changed.statements
    )  # fmt: skip
    stated = (say("Statement"), say("As recorded"), say("Corrected"))
    return (
        table(say("Figures of performance"), heads, rows, note, known),
        table(say("Statements of conformity"), stated, decisions),
    )


def _rivals(d: Diagnosis) -> doc.Table:
    some, every = d.compared, int(d.before.used.sum())
    drawn = say(
        "Explanations were compared on {some} of {every} observations, drawn at random; what is asserted was then "
        "estimated from all. An error much smaller than the noise, which only all together would show, can go unnoticed.",
        some=some,
        every=every,
    )
    heads = doc.columns((say("Explanation"), doc.Column(say("Probability"))))
    rows = tuple((wording.effect_title(name), wording.probability(p)) for name, p in d.rivals)
    notes = messages.holding((True, say("The rest is the probability that nothing is missing.")), (some < every, drawn))
    return doc.Table(say("Model comparison: one explanation alone"), heads, rows, tuple(notes))


def simulation_section(simulated: SimulatedTwin, refitted: Mapping[str, Mapping[str, Quantity]]) -> Section:
    """Which simulation it was, and what of it was estimated anew."""
    u, common = say("{u:.3g} µm", u=simulated.u_um), simulated.u_common_um
    if common:
        u = say("{own}, and {common:.3g} µm of the artefact's size in common", own=u, common=common)
    elif not simulated.u_um:
        u = say("not stated: taken as exact")
    file = say("Error map") if simulated.maps else say("Prediction")
    facts = doc.facts(
        *((file, Verbatim(name)) for name in simulated.files),
        *((say("SHA-256"), Verbatim(value)) for value in simulated.files.values()),
        (say("Program"), Verbatim(simulated.program)),
        (say("Effects that it contains"), commas(wording.titles(simulated.contains)) or say("not stated")),
        (say("Estimated anew"), commas(wording.titles(simulated.refitted)) or say("none")),
        (say("Standard uncertainty of a predicted coordinate"), u),
        (say("Predicted errors, rms in the observations"), say("{rms} µm", rms=alike(simulated.rms_predicted_um)[0])),
    )
    told = say(
        "Observed minus predicted is what is explained here; where the artefact was taken to stand is no part of it. Sizes of "
        "effects are what the machine has beyond what the simulation contains. The noise is that of both together."
    )
    differing = (
        (wording.parameter_title(owner, name), wording.with_uncertainty(one), one.unit, wording.expanded(one)[2])
        for owner, quantities in refitted.items()
        for name, one in quantities.items()
    )
    heads = (say("Parameter"), Column(say("Machine minus simulation")), say("Unit"), Column(say("k")))
    anew = table(say("What the simulation contains, estimated anew"), heads, differing)
    return section(say("Simulation"), facts, Paragraph(told), anew)


def improvement_table(gain: Improvement, rms: Text, heldout: Text, note: Text) -> Table:
    """Rms in µm, and the gain in log predictive density; ``note``: what was held out, and what ± is."""
    density = say("{elpd_gain:.1f} ± {elpd_gain_se:.1f}", elpd_gain=gain.elpd_gain, elpd_gain_se=gain.elpd_gain_se)
    rows = (
        (rms, *alike(gain.rms_before_um, gain.rms_after_um, decimals=2), unit("µm")),
        (heldout, *alike(gain.heldout_rms_before_um, gain.heldout_rms_after_um, decimals=2), unit("µm")),
        (say("Gain in log predictive density"), NOTHING, density, NOTHING),
    )
    heads = (say("Quantity"), Column(say("Before")), Column(say("After")), say("Unit"))
    return Table(say("Improvement"), columns(heads), rows, (note,))
