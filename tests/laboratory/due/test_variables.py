"""Intervals from values: NASA-HDBK-8739.19-5, tables 7-2 to 7-7, and suncal 1.7.1 on the same data."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import norm, t

from cmm_uq.base.errors import CmmUqError
from cmm_uq.laboratory.due.intervals import DriftPolynomial, LastValue, fitted_drift, interval_of_reliability

DAYS = np.array([70.0, 86, 104, 135, 167, 173])
CHANGES = np.array([0.1, 0.11, 0.251, 0.299, 0.403, 0.615])
START = LastValue(10.03, 0.28)


def test_the_fit_is_that_of_table_7_3() -> None:
    fit = fitted_drift(DAYS, CHANGES, 2)
    assert fit.coefficients == pytest.approx([0.00015741, 0.00001674], rel=1e-3)
    assert fit.covariance.ravel() == pytest.approx([1.01e-6, -6.607e-9, -6.607e-9, 4.549e-11], rel=1e-3)
    assert (round(fit.scatter, 4), fit.freedoms) == (0.0708, 4)


def test_the_predicted_values_are_those_of_tables_7_4_and_7_7() -> None:
    assert 10.03 + fitted_drift(DAYS, CHANGES, 2).change(np.array([140.1, 327.15])) == pytest.approx(
        [10.38, 11.87], abs=5e-3
    )


def test_with_the_scatter_in_it_the_uncertainty_reaches_its_target_as_in_table_7_7() -> None:
    """The handbook adds the scatter about the curve to the uncertainty; suncal 1.7.1 does not (328.93 days)."""
    fit = fitted_drift(DAYS, CHANGES, 2)
    single = LastValue(10.03, float(np.hypot(0.28, fit.scatter)))
    before, after = np.hypot(single.u, fit.u_change(np.array([327.145, 327.155])))
    assert before < 0.5 < after


def test_the_handbooks_one_sided_interval_has_four_degrees_of_freedom() -> None:
    """Table 7-5, 171.75 days: value + t(90 %, 4)·u meets the limit, u with the scatter; here u has those of all its parts."""
    fit = fitted_drift(DAYS, CHANGES, 2)
    then = np.array([171.75])
    u = np.sqrt(0.28**2 + fit.scatter**2 + fit.u_change(then) ** 2)
    assert (10.03 + fit.change(then) + t.ppf(0.9, 4) * u)[0] == pytest.approx(11, abs=5e-4)


def test_suncals_intervals() -> None:
    """Figures that suncal 1.7.1 gives: 184.9343 and 328.9317 days."""
    fit = fitted_drift(DAYS, CHANGES, 2)
    assert interval_of_reliability(fit, START, 0.9, 9, 11) == pytest.approx(184.934255, abs=1e-5)
    assert interval_of_reliability(fit, START, 0.9, None, 11) == pytest.approx(184.934257, abs=1e-5)
    before, after = np.hypot(START.u, fit.u_change(np.array([328.93169, 328.93171])))
    assert before < 0.5 < after


def test_suncal_itself() -> None:
    suncal = pytest.importorskip("suncal.intervals")
    theirs = suncal.VariablesReliabilityTarget(DAYS, CHANGES, u0=0.28, y0=10.03).calculate(9, 11, 0.9, order=1)
    assert interval_of_reliability(fitted_drift(DAYS, CHANGES), START, 0.9, 9, 11) == pytest.approx(
        theirs.interval, rel=1e-8
    )


def test_a_value_beyond_what_is_wanted_from_the_beginning_has_no_interval() -> None:
    """Handbook, table 7-6, prints 153.04 and suncal 136.03: where the probability rises again through the target."""
    fit = fitted_drift(DAYS, CHANGES, 2)
    assert interval_of_reliability(fit, LastValue(9.03, 0.28), 0.9, 9, None) == 0


def test_without_a_drift_there_is_no_end() -> None:
    assert interval_of_reliability(fitted_drift(DAYS, 0 * DAYS), START, 0.9, 9, 11) == np.inf


def test_a_known_drift_by_hand() -> None:
    """0.001 a day, u = 0.1, limit 1 one-sided at 97.5 %: (1 − 1.96·0.1)/0.001 days."""
    known = DriftPolynomial(np.array([1e-3]), np.zeros((1, 1)), 0.0, 100, 1000.0)
    assert interval_of_reliability(known, LastValue(0, 0.1), 0.975, None, 1) == pytest.approx(
        1000 - 100 * norm.ppf(0.975), rel=1e-6
    )


def test_one_interval_is_too_few() -> None:
    with pytest.raises(CmmUqError, match="more than 1 intervals"):
        fitted_drift(DAYS[:1], CHANGES[:1])
