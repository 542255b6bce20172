"""Trends: the same line by another computation."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.laboratory.due.history import YEAR, epochs, trend
from tests.laboratory.due.histories import series

DAYS, VALUES = [0, 360, 740, 1100], [1.0, 1.9, 3.4, 3.8]
U, COMMON, WITH = [0.5, 0.4, 0.6, 0.5], [0.3, 0.2, 0.4, 0.3], ["A", "A", "B", "A"]


def test_the_artefacts_errors_may_be_estimated_instead() -> None:
    """The same model with the error of each artefact as an unknown of its own, known to be 0 ± 1: least squares, augmented."""
    line = trend(series(DAYS, VALUES, U, COMMON, WITH))
    assert line is not None
    own = np.sqrt(np.array(U) ** 2 - np.array(COMMON) ** 2)
    years = (np.array(DAYS) - DAYS[-1]) / YEAR
    errors = np.array(COMMON)[:, None] * (np.array(WITH)[:, None] == np.array(["A", "B"])[None, :])
    rows = np.vstack([np.column_stack([np.ones(4), years, errors]) / own[:, None], np.eye(4)[2:]])
    wanted = np.concatenate([np.array(VALUES) / own, np.zeros(2)])
    spread = np.linalg.inv(rows.T @ rows)
    solved = spread @ rows.T @ wanted
    assert (line.value, line.slope) == pytest.approx(tuple(solved[:2]), rel=1e-9)
    assert line.covariance / line.excess**2 == pytest.approx(spread[:2, :2], rel=1e-7)


def test_a_common_error_does_not_tilt_the_line() -> None:
    alone, shared = trend(series(DAYS, VALUES, 0.5)), trend(series(DAYS, VALUES, float(np.hypot(0.5, 3.0)), 3.0))
    assert alone is not None
    assert shared is not None
    assert (shared.slope, shared.u_slope) == pytest.approx((alone.slope, alone.u_slope), rel=1e-6)
    assert shared.covariance[0, 0] == pytest.approx(alone.covariance[0, 0] + alone.excess**2 * 9.0, rel=1e-6)


def test_an_adjustment_begins_a_new_line() -> None:
    jumped = series([0, 360, 370, 730], [1.0, 2.0, 0.0, 0.5], adjusted_since=[0, 0, 365, 365])
    assert [(rows.start, rows.stop) for rows in epochs(jumped)] == [(0, 2), (2, 4)]
    line = trend(jumped)
    assert line is not None
    assert (line.count, line.slope) == (2, pytest.approx(0.5 * YEAR / 360))


@pytest.mark.parametrize("days", [[0], [100, 100]])
def test_one_day_has_no_trend(days: list[int]) -> None:
    assert trend(series(days, [1.0] * len(days))) is None


def test_more_scatter_than_the_uncertainties_allow_widens_the_line() -> None:
    """χ² = Σ (residual/u)² over n − 2, by numpy's own straight line; the Birge ratio is its root."""
    values = [0.0, 5.0, -4.0, 3.0]
    line = trend(series(DAYS, values, 0.5))
    assert line is not None
    left = np.polyfit(DAYS, values, 1, full=True)[1][0]
    assert line.excess == pytest.approx(np.sqrt(left / 0.25 / 2))
    assert line.u_slope == pytest.approx(
        line.excess * 0.5 * YEAR / np.sqrt(np.sum((np.array(DAYS) - np.mean(DAYS)) ** 2))
    )


def test_values_without_an_uncertainty_have_a_line_too() -> None:
    line = trend(series([0, 365, 730], [1.0, 2.0, 3.0], 0.0))
    assert line is not None
    assert line.slope == pytest.approx(YEAR / 365)
