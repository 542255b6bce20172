"""The posterior of a linear model under a noise of several components: everything linear integrated out, and drawn, exactly.

Given the sizes of the components, all else is normal. The observations enter through one matrix of inner products for each
class of observations with equal variance, so that the density at new sizes costs nothing that grows with their number.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property

import numpy as np

from cmm_uq.base.points import Floats, Ints
from cmm_uq.base.values import dataclass, replace
from cmm_uq.maths.inference.linear_model import Freedoms, LeastSquares, LinearModel
from cmm_uq.maths.inference.noise import GROWING, Components, Sizes, slow_variances
from cmm_uq.maths.inference.slow import SlowFirst, groups, products

# mm: from a nanometre to a centimetre; between them an unknown noise is uniform in its logarithm
SIGMA_BOUNDS = (1e-6, 10.0)
_JITTER = 1e-11  # relative; a recording that a model explains to the last digit leaves nothing to factorise
_NUMBERS = 500_000  # in one batch of matrices; the random numbers of draws follow batch by batch
_CACHED = 220_000  # in the matrices that are reckoned with at once: as many as a processor's cache holds
_MOST_FREE = 150  # columns of placings up to which slow noise is eliminated before them
_NUMBERS_DRAWN = 100_000_000  # in the matrices that all draws of the parameters take


@dataclass(frozen=True, eq=False)
class Marginal:
    """Log density of the sizes of the noise, and exact draws of the model's parameters for each."""

    model: LinearModel  # linear about its estimate
    noise: Components  # its components; observations as in the model
    estimate: LeastSquares  # of the model: deviations from it leave digits that lengths of half a metre would not

    @cached_property
    def _scale(self) -> float:
        return float(max(self.estimate.sigma_of_residuals, SIGMA_BOUNDS[0]))

    @cached_property
    def _freedoms(self) -> Freedoms:
        """Orthonormal columns of what each placing reaches, turned as the observations are, in units of the noise."""
        turned = self.model.freedoms.reached.turned(self.noise.turn)
        return replace(turned, columns=turned.columns * self._scale)

    @cached_property
    def _length(self) -> Floats:
        """(P,) by which columns [slow, parameters, observations] are divided."""
        design = self.model.design
        priors = np.where(np.isinf(self.model.prior_sd), 0.0, 1 / self.model.effective_sd)
        parameters = np.sqrt(np.sum(design**2, axis=0) / self._scale**2 + priors**2)
        others = np.full(self.noise.slow.shape[1], 1 / self._scale)
        return np.concatenate([others, np.where(parameters > 0, parameters, 1.0), [1.0]])

    @cached_property
    def _turned(self) -> Floats:
        """(m, P) columns [slow, parameters, observations], turned."""
        model = self.model
        left = model.observed - model.design @ self.estimate.value
        return np.asarray(self.noise.turn @ np.hstack([self.noise.slow, model.design, left[:, None]])) / self._length

    @cached_property
    def _products(self) -> Floats:
        """Inner products (c, P²) of the columns, by class of the observations."""
        index, shares = self.noise.classes
        return products(self._turned, self._turned, index, len(shares))

    @cached_property
    def _prior(self) -> Floats:
        """(P, P) precision of the columns beforehand, which is data too; of slow noise it is not known yet."""
        model, value, size = self.model, self.estimate.value, len(self._length)
        prior, sd = np.zeros((len(value), size)), model.effective_sd
        known = np.flatnonzero(np.isfinite(model.prior_sd))
        prior[known, size - 1 - len(value) + known] = 1 / sd[known]
        prior[known, -1] = (model.prior_mean - value)[known] / sd[known]
        prior = prior / self._length
        return np.asarray(prior.T @ prior)

    @cached_property
    def _blocks(self) -> Floats:
        """Inner products (c, blocks·j·(j + P)) of each placing's columns with themselves and with all others, by class."""
        freedoms, (index, shares) = self._freedoms, self.noise.classes
        j, classes = freedoms.columns.shape[1], len(shares)
        whole = np.hstack([freedoms.columns, self._turned])
        among = Freedoms(whole, index * freedoms.blocks + freedoms.index, classes * freedoms.blocks)
        each = [among.sums(freedoms.columns[:, [i]] * whole) for i in range(j)]
        return np.stack(each, axis=1).reshape(classes, -1) if each else np.zeros((classes, 0))

    @cached_property
    def _absent(self) -> Floats:
        """(blocks, j) one for columns that a placing lacks."""
        lengths = self._freedoms.sums(self._freedoms.columns**2) / self._scale**2
        return np.where(lengths > 0.5, 0.0, 1.0)

    @cached_property
    def _without_slow(self) -> tuple[Floats, Floats, Floats]:
        """Products and blocks without the columns of slow noise, whose coefficients are zero where it is absent."""
        P, c, j = len(self._length), self.noise.slow.shape[1], self._freedoms.columns.shape[1]
        found, prior = self._products.reshape(-1, P, P)[:, c:, c:], self._prior[c:, c:]
        blocks = self._blocks.reshape(len(found), -1, j + P)
        kept = np.delete(np.arange(j + P), np.arange(j, j + c))
        return found.reshape(len(found), -1), prior.ravel(), blocks[:, :, kept].reshape(len(found), -1)

    @cached_property
    def _counts(self) -> Floats:
        return np.bincount(self.noise.classes[0], minlength=len(self.noise.classes[1])).astype(np.float64)

    @cached_property
    def _slow_first(self) -> SlowFirst | None:
        """Products of slow noise with [placings, parameters, observations]; none where placings have too many columns."""
        if not self.noise.slow.shape[1] or self._freedoms.count > _MOST_FREE:
            return None
        return self._eliminating(*self.noise.classes)

    @cached_property
    def _slow_first_even(self) -> tuple[SlowFirst, Floats]:
        """The same where no noise grows, so that there are fewer classes of observations, and their shares."""
        index, shares = self.noise.classes
        others = np.round(np.delete(shares, GROWING, axis=1), 9)
        _, first, which = np.unique(others, axis=0, return_index=True, return_inverse=True)
        return self._eliminating(which.ravel()[index], shares[first]), shares[first]

    def _eliminating(self, index: Ints, shares: Floats) -> SlowFirst:
        c = self.noise.slow.shape[1]
        cosines, group = self._turned[:, :c], np.full(len(self._turned), -1)
        for number, (_, rows) in enumerate(groups(cosines)):
            group[rows] = number
        others = np.hstack([self._freedoms.apart(group).dense(), self._turned[:, c:]])
        return SlowFirst(cosines, others, index, shares[:, -1], self._walk)

    def _without_slow_noise(self, slow: SlowFirst, sizes: Sizes) -> tuple[Floats, Floats]:
        """As :meth:`_factors`, slow noise eliminated ahead of the placings."""
        shares = self.noise.classes[1]
        if not np.any(sizes.growth):
            slow, shares = self._slow_first_even
        v = self.noise.variances(sizes)[0] @ shares.T
        precision, walks, log = self._of_slow(sizes)
        c, free = precision.shape[1], self._freedoms.count
        P = len(self._length)
        prior = np.zeros((free + P - c, free + P - c))
        prior[free:, free:] = self._prior[c:, c:]
        at = np.arange(free)
        prior[at, at] = self._absent.ravel()
        left, logs = slow.precision(v, prior.ravel(), precision, walks)
        diagonal = np.arange(left.shape[1])
        left[:, diagonal, diagonal] *= 1 + _JITTER
        return cholesky(left), log - 0.5 * np.log(v) @ slow.counts - logs

    def _of_slow(self, sizes: Sizes) -> tuple[Floats, Floats, Floats]:
        """What is known beforehand of slow noise' coefficients.

        Precision (w, c) of all but walks; by what that of a walk is multiplied (w,), zero of what is none; half the logarithm
        of the determinant (w,).
        """
        variances = np.maximum(self.noise.variances(sizes)[1], (1e-6 * self._scale) ** 2)
        walks, constant = sizes.rate == 0, variances[:, 0]
        variances[walks] = constant[walks, None] * self._walked
        own = self._length[: variances.shape[1]]
        precision = np.where(walks[:, None], 0.0, 1 / (variances * own**2))
        return precision, np.where(walks, 1 / constant, 0.0), -0.5 * np.log(variances).sum(axis=1)

    @cached_property
    def _walked(self) -> Floats:
        """(c,) variances of the coefficients of a walk, over that of its first, which is a constant."""
        variances = slow_variances(np.ones(1), np.zeros(1), self.noise.frequency)[0][0]
        return np.asarray(variances / variances[0])

    @cached_property
    def _walk(self) -> Floats:
        """(c, c) precision of the coefficients of a walk whose constants have the variance one, but for what ties them."""
        own = self._length[: self.noise.slow.shape[1]]
        return np.asarray((np.diag(1 / self._walked) + self.noise.tied) / own / own[:, None])

    def _factors(self, sizes: Sizes) -> tuple[Floats, Floats]:
        """Lower factors (w, P, P) of precision and observations together, and the logarithm of what stands before them.

        What each placing leaves free is eliminated first, by itself; slow noise has no rows and columns where it is absent in
        all of the sizes, and comes first where there are few placings.
        """
        absent = not np.any(sizes.slow)
        if not absent and self._slow_first is not None:
            return self._without_slow_noise(self._slow_first, sizes)
        v = self.noise.variances(sizes)[0] @ self.noise.classes[1].T
        products, prior, blocks = self._without_slow if absent else (self._products, self._prior.ravel(), self._blocks)
        c = self.noise.slow.shape[1]
        P = len(self._length) - absent * c
        whole = ((1 / v) @ products).reshape(-1, P, P)
        whole += prior.reshape(P, P)
        log = -0.5 * np.log(v) @ self._counts
        if absent:  # what is left of slow noise whose variance goes to zero
            log += np.log(self._length[:c]).sum()
        else:
            precision, walks, own = self._of_slow(sizes)
            whole[:, :c, :c] += walks[:, None, None] * self._walk
            whole.reshape(len(whole), -1)[:, : c * P : P + 1] += precision
            log += own
        whole.reshape(len(whole), -1)[:, :: P + 1] *= 1 + _JITTER
        if self._freedoms.count:
            lost, own = self._eliminated(v, blocks)
            whole -= lost
            # of as many observations as freedoms nothing is left
            whole[:, -1, -1] = np.maximum(whole[:, -1, -1], np.finfo(np.float64).tiny)
            log -= own
        return cholesky(whole), log

    def _eliminated(self, v: Floats, products: Floats) -> tuple[Floats, Floats]:
        """What the placings take from the precision (w, P, P), and half the logarithm of their own determinant (w,)."""
        w, (blocks, j) = len(v), self._absent.shape
        each = ((1 / v) @ products).reshape(w * blocks, j, -1)
        diagonal = np.arange(j)
        own = each[:, :, :j]
        own[:, diagonal, diagonal] *= 1 + _JITTER
        own[:, diagonal, diagonal] += np.tile(self._absent, (w, 1))
        factor = cholesky(own)
        rows = each[:, :, j:]
        for i in range(j):  # forward substitution
            rows[:, i] /= factor[:, i, i, None]
            rows[:, i + 1 :] -= factor[:, i + 1 :, i, None] * rows[:, i, None]
        rows = rows.reshape(w, blocks * j, -1)
        logs = np.log(factor[:, diagonal, diagonal]).reshape(w, -1).sum(axis=1)
        return rows.transpose(0, 2, 1) @ rows, logs

    def _batches(self, sizes: Sizes, most: int = _NUMBERS) -> Iterator[Ints]:
        """Which sizes to reckon with at once: those without slow noise or growth, which need less, apart."""
        j, c = self._freedoms.columns.shape[1], self.noise.slow.shape[1]
        slow, even = sizes.slow > 0, sizes.growth == 0
        whole = (slow,) if self._slow_first is None else (slow & even, slow & ~even)
        each = [(~slow, len(self._length) - c, None), *((part, len(self._length), self._slow_first) for part in whole)]
        for chosen, P, first in each:
            numbers = first.numbers if first else P**2 + self._freedoms.count * (j + P)
            size = max(1, (most if first else _NUMBERS) // (numbers + 3 * len(self._counts)))
            at = np.flatnonzero(chosen)
            yield from (at[i : i + size] for i in range(0, len(at), size))

    def log_density(self, latent: Floats) -> Floats:
        """(w,) up to a constant, of the numbers (w, d) that say the sizes; minus infinity out of bounds."""
        low, high = np.log(max(SIGMA_BOUNDS[0], self.noise.least)), np.log(SIGMA_BOUNDS[1])
        inside = (latent[:, 0] > low) & (latent[:, 0] < high)
        held = np.where(np.isfinite(latent), latent, 0.0)
        held[:, 0] = np.clip(held[:, 0], low, high)
        sizes = self.noise.sizes(held)
        log, squares = self.log_likelihood(sizes)
        value = log - 0.5 * squares + self.noise.log_prior(held, sizes)
        return np.where(inside & np.isfinite(value), value, -np.inf)

    def log_likelihood(self, sizes: Sizes) -> tuple[Floats, Floats]:
        """Log likelihood (w,) of w sizes but for the sum of squares, and that sum (w,), of which half is to be subtracted."""
        logs, squares = np.empty(len(sizes.placing)), np.empty(len(sizes.placing))
        for part in self._batches(sizes, _CACHED):
            factors, log = self._factors(sizes.at(part))
            diagonal = np.einsum("wii->wi", factors)
            logs[part] = log - np.log(diagonal[:, :-1]).sum(axis=1)
            squares[part] = diagonal[:, -1] ** 2
        return logs, squares

    @property
    def affordable_draws(self) -> int:
        """How many draws of the parameters take a second or so; never fewer than ten thousand."""
        return max(10_000, _NUMBERS_DRAWN // len(self._length) ** 2)

    def draw(self, sizes: Sizes, random: np.random.Generator) -> Floats:
        """One exact draw (w, k) of the parameters for each of w sizes; sizes that come again are reckoned with once."""
        count, k = len(sizes.placing), len(self.model.unknowns)
        if not k:
            return np.zeros((count, 0))
        found = np.empty((count, k))
        first, index = sizes.different if np.any(sizes.slow) else (np.arange(count), np.arange(count))
        once = sizes.at(first)
        for part in self._batches(once):
            factors, _ = self._factors(once.at(part))
            # the parameters stand last before the observations: the lower right of the factor is all that they need
            lower, place = factors[:, -1 - k :, -1 - k : -1], np.full(len(first), -1)
            place[part] = np.arange(len(part))
            which = place[index]
            drawn = np.flatnonzero(which >= 0)
            own, mean = lower[which[drawn], :-1], lower[which[drawn], -1]
            normal = mean + random.standard_normal(mean.shape)
            for i in reversed(range(k)):  # back substitution
                normal[:, i] /= own[:, i, i]
                normal[:, :i] -= own[:, i, :i] * normal[:, i : i + 1]
            found[drawn] = normal
        return np.asarray(self.estimate.value + found / self._length[-1 - k : -1])


def cholesky(matrices: Floats) -> Floats:
    """Lower factors; ``nan`` for those that are not positive definite."""
    try:
        return np.asarray(np.linalg.cholesky(matrices))
    except np.linalg.LinAlgError:
        found = np.full_like(matrices, np.nan)
        for i, matrix in enumerate(matrices):
            try:
                found[i] = np.linalg.cholesky(matrix)
            except np.linalg.LinAlgError:
                continue
        return found
