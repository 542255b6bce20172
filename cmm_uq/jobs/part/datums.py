"""Datums of a drawing: common ones, ``A-B`` as ISO 5459 writes them, and what datums leave free of the part's frame.

What datums leave free of the part's frame: shifts and rotations that move none of them out of itself.

Each feature is invariant under some rigid motions (ISO 5459, invariance classes); datums fix the frame where no motion
but standing still leaves all of them in place. To first order these motions are a linear space of six dimensions.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from functools import cache

import numpy as np

from cmm_uq.base.errors import CmmUqError, suggestion
from cmm_uq.base.points import AXES, Floats
from cmm_uq.jobs.part.feature import Kind
from cmm_uq.jobs.part.probed import Probed

BETWEEN = "-"
_APART_MM = 0.01  # from one axis: what lies farther from it by its nominal lies on another
_ACROSS = 1e-3  # sine of the angle below which two directions are one, a twentieth of a degree
_AXIAL: tuple[Kind, ...] = ("circle", "cylinder", "cone")
_FACES: tuple[Kind, ...] = ("plane", "point")


def members(name: str, known: Collection[str]) -> tuple[str, ...]:
    """Names of the features that a datum is on: one, or those between the hyphens.

    ``name``: of the datum, as ``A`` or ``A-B``. A feature that has a hyphen in its own name is found by its whole name.
    """
    if name in known:
        return (name,)
    words = [word.strip() for word in name.split(BETWEEN)]

    @cache
    def read(start: int) -> tuple[tuple[str, ...], ...]:
        """Two ways at most to read the words from one on as names."""
        if start == len(words):
            return ((),)
        found: list[tuple[str, ...]] = []
        for end in range(start + 1, len(words) + 1):
            first = BETWEEN.join(words[start:end])
            found += [(first, *rest) for rest in read(end)] if first in known else []
        return tuple(found[:2])

    ways = read(0)
    if not ways:
        unknown = next((word for word in words if word not in known), name)
        of = f" of the common datum {name!r}" if len(words) > 1 else ""
        raise CmmUqError(f"there is no feature {unknown!r}{of}", fix=suggestion(unknown, known))
    if len(ways) > 1:
        one, other = (" and ".join(map(repr, way)) for way in ways)
        raise CmmUqError(f"the common datum {name!r} is {one}, or {other}", fix="Give features names without hyphens")
    twice = next((each for each in ways[0] if ways[0].count(each) > 1), None)
    if twice is not None:
        raise CmmUqError(f"the common datum {name!r} names {twice!r} twice", fix="Name each of its features once")
    return ways[0]


def as_one(features: Sequence[Probed]) -> tuple[Kind, Floats, Floats | None]:
    """What features are as one datum by their nominals: kind, a point (3,) of it, and its direction (3,).

    A ``line`` where all lie on one axis: circles, cylinders and cones with theirs, spheres with their centres. A ``plane``
    where all are parallel faces, or points of such. Else a ``point``, without direction.
    """
    points = np.array([one.facts.point_mm for one in features], dtype=np.float64)
    kinds = [one.facts.kind for one in features]
    if all(kind in _FACES for kind in kinds):
        normals = np.array([one.normals[0] for one in features])
        same = np.all(np.linalg.norm(np.cross(normals, normals[0]), axis=1) < _ACROSS)
        return ("plane", points.mean(axis=0), normals[0]) if same else ("point", points.mean(axis=0), None)
    axes = [one.direction for one in features if one.direction is not None and one.facts.kind in _AXIAL]
    apart = points - points[0]
    farthest = apart[int(np.argmax(np.linalg.norm(apart, axis=1)))]
    along = axes[0] if axes else farthest / (float(np.linalg.norm(farthest)) or 1.0)
    on_it = np.linalg.norm(apart - np.outer(apart @ along, along), axis=1) < _APART_MM
    parallel = all(np.linalg.norm(np.cross(axis, along)) < _ACROSS for axis in axes)
    if not any(kind in _FACES for kind in kinds) and parallel and on_it.all():
        return "line", points[0], np.asarray(along)
    return "point", points.mean(axis=0), None


# singular value below which a motion counts as free: datums that lean by less than a twentieth of a degree are one
_FREE = 1e-3


def freedoms(datums: Sequence[tuple[Probed, ...]]) -> tuple[str, ...]:
    """What the datums leave free, in words; nothing where they fix the frame."""
    every = [one for datum in datums for one in datum]
    centre, size = _about(every)
    fixed = [_fixed(one, centre, size, alone=len(datum) == 1) for datum in datums for one in datum]
    rows = np.concatenate([np.zeros((0, 6)), *fixed])
    free = _null(rows)
    shifts = _null(np.concatenate([rows, np.eye(6)[3:]]))
    named = [f"shift along {axis}" for i, axis in enumerate(AXES) if np.linalg.norm(shifts[:, i]) > _FREE]
    named += [f"rotation about {axis}" for i, axis in enumerate(AXES) if np.linalg.norm(free[:, 3 + i]) > _FREE]
    return tuple(named)


def _about(datums: Sequence[Probed]) -> tuple[Floats, float]:
    """Middle and extent of the datums, so that shifts and rotations are of one size."""
    points = np.concatenate([np.zeros((0, 3)), *(one.points for one in datums)])
    if not len(points):
        return np.zeros(3), 1.0
    centre = points.mean(axis=0)
    return np.asarray(centre), max(float(np.abs(points - centre).max()), 1.0)


def _null(rows: Floats) -> Floats:
    """(k, 6) orthonormal motions that the rows do not see."""
    _, values, motions = np.linalg.svd(rows, full_matrices=True)
    seen = np.zeros(6, dtype=bool)
    seen[: len(values)] = values > _FREE
    return np.asarray(motions[~seen])


def _fixed(one: Probed, centre: Floats, size: float, *, alone: bool = True) -> Floats:
    """(r, 6) of what a feature fixes: shifts of it and rotations, of a motion (shift, rotation about the centre).

    A point alone fixes all three shifts; in a common datum it holds the others' plane or face, along its normal.
    """
    arm = (np.array(one.facts.point_mm) - centre) / size
    # the shift of the feature's point is t + r × arm
    place = np.hstack([np.eye(3), -_cross(arm)])
    if one.facts.kind == "point" and not alone:
        return np.asarray(one.normals[:1] @ place)
    if one.direction is None:
        return place
    w = one.direction
    across = np.linalg.svd(w[None])[2][1:]
    turn = np.hstack([np.zeros((2, 3)), across])
    if one.facts.kind == "plane":
        return np.vstack([w @ place, turn])
    if one.facts.kind == "circle":  # its direction is nominal
        return np.asarray(across @ place)
    return np.vstack([across @ place, turn])


def _cross(v: Floats) -> Floats:
    """Matrix of the vector product v × ."""
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
