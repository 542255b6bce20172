"""Simulation-based calibration: ranks of true values among draws."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import sparse, stats

from benchmarks.ranks.drawn import Design, drawn, latent
from benchmarks.ranks.measuring import Case, ranked
from benchmarks.ranks.ranking import DRAWS, rank
from benchmarks.ranks.uniformity import RANKS, band, chi_squared, width
from cmm_uq.base.units import unit
from cmm_uq.maths.inference.linear_model import LinearModel, Unknown
from cmm_uq.maths.inference.noise import AXES, GROWTH, PLACING, Components

RECORDINGS = 2000


def normal_mean(narrower: float = 1.0, shifted: float = 0.0) -> list[list[int]]:
    """Ranks of three normal means, known beforehand as N(1, 2²), each from five readings with σ = 3 (conjugate)."""
    random = np.random.default_rng(1)
    precision = 1 / 2**2 + 5 / 3**2
    found = []
    for truth in random.normal(1, 2, (RECORDINGS, 3)):
        readings = truth[:, None] + 3 * random.standard_normal((3, 5))
        mean = (1 / 2**2 + readings.sum(axis=1) / 3**2) / precision + shifted / np.sqrt(precision)
        draws = mean + narrower / np.sqrt(precision) * random.standard_normal((DRAWS, 3))
        found.append([rank(truth[i], draws[:, i], random) for i in range(3)])
    return found


def first(recordings: list[list[int]]) -> list[int]:
    return [ranks[0] for ranks in recordings]


def test_ranks_in_the_conjugate_posterior_of_a_normal_mean_are_uniform() -> None:
    recordings = normal_mean()
    assert min(first(recordings)) >= 0
    assert max(first(recordings)) <= DRAWS
    assert chi_squared(first(recordings)) > 1e-3
    assert band(first(recordings)) > 1e-3
    value, low, high = width(recordings)
    assert low < 1 < high
    assert high - low < 0.06
    assert value == pytest.approx(1, abs=0.04)


def test_a_posterior_that_is_a_fifth_too_narrow_is_found_and_measured() -> None:
    recordings = normal_mean(narrower=0.8)
    assert chi_squared(first(recordings)) < 1e-6
    assert band(first(recordings)) < 1e-3
    value, low, high = width(recordings)
    assert low < 0.8 < high < 0.9
    assert value == pytest.approx(0.8, abs=0.03)


def test_a_posterior_that_is_shifted_by_a_fifth_of_its_width_leaves_the_band() -> None:
    ranks = first(normal_mean(shifted=0.2))
    assert chi_squared(ranks) < 1e-6
    assert band(ranks) < 1e-3


def test_a_component_that_is_absent_as_often_in_truth_as_in_the_draws_has_uniform_ranks() -> None:
    """Half of truths and draws are zero: a posterior that knows no more than its prior."""
    random = np.random.default_rng(2)

    def sizes(count: int) -> np.ndarray:
        return np.maximum(random.standard_normal(count), 0.0)

    ranks = [rank(sizes(1)[0], sizes(DRAWS), random) for _ in range(RECORDINGS)]
    assert chi_squared(ranks) > 1e-3
    assert band(ranks) > 1e-3


def test_a_rank_counts_the_draws_below_and_breaks_ties_over_all_places() -> None:
    random = np.random.default_rng(3)
    assert rank(2.5, np.array([1.0, 2.0, 3.0]), random) == 2
    assert {rank(0.0, np.array([-1.0, 0.0, 0.0, 1.0]), random) for _ in range(200)} == {1, 2, 3}


def test_chi_squared_is_that_of_scipy_in_ten_bins_and_takes_fewer_of_few_ranks() -> None:
    ranks = np.random.default_rng(4).integers(0, RANKS, 73).tolist()
    assert chi_squared(ranks) == pytest.approx(stats.chisquare(np.histogram(ranks, 10, (0, RANKS))[0]).pvalue)
    assert chi_squared(ranks[:30]) == pytest.approx(stats.chisquare(np.histogram(ranks[:30], 5, (0, RANKS))[0]).pvalue)
    assert np.isnan(chi_squared(ranks[:9]))


def test_uniform_ranks_leave_the_band_as_often_as_its_level_says() -> None:
    """Of 2000 sets of forty: 5 % ± 4 standard errors, and no more than that since the ranks are discrete."""
    sets = np.random.default_rng(5).integers(0, RANKS, (2000, 40))
    assert np.mean([band(each) <= 0.05 for each in sets]) == pytest.approx(0.05, abs=0.02)


def components(*possible: str) -> Components:
    """Four observations, two along x and two along y, of a coordinate whose noise is stated as 2 µm."""
    shares = np.repeat([[1.0, 0, 0, 1, 0.5, 1], [0, 1.0, 0, 1, 1, 1]], 2, axis=0)
    return Components(sparse.eye_array(4, format="csr"), shares, np.zeros((4, 0)), np.zeros(0), possible, stated=2e-3)


def test_the_noise_of_a_coordinate_is_drawn_from_the_density_that_the_sampler_takes_it_to_have() -> None:
    """A Kolmogorov–Smirnov test of ln σ against the package's prior, integrated; the first number of all may differ."""
    noise, random = components(AXES, PLACING, GROWTH), np.random.default_rng(1)
    sizes = noise.sizes(np.vstack([latent(noise, random) for _ in range(4000)]))
    at = np.log(2e-3) + np.linspace(-8, 8, 20_001)
    density = np.exp(noise.log_prior_of_sigma(at))
    distribution = np.cumsum(density) / density.sum()
    assert stats.kstest(np.log(sizes.coordinate), lambda x: np.interp(x, at, distribution)).pvalue > 1e-3
    # the moment that docs/noise.md gives, nine tenths of 0.2² and a tenth of 1², within four standard errors
    assert np.mean(np.log(sizes.coordinate / 2e-3) ** 2) == pytest.approx(0.9 * 0.2**2 + 0.1, abs=0.035)
    assert np.mean(sizes.placing == 0) == pytest.approx(0.5, abs=0.04)  # five standard errors


