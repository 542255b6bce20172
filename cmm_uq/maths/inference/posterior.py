"""The posterior of a linear model and of its noise, sampled by emcee, and what is in doubt that residuals do not show.

An error of the artefact's temperature changes every length of a recording at once. Residuals do not show it, and no repeat
averages it out: its standard uncertainty is stated, not estimated, and reaches estimates by their sensitivities to the
observations (JCGM 100:2008, 5.1.2 and F.1.2.3). Where it is not known whether an error is the same in all set-ups or each
set-up has its own, both are computed, and of each figure the larger variance stands. Of every correlation between them, from
none to one, the variance lies between the two, for it is linear in that correlation.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
import scipy
from numpy.typing import NDArray

from cmm_uq.base.messages import Text
from cmm_uq.base.points import Floats, Ints
from cmm_uq.base.values import dataclass, field, replace
from cmm_uq.maths.inference.ensembles import BURN_IN, LEAST_EFFECTIVE_SAMPLES, Convergence, Progress, run_ensembles
from cmm_uq.maths.inference.linear_model import Freedoms, LeastSquares, LinearModel, Unknown
from cmm_uq.maths.inference.marginal import SIGMA_BOUNDS, Marginal
from cmm_uq.maths.inference.noise import NEGLIGIBLE, SLOW, Components, Sizes
from cmm_uq.maths.inference.presence import Proposes, beginning, present
from cmm_uq.maths.inference.proposals import Proposal, tempered, weights
from cmm_uq.maths.uncertainty.quantity import Quantity

# of ln σ: how near to the end of the range searched is at its end, and the step through the whole range
_EDGE, _STEP = 0.01, 0.5
_LOOKED_AT = 2000  # draws by which it is judged whether slow noise is quicker than a few cosines
_BURN_IN = 30  # steps left out where what is proposed knows which components are present


@dataclass(frozen=True, eq=False)
class Posterior(Convergence):
    unknowns: tuple[Unknown, ...]  # k parameters
    draws: Floats  # (N, k) in the parameters' units
    sigma: Floats  # (N,) standard uncertainty of one coordinate, mm; constant when it was stated
    seed: int  # of the random numbers
    shapes: Floats = field(default_factory=lambda: np.zeros((0, 0)))  # (N, q) of what shapes columns, if anything does
    every: int = 1  # of how many steps one was kept as a draw

    @cached_property
    def covariance(self) -> Floats:
        return np.atleast_2d(np.cov(self.draws, rowvar=False))


@dataclass(frozen=True, eq=False, kw_only=True)
class NoisyPosterior(Posterior):
    """A posterior with the sizes of the noise's components in each draw."""

    sizes: Sizes


