"""What a certificate shows of an axis calibrated by shifting: figures, curve, what stays open, residuals, the artefact."""

from __future__ import annotations

from collections.abc import Iterable

from cmm_uq.artefacts.shift_axis.analysis import ShiftResult
from cmm_uq.artefacts.shift_axis.curve_page import MOST_ROWS, beside_integrations, curve_section, residuals_section
from cmm_uq.artefacts.shifting.facts import shift_facts
from cmm_uq.artefacts.shifting.page import artefact_section, figures_section, method_section, summary_of
from cmm_uq.base.messages import Number, Text, Verbatim, in_a_row, number, plural, say
from cmm_uq.base.units import unit
from cmm_uq.certificate.document import Block, Column, Paragraph, Section, Table
from cmm_uq.certificate.plots.residuals import curve_with_band
from cmm_uq.certificate.sections.results import Left
from cmm_uq.certificate.sections.warnings import not_converged
from cmm_uq.certificate.wording import Summary
from cmm_uq.machine.physics.effects.rigid_body import SCALE
from cmm_uq.maths.uncertainty.quantity import figure, nominal, rounded, significant


def sections(result: ShiftResult) -> list[Section]:
    """Figures, artefact, curve, what is not determined, residuals, method."""
    return [
        _figures(result), _artefact(result), curve_section(result), _open(result), residuals_section(result),
        _method(result),
    ]  # fmt: skip


def warnings(result: ShiftResult) -> tuple[Text, ...]:
    """What the reader must know before using a figure."""
    found = not_converged(result.estimate.chains)
    if not result.estimate.scale_known:
        found.append(
            say(
                "The mean sensitivity of the axis is not determined: no length of the artefact is known and "
                "the shifts are not known exactly. The curve is the linearity error, zero at both ends of "
                "the first series."
            )
        )
    if free := result.undetermined.patterns.shape[1]:
        found.append(
            plural(
                free,
                one=say(
                    "{free} combination of the errors at the positions read cannot be seen by these "
                    "readings; there the curve rests on the assumption that it is smooth.",
                    free=free,
                ),
                many=say(
                    "{free} combinations of the errors at the positions read cannot be seen by these "
                    "readings; there the curve rests on the assumption that it is smooth.",
                    free=free,
                ),
            )
        )
    return tuple(found)


def summary(result: ShiftResult, warnings: Iterable[Text]) -> Summary:
    """For the end of a command."""
    series = result.estimate.series
    measured = say(
        "{name}, axis {axis}, {points} points in {placings} placings",
        name=Verbatim(result.job.facts.machine.name),
        axis=Verbatim(result.axis),
        points=len(series.numbers),
        placings=len(series.shifts),
    )
    return summary_of(result.job, measured, quantities(result), warnings)


def quantities(result: ShiftResult) -> list[Left]:
    """Figures of performance, with their places in results.json."""
    named: list[Left] = [
        (
            f"linearity_{result.axis}", "peak_to_valley_um", say("Linearity error, peak to valley"), result.linearity,
        ),
        ("noise", "coordinate_um", say("Repeatability (one reading)"), result.repeatability),
    ]  # fmt: skip
    if result.scale is not None:
        scale = say("Mean sensitivity error of axis {axis}", axis=Verbatim(result.axis))
        named.insert(1, (SCALE[result.axis].name, "ppm", scale, result.scale))
    return named


def _figures(result: ShiftResult) -> Section:
    meaning = say(
        "Linearity error: of the estimated curve about the straight line through the ends of the first series."
    )
    return figures_section(say("Axis figures"), quantities(result), meaning)


def _open(result: ShiftResult) -> Section:
    free = result.undetermined
    count = free.patterns.shape[1]
    blocks: list[Block] = [
        Paragraph(
            say(
                "Every shift is a multiple of {period} mm, so an error of that period, or of a half, a "
                "third of it, is the same in all placings and shows in no reading: it looks like another "
                "artefact. A placing shifted by another length, such as {other} mm, would show it.",
                period=nominal(free.period),
                other=figure(0.618 * free.period, 3),
            )
        )
    ]
    if count:
        at, worst = result.estimate.series.positions, free.patterns[:, 0]
        blocks += [
            Paragraph(
                plural(
                    count,
                    one=say(
                        "Beyond a constant and a slope, {count} combination of the errors at the positions "
                        "read change no reading. The curve shows the smoothest error that agrees with the readings. "
                        "A placing that joins the positions, or a finer pitch, would determine them.",
                        count=count,
                    ),
                    many=say(
                        "Beyond a constant and a slope, {count} combinations of the errors at the positions "
                        "read change no reading. The curve shows the smoothest error that agrees with the readings. "
                        "A placing that joins the positions, or a finer pitch, would determine them.",
                        count=count,
                    ),
                )
            ),
            curve_with_band(
                at,
                worst,
                0 * at,
                x_label=say("Scale reading {axis} / mm", axis=Verbatim(result.axis)),
                y_label=say("Weight"),
                points=(at, worst),
                caption=say("One such combination: this pattern, of any size, changes no reading."),
                alternative=say(
                    "Weights of the errors at {count} positions that together change no reading.", count=len(at)
                ),
            ),
        ]
    else:
        blocks.append(
            Paragraph(
                say("At the positions read the readings alone determine the error, but for a constant and a slope.")
            )
        )
    return Section(say("What the shifts leave open"), tuple(blocks))


def _artefact(result: ShiftResult) -> Section:
    facts, estimate = shift_facts(result.job), result.estimate
    shifts = in_a_row(nominal(s) for s in facts.shifts_mm)
    rows = (
        (say("Shifts"), say("{shifts} mm, U = {U} µm (k = 2)", shifts=shifts, U=significant(2 * facts.u_shift_um))),
    )
    blocks: list[Block] = []
    if result.distances is not None:
        cells = tuple(
            (number(n), *(rounded(x, U) if U > 0 else (number(x, ".4f"), Number("0"))))
            for n, x, _, U in zip(estimate.series.numbers, *result.distances, strict=True)
        )
        columns = (
            Column(say("Point")),
            Column(say("Distance from the first"), unit("mm")),
            Column(say("U"), unit("mm")),
        )
        note = say("U is for a coverage probability of 95 %, from the posterior distribution.")
        blocks.append(Table(say("The artefact's own dimensions"), columns, cells[:MOST_ROWS], (note,)))
    return artefact_section(result.job, say("Uncalibrated artefact, shifted"), say("points"), rows, *blocks)


def _method(result: ShiftResult) -> Section:
    estimate = result.estimate
    text = say(
        "The error of the axis, the artefact's dimensions and the shifts are fitted to all readings "
        "at once; the error is a smooth function (Gaussian process, Matérn 7/2) whose size, "
        "correlation length and growth towards the ends are sampled, all else is drawn from its "
        "exact conditional distribution."
    )
    return method_section(
        text, len(estimate.series.reading), estimate.chains, estimate.seed, *beside_integrations(result)
    )
