"""Frequencies of several waves at once, against sums over a fine grid of all of them."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.parts.one_period import draw, systematic
from cmm_uq.parts.waves import Wave, coefficients_given, evidence_of
from cmm_uq.points import Floats

LOW, HIGH = 2e-3, 3e-2


def waves(count: int, noise: float, random: np.random.Generator) -> list[Wave]:
    """Of 10 µm, each seen at 14 readings over 120 mm in the same observations, as on diagonals."""
    return [
        Wave(random.uniform(0, 120, 14), random.uniform(0.5, 1.5, (14, 1)) * np.eye(14) / noise, 0.01, LOW, HIGH)
        for _ in range(count)
    ]


def every(some: list[Wave], v: Floats, steps: int) -> tuple[list[Floats], Floats, float]:
    """A grid even in the logarithm of each frequency, probabilities on it, and the log of their mean evidence."""
    each = np.exp(np.log(LOW) + (np.arange(steps) + 0.5) / steps * np.log(HIGH / LOW))
    grid = np.stack(np.meshgrid(*[each] * len(some), indexing="ij"), axis=-1).reshape(-1, len(some))
    log = evidence_of(v, some, grid)
    weight = np.exp(log - log.max())
    return list(grid.T), weight / weight.sum(), float(np.log(weight.mean()) + log.max())


@pytest.mark.parametrize(("count", "noise", "steps"), [(1, 1e-3, 4000), (2, 2e-3, 300), (3, 6e-3, 50)])
def test_frequencies_are_those_of_all_combinations(count: int, noise: float, steps: int) -> None:
    """Distributions of each frequency and the evidence, by a sum over all combinations on a fine grid.

    Of 800 independent draws, as many as weights leave at least, a distribution function scatters by 0.018 at most; four times
    that is allowed, and half a step of the coarsest grid.
    """
    random = np.random.default_rng(count)
    some = waves(count, noise, random)
    truth = np.exp(random.uniform(np.log(LOW), np.log(HIGH), count))
    v = random.standard_normal(14)
    for wave, f in zip(some, truth, strict=True):
        v = v + wave.columns(np.array([f]))[0] @ random.standard_normal(2)
    grid, weight, evidence = every(some, v, steps)
    found = draw(v, some, 4000, random)
    assert found.effective > 0.2
    assert found.evidence == pytest.approx(evidence, abs=0.15)
    for f, drawn in zip(grid, found.frequency.T, strict=True):
        for mark in np.geomspace(LOW, HIGH, 12):
            assert np.mean(drawn < mark) == pytest.approx(weight[f < mark].sum(), abs=0.08)


def test_a_recording_that_shows_nothing_leaves_frequencies_even_in_their_logarithm() -> None:
    random = np.random.default_rng(4)
    found = draw(np.zeros(14), waves(3, 1e3, random), 4000, random)
    assert found.evidence == pytest.approx(0.0, abs=1e-3)
    even = np.log(found.frequency / LOW) / np.log(HIGH / LOW)
    np.testing.assert_allclose(np.quantile(even, [0.1, 0.5, 0.9], axis=0), np.array([[0.1], [0.5], [0.9]]) + np.zeros(3),
                               atol=0.05)  # fmt: skip


def test_amplitudes_are_normal_given_their_frequencies() -> None:
    """By the other algebra: S·Xᵀ(X·S·Xᵀ + 1)⁻¹v in the space of observations, of sines and cosines of the readings."""
    random = np.random.default_rng(5)
    some, v, f = waves(2, 2e-3, random), random.standard_normal(14), np.array([0.011, 0.023])
    X = np.hstack([
        wave.shown @ np.column_stack([np.sin(2 * np.pi * one * wave.reading), np.cos(2 * np.pi * one * wave.reading)])
        for wave, one in zip(some, f, strict=True)
    ])  # fmt: skip
    gain = 1e-4 * X.T @ np.linalg.inv(1e-4 * X @ X.T + np.eye(14))
    covariance = 1e-4 * (np.eye(4) - gain @ X)
    drawn = coefficients_given(v, some, np.tile(f, (40_000, 1)), random)
    scale = np.sqrt(np.diagonal(covariance))
    np.testing.assert_allclose((drawn.mean(axis=0) - gain @ v) / scale, 0.0, atol=0.03)
    np.testing.assert_allclose(np.cov(drawn.T) / np.outer(scale, scale), covariance / np.outer(scale, scale), atol=0.03)


def test_each_is_taken_as_often_as_its_weight_says() -> None:
    taken = systematic(np.array([0.5, 0.0, 1.5, 2.0]), 4000, np.random.default_rng(0))
    np.testing.assert_allclose(np.bincount(taken, minlength=4), [500, 0, 1500, 2000], atol=1)
