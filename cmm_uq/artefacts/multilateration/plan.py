"""Stations in a plan and in the screening: a grid of targets in the volume, seen from places in and about it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from typing import cast

import numpy as np

from cmm_uq.analysis.planning import candidates
from cmm_uq.analysis.planning.set_up import SetUp
from cmm_uq.analysis.planning.setting import Planning, Setting, Start, Volume
from cmm_uq.analysis.screening.shape import ArtefactShape, Screening, rows_by, samples_of, spread
from cmm_uq.artefacts.kinds import MultilaterationFacts
from cmm_uq.artefacts.multilateration.artefact import (
    IDEAL,
    LEAST,
    READING,
    Multilateration,
    first_equations,
    nearest_station,
)
from cmm_uq.base.messages import say, signed
from cmm_uq.base.points import AXES, Floats, Points
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.machine.model.artefact import Artefact
from cmm_uq.machine.physics.effects.rigid_body import tip_offsets

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
