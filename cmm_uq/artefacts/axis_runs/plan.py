"""Runs along axes in a plan and in the screening: three axes through the middle of the volume, targets there and back."""

from __future__ import annotations

from dataclasses import replace
from typing import cast

import numpy as np

from cmm_uq.analysis.planning import candidates
from cmm_uq.analysis.planning.set_up import Pattern, SetUp, attitude_along, direction_words
from cmm_uq.analysis.planning.setting import Planning, Setting, Start, Volume
from cmm_uq.analysis.screening.shape import ArtefactShape, Screening, no_references, rows_by
from cmm_uq.artefacts.axis_runs.artefact import AxisRuns
from cmm_uq.artefacts.axis_runs.kind import READ, TURN
from cmm_uq.artefacts.axis_runs.run import FACE, FACE_ANGLE, READINGS
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Verbatim, say
from cmm_uq.base.points import Floats, Points
from cmm_uq.base.rotary import RotaryMachine
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.machine.model.artefact import Artefact

_SAME_MM, _STRAIGHT = 1e-6, 0.05  # part of a run's length, beyond which most positions are on no line


def _misfit(xyz: Floats, _: Floats, __: float) -> Floats:
    """Distance of each position from the line of its run, and from the targets that others were at as often."""
    middle = np.median(xyz, axis=0)
    travel = np.argmax(np.median(np.abs(xyz - middle), axis=0))
    steps = xyz[np.argmax(xyz[:, travel])] - xyz[np.argmin(xyz[:, travel])]
    best, steps_long = np.full(len(xyz), np.inf), float(np.linalg.norm(steps))
    for direction in (np.eye(3)[travel], steps / max(float(np.linalg.norm(steps)), _SAME_MM)):
        off = (xyz - middle) - np.outer((xyz - middle) @ direction, direction)
        off = np.linalg.norm(off - np.median(off, axis=0), axis=1)
        if np.median(off) < np.median(best):
            best = off
    if np.median(best) > _STRAIGHT * steps_long:
        return _off_circle(xyz)
    values, index, counts = np.unique(np.round(xyz[:, travel], 3), return_inverse=True, return_counts=True)
    alone = (counts == 1)[index.ravel()] & (len(values) < 0.6 * len(xyz))
    nearest = np.array([np.abs(np.delete(values, i) - v).min(initial=np.inf) for i, v in enumerate(values)])[
        index.ravel()
    ]
    return np.asarray(np.maximum(best, np.where(alone & np.isfinite(nearest), nearest, 0.0)))


def _off_circle(xyz: Floats) -> Floats:
    middle = np.median(xyz, axis=0)
    plane, keep = np.linalg.svd(xyz - middle, full_matrices=False)[2], np.ones(len(xyz), dtype=bool)
    for _ in range(3):
        flat = (xyz - middle) @ plane[:2].T
        found, *_ = np.linalg.lstsq(
            np.column_stack([flat, np.ones(len(flat))])[keep], np.sum(flat[keep] ** 2, axis=1), rcond=None
        )
        radius = np.sqrt(found[2] + found[:2] @ found[:2] / 4)
        off = np.hypot(np.linalg.norm(flat - found[:2] / 2, axis=1) - radius, (xyz - middle) @ plane[2])
        keep = off <= 3 * np.median(off) + _SAME_MM
    return np.asarray(off)


def shape_of(facts: ArtefactFacts, points: Points) -> ArtefactShape | None:
    rows = rows_by(points.measurement)
    extent = float(np.median([np.linalg.norm(np.ptp(points.xyz[each], axis=0)) for each in rows]))
    return ArtefactShape(rows, _misfit, np.nan, extent, reference=no_references(points)) if extent else None


SCREENING = Screening(shape_of)
_DEGREES = 5.0  # between targets on a circle
POLYGON = "polygon"
STEPS = 10  # between targets along each axis, where the plan does not say


def positioning(setting: Setting) -> tuple[SetUp, ...]:
    """Position along three lines through the middle of the volume (ISO 230-2)."""
    return tuple(_run(setting, axis, axis, turns=False) for axis in np.eye(3))