@pytest.mark.long
def test_parameters_are_drawn_from_their_priors_and_stay_where_nothing_is_known() -> None:
    known = Unknown(("scale_x", "ppm"), unit("ppm"), 3.0, 2.0, 1.0)
    anywhere = Unknown(("artefact", "length_mm"), unit("mm"), 400.0, np.inf, 1.0)
    linear = LinearModel(np.zeros(4), np.ones((4, 2)), (known, anywhere), np.zeros((4, 0)), np.ones(4), 2e-3)
    random = np.random.default_rng(2)
    made = [drawn(Design(linear, components()), random) for _ in range(4000)]
    values = np.array([each.values for each in made])
    assert stats.kstest((values[:, 0] - 3) / 2, "norm").pvalue > 1e-3
    assert np.all(values[:, 1] == 400)
    noise = [(each.linear.observed - each.values.sum()) / each.sizes.coordinate[0] for each in made]
    assert stats.kstest(np.ravel(noise), "norm").pvalue > 1e-3


@pytest.mark.long
def test_a_recording_is_drawn_and_every_parameter_and_size_ranked() -> None:
    found = ranked((Case("gauge blocks"), 1, 0))
    assert "fault" not in found
    assert set(found["ranks"]) == {
        *(f"scale_{a}.ppm" for a in "xyz"), "probe_radius.um", "artefact.length_mm", "noise.ln_sigma", "noise.likelihood",
        *(f"noise.axis_{a}" for a in "xyz"), "noise.placing", "noise.growth",
    }  # fmt: skip
    assert all(0 <= rank <= DRAWS for rank in found["ranks"].values())
    assert found == ranked((Case("gauge blocks"), 1, 0)) | {"seconds": found["seconds"]}
