"""Shapes against the distributions of scipy that they are, and against their definition by quadrature."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy import integrate, stats

from cmm_uq.maths.uncertainty import distributions
from cmm_uq.maths.uncertainty.distributions import DistributionShape

N = 1_000_000
KS = 2.225 / np.sqrt(N)
"""Kolmogorov's distance that one sample of ten thousand exceeds: P = 2·exp(−2·2.225²)."""
P = np.array([1e-6, 0.01, 0.02625, 0.1, 0.125, 0.2686, 0.3, 0.4999, 0.5, 0.5001, 0.7, 0.875, 0.99, 1 - 1e-6])

PEERS: dict[str, tuple[Callable[[], DistributionShape], Any]] = {
    "normal": (lambda: distributions.NORMAL, stats.norm()),
    "rectangular": (lambda: distributions.RECTANGULAR, stats.uniform(-1, 2)),
    "triangular": (lambda: distributions.TRIANGULAR, stats.triang(0.5, -1, 2)),
    "arcsine": (lambda: distributions.ARCSINE, stats.arcsine(-1, 2)),
    "exponential": (lambda: distributions.EXPONENTIAL, stats.expon()),
    "t": (lambda: distributions.t_shape(5.0), stats.t(5)),
    "gamma": (lambda: distributions.gamma_shape(3.0), stats.gamma(3)),
    "trapezoidal": (lambda: distributions.trapezoid(0.3), stats.trapezoid(0.35, 0.65, -1, 2)),
    "narrow trapezoidal": (lambda: distributions.trapezoid(0.9), stats.trapezoid(0.05, 0.95, -1, 2)),
}


@pytest.mark.parametrize("name", PEERS)
def test_variance_and_quantiles_are_those_of_the_distribution(name: str) -> None:
    make, peer = PEERS[name]
    assert make().variance == pytest.approx(peer.var(), rel=1e-9)
    np.testing.assert_allclose(make().inverse(P), peer.ppf(P), rtol=1e-8, atol=1e-12)


@pytest.mark.parametrize("name", PEERS)
def test_draws_have_the_distribution(name: str) -> None:
    make, peer = PEERS[name]
    draws = make().draw(np.random.default_rng(1), N)
    assert draws.shape == (N,)
    assert stats.kstest(draws, peer.cdf).statistic < KS


def test_a_point_is_drawn_and_inverted_to_itself() -> None:
    assert distributions.POINT.variance == 0.0
    assert distributions.POINT.draw(np.random.default_rng(0), 3).tolist() == [0.0, 0.0, 0.0]
    assert distributions.POINT.inverse(P).tolist() == [0.0] * len(P)


@pytest.mark.parametrize(("dof", "variance"), [(1.0, np.inf), (2.0, np.inf), (2.5, 5.0), (4.0, 2.0)])
def test_the_variance_of_t_is_infinite_up_to_two_degrees_of_freedom(dof: float, variance: float) -> None:
    assert distributions.t_shape(dof).variance == pytest.approx(variance)


def below(x: float, doubt: float) -> float:
    """Probability of less than x of a rectangle whose half-width lies evenly between 1 − doubt and 1 + doubt."""

    def part(width: float) -> float:
        return float(np.clip((1 + x / width) / 2, 0.0, 1.0))

    kink = [abs(x)] if 1 - doubt < abs(x) < 1 + doubt else None
    return integrate.quad(part, 1 - doubt, 1 + doubt, points=kink, epsabs=1e-13)[0] / (2 * doubt)


@pytest.mark.parametrize("doubt", [0.05, 0.3, 0.5])
def test_a_rectangle_of_uncertain_width_is_the_mean_of_rectangles(doubt: float) -> None:
    """Its variance is the mean of w²/3, and so (1 + doubt²/3)/3."""
    shape = distributions.blurred_rectangle(doubt)
    assert shape.variance == pytest.approx((1 + doubt**2 / 3) / 3, rel=1e-15)
    found = [below(float(x), doubt) for x in shape.inverse(P)]
    np.testing.assert_allclose(found, P, rtol=1e-7, atol=1e-12)
    draws = shape.draw(np.random.default_rng(2), N)
    places = np.linspace(-1 - doubt, 1 + doubt, 61)
    expected = [below(float(x), doubt) for x in places]
    assert np.abs(np.searchsorted(np.sort(draws), places) / N - expected).max() < KS
    assert 1 + 0.98 * doubt < np.abs(draws).max() <= 1 + doubt


@pytest.mark.parametrize(
    "shape", [distributions.RECTANGULAR, distributions.TRIANGULAR, distributions.ARCSINE, distributions.trapezoid(0.4)]
)
def test_a_bounded_shape_reaches_from_minus_one_to_one(shape: DistributionShape) -> None:
    ends = shape.inverse(np.array([0.0, 1.0]))
    np.testing.assert_allclose(ends, [-1.0, 1.0], atol=1e-15)
    draws = shape.draw(np.random.default_rng(3), N)
    assert -1 <= draws.min() < -0.995
    assert 0.995 < draws.max() <= 1


def test_earlier_draws_are_drawn_again_and_inverted_as_steps() -> None:
    """1, 2, 4 and 9: variance 38/3 about the mean of 4 with n − 1 = 3."""
    shape = distributions.empirical(np.array([4.0, 1.0, 9.0, 2.0]))
    assert shape.variance == pytest.approx(38 / 3)
    assert shape.inverse(np.array([0.1, 0.25, 0.26, 0.5, 0.51, 0.76])).tolist() == [1.0, 1.0, 2.0, 2.0, 4.0, 9.0]
    draws, counts = np.unique(shape.draw(np.random.default_rng(4), 40_000), return_counts=True)
    assert draws.tolist() == [1.0, 2.0, 4.0, 9.0]
    assert np.all(np.abs(counts - 10_000) < 5 * np.sqrt(40_000 * 0.25 * 0.75))
