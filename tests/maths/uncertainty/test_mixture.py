"""A quantity averaged over models is the mixture of what they give."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy import optimize, stats

from cmm_uq.base.units import unit
from cmm_uq.maths.uncertainty.quantity import Quantity, averaged, mixed

K = float(stats.norm.ppf(0.975))


def normal(value: float, u: float) -> Quantity:
    return Quantity(value, u, (value - K * u, value + K * u), unit("ppm"))


def test_of_two_values_far_apart_it_holds_both() -> None:
    """The twins of a scale, −35.1 ± 1.3 and 0.3 ± 5.1, at 63 and 37 %: ends by scipy's root finder, moments by hand."""
    found = averaged([normal(-35.1, 1.3), normal(0.3, 5.1)], [0.63, 0.37])
    mean = 0.63 * -35.1 + 0.37 * 0.3
    variance = 0.63 * (1.3**2 + 35.1**2) + 0.37 * (5.1**2 + 0.3**2) - mean**2
    assert (found.value, found.u) == pytest.approx((mean, np.sqrt(variance)))
    for tail, end in zip((0.025, 0.975), found.interval95, strict=True):
        wanted = optimize.brentq(
            lambda x, p=tail: 0.63 * stats.norm.cdf(x, -35.1, 1.3) + 0.37 * stats.norm.cdf(x, 0.3, 5.1) - p, -60, 40
        )
        assert end == pytest.approx(wanted, abs=1e-6)


@settings(max_examples=30, deadline=None)
@given(
    st.floats(-50, 50), st.floats(0.01, 20), st.floats(0.01, 20), st.lists(st.floats(0.01, 1), min_size=1, max_size=5)
)
def test_where_all_models_agree_it_is_what_they_say(
    value: float, below: float, above: float, weights: list[float]
) -> None:
    one = Quantity(value, 0.5 * (below + above) / K, (value - below, value + above), unit("µm"))
    found = averaged([one] * len(weights), weights)
    assert (found.value, found.u) == pytest.approx((one.value, one.u), abs=1e-5)
    assert found.interval95 == pytest.approx(one.interval95, abs=1e-6)


@settings(max_examples=30, deadline=None)
@given(st.lists(st.floats(0.01, 1), min_size=1, max_size=5), st.integers(0, 2**31))
def test_every_draw_of_a_mixture_is_one_of_a_model_and_each_model_has_its_share(
    weights: list[float], seed: int
) -> None:
    """Row i is row i of one model, so that none comes twice; shares to less than one draw."""
    count = 200
    draws = [np.column_stack([np.full(count, model), np.arange(count)]) for model in range(len(weights))]
    found = mixed(draws, weights, np.random.default_rng(seed))
    assert np.array_equal(found[:, 1], np.arange(count))
    share = np.bincount(found[:, 0].astype(int), minlength=len(weights))
    assert np.all(np.abs(share - count * np.array(weights) / sum(weights)) < 1)
    assert np.array_equal(found, mixed(draws, weights, np.random.default_rng(seed)))


def test_where_models_disagree_on_two_quantities_the_mixture_has_them_vary_together() -> None:
    """Three models without any uncertainty of their own: Σ w (m − m̄)(m − m̄)ᵀ by hand, weights 1 : 2 : 5 of 800 draws."""
    means = np.array([[1.0, -2.0], [3.0, 4.0], [-5.0, 0.5]])
    found = mixed([np.tile(mean, (800, 1)) for mean in means], [1, 2, 5], np.random.default_rng(3))
    p = np.array([0.125, 0.25, 0.625])
    off = means - p @ means
    assert np.cov(found, rowvar=False, ddof=0) == pytest.approx((p[:, None] * off).T @ off)
    first = np.cov(found[:400], rowvar=False, ddof=0)  # in any order: the first half is like the whole
    assert first == pytest.approx((p[:, None] * off).T @ off, rel=0.25)


def test_what_nothing_makes_uncertain_stays_so() -> None:
    exact = Quantity(3.0, 0.0, (3.0, 3.0), unit("mm"))
    assert averaged([exact, exact], [1, 2]) == exact
