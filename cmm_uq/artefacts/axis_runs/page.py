"""What a certificate shows of runs along axes: figures by ISO 230-2, targets, drift, and which errors no run shows."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Any, cast

import numpy as np

from cmm_uq.analysis.conformity.positioning import uncertainty_of_figures
from cmm_uq.artefacts.axis_runs.artefact import AxisRuns
from cmm_uq.artefacts.axis_runs.run import CIRCLE, SQUARE, TURNING, Run
from cmm_uq.base.messages import NOTHING, Text, Verbatim, commas, number, say, signed
from cmm_uq.base.points import AXES
from cmm_uq.base.units import MICROMETRE, unit
from cmm_uq.certificate.document import Block, Column, Paragraph, Section, Table, figure_columns, section, table
from cmm_uq.certificate.plots.residuals import deviations_plot, positioning_plot, residual_volume
from cmm_uq.certificate.result import Page, Result
from cmm_uq.machine.physics.kinematics import PARAMETRIC_ERRORS
from cmm_uq.maths.geometry.positioning import MissingReadingError, PositioningRuns
from cmm_uq.maths.uncertainty.quantity import nominal, rounded

COVERAGE = 2.0  # of U of the figures (ISO/TR 230-9)
Spread = Mapping[str, float]
Evaluated = Sequence[tuple[Run, PositioningRuns, Spread]]


def _evaluated(result: Result) -> list[tuple[Run, PositioningRuns | MissingReadingError, Spread]]:
    artefact, under = cast("AxisRuns", result.artefact), result.job.circumstances
    found: list[tuple[Run, PositioningRuns | MissingReadingError, Spread]] = []
    for run in artefact.runs:
        try:
            evaluated = artefact.positioning(run)
        except MissingReadingError as error:
            found.append((run, error, {}))
        else:
            found.append((run, evaluated, uncertainty_of_figures(evaluated, under)))
    return found


def missing_words(run: Run, error: MissingReadingError) -> Text:
    way = {1.0: say("in the positive direction"), -1.0: say("in the negative direction")}.get(error.direction, NOTHING)
    if not error.gap:
        return say(
            "measurement {number} is not evaluated: target {target:g} mm {way} has {count} readings in repeat {repeat}, "
            "not one", number=run.measurement, target=error.target, way=way, count=error.count, repeat=error.repeat,
        )  # fmt: skip
    why = say("lies outside the readings of repeat {repeat}", repeat=error.repeat)
    if np.isfinite(error.gap):
        why = say(
            "lies between readings of repeat {repeat} that are {gap:.3g} mm apart, more than {most:.3g} mm",
            repeat=error.repeat,
            gap=error.gap,
            most=error.most,
        )
    return say(
        "measurement {number} is not evaluated: target {target:g} mm {way} {why}",
        number=run.measurement, target=error.target, way=way, why=why,
    )  # fmt: skip


def _unit(run: Run) -> Text:
    return unit("″") if run.kind == TURNING else unit("µm")


def results(result: Result) -> dict[str, Any]:
    runs = []
    for run, found, spread in _evaluated(result):
        told: dict[str, Any] = {"measurement": run.measurement, "quantity": str(run.quantity), "unit": str(_unit(run))}
        if isinstance(found, MissingReadingError):
            runs.append({**told, "not_evaluated": str(missing_words(run, found))})
            continue
        by_way = [
            {"mean": m.tolist(), "s": None if np.isnan(s).any() else s.tolist()}
            for m, s in zip(found.mean, found.s, strict=True)
        ]
        told |= {
            "angles_deg" if run.kind == CIRCLE or run.table else "targets_mm": found.targets.tolist(),
            "directions": by_way,
            "reversal": found.reversal.tolist(),
            "figures": dict(found.figures()),
            "U": {name: COVERAGE * u for name, u in spread.items()},
        }
        if (motion := found.motion) is not None:
            told["in_motion"] = {
                "widest_gap_mm": motion.widest_gap,
                "linear_less_cubic_rms": float(np.sqrt(np.mean(motion.curvature**2))),
                "linear_less_cubic_max": float(np.abs(motion.curvature).max()),
                "part_of_noise": float(np.sqrt(np.mean(motion.share**2))),
                "u_delay": motion.u_delay,
            }
        runs.append({**told, "drift_of_repeats": found.drift.tolist()})
    return {"runs": runs, "not_read": _not_read(result)}


def _not_read(result: Result) -> list[str]:
    """Parametric errors that no run reads, by their name in VDI/VDE 2617."""
    artefact = cast("AxisRuns", result.artefact)
    read = {str(run.quantity) for run in artefact.runs}
    for run in (each for each in artefact.runs if each.kind == CIRCLE):
        plane = [a for a, part in zip(AXES, np.abs(run.travel), strict=True) if part < 0.5]
        read |= {f"{a}{how}{b}" for a in plane for b in plane for how in "tw"}
    square = artefact.points.columns.get(SQUARE, np.zeros(len(artefact.points)))
    read |= {f"{run.axis}w{str(run.quantity)[-1]}" for run in artefact.runs if square[artefact.rows[run.rows, 0]].any()}
    return [error.vdi for error in PARAMETRIC_ERRORS if error.vdi not in read]


def sections(result: Result) -> list[Section]:
    every = _evaluated(result)
    whole = [(run, found, spread) for run, found, spread in every if isinstance(found, PositioningRuns)]
    straight = [each for each in whole if each[0].kind != CIRCLE]
    each_way = [f"{figure}{arrow}" for figure in "AER" for arrow in "↑↓"]
    missing = (missing_words(run, found) for run, found, _ in every if isinstance(found, MissingReadingError))
    unseen = say(
        "No run reads {errors}: in what is said of all errors together these keep what physics allows of them.",
        errors=commas(map(Verbatim, _not_read(result))),
    )
    return [
        section(
            say("Runs along the axes"), _both(straight),
            _table(say("Each direction by itself"), each_way, straight), _in_motion(straight),
            *_circles([each for each in whole if each[0].kind == CIRCLE]),
            *(Paragraph(say("{why:capital}.", why=why)) for why in missing), Paragraph(unseen), _readings(result),
            residual_volume(result, say("positions")),
        ),
        section(say("Target by target"), *(block for run, found, _ in whole for block in _targets(run, found))),
    ]  # fmt: skip


def _cells(found: PositioningRuns, names: list[str], spread: Spread) -> Iterator[Text]:
    figures = found.figures()
    for name in names:
        if name not in figures:
            yield say("–")
        elif spread.get(name, 0.0) > 0:
            value, expanded = rounded(figures[name], COVERAGE * spread[name])
            yield say("{value} ± {U}", value=value, U=expanded)
        else:
            yield rounded(figures[name], 0.1)[0]


def _table(caption: Text, names: list[str], whole: Evaluated, *notes: Text) -> Table | None:
    rows = (
        (number(run.measurement), run.quantity, _unit(run), *_cells(found, names, spread))
        for run, found, spread in whole
    )
    figures = (Column(say("mean B") if name == "mean B" else Verbatim(name)) for name in names)
    return table(caption, [say("Measurement"), say("Quantity"), say("Unit"), *figures], rows, *notes)


def _both(whole: Evaluated) -> Table | None:
    without = say(
        "Figures without U, as those of straightnesses and rotations: no test uncertainty is stated of what reads them."
    )
    return _table(
        say("Both directions, by ISO 230-2:2014"), ["A", "E", "R", "B", "mean B", "M"], whole,
        say(
            "A accuracy, E systematic deviation, R repeatability, B reversal, M range of mean deviations. Straightnesses "
            "less a straight line, and rotations, are evaluated by the same formulas (ISO 230-1)."
        ),
        say("Quantities as VDI/VDE 2617 writes them: the carriage, t for a displacement or r for a rotation, and its axis."),
        say(
            "± U (k = 2): test uncertainty as ISO/TR 230-9 has it, of the instrument's scale, alignment, temperature and "
            "what changes between readings, as far as stated; the machine's own scatter is in the figures, not in U."
        ),
        NOTHING if all(spread for *_, spread in whole) else without,
    )  # fmt: skip


def _in_motion(whole: Evaluated) -> Table | None:
    rows = (
        (
            number(run.measurement), run.quantity, number(motion.widest_gap, ".3g"),
            number(float(np.sqrt(np.mean(motion.share**2))), ".2f"), number(float(np.abs(motion.curvature).max()), ".2g"),
            say("–") if motion.u_delay is None else number(motion.u_delay, ".2g"), _unit(run),
        )
        for run, found, _ in whole if (motion := found.motion) is not None
    )  # fmt: skip
    figures = figure_columns(say("Part of noise"), say("Linear less cubic"), say("u of delay"))
    return table(
        say("Readings in motion, interpolated at targets"),
        [say("Measurement"), say("Quantity"), Column(say("Widest gap"), unit("mm")), *figures, say("Unit")],
        rows,
        say(
            "Deviations at targets are interpolated linearly between the two readings next to each, of the same repeat and "
            "direction. ISO 230-2 asks that the axis rests at each target: these figures follow its formulas, and are no test "
            "by it."
        ),
        say(
            "U contains the noise of two readings (its part of that of one, by which scatter between repeats may be smaller, "
            "too), how far a cubic through two readings on either side is off the line, and what a delay between scales and "
            "instrument makes in either direction, as far as stated; a dash: not stated, and not contained."
        ),
    )


def _circles(whole: Evaluated) -> Iterator[Table | None]:
    yield _table(
        say("Circles, by ISO 230-4"),
        ["G↺", "G↻", "H", "G(b)"],
        whole,
        say(
            "G circular deviation, by the minimum zone, ↺ counter-clockwise about the positive axis; H circular "
            "hysteresis (1996); G(b) bidirectional circular deviation (2005). Of several rounds the largest."
        ),
    )
    known = [each for each in whole if {"Fmax", "D"} & set(each[1].figures())]
    what = say(
        "F radial deviation about the least-squares centre (1996), D mean bidirectional radial deviation (2005)."
    )
    yield _table(say("Radial deviations, by ISO 230-4"), ["Fmax", "Fmin", "D"], known, what)


def _targets(run: Run, found: PositioningRuns) -> Iterator[Block]:
    """The picture of a circle, or of a run that was repeated, as ISO 230-2 draws it, and its targets as a table."""
    own, title = _unit(run), say("Measurement {number}: {quantity}", number=run.measurement, quantity=run.quantity)
    low, high = (signed(m, ".2f") for m in (found.mean.min(), found.mean.max()))
    told = say("Mean deviations from {low} to {high} {unit}.", low=low, high=high, unit=own)
    picture = partial(
        positioning_plot, found.targets, found.mean, np.nan_to_num(found.s), found.arrows, own, alternative=told
    )
    if run.kind == CIRCLE:
        caption = say("{title}: radial deviations, filled counter-clockwise about the positive axis.", title=title)
        yield picture(label=say("Angle / °"), caption=caption)
        return
    ways = {"↑": (say("Mean ↑"), say("s ↑")), "↓": (say("Mean ↓"), say("s ↓"))}
    heads = [*(head for arrow in found.arrows for head in ways[arrow]), say("Reversal")]
    columns = [*(values for way in zip(found.mean, found.s, strict=True) for values in way), found.reversal]
    shown = list(zip(heads, columns, strict=True))[: None if found.both else -1]
    rows = tuple(
        (
            nominal(float(target)),
            *(say("–") if np.isnan(c[i]) else signed(round(c[i], 2) + 0.0, ".2f") for _, c in shown),
        )
        for i, target in enumerate(found.targets)
    )
    columns_of = (
        Column(say("Target"), unit("°" if run.table else "mm")),
        *figure_columns(*(head for head, _ in shown), unit=own),
    )
    if found.repeats == 1:
        yield Table(title, columns_of, rows)
        return
    means = say("{title}: means of {repeats} repeats, filled in the positive direction, with ±2s.",
                title=title, repeats=found.repeats)  # fmt: skip
    yield picture(label=say("Angle / °") if run.table else say("Target / mm"), caption=means)
    drift = number(float(np.abs(found.drift).max()), ".2g")
    drifts = say("The mean of a repeat differs from that of all by up to {drift} {unit}.", drift=drift, unit=own)
    yield Table(title, columns_of, rows, (drifts,))


def _readings(result: Result) -> Block:
    artefact = cast("AxisRuns", result.artefact)
    off = artefact.about_zero(artefact.readings) / MICROMETRE
    return deviations_plot(
        result,
        off,
        say("{count} readings: as recorded they deviate", count=len(off)),
        say("from their zero"),
        expanded_um=result.noise.expanded * artefact.noise_scale,
        reference=say("mean of the run"),
        position_label=say("Measurement"),
        caption=say(
            "Readings about the zero of their run, as recorded and after the fitted model, with U (k = {k}); of a rotation "
            "times the arm.",
            k=number(result.noise.coverage_factor, ".2f"),
        ),
    )


PAGE = Page(sections, results)
