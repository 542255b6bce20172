"""The frame of a part by its datums in order (ISO 5459): each fixes what those before it left free.

Of rotation, the first datum with a direction fixes two degrees of freedom, and the next that says a direction across it the
third: by its own direction, or by where it lies from the datums before it. Of translation, a plane fixes one across it, an
axis two, a point or centre three. Measured and nominal datums go through the same construction, and what takes one frame to
the other takes measured points to the coordinates of the part.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cmm_uq.analysis.parts.association import Features
from cmm_uq.analysis.parts.plan import FeatureKind, PartFeature, as_datum
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats

# sine of the angle between two datums below which the second says nothing of the rotation about the first, some 6°
_ACROSS = 0.1
# length of what a datum fixes, seen in the directions that are still free, below which it fixes none of them
_FREE = 1e-6
_SETTLED = 1e-11  # mm and rad
_ROUNDS = 20
# datums whose direction is measured; of a circle it is nominal
_TURNING: tuple[FeatureKind, ...] = ("line", "plane", "cylinder", "cone")
# datums that fix translation across their direction
_AXES: tuple[FeatureKind, ...] = ("line", "circle", "cylinder", "cone")


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
        for _ in range(_ROUNDS):
            left = self.frame(motion).points(self.points + displacements) - self.points
            step = np.einsum("kn,nj,Nnj->Nk", self._solve, self.normals, left, optimize=True)
            motion += step
            if np.abs(step).max(initial=0.0) < _SETTLED:
                break
        return motion

    def frame(self, motion: Floats) -> PartFrame:
        """The frame that takes a motion (N, 6) back."""
        from scipy.spatial.transform import Rotation

        turn = Rotation.from_rotvec(motion[:, 3:]).as_matrix()
        return PartFrame(turn, self.middle + motion[:, :3], self.middle)


class DatumSystem:
    """Datums in order, and what they fix.

    ``features``: of the datums, in order; a common datum stands for its members, which it moves as one. ``nominal``: each
    without any error, which says how the frame is made.
    """

    def __init__(self, features: Sequence[PartFeature], nominal: Sequence[Features]) -> None:
        self.features = tuple(
            each for one in features for each in (map(as_datum, one.members) if one.members else (one,))
        )
        self.nominal = _members(nominal)
        self._first: int | None = None
        self._second: tuple[int, int | None] = 0, None
        self._choose()
        one = self._rotations(self.nominal)
        self._steps = self._translation_steps(one[0])
        self._to = self._origins(self.nominal, one)[0]
        self._turn = one[0]

    def frames(self, measured: Sequence[Features]) -> PartFrame:
        """The frames of measured datums, in the order of the datums."""
        each = _members(measured)
        turn = self._rotations(each)
        return PartFrame(np.swapaxes(turn, 1, 2) @ self._turn, self._origins(each, turn), self._to)

    def _choose(self) -> None:
        """The datum that fixes two rotations, and what fixes the third: a direction, or where one lies from one before."""
        directed = [i for i, feature in enumerate(self.features) if feature.kind in _TURNING]
        placed = [i for i, feature in enumerate(self.features) if feature.kind != "plane"]
        if not directed:
            if len(self.features) < 3:
                names = ", ".join(repr(feature.name) for feature in self.features)
                raise CmmUqError(f"the datums ({names}) do not fix how the part is turned", where="datums",
                                 fix="Name a plane or an axis, or three points")  # fmt: skip
            return
        self._first = directed[0]
        main = self.nominal[self._first].direction[0]
        for i in range(len(self.features)):
            if i in directed and np.linalg.norm(np.cross(main, self.nominal[i].direction[0])) > _ACROSS:
                self._second = i, None
                return
            if i in placed and i != placed[0]:
                apart = self.nominal[i].position[0] - self.nominal[placed[0]].position[0]
                if np.linalg.norm(np.cross(main, apart)) > _ACROSS * np.linalg.norm(apart):
                    self._second = i, placed[0]
                    return
        raise CmmUqError(f"the datums leave the part free to turn about {self.features[self._first].name!r}",
                         where="datums", fix="Name another datum, with a direction across it or beside it")  # fmt: skip

    def _rotations(self, given: Sequence[Features]) -> Floats:
        """(N, 3, 3) rows u, v, w of the datums' frame."""
        if self._first is None:
            return self._of_points(given)
        w = _unit(given[self._first].direction)
        i, other = self._second
        second = given[i].direction if other is None else given[i].position - given[other].position
        u = _unit(second - np.einsum("ni,ni->n", second, w)[:, None] * w)
        return np.stack([u, np.cross(w, u), w], axis=1)

    def _of_points(self, given: Sequence[Features]) -> Floats:
        """By a triangle of the first three places."""
        u = _unit(given[1].position - given[0].position)
        rest = given[2].position - given[0].position
        v = _unit(rest - np.einsum("ni,ni->n", rest, u)[:, None] * u)
        return np.stack([u, v, np.cross(u, v)], axis=1)

    def _translation_steps(self, turn: Floats) -> list[tuple[int, Floats]]:
        """(datum, (m, 3) directions in the datums' frame) in which each fixes the translation."""
        free, steps = np.eye(3), []
        for i, feature in enumerate(self.features):
            fixed = _fixed(feature.kind, self.nominal[i].direction[0]) @ turn.T @ free.T
            _, sizes, rows = np.linalg.svd(fixed, full_matrices=True)
            count = int(np.sum(sizes > _ACROSS))
            if count:
                steps.append((i, rows[:count] @ free))
            free = rows[count:] @ free
            if not len(free):
                break
        if len(free):
            raise CmmUqError("the datums leave the part free to shift", where="datums", fix="Name another datum")
        return steps

    def _origins(self, given: Sequence[Features], turn: Floats) -> Floats:
        """(N, 3) of a point that the datums fix."""
        own = [np.einsum("nij,nj->ni", turn, each.position) for each in given]
        origin = own[0].copy()
        for i, directions in self._steps:
            origin = self._on_datum(origin, own[i], i, given, turn, directions)
        return np.asarray(np.einsum("nij,ni->nj", turn, origin))

    def _on_datum(
        self, origin: Floats, place: Floats, i: int, given: Sequence[Features], turn: Floats, directions: Floats
    ) -> Floats:
        """The origin moved along free directions (m, 3) of the datums' frame onto datum i."""
        gap = place - origin
        kind = self.features[i].kind
        if kind in ("plane", *_AXES):
            own = np.einsum("nij,nj->ni", turn, given[i].direction)
            along = np.einsum("ni,ni->n", gap, own)[:, None] * own
            gap = along if kind == "plane" else gap - along
            # the step within the free directions that takes the gap away
            fixed = own[:, None, :] if kind == "plane" else _across(own)
            A, b = fixed @ directions.T, np.einsum("nki,ni->nk", fixed, gap)
            if len(directions) == 1:
                step = np.einsum("nk,nk->n", A[:, :, 0], b) / np.einsum("nk,nk->n", A[:, :, 0], A[:, :, 0])
                return np.asarray(origin + step[:, None] * directions)
            return np.asarray(origin + np.linalg.solve(A, b[:, :, None])[:, :, 0] @ directions)
        return np.asarray(origin + (gap @ directions.T) @ directions)


def _members(given: Sequence[Features]) -> list[Features]:
    """Features, of common datums their members'."""
    return [each for one in given for each in one.members or (one,)]


def _fixed(kind: FeatureKind, direction: Floats) -> Floats:
    """(m, 3) directions in which a datum of this kind fixes the translation."""
    if kind == "plane":
        return np.asarray(direction[None])
    if kind in _AXES:
        return np.asarray(_across(direction[None])[0])
    return np.eye(3)


def _across(directions: Floats) -> Floats:
    """(N, 2, 3) unit vectors across directions (N, 3) and each other."""
    helper = np.eye(3)[np.argmin(np.abs(directions), axis=1)]
    u = _unit(np.cross(directions, helper))
    return np.stack([u, np.cross(directions, u)], axis=1)


def _unit(vectors: Floats) -> Floats:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))
