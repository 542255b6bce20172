"""Where a robot's tool truly is at poses that it was not measured at, and what its joints are to be told for it to be there.

By rows, tool and all other named errors as the recording has them, exact kinematics, drawn from what stays uncertain:

    place = placing ∘ tool(rows + change(q), q)          u² = u²(parameters, placing) + s²

s being what the fitted robot leaves at a pose (:mod:`cmm_uq.artefacts.optical.pose_noise`). Readings are corrected by
Newton steps on place and, by what freedom that leaves, attitude of the flange (task priority: Nakamura, Hanafusa, Yoshikawa,
Int. J. Robot. Res. 6 (1987) 3), so that both are those that the rows of the job have at the readings commanded.
"""

from __future__ import annotations

from typing import cast

import numpy as np
from scipy.special import stdtrit

from cmm_uq.artefacts.kinds import TrackedFacts
from cmm_uq.artefacts.optical.pose_noise import reaches
from cmm_uq.artefacts.optical.tracked import TrackedPoints, noise_by_pose
from cmm_uq.base.arm import THETA, Arm, D
from cmm_uq.base.points import Floats, Ints, Points
from cmm_uq.base.units import METRE
from cmm_uq.base.values import dataclass, replace
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.physics.superposition import Superposition
from cmm_uq.maths.geometry.feature import nearest_rotations
from cmm_uq.maths.inference.posterior import Density

DRAWS = 500
_ROUNDS, _SETTLED = 20, 1e-6  # mm of a step, within which readings are found
_SINGULAR = 1e-3  # part of the largest singular value of the joints' Jacobian below which a direction is not commanded
_SINGULAR_TURN = 0.02  # the same of what turns the flange
_LARGEST = 2.0  # ° or mm; where attitude needs more of a joint, near a singular pose, the place alone is corrected


@dataclass(frozen=True, eq=False)
class CorrectedPoses:
    xyz: Floats  # (n, 3) where the tool is at the readings commanded, in the frame of the base, mm
    covariance: Floats  # (n, 3, 3) of that with what is left at a pose, mm²
    degrees: float  # of freedom of what is left at a pose
    readings: Floats  # (n, j) corrected ones, ° or mm
    left: Floats  # (n,) distance from the place that the rows of the job have, with the corrected readings, mm
    uncorrected: Floats  # (n,) the same with those commanded

    @property
    def u(self) -> Floats:
        """(n, 3) mm."""
        return np.asarray(np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2)))

    @property
    def coverage_factor(self) -> float:
        """Of 95 % intervals of a coordinate."""
        return float(stdtrit(self.degrees, 0.975))


@dataclass(frozen=True, eq=False)
class _Carried:
    """From the frame in which an arm's base stands to that in which places are given."""

    turn: Floats  # (3, 3)
    middle: Floats  # (3,) of the recorded places, mm
    to: Floats  # (3,) where that is carried to, mm

    def __call__(self, xyz: Floats) -> Floats:
        return np.asarray((xyz - self.middle) @ self.turn.T + self.to)


def corrected_poses(model: RecordingModel, points: Points) -> CorrectedPoses:
    """By the named model of a robot that a tracker measured, of ``points`` as commanded."""
    tracked = cast("TrackedPoints", model.artefact)
    noise, linear, at = noise_by_pose(model), model.estimate().linear, tracked.rows[model.used, 0]
    scale = noise.scale(reaches(tracked.points))
    weighed = replace(linear, noise_scale=linear.noise_scale * scale[at], sigma=noise.sigma)
    mean, covariance, _ = Density(weighed).conditional(float(np.log(noise.sigma)))
    rows = _station(tracked, at)
    weights = 1 / scale[rows] ** 2
    seen = tracked.points.select(rows)
    acting, sizes = Superposition(model.effects, model.shapes), len(tracked.sizes)

    def carried(values: Floats) -> _Carried:
        """From the base of an arm of these parameters to the middle of what the tracker saw."""
        body, own = tracked.shape(values[len(values) - sizes :])[rows], _tool(acting, seen, values, sizes)
        middle, own_middle = (np.average(each, axis=0, weights=weights) for each in (body, own))
        moment = (body - middle).T @ (weights[:, None] * (own - own_middle))
        return _Carried(nearest_rotations(moment[None])[0], own_middle, np.zeros(3))

    here = carried(mean)
    if cast("TrackedFacts", tracked._facts).frame == "base":
        whole = tracked.reference * tracked.expansion[:, None]
        back = _Carried(np.eye(3), np.zeros(3), np.average(whole[rows], axis=0, weights=weights))
        to_base = replace(here, to=back.to)
    else:
        back = _Carried(here.turn.T, np.zeros(3), here.middle)
        to_base = _Carried(np.eye(3), np.zeros(3), np.zeros(3))

    random = np.random.default_rng(0)
    values, vectors = np.linalg.eigh(covariance)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    about = here(_tool(acting, seen, mean, sizes))
    placing = _placing_root(about, weights, noise.sigma)
    exact = _tool(acting, points, mean, sizes)
    at_mean, total, squares = here(exact), np.zeros((len(points), 3)), np.zeros((len(points), 3, 3))
    for _ in range(DRAWS):
        drawn = mean + root @ random.standard_normal(len(root.T))
        there = carried(drawn)(_tool(acting, points, drawn, sizes))
        moved = placing @ random.standard_normal(6)
        off = there + moved[:3] + np.cross(moved[3:], there) - at_mean
        total += off
        squares += off[:, :, None] * off[:, None]
    found = (squares - total[:, :, None] * total[:, None] / DRAWS) / (DRAWS - 1)
    found = back.turn @ found @ back.turn.T
    left = (noise.sigma * noise.scale(reaches(points))) ** 2
    found += left[:, None, None] * np.eye(3)
    readings, missed, before = _commanded(acting, points, mean, sizes, to_base)
    return CorrectedPoses(to_base(exact), found, noise.degrees, readings, missed, before)


