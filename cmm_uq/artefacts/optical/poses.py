"""Poses that are planned for points seen by a tracker: within travels, clear of floor and boxes, in sight of the station.

Each pose is a set-up of its own; all are seen from one station, whose six freedoms they share. The best are chosen by
exchange, as set-ups of any kind (Borm, Menq, Int. J. Robot. Res. 10 (1991) 584: by the determinant of the identification
Jacobian).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from cmm_uq.analysis.planning.set_up import SetUp, append, split
from cmm_uq.analysis.planning.setting import Planning, Setting, Start
from cmm_uq.artefacts.kinds import PlateFacts
from cmm_uq.artefacts.optical.tracked import TrackedPoints, readings_within
from cmm_uq.artefacts.plate import REFERENCES
from cmm_uq.base.arm import Arm
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, Verbatim, in_a_row, say, signed
from cmm_uq.base.points import AXES, Floats, Points, reading_name
from cmm_uq.certificate.document import Plot
from cmm_uq.certificate.plots.machine import poses_plot
from cmm_uq.certificate.plots.volume import placing_pictures
from cmm_uq.jobs.tables.plan import PosesFacts
from cmm_uq.machine.physics.catalogue import every
from cmm_uq.maths.geometry.feature import nearest_rotations
from cmm_uq.maths.inference.linear_model import Freedoms

Bools = NDArray[np.bool_]
POSES = 50  # of a plan that does not say how many
HELD_OUT = 100  # poses beside those of a plan, at which it predicts
_FARTHER = 2.5  # times its travel over which readings are spread and cut, so that three of five lie at an end
_DRAWN = 40  # times as many poses as are sought that are drawn at most
_TOGETHER = 64  # poses that are drawn together at least
_ALONG = 32  # places along a link of which the distance from the beam is taken
_TURN = (0.0, 360.0)  # of a table without a travel, °


class PlannedPoses(TrackedPoints):
    """Poses, each a measurement by itself, seen from one station: that of the recording, where there is one."""

    def __init__(self, facts: PlateFacts, points: Points, *, where: str | None = None) -> None:
        points = in_its_frame(points)
        super().__init__(facts, replace(points, measurement=np.ones_like(points.measurement)), where=where)
        self.points = points

    def placing(self, xyz: Floats) -> Freedoms:
        """About the origin, wherever the middle of the poses is, so that the information of others adds."""
        turns = np.cross(np.eye(3)[None], xyz[:, None])
        both = np.concatenate([np.broadcast_to(np.eye(3), turns.shape), turns], axis=1).transpose(0, 2, 1)
        return self.placings.columns(np.einsum("nji,njk->nik", self.attitudes(xyz), both))


def in_its_frame(points: Points) -> Points:
    """Poses as the recorded station, a measurement of many, would see them; those of a plan alone along the machine's axes."""
    of_each = np.unique(np.column_stack([points.measurement, points.point]), axis=0)[:, 0]
    stations = [number for number in np.unique(of_each) if np.sum(of_each == number) > 1]
    if len(stations) > 1:
        problem, fix = "the recording has several stations, and poses are planned for one", "Set the others aside"
        raise CmmUqError(
            problem, where="job.toml [plan]", fix=f"{fix}: [recording] measurements_aside = [{stations[0]}]"
        )
    if not stations:
        return points
    there, seen = points.measurement == stations[0], np.column_stack([points.columns[name] for name in REFERENCES])
    middle, seen_middle = points.xyz[there].mean(axis=0), seen[there].mean(axis=0)
    turn = nearest_rotations(((points.xyz[there] - middle).T @ (seen[there] - seen_middle))[None])[0]
    seen[~there] = seen_middle + (points.xyz[~there] - middle) @ turn
    return replace(points, columns={**points.columns, **dict(zip(REFERENCES, seen.T, strict=True))})


def numbered(recorded: Points, planned: Points) -> Points:
    """Planned poses as the kind records them: points of one station, numbered on."""
    order = planned.measurement - planned.measurement.min() + 1
    if not len(recorded):
        return replace(planned, measurement=np.ones_like(order), point=order)
    both = in_its_frame(append(recorded, split(planned)))
    columns = {name: both.columns[name][len(recorded) :] for name in REFERENCES}
    station = np.full(len(order), recorded.measurement[0])
    return replace(
        planned, measurement=station, point=recorded.point.max() + order, columns={**planned.columns, **columns}
    )


