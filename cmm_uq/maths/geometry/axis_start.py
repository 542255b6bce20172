"""Where to begin for a cylinder or a cone: directions of the axis that could explain the points.

For a given axis the surface is linear in what remains: |p⊥|² = 2c·p⊥ + k of a cylinder, with b·h + t²·h² more of a cone
(h along the axis, t the tangent of the half angle). Its least-squares misfit depends on the points only through their
moments up to the fourth order, so that hundreds of directions over the whole hemisphere cost nothing. That finds the
axis from short arcs too, where the principal directions of the points mislead.
"""

from __future__ import annotations

import numpy as np

from cmm_uq.base.points import Floats
from cmm_uq.maths.geometry.directions import cap_directions
from cmm_uq.maths.geometry.orthogonal_distance import principal

DIRECTIONS = 600
CANDIDATES = 6
APART = np.cos(np.radians(12))
"""Candidates nearer to each other than this descend to the same minimum."""


def axis_candidates(about: Floats, *, tapered: bool) -> list[Floats]:
    """A few unit directions (3,): the principal ones, then the most promising, for centred points (3, n) of unit extent.

    Parameters
    ----------
    tapered : True for a cone, False for a cylinder.
    """
    x, y, z = about
    monomials = np.array([np.ones_like(x), x, y, z, x * x, y * y, z * z, x * y, x * z, y * z])
    directions = np.vstack([principal(about), cap_directions(np.pi / 2, DIRECTIONS)])
    misfits = _misfits(monomials @ monomials.T / len(x), directions, tapered)
    # short rings and long thin bodies have their axis among the principal directions, whatever the misfits say
    chosen: list[Floats] = list(directions[:3])
    for i in 3 + np.argsort(misfits[3:]):
        if len(chosen) == 3 + CANDIDATES:
            break
        if all(abs(directions[i] @ w) < APART for w in chosen):
            chosen.append(directions[i])
    return chosen


def section(about: Floats, frame: Floats, *, tapered: bool) -> tuple[Floats, float, float]:
    """Centre (2,) across an axis given by its frame, radius at the centroid, and tangent of the half angle."""
    p, h = (frame @ about)[:2], frame[2] @ about
    regressors = [*p, np.ones_like(h), h, h * h] if tapered else [*p, np.ones_like(h)]
    fitted = np.linalg.lstsq(np.array(regressors).T, np.einsum("ij,ij->j", p, p), rcond=None)[0]
    centre = 0.5 * fitted[:2]
    squared = max(float(fitted[2] + centre @ centre), 1e-12)
    radius = np.sqrt(squared)
    return centre, float(radius), float(0.5 * fitted[3] / radius) if tapered else 0.0


def _misfits(M: Floats, directions: Floats, tapered: bool) -> Floats:
    """Mean squared misfit of |p⊥|² for axes (m, 3), brought to squares of distance: divided by (2r)²."""
    x, y, z = directions.T
    along = np.zeros((len(directions), 10))
    along[:, 4:] = np.array([x * x, y * y, z * z, 2 * x * y, 2 * x * z, 2 * y * z]).T
    across = np.array([0, 0, 0, 0, 1.0, 1, 1, 0, 0, 0]) - along
    G = np.zeros((len(directions), 10, 6 if tapered else 4))
    G[:, 0, 0] = 1.0
    G[:, 1:4, 1:4] = np.eye(3) - directions[:, :, None] * directions[:, None, :]
    if tapered:
        G[:, 1:4, 4], G[:, :, 5] = directions, along
    Gt = G.transpose(0, 2, 1)
    # the ridge keeps it solvable along the axis, where a projection has nothing, and where the points say nothing
    normal = Gt @ M @ G + 1e-12 * np.eye(G.shape[2])
    fitted = np.linalg.solve(normal, Gt @ M @ across[:, :, None])[:, :, 0]
    left = across - np.einsum("mij,mj->mi", G, fitted)
    squared = fitted[:, 0] + 0.25 * np.sum(fitted[:, 1:4] ** 2, axis=1)
    misfits = np.einsum("ij,jk,ik->i", left, M, left) / (4 * np.where(squared > 0, squared, np.inf))
    return np.where(squared > 0, misfits, np.inf)