@dataclass(frozen=True, eq=False)
class Density:
    """Log posterior density of the parameters and, unless it is stated, ln σ.

    The observations enter only through the triangular factor of the design, so one evaluation costs k² operations.
    """

    model: LinearModel

    @cached_property
    def _factor(self) -> tuple[Floats, Floats, float, int]:
        reduced = self.model.reduced
        Q, R = scipy.linalg.qr(reduced.design, mode="economic")
        explained = Q.T @ reduced.observed
        rest = reduced.observed - Q @ explained
        return np.asarray(R, dtype=np.float64), explained, float(rest @ rest), reduced.count

    @property
    def dimension(self) -> int:
        """Parameters, and one more when the noise is to be estimated."""
        return len(self.model.unknowns) + (self.model.sigma is None)

    @cached_property
    def _weight(self) -> Floats:
        return np.asarray(1 / self.model.effective_sd**2, dtype=np.float64)

    def __call__(self, theta: Floats) -> Floats:
        R, explained, rest, count = self._factor
        k = len(self.model.unknowns)
        misfit = theta[:, :k] @ R.T - explained
        squares = np.einsum("wi,wi->w", misfit, misfit) + rest
        prior = ((theta[:, :k] - self.model.prior_mean) ** 2) @ self._weight
        if self.model.sigma is not None:
            return np.asarray(-0.5 * (squares / self.model.sigma**2 + prior))
        log_sigma = theta[:, k]
        inside = (log_sigma > np.log(SIGMA_BOUNDS[0])) & (log_sigma < np.log(SIGMA_BOUNDS[1]))
        precision = np.exp(-2 * np.maximum(log_sigma, np.log(SIGMA_BOUNDS[0])))
        value = -0.5 * (squares * precision + prior) - count * log_sigma
        return np.where(inside, value, -np.inf)

    def conditional(self, log_sigma: float) -> tuple[Floats, Floats, float]:
        """Exact Gaussian of the parameters for a given noise: mean, covariance, and ln p(observations, ln σ)."""
        R, explained, rest, count = self._factor
        sigma2 = np.exp(2 * log_sigma)
        precision = R.T @ R / sigma2 + np.diag(self._weight)
        scale = 1 / np.sqrt(np.diag(precision))
        factor = scipy.linalg.cholesky(precision * np.outer(scale, scale), lower=True)
        right = (R.T @ explained / sigma2 + self._weight * self.model.prior_mean) * scale
        mean = scale * scipy.linalg.cho_solve((factor, True), right)
        covariance = np.outer(scale, scale) * scipy.linalg.cho_solve((factor, True), np.eye(len(scale)))
        misfit = explained - R @ mean
        deviation = mean - self.model.prior_mean
        squares = (misfit @ misfit + rest) / sigma2 + deviation @ (self._weight * deviation)
        volume = float(np.log(scale).sum() - np.log(np.diag(factor)).sum())
        return mean, covariance, float(-0.5 * squares - count * log_sigma + volume)

    def laplace(self) -> tuple[Floats, Floats]:
        """Centre (dimension,) and lower triangular factor of the covariance about it."""
        if self.model.sigma is not None:
            mean, covariance, _ = self.conditional(float(np.log(self.model.sigma)))
            return mean, _lower(covariance)
        _, _, rest, count = self._factor
        start = 0.5 * np.log(max(rest / max(count, 1), SIGMA_BOUNDS[0] ** 2 * 4))
        mode = self._likeliest_noise(float(start))
        mean, covariance, at_mode = self.conditional(mode)
        step = 0.1
        curvature = (2 * at_mode - self.conditional(mode - step)[2] - self.conditional(mode + step)[2]) / step**2
        k = len(mean)
        factor = np.zeros((k + 1, k + 1))
        factor[:k, :k] = _lower(covariance)
        factor[k, k] = 1 / np.sqrt(max(curvature, 1e-3))
        return np.append(mean, mode), factor

    def _likeliest_noise(self, start: float) -> float:
        """Ln σ at which the evidence is largest, near to ``start``.

        Where parameters with priors could explain every residual, nothing is left of them to start from; the largest
        evidence then lies further up than it is looked for, and the whole range is gone through.
        """
        low, high = max(start - 4, np.log(SIGMA_BOUNDS[0])), min(start + 4, np.log(SIGMA_BOUNDS[1]))
        found = float(self._largest_evidence(low, high))
        if found < high - _EDGE:
            return found
        places = np.arange(low, np.log(SIGMA_BOUNDS[1]), _STEP)
        best = float(places[np.argmax([self.conditional(float(place))[2] for place in places])])
        return float(self._largest_evidence(best - _STEP, min(best + _STEP, np.log(SIGMA_BOUNDS[1]))))

    def _largest_evidence(self, low: float, high: float) -> float:
        from scipy import optimize  # takes longer to import than most commands run

        found = optimize.minimize_scalar(lambda t: -self.conditional(t)[2], bounds=(low, high), method="bounded")
        return float(found.x)


def _lower(covariance: Floats) -> Floats:
    scale = np.sqrt(np.diag(covariance))
    return np.asarray(scale[:, None] * scipy.linalg.cholesky(covariance / np.outer(scale, scale), lower=True))


def sample(model: LinearModel, seed: int, progress: Progress | None = None) -> Posterior:
    """Sample the posterior of a linear model with emcee; ``progress`` gets the part done, from 0 to 1."""
    density = Density(model)
    centre, factor = density.laplace()
    chains = run_ensembles(density, Proposal.single(centre, factor), seed, progress)
    k = len(model.unknowns)
    sigma = np.full(len(chains.draws), model.sigma) if model.sigma is not None else np.exp(chains.draws[:, k])
    return Posterior(model.unknowns, chains.draws[:, :k], sigma, seed, **chains.quality)