def candidates(setting: Setting, start: Start | None = None) -> tuple[SetUp, ...]:
    """Half of them evenly within the travels, and half with three of five readings at an end of their travels."""
    count = setting.plan.candidates
    return (*even(setting, count - count // 2, 1), *even(setting, count // 2, 2, farther=_FARTHER))


def even(setting: Setting, count: int, seed: int, *, farther: float = 1.0) -> tuple[SetUp, ...]:
    """Poses spread over the travels that nothing stands in the way of; where there is none, an error that says what does."""
    limits = _limits(setting)
    wide = limits.mean(axis=1, keepdims=True) + farther * (limits - limits.mean(axis=1, keepdims=True))
    random, found, drawn, some = np.random.default_rng(seed), list[Floats](), 0, max(count, _TOGETHER)
    against = np.zeros(len(_WHY), dtype=np.int64)
    while sum(map(len, found)) < count and drawn < _DRAWN * some:
        readings = np.clip(readings_within(wide, some, int(random.integers(2**31))), *limits.T)
        blocked = _in_the_way(setting, readings)
        found.append(readings[~blocked.any(axis=0)])
        against, drawn = against + blocked.sum(axis=1), drawn + some
    readings = np.concatenate(found or [limits[:0].T])[:count]
    if count and not len(readings):
        said, fix = _WHY[int(np.argmax(against))]
        raise CmmUqError(
            f"no pose is possible: {against.max()} of {drawn} within the travels {said}",
            where="job.toml [plan]",
            fix=fix,
        )
    points, n = _points(setting, readings, random.choice([-1.0, 1.0], readings.shape)), setting.plan.repeats
    each = (points.select(np.full(n, row)) for row in range(len(points)))
    words = (in_a_row(signed(value, ".1f") for value in row) for row in readings.tolist())
    return tuple(
        SetUp(say("at {readings}", readings=row), replace(one, repeat=np.arange(1, n + 1)))
        for row, one in zip(words, each, strict=True)
    )


def _limits(setting: Setting) -> Floats:
    """(j, 2) lowest and highest readings; where no travel is stated those of the recording, of a table a turn."""
    machine, recorded, found = setting.machine, setting.recorded, list[Floats]()
    for axis in machine.joints if isinstance(machine, Arm) else machine.axes[3:]:
        limits = machine.limits_of(axis)[0]
        if np.isnan(limits).any() and recorded is not None:
            limits = np.array([recorded.readings[axis].min(), recorded.readings[axis].max()])
        elif np.isnan(limits).any():
            limits = np.array(machine.travel(axis) if isinstance(machine, Arm) else _TURN)
        found.append(limits)
    return np.array(found if isinstance(machine, Arm) else [*setting.volume.box, *found])


def _points(setting: Setting, readings: Floats, senses: Floats) -> Points:
    """At readings (n, j), as a tracker at the station sees them along the machine's axes.

    ``senses``: (n, j) −1 or +1 in which each shall move last, where an effect that is looked for asks for it.
    """
    machine, listed = setting.machine, (*(effect.name for effect in setting.named), *(setting.plan.rivals or ()))
    xyz, one = machine.coordinates(readings), np.ones(len(readings), dtype=np.int64)
    if isinstance(machine, Arm):
        axes, columns = machine.joints, dict(zip(machine.columns_of_joints, readings.T, strict=True))
    else:
        axes = machine.axes
        columns = {reading_name(axis): read for axis, read in zip(axes, readings.T, strict=True) if axis not in AXES}
    needed = {column for name in listed if name in every() for column in every()[name].columns}
    for axis, sense in zip(axes, senses.T, strict=True):
        columns |= {name: sense for name in (f"approach_{axis}", f"{axis}_approach") if name in needed}
    seen = xyz - np.array(setting.plan.poses.station_mm or [0.0, 0.0, 0.0])
    return Points(xyz, one, one, one, machine, columns | dict(zip(REFERENCES, seen.T, strict=True)))


_WHY = (
    ("leave volume_mm", "Widen volume_mm, or the travels"),
    ("go below the floor", "Lower [plan.poses] floor_mm, which counts along z of the base, or clearance_mm"),
    ("enter an obstacle", "Mend [[plan.poses.obstacle]], in the frame of the base, or clearance_mm"),
    ("turn the reflector away from the tracker", "Mend [plan.poses] station_mm or opening, or leave opening out"),
    ("hide the reflector from the tracker", "Mend [plan.poses] station_mm, obstacle or clearance_mm"),
)


def _in_the_way(setting: Setting, readings: Floats) -> Bools:
    """(5, n) which of the reasons in ``_WHY`` speak against each pose."""
    facts, points = setting.plan.poses, _points(setting, readings, np.ones_like(readings))
    machine, tool, box = points.machine, points.machine_xyz, setting.volume.box
    found = np.zeros((len(_WHY), len(tool)), dtype=bool)
    found[0] = np.any((tool < box[:, 0] - 1e-6) | (tool > box[:, 1] + 1e-6), axis=1)
    walls = [np.array([one.low_mm, one.high_mm]) for one in facts.obstacle]
    beam = None if facts.station_mm is None else np.array(facts.station_mm) - tool
    if beam is not None:
        found[4] = np.any([_enters(tool, beam, wall) for wall in walls], axis=0) if walls else False
    if not isinstance(machine, Arm):
        return found
    pose = machine.posed(points.columns)
    moves = np.ptp(pose.path, axis=0).max(axis=1) > 1e-6  # the base stands where it stands
    links = pose.path[:, :-1], np.diff(pose.path, axis=1)
    grown = facts.clearance_mm * np.array([[-1.0], [1.0]])
    if facts.floor_mm is not None:
        found[1] = np.any(pose.path[:, moves, 2] < facts.floor_mm + facts.clearance_mm, axis=1)
    for wall in walls:
        found[2] |= np.any(_enters(*links, wall + grown)[:, moves[1:] | moves[:-1]], axis=1)
    if beam is not None:
        length = np.linalg.norm(beam, axis=1)
        if facts.opening is not None:
            looks = pose.flange @ (np.array(facts.opening) / np.linalg.norm(facts.opening))
            found[3] = np.einsum("ni,ni->n", looks, beam) < np.cos(np.radians(facts.acceptance_deg)) * length
        found[4] |= _shaded(facts, links, tool, beam / length[:, None], length)
    return found


def _enters(start: Floats, step: Floats, box: Floats) -> Bools:
    """(...) whether start + t·step (..., 3), 0 ≤ t ≤ 1, is anywhere within a box (2, 3) of two corners (by slabs)."""
    with np.errstate(divide="ignore", invalid="ignore"):  # 0/0 on a face counts as within
        near, far = ((wall - start) / step for wall in box)
    low, high = np.fmin(near, far), np.fmax(near, far)
    beside = (step == 0) & ((start < box[0]) | (start > box[1]))
    low, high = (
        np.nan_to_num(low, nan=-np.inf, neginf=-np.inf, posinf=np.inf),
        np.nan_to_num(high, nan=np.inf, posinf=np.inf),
    )
    within = np.maximum(low.max(axis=-1), 0.0) <= np.minimum(high.min(axis=-1), 1.0)
    return np.asarray(within & ~beside.any(axis=-1))


def _shaded(facts: PosesFacts, links: tuple[Floats, Floats], tool: Floats, towards: Floats, length: Floats) -> Bools:
    """(n,) whether a link, as thick as the clearance, comes between the reflector and the station; not what holds it."""
    start, step = (each[:, :-1, None] for each in links)
    about = (start + np.linspace(0.0, 1.0, _ALONG)[:, None] * step).reshape(len(tool), -1, 3) - tool[:, None]
    along = np.einsum("nki,ni->nk", about, towards)
    off = np.linalg.norm(about - along[:, :, None] * towards[:, None], axis=2)
    between = (along > facts.clearance_mm) & (along < length[:, None])
    return np.asarray(np.any(between & (off < facts.clearance_mm), axis=1))


def pictures(setting: Setting, placings: Sequence[SetUp]) -> list[Plot]:
    """Of an arm all poses together, of other machines their points in the volume."""
    machine, facts = setting.machine, setting.plan.poses
    if not placings:
        return []
    points = setting.joined(placings)
    if not isinstance(machine, Arm):
        return placing_pictures([SetUp(say("All points"), points)], setting.volume.box, 1)
    walls = [np.array([one.low_mm, one.high_mm]) for one in facts.obstacle]
    station = None if facts.station_mm is None else np.array(facts.station_mm)
    return [poses_plot(machine.posed(points.columns).path, walls, station, facts.floor_mm)]


def notes(setting: Setting) -> tuple[Text, ...]:
    facts = setting.plan.poses
    stated = {"floor_mm": facts.floor_mm, "obstacle": facts.obstacle or None, "station_mm": facts.station_mm}
    missing = ", ".join(name for name, fact in stated.items() if fact is None)
    way = say("Looked at are poses alone: not the way from one to the next, nor whether links touch each other.")
    unstated = say("Not stated in [plan.poses], and not looked at: {keys}.", keys=Verbatim(missing))
    return (way, unstated) if missing else (way,)


PLANNING = Planning(
    {"even poses": lambda setting: even(setting, setting.plan.number or POSES, 3)},
    candidates,
    shared=True,
    observe=PlannedPoses,
    numbered=numbered,
    held_out=lambda setting: even(setting, HELD_OUT, 4),
    notes=notes,
    pictures=pictures,
)
