"""What a certificate shows of multilateration: stations, targets found without the machine, and what remains free.

Targets that four stations see, found from their distances alone: no error model, no coordinates but as a first guess.

Of a frame nothing is known: what a common motion of targets and stations would be, and without a stated scale a common growth
too, is taken to be none (least squares with inner constraints; Hughes et al. 2000).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from cmm_uq.artefacts.kinds import MultilaterationFacts
from cmm_uq.artefacts.multilateration.artefact import Multilateration
from cmm_uq.base.messages import Text, Verbatim, number, say, semicolons
from cmm_uq.base.points import AXES, Floats, Ints
from cmm_uq.base.units import METRE, MICROMETRE, unit
from cmm_uq.base.values import dataclass
from cmm_uq.certificate.document import Block, Column, Paragraph, Section, Table, figure_columns, section, table
from cmm_uq.certificate.plots.residuals import deviations_plot, residual_volume
from cmm_uq.certificate.result import Page, Result
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.model.noise import noise_of
from cmm_uq.machine.physics.effects.rigid_body import tip_offsets
from cmm_uq.maths.uncertainty.quantity import rounded
from cmm_uq.maths.uncertainty.type_a import coverage_factor

STATIONS, MOST = 4, 250  # that a target needs; targets that are solved
_SAME_MM, _SETTLED, _ROUNDS, _SINGULAR = 0.5, 1e-9, 6, 1e-7


@dataclass(frozen=True, eq=False)
class FreePoints:
    point: Ints  # (t,) numbers of the targets
    errors: Floats  # (t, 3) true minus indicated, mm, but for a motion of all
    covariance: Floats  # (3t, 3t) mm², of the readings' noise and of the scale as stated
    rows: tuple[Ints, ...]  # readings of each
    residual_sd: float  # mm
    degrees_of_freedom: int
    gauge: Floats  # (3t, 6 or 7) what is taken to be none, orthonormal

    @property
    def factor(self) -> float:
        """Coverage factor for 95 %: Student's t of the residuals."""
        return float(coverage_factor(self.degrees_of_freedom, 0.95))

    @property
    def expanded(self) -> Floats:
        """U (t, 3), mm."""
        return np.asarray(self.factor * np.sqrt(np.diag(self.covariance)).reshape(-1, 3))

    def without_motion(self, errors: Floats) -> Floats:
        """Errors (t, 3) of these targets but for a motion, as the readings have them."""
        flat = errors.ravel()
        return np.asarray((flat - self.gauge @ (self.gauge.T @ flat)).reshape(-1, 3))


def free_points(
    artefact: Multilateration, u_scale_um_per_m: float | None, used: NDArray[np.bool_] | None = None
) -> FreePoints | Text:
    """The targets, or why they cannot be found so; of readings (n,) that are used, by default all."""
    targets = _free_targets(artefact, np.ones(len(artefact.rows), dtype=bool) if used is None else used)
    if not targets:
        return say("No target was read from {count} stations.", count=STATIONS)
    count, rows = len(targets), np.concatenate(targets)
    of, station = np.repeat(np.arange(count), [len(each) for each in targets]), artefact.stations.index[rows]
    xyz, drift = artefact.points.xyz[rows], artefact.drift[rows]
    stations, own = np.unique(station, return_inverse=True)
    j, q = artefact.found.shape[1], len(stations)
    mean = np.array([artefact.points.xyz[each].mean(axis=0) for each in targets])
    gauge = _motions(mean, scale=u_scale_um_per_m is None)
    error, places, m = np.zeros((count, 3)), artefact.found[stations] * ([1, 1, 1] + [0] * (j - 3)), len(rows)
    for _ in range(_ROUNDS):
        away = xyz + error[of] - places[own, :3]
        distance = np.linalg.norm(away, axis=1)
        off = artefact.distances[rows] + places[own, 3] + np.sum(drift * places[own, 4:], axis=1) - distance
        beam, design = away / distance[:, None], np.zeros((m, 3 * count + j * q))
        for k in range(3):
            design[np.arange(m), 3 * of + k] = beam[:, k]
        for k, column in enumerate(np.column_stack([-beam, -np.ones(m), -drift]).T):
            design[np.arange(m), 3 * count + j * own + k] = column
        whole = np.vstack([design, np.hstack([gauge.T, np.zeros((gauge.shape[1], j * q))])])
        freedom = m + gauge.shape[1] - whole.shape[1]
        U, s, Vt = np.linalg.svd(whole, full_matrices=False)
        if freedom < 1 or s[-1] < _SINGULAR * s[0]:
            return say("{count} targets and {stations} stations do not determine each other.", count=count, stations=q)
        inverse = (Vt.T / s) @ U[:m].T
        step = inverse @ off
        error, places = error + step[: 3 * count].reshape(-1, 3), places + step[3 * count :].reshape(-1, j)
        if np.abs(step).max() < _SETTLED:
            break
    sd = float(np.sqrt(np.sum((off - design @ step) ** 2) / freedom))
    covariance = sd**2 * inverse[: 3 * count] @ inverse[: 3 * count].T
    if u_scale_um_per_m is not None:
        growth = (MICROMETRE / METRE * u_scale_um_per_m * (mean - mean.mean(axis=0))).ravel()
        covariance += np.outer(growth, growth)
    numbers = artefact.points.point[[each[0] for each in targets]]
    return FreePoints(numbers, error, covariance, tuple(targets), sd, freedom, gauge)