def all_errors(setting: Setting) -> tuple[SetUp, ...]:
    """The same lines: position, two straightnesses and three rotations of each."""
    return tuple(
        _run(setting, axis, sense, turns=turns) for axis in np.eye(3) for turns in (False, True) for sense in np.eye(3)
    )


def circles(setting: Setting) -> tuple[SetUp, ...]:
    """A circle in each plane through the middle of the volume, in both senses (ISO 230-4), read by a telescoping ballbar."""
    found = []
    for axis, name in zip(np.eye(3), ("YZ", "ZX", "XY"), strict=True):
        candidates.check_allowed(setting, axis)
        attitude = attitude_along(axis)[:, [1, 2, 0]]
        words = say("Circle in the plane {plane}, both senses", plane=Verbatim(name))
        found.append(setting.volume.set_up(circle_pattern(setting), attitude, candidates.MIDDLE, words))
    return tuple(found)


def circle_pattern(setting: Setting) -> Pattern:
    """Targets on a circle about the third axis, round and back."""
    plan = setting.plan
    radius = (plan.length_mm or float(setting.volume.size.min())) / 2
    there = np.radians(np.arange(0, 360, _DEGREES))
    at, way = np.concatenate([there, there[::-1]]), np.repeat([1.0, -1.0], len(there))
    outward = np.column_stack([np.cos(at), np.sin(at), 0 * at])
    travel = way[:, None] * np.column_stack([-np.sin(at), np.cos(at), 0 * at])
    vectors = {"approach": travel, "read": outward, "turn": 0 * outward}
    columns, n = {name: np.zeros(len(at)) for name in READINGS.values()}, len(at)
    return Pattern(radius * outward, np.arange(1, n + 1), np.ones(n, dtype=np.int64), columns, vectors).repeated(
        plan.repeats
    )


def _run(setting: Setting, axis: Floats, sense: Floats, *, turns: bool) -> SetUp:
    candidates.check_allowed(setting, axis)
    attitude, words, letter = attitude_along(axis), direction_words(axis), Verbatim("XYZ"[int(np.argmax(sense))])
    what = say("{words}, displacement read along {axis}", words=words, axis=letter)
    if turns:
        what = say("{words}, rotation read about {axis}", words=words, axis=letter)
    pattern = run_pattern(setting, setting.volume.chord(axis), attitude.T @ sense, turns=turns)
    return setting.volume.set_up(pattern, attitude, candidates.MIDDLE, what)


def run_pattern(setting: Setting, length: float, sense: Floats, *, turns: bool) -> Pattern:
    """Targets along the first axis, there and back."""
    plan = setting.plan
    pitch = plan.pitch_mm or (plan.length_mm or length) / STEPS
    out = pitch * np.arange(int(min(plan.length_mm or length, length) / pitch + 1e-9) + 1)
    at = np.concatenate([out, out[::-1]]) if plan.both_ways is not False else out
    n = len(at)
    body, travel = np.zeros((n, 3)), np.zeros((n, 3))
    body[:, 0], travel[:, 0] = at - 0.5 * out[-1], np.where(np.arange(n) < len(out), 1.0, -1.0)
    still, own = np.zeros((n, 3)), np.tile(sense, (n, 1))
    vectors = {"approach": travel, "read": still if turns else own, "turn": own if turns else still}
    columns = {name: np.zeros(n) for name in READINGS.values()}
    return Pattern(body, np.arange(1, n + 1), np.ones(n, dtype=np.int64), columns, vectors).repeated(plan.repeats)


