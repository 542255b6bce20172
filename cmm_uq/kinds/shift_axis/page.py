"""What a certificate shows of an axis calibrated by shifting: curve and band, what stays open, residuals, the table."""

from __future__ import annotations

import numpy as np

from cmm_uq.documents.document import Block, Column, Facts, Paragraph, Section, Table
from cmm_uq.documents.origin import file_name
from cmm_uq.documents.plots import curve_with_band, length_plot
from cmm_uq.documents.wording import expanded
from cmm_uq.jobs.artefact import Traceability
from cmm_uq.jobs.job import Job
from cmm_uq.kinds.shift_axis.analysis import ShiftResult
from cmm_uq.kinds.shifting.facts import shift_facts
from cmm_uq.messages import NOTHING, Number, Text, Verbatim, commas, day, number, plural, say
from cmm_uq.points import Floats
from cmm_uq.uncertainty.degrees_of_freedom import factor_of_noise
from cmm_uq.uncertainty.quantity import Quantity
from cmm_uq.uncertainty.rounding import rounded
from cmm_uq.units import MICROMETRE, unit

SIGN = say("Sign rule: true coordinate = indicated coordinate + error.")
_MOST_ROWS = 60


def sections(result: ShiftResult) -> list[Section]:
    """Figures, curve, what is not determined, residuals, artefact, method."""
    return [_figures(result), _curve(result), _open(result), _residuals(result), _artefact(result), _method(result)]


def warnings(result: ShiftResult) -> tuple[Text, ...]:
    """What the reader must know before using a figure."""
    found, chains = [], result.estimate.chains
    if not chains.converged:
        found.append(
            say(
                "The sampling did not converge (least effective sample size {ess_min:.0f}, R-hat "
                "{rhat_max:.3f}): estimates and uncertainties must not be used.",
                ess_min=chains.ess_min,
                rhat_max=chains.rhat_max,
            )
        )
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


def summary(result: ShiftResult) -> list[tuple[Text, Text, Text]]:
    """Rows of what, figure and remark, for the end of a command."""
    facts, series = result.job.facts, result.estimate.series
    rows: list[tuple[Text, Text, Text]] = [
        (
            say("Measured"),
            say(
                "{name}, axis {axis}, {points} points in {placings} placings",
                name=Verbatim(facts.machine.name),
                axis=Verbatim(result.axis),
                points=len(series.numbers),
                placings=len(series.shifts),
            ),
            day(facts.job.date),
        )
    ]
    for name, value, U, k, own in _quantities(result):
        rows.append((name, say("{value} ± {u} {unit}", value=value, u=U, unit=own), say("k = {k}", k=k)))
    return rows + [(say("Warning"), text, NOTHING) for text in warnings(result)]


def table_file(job: Job) -> str:
    """Name of the correction table, an error map, beside the certificate."""
    return file_name("correction_table.csv", job.origin)


def _quantities(result: ShiftResult) -> list[tuple[Text, Text, Text, Text, Text]]:
    named: list[tuple[Text, Quantity]] = [
        (say("Linearity error, peak to valley"), result.linearity),
        (say("Repeatability (one reading)"), result.repeatability),
    ]
    if result.scale is not None:
        scale = say("Mean sensitivity error of axis {axis}", axis=Verbatim(result.axis))
        named.insert(1, (scale, result.scale))
    return [(name, *expanded(quantity), quantity.unit) for name, quantity in named]


def _figures(result: ShiftResult) -> Section:
    columns = (
        Column(say("Quantity"), numeric=False),
        Column(say("Value")),
        Column(say("U")),
        Column(say("k")),
        Column(say("Unit"), numeric=False),
    )
    notes = (
        SIGN,
        say("Linearity error: of the estimated curve about the straight line through the ends of the first series."),
        say("U is the expanded uncertainty for a coverage probability of 95 %, from the posterior distribution."),
    )
    return Section(
        say("Figures of performance"), (Table(say("Axis figures"), columns, tuple(_quantities(result)), notes),)
    )


def _curve(result: ShiftResult) -> Section:
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
            "The error runs from {low:.1f} to {high:.1f} µm; the band is at most {k:.1f} µm to each side.",
            low=fine.error.min() / MICROMETRE,
            high=fine.error.max() / MICROMETRE,
            k=k * fine.u.max() / MICROMETRE,
        ),
    )
    rows = tuple(
        (
            (number(x, ".3f"), *rounded(e / MICROMETRE, max(one, 1e-6) / MICROMETRE), number(band / MICROMETRE, ".2f"))
            if one > 0
            else (number(x, ".3f"), *3 * (Number("0"),))
        )
        for x, e, one, band in _sparse(curve.position, curve.error, curve.expanded, curve.band)
    )
    columns = (
        Column(say("Reading"), unit("mm")),
        Column(say("Error"), unit("µm")),
        Column(say("U"), unit("µm")),
        Column(say("Band"), unit("µm")),
    )
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
    chosen = np.unique(np.linspace(0, count - 1, min(count, _MOST_ROWS)).round().astype(int))
    return [tuple(float(column[i]) for column in columns) for i in chosen]