def sample_with_noise(
    model: LinearModel, noise: Components, estimate: LeastSquares, seed: int, progress: Progress | None = None
) -> NoisyPosterior:
    """Sample the posterior of a linear model and of its noise; ``progress`` gets the part done, from 0 to 1."""
    marginal, proposal = sufficient(Marginal(model, noise, estimate), seed)
    noise = marginal.noise
    chains = run_ensembles(
        marginal.log_density,
        proposal,
        seed,
        progress,
        effective_samples=LEAST_EFFECTIVE_SAMPLES,
        steps_at_once=100,
        walkers=max(16, (2 if noise.most else 4) * noise.dimension + 2 * bool(noise.most)),
        burn_in=_BURN_IN if noise.most else BURN_IN,
    )  # everything but the noise is drawn independently, given it
    every = chains.thinning(marginal.affordable_draws)
    sizes = noise.sizes(chains.thinned(every))
    random = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(5,)))
    draws = marginal.draw(sizes, random)
    return NoisyPosterior(model.unknowns, draws, sizes.coordinate, seed, every=every, sizes=sizes, **chains.quality)


def sufficient(marginal: Marginal, seed: int) -> tuple[Marginal, Proposes]:
    """The density with as many cosines as slow noise of this recording takes, and what to propose for it."""
    centre, factor = start(marginal)
    if SLOW not in marginal.noise.possible:
        return marginal, tempered(marginal.log_density, centre, factor, seed)
    fewer = replace(marginal, noise=marginal.noise.fewer)
    proposal = present(fewer.log_density, beginning(marginal.noise.names, centre[0], factor[0, 0]), seed)
    if fewer.noise is marginal.noise:
        return marginal, proposal
    random = np.random.RandomState(np.random.MT19937(np.random.SeedSequence(seed, spawn_key=(13,))))
    latent = proposal.draws(_LOOKED_AT, random)
    weight = weights(fewer.log_density(latent) - proposal.log_density(latent))
    if weight @ fewer.noise.quick(fewer.noise.sizes(latent)) < NEGLIGIBLE:
        return fewer, proposal
    return marginal, present(marginal.log_density, proposal, seed, looks=1)


def start(marginal: Marginal) -> tuple[Floats, Floats]:
    """Centre and factor from which to look: the residuals' scatter, the prior of all else."""
    d = marginal.noise.dimension
    dof = max(marginal.estimate.degrees_of_freedom, 1)
    centre = np.zeros(d)
    sigma = np.log(max(marginal.estimate.sigma, 2e-6, marginal.noise.display / 5)) - (0.5 if d > 1 else 0.0)
    centre[0] = max(sigma, np.log(marginal.noise.known) + 1 / np.sqrt(2 * dof)) if marginal.noise.known else sigma
    return centre, np.diag([1 / np.sqrt(2 * dof) + (0.7 if d > 1 else 0.0), *np.ones(d - 1)])


