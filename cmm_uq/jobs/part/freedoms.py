"""What datums leave free of the part's frame: shifts and rotations that move none of them out of itself.

Each feature is invariant under some rigid motions (ISO 5459, invariance classes); datums fix the frame where no motion
but standing still leaves all of them in place. To first order these motions are a linear space of six dimensions.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cmm_uq.base.points import AXES, Floats
from cmm_uq.jobs.part.probed import Probed

_FREE = 1e-3
"""Singular value below which a motion counts as free: datums that lean by less than a twentieth of a degree are one."""


def freedoms(datums: Sequence[tuple[Probed, ...]]) -> tuple[str, ...]:
    """What the datums leave free, in words; nothing where they fix the frame.

    Parameters
    ----------
    datums : in order, each the features that it is on: several of a common datum.
    """
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
