"""The posterior of a linear model and of its noise: emcee over the sizes of the noise, exact draws of all that is linear."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cmm_uq.base.points import Floats
from cmm_uq.maths.inference.ensembles import BURN_IN, LEAST_EFFECTIVE_SAMPLES, Progress, run_ensembles
from cmm_uq.maths.inference.least_squares import LeastSquares
from cmm_uq.maths.inference.linear_model import LinearModel
from cmm_uq.maths.inference.marginal import Marginal
from cmm_uq.maths.inference.noise import NEGLIGIBLE, SLOW, Components
from cmm_uq.maths.inference.posterior import NoisyPosterior
from cmm_uq.maths.inference.presence import beginning, present
from cmm_uq.maths.inference.proposals import Proposes, tempered, weights

_LOOKED_AT = 2000
"""Draws by which it is judged whether slow noise is quicker than a few cosines."""

_BURN_IN = 30
"""Steps that are left out where what is proposed knows which components are present: about every other one is taken."""


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
        burn_in=_BURN_IN if noise.most else BURN_IN,
    )  # everything but the noise is drawn independently, given it
    every = chains.thinning(marginal.affordable_draws)
    sizes = noise.sizes(chains.thinned(every))
    random = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(5,)))
    return NoisyPosterior(
        unknowns=model.unknowns, draws=marginal.draw(sizes, random), sigma=sizes.coordinate, seed=seed,
        sampler=chains.sampler, ess_min=chains.ess_min, rhat_max=chains.rhat_max, steps=chains.steps,
        autocorrelation_time=chains.autocorrelation_time, every=every, sizes=sizes,
    )  # fmt: skip


def sufficient(marginal: Marginal, seed: int) -> tuple[Marginal, Proposes]:
    """The density with as many cosines as slow noise of this recording takes, and what to propose for it.

    Parameters
    ----------
    marginal : with all cosines.
    seed : of the draws.
    """
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
