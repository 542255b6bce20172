"""What the noise may be: white, with a common part in each placing, or correlated in time.

The noise model belongs to the baseline. Set-up offsets or slow drifts of the noise that are not modelled look like physics.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import linalg, sparse, special

from cmm_uq.points import Floats, Ints

PLACING_RATIOS = (0.5, 1.0, 2.0)
"""Standard deviation of a placing over that of a reading."""

CORRELATIONS = (0.5, 0.85)
"""Correlation of neighbours in time."""

WHITE = 0.8
"""Probability, beforehand, that noise is white; the rest is shared by the other kinds."""

_FEW = 12
"""Directions; of no more than that, correlation is reckoned within each of them: a point may be seen along several at once."""

TAILS = 0.05
"""Probability of heavy tails, taken from that of white noise."""

_TAILS_DOF = 4.0
_SHRINK = (_TAILS_DOF - 2) / _TAILS_DOF
"""Square of the t distribution's scale over its standard deviation."""

_STATED_IS_RIGHT = 0.9
_STATED_SPREAD = 0.08
_POINTS = 400


@dataclass(frozen=True, eq=False)
class Kind:
    """One kind of noise.

    Parameters
    ----------
    name : ``white``, ``placing``, ``correlated`` or ``tails``.
    size : ratio of the placing's standard deviation to the reading's, or correlation of neighbours; 0 for white.
    whitening : (m, m) W, sparse where it can be; W times such noise, over the standard deviation of a reading, is white.
    log_whitening : logarithm of its determinant.
    probability : beforehand.
    log_factor : logarithm by which its density exceeds that of a normal distribution with this covariance.
    """

    name: str
    size: float
    whitening: sparse.csr_array | Floats
    log_whitening: float
    probability: float
    log_factor: float = 0.0

    def white(self, columns: Floats) -> Floats:
        """Columns (m, b) that become white noise if they are noise of this kind."""
        return np.asarray(self.whitening @ columns, dtype=np.float64)

    def noise(self, normal: Floats) -> Floats:
        """Noise (m, b) of this kind from standard normal numbers."""
        if isinstance(self.whitening, np.ndarray):
            return np.asarray(linalg.solve_triangular(self.whitening, normal, lower=True), dtype=np.float64)
        return np.asarray(sparse.linalg.splu(self.whitening.tocsc()).solve(normal), dtype=np.float64)


def tails(residual: Floats) -> Kind:
    """Student's t with four degrees of freedom, by its tangent at residuals (m,) over the noise scale.

    ln t is convex in the square of its argument, so that the tangent is a normal density below it, wherever it touches: the
    evidence of this kind is never overstated. (σ stays the standard deviation of a reading.)
    """
    scale = 1.4826 * float(np.median(np.abs(residual)))
    squares = (residual / max(scale, 1e-300)) ** 2 / _SHRINK
    weight = (_TAILS_DOF + 1) / (_TAILS_DOF + squares)
    log_t = special.gammaln((_TAILS_DOF + 1) / 2) - special.gammaln(_TAILS_DOF / 2) - 0.5 * np.log(np.pi * _TAILS_DOF)
    log_t = log_t - 0.5 * (_TAILS_DOF + 1) * np.log1p(squares / _TAILS_DOF) - 0.5 * np.log(_SHRINK)
    normal = -0.5 * np.log(2 * np.pi * _SHRINK / weight) - 0.5 * weight * squares
    log_whitening = 0.5 * float(np.log(weight / _SHRINK).sum())
    whitening = sparse.diags_array(np.sqrt(weight / _SHRINK)).tocsr()
    return Kind("tails", _TAILS_DOF, whitening, log_whitening, TAILS, float(np.sum(log_t - normal)))


