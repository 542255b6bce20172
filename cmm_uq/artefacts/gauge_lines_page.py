"""What a certificate shows of a step gauge or of gauge blocks: deviations along every line, line by line, and positions."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np
from scipy import special

from cmm_uq.analysis.conformity.plans import ISO_10360_2, position_on, share_of_travel
from cmm_uq.artefacts.gauge_lines import StepGauge
from cmm_uq.base.messages import NOTHING, Text, listed, number, say, semicolons, sentences
from cmm_uq.base.points import Floats
from cmm_uq.base.units import MICROMETRE, PPM, unit
from cmm_uq.certificate.document import Block, Column, Paragraph, Section, Table
from cmm_uq.certificate.plots.residuals import length_plot, residual_volume
from cmm_uq.certificate.result import AtLeast, Page, Result
from cmm_uq.certificate.wording import deviating
from cmm_uq.machine.model.noise import noise_of
from cmm_uq.maths.inference.doubt import Doubt
from cmm_uq.maths.inference.draws import evenly, uncertainty_of_sum
from cmm_uq.maths.uncertainty.quantity import rounded

LEAST_FACES = 8  # faces on a line from which on a periodic error can be told from scatter

# probability of a periodic part so large by chance, over all periods looked at, below which it is reported
SIGNIFICANT = 0.01

_FINENESS = 4  # frequencies looked at for each independent one


@dataclass(frozen=True, eq=False)
class Periodic:
    """A periodic error: period and amplitude, mm, and the probability of one so large by chance."""

    period: float
    amplitude: float
    p_value: float


@dataclass(frozen=True, eq=False)
class GaugeLine:
    """One measurement of a gauge."""

    measurement: int  # its number
    direction: Floats  # (3,) unit vector, in the sense of growing distances
    middle: Floats  # (3,) in the recorded frame, mm
    length: float  # from its first to its farthest face, by the certificate, mm
    faces: int  # different ones
    scale_ppm: float  # slope of deviation over distance
    scale_weights: Floats  # (n,) of all observations, mm, in ``scale_ppm``
    linearity: float  # largest deviation from that slope, of the mean of each face, mm
    # mean difference of faces reached from both sides, outward minus inward, mm; ``None`` when there are none
    gap: float | None
    gap_weights: Floats  # (n,) of all observations in ``gap``
    periodic: Periodic | None  # the periodic part, where there is one


def lines_of(gauge: StepGauge) -> tuple[GaugeLine, ...]:
    found, deviations, directions = [], gauge.deviations(), gauge.directions()
    reversals = gauge.reversals()
    for measurement in np.unique(gauge.measurement).tolist():
        rows = np.flatnonzero(gauge.measurement == measurement)
        faces, index = np.unique(np.round(gauge.reference[rows], 6), return_inverse=True)
        means = np.bincount(index, deviations[rows]) / np.bincount(index)
        about = gauge.reference[rows] - gauge.reference[rows].mean()
        slope = float(about @ deviations[rows] / (about @ about))
        rest = means - means.mean() - slope * (faces - faces.mean())
        slope_weights, gap, gap_weights = np.zeros(len(deviations)), None, np.zeros(len(deviations))
        slope_weights[rows] = about / (about @ about)
        if reversals is not None and np.any(own := reversals.measurement == measurement):
            gap = float(reversals.gap[own].mean())
            gap_weights[rows] = reversals.weights[rows] / own.sum()
        found.append(GaugeLine(
            measurement, directions[rows[0]], gauge.points.xyz[rows].mean(axis=0), float(np.ptp(faces)), len(faces),
            slope / PPM, slope_weights / PPM, float(np.abs(rest).max()), gap, gap_weights,
            periodic_part(faces, means),
        ))  # fmt: skip
    return tuple(found)


def periodic_part(position: Floats, deviation: Floats) -> Periodic | None:
    """The sinusoid that explains most of what a straight line leaves of deviations (n,) at positions (n,), mm.

    Periods from twice the mean distance of the faces to half the line are looked at. The probability of the F test becomes
    that of the largest of all periods by the mean number of upcrossings (Baluev 2008, MNRAS 385, 1279). ``None`` below
    :data:`LEAST_FACES`, or when chance explains it as well.
    """
    n = len(position)
    if n < LEAST_FACES:
        return None
    span = float(np.ptp(position))
    independent = (n - 1) // 2 - 1
    frequencies = np.linspace(2 / span, 0.5 * (n - 1) / span, _FINENESS * independent + 1)
    trend, _ = np.linalg.qr(np.column_stack([np.ones(n), position - position.mean()]))
    rest = deviation - trend @ (trend.T @ deviation)
    angles = 2 * np.pi * np.outer(frequencies, position)
    waves = np.stack([np.cos(angles), np.sin(angles)], axis=2)
    waves = waves - np.einsum("nj,fjk->fnk", trend, np.einsum("nj,fnk->fjk", trend, waves))
    coefficients = np.linalg.pinv(waves) @ rest
    explained = np.sum(np.einsum("fnk,fk->fn", waves, coefficients) ** 2, axis=1)
    best, freedom, total = int(np.argmax(explained)), n - 4, float(rest @ rest)
    left = max(total - float(explained[best]), 0.0)
    if total == 0 or freedom < 1:
        return None
    chance = float(special.fdtrc(2, freedom, explained[best] / 2 / (left / freedom))) if left > 0 else 0.0
    width = float(np.ptp(frequencies)) * np.sqrt(4 * np.pi * np.var(position))
    p_value = float(min(1.0, chance * (1 + width * np.sqrt(-np.log(max(chance, 1e-300))))))
    if p_value >= SIGNIFICANT:
        return None
    return Periodic(float(1 / frequencies[best]), float(np.linalg.norm(coefficients[best])), p_value)


_DRAWS = 2000  # of the sizes of the noise, over which a line's uncertainties are taken


@dataclass(frozen=True, eq=False)
class LineFigures:
    """One line with what the noise and the certificate leave uncertain of it."""

    line: GaugeLine  # as recorded
    position: Text  # in words
    share: float | None  # of the travel along it; ``None`` where no travel is stated
    scale_u_ppm: float  # scale_u_ppm, scale_factor: standard uncertainty of the slope, and k for 95 %
    scale_factor: float
    gap_u_um: float | None  # gap_u_um, gap_factor: of the bidirectional error; ``None`` without one
    gap_factor: float
    at_least: AtLeast  # raises a U that a certificate does not state

    @property
    def expanded_scale_ppm(self) -> tuple[float, float]:
        """U and k of the slope."""
        return self.at_least("lines.slope_ppm", self.scale_factor * self.scale_u_ppm, self.scale_factor, unit("µm/m"))

    @property
    def expanded_gap_um(self) -> tuple[float, float] | None:
        """U and k of the bidirectional error; ``None`` without one."""
        if self.gap_u_um is None:
            return None
        return self.at_least("lines.bidirectional_um", self.gap_factor * self.gap_u_um, self.gap_factor, unit("µm"))

    @property
    def short(self) -> bool:
        """Whether it is shorter than the standard asks for (ISO 10360-2:2009)."""
        return self.share is not None and self.share < ISO_10360_2.least_share

    def as_data(self) -> dict[str, Any]:
        line, periodic = self.line, self.line.periodic
        return {
            "measurement": line.measurement,
            "position": self.position,
            "length_mm": line.length,
            "faces": line.faces,
            "slope_ppm": {
                "value": line.scale_ppm,
                "u": self.scale_u_ppm,
                "U": self.expanded_scale_ppm[0],
                "k": self.expanded_scale_ppm[1],
            },
            "off_slope_um": line.linearity / MICROMETRE,
            "bidirectional_um": None
            if line.gap is None
            else {
                "value": line.gap / MICROMETRE,
                "u": self.gap_u_um,
                "U": None if self.expanded_gap_um is None else self.expanded_gap_um[0],
                "k": self.gap_factor if self.expanded_gap_um is None else self.expanded_gap_um[1],
            },
            "periodic": None
            if periodic is None
            else {
                "amplitude_um": periodic.amplitude / MICROMETRE,
                "period_mm": periodic.period,
                "p_value": periodic.p_value,
            },
            "share_of_travel": self.share,
        }


@dataclass(frozen=True, eq=False)
class GaugeFigures:
    """Every line, and which of the seven positions of ISO 10360-2:2009 were not measured."""

    lines: tuple[LineFigures, ...]
    missing: tuple[Text, ...]


def figures(result: Result) -> GaugeFigures:
    gauge, sizes = cast("StepGauge", result.artefact), result.posterior.sizes
    every = replace(result.model, used=np.ones_like(result.model.used))
    components, sizes = noise_of(every), sizes.at(evenly(len(sizes.placing), _DRAWS))
    size, machine = gauge.sizes[0], gauge.points.machine
    relative = size.sd / size.nominal if size.certified else 0.0
    lines = []
    for line in lines_of(gauge):
        weights = np.stack([line.scale_weights, line.gap_weights / MICROMETRE])
        doubt = Doubt.of(result.causes, weights)
        if not gauge.certificate.plain:
            relative = abs(float(line.scale_weights @ gauge.size_change()[:, 0])) * size.sd * PPM
        beside = float(np.hypot(relative / PPM, np.sqrt(doubt.variance(np.array([1.0, 0.0])))))
        scale_u, scale_expanded = uncertainty_of_sum(components, sizes, line.scale_weights, beside)
        gap_u, gap_expanded = uncertainty_of_sum(
            components, sizes, weights[1], float(np.sqrt(doubt.variance(np.array([0.0, 1.0]))))
        )
        lines.append(LineFigures(
            line, position_on(machine, line.middle, line.direction),
            share_of_travel(machine, line.middle, line.direction, line.length),
            scale_u, scale_expanded / scale_u, None if line.gap is None else gap_u,
            gap_expanded / gap_u if gap_u else 2.0, result.at_least,
        ))  # fmt: skip
    found = {one.position for one in lines}
    return GaugeFigures(tuple(lines), tuple(position for position in ISO_10360_2.positions if position not in found))


def results(result: Result) -> dict[str, Any]:
    found = figures(result)
    return {"lines": [line.as_data() for line in found.lines], "positions_not_measured": list(found.missing)}


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
