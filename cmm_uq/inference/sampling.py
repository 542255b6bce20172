"""The posterior of a linear model and of its noise: emcee over the sizes of the noise, exact draws of all that is linear."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cmm_uq.inference.ensembles import LEAST_EFFECTIVE_SAMPLES, Progress, run_ensembles
from cmm_uq.inference.least_squares import LeastSquares
from cmm_uq.inference.linear_model import LinearModel
from cmm_uq.inference.marginal import Marginal
from cmm_uq.inference.noise import NEGLIGIBLE, Components
from cmm_uq.inference.posterior import NoisyPosterior
from cmm_uq.inference.proposals import Proposal, moments, tempered, weights
from cmm_uq.points import Floats

_LOOKED_AT = 400
"""Draws by which it is judged whether slow noise is quicker than a few cosines."""
_WIDER = 2.0
"""Times the spread under a few cosines in which to look for that under all."""


def sample_with_noise(
    model: LinearModel, noise: Components, estimate: LeastSquares, seed: int, progress: Progress | None = None
) -> NoisyPosterior:
    """Sample the posterior.

    Parameters
    ----------
    model : linear about its estimate.
    noise : the components that its observations could show.
    estimate : least squares of the model.
    seed : the same seed gives the same draws.
    progress : told the part done, from 0 to 1.
    """
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
    )  # everything but the noise is drawn independently, given it
    every = chains.thinning(marginal.affordable_draws)
    sizes = noise.sizes(chains.thinned(every))
    random = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(5,)))
    return NoisyPosterior(
        unknowns=model.unknowns, draws=marginal.draw(sizes, random), sigma=sizes.coordinate, seed=seed,
        sampler=chains.sampler, ess_min=chains.ess_min, rhat_max=chains.rhat_max, steps=chains.steps,
        autocorrelation_time=chains.autocorrelation_time, every=every, sizes=sizes,
    )  # fmt: skip


def sufficient(marginal: Marginal, seed: int) -> tuple[Marginal, Proposal]:
    """The density with as many cosines as slow noise of this recording takes, and what to propose for it.

    Parameters
    ----------
    marginal : with all cosines.
    seed : of the draws.
    """
    fewer = replace(marginal, noise=marginal.noise.fewer)
    proposal = tempered(fewer.log_density, *start(fewer), seed)
    if fewer.noise is marginal.noise:
        return marginal, proposal
    random = np.random.RandomState(np.random.MT19937(np.random.SeedSequence(seed, spawn_key=(13,))))
    z = proposal.draws(_LOOKED_AT, random)
    latent = proposal.parameters(z)
    weight = weights(fewer.log_density(latent) - proposal.log_density(z))
    if weight @ fewer.noise.quick(fewer.noise.sizes(latent)) < NEGLIGIBLE:
        return fewer, proposal
    mean, covariance = moments(latent, weight)
    wide = np.linalg.cholesky(covariance + 1e-4 * np.eye(len(mean)))
    return marginal, tempered(marginal.log_density, mean, np.asarray(_WIDER * wide, dtype=np.float64), seed)


def start(marginal: Marginal) -> tuple[Floats, Floats]:
    """Centre and factor from which to look: the residuals' scatter, the prior of all else."""
    d = marginal.noise.dimension
    dof = max(marginal.estimate.degrees_of_freedom, 1)
    centre = np.zeros(d)
    sigma = np.log(max(marginal.estimate.sigma, 2e-6)) - (0.5 if d > 1 else 0.0)
    centre[0] = max(sigma, np.log(marginal.noise.known) + 1 / np.sqrt(2 * dof)) if marginal.noise.known else sigma
    return centre, np.diag([1 / np.sqrt(2 * dof) + (0.7 if d > 1 else 0.0), *np.ones(d - 1)])