def _free_targets(artefact: Multilateration, used: NDArray[np.bool_]) -> list[Ints]:
    """Readings of each target that enough stations read with one reflector at one place, evenly chosen where they are many."""
    points = artefact.points
    key = np.column_stack([points.point, tip_offsets(points).round(3)])
    index = np.unique(key, axis=0, return_inverse=True)[1].ravel()
    found = [np.flatnonzero((index == i) & used) for i in range(index.max() + 1)]
    seen = [
        rows
        for rows in found
        if len(np.unique(points.measurement[rows])) >= STATIONS and np.ptp(points.xyz[rows], axis=0).max() < _SAME_MM
    ]
    return [seen[i] for i in np.unique(np.linspace(0, len(seen) - 1, min(MOST, len(seen))).round().astype(int))]


def _motions(xyz: Floats, *, scale: bool) -> Floats:
    """Orthonormal columns (3t, 6 or 7) of what a motion, and a growth, does to places (t, 3)."""
    about = xyz - xyz.mean(axis=0)
    columns = [*(np.tile(axis, (len(xyz), 1)) for axis in np.eye(3)), *(np.cross(axis, about) for axis in np.eye(3))]
    columns += [about] if scale else []
    return np.asarray(np.linalg.qr(np.column_stack([column.ravel() for column in columns]))[0])


class Standpoint(NamedTuple):
    measurement: int
    readings: int
    position: Floats  # (3,) in the recording's frame, mm
    dead_path: float  # that the readings lack, mm
    drift: float | None  # of it, mm/h
    u: Floats  # (4 or 5,) of position, dead path and drift, mm, mm/h
    residual_rms: float  # mm


def standpoints(
    model: RecordingModel,
    values: Floats,
    covariance: Floats,
    sigma: float,
    whiten: Callable[[Floats], Floats] = np.asarray,
) -> list[Standpoint]:
    """Stations where parameters (k,) with their covariance put them.

    ``whiten``: what makes the noise of columns (m, r) white, of standard deviation ``sigma``, mm.
    """
    artefact, residuals, true = cast("Multilateration", model.artefact), model.residuals(values), model.placed(values)
    found, tips, used = artefact.at(true, values[-1]), tip_offsets(artefact.points), model.used
    inverse = np.linalg.pinv(whiten(artefact.placing(true).at(used).dense()))
    found = found + (inverse @ whiten(residuals[used, None])).reshape(found.shape)
    found[:, 3] += artefact.found[:, 3] * values[-1] / artefact.sizes[0].nominal
    of = inverse @ whiten(model.estimate().linear.design)
    u = np.sqrt(np.diag(sigma**2 * inverse @ inverse.T + of @ covariance @ of.T)).reshape(found.shape)
    each = []
    for i, rows in enumerate(artefact.stations.rows):
        own, which = rows[used[rows]], int(artefact.stations.numbers[i])
        rms, drift = float(np.sqrt(np.mean(residuals[own] ** 2))), float(found[i, 4]) if len(found[i]) > 4 else None
        each.append(Standpoint(which, len(own), found[i, :3] + tips[rows[0]], float(found[i, 3]), drift, u[i], rms))
    return each


def _free(result: Result) -> list[Text]:
    artefact = cast("Multilateration", result.artefact)
    q, facts = len(artefact.stations.numbers), cast("MultilaterationFacts", result.job.facts.artefact)
    where = say(
        "the position of each station ({count} coordinates), and with it every motion of the whole machine", count=3 * q
    )
    free: list[Text] = [where, say("the dead path of each station ({count} in all)", count=q)]
    free += [say("how each dead path drifts, in proportion to time")] if facts.dead_path_drifts else []
    return free if artefact.sizes[0].certified else [*free, say("the scale of the interferometer")]