def _open(result: ShiftResult) -> Section:
    free = result.undetermined
    count = free.patterns.shape[1]
    blocks: list[Block] = [
        Paragraph(
            say(
                "Every shift is a multiple of {period:.4g} mm, so an error of that period, or of a half, a "
                "third of it, is the same in all placings and shows in no reading: it looks like another "
                "artefact. A placing shifted by another length, such as {other:.3g} mm, would show it.",
                period=free.period,
                other=0.618 * free.period,
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


def _residuals(result: ShiftResult) -> Section:
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


def certificate_rows(certificate: Traceability | None) -> list[tuple[Text, Text]]:
    """Number and laboratory of the artefact's certificate, if it has one."""
    if certificate is None:
        return []
    return [(say("Its certificate"), Verbatim(f"{certificate.number} {certificate.laboratory}".strip()))]


def _artefact(result: ShiftResult) -> Section:
    facts, estimate = shift_facts(result.job), result.estimate
    known = facts.known
    rows: list[tuple[Text, Text]] = [
        (say("Artefact"), Verbatim(facts.name) if facts.name else say("Uncalibrated artefact, shifted")),
        (say("Serial number"), Verbatim(facts.serial)),
    ]
    if known is not None:
        told = say(
            "points {first} to {last}: {length:.10g} mm, u = {u:g} µm",
            first=known.from_point, last=known.to_point, length=known.length_mm, u=known.u_um,
        )  # fmt: skip
        rows.append((say("Known length"), told))
    rows += certificate_rows(facts.certificate)
    shifts = commas(number(s, "g") for s in facts.shifts_mm)
    rows.append((say("Shifts"), say("{shifts} mm, u = {u:g} µm", shifts=shifts, u=facts.u_shift_um)))
    blocks: list[Block] = [Facts(tuple((label, value) for label, value in rows if value))]
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
        blocks.append(Table(say("The artefact's own dimensions"), columns, cells[:_MOST_ROWS], (note,)))
    return Section(say("Artefact and traceability"), tuple(blocks))


def _method(result: ShiftResult) -> Section:
    estimate, chains = result.estimate, result.estimate.chains
    text = Paragraph(
        say(
            "The error of the axis, the artefact's dimensions and the shifts are fitted to all readings "
            "at once; the error is a smooth function (Gaussian process, Matérn 7/2) whose size, "
            "correlation length and growth towards the ends are sampled, all else is drawn from its "
            "exact conditional distribution."
        )
    )
    rows = [
        (say("Readings (means)"), number(len(estimate.series.reading))),
        (say("Sampler"), say("{sampler}, seed {seed}", sampler=Verbatim(chains.sampler), seed=estimate.seed)),
        (
            say("Convergence"),
            say(
                "{reached}: {ess:.0f} effective samples, R-hat {rhat:.4f}, autocorrelation time "
                "{time:.1f} of {steps} steps",
                reached=say("reached") if chains.converged else say("NOT reached"),
                ess=chains.ess_min,
                rhat=chains.rhat_max,
                time=chains.autocorrelation_time,
                steps=chains.steps,
            ),
        ),
    ]
    blocks: list[Block] = [text, Facts(tuple(rows))]
    if (joint := result.beside_integrations) is not None:
        curves = list(result.integrated.values())
        rows_ = tuple(
            (number(x[0], ".3f"), *(number(v / MICROMETRE, ".2f") for v in x[1:]))
            for x in _sparse(joint.position, *(v for c in curves for v in (c.error, c.u)), joint.error, joint.u)
        )
        columns = (
            Column(say("Reading"), unit("mm")),
            Column(say("Integrated"), unit("µm")),
            Column(say("u"), unit("µm")),
            Column(say("Improved"), unit("µm")),
            Column(say("u"), unit("µm")),
            Column(say("Joint fit"), unit("µm")),
            Column(say("u"), unit("µm")),
        )
        notes = (
            say(
                "Integrated: sum of local slopes, improved: with slopes of both neighbours (Shimizu, Kiyono "
                "and Gao, equations 6 and 8 with their signs mended); u by the law of propagation (JCGM "
                "102:2011), from repeatability alone. Without a known length and with shifts not known "
                "exactly the mean slope is that of the readings."
            ),
        )
        blocks.append(Table(say("Beside the integrations of the method's source"), columns, rows_, notes))
    return Section(say("Method"), tuple(blocks))
