"""The frame of a part by its datums in order (ISO 5459): each fixes what those before it left free.

Of rotation, the first datum with a direction fixes two degrees of freedom, and the next that says a direction across it the
third: by its own direction, or by where it lies from the datums before it. Of translation, a plane fixes one across it, an
axis two, a point or centre three. Measured and nominal datums go through the same construction, and what takes one frame to
the other takes measured points to the coordinates of the part.

Common datums are several features associated at once, by least squares, as the one rigid thing of their nominals: place and
turn of the whole are free, and the size of each member; between themselves the members stand as the drawing says. So two
bearing seats have one axis, which is neither of the two that they have alone, and two faces one plane.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise

import numpy as np
from scipy.spatial.transform import Rotation

from cmm_uq.analysis.parts.association import VALUES, Features, ProbedFeature, component, normed
from cmm_uq.analysis.parts.plan import PartFeature, as_datum
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats
from cmm_uq.base.values import dataclass
from cmm_uq.jobs.part.feature import ROUND, TURNED, Kind

# sine of the angle between two datums below which the second says nothing of the rotation about the first, some 6°
_ACROSS = 0.1
# length of what a datum fixes, seen in the directions that are still free, below which it fixes none of them
_FREE = 1e-6
_SETTLED = 1e-11  # mm and rad; of the extent of the points of a common datum
_ROUNDS_OF_BEST_FIT = 20
_ROUNDS = 100
_UNSEEN = 1e-6  # singular value, of the largest, below which the points do not see a motion
_KEPT = 1e-3  # by how much a motion that is not seen may move a datum, of what the points as a whole would move
_BLOCK = 50_000  # points worked on together, so that their derivatives take some tens of megabytes
# datums that fix translation across their direction
_AXES: tuple[Kind, ...] = ("line", "circle", "cylinder", "cone")


@dataclass(frozen=True, eq=False)
class PartFrame:
    """From measured coordinates to those of the part: x → (x − origin) · turn + nominal origin."""

    turn: Floats  # (N, 3, 3)
    # origin, to: (N, 3) measured, and (3,) nominal place of a point that the datums fix, mm
    origin: Floats
    to: Floats

    def points(self, xyz: Floats) -> Floats:
        """Points (N, 3) or (N, n, 3), mm."""
        moved = xyz - (self.origin if xyz.ndim == 2 else self.origin[:, None])
        return self.vectors(moved) + self.to

    def vectors(self, directions: Floats) -> Floats:
        """Directions (N, 3) or (N, n, 3)."""
        return np.asarray(np.einsum("n...i,nij->n...j", directions, self.turn))


BEST_FIT = ("(best fit)",)  # in place of names of datums: the frame by best fit


class BestFit:
    """The frame in which all points lie nearest to the nominal surfaces, by least squares of their distances.

    Distances are those from the tangent plane of each nominal point, which a shift t along a surface of radius R leaves by
    t²/(2R): a nanometre for 5 µm along 12 mm.

    ``points, normals``: (n, 3) nominal.
    """

    def __init__(self, points: Floats, normals: Floats) -> None:
        self.points, self.normals = points, normals
        self.middle = points.mean(axis=0)
        about = points - self.middle
        size = float(np.sqrt(np.mean(about**2))) or 1.0
        rows = np.hstack([normals, np.cross(about, normals) / size])
        if np.linalg.matrix_rank(rows, tol=_FREE * np.sqrt(len(rows))) < rows.shape[1]:
            raise CmmUqError("the points leave the part free to move by their best fit", where="alignment",
                             fix="Probe faces in three directions, or name datums")  # fmt: skip
        self._solve = np.linalg.pinv(rows) / np.repeat([1.0, size], 3)[:, None]

    @property
    def derivative(self) -> Floats:
        """(6, n, 3) of shift and rotation of the measured points by their coordinates."""
        return np.asarray(self._solve[:, :, None] * self.normals)

    def motion(self, displacements: Floats) -> Floats:
        """(N, 6) shift, mm, and rotation vector, rad, by which points displaced by (N, n, 3) have moved."""
        motion = np.zeros((len(displacements), 6))
        for _ in range(_ROUNDS_OF_BEST_FIT):
            left = self.frame(motion).points(self.points + displacements) - self.points
            step = np.einsum("kn,nj,Nnj->Nk", self._solve, self.normals, left, optimize=True)
            motion += step
            if np.abs(step).max(initial=0.0) < _SETTLED:
                break
        return motion

    def frame(self, motion: Floats) -> PartFrame:
        """The frame that takes a motion (N, 6) back."""
        turn = Rotation.from_rotvec(motion[:, 3:]).as_matrix()
        return PartFrame(turn, self.middle + motion[:, :3], self.middle)


class DatumSystem:
    """Datums in order, and what they fix.

    ``features``: of the datums, in order; a common datum stands for its members, which it moves as one. ``nominal``: each
    without any error, which says how the frame is made.
    """

    def __init__(self, features: Sequence[PartFeature], nominal: Sequence[Features]) -> None:
        self.features = tuple(each for one in features for each in tuple(map(as_datum, one.members)) or (one,))
        self.nominal = _members(nominal)
        self._first: int | None = None
        self._second: tuple[int, int | None] = 0, None
        self._choose()
        turn = self._rotations(self.nominal)
        self._turn = turn[0]
        self._steps = self._translation_steps()
        self._to = self._origins(self.nominal, turn)[0]

    def frames(self, measured: Sequence[Features]) -> PartFrame:
        """The frames of measured datums, in the order of the datums."""
        each = _members(measured)
        turn = self._rotations(each)
        return PartFrame(np.swapaxes(turn, 1, 2) @ self._turn, self._origins(each, turn), self._to)

    def _choose(self) -> None:
        """The datum that fixes two rotations, and what fixes the third: a direction, or where one lies from one before."""
        directed = [i for i, feature in enumerate(self.features) if feature.kind in TURNED]
        placed = [i for i, feature in enumerate(self.features) if feature.kind != "plane"]
        if not directed:
            if len(self.features) < 3:
                names = ", ".join(repr(feature.name) for feature in self.features)
                raise CmmUqError(f"the datums ({names}) do not fix how the part is turned", where="datums",
                                 fix="Name a plane or an axis, or three points")  # fmt: skip
            return
        self._first = directed[0]
        main = self.nominal[self._first].direction[0]
        for i, own in enumerate(self.nominal):
            if i in directed and np.linalg.norm(np.cross(main, own.direction[0])) > _ACROSS:
                self._second = i, None
                return
            if i in placed and i != placed[0]:
                apart = own.position[0] - self.nominal[placed[0]].position[0]
                if np.linalg.norm(np.cross(main, apart)) > _ACROSS * np.linalg.norm(apart):
                    self._second = i, placed[0]
                    return
        raise CmmUqError(f"the datums leave the part free to turn about {self.features[self._first].name!r}",
                         where="datums", fix="Name another datum, with a direction across it or beside it")  # fmt: skip

    def _rotations(self, given: Sequence[Features]) -> Floats:
        """(N, 3, 3) rows u, v, w of the datums' frame; of points alone by a triangle of the first three."""
        if self._first is None:
            u = normed(given[1].position - given[0].position)
            v = _perpendicular(given[2].position - given[0].position, u)
            return np.stack([u, v, np.cross(u, v)], axis=1)
        w = normed(given[self._first].direction)
        i, other = self._second
        second = given[i].direction if other is None else given[i].position - given[other].position
        u = _perpendicular(second, w)
        return np.stack([u, np.cross(w, u), w], axis=1)

    def _translation_steps(self) -> list[tuple[int, Floats]]:
        """(datum, (m, 3) directions in the datums' frame) in which each fixes the translation."""
        free, steps = np.eye(3), []
        for i, (feature, own) in enumerate(zip(self.features, self.nominal, strict=True)):
            held = _held(feature.kind, own.direction[:1])[0]
            _, sizes, rows = np.linalg.svd(held @ self._turn.T @ free.T, full_matrices=True)
            count = int(np.sum(sizes > _ACROSS))
            if count:
                steps.append((i, rows[:count] @ free))
            free = rows[count:] @ free
            if not len(free):
                return steps
        raise CmmUqError("the datums leave the part free to shift", where="datums", fix="Name another datum")

    def _origins(self, given: Sequence[Features], turn: Floats) -> Floats:
        """(N, 3) of a point that the datums fix: moved onto each datum along directions that are still free."""
        own = [np.einsum("nij,nj->ni", turn, each.position) for each in given]
        origin = own[0].copy()
        for i, directions in self._steps:
            gap, kind = own[i] - origin, self.features[i].kind
            if kind not in ("plane", *_AXES):
                origin = origin + (gap @ directions.T) @ directions
                continue
            direction = np.einsum("nij,nj->ni", turn, given[i].direction)
            gap = component(gap, direction) if kind == "plane" else gap - component(gap, direction)
            # the step within the free directions that takes the gap away
            fixed = _held(kind, direction)
            A, b = fixed @ directions.T, np.einsum("nki,ni->nk", fixed, gap)
            if len(directions) == 1:
                step = np.einsum("nk,nk->n", A[:, :, 0], b) / np.einsum("nk,nk->n", A[:, :, 0], A[:, :, 0])
                origin = origin + step[:, None] * directions
            else:
                origin = origin + np.linalg.solve(A, b[:, :, None])[:, :, 0] @ directions
        return np.asarray(np.einsum("nij,ni->nj", turn, origin))


