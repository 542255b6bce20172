"""R-hat against ArviZ, the peer whose definition it follows, and the autocorrelation time against emcee."""

import arviz
import numpy as np
import pytest
from emcee.autocorr import integrated_time

from cmm_uq.base.points import Floats
from cmm_uq.maths.inference.ensembles import autocorrelation_time, rhat


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