def _station(tracked: TrackedPoints, used: Ints) -> Ints:
    """Rows of the station that has most points of which all coordinates are used."""
    whole = np.flatnonzero(np.bincount(used, minlength=len(tracked.points)) == 3)
    numbers, counts = np.unique(tracked.points.measurement[whole], return_counts=True)
    return np.asarray(whole[tracked.points.measurement[whole] == numbers[np.argmax(counts)]])


def _tool(acting: Superposition, points: Points, values: Floats, sizes: int) -> Floats:
    """(n, 3) where parameters (k,) have the tool, in the frame of the base that the arm has with them, mm."""
    return np.asarray(points.xyz + acting.errors(points, values[: len(values) - sizes]))


def _placing_root(places: Floats, weights: Floats, sigma: float) -> Floats:
    """(6, 6) factor of the covariance of a shift and a turn, by places (n, 3) about their middle."""
    turns = np.cross(np.eye(3)[None], places[:, None]).transpose(0, 2, 1)
    columns = np.concatenate([np.broadcast_to(np.eye(3), turns.shape), turns], axis=2)
    information = np.einsum("n,nik,nil->kl", weights / sigma**2, columns, columns)
    values, vectors = np.linalg.eigh(information)
    return np.asarray(vectors / np.sqrt(values))


def _commanded(
    acting: Superposition, points: Points, values: Floats, sizes: int, to_base: _Carried
) -> tuple[Floats, Floats, Floats]:
    """Readings (n, j) that bring tool and flange to where the rows of the job have them; what is missed (n,), and was, mm."""
    arm = cast("Arm", points.machine)
    start = np.column_stack([points.columns[name] for name in arm.columns_of_joints])
    target, attitude = points.xyz, arm.posed(points.columns).flange
    units = arm.sense * np.where(arm.revolute, np.pi / 180, 1.0)
    which = 5 * np.arange(len(arm.rows)) + np.where(arm.revolute, THETA, D)
    read, before, whole = start.copy(), np.zeros(len(points)), np.ones(len(points), dtype=bool)
    for turn in range(_ROUNDS):
        columns = {**points.columns, **dict(zip(arm.columns_of_joints, read.T, strict=True))}
        here = replace(points, columns=columns, xyz=arm.posed(columns).tool - arm.origin_mm)
        missed = to_base(_tool(acting, here, values, sizes)) - target
        if not turn:
            before = np.linalg.norm(missed, axis=1)
        true = cast("Arm", acting.about(here, values[: len(values) - sizes]).points.machine)
        pose = true.posed(columns)
        turned = to_base.turn @ pose.flange
        away = 0.5 * np.cross(attitude, turned, axis=1).sum(axis=2)  # small turn from the attitude wanted
        moves = to_base.turn @ pose.jacobian[:, :, which]
        about = np.where(arm.revolute[:, None], pose.axes[:, np.arange(len(arm.rows)), which % 5], 0.0)
        about = to_base.turn @ about.transpose(0, 2, 1)
        step = np.array([_step(*each) for each in zip(moves, about, -missed, -away, whole, strict=True)]) / units
        far = whole & (np.abs(read + step - start).max(axis=1) > _LARGEST)  # near a pose that no joints reach otherwise
        whole &= ~far
        step = np.where(far[:, None], start - read, step)
        read = read + step
        if np.abs(step * units).max() * METRE < _SETTLED:
            break
    return read, np.linalg.norm(missed, axis=1), before


def _step(moves: Floats, about: Floats, shift: Floats, turn: Floats, whole: bool) -> Floats:
    """(j,) that shifts the tool and, by what freedom that leaves, turns the flange where ``whole``."""
    inverse = np.linalg.pinv(moves, rcond=_SINGULAR)
    first = inverse @ shift
    if not whole:
        return np.asarray(first)
    free = np.eye(len(first)) - inverse @ moves
    return np.asarray(first + np.linalg.pinv(about @ free, rcond=_SINGULAR_TURN) @ (turn - about @ first))
