"""Ensembles side by side against emcee itself: a sampler for each ensemble, one after another."""

from typing import Any

import emcee
import numpy as np

from cmm_uq.base.points import Floats
from cmm_uq.maths.inference.ensembles import BURN_IN, ENSEMBLES, SHARES, run_ensembles
from cmm_uq.maths.inference.proposals import Proposal

WALKERS, STEPS, SEED = 12, 40, 7
MIXTURE = Proposal(
    np.array([3.0, -1.0]), np.array([[2.0, 0.0], [0.5, 1.0]]), np.array([0.7, 0.3]),
    np.array([[0.0, 0.0], [1.0, 2.0]]), np.stack([np.eye(2), 0.5 * np.eye(2)]),
)  # fmt: skip


def curved(x: Floats) -> Floats:
    """A bent density (w,)."""
    return np.asarray(-0.5 * (x[:, 0] - 3) ** 2 - 0.5 * (x[:, 1] + 1 - 0.3 * (x[:, 0] - 3) ** 2) ** 2)


def one_by_one(proposal: Proposal) -> Floats:
    """Draws of each ensemble by a sampler of its own."""

    def whitened(z: Floats) -> Floats:
        return curved(proposal.parameters(z))

    def independence(z: Floats, random: Any) -> tuple[Floats, Floats]:
        proposed = proposal.draws(len(z), random)
        return proposed, proposal.log_density(z) - proposal.log_density(proposed)

    found = []
    for child in np.random.SeedSequence(SEED).spawn(ENSEMBLES):
        moves = list(zip((emcee.moves.MHMove(independence), emcee.moves.DEMove()), SHARES, strict=True))
        sampler = emcee.EnsembleSampler(WALKERS, 2, whitened, vectorize=True, moves=moves)
        random = np.random.RandomState(np.random.MT19937(child))
        sampler.random_state = random.get_state()
        begin = proposal.draws(WALKERS, random)
        sampler.run_mcmc(sampler.run_mcmc(begin, BURN_IN, store=False), STEPS, skip_initial_state_check=True)
        found.append(sampler.get_chain())
    return proposal.parameters(np.concatenate(found).reshape(-1, 2))


def test_every_ensemble_draws_what_a_sampler_of_its_own_draws() -> None:
    for proposal in (MIXTURE, Proposal.single(np.array([3.0, -1.0]), np.eye(2))):
        chains = run_ensembles(
            curved, proposal, SEED, effective_samples=1, steps_at_once=STEPS, walkers=WALKERS
        )  # fmt: skip
        assert chains.steps % STEPS == 0
        by_step = chains.draws.reshape(ENSEMBLES, chains.steps, WALKERS, 2)
        expected = one_by_one(proposal).reshape(ENSEMBLES, STEPS, WALKERS, 2)
        np.testing.assert_allclose(by_step[:, :STEPS], expected, rtol=1e-12)
