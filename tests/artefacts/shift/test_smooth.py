"""One density in two spaces: both ways of integrating coefficients out agree with each other and with scipy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from cmm_uq.artefacts.shift.smooth import ByCoefficients, ByObservations, SmoothFunction, SmoothMarginal, SmoothModel

RANDOM = np.random.default_rng(4)
EVEN, ENDS, COLUMNS = (RANDOM.standard_normal((9, k)) for k in (4, 4, 2))
OBSERVED, COLUMN_SD = RANDOM.standard_normal(9), np.array([0.5, 2.0])
SD = np.array([[1.0, 0.5, 0.2, 0.1], [3.0, 2.0, 1.0, 0.5]])
GROWTH, SIGMA = np.array([1.0, 2.5]), np.array([0.3, 0.7])
WAYS = [way(OBSERVED, EVEN, ENDS, COLUMNS, COLUMN_SD, 0.8, 5) for way in (ByObservations, ByCoefficients)]


@pytest.mark.parametrize("way", WAYS)
def test_the_density_is_that_of_scipys_normal_distribution(way: SmoothMarginal) -> None:
    expected = []
    for sd, r, sigma in zip(SD, GROWTH, SIGMA, strict=True):
        design = np.hstack([(EVEN + (r - 1) * ENDS) * sd, COLUMNS * COLUMN_SD])
        normal = stats.multivariate_normal(np.zeros(9), design @ design.T + sigma**2 * np.eye(9))
        expected.append(normal.logpdf(OBSERVED) + 4.5 * np.log(2 * np.pi) - 0.4 / sigma**2 - 5 * np.log(sigma))
    np.testing.assert_allclose(way.log_likelihood(SD, GROWTH, SIGMA), expected, rtol=1e-12)


@pytest.mark.long
@pytest.mark.parametrize("way", WAYS)
def test_draws_have_the_mean_and_covariance_of_the_conditional(way: SmoothMarginal) -> None:
    """By the formula for partitioned normal vectors (Rasmussen & Williams 2006, A.6); 200 000 draws, five of their errors."""
    count = 200_000
    sd, r, sigma = np.tile(SD[1], (count, 1)), np.full(count, 2.5), np.full(count, 0.7)
    drawn = np.hstack(way.draw(sd, r, sigma, np.random.default_rng(1)))
    design = np.hstack([EVEN + 1.5 * ENDS, COLUMNS])
    prior = np.diag(np.r_[SD[1], COLUMN_SD] ** 2)
    gain = prior @ design.T @ np.linalg.inv(design @ prior @ design.T + 0.49 * np.eye(9))
    covariance = prior - gain @ design @ prior
    spread = np.sqrt(np.diag(covariance))
    np.testing.assert_array_less(np.abs(drawn.mean(axis=0) - gain @ OBSERVED), 5 * spread / np.sqrt(count))
    found = np.cov(drawn, rowvar=False) / np.outer(spread, spread)
    np.testing.assert_allclose(found, covariance / np.outer(spread, spread), atol=5 * np.sqrt(2 / count))


@pytest.mark.parametrize(("count", "space"), [(5, ByObservations), (40, ByCoefficients)])
def test_the_smaller_space_is_chosen(count: int, space: type[SmoothMarginal]) -> None:
    """Ten sines: five observations are fewer, forty more."""
    x, none = np.linspace(0.0, 100.0, count), np.zeros((count, 0))
    function = SmoothFunction("linearity_x", 0.0, 100.0, 25.0, x, np.ones(count), 0.005)
    assert function.sines(x).shape[1] == 10
    model = SmoothModel(x, np.ones(count), np.ones((count, 1)), none, np.zeros(0), (function,), None, 0.001)
    assert type(model._reduced) is space
