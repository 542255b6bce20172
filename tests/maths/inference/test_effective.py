"""Bulk effective samples against ArviZ, whose definition it follows, and against the exact figure of a known chain."""

from __future__ import annotations

import arviz
import numpy as np
import pytest

from cmm_uq.base.points import Floats
from cmm_uq.maths.inference.ensembles import bulk_ess


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
