"""How far each point of a plan is off: its mean error and the covariance of it, over all causes and places.

A shift and a turn that all points have in common show in no characteristic and are taken out of every draw, by least squares.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cmm_uq.analysis.parts.virtual import Virtual
from cmm_uq.base.points import Floats

DRAWS = 2_000
"""A standard deviation is then known to two percent."""

_BLOCK = 300_000
"""Coordinates drawn at once."""

_NEGLIGIBLE = 1e-9
"""Of the largest, a singular value of rigid motions that points do not tell from others."""


@dataclass(frozen=True, eq=False)
class Displaced:
    """Errors of points: indicated less true, in the frame of the part.

    Parameters
    ----------
    mean : (n, 3) mm.
    covariance : (n, 3, 3) of each point, mm².
    """

    mean: Floats
    covariance: Floats


def displaced(virtual: Virtual, draws: int = DRAWS, seed: int = 0) -> Displaced:
    """Mean and covariance of the error of each point, each place as often as the others."""
    points, random = virtual.plan.points, np.random.default_rng(seed)
    n = len(points)
    rigid = _rigid(points)
    block = max(1, min(draws, _BLOCK // (3 * n)))
    each = max(1, -(-draws // len(virtual.whole)))
    total, first, second = 0, np.zeros((n, 3)), np.zeros((n, 3, 3))
    for place in virtual.whole:
        for start in range(0, each, block):
            count = min(block, each - start)
            whole = (place.base + place.moved(place.drawn(random, count))).reshape(count, 3 * n)
            off = (whole - (whole @ rigid) @ rigid.T).reshape(count, n, 3)
            first += off.sum(axis=0)
            second += np.einsum("kni,knj->nij", off, off)
            total += count
    mean = first / total
    return Displaced(mean, second / total - mean[:, :, None] * mean[:, None, :])


def _rigid(points: Floats) -> Floats:
    """(3n, r) orthonormal displacements of small shifts and turns of points (n, 3)."""
    about = points - points.mean(axis=0)
    span = max(float(np.abs(about).max()), 1.0)
    shifts = [np.tile(axis, (len(points), 1)) for axis in np.eye(3)]
    turns = [np.cross(axis, about) / span for axis in np.eye(3)]
    motions = np.array([*shifts, *turns]).reshape(6, -1)
    _, size, rows = np.linalg.svd(motions, full_matrices=False)
    return np.asarray(rows[size > _NEGLIGIBLE * size[0]].T)
