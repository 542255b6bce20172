"""Tails of the unified interval, beside the construction that they come from."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import ndtr, ndtri

from cmm_uq.analysis.parts.unified import tails
from cmm_uq.base.points import Floats


def interval(at: float, coverage: float = 0.95) -> tuple[float, float]:
    """Of the mean, not negative, of a normal quantity that was measured so many standard deviations from zero."""
    below, above = tails(float(ndtr(-at)), coverage)
    return max(0.0, at + float(ndtri(below))), at - float(ndtri(above))


def accepted(mean: float, x: Floats, coverage: float) -> Floats:
    """Measurements x on a grid, in the order of their ratios of likelihoods, until they have the coverage (Neyman's belt)."""
    ratio = -0.5 * (x - mean) ** 2 + 0.5 * (x - np.maximum(x, 0)) ** 2
    weights = np.exp(-0.5 * (x - mean) ** 2)
    order = np.argsort(-ratio)
    inside = np.cumsum(weights[order]) <= coverage * weights.sum()
    return np.asarray(x[order[inside]])


@pytest.mark.parametrize("coverage", [0.9, 0.95, 0.99])
@pytest.mark.parametrize("at", [0.3, 1.2, 1.9, 2.4, 3.1, 4.0, 6.0])
def test_limits_are_those_of_the_belt(at: float, coverage: float) -> None:
    """Means whose accepted measurements reach this one: by brute force, means on a grid of a hundredth."""
    x, means = np.linspace(-8.0, 14.0, 11_001), np.linspace(0.0, 9.0, 901)
    belts = [accepted(mean, x, coverage) for mean in means]
    holding = [mean for mean, belt in zip(means, belts, strict=True) if belt.min() <= at <= belt.max()]
    assert interval(at, coverage) == pytest.approx((min(holding), max(holding)), abs=0.015)


def test_an_interval_of_a_measurement_below_zero_ends_where_a_twentieth_of_what_is_possible_lies_beyond() -> None:
    for at in (-0.1, -1.0, -2.0):
        low, high = interval(at)
        assert low == 0
        assert ndtr(at - high) / ndtr(at) == pytest.approx(0.05, rel=1e-9)


@pytest.mark.parametrize("mean", [0.0, 0.3, 1.0, 1.9, 2.3, 3.0, 3.7, 5.0])
def test_whatever_the_mean_95_percent_hold_and_not_many_more(mean: float) -> None:
    x = mean + np.linspace(-6, 6, 6001)
    weights = np.exp(-0.5 * (x - mean) ** 2)
    ends = np.array([interval(at) for at in x])
    held = (ends[:, 0] <= mean) & (mean <= ends[:, 1])
    assert 0.949 < weights[held].sum() / weights.sum() < 0.97


def test_far_from_zero_both_tails_are_half_of_what_is_missed() -> None:
    assert tails(0.0, 0.95) == pytest.approx((0.025, 0.025))
