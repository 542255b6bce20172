"""What a certificate shows of the curve of an axis: with its band, by position, beside other ways to it, and its residuals."""

from __future__ import annotations

import numpy as np

from cmm_uq.artefacts.shift_axis.analysis import ShiftResult
from cmm_uq.artefacts.shifting.page import table_file
from cmm_uq.base.messages import Number, Verbatim, number, say, signed
from cmm_uq.base.points import Floats
from cmm_uq.base.units import MICROMETRE, unit
from cmm_uq.certificate.document import Column, Section, Table
from cmm_uq.certificate.plots.residuals import curve_with_band, length_plot
from cmm_uq.certificate.sections.results import SIGN
from cmm_uq.maths.uncertainty.quantity import rounded
from cmm_uq.maths.uncertainty.type_a import factor_of_noise

MOST_ROWS = 60
"""Of a table."""


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
    chosen = np.unique(np.linspace(0, count - 1, min(count, MOST_ROWS)).round().astype(int))
    return [tuple(float(column[i]) for column in columns) for i in chosen]


def residuals_section(result: ShiftResult) -> Section:
    """What the placings disagree by, without and with the curve."""
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
    """The curve beside the integrations of the method's source; none where these cannot be done."""
    if (joint := result.beside_integrations) is None:
        return ()
    curves = list(result.integrated.values())
    rows = tuple(
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
    return (Table(say("Beside the integrations of the method's source"), columns, rows, notes),)
