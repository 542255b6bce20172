"""Several ensembles of emcee on one density, until the autocorrelation time says enough.

The walkers move in coordinates whitened by an approximation of the density, so that most steps are independence
proposals from a multivariate t distribution; differential-evolution steps repair what the approximation misses. (emcee's
snooker move is not used: its normalisation is wrong in release 3.1.6.) Walkers of one ensemble are not independent, so
the ensembles are compared with each other.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import special

from cmm_uq.points import Floats

ENSEMBLES = 4
STEPS_AT_ONCE = 300
MOST_STEPS = 6000
BURN_IN = 60
WALKERS = 32
EFFECTIVE_SAMPLES = 4000
"""Asked of every parameter: the interval's ends are then stable to about 3 % of u, below the last digit printed."""

LEAST_EFFECTIVE_SAMPLES = 1000
LARGEST_RHAT = 1.01
_T_DOF = 6.0
_WIDER = 2.0
"""Times the curvature's width at which a skewed density is first looked at: too wide costs draws, too narrow misses a tail."""
_LOOKS = 3
_ENOUGH, _MOST_LOOKS, _NEVER = 0.2, 25, -1e30
"""Letting in by degrees: part of the draws that must count, rounds at most, least gain that is reckoned with."""

Progress = Callable[[float], None]
LogDensity = Callable[[Floats], Floats]
"""Of (w, d) parameters, up to a constant: (w,)."""