def polygon(setting: Setting, *, shift: int = 0, part: float = 0.0) -> SetUp:
    """A polygon on the rotary table, its faces read by an autocollimator there and back.

    ``shift``: by how many faces it is turned against the table; ``part``: of a face by which it is turned besides.
    """
    machine, faces = setting.machine, setting.plan.faces
    if not isinstance(machine, RotaryMachine) or not machine.tables:
        fix = 'Give the table in [machine] chain, such as "XYZ|C"'
        raise CmmUqError(
            "a polygon stands on a rotary table, which the chain has not", where="job.toml [plan] ready", fix=fix
        )
    table = machine.tables[-1]
    limits = np.where(np.isnan(table.travel_deg), [0.0, 360.0], table.travel_deg)
    low = max(float(limits[0]), min(0.0, float(limits[1]) - 360.0))
    out = np.asarray(low + (np.arange(faces) + part) * 360.0 / faces, dtype=np.float64)
    out = out[out <= min(float(limits[1]), low + 360.0 - _SAME_MM)]
    if len(out) < 2:
        problem = f"the travel of {table.letter.upper()} shows fewer than two faces of a polygon of {faces}"
        raise CmmUqError(problem, where="job.toml [plan] faces", fix="Mend travel_deg, or take a polygon of more faces")
    at, way = np.append(out, out[::-1]), np.repeat([1.0, -1.0], len(out)).astype(np.float64)
    face = (np.tile(np.arange(len(out)), 2) + shift) % faces + 1.0
    face[len(out) :] = face[: len(out)][::-1]
    times, n = setting.plan.repeats, 2 * len(out)
    columns: dict[str, Floats] = {name: np.zeros(n) for name in (*READINGS.values(), *READ, *TURN)}
    turned = (TURN[table.about], np.ones(n)), (table.column, at), (f"{table.letter}_approach", way), (FACE, face)
    columns |= {name: np.asarray(values, dtype=np.float64) for name, values in turned}
    columns |= {FACE_ANGLE: np.zeros(n)} if getattr(setting.artefact, "u_polygon_arcsec", None) is not None else {}
    number, repeat = np.tile(np.arange(1, n + 1), times), np.repeat(np.arange(1, times + 1), n)
    place = np.tile(machine.pivot(table), (n * times, 1))
    whole = {name: np.tile(values, times) for name, values in columns.items()}
    words = say("Polygon turned by {angle:.4g}° against the table", angle=(shift + part) * 360.0 / faces)
    return SetUp(words, Points(place, np.ones(len(place), dtype=np.int64), number, repeat, machine, whole))


def polygons(setting: Setting) -> tuple[SetUp, ...]:
    """One setting of a polygon with certified faces; of another one two, a face apart, by which table and faces are parted."""
    known = getattr(setting.artefact, "u_polygon_arcsec", None) is not None
    return tuple(polygon(setting, shift=shift) for shift in ((0,) if known else (0, 1)))


def _candidates(setting: Setting, start: Start | None) -> tuple[SetUp, ...]:
    """Lines in the volume; of a polygon its faces at other angles of the table, and turned against it."""
    if setting.plan.ready != POLYGON:
        return _PLACES.candidates(setting, start)
    faces = setting.plan.faces
    shifts = sorted({round(i * faces / 4) % faces for i in range(4)} | {1})
    return setting.completed([polygon(setting, shift=s, part=part) for s in shifts for part in (0.0, 0.25, 0.5, 0.75)])


def _shape(setting: Setting) -> Pattern:
    length = setting.plan.length_mm or float(setting.volume.size.min())
    return run_pattern(setting, length, np.eye(3)[0], turns=False)


def elsewhere(artefact: Artefact, volume: Volume, count: int) -> tuple[SetUp, ...]:
    """The targets of a recorded run, displacements read along other lines."""
    run = cast("AxisRuns", artefact).runs[0]
    if run.table:
        return ()
    own = artefact.points.select(artefact.rows[run.rows, 0])
    along = {name: np.full(len(own), part) for name, part in zip(READ, run.travel, strict=True)}
    still = dict.fromkeys(TURN, np.zeros(len(own)))
    first = replace(own, columns={**own.columns, **along, **still}).select(own.repeat == own.repeat.min())
    pattern, attitude, _ = Pattern.of_recording(first)
    return _RELOCATED.like(pattern, attitude, volume, count)


_RELOCATED = candidates.RelocatedCandidates(candidates.along_lines)
_PLACES = candidates.VolumeCandidates(candidates.along_lines, _shape, _RELOCATED)
PLANNING = Planning(
    {"positioning": positioning, "all errors": all_errors, "circles": circles, POLYGON: polygons},
    _candidates,
    elsewhere,
)
