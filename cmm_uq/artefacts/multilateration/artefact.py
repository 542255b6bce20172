"""Multilateration: a tracking interferometer reads how far a reflector on the ram is, from one station after another.

A reading is the distance of the reflector from the station, less a dead path. Where a station stands and its dead path are
free, so that neither a motion of the frame nor another zero is an error of the machine. The machine's positions, corrected
by its errors, stand for targets that nobody knows: one observation is what is left of one distance (Schwenke et al. 2005).

Stations in a plan and in the screening: a grid of targets in the volume, seen from places in and about it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from typing import cast

import numpy as np
from numpy.typing import NDArray

from cmm_uq.analysis.planning import candidates
from cmm_uq.analysis.planning.set_up import SetUp
from cmm_uq.analysis.planning.setting import Planning, Setting, Start, Volume
from cmm_uq.analysis.screening.shape import ArtefactShape, Screening, rows_by, samples_of, spread
from cmm_uq.artefacts.kinds import MultilaterationFacts
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, say, signed
from cmm_uq.base.points import AXES, Floats, Points
from cmm_uq.base.units import HOUR, METRE, MICROMETRE, unit
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.machine.model.artefact import Artefact, Placings, Size
from cmm_uq.machine.model.recorded import columns_needed, place
from cmm_uq.machine.physics.effects.drives import index_change
from cmm_uq.machine.physics.effects.rigid_body import tip_offsets
from cmm_uq.maths.inference.linear_model import Freedoms

# the recorded column; and that of the artefact's own points: they are where the machine would stand if just that were read
READING, IDEAL = "reading_mm", "_ideal_reading_mm"
LEAST = 6  # targets of a station: its place, its dead path, a constant of the first solution, and one to see it by
_ROUNDS, _SETTLED = 30, 1e-9  # mm
# singular value, over that of a spread of one, below which targets do not say where a station stands; rms misfit that no
# machine's errors explain: so many mm, and so much of the volume
_DEGENERATE, _STRAY_MM, _STRAY_RATIO = 1e-5, 0.5, 5e-3
_SAME_MM = 1e-3


def first_equations(xyz: Floats, readings: Floats) -> tuple[Floats, Floats]:
    """Linear ones (n, 5) of a station's place S, its dead path L and a constant: |p|² − d² = 2p·S + 2dL + (L² − |S|²)."""
    design = np.column_stack([2 * xyz, 2 * readings, np.ones(len(readings))])
    return design, np.sum(xyz**2, axis=1) - readings**2


def first_station(xyz: Floats, readings: Floats) -> Floats | None:
    """Place and dead path (4,) of a station that reads targets (n, 3), mm; ``None`` where they do not say it."""
    middle, zero = xyz.mean(axis=0), float(readings.mean())
    size = max(float(np.abs(xyz - middle).max()), _SAME_MM)
    design, given = first_equations((xyz - middle) / size, (readings - zero) / size)
    if len(design) < design.shape[1] or np.linalg.svd(design, compute_uv=False)[-1] < _DEGENERATE * np.sqrt(
        len(design)
    ):
        return None
    found = np.linalg.lstsq(design, given, rcond=None)[0]
    return np.append(size * found[:3] + middle, size * found[3] - zero)


def nearest_station(xyz: Floats, readings: Floats, drift: Floats, start: Floats) -> Floats:
    """Place, dead path and drift (4 + j,) that suit readings (n,) at targets (n, 3) best: Gauss–Newton.

    ``drift`` (n, j): what a distance grows by for one mm of drift.
    """
    found = np.append(start[:4], np.zeros(drift.shape[1]))
    for _ in range(_ROUNDS):
        away = xyz - found[:3]
        distance = np.maximum(np.linalg.norm(away, axis=1), _SETTLED)
        off = distance - (readings + found[3] + drift @ found[4:])
        design = np.column_stack([away / distance[:, None], np.ones(len(away)), drift])
        step = np.linalg.lstsq(design, off, rcond=None)[0]
        found = found + step
        if np.abs(step).max() < _SETTLED:
            break
    return np.asarray(found, dtype=np.float64)


