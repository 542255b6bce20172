"""Least squares of orthogonal distances: Gauss–Newton steps by QR, damped where a step would not descend.

The features are given in centred data of unit extent. Each says how to linearise its distances at a state and how to
move the state by a small step; frames that follow the axis keep every step free of singularities.
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
SETTLED = 1e-13
"""Step, in units of the extent of the data, below which nothing is left to gain."""
SHRINKING = 1e-7
"""Steps below this that no longer shrink are rounding."""
SINGULAR = 1e12
"""Condition number from which the points do not determine the feature."""


@dataclass(frozen=True, eq=False)
class Minimum(Generic[State]):
    """Where the sum of squares is least.

    Parameters
    ----------
    state : the feature, in the units of the data given.
    distances : (m,) orthogonal distances there.
    root : (k, k) upper triangular R of the Jacobian: (RᵀR)⁻¹ is the covariance for distances of unit variance.
    condition : of the Jacobian with columns of unit length.
    iterations : steps taken.
    """

    state: State
    distances: Floats
    root: Floats
    condition: float
    iterations: int

    @property
    def cost(self) -> float:
        """Sum of squared distances."""
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

    Parameters
    ----------
    start : where to begin.
    linearise : (k + 1, m) derivatives of the distances with respect to the step's k parameters, and the distances last.
    move : the state after a step (k,).
    what : the feature's name, for messages.

    Raises
    ------
    CmmUqError : the points do not determine the feature, or no minimum is found.
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
    raise CmmUqError(
        f"{what}: the fit does not settle on these {rows.shape[1]} points",
        fix=f"Cover more of the {what} (k = {k} parameters), and remove points that are not on it",
    )


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
    """The minimum, given that ``state`` is it, from its linearisation ``rows`` (see :func:`minimise`).

    Raises
    ------
    CmmUqError : the points do not determine the feature.
    """
    R = triangle(rows)[:-1, :-1]
    scale = np.linalg.norm(R, axis=0)
    s = np.linalg.svd(R / np.where(scale > 0, scale, 1.0), compute_uv=False)
    if s[-1] * SINGULAR <= s[0]:
        raise CmmUqError(f"{what}: the points do not determine it", fix=f"Cover more of the {what}")
    return Minimum(state, rows[-1], R, float(s[0] / s[-1]), iterations)
