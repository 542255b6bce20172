"""What a certificate shows of a step gauge or of gauge blocks: deviations along every line, line by line, and positions."""

from __future__ import annotations

from typing import Any, cast

import numpy as np
import scipy

from cmm_uq.analysis.conformity.plans import ISO_10360_2, position_on, share_of_travel
from cmm_uq.artefacts.gauge_lines import StepGauge
from cmm_uq.base.messages import NOTHING, Text, listed, number, say, semicolons, sentences
from cmm_uq.base.points import Floats
from cmm_uq.base.units import MICROMETRE, PPM, unit
from cmm_uq.base.values import dataclass
from cmm_uq.certificate.document import Block, Column, Paragraph, Section, Table, figure_columns, section, table
from cmm_uq.certificate.plots.residuals import deviations_plot, residual_volume
from cmm_uq.certificate.result import Page, Result
from cmm_uq.machine.model.noise import noise_of
from cmm_uq.maths.inference.draws import evenly, uncertainty_of_sum
from cmm_uq.maths.inference.posterior import Doubt
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
    chance = float(scipy.special.fdtrc(2, freedom, explained[best] / 2 / (left / freedom))) if left > 0 else 0.0
    width = float(np.ptp(frequencies)) * np.sqrt(4 * np.pi * np.var(position))
    p_value = float(min(1.0, chance * (1 + width * np.sqrt(-np.log(max(chance, 1e-300))))))
    if p_value >= SIGNIFICANT:
        return None
    return Periodic(float(1 / frequencies[best]), float(np.linalg.norm(coefficients[best])), p_value)


_DRAWS = 2000  # of the sizes of the noise, over which a line's uncertainties are taken

Stated = tuple[float, float, float]  # standard uncertainty, expanded one and coverage factor, as stated


@dataclass(frozen=True, eq=False)
class LineFigures:
    line: GaugeLine  # as recorded
    position: Text  # in words
    share: float | None  # of the travel along it; ``None`` where no travel is stated
    scale_ppm: Stated  # of the slope
    gap_um: Stated | None  # of the bidirectional error; ``None`` without one

    @property
    def short(self) -> bool:
        """Whether it is shorter than the standard asks for (ISO 10360-2:2009)."""
        return self.share is not None and self.share < ISO_10360_2.least_share

    def as_data(self) -> dict[str, Any]:
        line, periodic = self.line, self.line.periodic
        return {
            "measurement": line.measurement, "position": self.position, "length_mm": line.length, "faces": line.faces,
            "slope_ppm": _stated_data(line.scale_ppm, self.scale_ppm), "off_slope_um": line.linearity / MICROMETRE,
            "bidirectional_um": None
            if line.gap is None or self.gap_um is None else _stated_data(line.gap / MICROMETRE, self.gap_um),
            "periodic": None if periodic is None else {
                "amplitude_um": periodic.amplitude / MICROMETRE, "period_mm": periodic.period, "p_value": periodic.p_value,
            },
            "share_of_travel": self.share,
        }  # fmt: skip


def _stated_data(value: float, stated: Stated) -> dict[str, float]:
    return {"value": value, **dict(zip(("u", "U", "k"), stated, strict=True))}


def figures(result: Result) -> tuple[LineFigures, ...]:
    gauge, sizes = cast("StepGauge", result.artefact), result.posterior.sizes
    every = result.model.using()
    components, sizes = noise_of(every), sizes.at(evenly(len(sizes.placing), _DRAWS))
    size, machine = gauge.sizes[0], gauge.points.machine
    relative = size.sd / size.nominal if size.certified else 0.0

    def stated(name: str, of: str, weights: Floats, beside: float) -> Stated:
        u, expanded = uncertainty_of_sum(components, sizes, weights, beside)
        k = expanded / u if u else 2.0
        return u, *result.at_least(f"lines.{name}", k * u, k, unit(of))

    lines = []
    for line in lines_of(gauge):
        weights = np.stack([line.scale_weights, line.gap_weights / MICROMETRE])
        doubt = Doubt.of(result.causes, weights)
        if not gauge.certificate.plain:
            relative = abs(float(line.scale_weights @ gauge.size_change()[:, 0])) * size.sd * PPM
        of_slope, of_gap = (float(np.sqrt(doubt.variance(one))) for one in np.eye(2))
        slope = stated("slope_ppm", "µm/m", line.scale_weights, float(np.hypot(relative / PPM, of_slope)))
        gap = None if line.gap is None else stated("bidirectional_um", "µm", weights[1], of_gap)
        share = share_of_travel(machine, line.middle, line.direction, line.length)
        lines.append(LineFigures(line, position_on(machine, line.middle, line.direction), share, slope, gap))
    return tuple(lines)


def missing_positions(lines: tuple[LineFigures, ...]) -> tuple[Text, ...]:
    """Which of the seven positions of ISO 10360-2:2009 were not measured."""
    measured = {one.position for one in lines}
    return tuple(position for position in ISO_10360_2.positions if position not in measured)


