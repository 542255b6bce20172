"""What a certificate shows of a step gauge or of gauge blocks: deviations along every line, line by line, and positions."""

from __future__ import annotations

from typing import cast

import numpy as np

from cmm_uq.conformity.measurement_lines import position_on, share_of_travel
from cmm_uq.conformity.plans import ISO_10360_2
from cmm_uq.documents.document import Block, Column, Paragraph, Section, Table
from cmm_uq.documents.outcome import Page
from cmm_uq.documents.plots import length_plot
from cmm_uq.documents.residual_volume import flagged, residual_volume
from cmm_uq.documents.result import Result
from cmm_uq.documents.wording import listed
from cmm_uq.kinds.gauge_lines.lines import GaugeLine, lines_of
from cmm_uq.kinds.gauge_lines.observe import StepGauge
from cmm_uq.points import Floats
from cmm_uq.uncertainty.rounding import rounded
from cmm_uq.units import MICROMETRE


def sections(result: Result) -> list[Section]:
    """Deviations by distance, each line by itself, positions by ISO 10360-2, residuals in the volume."""
    gauge = cast("StepGauge", result.artefact)
    lines = lines_of(gauge)
    blocks: list[Block] = [_plot(result, gauge), _table(result, gauge, lines)]
    blocks += [*_periodic(lines), *_positions(gauge, lines), residual_volume(result, "faces")]
    return [Section("Deviations along the gauge", tuple(blocks))]


def _plot(result: Result, gauge: StepGauge) -> Block:
    deviations, residuals = gauge.deviations() / MICROMETRE, result.residuals / MICROMETRE
    expanded = 2 * result.noise.coordinate.value
    return length_plot(
        _side_by_side(gauge), deviations, residuals, expanded_before_um=expanded, expanded_after_um=expanded,
        reference="certified distance, mean of each line", flagged=flagged(result),
        position_label="Certified distance from the first face / mm (lines side by side)",
        caption="Deviation of each face from its certified distance, as recorded and after the fitted model, with U (k = 2).",
        alternative=(
            f"{len(deviations)} faces on {len(set(gauge.measurement.tolist()))} lines: as recorded they deviate by "
            f"{deviations.min():.1f} to {deviations.max():.1f} µm from the mean of their line; after the fitted model "
            f"{residuals.min():.1f} to {residuals.max():.1f} µm remain."
        ),
    )  # fmt: skip


def _side_by_side(gauge: StepGauge) -> Floats:
    """Certified distances, those of different lines drawn apart by a part of the step between faces."""
    faces, (_, line) = np.unique(gauge.reference), np.unique(gauge.measurement, return_inverse=True)
    rank = (line + 0.5) / (line.max() + 1) - 0.5
    return np.asarray(gauge.reference + 0.7 * float(np.diff(faces).min()) * rank, dtype=np.float64)


def _table(result: Result, gauge: StepGauge, lines: tuple[GaugeLine, ...]) -> Table:
    sigma = result.noise.coordinate.value * MICROMETRE
    relative = gauge.sizes[0].sd / gauge.sizes[0].nominal if gauge.sizes[0].certified else 0.0
    both = any(line.gap is not None for line in lines)
    rows = []
    for line in lines:
        scale, U = rounded(line.scale_ppm, 2 * float(np.hypot(line.scale_noise * sigma, relative * 1e6)))
        linearity = rounded(line.linearity / MICROMETRE, 2 * sigma / MICROMETRE)[0]
        row = [
            str(line.measurement),
            position_on(gauge.points.machine, line.middle, line.direction),
            f"{line.length:.10g}",
            str(line.faces),
            scale,
            U,
            linearity,
        ]
        if both:
            row += _gap(line, sigma)
        rows.append(tuple(row))
    columns = [
        Column("Line", numeric=False), Column("Position", numeric=False), Column("Length", "mm"), Column("Faces"),
        Column("Slope", "µm/m"), Column("U", "µm/m"), Column("Off slope", "µm"),
    ]  # fmt: skip
    notes = [
        "Slope: indicated minus certified distance, over the distance. Off slope: largest deviation of a face from it."
    ]
    if both:
        columns += [Column("Bidirectional", "µm"), Column("U", "µm")]
        notes.append(
            "Bidirectional: faces met travelling away from the first face minus the same faces met on the way back."
        )
    notes.append(
        "U (k = 2) from the standard uncertainty of a coordinate, for the slope also from the gauge's certificate."
    )
    return Table("Each line by itself, at 20 °C", tuple(columns), tuple(rows), tuple(notes))


def _gap(line: GaugeLine, sigma: float) -> tuple[str, str]:
    if line.gap is None:
        return "", ""
    return rounded(line.gap / MICROMETRE, 2 * line.gap_noise * sigma / MICROMETRE)


def _periodic(lines: tuple[GaugeLine, ...]) -> list[Block]:
    found = [
        f"line {line.measurement}: amplitude {line.periodic.amplitude / MICROMETRE:.2g} µm, period "
        f"{line.periodic.period:.3g} mm (p = {line.periodic.p_value:.1g})"
        for line in lines
        if line.periodic is not None
    ]
    text = f"Periodic along the line, beyond what scatter explains: {'; '.join(found)}."
    return [Paragraph(text)] if found else []


def _positions(gauge: StepGauge, lines: tuple[GaugeLine, ...]) -> list[Block]:
    """Which of the seven positions of ISO 10360-2 are there, and long enough."""
    machine = gauge.points.machine
    short = [
        f"line {line.measurement} ({100 * share:.0f} %)"
        for line in lines
        if (share := share_of_travel(machine, line.middle, line.direction, line.length)) is not None
        and share < ISO_10360_2.least_share
    ]
    found = {position_on(machine, line.middle, line.direction) for line in lines}
    missing = [position for position in ISO_10360_2.positions if position not in found]
    texts = []
    if missing:
        texts.append(f"Not measured of the seven positions of ISO 10360-2:2009: {listed(missing)}.")
    if short:
        least = f"{100 * ISO_10360_2.least_share:.0f} %"
        texts.append(f"Shorter than the {least} of the travel that ISO 10360-2:2009 asks for: {listed(short)}.")
    return [Paragraph(" ".join(texts), tone="note")] if texts else []


PAGE = Page(sections)
