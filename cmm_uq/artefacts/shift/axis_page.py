"""What a certificate shows of an axis calibrated by shifting: figures, curve with its band, results."""

from __future__ import annotations

from typing import Any

import numpy as np

from cmm_uq.artefacts.shift import result as shared
from cmm_uq.artefacts.shift.axis import SelectedPoints, ShiftResult
from cmm_uq.artefacts.shift.integration import IntegratedCurve
from cmm_uq.base.messages import Number, Text, Verbatim, in_a_row, number, plural, say, signed
from cmm_uq.base.points import Floats
from cmm_uq.base.units import MICROMETRE, unit
from cmm_uq.certificate.document import Block, Column, Paragraph, Section, Table, figure_columns, table
from cmm_uq.certificate.origin import quantity_data
from cmm_uq.certificate.plots.residuals import curve_with_band, length_plot
from cmm_uq.certificate.sections.method import not_converged
from cmm_uq.certificate.sections.results import Left
from cmm_uq.certificate.wording import SIGN
from cmm_uq.machine.physics.effects.rigid_body import SCALE
from cmm_uq.maths.uncertainty.quantity import figure, nominal, rounded, significant
from cmm_uq.maths.uncertainty.type_a import factor_of_noise


def shift_results(result: ShiftResult) -> dict[str, Any]:
    estimate, curve, linearity = result.estimate, result.estimate.curve, f"linearity_{result.axis}"
    estimates: dict[str, Any] = {linearity: {"peak_to_valley_um": quantity_data(result.linearity)}}
    if result.scale is not None:
        estimates[SCALE[result.axis].name] = {"ppm": quantity_data(result.scale)}
    joint, (mean, u, U) = result.beside_integrations, result.distances or (None, None, None)
    return shared.shared_results(result, estimates, len(estimate.series.reading), {
        "curves": {linearity: shared.curve_data(curve, result.stated_along(curve))},
        "integrations": {method: _integrated_data(one) for method, one in result.integrated.items()},
        **({"selections": [_selected_data(one) for one in result.selected]} if result.selected else {}),
        "beside_integrations": None if joint is None else shared.curve_data(joint, joint.expanded),
        "artefact": {
            "point": estimate.series.numbers.tolist(), "distance_mm": None if mean is None else mean.tolist(),
            "u_um": None if u is None else _um(u), "U_mm": None if U is None else U.tolist(),
        },
        "shifts": [
            {"nominal_mm": nominal, "mm": quantity_data(shift)}
            for nominal, shift in zip(estimate.series.shifts.tolist(), result.shifts, strict=True)
        ],
        "identifiability": {
            "scale_determined": estimate.scale_known, "period_not_seen_mm": result.undetermined.period,
            "patterns_not_seen": [
                {"position_mm": estimate.series.positions.tolist(), "weight": pattern.tolist()}
                for pattern in result.undetermined.patterns.T
            ],
        },
    })  # fmt: skip


def _um(values: Floats) -> list[float]:
    found: list[float] = (values / MICROMETRE).tolist()
    return found


def _integrated_data(one: IntegratedCurve) -> dict[str, Any]:
    return {"position_mm": one.position.tolist(), "error_um": _um(one.error), "u_um": _um(one.u)}


def _selected_data(one: SelectedPoints) -> dict[str, Any]:
    data: dict[str, Any] = {"points": one.numbers.tolist(), "joint_um": _um(one.joint)}
    for method, found in one.integrated.items():
        left, u = one.peak_to_valley(method)
        data[method] = {**_integrated_data(found), "left_um": left / MICROMETRE, "u_left_um": u / MICROMETRE}
    return data


def _selections(result: ShiftResult) -> Table | None:
    """The source's experiments side by side: what each integration leaves, from all points and from some."""
    rows = []
    for one in result.selected:
        steps = np.abs(np.diff(next(iter(one.integrated.values())).position))
        low, high = (nominal(round(float(step), 1)) for step in (steps.min(), steps.max()))
        pitch = low if low == high else say("{low} to {high}", low=low, high=high)
        sizes = (np.ptp(one.joint), *(part for method in one.integrated for part in one.peak_to_valley(method)))
        rows.append((number(len(one.numbers)), pitch, *(number(float(size) / MICROMETRE, ".1f") for size in sizes)))
    heads = _in_um(say("Error"), say("Integrated leaves"), say("u"), say("Improved leaves"), say("u"))
    note = say(
        "Peak to valley at the points: of the error by the joint fit of all readings, and of what the integrations from these "
        "points alone leave of it; u of that difference by the law of propagation, from repeatability alone."
    )
    columns = (Column(say("Points")), Column(say("Pitch"), unit("mm")), *heads)
    return table(say("Integrations from some of the points"), columns, rows, note)


MOST_ROWS = 60  # of a table


