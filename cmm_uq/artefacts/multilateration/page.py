"""What a certificate shows of multilateration: stations, targets found without the machine, and what remains free."""

from __future__ import annotations

from typing import Any, NamedTuple, cast

import numpy as np

from cmm_uq.artefacts.kinds import MultilaterationFacts
from cmm_uq.artefacts.multilateration.artefact import Multilateration
from cmm_uq.artefacts.multilateration.free_points import STATIONS, FreePoints, free_points
from cmm_uq.base.messages import Text, Verbatim, number, say, semicolons
from cmm_uq.base.points import AXES, Floats
from cmm_uq.base.units import MICROMETRE, unit
from cmm_uq.certificate.document import Block, Column, Paragraph, Section, Table, figure_columns, text_columns
from cmm_uq.certificate.plots.residuals import length_plot, residual_volume
from cmm_uq.certificate.result import Page, Result
from cmm_uq.certificate.wording import deviating
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.physics.effects.rigid_body import tip_offsets
from cmm_uq.maths.inference.linear_model import LinearModel
from cmm_uq.maths.uncertainty.quantity import rounded


class Standpoint(NamedTuple):
    """A station as found."""

    measurement: int
    readings: int
    position: Floats  # (3,) in the recording's frame, mm
    dead_path: float  # that the readings lack, mm
    drift: float | None  # of it, mm/h
    u: Floats  # (4 or 5,) of position, dead path and drift, mm, mm/h
    residual_rms: float  # mm


def standpoints(
    model: RecordingModel, linear: LinearModel, values: Floats, covariance: Floats, noise: float
) -> list[Standpoint]:
    """Stations where parameters (k,) put them; u by the covariance (k, k) of these and the noise of readings, mm."""
    artefact = cast("Multilateration", model.artefact)
    true, scale = model.placed(values), float(values[-1]) / artefact.sizes[0].nominal
    found, columns, tips = artefact.at(true, values[-1]), artefact.placing(true).columns, tip_offsets(artefact.points)
    whole, residuals = np.zeros((len(true), len(values))), model.residuals(values)
    whole[model.used] = linear.design
    each = []
    for which, station, zero, rows in zip(
        artefact.stations.numbers.tolist(), found, scale * artefact.found[:, 3], artefact.stations.rows, strict=True
    ):
        used = rows[model.used[rows]]
        inverse = np.linalg.pinv(columns[used])
        of = inverse @ whole[used]
        u = np.sqrt(np.diag(noise**2 * inverse @ inverse.T + of @ covariance @ of.T))
        rms, drift = float(np.sqrt(np.mean(residuals[used] ** 2))), float(station[4]) if len(station) > 4 else None
        each.append(Standpoint(which, len(used), station[:3] + tips[used[0]], float(station[3] + zero), drift, u, rms))
    return each


def _standpoints(result: Result) -> list[Standpoint]:
    noise = MICROMETRE * result.noise.coordinate.value * max(result.noise.wider, 1.0)
    covariance = np.atleast_2d(np.cov(result.values.T))
    return standpoints(result.model, result.estimate.linear, result.values.mean(axis=0), covariance, noise)


def _free(result: Result) -> list[Text]:
    """What is free, and no error of the machine."""
    artefact = cast("Multilateration", result.artefact)
    q, facts = len(artefact.stations.numbers), cast("MultilaterationFacts", result.job.facts.artefact)
    where = say(
        "the position of each station ({count} coordinates), and with it every motion of the whole machine", count=3 * q
    )
    free: list[Text] = [where, say("the dead path of each station ({count} in all)", count=q)]
    free += [say("how each dead path drifts, in proportion to time")] if facts.dead_path_drifts else []
    return free if artefact.sizes[0].certified else [*free, say("the scale of the interferometer")]


def _independent(result: Result) -> FreePoints | Text:
    facts = cast("MultilaterationFacts", result.job.facts.artefact)
    return free_points(cast("Multilateration", result.artefact), facts.u_scale_um_per_m, result.model.used)


def _left(result: Result, free: FreePoints) -> Floats:
    """Errors (t, 3) of targets, mm, as found by themselves less those of the fitted model, but for a motion of all."""
    values, count = result.values.mean(axis=0), len(result.artefact.sizes)
    modelled = result.model.errors(result.artefact.points.xyz, values[: len(values) - count])
    return free.errors - free.without_motion(np.array([modelled[rows].mean(axis=0) for rows in free.rows]))


