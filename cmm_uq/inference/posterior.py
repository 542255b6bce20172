"""The posterior of a linear model, sampled by emcee.

The ensembles start from the Laplace approximation and move in coordinates whitened by it, so that most steps are
independence proposals from a multivariate t distribution; differential-evolution steps repair what the approximation
misses. (emcee's snooker move is not used: its normalisation is wrong in release 3.1.6.) Several independent ensembles run
until the autocorrelation time says enough.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy import linalg, optimize

from cmm_uq.inference.linear_model import LinearModel, Unknown
from cmm_uq.points import Floats

SIGMA_BOUNDS = (1e-6, 10.0)
"""mm: from a nanometre to a centimetre; between them an unknown noise is uniform in its logarithm."""

ENSEMBLES = 4
STEPS_AT_ONCE = 300
MOST_STEPS = 6000
BURN_IN = 60
EFFECTIVE_SAMPLES = 4000
"""Asked of every parameter: the interval's ends are then stable to about 3 % of u, below the last digit printed."""

LEAST_EFFECTIVE_SAMPLES = 1000
LARGEST_RHAT = 1.01
_T_DOF = 6.0

Progress = Callable[[float], None]


@dataclass(frozen=True, eq=False)
class Posterior:
    """Draws from a posterior, and whether they can be trusted.

    Attributes
    ----------
    unknowns : k parameters.
    draws : (N, k) in the parameters' units.
    sigma : (N,) standard uncertainty of one coordinate, mm; constant when it was stated.
    seed : of the random numbers.
    sampler : program and version.
    ess_min, rhat_max : worst over all parameters and the noise.
    steps, autocorrelation_time : length of each chain, and the longest time.
    """

    unknowns: tuple[Unknown, ...]
    draws: Floats
    sigma: Floats
    seed: int
    sampler: str
    ess_min: float
    rhat_max: float
    steps: int
    autocorrelation_time: float

    @property
    def converged(self) -> bool:
        """At least 1000 effective samples, R-hat below 1.01, and chains longer than 50 autocorrelation times."""
        return bool(
            self.ess_min >= LEAST_EFFECTIVE_SAMPLES
            and self.rhat_max < LARGEST_RHAT
            and self.steps > 50 * self.autocorrelation_time
        )

    @cached_property
    def covariance(self) -> Floats:
        """(k, k) of the draws."""
        return np.atleast_2d(np.cov(self.draws, rowvar=False))


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
        """Inverse prior variances, (k,); a certificate without uncertainty is taken as good to a nanometre."""
        sd = self.model.prior_sd
        scale = np.array([u.scale for u in self.model.unknowns])
        return np.asarray(1 / np.maximum(sd, 1e-6 * scale) ** 2, dtype=np.float64)

    def __call__(self, theta: Floats) -> Floats:
        """Log density, up to a constant, of (w, dimension) → (w,)."""
        R, explained, rest, count = self._factor
        k = len(self.model.unknowns)
        misfit = theta[:, :k] @ R.T - explained
        squares = np.einsum("wi,wi->w", misfit, misfit) + rest
        prior = ((theta[:, :k] - self.model.prior_mean) ** 2) @ self._weight
        if self.model.sigma is not None:
            return np.asarray(-0.5 * (squares / self.model.sigma**2 + prior))
        log_sigma = theta[:, k]
        inside = (log_sigma > np.log(SIGMA_BOUNDS[0])) & (log_sigma < np.log(SIGMA_BOUNDS[1]))
        value = -0.5 * (squares * np.exp(-2 * log_sigma) + prior) - count * log_sigma
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
        log_evidence = (
            -0.5 * ((misfit @ misfit + rest) / sigma2 + deviation @ (self._weight * deviation))
            - count * log_sigma + float(np.log(scale).sum() - np.log(np.diag(factor)).sum())
        )  # fmt: skip
        return mean, covariance, float(log_evidence)

    def laplace(self) -> tuple[Floats, Floats]:
        """Centre (dimension,) and lower triangular factor of the covariance about it."""
        if self.model.sigma is not None:
            mean, covariance, _ = self.conditional(float(np.log(self.model.sigma)))
            return mean, _lower(covariance)
        _, _, rest, count = self._factor
        start = 0.5 * np.log(max(rest / max(count, 1), SIGMA_BOUNDS[0] ** 2 * 4))
        found = optimize.minimize_scalar(
            lambda t: -self.conditional(t)[2],
            bounds=(max(start - 4, np.log(SIGMA_BOUNDS[0])), min(start + 4, np.log(SIGMA_BOUNDS[1]))),
            method="bounded",
        )
        mean, covariance, at_mode = self.conditional(float(found.x))
        step = 0.1
        curvature = (
            2 * at_mode - self.conditional(float(found.x) - step)[2] - self.conditional(float(found.x) + step)[2]
        ) / step**2
        k = len(mean)
        factor = np.zeros((k + 1, k + 1))
        factor[:k, :k] = _lower(covariance)
        factor[k, k] = 1 / np.sqrt(max(curvature, 1e-3))
        return np.append(mean, found.x), factor


