"""Common datums (ISO 5459): several features associated at once, by least squares, as the one rigid thing of their nominals.

Place and turn of the whole are free, and the size of each member; between themselves the members stand as the drawing says.
So two bearing seats have one axis, which is neither of the two that they have alone, and two faces one plane.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cached_property
from itertools import pairwise

import numpy as np
from scipy.spatial.transform import Rotation

from cmm_uq.analysis.parts.association import VALUES, Features, ProbedFeature
from cmm_uq.analysis.parts.plan import FeatureKind, PartFeature, as_datum
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats

_ROUNDS = 100
_SETTLED = 1e-11  # of the extent of the points: a step below which the least squares are reached
_UNSEEN = 1e-6  # singular value, of the largest, below which the points do not see a motion
_KEPT = 1e-3  # by how much a motion that is not seen may move a datum, of what the points as a whole would move
_BLOCK = 50_000  # points worked on together, so that their derivatives take some tens of megabytes
_THREE = 3  # numbers of a shift; as many follow of a rotation
_Surface = Callable[[PartFeature, Floats], tuple[Floats, Floats]]


class ProbedCommon(ProbedFeature):
    """A common datum to be associated many times; its values are shift and rotation vector of the whole.

    ``feature``: of the plan, with members. ``points``: (n, 3) points of all members as they are measured without any draw,
    mm.
    """

    def __init__(self, feature: PartFeature, points: Floats) -> None:
        self.feature, self.points, self.association = feature, points, "least_squares"
        self.n, ends = len(points), np.cumsum([0, *(len(one.points) for one in feature.members)])
        self._rows = [slice(a, b) for a, b in pairwise(ends.tolist())]
        self._middle = feature.points.mean(axis=0)
        self._extent = float(np.sqrt(np.mean((feature.points - self._middle) ** 2))) or 1.0
        self._sizes = np.zeros((self.n, len(feature.members)))
        for i, (one, rows) in enumerate(zip(feature.members, self._rows, strict=True)):
            self._sizes[rows, i] = one.kind in _SIZED
        self._sizes = self._sizes[:, self._sizes.any(axis=0)]
        self._refuse_undetermined()
        self._start = np.eye(3)[None], np.zeros((1, 3)), np.zeros((1, self._sizes.shape[1]))
        self._start = self._settled(points[None], None)
        self._inverse = self._inverse_at(self._seen(points[None], *self._start)[1][0])

    def of(self, displacements: Floats, *, with_points: bool = False) -> Features:
        return self._features(self._motion(displacements))

    @cached_property
    def base(self) -> Floats:
        """(8,) values without any draw."""
        return np.asarray(self._motion(np.zeros((1, self.n, 3)))[0])

    @cached_property
    def derivative(self) -> Floats:
        """(8, n, 3) of the values by the coordinates of each point."""
        return self.by_differences(self._motion)

    def to_first_order(self, change: Floats) -> Features:
        """Features of first-order changes (N, 8) of the values."""
        return self._features(self.base + change)

    @property
    def undisturbed(self) -> Features:
        return self._features(self.base[None])

    def _motion(self, displacements: Floats) -> Floats:
        values = np.zeros((len(displacements), VALUES))
        block = max(1, _BLOCK // self.n)
        for start in range(0, len(displacements), block):
            rows = slice(start, start + block)
            turn, shift, _ = self._settled(self.points + displacements[rows], self._inverse)
            values[rows, :_THREE] = shift
            values[rows, _THREE : 2 * _THREE] = Rotation.from_matrix(turn).as_rotvec()
        return values

    def _features(self, motion: Floats) -> Features:
        """The datum, and each member's, where the whole has gone."""
        shift, turn = motion[:, :_THREE], Rotation.from_rotvec(motion[:, _THREE : 2 * _THREE]).as_matrix()

        def moved(one: PartFeature) -> Features:
            values = np.zeros((len(motion), VALUES))
            values[:, :3] = (one.nominal.point - self._middle) @ np.swapaxes(turn, 1, 2) + self._middle + shift
            if one.nominal.direction is not None:
                values[:, 3:6] = one.nominal.direction @ np.swapaxes(turn, 1, 2)
            return Features(values)

        whole, members = moved(self.feature), tuple(moved(as_datum(one)) for one in self.feature.members)
        return Features(whole.values, members=members)

    def _settled(self, points: Floats, inverse: Floats | None) -> tuple[Floats, Floats, Floats]:
        """Turn (N, 3, 3), shift (N, 3), change of radii (N, S) for points (N, n, 3).

        Steps go by the inverse of the normal equations at the undisturbed points, or of their own where there is none yet;
        they end at the least squares of these points all the same.
        """
        turn, shift, sizes = (np.repeat(each, len(points), axis=0) for each in self._start)
        for _ in range(_ROUNDS):
            left, by_motion = self._seen(points, turn, shift, sizes)
            own = self._inverse_at(by_motion[0]) if inverse is None else inverse
            step = -np.einsum("ij,Nnj,Nn->Ni", own, by_motion, left, optimize=True)
            shift = shift + np.einsum("Nij,Nj->Ni", turn, step[:, :3])
            turn = turn @ Rotation.from_rotvec(step[:, 3:6] / self._extent).as_matrix()
            sizes = sizes + step[:, 6:]
            if np.abs(step).max(initial=0.0) < _SETTLED * self._extent:
                return turn, shift, sizes
        raise CmmUqError("its members do not settle on these points", where=f"common datum {self.feature.name!r}",
                         fix="Look for points that do not belong to it")  # fmt: skip

    def _seen(self, points: Floats, turn: Floats, shift: Floats, sizes: Floats) -> tuple[Floats, Floats]:
        """Distances (N, n) from the moved surfaces, and (N, n, 6 + S) derivatives by shift, rotation times extent, and sizes.

        Shift and rotation are those along the axes of the moved whole.
        """
        about = np.einsum("Nni,Nij->Nnj", points - self._middle - shift[:, None], turn)
        away, normals = np.empty(about.shape[:2]), np.empty_like(about)
        for one, rows in zip(self.feature.members, self._rows, strict=True):
            away[:, rows], normals[:, rows] = _SURFACES[one.kind](one, about[:, rows] + self._middle)
        held = np.broadcast_to(-self._sizes, (len(points), *self._sizes.shape))
        by_motion = np.concatenate([-normals, -np.cross(about, normals) / self._extent, held], axis=2)
        return away - sizes @ self._sizes.T, by_motion

    @staticmethod
    def _inverse_at(by_motion: Floats) -> Floats:
        _, values, rows = np.linalg.svd(by_motion, full_matrices=False)
        kept = values > _UNSEEN * values[0]
        return np.asarray((rows[kept].T / values[kept] ** 2) @ rows[kept])

    def _refuse_undetermined(self) -> None:
        """Motions that the nominal points do not see have to leave each member's datum where it is."""
        nominal = self.feature.points[None]
        still = np.eye(3)[None], np.zeros((1, 3)), np.zeros((1, self._sizes.shape[1]))
        _, values, rows = np.linalg.svd(self._seen(nominal, *still)[1][0], full_matrices=True)
        seen = np.zeros(len(rows), dtype=bool)
        seen[: len(values)] = values > _UNSEEN * values[0]
        for motion in rows[~seen]:
            for one in map(as_datum, self.feature.members):
                if self._moves(one, motion[:3], motion[3:6]):
                    where = f"common datum {self.feature.name!r}"
                    raise CmmUqError(f"its members leave {one.name!r} free to move", where=where,
                                     fix="Name more features, or probe them at more places")  # fmt: skip

    def _moves(self, one: PartFeature, shift: Floats, rotation: Floats) -> bool:
        """Whether a motion takes a datum out of itself; rotations are times the extent."""
        moved, w = shift + np.cross(rotation, one.nominal.point - self._middle) / self._extent, one.nominal.direction
        if w is None:
            return bool(np.linalg.norm(moved) > _KEPT)
        along = moved @ w
        off = abs(along) if one.kind == "plane" else np.linalg.norm(moved - along * w)
        return bool(max(off, np.linalg.norm(np.cross(rotation, w))) > _KEPT)


