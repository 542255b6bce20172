"""A diagnosis as a document, and its results.json."""

from __future__ import annotations

from typing import Any

import numpy as np

from cmm_uq.conformity.accuracy import TITLES, UNITS
from cmm_uq.documents.diagnosis_words import VERDICTS, lines, noise_words, sentence, summary_rows
from cmm_uq.documents.document import Block, Column, Document, Facts, Paragraph, Section, Table
from cmm_uq.documents.origin import came_about
from cmm_uq.documents.outcome import Outcome
from cmm_uq.documents.plots import curve_with_band, length_plot
from cmm_uq.documents.program import program
from cmm_uq.documents.result import Diagnosed
from cmm_uq.documents.results_file import diagnosis_data, head
from cmm_uq.documents.wording import expanded, probability
from cmm_uq.documents.working_page import working_page
from cmm_uq.units import MICROMETRE


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
        facts, "Diagnosis", f"{came_about(found.job)} {facts.job.date.isoformat()}",
        particulars=(
            Facts((("Verdict", d.verdict), ("p-value of “nothing is missing”", f"{d.p_value:.2g}"),
                   ("False-alarm rate", f"{100 * d.alpha:g} %"))),
            Facts((("Machine", facts.machine.name), ("Artefact", d.before.artefact.title),
                   ("Effects that the job names", ", ".join(facts.model.effects) or "none"))),
        ),
        warnings=(f"{f.why[0].upper()}{f.why[1:]}." for f in found.findings),
        sections=diagnosis_sections(found),
        produced_by=f"{program(found.job)}, {d.posterior.sampler}, seed {d.posterior.seed}",
    )  # fmt: skip


def diagnosis_sections(found: Diagnosed) -> tuple[Section, ...]:
    """What a diagnosis says, as sections of any document."""
    noise = noise_words(found.diagnosis, found.job.facts.recording.u_coordinate_um)
    sections = (
        Section("What was left out", _left_out(found)),
        Section("Before and after", _before_after(found)),
        Section("What a correction would change", _consequences(found)),
        Section("Where the mismatch lives", _where(found)),
        Section("Candidate explanations", (_rivals(found),)),
        Section("Noise", tuple(Paragraph(text) for text in noise)),
        Section("What to measure next", tuple(
            Paragraph(f"{' and '.join(s.separates)}: {s.what}") for s in found.suggestions
        )),
    )  # fmt: skip
    return tuple(section for section in sections if section.blocks)


def _left_out(found: Diagnosed) -> tuple[Block, ...]:
    d = found.diagnosis
    blocks: list[Block] = [Paragraph(VERDICTS[d.verdict])]
    blocks += [Paragraph(sentence(item, d.improvement)) for item in d.effects]
    blocks += [
        Paragraph(f"This recording cannot tell apart: {', '.join(group)}.", tone="warning")
        for group in d.indistinguishable
    ]
    return tuple(blocks)


def _before_after(found: Diagnosed) -> tuple[Block, ...]:
    d = found.diagnosis
    before, after = (
        model.residuals(model.estimate().least_squares.value) / MICROMETRE for model in (d.before, d.after)
    )
    expanded = 2 * d.noise.coordinate.value * d.before.artefact.noise_scale
    odd = {m for f in found.findings for m in f.measurements}
    gain = d.improvement
    plot = length_plot(
        d.before.artefact.measurement.astype(np.float64), before, after, expanded_before_um=expanded,
        expanded_after_um=expanded, reference="no residual", flagged=np.isin(d.before.artefact.measurement, list(odd)),
        before_label="Residuals of the job's model", after_label="With what was left out",
        caption="Residual of each observation before and after, with U (k = 2) from the noise.",
        alternative=f"Residual rms {gain.rms_before_um:.1f} µm before and {gain.rms_after_um:.1f} µm after.",
    )  # fmt: skip
    rows = (
        ("Residual rms", f"{gain.rms_before_um:.2f}", f"{gain.rms_after_um:.2f}", "µm"),
        (
            f"Rms on held-out {gain.unseen}",
            f"{gain.heldout_rms_before_um:.2f}",
            f"{gain.heldout_rms_after_um:.2f}",
            "µm",
        ),
        ("Gain in log predictive density", "", f"{gain.elpd_gain:.1f} ± {gain.elpd_gain_se:.1f}", ""),
    )
    heads = (Column("Quantity", numeric=False), Column("Before"), Column("After"), Column("Unit", numeric=False))
    changes = _changes(found)
    table = Table(
        "Improvement",
        heads,
        rows,
        (f"{gain.unseen.capitalize()} are left out with all their repeats; ± is one standard error.",),
    )
    return (plot, table, changes) if changes else (plot, table)