def results(result: Result) -> dict[str, Any]:
    lines = figures(result)
    return {"lines": [line.as_data() for line in lines], "positions_not_measured": list(missing_positions(lines))}


def sections(result: Result) -> list[Section]:
    lines, volume = figures(result), residual_volume(result, say("faces"))
    blocks = (
        _plot(result, cast("StepGauge", result.artefact)),
        _table(result, lines),
        _periodic(lines),
        _positions(lines),
    )
    return [section(say("Deviations along the gauge"), *blocks, volume)]


def _plot(result: Result, gauge: StepGauge) -> Block:
    deviations, noise, lines = gauge.deviations() / MICROMETRE, result.noise, len(set(gauge.measurement.tolist()))
    expanded, factor = result.at_least("lines.faces_um", noise.expanded, noise.coverage_factor, unit("µm"))
    what = say("{faces} faces on {lines} lines: as recorded they deviate", faces=len(deviations), lines=lines)
    caption = say(
        "Deviation of each face from its certified distance, as recorded and after the fitted model, with U (k = {k}).",
        k=number(factor, ".2f"),
    )
    return deviations_plot(
        result, deviations, what, say("from the mean of their line"), position=_side_by_side(gauge), expanded_um=expanded,
        reference=say("certified distance, mean of each line"), caption=caption,
        position_label=say("Certified distance from the first face / mm (lines side by side)"),
    )  # fmt: skip


def _side_by_side(gauge: StepGauge) -> Floats:
    """Certified distances, those of different lines drawn apart by a part of the step between faces."""
    faces, (_, line) = np.unique(gauge.reference), np.unique(gauge.measurement, return_inverse=True)
    rank = (line + 0.5) / (line.max() + 1) - 0.5
    return np.asarray(gauge.reference + 0.7 * float(np.diff(faces).min()) * rank, dtype=np.float64)


def _table(result: Result, lines: tuple[LineFigures, ...]) -> Table | None:
    both = any(one.gap_um is not None for one in lines)
    rows: list[tuple[Text, ...]] = []
    for one in lines:
        line, gap = one.line, (NOTHING, NOTHING)
        if line.gap is not None and one.gap_um is not None:
            gap = rounded(line.gap / MICROMETRE, one.gap_um[1])
        where = (number(line.measurement), one.position, number(line.length, ".10g"), number(line.faces))
        linearity = rounded(line.linearity / MICROMETRE, result.noise.expanded)[0]
        rows.append((*where, *rounded(line.scale_ppm, one.scale_ppm[1]), linearity, *(gap if both else ())))
    in_um = (say("Off slope"), *((say("Bidirectional"), say("U")) if both else ()))
    slope = say(
        "Slope: indicated minus certified distance, over the distance. Off slope: largest deviation of a face from it."
    )
    bidirectional = say(
        "Bidirectional: faces met travelling away from the first face minus the same faces met on the way back."
    )
    u = say(
        "U for a coverage probability of 95 %, from the standard uncertainty of a coordinate and how well it is known, "
        "for the slope also from the gauge's certificate; a line by itself, without what the other lines tell."
    )
    return table(
        say("Each line by itself, at 20 °C"),
        [say("Line"), say("Position"), Column(say("Length"), unit("mm")), Column(say("Faces")),
         *figure_columns(say("Slope"), say("U"), unit=unit("µm/m")), *figure_columns(*in_um, unit=unit("µm"))],
        rows, slope, *((bidirectional,) if both else ()), u,
    )  # fmt: skip


def _periodic(lines: tuple[LineFigures, ...]) -> Block | None:
    parts = [
        say(
            "line {measurement}: amplitude {amplitude:.2g} µm, period {period:.3g} mm (p = {p_value:.1g})",
            measurement=one.line.measurement, amplitude=periodic.amplitude / MICROMETRE, period=periodic.period,
            p_value=periodic.p_value,
        )
        for one in lines if (periodic := one.line.periodic) is not None
    ]  # fmt: skip
    text = say("Periodic along the line, beyond what scatter explains: {lines}.", lines=semicolons(parts))
    return Paragraph(text) if parts else None


def _positions(lines: tuple[LineFigures, ...]) -> Block | None:
    short = [
        say("line {measurement} ({share:.0f} %)", measurement=one.line.measurement, share=100 * one.share)
        for one in lines
        if one.share and one.short
    ]
    texts: list[Text] = []
    if missing := listed(missing_positions(lines)):
        texts.append(say("Not measured of the seven positions of ISO 10360-2:2009: {positions}.", positions=missing))
    if short:
        least = say("{least_share:.0f} %", least_share=100 * ISO_10360_2.least_share)
        asked = say("Shorter than the {least} of the travel that ISO 10360-2:2009 asks for: {short}.",
                    least=least, short=listed(short))  # fmt: skip
        texts.append(asked)
    return Paragraph(sentences(texts), tone="note") if texts else None


PAGE = Page(sections, results)
