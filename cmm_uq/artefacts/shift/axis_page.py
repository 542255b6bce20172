"""What a certificate shows of an axis calibrated by shifting: figures, curve with its band, results."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from cmm_uq.artefacts.shift.axis import ShiftResult
from cmm_uq.artefacts.shift.result import (
    Curve,
    artefact_section,
    figures_section,
    method_section,
    shift_facts,
    summary_of,
    table_file,
)
from cmm_uq.base.messages import Number, Text, Verbatim, in_a_row, number, plural, say, signed
from cmm_uq.base.points import Floats
from cmm_uq.base.units import MICROMETRE, unit
from cmm_uq.certificate.document import Block, Column, Paragraph, Section, Table
from cmm_uq.certificate.origin import quantity_data
from cmm_uq.certificate.plots.residuals import curve_with_band, length_plot
from cmm_uq.certificate.results.contents import covariance_data, head
from cmm_uq.certificate.sections.method import not_converged
from cmm_uq.certificate.sections.results import SIGN, Left
from cmm_uq.certificate.wording import Summary
from cmm_uq.jobs.verdicts import NO_VERDICTS
from cmm_uq.machine.physics.effects.rigid_body import SCALE
from cmm_uq.maths.inference.ensembles import Chains
from cmm_uq.maths.uncertainty.quantity import figure, nominal, rounded, significant
from cmm_uq.maths.uncertainty.type_a import factor_of_noise


def shift_results(result: ShiftResult) -> dict[str, Any]:
    job, estimate = result.job, result.estimate
    axis = result.axis
    estimates = {f"linearity_{axis}": {"peak_to_valley_um": quantity_data(result.linearity)}}
    if result.scale is not None:
        estimates[SCALE[axis].name] = {"ppm": quantity_data(result.scale)}
    before, after = result.disagreement_um
    joint, distances = result.beside_integrations, result.distances
    return {
        **head(job, effects=False),
        "estimates": estimates,
        "covariance": covariance_data(result.covariance),
        "observations": len(estimate.series.reading),
        "noise": {
            "stated_coordinate_um": job.facts.recording.u_coordinate_um,
            "coordinate_um": quantity_data(result.repeatability),
        },
        "sampling": sampling_data(estimate.chains, estimate.seed, len(estimate.sigma)),
        "curves": {f"linearity_{axis}": curve_data(estimate.curve, result.stated_along(estimate.curve), MICROMETRE, "um")},
        "integrations": {
            method: {"position_mm": curve.position.tolist(), "error_um": _um(curve.error), "u_um": _um(curve.u)}
            for method, curve in result.integrated.items()
        },
        "beside_integrations": None if joint is None else curve_data(joint, joint.expanded, MICROMETRE, "um"),
        "artefact": {"point": estimate.series.numbers.tolist(),
                     "distance_mm": None if distances is None else distances[0].tolist(),
                     "u_um": None if distances is None else _um(distances[1]),
                     "U_mm": None if distances is None else distances[2].tolist()},
        "shifts": [
            {"nominal_mm": nominal, "mm": quantity_data(shift)}
            for nominal, shift in zip(estimate.series.shifts.tolist(), result.shifts, strict=True)
        ],
        "identifiability": {
            "scale_determined": estimate.scale_known,
            "period_not_seen_mm": result.undetermined.period,
            "patterns_not_seen": [
                {"position_mm": estimate.series.positions.tolist(), "weight": pattern.tolist()}
                for pattern in result.undetermined.patterns.T
            ],
        },
        "improvement": {"rms_before_um": before, "rms_after_um": after},
        "conformity": [],
        "verdicts": NO_VERDICTS.data(),
    }  # fmt: skip


def sampling_data(chains: Chains, seed: int, draws: int) -> dict[str, Any]:
    return {
        "sampler": chains.sampler, "seed": seed, "draws": draws, "ess_min": chains.ess_min, "rhat_max": chains.rhat_max,
        "steps": chains.steps, "autocorrelation_time": chains.autocorrelation_time, "converged": chains.converged,
    }  # fmt: skip


def curve_data(curve: Curve, expanded: Floats, unit: float, suffix: str) -> dict[str, Any]:
    """A curve with its uncertainty, U as it is stated, in a unit with that suffix."""
    low, high = curve.interval95
    return {
        "position_mm": curve.position.tolist(), f"error_{suffix}": (curve.error / unit).tolist(),
        f"u_{suffix}": (curve.u / unit).tolist(),
        f"interval95_{suffix}": [(low / unit).tolist(), (high / unit).tolist()],
        f"U_{suffix}": (expanded / unit).tolist(), f"band_{suffix}": (curve.band / unit).tolist(),
        "simultaneous_factor95": curve.simultaneous_factor,
    }  # fmt: skip


def _um(values: Floats) -> list[float]:
    found: list[float] = (values / MICROMETRE).tolist()
    return found


MOST_ROWS = 60  # of a table


def curve_section(result: ShiftResult) -> Section:
    """The curve with its band, as a picture and as a table."""
    fine, curve = result.fine, result.estimate.curve
    k = curve.simultaneous_factor
    plot = curve_with_band(
        fine.position,
        fine.error / MICROMETRE,
        k * fine.u / MICROMETRE,
        x_label=say("Scale reading {axis} / mm", axis=Verbatim(result.axis)),
        y_label=say("Error e / µm"),
        points=(curve.position, curve.error / MICROMETRE),
        caption=say(
            "Error of axis {axis}, with the band that holds the whole curve with 95 % probability.",
            axis=Verbatim(result.axis),
        ),
        alternative=say(
            "The error runs from {low} to {high} µm; the band is at most {k:.1f} µm to each side.",
            low=signed(fine.error.min() / MICROMETRE, ".1f"),
            high=signed(fine.error.max() / MICROMETRE, ".1f"),
            k=k * fine.u.max() / MICROMETRE,
        ),
    )
    rows = tuple(
        (
            (number(x, ".3f"), *rounded(e / MICROMETRE, max(one, 1e-6) / MICROMETRE), number(band / MICROMETRE, ".2f"))
            if one > 0
            else (number(x, ".3f"), *3 * (Number("0"),))
        )
        for x, e, one, band in _sparse(curve.position, curve.error, result.stated_along(curve), curve.band)
    )
    columns: tuple[Column, ...] = (Column(say("Reading"), unit("mm")), Column(say("Error"), unit("µm")))
    columns += (Column(say("U"), unit("µm")), Column(say("Band"), unit("µm")))
    notes = (
        SIGN,
        say("U: 95 % at that position; band: half width of the band for the whole curve, k = {k:.2f}.", k=k),
        say(
            "{table_file} holds the curve as an error map; beyond the readings it repeats the last "
            "value, uncalibrated.",
            table_file=Verbatim(table_file(result.job)),
        ),
    )
    return Section(say("Error of the axis"), (plot, Table(say("Error by position"), columns, rows, notes)))


def _sparse(*columns: Floats) -> list[tuple[float, ...]]:
    """Rows of the columns, evenly thinned where there are more than a page holds."""
    count = len(columns[0])
    chosen = np.unique(np.linspace(0, count - 1, min(count, MOST_ROWS)).round().astype(int))
    return [tuple(float(column[i]) for column in columns) for i in chosen]


def residuals_section(result: ShiftResult) -> Section:
    series = result.estimate.series
    before, after = (r / MICROMETRE for r in result.estimate.residuals)
    size = result.disagreement_um
    k = factor_of_noise(result.repeatability)
    U = k * result.repeatability.value * series.noise_scale
    plot = length_plot(
        series.numbers[series.point],
        before,
        after,
        expanded_before_um=U,
        expanded_after_um=U,
        reference=say("the artefact's point"),
        position_label=say("Point of the artefact"),
        before_label=say("Without a curve"),
        after_label=say("With the curve"),
        caption=say("What the placings disagree by, without and with the curve, and U (k = {k}).", k=number(k, ".2f")),
        alternative=say(
            "The placings disagree by {before:.2f} µm rms without and {after:.2f} µm with the curve.",
            before=size[0],
            after=size[1],
        ),
    )
    return Section(say("Residuals"), (plot,))


def beside_integrations(result: ShiftResult) -> tuple[Table, ...]:
    if (joint := result.beside_integrations) is None:
        return ()
    curves = list(result.integrated.values())
    rows = tuple(
        (number(x[0], ".3f"), *(number(v / MICROMETRE, ".2f") for v in x[1:]))
        for x in _sparse(joint.position, *(v for c in curves for v in (c.error, c.u)), joint.error, joint.u)
    )
    columns: tuple[Column, ...] = (Column(say("Reading"), unit("mm")), Column(say("Integrated"), unit("µm")))
    columns += (Column(say("u"), unit("µm")), Column(say("Improved"), unit("µm")), Column(say("u"), unit("µm")))
    columns += (Column(say("Joint fit"), unit("µm")), Column(say("u"), unit("µm")))
    notes = (
        say(
            "Integrated: sum of local slopes, improved: with slopes of both neighbours (Shimizu, Kiyono "
            "and Gao, equations 6 and 8 with their signs mended); u by the law of propagation (JCGM "
            "102:2011), from repeatability alone. Without a known length and with shifts not known "
            "exactly the mean slope is that of the readings."
        ),
    )
    return (Table(say("Beside the integrations of the method's source"), columns, rows, notes),)


def sections(result: ShiftResult) -> list[Section]:
    return [
        _figures(result), _artefact(result), curve_section(result), _open(result), residuals_section(result),
        _method(result),
    ]  # fmt: skip


def warnings(result: ShiftResult) -> tuple[Text, ...]:
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
        columns: tuple[Column, ...] = (Column(say("Point")), Column(say("Distance from the first"), unit("mm")))
        columns += (Column(say("U"), unit("mm")),)
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