class Multilateration(Artefact):
    """One observation a reading; one measurement is one station with one reflector.

    ``facts`` what the job says of the interferometer; ``points`` the recording, or the points of such an artefact, displaced.
    """

    kind = "multilateration"
    title = say("Tracking interferometer")

    def __init__(self, facts: MultilaterationFacts, points: Points, *, where: str | None = None) -> None:
        self._facts, self._where, count = facts, where, len(points)
        self.stations = Placings.of(points.measurement)
        self.drift = np.zeros((count, 0))
        if facts.dead_path_drifts:
            hours = columns_needed(points, ("time_s",), "drifting dead path", where) / HOUR
            self.drift = hours - self.stations.means(hours)
        if IDEAL not in points.columns:
            points = self._with_ideal(points)
        self.points, self.rows = points, np.arange(count)[:, None]
        self._known = (np.zeros((0, 3)), np.zeros((0, 3)))
        ideal = points.columns[IDEAL]
        self.found = self._nearest(points.xyz, ideal, self._first(points, ideal))
        self.distances = ideal + self.found[self.stations.index, 3]
        longest, stated = float(self.distances.max()), facts.u_scale_um_per_m
        sd = np.inf if stated is None else MICROMETRE * stated * longest / METRE
        title = say("Longest distance by the interferometer")
        self.sizes = (Size("length_mm", title, unit("mm"), longest, sd, title),)

    @property
    def set_up(self) -> Text:
        return say("Station of the interferometer")

    def _with_ideal(self, points: Points) -> Points:
        """The artefact's own points of a recording: moved along their beams by what each reading is off."""
        readings = columns_needed(points, (READING,), "tracking interferometer", self._where)[:, 0]
        offsets = zip(AXES, self._facts.optics_mm, strict=True)
        tips = np.column_stack([points.columns.get(f"tip_{a}_mm", np.full(len(points), at)) for a, at in offsets])
        several = np.any(np.abs(tips - self.stations.means(tips)) > _SAME_MM, axis=1)
        self._refuse(points, several, "has several offsets of the reflector", "Number each as a measurement of its own")
        start = self._first(points, readings)
        if not self._facts.air_corrected:
            path = np.linalg.norm(points.xyz - np.array(start)[self.stations.index, :3], axis=1)
            readings = readings - index_change(points) * path
        found = self._nearest(points.xyz, readings, start)
        away = points.xyz - found[self.stations.index, :3]
        distance = np.linalg.norm(away, axis=1)
        off = readings + found[self.stations.index, 3] - distance
        rms, most = (
            np.sqrt(self.stations.means(off**2)),
            _STRAY_MM + _STRAY_RATIO * np.linalg.norm(np.ptp(points.xyz, axis=0)),
        )
        what = f"has readings {rms.max():.3g} mm (rms) off what one station can read at these positions"
        fix = f"Look for another unit or sign of {READING} (mm, growing with the distance), or rows of another station"
        self._refuse(points, rms > most, what, fix)
        columns = {name: values for name, values in points.columns.items() if name != READING}
        columns |= {IDEAL: readings - off, **{f"tip_{a}_mm": tips[:, i] for i, a in enumerate(AXES)}}
        machine = replace(points.machine, tip_on_every_carriage=True)
        return replace(points, xyz=points.xyz - (off / distance)[:, None] * away, machine=machine, columns=columns)

    def _first(self, points: Points, readings: Floats) -> list[Floats]:
        found, more = [], "Read more of them, spread over all three axes, or leave the station out"
        for number, rows in zip(self.stations.numbers, self.stations.rows, strict=True):
            own, count = points.measurement == number, len(np.unique(np.round(points.xyz[rows] / _SAME_MM), axis=0))
            few = f"has {count} targets, and a station's place and dead path need {LEAST}"
            self._refuse(points, own & (count < LEAST), few, more)
            start = first_station(points.xyz[rows], readings[rows])
            flat = "has targets in one plane, that do not say where its station stands"
            self._refuse(points, own & (start is None), flat, more)
            found += [] if start is None else [start]
        return found

    def _refuse(self, points: Points, rows: NDArray[np.bool_], problem: str, fix: str) -> None:
        if np.any(rows):
            number = points.measurement[np.argmax(rows)]
            raise CmmUqError(f"measurement {number} {problem}", where=place(points, rows, self._where), fix=fix)

    def _nearest(self, xyz: Floats, distances: Floats, starts: list[Floats] | Floats) -> Floats:
        """Place, dead path and drift of every station (q, 4 + j)."""
        each = zip(self.stations.rows, starts, strict=True)
        return np.array([nearest_station(xyz[i], distances[i], self.drift[i], start) for i, start in each])

    def at(self, xyz: Floats, size: float) -> Floats:
        """The same of targets that are truly at ``xyz`` (n, 3), the longest distance being ``size``; of no recorded zero."""
        start = self.found * (np.arange(self.found.shape[1]) < 3)
        return self._nearest(xyz, self.distances * size / self.sizes[0].nominal, start)

    def fit(self, true_xyz: Floats, sizes: Floats) -> Floats:
        found = self.at(true_xyz, sizes[0])[self.stations.index]
        away = true_xyz - found[:, :3]
        beyond = found[:, 3] + np.sum(self.drift * found[:, 4:], axis=1)
        wanted = self.distances * sizes[0] / self.sizes[0].nominal + beyond
        return np.asarray(found[:, :3] + away * (wanted / np.linalg.norm(away, axis=1))[:, None])

    def beams(self, xyz: Floats) -> Floats:
        """Unit vectors (n, 3) from the stations, kept for points that nobody can change."""
        if self._known[0] is not xyz:
            away = xyz - self.at(xyz, self.sizes[0].nominal)[self.stations.index, :3]
            away /= np.linalg.norm(away, axis=1, keepdims=True)
            if xyz.flags.writeable:
                return away
            self._known = xyz, away
        return self._known[1]

    def project(self, xyz: Floats, displacement: Floats) -> Floats:
        return np.asarray(np.einsum("ni,nik->nk", self.beams(xyz), displacement), dtype=np.float64)

    def size_change(self) -> Floats:
        return np.asarray(self.distances[:, None] / self.sizes[0].nominal)

    def placing(self, xyz: Floats) -> Freedoms:
        """Of each station its place, its dead path and, where it may, how that drifts."""
        return self.stations.columns(np.column_stack([self.beams(xyz), np.ones(len(xyz)), self.drift]))

    def recorded(self, points: Points, xyz: Floats) -> Points:
        """The machine stands at its targets, and the interferometer reads how far they truly are."""
        stations, dead = self.found[self.stations.index, :3], self.found[self.stations.index, 3]
        away = points.xyz - stations
        away *= (self.distances / np.linalg.norm(away, axis=1))[:, None]
        path = np.linalg.norm(away + points.xyz - xyz, axis=1)
        change = 0.0 if self._facts.air_corrected else index_change(points) * path
        return replace(points, columns={**points.columns, READING: path - dead + change})


