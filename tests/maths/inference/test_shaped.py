"""Shaped columns: against numerical integration over the shape, and with more than one mode."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cmm_uq.base.points import Floats
from cmm_uq.maths.inference.curvature import Shaped, sample_shaped
from cmm_uq.maths.inference.linear_model import LinearModel, Unknown

M = 60


def wave(x: Floats, period: float) -> Floats:
    return np.column_stack([np.sin(2 * np.pi * x / period), np.cos(2 * np.pi * x / period)])


def model(x: Floats, noise: float, sigma: float | None, truth: tuple[float, float, float], seed: int) -> LinearModel:
    """A line and a wave; lengths in mm as everywhere."""
    offset, amplitude, period = truth
    random = np.random.default_rng(seed)
    y = offset + amplitude * np.sin(2 * np.pi * x / period) + noise * random.standard_normal(len(x))
    design = np.column_stack([np.ones(len(x)), wave(x, 20.0)])
    unknowns = tuple(Unknown((name, "mm"), "mm", 0.0, 1.0, 1.0) for name in ("offset", "sine", "cosine"))
    return LinearModel(y, design, unknowns, np.zeros((len(x), 0)), np.ones(len(x)), sigma)


def shaped(x: Floats, nodes: Floats) -> Shaped:
    return Shaped((1, 2), nodes, np.stack([wave(x, period) for period in nodes]))


def test_the_marginal_of_a_period_is_that_of_direct_integration() -> None:
    """Mean and standard deviation against sums over the grid of exact Gaussian evidences, to 4 sampling errors."""
    random = np.random.default_rng(1)
    x = np.sort(random.uniform(0, 100, M))
    linear = model(x, 0.02, 0.02, (0.1, 0.03, 23.0), 2)
    nodes = 1 / np.linspace(1 / 40, 1 / 12, 800)[::-1]
    posterior = sample_shaped(linear, [shaped(x, nodes)], 3)
    log = []
    for period in nodes:
        A = np.column_stack([np.ones(M), wave(x, period)])
        covariance = 0.02**2 * np.eye(M) + A @ A.T
        log.append(
            -0.5 * linear.observed @ np.linalg.solve(covariance, linear.observed)
            - 0.5 * np.linalg.slogdet(covariance)[1]
        )
    p = np.exp(np.array(log) - max(log)) * np.gradient(np.log(nodes))
    p /= p.sum()
    mean = float(p @ nodes)
    sd = float(np.sqrt(p @ (nodes - mean) ** 2))
    draws = posterior.shapes[:, 0]
    error = sd / np.sqrt(posterior.ess_min)
    assert posterior.converged
    assert draws.mean() == pytest.approx(mean, abs=4 * error)
    assert draws.std() == pytest.approx(sd, rel=4 / np.sqrt(posterior.ess_min) + 0.02)


def test_a_size_of_half_a_metre_known_to_a_nanometre_does_not_blur_the_period() -> None:
    random = np.random.default_rng(7)
    x = np.sort(random.uniform(0, 100, M))
    plain = model(x, 1e-3, None, (0.0, 0.01, 23.0), 8)
    length = Unknown(("artefact", "length"), "mm", 500.0, 1e-6, 0.1)
    long = replace(plain, observed=plain.observed + 500.0, unknowns=(length, *plain.unknowns[1:]))
    columns = shaped(x, 1 / np.linspace(1 / 40, 1 / 12, 300)[::-1])
    mine, theirs = sample_shaped(long, [columns], 9), sample_shaped(replace(plain, unknowns=(
        Unknown(("artefact", "length"), "mm", 0.0, 1e-6, 0.1), *plain.unknowns[1:])), [columns], 9)  # fmt: skip
    assert mine.shapes.mean() == pytest.approx(theirs.shapes.mean(), abs=1e-3)
    assert mine.sigma.mean() == pytest.approx(theirs.sigma.mean(), rel=1e-3)


def test_two_modes_keep_their_probabilities() -> None:
    """Readings every 10 mm cannot tell a period of 30 mm from one of 15 mm: 1/15 = 1/10 − 1/30."""
    x = np.arange(M) * 10.0
    linear = model(x, 0.01, None, (0.0, 0.05, 30.0), 4)
    nodes = np.sort(np.concatenate([1 / np.linspace(1 / 33, 1 / 27, 300), 1 / np.linspace(1 / 16, 1 / 14, 300)]))
    posterior = sample_shaped(linear, [shaped(x, nodes)], 5)
    longer = posterior.shapes[:, 0] > 20
    assert posterior.converged
    # the aliases have equal likelihood; uniform in ln(period), their widths in ln(period) are as 30 to 15
    assert longer.mean() == pytest.approx(2 / 3, abs=0.05)
    amplitude = np.hypot(posterior.draws[:, 1], posterior.draws[:, 2])
    assert abs(amplitude.mean() - 0.05) < 4 * amplitude.std()


def test_intervals_of_period_amplitude_and_noise_hold_the_truth_as_often_as_they_say() -> None:
    """Twelve recordings, 95 % intervals: at least 9 of 12 (binomial, 0.2 %)."""
    random = np.random.default_rng(6)
    x = np.sort(random.uniform(0, 100, M))
    nodes = 1 / np.linspace(1 / 40, 1 / 12, 300)[::-1]
    columns = shaped(x, nodes)
    held = np.zeros(4, dtype=int)
    for seed in range(12):
        truth = (0.1, 0.02, float(random.uniform(16, 32)))
        posterior = sample_shaped(model(x, 0.01, None, truth, 100 + seed), [columns], seed)
        amplitude = np.hypot(posterior.draws[:, 1], posterior.draws[:, 2])
        for i, (draws, value) in enumerate(
            zip(
                (posterior.draws[:, 0], amplitude, posterior.shapes[:, 0], posterior.sigma), (*truth, 0.01), strict=True
            )
        ):
            low, high = np.quantile(draws, [0.025, 0.975])
            held[i] += low <= value <= high
    assert np.all(held >= 9)
