"""A linear measurement model: observations, what explains them, what is known beforehand and what each set-up leaves free.

    observed = design · parameters + placing · (anything) + noise,   noise_i ~ N(0, (σ · noise_scale_i)²)

Observed values are mm. Columns of ``placing`` have no prior and are of no interest (where the artefact stood); they are
projected out exactly. Everything else in this room works on the reduced form that :meth:`LinearModel.reduced` gives.

Least squares are by singular values. Normal equations and pseudo-inverses hide a rank deficiency; the singular value
decomposition of the scaled design shows it, so that the combination of parameters that remains free can be named.

What has been fitted takes part of the noise with it, and of some observations nearly all: of the mean of three repeats, where
each placing is fitted by itself, nothing may be left. Residuals that are taken for the noise are then a mixture of large and
small ones, and look as if a normal noise had heavy tails: they are studentised, in units of their own standard deviations.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property

import numpy as np
import scipy
from numpy.typing import NDArray

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats, Ints
from cmm_uq.base.units import Unit
from cmm_uq.base.values import dataclass, replace
from cmm_uq.maths.inference.noise import Components, Sizes

_DEPENDENT = 1e-10  # part of the largest diagonal element below which another counts as zero


@dataclass(frozen=True, eq=False)
class Freedoms:
    """Columns (m, blocks·j), of which every observation has those of its own block."""

    columns: Floats  # (m, j) of each observation's own block
    index: Ints  # (m,) its block
    blocks: int  # how many there are; one that no observation belongs to is free altogether

    @classmethod
    def of(cls, columns: Floats | Freedoms) -> Freedoms:
        """Columns (m, q) as one block; none without columns."""
        if isinstance(columns, Freedoms):
            return columns
        return cls(columns, np.zeros(len(columns), dtype=np.int64), int(columns.shape[1] > 0))

    @property
    def count(self) -> int:
        return self.blocks * int(self.columns.shape[1])

    def dense(self) -> Floats:
        """All columns (m, blocks·j), the zeros too."""
        whole = np.zeros((len(self.index), self.blocks, self.columns.shape[1]))
        if self.blocks:
            whole[np.arange(len(self.index)), self.index] = self.columns
        return whole.reshape(len(self.index), -1)

    def at(self, rows: NDArray[np.bool_] | Ints) -> Freedoms:
        return Freedoms(self.columns[rows], self.index[rows], self.blocks)

    def over(self, scale: Floats) -> Freedoms:
        """Divided by the noise scale (m,) of the observations."""
        return Freedoms(self.columns / scale[:, None], self.index, self.blocks)

    def turned(self, turn: scipy.sparse.csr_array) -> Freedoms:
        """Of observations mixed by a matrix (m, m); one block where it mixes those of several."""
        among = turn.tocoo()
        whole = Freedoms.of(self.dense()) if np.any(self.index[among.row] != self.index[among.col]) else self
        return Freedoms(np.asarray(turn @ whole.columns), whole.index, whole.blocks)

    @cached_property
    def rows(self) -> list[Ints]:
        order = np.argsort(self.index, kind="stable")
        return np.split(order, np.cumsum(np.bincount(self.index, minlength=self.blocks))[:-1]) if self.blocks else []

    @cached_property
    def reached(self) -> Freedoms:
        """Orthonormal columns of the same span; as many as a block lacks are zero."""
        found = np.zeros_like(self.columns)
        for rows in self.rows:
            basis = reached(self.columns[rows])
            found[rows, : basis.shape[1]] = basis
        return Freedoms(found, self.index, self.blocks)

    def apart(self, group: Ints) -> Freedoms:
        """The same span by orthogonal columns of one length, as many as can be zero outside one group (m,) each.

        Columns that are zero stay where they are.
        """
        found = np.zeros_like(self.columns)
        for rows in self.rows:
            columns = self.columns[rows]
            kept = np.flatnonzero(np.any(columns, axis=0))
            basis, taken, span = columns[:, kept], [], np.zeros((0, len(kept)))
            for number in np.unique(group[rows]):
                outside = group[rows] != number
                _, s, Vt = np.linalg.svd(basis[outside], full_matrices=True)
                within = Vt[np.sum(s > _DEPENDENT * np.linalg.norm(basis)) :]
                taken.append(np.where(outside[:, None], 0.0, basis @ within.T))
                span = np.vstack([span, within])
            rest = np.linalg.svd(span, full_matrices=True)[2][len(span) :]
            found[np.ix_(rows, kept)] = np.hstack([*taken, basis @ rest.T])
        return Freedoms(found, self.index, self.blocks)

    @cached_property
    def rank(self) -> int:
        return int(np.sum(self.sums(self.reached.columns**2) > 0.5))

    def sums(self, values: Floats) -> Floats:
        """Sums of values (m, …) over the observations of each block, (blocks, …)."""
        found = np.zeros((self.blocks, *values.shape[1:]))
        if self.blocks and len(values):
            order = np.argsort(self.index, kind="stable")
            starts = np.flatnonzero(np.diff(self.index[order], prepend=-1))
            found[self.index[order][starts]] = np.add.reduceat(values[order], starts, axis=0)
        return found

    def without(self, columns: Floats) -> Floats:
        left = columns
        for basis in self.reached.columns.T if self.blocks else ():
            left = left - basis[:, None] * self.sums(basis[:, None] * left)[self.index]
        return left


def reached(columns: Floats) -> Floats:
    """Orthonormal basis (m, r) of what columns (m, q) reach, by QR with pivoting."""
    if not columns.size:
        return np.zeros((len(columns), 0))
    Q, R, _ = scipy.linalg.qr(columns, mode="economic", pivoting=True)
    diagonal = np.abs(np.diag(R))
    return np.asarray(Q[:, diagonal > _DEPENDENT * diagonal[0]], dtype=np.float64)


@dataclass(frozen=True)
class Unknown:
    key: tuple[str, str]  # effect (or ``artefact``) and parameter name, as in results.json.
    unit: Unit  # as printed
    prior_mean: float
    prior_sd: float  # infinite where nothing is known beforehand
    scale: float  # a typical size, for columns of comparable length
    known: bool = False  # whether the prior comes from a certificate, so that least squares may use it too


@dataclass(frozen=True, eq=False)
class LinearModel:
    observed: Floats  # (m,) mm
    design: Floats  # (m, k) mm per unit of each parameter
    unknowns: tuple[Unknown, ...]  # k of them
    placing: Floats | Freedoms  # (m, q) columns to be projected out, or those of each placing by itself
    noise_scale: Floats  # (m,) positive
    sigma: float | None  # standard uncertainty of one coordinate, mm; ``None`` when it is to be estimated

    @cached_property
    def reduced(self) -> Reduced:
        """Whitened by the noise scale, the placing projected out by QR."""
        y = self.reduce(self.observed[:, None])[:, 0]
        return Reduced(y, self.reduce(self.design), len(y) - self._whitened.rank)

    def reduce(self, columns: Floats) -> Floats:
        """Columns (m, r), mm, in units of the noise scale, the placing projected out."""
        return self._whitened.without(columns / self.noise_scale[:, None])

    @cached_property
    def freedoms(self) -> Freedoms:
        """The columns of the placing, by placing where that is known."""
        return Freedoms.of(self.placing)

    @cached_property
    def _whitened(self) -> Freedoms:
        return self.freedoms.over(self.noise_scale)

    def at(self, rows: NDArray[np.bool_]) -> LinearModel:
        of_rows = {name: getattr(self, name)[rows] for name in ("observed", "design", "noise_scale")}
        return replace(self, **of_rows, placing=self.freedoms.at(rows))

    def only(self, parameters: Sequence[int]) -> LinearModel:
        """The model with some of its parameters, the others zero."""
        chosen = list(parameters)
        return replace(self, design=self.design[:, chosen], unknowns=tuple(self.unknowns[i] for i in chosen))

    def uncorrelated(self, whiten: Callable[[Floats], Floats]) -> LinearModel:
        """The same model in observations whose noise ``whiten`` has made white, of one coordinate's standard deviation."""
        design, placing = whiten(self.design), whiten(self.freedoms.dense())
        observed, scale = whiten(self.observed[:, None])[:, 0], np.ones(len(self.observed))
        return replace(self, observed=observed, design=design, placing=placing, noise_scale=scale)

    @property
    def priors(self) -> tuple[Floats, Floats]:
        """What is known beforehand as p observations of unit variance: rows (p, k), and what they give, (p,)."""
        known = np.isfinite(self.prior_sd)
        sd = self.effective_sd[known]
        return np.eye(len(known))[known] / sd[:, None], self.prior_mean[known] / sd

    @property
    def scale(self) -> Floats:
        return np.array([u.scale for u in self.unknowns])

    @property
    def prior_mean(self) -> Floats:
        return np.array([u.prior_mean for u in self.unknowns])

    @property
    def prior_sd(self) -> Floats:
        return np.array([u.prior_sd for u in self.unknowns])

    @property
    def effective_sd(self) -> Floats:
        """(k,) prior ones; a certificate without uncertainty is taken as good to a millionth of a typical size."""
        return np.maximum(self.prior_sd, 1e-6 * self.scale)


@dataclass(frozen=True, eq=False)
class Reduced:
    """Observations (m,) and design (m, k) in units of the noise scale, and how many observations they are worth."""

    observed: Floats
    design: Floats
    count: int


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

    @property
    def free(self) -> list[dict[tuple[str, str], float]]:
        """Parts by key of each combination that leaves all observations as they are."""
        keys = [unknown.key for unknown in self.unknowns]
        each = (zip(keys, column.tolist(), strict=True) for column in self.null_space.T)
        return [{key: part for key, part in column if part} for column in each]


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
    U, s, Vt = scipy.linalg.svd(reduced.design[:, free] * scale, full_matrices=False)
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
    _, _, order = scipy.linalg.qr(null_space.T, mode="economic", pivoting=True)
    pivots = order[: null_space.shape[1]]
    columns = null_space @ scipy.linalg.inv(null_space[pivots])
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
