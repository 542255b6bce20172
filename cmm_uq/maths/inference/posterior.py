"""The posterior of a linear model and of its noise, sampled by emcee."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy import linalg

from cmm_uq.base.points import Floats
from cmm_uq.maths.inference.ensembles import BURN_IN, LEAST_EFFECTIVE_SAMPLES, Progress, converged, run_ensembles
from cmm_uq.maths.inference.least_squares import LeastSquares
from cmm_uq.maths.inference.linear_model import LinearModel, Unknown
from cmm_uq.maths.inference.marginal import Marginal
from cmm_uq.maths.inference.noise import NEGLIGIBLE, SLOW, Components, Sizes
from cmm_uq.maths.inference.presence import beginning, present
from cmm_uq.maths.inference.proposals import Proposal, Proposes, tempered, weights

__all__ = ["SIGMA_BOUNDS", "Density", "Posterior", "Progress", "sample"]
# mm: from a nanometre to a centimetre; between them an unknown noise is uniform in its logarithm
SIGMA_BOUNDS = (1e-6, 10.0)
# of ln σ: how near to the end of the range searched is at its end, and the step through the whole range
_EDGE, _STEP = 0.01, 0.5
_LOOKED_AT = 2000  # draws by which it is judged whether slow noise is quicker than a few cosines
_BURN_IN = 30  # steps left out where what is proposed knows which components are present


@dataclass(frozen=True, eq=False)
class Posterior:
    """Draws from a posterior, and whether they can be trusted."""

    unknowns: tuple[Unknown, ...]  # k parameters
    draws: Floats  # (N, k) in the parameters' units
    sigma: Floats  # (N,) standard uncertainty of one coordinate, mm; constant when it was stated
    seed: int  # of the random numbers
    sampler: str  # program and version
    ess_min: float  # worst over all parameters and the noise
    rhat_max: float  # the same
    steps: int  # of each chain
    autocorrelation_time: float  # the longest
    shapes: Floats = field(default_factory=lambda: np.zeros((0, 0)))  # (N, q) of what shapes columns, if anything does
    every: int = 1  # of how many steps one was kept as a draw

    @property
    def converged(self) -> bool:
        """Enough effective samples, ensembles that agree, chains long against their autocorrelation time."""
        return converged(self.ess_min, self.rhat_max, self.steps, self.autocorrelation_time)

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
        Q, R = linalg.qr(reduced.design, mode="economic")
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
        factor = linalg.cholesky(precision * np.outer(scale, scale), lower=True)
        right = (R.T @ explained / sigma2 + self._weight * self.model.prior_mean) * scale
        mean = scale * linalg.cho_solve((factor, True), right)
        covariance = np.outer(scale, scale) * linalg.cho_solve((factor, True), np.eye(len(scale)))
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
    return np.asarray(scale[:, None] * linalg.cholesky(covariance / np.outer(scale, scale), lower=True))


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
    return NoisyPosterior(
        unknowns=model.unknowns,
        draws=draws,
        sigma=sizes.coordinate,
        seed=seed,
        every=every,
        sizes=sizes,
        **chains.quality,
    )


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
