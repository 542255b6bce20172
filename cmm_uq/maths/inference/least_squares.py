"""Least squares by singular values: what a recording determines, and what it leaves free; studentised residuals.

Normal equations and pseudo-inverses hide a rank deficiency; the singular value decomposition of the scaled design shows
it, so that the combination of parameters that remains free can be named.

What has been fitted takes part of the noise with it, and of some observations nearly all: of the mean of three repeats, where
each placing is fitted by itself, nothing may be left. Residuals that are taken for the noise are then a mixture of large and
small ones, and look as if a normal noise had heavy tails: they are studentised, in units of their own standard deviations.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats, Ints
from cmm_uq.maths.inference.linear_model import LinearModel, Unknown
from cmm_uq.maths.inference.noise import Components, Sizes

RANK_TOLERANCE = 1e-7  # part of the largest singular value; fitted placings of spheres leave 1e-8
_NOTHING = 1e-8  # part of a parameter in a free combination, over its typical size, that is rounding
_ROUGHLY = 100.0  # times its singular value over the largest: so far noise turns a combination that only it shows


@dataclass(frozen=True, eq=False)
class LeastSquares:
    unknowns: tuple[Unknown, ...]  # k parameters; certified ones keep their certified value
    value: Floats  # (k,) of an undetermined parameter the one nearest to its prior mean that fits equally well
    covariance: Floats  # (k, k), certificates' u propagated (JCGM 100, 5.1.2); infinite variance where undetermined
    determined: NDArray[np.bool_]  # (k,) whether the observations (or a certificate) determine the parameter by itself
    null_space: Floats  # (k, f) combinations, in the parameters' units, that leave all observations as they are
    rank: int  # of the design in units of the parameters' typical sizes
    condition: float  # of its determined part
    residuals: Floats  # (m,) mm, observed minus explained
    degrees_of_freedom: int  # observations minus what was fitted to them
    residual_sd: float | None  # mm, √(sum of squares / degrees of freedom); ``None`` without degrees of freedom
    sigma: float  # mm, standard uncertainty of one coordinate that the covariance uses
    sigma_of_residuals: float  # mm, the same from the residuals alone; that in use where no degrees of freedom are left
    spread: Floats  # (k,) standard deviation that the noise gives to ``value``, of undetermined parameters too


def solve(model: LinearModel, most: int | None = None) -> LeastSquares:
    """Least-squares estimate; certified parameters are held, physical priors are not used.

    ``most``: combinations to take as determined; fewer than the design's rank where the design itself is not known well
    enough for the last of them, as where it follows the noise of fitted placings.
    """
    unknowns, reduced = model.unknowns, model.reduced
    held = np.array([u.known for u in unknowns], dtype=bool)
    free = np.flatnonzero(~held)
    if reduced.count < len(free) or (reduced.count == len(free) and model.sigma is None):
        problem = f"{reduced.count} observations cannot determine {len(free)} parameters"
        fix = "name fewer effects in job.toml [model] effects"
        if reduced.count == len(free):
            problem = (
                f"{reduced.count} observations for {len(free)} parameters leave nothing to estimate the noise from"
            )
            fix = "state u_coordinate_um in job.toml [recording]"
        raise CmmUqError(problem, where="recording", fix=f"Record more placings, or {fix}")
    value = model.prior_mean.copy()
    scale = model.scale[free]
    target = reduced.observed - reduced.design @ value
    U, s, Vt = linalg.svd(reduced.design[:, free] * scale, full_matrices=False)
    rank = int(np.sum(s > RANK_TOLERANCE * s[0])) if s.size and s[0] > 0 else 0
    nothing = _NOTHING
    if most is not None and most < rank:
        nothing, rank = _ROUGHLY * float(s[most] / s[0]), most
    forward = (Vt[:rank].T / s[:rank]) @ U[:, :rank].T * scale[:, None]
    value[free] += forward @ target
    whitened = reduced.observed - reduced.design @ value
    dof = reduced.count - rank
    sum_of_squares = float(whitened @ whitened)
    stated = model.sigma if model.sigma is not None else 0.0
    from_residuals = float(np.sqrt(sum_of_squares / dof)) if dof > 0 else stated
    sigma = stated or from_residuals
    null_space = np.zeros((len(unknowns), len(free) - rank))
    null_space[free] = _simplest(Vt[rank:].T, nothing) * scale[:, None]
    for column in null_space.T:
        column /= column[np.flatnonzero(column)[0]]
    determined = np.ones(len(unknowns), dtype=bool)
    determined[free] = np.all(null_space[free] == 0, axis=1)
    residuals, spread = whitened * model.noise_scale, np.zeros(len(unknowns))
    residual_sd = float(np.sqrt(residuals @ residuals / dof)) if dof > 0 else None
    spread[free] = sigma * np.sqrt(np.sum(forward**2, axis=1))
    covariance = _covariance(model, forward, free, held, sigma)
    covariance[np.diag(~determined)] = np.inf
    condition = float(s[0] / s[rank - 1]) if rank else float("inf")
    figures = rank, condition, residuals, dof, residual_sd, sigma, from_residuals, spread
    return LeastSquares(unknowns, value, covariance, determined, null_space, *figures)


def likeliest(model: LinearModel, sigma: float) -> Floats:
    """The parameters (k,) that observations with noise ``sigma``, mm, and all priors together make likeliest."""
    rows, given = model.priors
    scale = model.scale
    whole = np.vstack([model.reduced.design / sigma, rows]) * scale
    return np.asarray(scale * np.linalg.lstsq(whole, np.append(model.reduced.observed / sigma, given), rcond=None)[0])


def _covariance(model: LinearModel, forward: Floats, free: Ints, held: NDArray[np.bool_], sigma: float) -> Floats:
    """σ² from the noise, plus what the certificates' uncertainty does to the estimates."""
    k = len(held)
    covariance, sensitivity = np.zeros((k, k)), np.zeros((k, int(held.sum())))
    sensitivity[free] = -forward @ model.reduced.design[:, held]
    sensitivity[held] = np.eye(int(held.sum()))
    covariance[np.ix_(free, free)] = sigma**2 * forward @ forward.T
    covariance += (sensitivity * model.prior_sd[held] ** 2) @ sensitivity.T
    return covariance