def _flat(one: PartFeature, points: Floats) -> tuple[Floats, Floats]:
    normal = np.asarray(as_datum(one).nominal.direction)
    return (points - one.nominal.point) @ normal, np.broadcast_to(normal, points.shape)


def _ball(one: PartFeature, points: Floats) -> tuple[Floats, Floats]:
    apart = points - one.nominal.point
    far = np.linalg.norm(apart, axis=2)
    return far - 0.5 * (one.nominal.diameter_mm or 0.0), apart / far[:, :, None]


def _about_an_axis(one: PartFeature, points: Floats) -> tuple[Floats, Floats]:
    """Of a circle, cylinder or cone, as :mod:`cmm_uq.maths.geometry.placed` has them."""
    w, apart = np.asarray(one.nominal.direction), points - one.nominal.point
    height, half = apart @ w, one.nominal.half_angle_rad or 0.0
    across = apart - height[:, :, None] * w
    far = np.linalg.norm(across, axis=2)
    away = (far - 0.5 * (one.nominal.diameter_mm or 0.0)) * np.cos(half) - height * np.sin(half)
    return away, np.cos(half) * across / far[:, :, None] - np.sin(half) * w


_SURFACES: Mapping[FeatureKind, _Surface] = {
    "point": _flat, "plane": _flat, "sphere": _ball, "circle": _about_an_axis, "cylinder": _about_an_axis,
    "cone": _about_an_axis,
}  # fmt: skip
_SIZED: tuple[FeatureKind, ...] = ("circle", "sphere", "cylinder", "cone")