def results(result: Result) -> dict[str, Any]:
    k, stations, covariance = result.noise.coverage_factor / MICROMETRE, [], np.atleast_2d(np.cov(result.values.T))
    values, sizes = result.values.mean(axis=0), result.posterior.sizes.typical
    whiten = noise_of(result.model).white(sizes)
    for one in standpoints(result.model, values, covariance, float(sizes.coordinate[0]), whiten):
        told = {"measurement": one.measurement, "position_mm": one.position.tolist(), "dead_path_mm": one.dead_path}
        told |= {"U_position_um": (k * one.u[:3]).tolist(), "U_dead_path_um": k * float(one.u[3])}
        if one.drift is not None:
            told |= {"drift_um_per_h": one.drift / MICROMETRE, "U_drift_um_per_h": k * float(one.u[4])}
        stations.append({**told, "readings": one.readings, "residual_rms_um": one.residual_rms / MICROMETRE})
    data: dict[str, Any] = {"stations": stations, "free": [str(each) for each in _free(result)]}
    artefact, facts = cast("Multilateration", result.artefact), cast("MultilaterationFacts", result.job.facts.artefact)
    free = free_points(artefact, facts.u_scale_um_per_m, result.model.used)
    if isinstance(free, Text):
        return {**data, "targets": {"not_found": free}}
    modelled = result.model.errors(artefact.points.xyz, values[: -len(artefact.sizes)])
    left = free.errors - free.without_motion(np.array([modelled[rows].mean(axis=0) for rows in free.rows]))
    told = {"residual_sd_um": free.residual_sd / MICROMETRE, "degrees_of_freedom": free.degrees_of_freedom}
    figures = [free.point, *(each / MICROMETRE for each in (free.errors, free.expanded, left))]
    rows = zip(*(each.tolist() for each in figures), strict=True)
    each = [dict(zip(("point", "error_um", "U_um", "left_um"), row, strict=True)) for row in rows]
    return {**data, "targets": {**told, "k": free.factor, "each": each}, "conditional": {"targets": "white noise"}}


def sections(result: Result) -> list[Section]:
    data = results(result)
    free = Paragraph(say("Free, and no error of the machine: {free}.", free=semicolons(_free(result))))
    stations = _stations(data["stations"], result.noise.coverage_factor)
    volume = residual_volume(result, say("targets"))
    return [
        section(say("Stations of the interferometer"), stations, free, _readings(result), volume),
        section(say("Targets by the distances alone"), _targets(data["targets"])),
    ]


def _stations(stations: list[dict[str, Any]], k: float) -> Table | None:
    rows, drifts = [], []
    for one in stations:
        which, expanded = number(one["measurement"]), [*one["U_position_um"], one["U_dead_path_um"]]
        figures = zip((*one["position_mm"], one["dead_path_mm"]), expanded, strict=True)
        x, y, z, path = (rounded(value, MICROMETRE * U)[0] for value, U in figures)
        of_place, of_path = (rounded(0.0, U)[1] for U in (max(expanded[:3]), expanded[3]))
        last = number(one["readings"]), number(one["residual_rms_um"], ".2f")
        rows.append((which, x, y, z, of_place, path, of_path, *last))
        if "drift_um_per_h" in one:
            drift, U = rounded(one["drift_um_per_h"], one["U_drift_um_per_h"])
            words = say(
                "Measurement {which}: the dead path drifts by {drift} ± {U} µm/h.", which=which, drift=drift, U=U
            )
            drifts.append(words)
    note = say(
        "U (k = {k}): of the coordinate that is known least, and of the dead path; of the readings' noise and of the error "
        "factors. Positions are in the frame of the recording.",
        k=number(k, ".2f"),
    )
    wide, dead = Column(Verbatim("U"), unit("µm")), Column(say("Dead path"), unit("mm"))
    return table(
        say("Stations"),
        [say("Measurement"), *figure_columns(*map(Verbatim, "XYZ"), unit=unit("mm")), wide, dead, wide,
         Column(say("Readings")), Column(say("Residual (rms)"), unit("µm"))], rows, note, *drifts,
    )  # fmt: skip


def _readings(result: Result) -> Block:
    artefact = cast("Multilateration", result.artefact)
    away = artefact.points.xyz - artefact.found[artefact.stations.index, :3]
    caption = say(
        "Distances of indicated targets from the best place of their station less what was read, as recorded and after "
        "the fitted model, with U (k = {k}).",
        k=number(result.noise.coverage_factor, ".2f"),
    )
    off = (np.linalg.norm(away, axis=1) - artefact.distances) / MICROMETRE
    return deviations_plot(
        result, off, say("{count} readings: as recorded they deviate", count=len(off)), say("from the best station"),
        reference=say("distance from the best station"), position_label=say("Measurement"), caption=caption,
    )  # fmt: skip


def _targets(targets: dict[str, Any]) -> Block | None:
    if "not_found" in targets:
        return Paragraph(say("Not found: {why}", why=targets["not_found"]), tone="note")
    names, rows = ("error_um", "left_um", "U_um"), []
    for i, axis in enumerate(AXES):
        rms = [float(np.sqrt(np.mean([one[name][i] ** 2 for one in targets["each"]]))) for name in names]
        rows.append((Verbatim(axis.upper()), *(number(value, ".2f") for value in rms)))
    figures = figure_columns(say("Errors"), say("Left by the fitted model"), say("U"), unit=unit("µm"))
    note = say(
        "{count} targets, each read from {stations} stations or more, by distances alone, as if nothing were known of the "
        "machine; root mean squares. What moves all targets together is no error here. Residuals of {freedom} degrees of "
        "freedom have a standard deviation of {sd} µm. U (k = {k}) of one target, of white noise.",
        count=len(targets["each"]), stations=STATIONS, freedom=targets["degrees_of_freedom"],
        k=number(targets["k"], ".2f"), sd=number(targets["residual_sd_um"], ".2f"),
    )  # fmt: skip
    return table(say("Errors of the targets along each axis"), [say("Axis"), *figures], rows, note)


PAGE = Page(sections, results)
