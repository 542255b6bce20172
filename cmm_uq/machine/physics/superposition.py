"""Errors of several effects at once: displacements add up, on axes that lean as their squarenesses say.

To first order every effect acts as if the others were not there. Squareness errors of hundreds of seconds are too large for
that: their squares and products, and theirs with scale errors, are parts per million. So they act together, without
approximation: each carriage moves along the unit vector of ``axis_directions``, by what its scale reads and errs (effects
``along_motion``), and rotations act on what the leaning motions carry. So do errors of the rows of an arm, whose tool is where
the chain of all changed rows has it. Everything else is added.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from cmm_uq.base.arm import Arm
from cmm_uq.base.points import AXES, Floats, Ints, Points
from cmm_uq.base.values import dataclass, field, replace
from cmm_uq.machine.physics import kinematics
from cmm_uq.machine.physics.effect import ARTEFACT, Effect
from cmm_uq.machine.physics.effects.joints import OfRows, arm_of
from cmm_uq.machine.physics.kinematics import SQUARENESSES, along_directions, axis_directions, leaning

_SETTLED = 1e-9  # mm
_ROUNDS = 50


@dataclass(frozen=True, eq=False)
class About:
    """Where the columns of effects that act together are taken, found once for all of them."""

    points: Points  # as indicated, with the directions of the motions where they lean
    # (3, ..., 3, 3) of those directions by the squarenesses; ``None`` where columns of these are to first order.
    change: Floats | None = None

    def columns(self, effect: Effect, shape: Sequence[float] = ()) -> Floats:
        """Change of e, (n, 3, j) in mm, for one unit of each coefficient of one effect, named in the model or not."""
        basis, directions = effect.basis(self.points, shape), self.points.directions
        if directions is not None and effect.along_motion is not None:  # of an axis that leans
            axis = AXES.index(effect.along_motion)
            basis = np.asarray(directions[..., axis, :, None] * basis[:, axis : axis + 1])
        if effect.mechanism == ARTEFACT:
            return self.points.machine.turned(basis, self.points.columns)
        if self.change is None or not effect.plane:
            return basis
        turned = along_directions(self.points.carriages, self.change[SQUARENESSES.index(str(effect.plane))])
        found = basis.copy()
        found[:, :, 0] = (turned.T * effect.lean(self.points)).T
        return found

    def motion(self, effect: Effect) -> tuple[Floats, Floats] | None:
        """Of an effect along one motion, that is straight: its direction (3,), and how far each point moves (n, j), mm."""
        directions, straight = self.points.directions, self.points.machine.axes == tuple(AXES)
        if effect.along_motion is None or not straight or (directions is not None and directions.ndim > 2):
            return None
        axis = AXES.index(effect.along_motion)
        return (np.eye(3) if directions is None else directions)[axis], effect.travelled(self.points)

    def select(self, rows: Ints) -> About:
        """Of some of the points."""
        change = self.change if self.change is None or self.change.ndim == 3 else self.change[:, rows]
        return About(self.points.select(rows), change)


@dataclass(frozen=True, eq=False)
class Superposition:
    effects: tuple[Effect, ...]  # in the order of their coefficients
    shapes: Mapping[str, Sequence[float]] = field(default_factory=dict)  # nonlinear parameters by the effect's name

    def errors(self, points: Points, coefficients: Floats) -> Floats:
        """Errors e (n, 3), mm, of points as indicated, for coefficients (k,)."""
        arm = self._arm(points, coefficients)
        if arm is not None:
            of_rows = np.array([isinstance(effect, OfRows) for effect in self.effects for _ in effect.coefficients])
            others = self._sum(About(points), np.where(of_rows, 0.0, coefficients))
            columns = points.columns
            return np.asarray(others + arm.posed(columns).tool - arm_of(points).posed(columns).tool, dtype=np.float64)
        squareness = self._squareness(points, coefficients)
        if squareness is None:
            return self._sum(About(points), coefficients)
        directions = axis_directions(squareness)
        e = self._sum(About(replace(points, directions=directions)), np.where(self.leans, 0.0, coefficients))
        return np.asarray(e + leaning(points.carriages, directions), dtype=np.float64)

    def _sum(self, about: About, coefficients: Floats) -> Floats:
        """(n, 3) of all effects to first order, one after the other: columns of all together are hundreds of megabytes."""
        e, start = np.zeros((len(about.points), 3)), 0
        for effect in self.effects:
            own = coefficients[start : (start := start + len(effect.coefficients))]
            if own.any():
                e += about.columns(effect, self.shapes.get(effect.name, ())) @ own
        return e

    def about(self, true: Points, coefficients: Floats) -> About:
        """Where columns are linear about coefficients (k,).

        ``true``: points where they truly are; their columns are taken where a machine would indicate them that has these
        squarenesses and no other error. The columns of three scale errors then add up to the place itself.
        """
        arm = self._arm(true, coefficients)
        if arm is not None:
            return About(replace(true, machine=arm))
        squareness = self._squareness(true, coefficients)
        if squareness is None:
            return About(true)
        directions = axis_directions(squareness)
        indicated = replace(_indicated(true, directions), directions=directions)
        return About(indicated, kinematics.direction_derivatives(squareness))

    def derivatives(self, about: About) -> Floats:
        """Change of e, (n, 3, k) in mm, for one unit of each coefficient."""
        bases = [about.columns(effect, self.shapes.get(effect.name, ())) for effect in self.effects]
        return np.concatenate(bases, axis=2) if bases else np.zeros((len(about.points), 3, 0))

    def largest_lean(self, points: Points, sizes: Floats) -> float:
        """Largest sum of leans in one plane, rad, where each effect may be as large as its coefficient of ``sizes`` (k,)."""
        total = dict.fromkeys(SQUARENESSES, 0.0)
        for column, effect in self.leaning:
            total[str(effect.plane)] += float(sizes[column] * np.abs(effect.lean(points)).max(initial=0.0))
        return max(total.values())

    def _squareness(self, points: Points, coefficients: Floats) -> Floats | None:
        """Squarenesses (3,) or (n, 3), rad, of all effects that are some; ``None`` where there are none."""
        acting = [(effect, coefficients[column]) for column, effect in self.leaning if coefficients[column]]
        if not acting:
            return None
        total: list[Floats] = [np.zeros(()) for _ in SQUARENESSES]
        for effect, coefficient in acting:
            plane = SQUARENESSES.index(str(effect.plane))
            total[plane] = total[plane] + coefficient * effect.lean(points)
        return np.stack(np.broadcast_arrays(*total), axis=-1)

    def _arm(self, points: Points, coefficients: Floats) -> Arm | None:
        """The arm with its rows as the coefficients (k,) change them; ``None`` where they change none."""
        change, first = np.zeros(1), 0
        for effect in self.effects:
            own = coefficients[first : first + len(effect.coefficients)]
            first += len(own)
            if isinstance(effect, OfRows) and own.any():
                change = change + effect.change(points, self.shapes.get(effect.name, ())) @ own
        return arm_of(points).changed(change) if change.ndim == 2 else None

    @property
    def bends(self) -> bool:
        """Whether e is linear in the coefficients about a place of theirs only: changes of an arm's rows."""
        return any(isinstance(effect, OfRows) for effect in self.effects)

    @property
    def leaning(self) -> list[tuple[int, Effect]]:
        first = np.cumsum([0, *(len(effect.coefficients) for effect in self.effects)])
        return [(int(i), effect) for i, effect in zip(first, self.effects, strict=False) if effect.plane]

    @property
    def leans(self) -> NDArray[np.bool_]:
        """(k,) which coefficients are of a squareness."""
        return np.array([bool(effect.plane) for effect in self.effects for _ in effect.coefficients], dtype=bool)


def _indicated(true: Points, directions: Floats) -> Points:
    """Where a machine whose motions have these directions, and no other error, indicates true points."""
    points = true
    for _ in range(_ROUNDS):
        xyz = true.xyz - true.on_artefact(leaning(points.carriages, directions)[:, :, None])[:, :, 0]
        change = np.abs(xyz - points.xyz).max(initial=0.0)
        points = true.at(xyz)
        if not change > _SETTLED:
            break
    return points
