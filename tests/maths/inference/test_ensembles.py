"""Ensembles side by side, and what their draws are worth."""

from __future__ import annotations

from typing import Any

import arviz
import emcee
import numpy as np
import pytest
from emcee.autocorr import integrated_time

from cmm_uq.base.points import Floats
from cmm_uq.maths.inference.ensembles import (
    BURN_IN,
    ENSEMBLES,
    SHARES,
    autocorrelation_time,
    bulk_ess,
    rhat,
    run_ensembles,
)
from cmm_uq.maths.inference.proposals import Proposal


def peer(chains: Floats) -> float:
    return float(arviz.rhat(arviz.convert_to_dataset({"z": chains}), method="rank")["z"].max())


def walks(seed: int, drift: float, wide: float) -> Floats:
    """Four chains of three parameters that repeat states, one of them displaced and one wider."""
    random = np.random.default_rng(seed)
    steps = random.standard_normal((4, 500, 3))
    steps[0] += drift
    steps[1] *= wide
    return np.repeat(steps, 2, axis=1)[:, :501]


@pytest.mark.parametrize(("drift", "wide"), [(0.0, 1.0), (0.3, 1.0), (0.0, 1.6), (2.0, 3.0)])
def test_r_hat_is_that_of_arviz(drift: float, wide: float) -> None:
    for seed in (1, 2):
        chains = walks(seed, drift, wide)
        assert rhat(chains) == pytest.approx(peer(chains), rel=1e-12)


def test_chains_that_never_moved_have_not_converged() -> None:
    chains = np.zeros((4, 100, 1)) + np.arange(4.0)[:, None, None]
    assert not rhat(chains) < 1.01


@pytest.mark.parametrize("steps", [64, 100, 511])
def test_the_autocorrelation_time_is_that_of_emcee(steps: int) -> None:
    for kept in (0.0, 0.5, 0.9, 0.99):
        chains = np.random.default_rng(steps).standard_normal((12, steps))
        for step in range(1, steps):
            chains[:, step] += kept * chains[:, step - 1]
        peers = integrated_time(chains.T[:, :, None], quiet=True, tol=0)
        assert autocorrelation_time(chains) == pytest.approx(float(peers[0]), rel=1e-9)


def autoregressive(seed: int, memory: float, chains: int, draws: int) -> Floats:
    """Stationary chains x_t = memory·x_(t−1) + noise of two quantities."""
    noise = np.random.default_rng(seed).standard_normal((chains, draws, 2))
    found = noise.copy()
    found[:, 0] /= np.sqrt(1 - memory**2)
    for t in range(1, draws):
        found[:, t] = memory * found[:, t - 1] + noise[:, t]
    return found


@pytest.mark.parametrize("memory", [-0.6, 0.0, 0.3, 0.9, 0.99])
@pytest.mark.parametrize(("chains", "draws"), [(4, 100), (7, 301), (2, 57), (128, 300)])
def test_it_is_that_of_arviz(memory: float, chains: int, draws: int) -> None:
    for seed in (1, 2):
        values = autoregressive(seed, memory, chains, draws)
        peer = arviz.ess(arviz.convert_to_dataset({"x": values}), method="bulk")["x"].to_numpy()
        assert bulk_ess(values) == pytest.approx(peer.min(), rel=1e-10)


def test_an_autoregressive_chain_is_worth_what_its_memory_leaves() -> None:
    """The exact ratio of effective to all draws is (1 − memory)/(1 + memory); the estimator's own spread is some 3 %."""
    values = autoregressive(3, 0.5, 8, 20_000)
    assert bulk_ess(values) == pytest.approx(160_000 / 3, rel=0.15)


def test_what_never_varies_is_known_from_any_draw() -> None:
    assert bulk_ess(np.ones((4, 50, 1))) == 200


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
