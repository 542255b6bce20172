"""Noise that is drawn has the covariance of its kind, whatever the order in which it is drawn."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy import stats

from cmm_uq.analysis.diagnosis.comparison.lack_of_fit import DEGREES, draw_noise, order_and_side, tail_widths
from cmm_uq.artefacts.error_maps.comparison import kinds_along
from cmm_uq.base.points import Floats


class Unit:
    """In place of random numbers, one direction after the other: what is drawn of them is a root of the covariance."""

    def standard_normal(self, shape: tuple[int, int]) -> Floats:
        return np.eye(*shape)


@pytest.mark.parametrize("phi", [0.0, 0.5, 0.9])
def test_readings_that_follow_each_other_are_drawn_with_their_correlation(phi: float) -> None:
    """First-order autoregression: the correlation of readings k apart is φ^k, and none between two chains."""
    chain = np.repeat([1, 2], 6)
    kind = kinds_along(chain, 0.5, (phi,))[1]
    left = np.random.default_rng(8).standard_normal(12)
    random: Any = Unit()
    root = draw_noise(kind, random, 12, np.ones(12), order_and_side(left, np.zeros((12, 0))))
    apart = np.abs(np.arange(6)[:, None] - np.arange(6))
    wanted = np.kron(np.eye(2), phi**apart)
    np.testing.assert_allclose(root @ root.T, wanted, atol=1e-12)


def test_exchanged_and_mirrored_readings_have_the_same_noise() -> None:
    left = np.random.default_rng(9).standard_normal(8)
    order, side = np.array([3, 0, 7, 1, 6, 2, 5, 4]), np.array([1.0, -1, 1, 1, -1, 1, -1, 1])
    kind = kinds_along(np.arange(8), 0.5, (0.5,))[0]

    def of(values: Floats) -> Floats:
        random = np.random.default_rng(1)
        return draw_noise(kind, random, 5, np.ones(8), order_and_side(values, np.zeros((8, 0))))

    np.testing.assert_allclose(of((side * left)[order]), (side[:, None] * of(left))[order], atol=1e-12)


def test_heavy_draws_are_of_student_s_t_with_the_variance_of_the_others() -> None:
    """Each draw has one number of degrees of freedom, so that every column is of scipy's t, over its standard deviation."""
    random = np.random.default_rng(10)
    heavy = np.arange(60) % 3 != 0
    wider = tail_widths(random, heavy, 4000)
    assert np.all(wider[:, ~heavy] == 1)
    found = wider * random.standard_normal(wider.shape)
    by_degrees = [
        [stats.kstest(column * np.sqrt(dof / (dof - 2)), stats.t(dof).cdf).pvalue for column in found[:, heavy].T]
        for dof in DEGREES
    ]
    assert np.max(by_degrees, axis=0).min() > 1e-4
    likelier = np.argmax(by_degrees, axis=0)
    assert 8 <= np.sum(likelier == 0) <= 32, "binomial of forty, one half: 1e-4 beyond"
    normal = [stats.kstest(column, stats.norm.cdf).pvalue for column in found[:, heavy].T]
    assert max(normal) < 1e-4
