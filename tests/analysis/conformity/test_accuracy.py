"""Figures of performance, and whether their uncertainty is what it says."""

from __future__ import annotations

import statistics

import numpy as np
import pytest

from cmm_uq.analysis.conformity.accuracy import Repeated, figures, with_uncertainty
from cmm_uq.base.points import Floats, Ints

# Lengths printed in figures C 1/C 2 (uncompensated) and C 3/C 4 (compensated) of Harris 2004, mm.
UNCOMPENSATED = [
    404.0194, 404.3593, 404.2331, 404.1931, 404.2244, 404.2373, 404.1125, 404.0901, 404.2651, 404.3261, 404.2004, 404.1981,
    404.2016, 404.1960, 404.2079, 404.1894, 404.2093, 404.1960, 404.2245, 404.2177,
]  # fmt: skip
COMPENSATED = [
    404.2388, 404.2404, 404.2273, 404.2286, 404.2571, 404.2565, 404.2508, 404.2162, 404.2173, 404.2407, 404.2312, 404.2521,
    404.2437, 404.2311, 404.2384, 404.2115, 404.2418, 404.2311, 404.2310, 404.2280,
]  # fmt: skip


def white(sigma: float, n: int) -> Repeated:
    """Independent noise of ``n`` lengths."""
    return lambda chosen, times, random: sigma * random.standard_normal((len(chosen), times, n))


@pytest.mark.parametrize(
    ("lengths", "mean", "rms", "span", "largest"),
    [(UNCOMPENSATED, 404.2051, 73.2, 339.9, 185.7), (COMPENSATED, 404.2357, 12.8, 45.6, 24.2)],
)
def test_the_printed_figures_of_the_thesis(
    lengths: list[float], mean: float, rms: float, span: float, largest: float
) -> None:
    """Mean, standard deviation and range as printed there; the largest deviation is its table 20's 0.186 and 0.024 mm."""
    found = figures(np.array(lengths))
    assert found["mean_length_mm"] == pytest.approx(mean, abs=6e-5)
    assert found["rms_accuracy_error_um"] == pytest.approx(rms, abs=0.06)
    assert found["b89_range_um"] == pytest.approx(span, abs=0.06)
    assert found["b89_max_deviation_um"] == pytest.approx(largest, abs=0.06)


def test_figures_of_many_sets_are_those_of_each_by_the_standard_library() -> None:
    sets = 404 + 0.02 * np.random.default_rng(2).standard_normal((3, 2, 7))
    found = figures(sets.swapaxes(0, 1).copy().swapaxes(0, 1))
    for at in np.ndindex(3, 2):
        each = sets[at].tolist()
        mean = statistics.fmean(each)
        assert found["mean_length_mm"][at] == pytest.approx(mean, rel=1e-15)
        assert found["rms_accuracy_error_um"][at] == pytest.approx(1e3 * statistics.stdev(each), rel=1e-10)
        assert found["b89_range_um"][at] == pytest.approx(1e3 * (max(each) - min(each)), rel=1e-10)
        assert found["b89_max_deviation_um"][at] == pytest.approx(1e3 * max(abs(x - mean) for x in each), rel=1e-10)
    assert figures(np.array([404.0]))["rms_accuracy_error_um"] == 0


def test_a_copied_length_has_the_noise_of_its_original() -> None:
    """Of twenty lengths, eighteen and one twice: u(mean) = σ·√(18 + 2²)/20, and a copy alone has no scatter."""
    sigma, n = 5e-3, 20
    drawn = np.full((500, n), 404.0)
    shared = np.where(np.arange(n) == 17, 13, np.arange(n))
    found = with_uncertainty(np.full(n, 404.0), drawn, white(sigma, n), 3, shared)
    assert found["mean_length_mm"].u == pytest.approx(sigma * 22**0.5 / n, rel=0.02)
    two = with_uncertainty(np.full(2, 404.0), drawn[:, :2], white(sigma, 2), 3, np.zeros(2, dtype=np.int64))
    assert two["b89_range_um"].u == 0
    assert two["mean_length_mm"].u == pytest.approx(sigma, rel=0.02)