def _lower(covariance: Floats) -> Floats:
    scale = np.sqrt(np.diag(covariance))
    return np.asarray(scale[:, None] * linalg.cholesky(covariance / np.outer(scale, scale), lower=True))


def sample(model: LinearModel, seed: int, progress: Progress | None = None) -> Posterior:
    """Sample the posterior of a linear model with emcee.

    Parameters
    ----------
    model : with proper priors or data on every parameter.
    seed : the same seed gives the same draws.
    progress : told the part done, from 0 to 1.
    """
    import emcee

    density = Density(model)
    centre, factor = density.laplace()
    d, k = density.dimension, len(model.unknowns)
    walkers = max(32, 4 * d + 4 * d % 2)
    samplers = []
    for child in np.random.SeedSequence(seed).spawn(ENSEMBLES):
        sampler = emcee.EnsembleSampler(
            walkers, d, lambda z: density(centre + z @ factor.T), vectorize=True,
            moves=[(emcee.moves.MHMove(_independence), 0.9), (emcee.moves.DEMove(), 0.1)],
        )  # fmt: skip
        random = np.random.RandomState(np.random.MT19937(child))
        sampler.random_state = random.get_state()
        sampler.run_mcmc(_t_draws(walkers, d, random), BURN_IN, store=False)
        samplers.append((sampler, sampler._previous_state))
    return _run(model, density, samplers, centre, factor, seed, progress, f"emcee {emcee.__version__}", k)


def _run(
    model: LinearModel,
    density: Density,
    samplers: list[tuple[Any, Any]],
    centre: Floats,
    factor: Floats,
    seed: int,
    progress: Progress | None,
    name: str,
    k: int,
) -> Posterior:
    steps, states = 0, [state for _, state in samplers]
    while True:
        for i, (sampler, _) in enumerate(samplers):
            states[i] = sampler.run_mcmc(states[i], STEPS_AT_ONCE, skip_initial_state_check=True)
        steps += STEPS_AT_ONCE
        chains = np.stack([sampler.get_chain() for sampler, _ in samplers])
        time, effective = _effective_samples(chains)
        if progress:
            progress(min(1.0, effective / EFFECTIVE_SAMPLES))
        if (effective >= EFFECTIVE_SAMPLES and steps > 50 * time) or steps >= MOST_STEPS:
            break
    rhat = _rhat(chains.reshape(ENSEMBLES, -1, density.dimension))
    draws = centre + chains.reshape(-1, density.dimension) @ factor.T
    sigma = np.full(len(draws), model.sigma) if model.sigma is not None else np.exp(draws[:, k])
    return Posterior(model.unknowns, draws[:, :k], sigma, seed, name, effective, rhat, steps, time)


def _independence(coordinates: Floats, random: Any) -> tuple[Floats, Floats]:
    """Proposal from a multivariate t about the origin of the whitened coordinates, with its Hastings ratio."""
    proposed = _t_draws(len(coordinates), coordinates.shape[1], random)
    return proposed, _t_log_density(coordinates) - _t_log_density(proposed)


def _t_draws(count: int, d: int, random: Any) -> Floats:
    normal = random.standard_normal((count, d))
    return np.asarray(normal / np.sqrt(random.chisquare(_T_DOF, size=(count, 1)) / _T_DOF))


def _t_log_density(z: Floats) -> Floats:
    d = z.shape[1]
    return np.asarray(-0.5 * (_T_DOF + d) * np.log1p(np.einsum("wi,wi->w", z, z) / _T_DOF))


def _effective_samples(chains: Floats) -> tuple[float, float]:
    """Longest integrated autocorrelation time, and the effective samples that follow, over all parameters."""
    from emcee.autocorr import integrated_time

    ensembles, steps, walkers, d = chains.shape
    merged = chains.transpose(1, 0, 2, 3).reshape(steps, ensembles * walkers, d)
    time = float(np.max(np.maximum(integrated_time(merged, quiet=True, tol=0), 1.0)))
    return time, steps * ensembles * walkers / time


def _rhat(chains: Floats) -> float:
    """Largest rank-normalised split R-hat, each ensemble one chain: walkers of one ensemble are not independent."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FutureWarning)
        import arviz
    result = arviz.rhat(arviz.convert_to_dataset({"z": chains}), method="rank")
    return float(result["z"].max())