def kinds(
    placing: Ints,
    order: Floats,
    directions: Floats,
    *,
    white: float = WHITE,
    correlations: Sequence[float] = CORRELATIONS,
) -> list[Kind]:
    """Kinds of noise that a recording could show.

    Parameters
    ----------
    placing : (m,) observations with the same number share an offset: repeats of one quantity in one placing.
    order : (m,) time, or place in the recording, of each observation.
    directions : (m, 3) along which each observation sees the noise of a point; zero where it sees a difference of points.
    white : probability, beforehand, that it is white; the others share the rest.
    correlations : of neighbours in time to consider.
    """
    m = len(placing)
    _, place, repeats = np.unique(placing, return_inverse=True, return_counts=True)
    shared = len(repeats) < m
    share = (1 - white) / (len(correlations) + shared * len(PLACING_RATIOS))
    found = [Kind("white", 0.0, sparse.eye_array(m, format="csr"), 0.0, white - TAILS)]
    if shared:
        found += [_shared(ratio, place, repeats, share) for ratio in PLACING_RATIOS]
    distinct, chain = np.unique(np.round(directions, 3), axis=0, return_inverse=True)
    if len(distinct) > _FEW and directions.any(axis=1).all():
        return found + [_correlated_along(phi, order, directions, share) for phi in correlations]
    sequence = np.lexsort((order, chain.ravel()))
    return found + [_correlated(phi, sequence, chain.ravel()[sequence], share) for phi in correlations]


def _shared(ratio: float, place: Ints, repeats: Ints, probability: float) -> Kind:
    """An offset of each place, ``ratio`` times a reading's standard deviation: covariance 1 + ratio² within a place."""
    m, grown = len(place), np.sqrt(1 + repeats * ratio**2)
    member = sparse.csr_array((np.ones(m), (np.arange(m), place)), shape=(m, len(repeats)))
    less = sparse.diags_array((1 - 1 / grown) / repeats)
    whitening = (sparse.eye_array(m) - member @ less @ member.T).tocsr()
    return Kind("placing", ratio, whitening, -float(np.log(grown).sum()), probability)


def _correlated(phi: float, sequence: Ints, chain: Ints, probability: float) -> Kind:
    """First-order autoregression along a sequence (m,) of observations, in chains that are numbered (m,)."""
    m, innovation = len(sequence), np.sqrt(1 - phi**2)
    follows = np.append(False, chain[1:] == chain[:-1])
    diagonal = np.where(follows, 1 / innovation, 1.0)
    below = np.full(int(follows.sum()), -phi / innovation)
    rows, columns = np.append(sequence, sequence[follows]), np.append(sequence, sequence[np.flatnonzero(follows) - 1])
    whitening = sparse.csr_array((np.append(diagonal, below), (rows, columns)), shape=(m, m))
    return Kind("correlated", phi, whitening, float(np.log(diagonal).sum()), probability)


def _correlated_along(phi: float, order: Floats, directions: Floats, probability: float) -> Kind:
    """First-order autoregression of each coordinate, seen along directions that all differ."""
    rank = np.argsort(np.argsort(order, kind="stable"), kind="stable")  # without ties: equal times would be singular
    unit = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    covariance = phi ** np.abs(rank[:, None] - rank) * (unit @ unit.T)
    factor = linalg.cholesky(covariance, lower=True)
    whitening = np.asarray(linalg.solve_triangular(factor, np.eye(len(rank)), lower=True), dtype=np.float64)
    return Kind("correlated", phi, whitening, -float(np.log(np.diag(factor)).sum()), probability)


def sigma_grid(stated: float | None, residual: float) -> tuple[Floats, Floats]:
    """Values (s,) of the noise, mm, and their log probabilities beforehand.

    A stated value is mostly right to 8 %, and now and then simply wrong; without one, the logarithm is uniform.

    Parameters
    ----------
    stated : as the job states it.
    residual : standard deviation of what the baseline leaves.
    """
    centre = np.log(residual)
    grid = np.linspace(centre - 4.0, centre + 1.5, _POINTS)
    if stated is None:
        return np.exp(grid), np.full(_POINTS, -np.log(_POINTS))
    at = np.log(stated)
    grid = np.unique(np.concatenate([grid, np.linspace(at - 5 * _STATED_SPREAD, at + 5 * _STATED_SPREAD, 60)]))
    right = np.exp(-0.5 * ((grid - at) / _STATED_SPREAD) ** 2) / _STATED_SPREAD
    wrong = np.exp(-0.5 * (grid - at) ** 2)
    weight = _STATED_IS_RIGHT * right + (1 - _STATED_IS_RIGHT) * wrong
    return np.exp(grid), np.log(weight * np.gradient(grid) / np.sqrt(2 * np.pi))


def order_of(time: Floats | None, count: int) -> Floats:
    """Time of each observation, or its place in the recording."""
    return np.arange(count, dtype=np.float64) if time is None else time
