"""Least squares of orthogonal distances, and where to begin for a cylinder or a cone.

Gauss–Newton steps by QR, damped where a step would not descend.
The features are given in centred data of unit extent. Each says how to linearise its distances at a state and how to
move the state by a small step; frames that follow the axis keep every step free of singularities.

For a given axis the surface is linear in what remains: |p⊥|² = 2c·p⊥ + k of a cylinder, with b·h + t²·h² more of a cone
(h along the axis, t the tangent of the half angle). Its least-squares misfit depends on the points only through their
moments up to the fourth order, so that hundreds of directions over the whole hemisphere cost nothing. That finds the
axis from short arcs too, where the principal directions of the points mislead.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats

State = TypeVar("State")
MAX_ITERATIONS = 200
SETTLED = 1e-13  # step, in units of the extent of the data, below which nothing is left to gain
SHRINKING = 1e-7  # steps below this that no longer shrink are rounding
SINGULAR = 1e12  # condition number from which the points do not determine the feature


@dataclass(frozen=True, eq=False)
class Minimum(Generic[State]):
    state: State  # the feature, in the units of the data given
    distances: Floats  # (m,) orthogonal distances there
    root: Floats  # (k, k) upper triangular R of the Jacobian: (RᵀR)⁻¹ is the covariance for distances of unit variance
    condition: float  # of the Jacobian with columns of unit length
    iterations: int  # steps taken

    @property
    def cost(self) -> float:
        return float(self.distances @ self.distances)

    def covariance(self) -> Floats:
        """(k, k) covariance of the step's parameters for distances of unit variance."""
        inverse = np.linalg.inv(self.root)
        return np.asarray(inverse @ inverse.T)


def triangle(rows: Floats) -> Floats:
    """Upper triangular R (k, k) of the QR factorisation of ``rows.T``, for rows (k, m) with m ≥ k or padded to it."""
    from scipy.linalg import lapack

    k, m = rows.shape
    if m < k:
        rows = np.hstack([rows, np.zeros((k, k - m))])
    # the transpose of C-ordered rows is what LAPACK wants, so that nothing is copied but once
    factored = lapack.dgeqrf(rows.T)[0]
    return np.asarray(np.triu(factored[:k]))


def principal(about: Floats) -> Floats:
    """(d, d) principal directions of centred points (d, n), rows, longest extent first."""
    return np.asarray(np.linalg.svd(triangle(about))[2])


def extents(about: Floats) -> Floats:
    """Singular values (d,) of centred points (d, n), largest first."""
    return np.asarray(np.linalg.svd(triangle(about), compute_uv=False))


def minimise(
    start: State, linearise: Callable[[State], Floats], move: Callable[[State, Floats], State], what: str
) -> Minimum[State]:
    """Descend from a start to the least sum of squared distances.

    ``linearise``: (k + 1, m) derivatives of the distances with respect to the step's k parameters, and the distances last.
    ``move``: the state after a step (k,).
    """
    state, rows = start, linearise(start)
    k = len(rows) - 1
    cost, damping, rise, last = float(rows[-1] @ rows[-1]), 0.0, 2.0, np.inf
    for iteration in range(1, MAX_ITERATIONS + 1):
        R = triangle(rows)
        while True:
            step, expected = _step(R, damping)
            moved = move(state, step)
            trial = linearise(moved)
            gain = cost - float(trial[-1] @ trial[-1])
            size = float(np.abs(step).max())
            # at the level of rounding the cost says nothing any more, the size of the step does
            if gain >= 0 or size < SHRINKING:
                break
            damping, rise = max(rise * damping, 1e-4), 2 * rise
        state, rows, cost = moved, trial, cost - gain
        if size < SETTLED or (size < SHRINKING and size > 0.5 * last):
            return minimum_at(state, rows, what, iteration)
        # the more of the expected gain came true, the less damping (Nielsen 1999); none where the model holds well
        damping *= max(1 / 3, 1 - (2 * gain / expected - 1) ** 3) if expected > 0 else 1 / 3
        last, damping, rise = size, damping if damping > 1e-9 else 0.0, 2.0
    fix = f"Cover more of the {what} (k = {k} parameters), and remove points that are not on it"
    raise CmmUqError(f"{what}: the fit does not settle on these {rows.shape[1]} points", fix=fix)


def _step(R: Floats, damping: float) -> tuple[Floats, float]:
    """Damped least-squares step from R of Jacobian and distances, and the gain expected of it."""
    J, d = R[:, :-1], R[:, -1]
    scale = np.linalg.norm(J, axis=0)
    scale[scale == 0] = 1.0
    J = J / scale
    k = J.shape[1]
    step = np.linalg.lstsq(np.vstack([J, np.sqrt(damping) * np.eye(k)]), -np.append(d, np.zeros(k)), rcond=1e-14)[0]
    return step / scale, float(d @ d - np.sum((J @ step + d) ** 2))


def minimum_at(state: State, rows: Floats, what: str, iterations: int = 0) -> Minimum[State]:
    """The minimum, given that ``state`` is it, from its linearisation ``rows`` (see :func:`minimise`)."""
    R = triangle(rows)[:-1, :-1]
    scale = np.linalg.norm(R, axis=0)
    s = np.linalg.svd(R / np.where(scale > 0, scale, 1.0), compute_uv=False)
    if s[-1] * SINGULAR <= s[0]:
        raise CmmUqError(f"{what}: the points do not determine it", fix=f"Cover more of the {what}")
    return Minimum(state, rows[-1], R, float(s[0] / s[-1]), iterations)


def cap_directions(polar_angle: float, n: int = 20_000) -> Floats:
    """Unit directions (n, 3) spread evenly over the cap of a sphere about +z, whose edge is ``polar_angle`` from it, rad."""
    i = np.arange(n)
    z = 1 - (1 - np.cos(polar_angle)) * (i + 0.5) / n
    turn = np.pi * (3 - np.sqrt(5)) * i
    r = np.sqrt(1 - z**2)
    return np.column_stack([r * np.cos(turn), r * np.sin(turn), z])


DIRECTIONS, CANDIDATES = 600, 6
APART = np.cos(np.radians(12))  # candidates nearer to each other than this descend to the same minimum


def axis_candidates(about: Floats, *, tapered: bool) -> list[Floats]:
    """A few unit directions (3,): the principal ones, then the most promising, for centred points (3, n) of unit extent."""
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