@dataclass(frozen=True, eq=False)
class Cause:
    name: Text  # in words
    common: Floats  # (m, r) change of each observation, mm, for one standard uncertainty of each of r independent parts
    apart: Freedoms | None = None  # where each block errs by itself; ``None`` where all are known to err together
    # (m,) change for one standard uncertainty of what is in the draws already, as that of a certified size is: it stands for
    # ``common``, which is then zero, and of ``apart`` only what is more counts
    included: Floats | None = None

    @classmethod
    def of_blocks(cls, name: Text, changes: Floats, block: Ints) -> Cause:
        """One that changes observations by ``changes`` (m,) or (m, r) mm, all as one or those of one ``block`` (m,) apart."""
        _, index = np.unique(block, return_inverse=True)
        columns = changes.reshape(len(changes), -1)
        return cls(name, columns, Freedoms(columns, index.ravel(), int(index.max(initial=-1)) + 1))

    def at(self, rows: NDArray[np.bool_]) -> Cause:
        apart = None if self.apart is None else self.apart.at(rows)
        included = None if self.included is None else self.included[rows]
        return Cause(self.name, self.common[rows], apart, included)

    def drawn(self, shape: tuple[int, ...], random: np.random.Generator, *, apart: bool) -> Floats:
        if not apart or self.apart is None:
            return np.asarray(random.standard_normal((*shape, self.common.shape[1])) @ self.common.T)
        own = random.standard_normal((*shape, self.apart.blocks, self.apart.columns.shape[1]))
        return np.asarray(np.einsum("...mj,mj->...m", own[..., self.apart.index, :], self.apart.columns))

    def carried(self, weights: Floats) -> tuple[Floats, Floats]:
        """Change of combinations (k, m) of the observations, for one standard uncertainty: (k, r) common, (k, q) apart."""
        common = weights @ self.common
        if self.apart is None:
            return common, common
        each = np.vstack([self.apart.sums(weights.T * column[:, None]) for column in self.apart.columns.T]).T
        if self.included is not None:
            whole, known = np.sum(each**2, axis=1), (weights @ self.included) ** 2
            more = np.divide(whole - known, whole, out=np.zeros_like(whole), where=whole > known)
            each = each * np.sqrt(more)[:, None]
        return common, each


@dataclass(frozen=True, eq=False)
class Doubt:
    """What is in doubt about k estimates by causes that the residuals do not show."""

    # of each cause the changes of the estimates, all observations erring together (k, r) and apart (k, q)
    carried: tuple[tuple[Floats, Floats], ...]
    causes: tuple[Cause, ...] = ()  # of the observations that these estimates are from

    @classmethod
    def of(cls, causes: Sequence[Cause], weights: Floats) -> Doubt:
        return cls(tuple(cause.carried(weights) for cause in causes), tuple(causes))

    def variance(self, combination: Floats) -> float:
        """Of a combination (k,) of the estimates, in their units: of each cause the larger one."""
        return float(sum(max(*(np.sum((combination @ part) ** 2) for part in each)) for each in self.carried))

    def covariance(self) -> Floats:
        """(k, k), its diagonal of each cause the larger; estimates that different readings decide for do not correlate."""
        whole = 0.0
        for common, apart in self.carried:
            own = np.sum(apart**2, axis=1) > np.sum(common**2, axis=1)
            together, alone = np.where(own[:, None], 0.0, common), np.where(own[:, None], apart, 0.0)
            whole = whole + together @ together.T + alone @ alone.T
        return np.asarray(whole)

    def widened(self, draws: Floats, seed: int) -> Floats:
        """Draws (N, k) with what is in doubt, about the same mean."""
        random = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(23,)))
        normal = random.standard_normal(draws.shape)
        return np.asarray(draws + (normal - normal.mean(axis=0)) @ symmetric_root(self.covariance()).T)

    def larger(self, quantity: Quantity, combination: Floats) -> Quantity:
        """A combination (k,) of widened draws, its variance not below what is in doubt of it by itself."""
        more = self.variance(combination) - float(combination @ self.covariance() @ combination)
        if more <= 1e-9 * quantity.u**2:
            return quantity
        wider = float(np.sqrt(1 + more / quantity.u**2))
        low, high = (quantity.value + wider * (end - quantity.value) for end in quantity.interval95)
        return replace(quantity, u=wider * quantity.u, interval95=(low, high))


def symmetric_root(covariance: Floats) -> Floats:
    """(k, k) of a covariance, in units of its deviations: axes of one length turn with the last digits, their sum does not."""
    scale = np.sqrt(np.diag(covariance))
    scale = np.where(scale > 0, scale, 1.0)
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    return np.asarray(scale[:, None] * ((vectors * np.sqrt(np.maximum(values, 0.0))) @ vectors.T))


def gain(linear: LinearModel, sigma: float) -> Floats:
    """By how much each estimate changes with each observation, (k, m), under noise ``sigma``, mm, of a coordinate."""
    _, covariance, _ = Density(replace(linear, sigma=sigma)).conditional(float(np.log(sigma)))
    return np.asarray(covariance @ linear.reduced.design.T / sigma**2 / linear.noise_scale)