NEAR_MM = 100.0  # a target nearer to the station is not read: the beam could not follow
_CLOSE_MM, _HARDLY = 1e-3, 0.02


def _misfit(xyz: Floats, reference: Floats, _: float) -> Floats:
    """Reading less that of the one station, by sets of LEAST targets, that suits half of all targets best (Rousseeuw 1984)."""
    if len(xyz) < LEAST or not np.all(np.isfinite(reference)):
        return np.zeros(len(xyz))
    about, readings = xyz - xyz.mean(axis=0), reference[:, 0] - reference.mean()
    size = max(float(np.abs(about).max()), _CLOSE_MM)
    design, given = first_equations(about / size, readings / size)
    some = samples_of(len(xyz), LEAST)
    found = size * np.einsum("sij,sj->si", np.linalg.pinv(design[some]), given[some])
    off = np.abs(readings + found[:, 3:4] - np.linalg.norm(about - found[:, None, :3], axis=2))
    best = int(np.argmin(np.median(off, axis=1)))
    near = off[best] <= max(3 * float(np.median(off[best])), _CLOSE_MM)
    station = nearest_station(about[near], readings[near], np.zeros((near.sum(), 0)), found[best])
    again = np.abs(readings + station[3] - np.linalg.norm(about - station[:3], axis=1))
    return np.asarray(again if np.median(again) < np.median(off[best]) else off[best])