def _simplest(null_space: Floats, nothing: float) -> Floats:
    """The same space, each column with a one where no other has anything; parts up to ``nothing`` are zero."""
    if null_space.shape[1] == 0:
        return null_space
    _, _, order = linalg.qr(null_space.T, mode="economic", pivoting=True)
    pivots = order[: null_space.shape[1]]
    columns = null_space @ linalg.inv(null_space[pivots])
    return np.where(np.abs(columns) < nothing, 0.0, columns)


# part of its variance that must be left of an observation: a smaller one is mostly what the model lacks, made large
_LEAST_LEFT = 0.1
_SINGULAR = 1e-9  # part of the largest singular value below which another counts as zero


def studentised(model: LinearModel, noise: Components, sizes: Sizes, residuals: Floats) -> Floats:
    """Residuals (n,), each of variance one over that of a reading, of the observations that the fit leaves enough of.

    The design's columns and the placings are projected out under the noise without its slow part (Cook & Weisberg 1982,
    Residuals and Influence in Regression, 2.2.1).

    ``residuals``: (m,) of least squares, mm.
    """
    variance = (noise.variances(sizes)[0] @ noise.shares.T)[0]
    scale = np.sqrt(variance) / float(sizes.coordinate[0])
    placed = model.freedoms.turned(noise.turn).over(scale)
    fitted = [i for i, unknown in enumerate(model.unknowns) if not unknown.known]
    typical = np.array([model.unknowns[i].scale for i in fitted])
    design = placed.without(np.asarray(noise.turn @ (model.design[:, fitted] * typical)) / scale[:, None])
    U, s, _ = np.linalg.svd(design, full_matrices=False)
    U = U[:, s > _SINGULAR * s.max(initial=0.0)]
    left = 1 - np.sum(placed.reached.columns**2, axis=1) - np.sum(U**2, axis=1)
    own = placed.without(noise.white(sizes)(residuals[:, None]))[:, 0]
    own = own - U @ (U.T @ own)
    kept = left > _LEAST_LEFT
    return np.asarray(own[kept] / np.sqrt(left[kept]))
