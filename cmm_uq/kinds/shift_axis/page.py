"""What a certificate shows of an axis calibrated by shifting: curve and band, what stays open, residuals, the table."""

from __future__ import annotations

import numpy as np

from cmm_uq.documents.document import Block, Column, Facts, Paragraph, Section, Table
from cmm_uq.documents.origin import file_name
from cmm_uq.documents.plots import curve_with_band, length_plot
from cmm_uq.documents.wording import expanded
from cmm_uq.jobs.job import Job
from cmm_uq.kinds.shift_axis.analysis import ShiftResult
from cmm_uq.kinds.shifting.facts import shift_facts
from cmm_uq.points import Floats
from cmm_uq.uncertainty.rounding import rounded
from cmm_uq.units import MICROMETRE

SIGN = "Sign rule: true coordinate = indicated coordinate + error."
_MOST_ROWS = 60


def sections(result: ShiftResult) -> list[Section]:
    """Figures, curve, what is not determined, residuals, artefact, method."""
    return [_figures(result), _curve(result), _open(result), _residuals(result), _artefact(result), _method(result)]


def warnings(result: ShiftResult) -> tuple[str, ...]:
    """What the reader must know before using a figure."""
    found, chains = [], result.estimate.chains
    if not chains.converged:
        found.append(
            f"The sampling did not converge (least effective sample size {chains.ess_min:.0f}, R-hat "
            f"{chains.rhat_max:.3f}): estimates and uncertainties must not be used."
        )
    if not result.estimate.scale_known:
        found.append(
            "The mean sensitivity of the axis is not determined: no length of the artefact is known and the shifts are "
            "not known exactly. The curve is the linearity error, zero at both ends of the first series."
        )
    if free := result.undetermined.patterns.shape[1]:
        found.append(
            f"{free} combination{'s' if free > 1 else ''} of the errors at the positions read cannot be seen by these "
            "readings; there the curve rests on the assumption that it is smooth."
        )
    return tuple(found)


def summary(result: ShiftResult) -> list[tuple[str, str, str]]:
    """Rows of what, figure and remark, for the end of a command."""
    facts, series = result.job.facts, result.estimate.series
    rows = [(
        "Measured", f"{facts.machine.name}, axis {result.axis}, {len(series.numbers)} points in {len(series.shifts)} "
        "placings", facts.job.date.isoformat(),
    )]  # fmt: skip
    for name, value, U, k, unit in _quantities(result):
        rows.append((name, f"{value} ± {U} {unit}", f"k = {k}"))
    return rows + [("Warning", text, "") for text in warnings(result)]


def table_file(job: Job) -> str:
    """Name of the correction table, an error map, beside the certificate."""
    return file_name("correction_table.csv", job.origin)


def _quantities(result: ShiftResult) -> list[tuple[str, str, str, str, str]]:
    named = [
        ("Linearity error, peak to valley", result.linearity),
        ("Repeatability (one reading)", result.repeatability),
    ]
    if result.scale is not None:
        named.insert(1, (f"Mean sensitivity error of axis {result.axis}", result.scale))
    return [(name, *expanded(quantity), quantity.unit) for name, quantity in named]


def _figures(result: ShiftResult) -> Section:
    columns = (
        Column("Quantity", numeric=False), Column("Value"), Column("U"), Column("k"), Column("Unit", numeric=False),
    )  # fmt: skip
    notes = (
        SIGN,
        "Linearity error: of the estimated curve about the straight line through the ends of the first series.",
        "U is the expanded uncertainty for a coverage probability of 95 %, from the posterior distribution.",
    )
    return Section("Figures of performance", (Table("Axis figures", columns, tuple(_quantities(result)), notes),))


def _curve(result: ShiftResult) -> Section:
    fine, curve = result.fine, result.estimate.curve
    k = curve.simultaneous_factor
    plot = curve_with_band(
        fine.position, fine.error / MICROMETRE, k * fine.u / MICROMETRE, x_label=f"Scale reading {result.axis} / mm",
        y_label="Error e / µm", points=(curve.position, curve.error / MICROMETRE),
        caption=f"Error of axis {result.axis}, with the band that holds the whole curve with 95 % probability.",
        alternative=(
            f"The error runs from {fine.error.min() / MICROMETRE:.1f} to {fine.error.max() / MICROMETRE:.1f} µm; "
            f"the band is at most {k * fine.u.max() / MICROMETRE:.1f} µm to each side."
        ),
    )  # fmt: skip
    rows = tuple(
        (f"{x:.3f}", *rounded(e / MICROMETRE, max(one, 1e-6) / MICROMETRE), f"{band / MICROMETRE:.2f}")
        if one > 0
        else (f"{x:.3f}", "0", "0", "0")
        for x, e, one, band in _sparse(curve.position, curve.error, curve.expanded, curve.band)
    )
    columns = (Column("Reading", "mm"), Column("Error", "µm"), Column("U", "µm"), Column("Band", "µm"))
    notes = (
        SIGN,
        f"U: 95 % at that position; band: half width of the band for the whole curve, k = {k:.2f}.",
        f"{table_file(result.job)} holds the curve as an error map; beyond the readings it repeats the last value, "
        "uncalibrated.",
    )
    return Section("Error of the axis", (plot, Table("Error by position", columns, rows, notes)))


def _sparse(*columns: Floats) -> list[tuple[float, ...]]:
    """Rows of the columns, evenly thinned where there are more than a page holds."""
    count = len(columns[0])
    chosen = np.unique(np.linspace(0, count - 1, min(count, _MOST_ROWS)).round().astype(int))
    return [tuple(float(column[i]) for column in columns) for i in chosen]


