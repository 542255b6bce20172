"""Common datums of a drawing, ``A-B``: a datum on several features, as ISO 5459 writes it."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from functools import cache

import numpy as np

from cmm_uq.base.errors import CmmUqError, suggestion
from cmm_uq.base.points import Floats
from cmm_uq.jobs.part.feature import Kind
from cmm_uq.jobs.part.probed import Probed

BETWEEN = "-"

_APART_MM = 0.01
"""From one axis: what lies farther from it by its nominal lies on another."""

_ACROSS = 1e-3
"""Sine of the angle below which two directions are one, a twentieth of a degree."""

_AXIAL: tuple[Kind, ...] = ("circle", "cylinder", "cone")
_FACES: tuple[Kind, ...] = ("plane", "point")


def members(name: str, known: Collection[str]) -> tuple[str, ...]:
    """Names of the features that a datum is on: one, or those between the hyphens.

    Parameters
    ----------
    name : of the datum, as ``A`` or ``A-B``. A feature that has a hyphen in its own name is found by its whole name.
    known : names of features.

    Raises
    ------
    CmmUqError : there is none of that name, or the name says it in two ways, or a feature twice.
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
