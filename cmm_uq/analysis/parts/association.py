"""Features of virtual measurements: of drawn points exactly, or to first order where only values are asked for.

To first order means: by the exact derivative of the association about the measurement without errors of its own. How far that
is from the association itself is looked at in every run (:mod:`cmm_uq.analysis.parts.virtual`).
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cached_property

import numpy as np

from cmm_uq.analysis.parts.plan import PartFeature
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats
from cmm_uq.base.values import dataclass, field, replace
from cmm_uq.jobs.part.feature import ORIENTED, Kind
from cmm_uq.maths.geometry.association import Association
from cmm_uq.maths.geometry.repeated import MANY, Drawn, Raised, Repeated, one_by_one

_STEP = 1e-3  # mm: of central differences, whose error is the square of step over radius
_NEAR = 1e-2  # of a feature's extent: how far points may be from those that it was prepared for
# features that lie anywhere along their axis by their fit
_SLIDING: tuple[Kind, ...] = ("line", "circle", "cylinder", "cone")
VALUES = 8  # numbers that a feature is told by: position (3), direction (3), diameter, half angle


@dataclass(frozen=True, eq=False)
class Features:
    values: Floats  # (N, 8) position, direction, diameter, half angle; zero where there is none
    # (N,) form deviation, mm; (0,) where it was not asked for
    form: Floats = field(default_factory=lambda: np.zeros(0))
    # (N, n, 3) measured; (0, 0, 3) where they were not asked for
    points: Floats = field(default_factory=lambda: np.zeros((0, 0, 3)))
    members: tuple[Features, ...] = ()  # of a common datum, each as what it fixes

    @property
    def position(self) -> Floats:
        """(N, 3) mm."""
        return self.values[:, :3]

    @property
    def direction(self) -> Floats:
        """(N, 3) unit vectors, in the sense of the nominal one."""
        return self.values[:, 3:6]

    @property
    def diameter(self) -> Floats:
        """(N,) mm."""
        return self.values[:, 6]


class ProbedFeature:
    """A feature to be associated many times.

    ``points``: (n, 3) its points as they are measured without any draw, mm. ``association``: how. ``looked_at``: the same
    feature at points that are near, whose preparation then serves for these too.
    """

    def __init__(
        self, feature: PartFeature, points: Floats, association: Association, looked_at: ProbedFeature | None = None
    ) -> None:
        self.feature, self.points, self.association, self.n = feature, points, association, len(points)
        self._offset = np.zeros_like(points)
        self._repeated: Repeated
        if feature.kind == "point":
            return
        if looked_at is not None and looked_at.is_near(points):
            self._repeated = looked_at._repeated
            self._offset = points - (looked_at.points - looked_at._offset)
            return
        with self._named():
            self._repeated = Repeated(feature.kind, self._in_own_plane(points))

    @contextmanager
    def _named(self) -> Iterator[None]:
        """What a fit refuses, by the name of the feature."""
        try:
            yield
        except CmmUqError as error:
            raise CmmUqError(error.problem, where=f"feature {self.feature.name!r}", fix=error.fix) from error

    def is_near(self, points: Floats) -> bool:
        """Whether points (n, 3) are so near to its own that these serve for them too; only of what takes long to prepare.

        The point on the axis is then the one over the middle of its own points.
        """
        if self.feature.kind not in ("cylinder", "cone"):
            return False
        return bool(np.abs(points - self.points).max(initial=0.0) < _NEAR * self._repeated.placed.extent)

    @cached_property
    def _plane(self) -> Floats:
        """(2, 3) of a line on a surface: along it, and out of the material."""
        along = np.asarray(self.feature.nominal.direction)
        out = self.feature.normals.mean(axis=0)
        out = out - (out @ along) * along
        return np.array([along, out / np.linalg.norm(out)])

    def _in_own_plane(self, points: Floats) -> Floats:
        """Of a line on a surface the coordinates (…, 2) in its plane, else the points."""
        return np.asarray(points @ self._plane.T) if self.feature.kind == "line" else points

    def of(self, displacements: Floats, *, with_points: bool = False) -> Features:
        """Features of displacements (N, n, 3) from ``points``, mm, by the association itself; (N, n) along the normals."""
        normals, raised = self.feature.normals, displacements.ndim < self.points.ndim + 1
        points = np.zeros((0, 0, 3))
        if with_points:
            points = self.points + (displacements[:, :, None] * normals if raised else displacements)
        if raised:
            local = Raised(displacements, self._in_own_plane(normals), self._in_own_plane(self._offset))
            drawn = self._associated(local)
            values = self._values(drawn)
            if len(self._unsaid):
                mean = self._offset.mean(axis=0) + displacements @ normals.astype(displacements.dtype) / self.n
                values = self._slid(values, mean)
            return Features(values, drawn.form, points)
        if self.feature.kind == "point":
            values = np.zeros((len(displacements), VALUES))
            values[:, :3] = (self.points + displacements).mean(axis=1)
            return Features(values, np.zeros(len(displacements)), points)
        moved = displacements + self._offset
        drawn = self._associated(self._in_own_plane(moved))
        return Features(self._slid(self._values(drawn), moved.mean(axis=1)), drawn.form, points)

    def _associated(self, displacements: Floats | Raised) -> Drawn:
        if self.association == "least_squares":
            return self._repeated.least_squares(displacements)
        if self.association in ("minimum_zone", "tangent"):
            drawn = self._repeated.minimum_zone(displacements)
            return self._outside(drawn) if self.association == "tangent" else drawn
        with self._named():
            return self._repeated.one_sided(displacements, inscribed=self.association == "maximum_inscribed")

    def _outside(self, drawn: Drawn) -> Drawn:
        """The side of a minimum zone that looks out of the material."""
        if self.feature.kind not in ("line", "plane"):
            raise CmmUqError(f"a {self.feature.kind} has no tangent feature", where=f"feature {self.feature.name!r}",
                             fix="Use maximum_inscribed or minimum_circumscribed")  # fmt: skip
        out = self.feature.normals.mean(axis=0)
        across = self._plane @ out if self.feature.kind == "line" else out
        return replace(drawn, position=drawn.position + 0.5 * drawn.form[:, None] * across / np.linalg.norm(across))

    def _values(self, drawn: Drawn) -> Floats:
        values = np.zeros((len(drawn.position), VALUES))
        position, direction = drawn.position, drawn.direction
        if self.feature.kind == "line":
            middle = self.points.mean(axis=0)
            middle = middle - (self._plane @ middle) @ self._plane
            position = position @ self._plane + middle
            direction = None if direction is None else direction @ self._plane
        values[:, :3] = position
        nominal = self.feature.nominal.direction
        if self.feature.kind in ORIENTED and nominal is not None:
            sensed = np.broadcast_to(nominal, position.shape) if direction is None else direction
            values[:, 3:6] = sensed * np.sign(sensed @ nominal)[:, None]
        for column, value in ((6, drawn.size), (7, drawn.half_angle)):
            if value is not None:
                values[:, column] = value
        return values

    @cached_property
    def _unsaid(self) -> Floats:
        """(k, 3) directions in which no fit says where a feature lies: along its axis, of a line across its surface too."""
        if self.feature.kind not in _SLIDING:
            return np.zeros((0, 3))
        axis = np.asarray(self.feature.nominal.direction)
        return np.array([axis, np.cross(*self._plane)]) if self.feature.kind == "line" else axis[None]

    def _slid(self, values: Floats, mean: Floats) -> Floats:
        """Values (N, 8) whose position goes with the points, which moved by a mean (N, 3), where no fit says where it lies.

        A circle lies as high as it is probed; what moves points and datums together leaves it where it is in the part.
        """
        by = mean @ self._unsaid.T
        return np.asarray(values + sum(by[..., i, None] * each for i, each in enumerate(self._sliding(values))))

    def _sliding(self, values: Floats) -> list[Floats]:
        """Changes (N, 8) of values for 1 mm in each of these directions; on the axis as it is measured."""
        found = [np.zeros_like(values) for _ in self._unsaid]
        for i, each in enumerate(found):
            own = values[:, 3:6] / (values[:, 3:6] @ self._unsaid[0])[:, None]
            each[:, :3] = self._unsaid[i] if i else own
            if (half := self.feature.nominal.half_angle_rad) is not None:
                each[:, 6] = 2 * np.tan(np.copysign(values[:, 7], half)) * np.linalg.norm(own, axis=1)
        return found

    @cached_property
    def base(self) -> Floats:
        """(8,) values without any draw."""
        return np.asarray(self.values(np.zeros((1, self.n, 3)))[0])

    def values(self, displacements: Floats) -> Floats:
        """(N, 8) values of displacements (N, n, 3)."""
        return self.of(displacements).values

    @cached_property
    def derivative(self) -> Floats:
        """(8, n, 3) of the values by the coordinates of each point."""
        if self.feature.kind == "point" or self.feature.members or self.n <= MANY:
            steps = [_STEP * unit for unit in one_by_one(self.n, 3)]
            found = [(self.values(step) - self.values(-step)) / (2 * _STEP) for step in steps]
            return np.concatenate(found).T.reshape(VALUES, self.n, 3)
        states, followed = self._repeated.followed(self._in_own_plane(self._offset), _STEP)
        up, down = np.split(self._slid(self._values(self._repeated.drawn(states)), self._offset.mean(axis=0)), 2)
        by_coordinate = (0.5 * followed @ (up - down)).reshape(self.n, -1, VALUES)
        if self.feature.kind == "line":
            by_coordinate = np.einsum("nbv,bi->niv", by_coordinate, self._plane)
        sliding = [each[0] for each in self._sliding(self.base[None])]
        slid = np.einsum("kv,ki->vi", np.array(sliding).reshape(-1, VALUES), self._unsaid) / self.n
        return np.asarray(np.moveaxis(by_coordinate, 2, 0) + slid[:, None])

    @property
    def undisturbed(self) -> Features:
        return Features(self.base[None])

    def to_first_order(self, change: Floats) -> Features:
        """Features of first-order changes (N, 8) of the values."""
        values = self.base + change
        if self.feature.kind in ORIENTED:
            values[:, 3:6] /= np.linalg.norm(values[:, 3:6], axis=1, keepdims=True)
        return Features(values)


def component(vectors: Floats, directions: Floats) -> Floats:
    """(N, 3) of vectors along unit vectors."""
    return np.asarray(np.einsum("ni,ni->n", vectors, directions)[:, None] * directions)


def normed(vectors: Floats) -> Floats:
    """Unit vectors (…, 3)."""
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))