@dataclass(frozen=True, eq=False)
class Chains:
    """Draws from a density, and whether they can be trusted.

    Attributes
    ----------
    draws : (N, d) in the density's own parameters: ensembles, steps and walkers in this order.
    sampler : program and version.
    ess_min, rhat_max : effective samples and rank-normalised R-hat, worst over all parameters.
    steps, autocorrelation_time : length of each chain, and the longest time.
    """

    draws: Floats
    sampler: str
    ess_min: float
    rhat_max: float
    steps: int
    autocorrelation_time: float

    @property
    def converged(self) -> bool:
        """See :func:`converged`."""
        return converged(self.ess_min, self.rhat_max, self.steps, self.autocorrelation_time)

    def thinning(self, most: int) -> int:
        """Of how many steps one is to be kept for at most ``most`` draws (or for those of two steps of each chain)."""
        return max(1, min(-(-len(self.draws) // most), self.steps // 2))

    def thinned(self, every: int) -> Floats:
        """Draws of every such step."""
        by_step = self.draws.reshape(ENSEMBLES, self.steps, -1, self.draws.shape[1])
        return np.asarray(by_step[:, every - 1 :: every].reshape(-1, self.draws.shape[1]))


def converged(ess_min: float, rhat_max: float, steps: int, autocorrelation_time: float) -> bool:
    """At least 1000 effective samples, R-hat below 1.01, and chains longer than 50 autocorrelation times."""
    return bool(ess_min >= LEAST_EFFECTIVE_SAMPLES and rhat_max < LARGEST_RHAT and steps > 50 * autocorrelation_time)


def run_ensembles(
    density: LogDensity,
    centre: Floats,
    factor: Floats,
    seed: int,
    progress: Progress | None = None,
    *,
    effective_samples: int = EFFECTIVE_SAMPLES,
    steps_at_once: int = STEPS_AT_ONCE,
    least_walkers: int = WALKERS,
) -> Chains:
    """Sample a density with emcee.

    Parameters
    ----------
    density : its logarithm.
    centre, factor : (d,) and (d, d): the density is roughly that of ``centre + factor @ z`` with standard normal z.
    seed : the same seed gives the same draws.
    progress : told the part done, from 0 to 1.
    effective_samples : to reach in every parameter.
    steps_at_once : between two looks at how many there are.
    least_walkers : in each ensemble; there are at least four for each dimension.
    """
    import emcee

    d = len(centre)
    walkers = max(least_walkers, 4 * d)
    samplers, states = [], []
    for child in np.random.SeedSequence(seed).spawn(ENSEMBLES):
        sampler = emcee.EnsembleSampler(
            walkers, d, lambda z: density(centre + z @ factor.T), vectorize=True,
            moves=[(emcee.moves.MHMove(_independence), 0.9), (emcee.moves.DEMove(), 0.1)],
        )  # fmt: skip
        random = np.random.RandomState(np.random.MT19937(child))
        sampler.random_state = random.get_state()
        states.append(
            sampler.run_mcmc(_start(lambda z: density(centre + z @ factor.T), walkers, d, random), BURN_IN, store=False)
        )
        samplers.append(sampler)
    steps = 0
    while True:
        states = [
            sampler.run_mcmc(state, steps_at_once, skip_initial_state_check=True)
            for sampler, state in zip(samplers, states, strict=True)
        ]
        steps += steps_at_once
        chains = np.stack([sampler.get_chain() for sampler in samplers])
        time, effective = _effective_samples(chains)
        if progress:
            progress(min(1.0, effective / effective_samples))
        if (effective >= effective_samples and steps > 50 * time) or steps >= MOST_STEPS:
            break
    draws = centre + chains.reshape(-1, d) @ factor.T
    return Chains(draws, f"emcee {emcee.__version__}", effective, rhat(chains.reshape(ENSEMBLES, -1, d)), steps, time)


def refined(density: LogDensity, centre: Floats, factor: Floats, seed: int) -> tuple[Floats, Floats]:
    """A better approximation of a skewed density: its moments by importance sampling from a t distribution, thrice.

    Returns
    -------
    centre (d,) and factor (d, d), as :func:`run_ensembles` wants them.
    """
    random = np.random.RandomState(np.random.MT19937(np.random.SeedSequence(seed)))
    width, looks = _WIDER, 0
    while looks < _LOOKS:
        z = _t_draws(500 * len(centre), len(centre), random)
        theta = centre + width * z @ factor.T
        log_weight = density(theta) - _t_log_density(z)
        weight = np.exp(log_weight - log_weight.max())
        weight /= weight.sum()
        # too few draws that count would make it degenerate: the approximation is then better than its correction
        if 1 / np.sum(weight**2) < 5 * len(centre):
            if width == 1.0:
                break
            width = max(1.0, width / 2**0.25)  # in many dimensions most of what is so much wider lies where nothing is
            continue
        looks += 1
        mean = weight @ theta
        about = theta - mean
        centre, factor, width = mean, np.linalg.cholesky((about * weight[:, None]).T @ about), 1.0
    return centre, factor


def tempered(density: LogDensity, centre: Floats, factor: Floats, seed: int) -> tuple[Floats, Floats]:
    """An approximation of a density that may lie far from where it was looked for: importance sampling, let in by degrees.

    What is looked for goes from where the search begins to the density, in each round as far as enough draws count.

    Parameters
    ----------
    centre, factor : where to begin, (d,) and (d, d), wide enough for the density to be somewhere within.
    seed : of the draws.

    Returns
    -------
    centre (d,) and factor (d, d), as :func:`run_ensembles` wants them.
    """
    random, d = np.random.RandomState(np.random.MT19937(np.random.SeedSequence(seed))), len(centre)
    begin, back = centre, np.linalg.inv(factor)
    count, power, left = 100 * (d + 1), 0.0, _LOOKS
    for _ in range(_MOST_LOOKS):
        z = _t_draws(count, d, random)
        theta = centre + z @ factor.T
        first = -0.5 * np.sum(((theta - begin) @ back.T) ** 2, axis=1)
        gain = np.maximum(density(theta) - first, _NEVER)
        known = first - _t_log_density(z)
        power = _highest_power(gain, known, power, _ENOUGH * count)
        weight = _weights(power * gain + known)
        mean = weight @ theta
        about = theta - mean
        covariance = (about * weight[:, None]).T @ about
        centre, factor = mean, np.linalg.cholesky(covariance + 1e-12 * np.trace(covariance) * np.eye(d))
        left -= power == 1.0
        if not left:
            break
    return centre, factor


def _highest_power(gain: Floats, known: Floats, least: float, enough: float) -> float:
    """Largest power of a gain in density, not below ``least``, at which the draws are worth enough, by bisection."""
    low, high = least, 1.0
    if _worth(gain + known) >= enough:
        return 1.0
    for _ in range(20):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if _worth(middle * gain + known) >= enough else (low, middle)
    return low


def _weights(log: Floats) -> Floats:
    weight = np.exp(log - log.max())
    return np.asarray(weight / weight.sum())


def _worth(log: Floats) -> float:
    return float(1 / np.sum(_weights(log) ** 2))


def _start(density: LogDensity, walkers: int, d: int, random: Any) -> Floats:
    """Where the walkers begin: draws that the density does not forbid."""
    z = _t_draws(walkers, d, random)
    for _ in range(100):
        forbidden = ~np.isfinite(density(z))
        if not forbidden.any():
            break
        z[forbidden] = _t_draws(int(forbidden.sum()), d, random)
    return z


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
    if (np.ptp(merged, axis=0) == 0).any():  # a walker that never moved has no autocorrelation time yet
        return float(steps), float(ensembles * walkers)
    time = float(np.max(np.maximum(integrated_time(merged, quiet=True, tol=0), 1.0)))
    return time, steps * ensembles * walkers / time


def rhat(chains: Floats, scores: Floats | None = None) -> float:
    """Largest rank-normalised split R-hat of the parameters, bulk or tail (Vehtari et al. 2021, section 4).

    Parameters
    ----------
    chains : (c, n, d) independent chains.
    scores : of the chains' halves, where they are known already.
    """
    halves = split(chains)
    folded = np.abs(halves - np.median(halves, axis=(0, 1)))
    bulk = normal_scores(halves) if scores is None else scores
    return max(float(_split_rhat(values).max()) for values in (bulk, normal_scores(folded)))


def split(chains: Floats) -> Floats:
    """The first and the last half of each chain as chains (2c, n // 2, d)."""
    half = chains.shape[1] // 2
    return np.concatenate([chains[:, :half], chains[:, -half:]])


def normal_scores(values: Floats) -> Floats:
    """Normal quantiles of the ranks of (c, n, d) values, for each parameter over all chains; ties share their rank."""
    flat = values.reshape(-1, values.shape[2])
    ranks = np.empty_like(flat)
    for rank, column in zip(ranks.T, flat.T, strict=True):
        _, place, count = np.unique(column, return_inverse=True, return_counts=True)
        rank[:] = (np.cumsum(count) - 0.5 * (count - 1))[place]
    return np.asarray(special.ndtri((ranks - 0.375) / (len(flat) + 0.25)), dtype=np.float64).reshape(values.shape)


def _split_rhat(values: Floats) -> Floats:
    """√((n − 1)/n + B/(n·W)) with the variances between and within chains, (d,)."""
    n = values.shape[1]
    within = values.var(axis=1, ddof=1).mean(axis=0)
    between = values.mean(axis=1).var(axis=0, ddof=1)
    with np.errstate(
        divide="ignore", invalid="ignore"
    ):  # chains that never moved: infinite or not a number, not converged
        return np.asarray(np.sqrt((n - 1) / n + between / within), dtype=np.float64)
