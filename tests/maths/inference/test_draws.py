"""Draws by name and by chain, and uncertainties of sums."""

from __future__ import annotations

import builtins
import io
import zipfile
from typing import Any

import numpy as np
import pytest
from scipy import stats

from cmm_uq.base.errors import CmmUqError
from cmm_uq.maths.inference.draws import Draws, by_chain, by_ensemble, evenly, uncertainty_of_sum
from cmm_uq.maths.inference.ensembles import ENSEMBLES, Chains, run_ensembles
from cmm_uq.maths.inference.noise import Sizes
from cmm_uq.maths.inference.proposals import Proposal
from tests.maths.inference.test_noise import SIZES, M, components, covariance


def some(chains: int = 6, draws: int = 40) -> Draws:
    values = np.random.default_rng(1).standard_normal((chains, draws, 2)) * [1.0, 1e-3] + [0.0, 404.2]
    return Draws({"scale_x.ppm": "ppm", "artefact.length_mm": "mm"}, values)


def test_a_chain_is_the_path_of_one_walker() -> None:
    """A draw of step s, walker w and ensemble e is numbered so that its place can be told."""
    steps, walkers = 5, 3
    e, s, w = np.meshgrid(np.arange(ENSEMBLES), np.arange(steps), np.arange(walkers), indexing="ij")
    chains = by_chain((100 * e + 10 * w + s).ravel(), steps)
    assert chains.shape == (ENSEMBLES * walkers, steps)
    for number, chain in enumerate(chains):
        assert chain.tolist() == [100 * (number // walkers) + 10 * (number % walkers) + step for step in range(steps)]


def test_kept_draws_of_an_ensemble_are_its_walkers_paths_one_behind_the_other() -> None:
    """480 draws, numbered as above, of which 96 are kept: 24 of each ensemble, two of each walker, the earlier step first."""
    steps, walkers = 10, 12
    e, s, w = np.meshgrid(np.arange(ENSEMBLES), np.arange(steps), np.arange(walkers), indexing="ij")
    every = (10_000 * e + 100 * w + s).ravel()
    kept = evenly(len(every), 96)
    chains = by_ensemble(every[kept], steps, len(every))
    assert chains.shape == (ENSEMBLES, 24)
    assert sorted(chains.ravel()) == sorted(every[kept])
    for ensemble, chain in enumerate(chains):
        assert set(chain // 10_000) == {ensemble}
        assert np.all(np.diff(chain) > 0)  # walker by walker, and step by step
    assert kept[0] == 0
    assert kept[-1] == len(every) - 1


def test_no_more_draws_are_kept_than_there_are() -> None:
    assert evenly(8, 2000).tolist() == list(range(8))


@pytest.mark.parametrize(("most", "every"), [(1000, 1), (180, 1), (60, 3), (59, 4), (1, 7)])
def test_thinned_draws_are_whole_steps_of_every_walker(most: int, every: int) -> None:
    """180 draws of 15 steps, numbered as above."""
    steps, walkers = 15, 3
    e, s, w = np.meshgrid(np.arange(ENSEMBLES), np.arange(steps), np.arange(walkers), indexing="ij")
    quality = {"sampler": "", "ess_min": 0.0, "rhat_max": 1.0, "steps": steps, "autocorrelation_time": 1.0}
    chains = Chains((100 * e + s + 0.1 * w).reshape(-1, 1), **quality)
    assert chains.thinning(most) == every
    kept = by_chain(chains.thinned(every)[:, 0], steps // every)
    for number, chain in enumerate(kept):
        first = 100 * (number // walkers) + 0.1 * (number % walkers)
        assert np.allclose(chain, first + np.arange(every - 1, steps, every)[: steps // every])


def test_the_sampler_gives_its_draws_in_the_order_that_chains_are_made_of() -> None:
    """A walker that rejects a step repeats its state: within chains that happens often, between walkers never."""
    found = run_ensembles(
        lambda z: -0.5 * (z**2).sum(axis=1), Proposal.single(np.zeros(2), np.eye(2)), 1, effective_samples=1
    )
    chains = by_chain(found.draws, found.steps)
    assert np.mean(np.diff(chains[:, :, 0], axis=1) == 0) > 0.05
    assert not np.any(np.diff(chains[:, :, 0], axis=0) == 0)


def test_each_quantity_is_found_by_its_name() -> None:
    draws = some()
    assert list(draws) == ["scale_x.ppm", "artefact.length_mm"]
    assert np.array_equal(draws["artefact.length_mm"], draws.array[:, :, 1])
    with pytest.raises(KeyError, match=r"scale_x\.ppm"):
        draws["scale_x.pm"]


def test_the_covariance_is_that_of_all_draws() -> None:
    draws = some()
    a, b = draws["scale_x.ppm"].ravel(), draws["artefact.length_mm"].ravel()
    by_hand = ((a - a.mean()) * (b - b.mean())).sum() / (len(a) - 1)
    assert draws.covariance.loc["scale_x.ppm", "artefact.length_mm"] == pytest.approx(by_hand, rel=1e-9)


def test_thinning_keeps_every_so_manyth_draw_of_each_chain_and_stays_below_its_limit() -> None:
    draws = some()
    third = draws.array.size // 3
    kept = draws.thinned(third)
    assert kept.every == 4  # every third would leave 14 of 40, more than a third
    assert np.array_equal(kept.array, draws.array[:, ::4])
    assert kept.array.size <= third
    assert draws.thinned(draws.array.size).every == 1


def test_the_file_reads_back_with_numpy_alone_and_is_the_same_on_every_run() -> None:
    draws = some().thinned(250)
    content = draws.as_npz()
    assert content == some().thinned(250).as_npz()
    with np.load(io.BytesIO(content), allow_pickle=False) as read:
        off = np.abs(read["centre"] + read["draws"] - draws.array) / draws.array.std(axis=(0, 1))
        assert off.max() < 2.0**-22  # single precision of deviations below 4 u: 2⁻²⁴ of them
        assert read["names"].tolist() == draws.names
        assert read["units"].tolist() == ["ppm", "mm"]
        assert read["every"] == draws.every
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        assert {member.date_time for member in archive.infolist()} == {(1980, 1, 1, 0, 0, 0)}


def test_without_arviz_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    found = builtins.__import__

    def without(name: str, *rest: Any, **more: Any) -> Any:
        if name == "arviz":
            raise ImportError(name)
        return found(name, *rest, **more)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(CmmUqError, match="pip install"):
        some().to_arviz()


WEIGHTS = np.random.default_rng(8).standard_normal(M)


def test_given_the_sizes_it_is_that_of_the_whole_covariance_and_normal() -> None:
    """u² = wᵀ·Σ·w + what comes beside; half the interval is 1.96 u."""
    noise = components()
    u, half = uncertainty_of_sum(noise, SIZES, WEIGHTS, beside=0.7)
    assert u == pytest.approx(np.sqrt(WEIGHTS @ covariance(noise, SIZES) @ WEIGHTS + 0.49))
    assert half == pytest.approx(stats.norm.ppf(0.975) * u)


def test_over_sizes_it_is_a_mixture_whose_interval_holds_95_percent() -> None:
    """Half of the draws with twice the noise: against the distribution function of the mixture."""
    both = Sizes(*(np.concatenate([part, f]) for part, f in (
        (SIZES.reading, 2 * SIZES.reading), (SIZES.placing, 2 * SIZES.placing), (SIZES.growth, 2 * SIZES.growth),
        (SIZES.slow, 2 * SIZES.slow), (SIZES.rate, SIZES.rate),
    )))  # fmt: skip
    small, _ = uncertainty_of_sum(components(), SIZES, WEIGHTS)
    u, half = uncertainty_of_sum(components(), both, WEIGHTS)
    assert u == pytest.approx(small * np.sqrt(2.5))
    assert np.mean(stats.norm.cdf(half, scale=[small, 2 * small])) == pytest.approx(0.975)


def test_without_weights_nothing_is_uncertain() -> None:
    assert uncertainty_of_sum(components(), SIZES, np.zeros(M)) == (0.0, 0.0)