def shape_of(facts: ArtefactFacts, points: Points) -> ArtefactShape | None:
    """Targets whose distances are those of one station; ``None`` where distances hardly change from target to target."""
    if READING not in points.columns:
        return None
    reference = points.columns[READING][:, None]
    if np.ptp(reference) < _HARDLY * spread(points.xyz):  # in metres: what is wrong is not where the machine stood
        return None
    return ArtefactShape(rows_by(points.measurement), _misfit, np.nan, spread(points.xyz), False, (READING,), reference)


SCREENING = Screening(shape_of)


def _seen(targets: Points, station: Floats) -> SetUp:
    """Targets as they would be read from a place, in scale readings of the reflector, mm."""
    distance = np.linalg.norm(targets.machine_xyz + tip_offsets(targets) - station, axis=1)
    own = targets.select(distance > NEAR_MM)
    x, y, z = (signed(each, ".0f") for each in station.tolist())
    words = say("station at ({x}, {y}, {z})", x=x, y=y, z=z)
    name = IDEAL if IDEAL in targets.columns else READING
    return SetUp(words, replace(own, columns={**own.columns, name: distance[distance > NEAR_MM]}))


def _grid(setting: Setting) -> Points:
    """Targets in the whole volume: ``grid[0]`` along X and along Y, ``grid[1]`` along Z."""
    volume, (across, up) = setting.volume, setting.plan.grid
    lines = [np.linspace(low, high, count) for (low, high), count in zip(volume.box, (across, across, up), strict=True)]
    xyz = volume.machine.coordinates(np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, 3))
    repeats, n = setting.plan.repeats, len(xyz)
    tip = cast("MultilaterationFacts", setting.artefact).optics_mm
    columns = {f"tip_{a}_mm": np.full(n * repeats, offset) for a, offset in zip(AXES, tip, strict=True)}
    point, repeat = np.tile(np.arange(1, n + 1), repeats), np.repeat(np.arange(1, repeats + 1), n)
    return Points(np.tile(xyz, (repeats, 1)), np.ones_like(point), point, repeat, volume.machine, columns)


def _places(volume: Volume) -> Iterator[Floats]:
    """Where a station may stand: on the table, or raised beside the volume; not in the way of the ram."""
    for part in product((-0.15, 0.25, 0.5, 0.75, 1.15), (-0.15, 0.25, 0.5, 0.75, 1.15), (0.0, 0.25, 0.5, 0.75)):
        at, beside = volume.box[:, 0] + volume.size * part, abs(part[0] - 0.5) > 0.5 or abs(part[1] - 0.5) > 0.5
        if volume.heights[0] <= at[2] <= volume.heights[1] and (beside or not part[2]):
            yield at


def four_stations(setting: Setting) -> tuple[SetUp, ...]:
    """Three low corners beside the volume, and one that is raised: four that are not in one plane."""
    box, size, targets = setting.volume.box, setting.volume.size, _grid(setting)
    corners = ((-0.15, -0.15, 0.0), (1.15, -0.15, 0.0), (-0.15, 1.15, 0.0), (1.15, 1.15, 0.75))
    return tuple(_seen(targets, box[:, 0] + size * part) for part in corners)


def stations(setting: Setting, start: Start | None) -> tuple[SetUp, ...]:
    if start is not None and start.again is not None:
        return elsewhere(start.artefact, setting.volume, setting.plan.candidates)
    targets = _grid(setting)
    found = (_seen(targets, at) for at in _places(setting.volume))
    return candidates.thinned(found, setting.plan.candidates, setting.volume)


def elsewhere(artefact: Artefact, volume: Volume, count: int) -> tuple[SetUp, ...]:
    """The targets of the first recorded station, read once from other places."""
    points = cast("Multilateration", artefact).points
    first = points.select(points.measurement == points.measurement[0])
    found = (_seen(first.select(first.repeat == first.repeat.min()), at) for at in _places(volume))
    return candidates.thinned(found, count, volume)


PLANNING = Planning({"four stations": four_stations}, stations, elsewhere)