def _open(result: ShiftResult) -> Section:
    free = result.undetermined
    count = free.patterns.shape[1]
    blocks: list[Block] = [Paragraph(
        f"Every shift is a multiple of {free.period:.4g} mm, so an error of that period, or of a half, a third of it, is the "
        "same in all placings and shows in no reading: it looks like another artefact. A placing shifted by another "
        f"length, such as {0.618 * free.period:.3g} mm, would show it."
    )]  # fmt: skip
    if count:
        at, worst = result.estimate.series.positions, free.patterns[:, 0]
        blocks += [
            Paragraph(
                f"Beyond a constant and a slope, {count} combination{'s' if count > 1 else ''} of the errors at the positions "
                "read change no reading. The curve shows the smoothest error that agrees with the readings. A placing "
                "that joins the positions, or a finer pitch, would determine them."
            ),
            curve_with_band(
                at, worst, 0 * at, x_label=f"Scale reading {result.axis} / mm", y_label="Weight", points=(at, worst),
                caption="One such combination: this pattern, of any size, changes no reading.",
                alternative=f"Weights of the errors at {len(at)} positions that together change no reading.",
            ),
        ]  # fmt: skip
    else:
        blocks.append(
            Paragraph("At the positions read the readings alone determine the error, but for a constant and a slope.")
        )
    return Section("What the shifts leave open", tuple(blocks))


def _residuals(result: ShiftResult) -> Section:
    series = result.estimate.series
    before, after = (r / MICROMETRE for r in result.estimate.residuals)
    size = result.disagreement_um
    U = 2 * result.repeatability.value * series.noise_scale
    plot = length_plot(
        series.numbers[series.point], before, after, expanded_before_um=U, expanded_after_um=U,
        reference="the artefact's point", position_label="Point of the artefact", before_label="Without a curve",
        after_label="With the curve", caption="What the placings disagree by, without and with the curve, and U (k = 2).",
        alternative=(
            f"The placings disagree by {size[0]:.2f} µm rms without and {size[1]:.2f} µm with the curve."
        ),
    )  # fmt: skip
    return Section("Residuals", (plot,))


def _artefact(result: ShiftResult) -> Section:
    facts, estimate = shift_facts(result.job), result.estimate
    known = facts.known
    rows = [("Artefact", facts.name or "Uncalibrated artefact, shifted"), ("Serial number", facts.serial)]
    if known is not None:
        rows.append(("Known length", f"points {known.from_point} to {known.to_point}: {known.length_mm:.10g} mm, "
                                     f"u = {known.u_um:g} µm"))  # fmt: skip
    if facts.certificate is not None:
        rows.append(("Its certificate", f"{facts.certificate.number} {facts.certificate.laboratory}".strip()))
    rows.append(("Shifts", f"{', '.join(f'{s:g}' for s in facts.shifts_mm)} mm, u = {facts.u_shift_um:g} µm"))
    blocks: list[Block] = [Facts(tuple((label, value) for label, value in rows if value))]
    if result.distances is not None:
        cells = tuple(
            (str(n), *(rounded(x, 2 * s) if s > 0 else (f"{x:.4f}", "0")))
            for n, x, s in zip(estimate.series.numbers, *result.distances, strict=True)
        )
        columns = (Column("Point"), Column("Distance from the first", "mm"), Column("U", "mm"))
        blocks.append(Table("The artefact's own dimensions (k = 2)", columns, cells[:_MOST_ROWS]))
    return Section("Artefact and traceability", tuple(blocks))


def _method(result: ShiftResult) -> Section:
    estimate, chains = result.estimate, result.estimate.chains
    text = Paragraph(
        "The error of the axis, the artefact's dimensions and the shifts are fitted to all readings at once; the error is a "
        "smooth function (Gaussian process, Matérn 7/2) whose size, correlation length and growth towards the ends are "
        "sampled, all else is drawn from its exact conditional distribution."
    )
    rows = [
        ("Readings (means)", str(len(estimate.series.reading))),
        ("Sampler", f"{chains.sampler}, seed {estimate.seed}"),
        ("Convergence", f"{'reached' if chains.converged else 'NOT reached'}: {chains.ess_min:.0f} effective samples, R-hat "
                        f"{chains.rhat_max:.4f}, autocorrelation time {chains.autocorrelation_time:.1f} of {chains.steps} "
                        "steps"),
    ]  # fmt: skip
    blocks: list[Block] = [text, Facts(tuple(rows))]
    if (joint := result.beside_integrations) is not None:
        curves = list(result.integrated.values())
        rows_ = tuple(
            (f"{x[0]:.3f}", *(f"{v / MICROMETRE:.2f}" for v in x[1:]))
            for x in _sparse(joint.position, *(v for c in curves for v in (c.error, c.u)), joint.error, joint.u)
        )
        columns = (
            Column("Reading", "mm"), Column("Integrated", "µm"), Column("u", "µm"), Column("Improved", "µm"),
            Column("u", "µm"), Column("Joint fit", "µm"), Column("u", "µm"),
        )  # fmt: skip
        notes = (
            "Integrated: sum of local slopes, improved: with slopes of both neighbours (Shimizu, Kiyono and Gao, equations 6 "
            "and 8 with their signs mended); u by the law of propagation (JCGM 102:2011), from repeatability alone. Without "
            "a known length and with shifts not known exactly the mean slope is that of the readings.",
        )
        blocks.append(Table("Beside the integrations of the method's source", columns, rows_, notes))
    return Section("Method", tuple(blocks))