def _curve(result: ShiftResult) -> Section:
    fine, curve, axis = result.fine, result.estimate.curve, Verbatim(result.axis)
    error, k = fine.error / MICROMETRE, curve.simultaneous_factor
    band = k * fine.u / MICROMETRE
    plot = curve_with_band(
        fine.position, error, band, x_label=say("Scale reading {axis} / mm", axis=axis), y_label=say("Error e / µm"),
        points=(curve.position, curve.error / MICROMETRE),
        caption=say("Error of axis {axis}, with the band that holds the whole curve with 95 % probability.", axis=axis),
        alternative=say(
            "The error runs from {low} to {high} µm; the band is at most {k:.1f} µm to each side.",
            low=signed(error.min(), ".1f"), high=signed(error.max(), ".1f"), k=k * fine.u.max() / MICROMETRE,
        ),
    )  # fmt: skip
    rows = tuple(
        (number(x, ".3f"), *rounded(e / MICROMETRE, max(U, 1e-6) / MICROMETRE), number(half / MICROMETRE, ".2f"))
        if U > 0
        else (number(x, ".3f"), *3 * (Number("0"),))
        for x, e, U, half in _sparse(curve.position, curve.error, result.stated_along(curve), curve.band)
    )
    columns = (Column(say("Reading"), unit("mm")), *_in_um(say("Error"), say("U"), say("Band")))
    beyond = say(
        "{table_file} holds the curve as an error map; beyond the readings it repeats the last value, uncalibrated.",
        table_file=Verbatim(shared.table_file(result.job)),
    )
    band_words = say("U: 95 % at that position; band: half width of the band for the whole curve, k = {k:.2f}.", k=k)
    by_position = Table(say("Error by position"), columns, rows, (SIGN, band_words, beyond))
    return Section(say("Error of the axis"), (plot, by_position))


def _in_um(*headings: Text) -> tuple[Column, ...]:
    return figure_columns(*headings, unit=unit("µm"))


def _sparse(*columns: Floats) -> list[tuple[float, ...]]:
    """Rows of the columns, evenly thinned where there are more than a page holds."""
    count = len(columns[0])
    chosen = np.unique(np.linspace(0, count - 1, min(count, MOST_ROWS)).round().astype(int))
    return [tuple(float(column[i]) for column in columns) for i in chosen]


def _residuals(result: ShiftResult) -> Section:
    series, (without, with_curve) = result.estimate.series, result.disagreement_um
    before, after = (r / MICROMETRE for r in result.estimate.residuals)
    k = factor_of_noise(result.repeatability)
    plot = length_plot(
        series.numbers[series.point], before, after,
        expanded_before_um=k * result.repeatability.value * series.noise_scale, reference=say("the artefact's point"),
        position_label=say("Point of the artefact"), before_label=say("Without a curve"),
        after_label=say("With the curve"),
        caption=say("What the set-ups disagree by, without and with the curve, and U (k = {k}).", k=number(k, ".2f")),
        alternative=say(
            "The set-ups disagree by {before:.2f} µm rms without and {after:.2f} µm with the curve.",
            before=without, after=with_curve,
        ),
    )  # fmt: skip
    return Section(say("Residuals"), (plot,))


def _beside_integrations(result: ShiftResult) -> Table | None:
    if (joint := result.beside_integrations) is None:
        return None
    integrations = (values for one in result.integrated.values() for values in (one.error, one.u))
    rows = (
        (number(x, ".3f"), *(signed(v / MICROMETRE, ".2f") for v in figures))
        for x, *figures in _sparse(joint.position, *integrations, joint.error, joint.u)
    )
    each = _in_um(say("Integrated"), say("u"), say("Improved"), say("u"), say("Joint fit"), say("u"))
    note = say(
        "Integrated: sum of local slopes, improved: with slopes of both neighbours (Shimizu, Kiyono and Gao, equations 6 and "
        "8 with their signs mended); u by the law of propagation (JCGM 102:2011), from repeatability alone. Without a known "
        "length and with shifts not known exactly the mean slope is that of the readings."
    )
    return table(
        say("Beside the integrations of the method's source"), [Column(say("Reading"), unit("mm")), *each], rows, note
    )


def sections(result: ShiftResult) -> list[Section]:
    parts = (_figures, _artefact, _curve, _open, _residuals, _method)
    return [part(result) for part in parts]


def warnings(result: ShiftResult) -> list[Text]:
    found = not_converged(result.estimate.chains)
    if not result.estimate.scale_known:
        open_scale = say(
            "The mean sensitivity of the axis is not determined: no length of the artefact is known and the shifts are "
            "not known exactly. The curve is the linearity error, zero at both ends of the first series."
        )
        found.append(open_scale)
    if free := result.undetermined.patterns.shape[1]:
        one = say(
            "{free} combination of the errors at the positions read cannot be seen by these "
            "readings; there the curve rests on the assumption that it is smooth.",
            free=free,
        )
        many = say(
            "{free} combinations of the errors at the positions read cannot be seen by these "
            "readings; there the curve rests on the assumption that it is smooth.",
            free=free,
        )
        found.append(plural(free, one=one, many=many))
    return found