def _changes(found: Diagnosed) -> Table | None:
    """Estimates of the effects that the job names, before and after: how biased they were."""
    d = found.diagnosis
    if not d.effects:
        return None
    before, after = (model.estimate().least_squares for model in (d.before, d.after))
    late = {u.key: value for u, value in zip(after.unknowns, after.value, strict=True)}
    rows = tuple(
        (f"{u.key[0]}, {u.key[1]}", f"{value:.4g}", f"{late[u.key]:.4g}", u.unit)
        for u, value, known in zip(before.unknowns, before.value, before.determined, strict=True)
        if known and not u.known
    )
    heads = (Column("Parameter", numeric=False), Column("Before"), Column("After"), Column("Unit", numeric=False))
    return Table("What it changes in the estimates (least squares)", heads, rows) if rows else None


def _consequences(found: Diagnosed) -> tuple[Block, ...]:
    """Figures and decisions of the recording, and of the same recording corrected for what was left out."""
    if found.consequences is None:
        return ()
    blocks: list[Block] = []
    rows = []
    for name, (before, after) in found.consequences.figures.items():
        (one, U_one, _), (two, U_two, _) = expanded(before), expanded(after)
        rows.append((TITLES[name], f"{one} ± {U_one}", f"{two} ± {U_two}", UNITS[name]))
    heads = (Column("Figure", numeric=False), Column("As recorded"), Column("Corrected"), Column("Unit", numeric=False))
    if rows:
        note = (
            "± is the expanded uncertainty for 95 %, for repetitions of the recording with the correction as it stands."
        )
        blocks.append(Table("Figures of performance", heads, tuple(rows), (note,)))
    decisions = tuple(
        (f"{before.facts.standard}, {before.quantity}", before.outcome, after.outcome)
        for before, after in found.consequences.statements
    )
    if decisions:
        columns = tuple(Column(title, numeric=False) for title in ("Statement", "As recorded", "Corrected"))
        blocks.append(Table("Statements of conformity", columns, decisions))
    return tuple(blocks)


def _where(found: Diagnosed) -> tuple[Block, ...]:
    rows = tuple(
        (place.what, place.covariate, f"{place.region[0]:.4g} … {place.region[1]:.4g}", f"{place.amplitude_um:.3g}",
         f"{place.p_value:.1g}")
        for place in found.diagnosis.where
    )  # fmt: skip
    if not rows:
        return ()
    heads = (Column("Nonparametric term", numeric=False), Column("Covariate", numeric=False), Column("Region"),
             Column("Amplitude", "µm"), Column("p"))  # fmt: skip
    first = found.diagnosis.where[0]
    x, y, u = first.curve
    plot = curve_with_band(
        x, y, 2 * u, x_label=first.covariate, y_label="Error / µm",
        caption=f"What the residuals show: {first.what}, with U (k = 2).",
        alternative=f"A function with a largest value of {first.amplitude_um:.3g} µm.",
    )  # fmt: skip
    note = (
        "p is corrected for having looked everywhere; the region is where the function exceeds half its largest value, or "
        "between which values it jumps. What the job's own model would absorb is no part of the function."
    )
    return (plot, Table("Covariates on which the residuals depend", heads, rows, (note,)))


def _rivals(found: Diagnosed) -> Table:
    rows = tuple((name, probability(p)) for name, p in found.diagnosis.rivals)
    heads = (Column("Explanation", numeric=False), Column("Probability"))
    return Table("Model comparison: one explanation alone", heads, rows, ("Nothing missing has the rest.",))


def diagnosed_outcome(found: Diagnosed) -> Outcome:
    """What there is to write of a diagnosis."""
    rows = summary_rows(found.diagnosis.verdict, found.diagnosis.p_value, lines(found), found.findings)
    document = diagnosis_document(found)
    consistent = found.diagnosis.verdict == "consistent"
    return Outcome(found, document, diagnosis_results(found), rows, document.warnings, conforming=consistent)
