"""What a certificate shows of a step gauge or of gauge blocks: deviations along every line, line by line, and positions."""

from __future__ import annotations

from typing import cast

import numpy as np

from cmm_uq.analysis.conformity.plans import ISO_10360_2
from cmm_uq.artefacts.gauge_lines.analysis import GaugeFigures, LineFigures, figures, results
from cmm_uq.artefacts.gauge_lines.observe import StepGauge
from cmm_uq.base.messages import NOTHING, Text, listed, number, say, semicolons, sentences
from cmm_uq.base.points import Floats
from cmm_uq.base.units import MICROMETRE, unit
from cmm_uq.certificate.document import Block, Column, Paragraph, Section, Table
from cmm_uq.certificate.outcome import Page
from cmm_uq.certificate.plots.residuals import length_plot, residual_volume
from cmm_uq.certificate.result import Result
from cmm_uq.certificate.wording import deviating
from cmm_uq.maths.uncertainty.quantity import rounded


def sections(result: Result) -> list[Section]:
    gauge = cast("StepGauge", result.artefact)
    found = figures(result)
    blocks: list[Block] = [_plot(result, gauge), _table(result, found.lines)]
    blocks += [*_periodic(found.lines), *_positions(found), residual_volume(result, say("faces"))]
    return [Section(say("Deviations along the gauge"), tuple(blocks))]


def _plot(result: Result, gauge: StepGauge) -> Block:
    deviations, residuals = gauge.deviations() / MICROMETRE, result.residuals / MICROMETRE
    expanded, factor = result.at_least(
        "lines.faces_um", result.noise.expanded, result.noise.coverage_factor, unit("µm")
    )
    return length_plot(
        _side_by_side(gauge),
        deviations,
        residuals,
        expanded_before_um=expanded,
        expanded_after_um=expanded,
        reference=say("certified distance, mean of each line"),
        flagged=result.flagged,
        position_label=say("Certified distance from the first face / mm (lines side by side)"),
        caption=say(
            "Deviation of each face from its certified distance, as recorded and after the fitted model, "
            "with U (k = {k}).",
            k=number(factor, ".2f"),
        ),
        alternative=deviating(
            say("{faces} faces on {lines} lines: as recorded they deviate", faces=len(deviations),
                lines=len(set(gauge.measurement.tolist()))),
            say("from the mean of their line"), deviations, residuals,
        ),
    )  # fmt: skip


def _side_by_side(gauge: StepGauge) -> Floats:
    """Certified distances, those of different lines drawn apart by a part of the step between faces."""
    faces, (_, line) = np.unique(gauge.reference), np.unique(gauge.measurement, return_inverse=True)
    rank = (line + 0.5) / (line.max() + 1) - 0.5
    return np.asarray(gauge.reference + 0.7 * float(np.diff(faces).min()) * rank, dtype=np.float64)


def _table(result: Result, found: tuple[LineFigures, ...]) -> Table:
    noise = result.noise.expanded
    both = any(one.line.gap is not None for one in found)
    rows: list[tuple[Text, ...]] = []
    for one in found:
        line = one.line
        scale, U = rounded(line.scale_ppm, one.expanded_scale_ppm[0])
        linearity = rounded(line.linearity / MICROMETRE, noise)[0]
        row: list[Text] = [
            number(line.measurement),
            one.position,
            number(line.length, ".10g"),
            number(line.faces),
            scale,
            U,
            linearity,
        ]
        if both:
            row += _gap(one)
        rows.append(tuple(row))
    columns = [Column(say("Line"), numeric=False), Column(say("Position"), numeric=False)]
    columns += [Column(say("Length"), unit("mm")), Column(say("Faces")), Column(say("Slope"), unit("µm/m"))]
    columns += [Column(say("U"), unit("µm/m")), Column(say("Off slope"), unit("µm"))]
    notes = [
        say(
            "Slope: indicated minus certified distance, over the distance. Off slope: largest deviation "
            "of a face from it."
        )
    ]
    if both:
        columns += [Column(say("Bidirectional"), unit("µm")), Column(say("U"), unit("µm"))]
        notes.append(
            say(
                "Bidirectional: faces met travelling away from the first face minus the same faces met on the way back."
            )
        )
    notes.append(
        say(
            "U for a coverage probability of 95 %, from the standard uncertainty of a coordinate and how well it is known, "
            "for the slope also from the gauge's certificate; a line by itself, without what the other lines tell."
        )
    )
    return Table(say("Each line by itself, at 20 °C"), tuple(columns), tuple(rows), tuple(notes))


def _gap(one: LineFigures) -> tuple[Text, Text]:
    if one.line.gap is None or one.expanded_gap_um is None:
        return (NOTHING, NOTHING)
    return rounded(one.line.gap / MICROMETRE, one.expanded_gap_um[0])


def _periodic(lines: tuple[LineFigures, ...]) -> list[Block]:
    found = [
        say(
            "line {measurement}: amplitude {amplitude:.2g} µm, period {period:.3g} mm (p = {p_value:.1g})",
            measurement=line.measurement,
            amplitude=line.periodic.amplitude / MICROMETRE,
            period=line.periodic.period,
            p_value=line.periodic.p_value,
        )
        for line in (one.line for one in lines)
        if line.periodic is not None
    ]
    text = say("Periodic along the line, beyond what scatter explains: {lines}.", lines=semicolons(found))
    return [Paragraph(text)] if found else []


def _positions(found: GaugeFigures) -> list[Block]:
    short = [
        say("line {measurement} ({share:.0f} %)", measurement=one.line.measurement, share=100 * one.share)
        for one in found.lines
        if one.share and one.short
    ]
    texts = []
    if found.missing:
        texts.append(
            say(
                "Not measured of the seven positions of ISO 10360-2:2009: {positions}.", positions=listed(found.missing)
            )
        )
    if short:
        least = say("{least_share:.0f} %", least_share=100 * ISO_10360_2.least_share)
        texts.append(
            say(
                "Shorter than the {least} of the travel that ISO 10360-2:2009 asks for: {short}.",
                least=least,
                short=listed(short),
            )
        )
    return [Paragraph(sentences(texts), tone="note")] if texts else []


PAGE = Page(sections, results)