def test_the_uncertainty_of_mean_and_scatter_is_the_textbook_one() -> None:
    """Pure noise: u(mean) = σ/√n, u(s) = σ·√(1 − c4²) with c4 of twenty lengths 0.98693 (ISO 7870-2)."""
    sigma, n = 5e-3, 20
    lengths = 404 + sigma * np.random.default_rng(1).standard_normal(n)
    found = with_uncertainty(lengths, np.full((500, n), 404.0), white(sigma, n), seed=3)
    assert found["mean_length_mm"].u == pytest.approx(sigma / np.sqrt(n), rel=0.02)
    assert found["rms_accuracy_error_um"].u == pytest.approx(5.0 * np.sqrt(1 - 0.98693**2), rel=0.02)
    assert found["b89_range_um"].u == pytest.approx(5.0 * 0.7287, rel=0.02)  # d3 of twenty (ISO 7870-2)


def test_the_value_is_that_of_the_recording_and_lies_in_its_interval() -> None:
    lengths = np.array(COMPENSATED)
    predicted = np.tile(lengths.mean(), (100, 20))
    for name, quantity in with_uncertainty(lengths, predicted, white(12e-3, 20), seed=0).items():
        assert quantity.value == figures(lengths)[name]
        assert quantity.interval95[0] < quantity.value < quantity.interval95[1]


def test_the_uncertainty_is_the_scatter_of_repetitions_and_not_the_spread_of_the_models() -> None:
    """Three hundred lengths leave numbers for ten repetitions of each of a thousand draws, whose models lie 0.1 mm apart."""
    sigma, m = 5e-3, 300
    models = 404 + 0.1 * np.arange(1000.0)[:, None] + np.zeros(m)
    found = with_uncertainty(np.full(m, 404.0), models, white(sigma, m), seed=2)
    assert found["mean_length_mm"].u == pytest.approx(sigma / np.sqrt(m), rel=0.02)


def test_every_draw_has_its_part_in_the_uncertainty() -> None:
    """Half of the draws with a noise of 1 µm, half with 7: √((1² + 7²)/2) = 5 µm, over √20."""
    sigma = np.array([1e-3, 7e-3])

    def noise(chosen: Ints, times: int, random: np.random.Generator) -> Floats:
        return sigma[chosen][:, None, None] * random.standard_normal((len(chosen), times, 20))

    found = with_uncertainty(np.full(20, 404.0), np.full((2, 20), 404.0), noise, seed=4)
    assert found["mean_length_mm"].u == pytest.approx(5e-3 / np.sqrt(20), rel=0.15)
    one = with_uncertainty(np.full(20, 404.0), np.full((1, 20), 404.0), white(7e-3, 20), seed=4)
    assert one["mean_length_mm"].u == pytest.approx(7e-3 / np.sqrt(20), rel=0.3)


def test_the_interval_leans_to_the_side_on_which_the_true_figure_lies() -> None:
    """Of two lengths, s = σ·|z|: its error lies between (0.0313 − 0.7979)σ and (2.2414 − 0.7979)σ with 95 %, and the figure
    that repetitions show on average is what was found less the error.
    """
    lengths = np.array([404.0, 404.0 + 1e-2])
    found = with_uncertainty(lengths, np.full((1000, 2), 404.0), white(5e-3, 2), seed=6)["rms_accuracy_error_um"]
    low, high = (end - found.value for end in found.interval95)
    assert low == pytest.approx(-5.0 * (2.2414 - 0.7979), rel=0.03)
    assert high == pytest.approx(5.0 * (0.7979 - 0.0313), rel=0.03)


def test_intervals_cover_the_figure_that_repetitions_would_show() -> None:
    """Lengths that differ systematically by 60 µm, noise 10 µm: nineteen intervals of twenty hold the mean figure."""
    random = np.random.default_rng(11)
    true, noise = 404 + 0.06 * random.standard_normal(20), 0.01
    many = figures(true + noise * random.standard_normal((40_000, 20)))
    hits = dict.fromkeys(many, 0)
    for seed in range(400):
        lengths = true + noise * random.standard_normal(20)
        found = with_uncertainty(lengths, np.tile(true, (20, 1)), white(noise, 20), seed)
        for name, quantity in found.items():
            hits[name] += quantity.interval95[0] <= many[name].mean() <= quantity.interval95[1]
    for name, count in hits.items():
        assert 0.91 < count / 400 < 0.985, name