def _members(given: Sequence[Features]) -> list[Features]:
    """Features, of common datums their members'."""
    return [each for one in given for each in one.members or (one,)]


def _perpendicular(vectors: Floats, directions: Floats) -> Floats:
    """(N, 3) unit vectors across directions, towards vectors."""
    return normed(vectors - component(vectors, directions))


def _held(kind: Kind, directions: Floats) -> Floats:
    """(N, m, 3) directions in which datums of this kind fix the translation; (1, 3, 3) of a point."""
    if kind == "plane":
        return directions[:, None, :]
    if kind not in _AXES:
        return np.eye(3)[None]
    u = normed(np.cross(directions, np.eye(3)[np.argmin(np.abs(directions), axis=1)]))
    return np.stack([u, np.cross(directions, u)], axis=1)


class ProbedCommon(ProbedFeature):
    """A common datum to be associated many times; its values are shift and rotation vector of the whole.

    ``feature``: of the plan, with members. ``points``: (n, 3) points of all members as they are measured without any draw,
    mm.
    """

    def __init__(self, feature: PartFeature, points: Floats) -> None:
        self.feature, self.points, self.association, self.n = feature, points, "least_squares", len(points)
        ends = np.cumsum([0, *(len(one.points) for one in feature.members)]).tolist()
        self._rows = [slice(a, b) for a, b in pairwise(ends)]
        self._middle = feature.points.mean(axis=0)
        self._extent = float(np.sqrt(np.mean((feature.points - self._middle) ** 2))) or 1.0
        sizes = np.zeros((self.n, len(feature.members)))
        for i, (one, rows) in enumerate(zip(feature.members, self._rows, strict=True)):
            sizes[rows, i] = one.kind in ROUND
        self._sizes = sizes[:, sizes.any(axis=0)]
        self._start = np.eye(3)[None], np.zeros((1, 3)), np.zeros((1, self._sizes.shape[1]))
        self._refuse_undetermined()
        self._start = self._settled(points[None], None)
        self._inverse = self._inverse_at(self._seen(points[None], *self._start)[1][0])

    def of(self, displacements: Floats, *, with_points: bool = False) -> Features:
        return self._features(self.values(displacements))

    def to_first_order(self, change: Floats) -> Features:
        return self._features(self.base + change)

    @property
    def undisturbed(self) -> Features:
        return self._features(self.base[None])

    def values(self, displacements: Floats) -> Floats:
        values = np.zeros((len(displacements), VALUES))
        block = max(1, _BLOCK // self.n)
        for start in range(0, len(displacements), block):
            rows = slice(start, start + block)
            turn, values[rows, :3], _ = self._settled(self.points + displacements[rows], self._inverse)
            values[rows, 3:6] = Rotation.from_matrix(turn).as_rotvec()
        return values

    def _features(self, motion: Floats) -> Features:
        """The datum, and each member's, where the whole has gone."""
        back = np.swapaxes(Rotation.from_rotvec(motion[:, 3:6]).as_matrix(), 1, 2)

        def moved(one: PartFeature) -> Floats:
            values = np.zeros((len(motion), VALUES))
            values[:, :3] = (one.nominal.point - self._middle) @ back + self._middle + motion[:, :3]
            if one.nominal.direction is not None:
                values[:, 3:6] = one.nominal.direction @ back
            return values

        members = tuple(Features(moved(as_datum(one))) for one in self.feature.members)
        return Features(moved(self.feature), members=members)

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
        _, values, rows = np.linalg.svd(self._seen(self.feature.points[None], *self._start)[1][0], full_matrices=True)
        seen = np.zeros(len(rows), dtype=bool)
        seen[: len(values)] = values > _UNSEEN * values[0]
        for motion in rows[~seen]:
            for one in map(as_datum, self.feature.members):
                if self._moves(one, motion[:3], motion[3:6]):
                    said, where = f"its members leave {one.name!r} free to move", f"common datum {self.feature.name!r}"
                    raise CmmUqError(said, where=where, fix="Name more features, or probe them at more places")

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


_SURFACES: Mapping[Kind, Callable[[PartFeature, Floats], tuple[Floats, Floats]]] = {
    "point": _flat, "plane": _flat, "sphere": _ball, "circle": _about_an_axis, "cylinder": _about_an_axis,
    "cone": _about_an_axis,
}  # fmt: skip