def results(result: Result) -> dict[str, Any]:
    k, free, stations = result.noise.coverage_factor / MICROMETRE, _independent(result), []
    for one in _standpoints(result):
        told = {
            "measurement": one.measurement,
            "readings": one.readings,
            "residual_rms_um": one.residual_rms / MICROMETRE,
        }
        told |= {"position_mm": one.position.tolist(), "U_position_um": (k * one.u[:3]).tolist()}
        told |= {"dead_path_mm": one.dead_path, "U_dead_path_um": k * float(one.u[3])}
        if one.drift is not None:
            told |= {"drift_um_per_h": one.drift / MICROMETRE, "U_drift_um_per_h": k * float(one.u[4])}
        stations.append(told)
    data: dict[str, Any] = {"stations": stations, "free": [str(each) for each in _free(result)]}
    if isinstance(free, Text):
        return {**data, "targets": {"not_found": str(free)}}
    figures = {"error_um": free.errors, "U_um": free.expanded, "left_um": _left(result, free)}
    rows = zip(*((values / MICROMETRE).tolist() for values in figures.values()), strict=True)
    each = [
        {"point": point, **dict(zip(figures, row, strict=True))}
        for point, row in zip(free.point.tolist(), rows, strict=True)
    ]
    of = {
        "residual_sd_um": free.residual_sd / MICROMETRE,
        "degrees_of_freedom": free.degrees_of_freedom,
        "k": free.factor,
    }
    return {**data, "targets": {**of, "each": each}, "conditional": {"targets": "white noise"}}


def sections(result: Result) -> list[Section]:
    free = Paragraph(say("Free, and no error of the machine: {free}.", free=semicolons(_free(result))))
    stations = (_stations(result), free, _readings(result), residual_volume(result, say("targets")))
    alone = Section(say("Targets by the distances alone"), (_targets(result),))
    return [Section(say("Stations of the interferometer"), stations), alone]


def _stations(result: Result) -> Table:
    k, rows, drifts = result.noise.coverage_factor, [], []
    for one in _standpoints(result):
        U = k * one.u
        x, y, z, dead = (rounded(at, u)[0] for at, u in zip((*one.position, one.dead_path), U, strict=False))
        of_place, of_path = (rounded(0.0, float(u) / MICROMETRE)[1] for u in (U[:3].max(), U[3]))
        count, rms = number(one.readings), number(one.residual_rms / MICROMETRE, ".2f")
        rows.append((number(one.measurement), x, y, z, of_place, dead, of_path, count, rms))
        if one.drift is not None:
            drift, u = rounded(one.drift / MICROMETRE, U[4] / MICROMETRE)
            drifts.append(
                say(
                    "Measurement {measurement}: the dead path drifts by {drift} ± {U} µm/h.",
                    measurement=one.measurement,
                    drift=drift,
                    U=u,
                )
            )
    place, path, wide = unit("mm"), Column(say("Dead path"), unit("mm")), Column(Verbatim("U"), unit("µm"))
    heads = [*text_columns(say("Measurement")), *figure_columns(*map(Verbatim, "XYZ"), unit=place), wide, path, wide]
    heads += [*figure_columns(say("Readings")), Column(say("Residual (rms)"), unit("µm"))]
    note = say(
        "U (k = {k}): of the coordinate that is known least, and of the dead path; of the readings' noise and of the error "
        "factors. Positions are in the frame of the recording.",
        k=number(k, ".2f"),
    )
    return Table(say("Stations"), tuple(heads), tuple(rows), (note, *drifts))


def _readings(result: Result) -> Block:
    artefact = cast("Multilateration", result.artefact)
    away = artefact.points.xyz - artefact.found[artefact.stations.index, :3]
    off = (np.linalg.norm(away, axis=1) - artefact.distances) / MICROMETRE
    residuals, expanded = result.residuals / MICROMETRE, result.noise.expanded
    told = say("{count} readings: as recorded they deviate", count=len(off))
    return length_plot(
        artefact.measurement.astype(float),
        off,
        residuals,
        expanded_before_um=expanded,
        expanded_after_um=expanded,
        reference=say("distance from the best station"),
        flagged=result.flagged,
        position_label=say("Measurement"),
        caption=say(
            "Distances of indicated targets from the best place of their station less what was read, as recorded and after "
            "the fitted model, with U (k = {k}).",
            k=number(result.noise.coverage_factor, ".2f"),
        ),
        alternative=deviating(told, say("from the best station"), off, residuals),
    )


def _targets(result: Result) -> Block:
    free = _independent(result)
    if isinstance(free, Text):
        return Paragraph(say("Not found: {why}", why=free), tone="note")
    left, rows = _left(result, free), []
    for i, axis in enumerate(AXES):
        rms = [float(np.sqrt(np.mean(each[:, i] ** 2))) / MICROMETRE for each in (free.errors, left, free.expanded)]
        rows.append((Verbatim(axis.upper()), *(number(value, ".2f") for value in rms)))
    heads = figure_columns(say("Errors"), say("Left by the fitted model"), say("U"), unit=unit("µm"))
    note = say(
        "{count} targets, each read from {stations} stations or more, by distances alone, as if nothing were known of the "
        "machine; root mean squares. What moves all targets together is no error here. Residuals of {freedom} degrees of "
        "freedom have a standard deviation of {sd} µm. U (k = {k}) of one target, of white noise.",
        count=len(free.point),
        stations=STATIONS,
        freedom=free.degrees_of_freedom,
        k=number(free.factor, ".2f"),
        sd=number(free.residual_sd / MICROMETRE, ".2f"),
    )
    title = say("Errors of the targets along each axis")
    return Table(title, (*text_columns(say("Axis")), *heads), tuple(rows), (note,))


PAGE = Page(sections, results)