def measured(result: ShiftResult) -> Text:
    name, axis, series = Verbatim(result.job.facts.machine.name), Verbatim(result.axis), result.estimate.series
    n, s = len(series.numbers), len(series.shifts)
    return say("{name}, axis {axis}, {points} points in {placings} set-ups", name=name, axis=axis, points=n, placings=s)


def quantities(result: ShiftResult) -> list[Left]:
    linearity, axis = say("Linearity error, peak to valley"), result.axis
    named: list[Left] = [(f"linearity_{axis}", "peak_to_valley_um", linearity, result.linearity)]
    if result.scale is not None:
        scale = say("Mean sensitivity error of axis {axis}", axis=Verbatim(axis))
        named.append((SCALE[axis].name, "ppm", scale, result.scale))
    return [*named, ("noise", "coordinate_um", say("Repeatability (one reading)"), result.repeatability)]


def _figures(result: ShiftResult) -> Section:
    meaning = say(
        "Linearity error: of the estimated curve about the straight line through the ends of the first series."
    )
    return shared.figures_section(say("Axis figures"), quantities(result), meaning)


def _open(result: ShiftResult) -> Section:
    free, title = result.undetermined, say("What the shifts leave open")
    period = say(
        "Every shift is a multiple of {period} mm, so an error of that period, or of a half, a "
        "third of it, is the same in all set-ups and shows in no reading: it looks like another "
        "artefact. A set-up shifted by another length, such as {other} mm, would show it.",
        period=nominal(free.period),
        other=figure(0.618 * free.period, 3),
    )
    if not (count := free.patterns.shape[1]):
        text = say("At the positions read the readings alone determine the error, but for a constant and a slope.")
        return Section(title, (Paragraph(period), Paragraph(text)))
    at, worst = result.estimate.series.positions, free.patterns[:, 0]
    one = say(
        "Beyond a constant and a slope, {count} combination of the errors at the positions "
        "read change no reading. The curve shows the smoothest error that agrees with the readings. "
        "A set-up that joins the positions, or a finer pitch, would determine them.",
        count=count,
    )
    many = say(
        "Beyond a constant and a slope, {count} combinations of the errors at the positions "
        "read change no reading. The curve shows the smoothest error that agrees with the readings. "
        "A set-up that joins the positions, or a finer pitch, would determine them.",
        count=count,
    )
    plot = curve_with_band(
        at, worst, 0 * at, x_label=say("Scale reading {axis} / mm", axis=Verbatim(result.axis)), y_label=say("Weight"),
        points=(at, worst), caption=say("One such combination: this pattern, of any size, changes no reading."),
        alternative=say("Weights of the errors at {count} positions that together change no reading.", count=len(at)),
    )  # fmt: skip
    return Section(title, (Paragraph(period), Paragraph(plural(count, one=one, many=many)), plot))


def _artefact(result: ShiftResult) -> Section:
    facts = shared.shift_facts(result.job)
    shifts, U = in_a_row(nominal(s) for s in facts.shifts_mm), significant(2 * facts.sd_shift_um)
    told = say("{shifts} mm, U = {U} µm (k = 2)", shifts=shifts, U=U)
    if facts.u_shift_um is None:
        told = say("{shifts} mm nominal, estimated: how well they are known is not stated", shifts=shifts)
    blocks: list[Block] = []
    if result.distances is not None:
        cells = tuple(
            (number(n), *(rounded(x, U) if U > 0 else (number(x, ".4f"), Number("0"))))
            for n, x, _, U in zip(result.estimate.series.numbers, *result.distances, strict=True)
        )
        columns = (Column(say("Point")), *figure_columns(say("Distance from the first"), say("U"), unit=unit("mm")))
        note = say("U is for a coverage probability of 95 %, from the posterior distribution.")
        blocks.append(Table(say("The artefact's own dimensions"), columns, cells[:MOST_ROWS], (note,)))
    title = say("Uncalibrated artefact, shifted")
    return shared.artefact_section(result.job, title, say("points"), ((say("Shifts"), told),), *blocks)


def _method(result: ShiftResult) -> Section:
    text = say(
        "The error of the axis, the artefact's dimensions and the shifts are fitted to all readings at once; the error is a "
        "smooth function (Gaussian process, Matérn 7/2) whose size, correlation length and growth towards the ends are "
        "sampled, all else is drawn from its exact conditional distribution."
    )
    readings = len(result.estimate.series.reading)
    return shared.method_section(result, text, readings, _beside_integrations(result), _selections(result))
