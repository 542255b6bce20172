"""A linear model beside which errors act in families, each of a size that the observations themselves say.

    observed = design · parameters + Σ_f s_f · columns_f · c_f + placing · (anything) + noise,   c_f ~ N(0, 1)

Beforehand each s_f is half-normal: one stands for as large as physics allows, and none is excluded below. Given the sizes of
the families and of the noise everything is normal, so that these alone are sampled (emcee), by their exact density in the
space of observations; all else is drawn from its exact distribution given them (Matheron's rule: Chilès, Delfiner 2012,
Geostatistics, 7.3). A family shrinks by what observations show of it alone: where that is nothing, its density is the prior's.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from itertools import pairwise

import numpy as np
import scipy
from numpy.typing import NDArray

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats, Ints
from cmm_uq.base.values import dataclass, field
from cmm_uq.maths.inference.linear_model import LeastSquares, LinearModel, reached
from cmm_uq.maths.inference.marginal import cholesky
from cmm_uq.maths.inference.noise import Components, Sizes
from cmm_uq.maths.inference.within import WithinLimits

Drawn = Callable[[np.random.Generator, int], Floats]


def normal(count: int) -> Drawn:
    """Independent standard normal numbers, so many for each draw."""
    return lambda random, draws: random.standard_normal((draws, count))


# of the residuals' scatter: an observation that each coefficient, as large as physics allows, moves less shows only noise, as
# contrasts of repeats do, whose points are nearly the same; less still where all are as large as that. The same of orthonormal
# columns of the placings
_UNSEEN, _REACHED = (1e-4, 0.02), 1e-4
_QUADRATIC = 1e8  # above any sum of squares that is not absurd
_NUMBERS = 2_000_000  # in the matrices that are factorised at once
_CLASSES = 60  # of observations alike in their noise; of more, a matrix a component of the noise is less work


def _log_normal(covariance: Floats, values: Floats) -> Floats:
    """(N,) logarithms of the density of values (n, N), up to a constant."""
    factor = scipy.linalg.cholesky(covariance, lower=True)
    white = scipy.linalg.solve_triangular(factor, values, lower=True)
    return np.asarray(-np.log(np.diag(factor)).sum() - 0.5 * np.einsum("ij,ij->j", white, white))


@dataclass(frozen=True, eq=False)
class FieldErrors:
    family: str | None  # whose size they share; ``None`` where they have the size one
    columns: Floats  # (m, j) of the observations, mm, for one standard deviation of each at the size one
    draw: Drawn  # coefficients (N, j) beforehand, in standard deviations at the size one
    # (m, p) of the observations for an error at each of p places, and its covariance (p, p) at the size one, where that is
    # not by the columns
    impulse: Floats | None = None
    covariance: Floats | None = None


@dataclass(frozen=True, eq=False)
class FieldModel:
    """The linear model of a recording, the noise of its observations, and families of errors beside it."""

    linear: LinearModel
    noise: Components
    estimate: LeastSquares
    errors: tuple[FieldErrors, ...]
    # (k,) mm: of the last k observations, which no placing reaches, no more is known than that they lie so near to what is
    # ``observed`` of them
    limit: Floats = field(default_factory=lambda: np.zeros(0))

    @cached_property
    def _known(self) -> Ints:
        return np.flatnonzero(np.isfinite(self.linear.prior_sd))

    @cached_property
    def _turned(self) -> Floats:
        """(m, …) columns [parameters in prior standard deviations, families, deviation], turned."""
        linear, value = self.linear, self.estimate.value
        off = (linear.prior_mean - value)[self._known]
        left = linear.observed - linear.design @ value - linear.design[:, self._known] @ off
        own = linear.design[:, self._known] * linear.effective_sd[self._known]
        return np.asarray(self.noise.turn @ np.hstack([own, *(one.columns for one in self.errors), left[:, None]]))

    @cached_property
    def _free(self) -> Floats:
        """(m, q) turned columns of which nothing is known: of placings, and of sizes without a certificate."""
        linear = self.linear
        unknown = np.flatnonzero(~np.isfinite(linear.prior_sd))
        placing = reached(np.asarray(self.noise.turn @ linear.freedoms.dense()))
        sizes = np.asarray(self.noise.turn @ (linear.design[:, unknown] * linear.scale[unknown]))
        whole = reached(np.hstack([placing, sizes])) if len(unknown) else placing
        if whole.shape[1] < placing.shape[1] + len(unknown):
            raise CmmUqError("the recording leaves a size of its artefact open, of which nothing is known beforehand",
                             where="the calibration", fix="Give the artefact's length")  # fmt: skip
        return whole

    @cached_property
    def _rows(self) -> tuple[Ints, Ints]:
        """Turned observations that what is unknown moves, and those that show noise alone, as contrasts of repeats do."""
        m = len(self.linear.observed)
        if self.noise.slow.shape[1]:
            return np.arange(m), np.arange(0)
        least = _UNSEEN[bool(self.families)] * self.estimate.sigma_of_residuals
        moved = np.any(np.abs(self._turned[:, :-1]) > least, axis=1)
        moved[m - len(self.limit) :] = True
        acting = moved | np.any(np.abs(self._free) > _REACHED, axis=1)
        return np.flatnonzero(acting), np.flatnonzero(~acting)

    @cached_property
    def into(self) -> Floats:
        """(m, n) orthonormal combinations of the observations that no placing reaches, and something else does."""
        rows, m = self._rows[0], len(self.linear.observed)
        free = self._free[rows]
        Q, R, _ = scipy.linalg.qr(free, pivoting=True) if free.size else (np.eye(len(rows)), np.zeros((0, 0)), None)
        diagonal = np.abs(np.diag(R))
        rank = int(np.sum(diagonal > 1e-10 * diagonal.max(initial=0.0)))
        found = np.zeros((m, len(rows) - rank))
        found[rows] = Q[:, rank:]
        return found

    @cached_property
    def _seen(self) -> Floats:
        """(n, …) of these combinations, the columns as in :attr:`_turned`."""
        return self.into.T @ self._turned

    @cached_property
    def _each(self) -> list[Floats]:
        """(n, j) of these combinations for each of the errors."""
        ends = len(self._known) + np.cumsum([0, *(one.columns.shape[1] for one in self.errors)])
        return [self._seen[:, start:end] for start, end in pairwise(ends.tolist())]

    @cached_property
    def families(self) -> tuple[str, ...]:
        """Those whose size is to be found."""
        return tuple(dict.fromkeys(one.family for one in self.errors if one.family is not None))

    @cached_property
    def _parts(self) -> Floats:
        """(c + F + 1, n²) covariances for unit variances of the noise, of each family, and what has a known size."""
        index, shares = self.noise.classes
        apart = np.sqrt(shares) if len(shares) > _CLASSES else np.eye(len(shares))
        each, own = [own[index, None] * self.into for own in apart.T], self._seen[:, : len(self._known)]
        sized = dict.fromkeys((*self.families, None), np.zeros_like(own @ own.T))
        sized[None] = own @ own.T
        for one, seen in zip(self.errors, self._each, strict=True):
            if one.covariance is None or one.impulse is None:
                sized[one.family] = sized[one.family] + seen @ seen.T
            else:
                impulse = self.shown(one.impulse)
                sized[one.family] = sized[one.family] + impulse @ one.covariance @ impulse.T
        return np.stack([*(part.T @ part for part in each), *sized.values()]).reshape(len(each) + len(sized), -1)

    def shown(self, columns: Floats) -> Floats:
        """(n, p) of the combinations, of columns (m, p) of the observations."""
        return np.asarray(self.into.T @ np.asarray(self.noise.turn @ columns))

    @cached_property
    def _alone(self) -> tuple[Floats, Floats]:
        """Count and sum of squares, by class, of observations that show noise alone."""
        index, classes = self.noise.classes[0][self._rows[1]], len(self.noise.classes[1])
        squares = self._turned[self._rows[1], -1] ** 2
        count = np.bincount(index, minlength=classes).astype(np.float64)
        return count, np.bincount(index, weights=squares, minlength=classes).astype(np.float64)

    def _covariance(self, sizes: Sizes, scales: Floats) -> Floats:
        """(w, n, n) of the combinations, mm²."""
        return self._noise(sizes, np.hstack([scales**2, np.ones((len(scales), 1))]))

    def _noise(self, sizes: Sizes, more: Floats | None = None) -> Floats:
        """(w, n, n) of noise in them, mm², and ``more`` (w, F + 1): variances of families, and of what has a known size."""
        n, own, shares = self.into.shape[1], self.noise.variances(sizes)[0], self.noise.classes[1]
        weights = np.hstack([own if len(shares) > _CLASSES else own @ shares.T, *([] if more is None else [more])])
        found = (weights @ self._parts[: weights.shape[1]]).reshape(-1, n, n)
        if self.noise.slow.shape[1]:
            variances = self.noise.variances(sizes)[1]
            for i in np.flatnonzero(sizes.slow > 0):
                seen = self._wandering[int(sizes.rate[i] == 0)]
                found[i] += (seen * variances[i]) @ seen.T
        return np.asarray(found)

    @cached_property
    def _wandering(self) -> tuple[Floats, Floats]:
        """(n, c) of the combinations: of slow noise that returns to its mean, and of a walk."""
        return self.shown(self.noise.slow), self.shown(self.noise.anchored)

    def log_likelihood(self, sizes: Sizes, scales: Floats) -> Floats:
        """(w,) up to a constant, of sizes of the noise and of the families (w, F)."""
        found, within = self.recorded(sizes, scales)
        found = found + within.log_probability
        return np.where(np.isfinite(found), found, -np.inf)

    def recorded(self, sizes: Sizes, scales: Floats) -> tuple[Floats, WithinLimits]:
        """(w,) the same of all that was observed itself, and what then follows for that of which limits are known."""
        n, count, k = self.into.shape[1], len(scales), len(self.limit)
        m, mean, factors = n - k, np.empty((count, k)), np.empty((count, k, k))
        v = self.noise.variances(sizes)[0] @ self.noise.classes[1].T
        many, squares = self._alone
        found = -0.5 * (np.log(v) @ many + (1 / v) @ squares)
        step = max(1, _NUMBERS // (n + 1) ** 2)
        for i in range(0, count, step):
            part = slice(i, i + step)
            whole = np.empty((len(scales[part]), n + 1, n + 1))
            whole[:, :n, :n] = self._covariance(sizes.at(part), scales[part])
            whole[:, n, :n] = whole[:, :n, n] = self._seen[:, -1]
            whole[:, n, n] = _QUADRATIC
            factor = cholesky(whole)
            diagonal, last = np.einsum("wii->wi", factor), factor[:, n, :m]  # K = L·Lᵀ; L⁻¹·n, without any difference
            found[part] -= np.log(diagonal[:, :m]).sum(axis=1) + 0.5 * np.einsum("wi,wi->w", last, last)
            mean[part] = np.einsum("wji,wi->wj", factor[:, m:n, :m], last) - self._seen[m:, -1]
            factors[part] = factor[:, m:n, m:n]
        return found, WithinLimits(mean, factors @ factors.transpose(0, 2, 1), self.limit)

    def slopes(self, sizes: Sizes, scales: Floats) -> Floats:
        """(F,) of :meth:`log_likelihood` by squares of the families' sizes, of one draw (Rasmussen, Williams 2006, 5.9)."""
        inverse, parts = np.linalg.inv(self._covariance(sizes, scales)[0]), self._parts[-1 - len(self.families) : -1]
        weight = inverse @ self._seen[:, -1]
        return np.asarray(0.5 * (parts @ (np.outer(weight, weight) - inverse).ravel()))

    def draw(
        self,
        sizes: Sizes,
        scales: Floats,
        random: np.random.Generator,
        within: Floats | None = None,
        observed: Floats | None = None,
    ) -> Floats:
        """Exact draws (N, k + …), one for each of N sizes of noise and families (N, F), of which many may be the same.

        Parameters, not a number where they have no prior; then of each error its coefficients, in standard deviations at the
        size one, and, where its covariance is not by its columns, n numbers w more, for which its errors at any places are
        larger by (covariance with the p places) · ``shown(impulse)``ᵀ · w. ``within``: (N, k) of the observations of which
        limits are known, how far each is from what is ``observed`` of it. ``observed``: (N, n) of the combinations, as
        other observations of each draw have them (:attr:`combined`).
        """
        table = np.column_stack([*vars(sizes).values(), scales])
        order = np.lexsort(table.T[::-1])
        new = np.append(True, np.any(np.diff(table[order], axis=0) != 0, axis=1))
        found = np.empty((len(scales), len(self.linear.unknowns) + len(self._stacked[2])))
        for rows in np.split(order, np.flatnonzero(new)[1:]):
            i = int(rows[0])
            found_in = self.combined if observed is None else observed[rows]
            if within is not None:
                found_in = found_in + np.pad(within[rows], ((0, 0), (len(self.combined) - within.shape[1], 0)))
            found[rows] = self._drawn(sizes.at(slice(i, i + 1)), scales[i], len(rows), random, found_in)
        return found

    @property
    def combined(self) -> Floats:
        """(n,) what was observed of the combinations, beyond what is expected of them beforehand."""
        return np.asarray(self._seen[:, -1])

    def log_densities(self, sizes: Sizes, scales: Floats, observed: Floats, without: int) -> Floats:
        """(w, N) of the last ``without`` observations given all others, up to a constant, by sizes (w,) and (w, F).

        ``observed``: (n, N) combinations, which differ in those observations alone.
        """
        found = np.empty((len(scales), observed.shape[1]))
        last = self.into[len(self.into) - without :]
        others = scipy.linalg.null_space(last)  # combinations of the other observations alone
        for i, scale in enumerate(scales):
            whole = self._covariance(sizes.at(slice(i, i + 1)), scale[None])[0]
            found[i] = _log_normal(whole, observed) - _log_normal(others.T @ whole @ others, others.T @ observed)
        return found

    @cached_property
    def _stacked(self) -> tuple[Floats, Floats, Ints, NDArray[np.bool_]]:
        """Of the t numbers of a draw's errors: columns (n, t), gains (n, t), sizes (t,), and which (t,) are drawn beforehand.

        Gains: by how much each changes with the weight of each combination, at the size one.
        """
        seen, gains, sized, own = [np.zeros((self.into.shape[1], 0))], list[Floats](), list[int](), list[bool]()
        for one, columns in zip(self.errors, self._each, strict=True):
            n, j = columns.shape
            more = 0 if one.covariance is None else n
            seen.append(np.hstack([columns, np.zeros((n, more))]))
            gains.append(np.hstack([np.zeros_like(columns), np.eye(n)]) if more else columns)
            sized += [len(self.families) if one.family is None else self.families.index(one.family)] * (j + more)
            own += [True] * j + [False] * more
        return np.hstack(seen), np.hstack([seen[0], *gains]), np.array(sized, dtype=np.int64), np.array(own, dtype=bool)

    def _drawn(self, sizes: Sizes, scale: Floats, count: int, random: np.random.Generator, observed: Floats) -> Floats:
        known, noise = len(self._known), self.noise
        factor = scipy.linalg.cho_factor(self._covariance(sizes, scale[None])[0])
        variance = (noise.variances(sizes)[0] @ noise.shares.T)[0]
        # what was observed less all that could have been: parameters, errors, noise
        own = random.standard_normal((count, known))
        left = observed - own @ self._seen[:, :known].T
        left -= (random.standard_normal((count, len(variance))) * np.sqrt(variance)) @ self.into
        if noise.slow.shape[1] and sizes.slow[0] > 0:
            waves = self.shown(noise.waves(sizes))
            left -= random.standard_normal((count, waves.shape[1])) @ waves.T
        seen, gain, sized, beforehand = self._stacked
        size, errors = np.append(scale, 1.0)[sized], np.zeros((count, len(sized)))
        errors[:, beforehand] = np.hstack([np.zeros((count, 0)), *(one.draw(random, count) for one in self.errors)])
        errors *= size
        left -= errors @ seen.T
        weight = scipy.linalg.cho_solve(factor, left.T).T
        errors += weight @ (gain * size**2)
        return np.hstack([self._parameters(own + weight @ self._seen[:, :known]), errors])

    def _parameters(self, own: Floats) -> Floats:
        found = np.full((len(own), len(self.linear.unknowns)), np.nan)
        found[:, self._known] = self.linear.prior_mean[self._known] + own * self.linear.effective_sd[self._known]
        return found

    def normal(self, sizes: Sizes, scale: Floats) -> tuple[Floats, Floats]:
        """Mean and covariance of what :meth:`draw` draws, for sizes of noise (one draw) and of families (F,)."""
        known = len(self._known)
        whole = self._covariance(sizes, scale[None])[0]
        sd = self.linear.effective_sd[self._known]
        columns, gain, sized, beforehand = self._stacked
        size = np.append(scale, 1.0)[sized]
        prior = np.append(np.ones(known), np.where(beforehand, size, 0.0))
        seen = np.hstack([self._seen[:, :known], columns]) * prior
        to_each = np.linalg.solve(whole, np.hstack([self._seen[:, :known] * sd, gain * size**2])).T
        residue = np.diag(np.append(sd, np.ones(len(sized))) * prior) - to_each @ seen
        noise = self._noise(sizes)[0]
        mean = to_each @ self._seen[:, -1]
        mean[:known] += self.linear.prior_mean[self._known]
        return mean, residue @ residue.T + to_each @ noise @ to_each.T
