"""The paper's integrations: exact where they must be, and their uncertainty three ways."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, strategies as st

from cmm_uq.artefacts.shift.integration import (
    KnownSpan,
    Method,
    calibration_curve,
    estimated_shift,
    integrated,
    local_sensitivity,
    with_known_length,
)
from cmm_uq.base.errors import CmmUqError
from tests.artefacts.shift.shifted import integrated_by_monte_carlo

UNEQUAL = np.array([0, 40, 60, 120, 140, 180, 220, 240, 320, 340, 400, 440.0])


def inverse(h, true):
    """Readings at which a calibration curve h has the values ``true``."""
    fine = np.linspace(-50, 600, 650_001)
    return np.interp(true, h(fine), fine)


@pytest.mark.parametrize("method", ["pitch", "improved"])
@given(gain=st.floats(0.9, 1.1), shift=st.floats(1.0, 100.0), start=st.floats(-100, 100))
def test_a_machine_with_a_wrong_scale_alone_is_integrated_exactly(
    method: Method, gain: float, shift: float, start: float
) -> None:
    a = start + UNEQUAL / gain
    curve = calibration_curve(a, a + shift / gain, shift, method)
    np.testing.assert_allclose(curve, UNEQUAL, atol=1e-9)


def test_the_slope_is_the_shift_over_what_the_machine_shows_of_it() -> None:
    a, b = np.array([0.0, 20.0]), np.array([19.9, 40.1])
    np.testing.assert_allclose(local_sensitivity(a, b, np.asarray(20.0)), [20 / 19.9, 20 / 20.1])


def test_the_estimated_shift_is_positive_where_the_artefact_moved_forward() -> None:
    """With the minus sign that (4) prints, every slope of (3) would be negative."""
    assert estimated_shift(np.array([0.0, 20.0]), np.array([19.9, 40.1])) == pytest.approx(20.0)


def test_a_shift_by_the_pitch_gives_back_the_true_positions_of_equal_points() -> None:
    """b[i] = a[i+1] for an equal pitch, so (6) telescopes: exact for any curve whatever."""

    def h(x):
        return x + 0.02 * np.sin(x / 60) + 1e-5 * x

    true = h(0.0) + 20.0 * np.arange(24)
    readings = inverse(h, true)
    curve = calibration_curve(readings[:-1], readings[1:], 20.0)
    np.testing.assert_allclose(curve, true[:-1] - true[0], atol=1e-6)


def test_the_improved_integration_is_exact_to_second_order_where_the_simple_one_is_not() -> None:
    """A curve bent by a constant: (8) halves the two slopes at the ends of what is left of the pitch."""

    def h(x):
        return x + 1e-6 * x**2

    true = UNEQUAL
    a, b = inverse(h, true), inverse(h, true + 20.0)
    left = [np.abs(calibration_curve(a, b, 20.0, method) - true).max() for method in ("pitch", "improved")]
    # by hand: the slope at a is taken at a + 10 mm; (6) is off by h''·(pitch/2 − 10)·pitch a step, (8) by less than a third
    assert left[0] == pytest.approx(abs(np.sum(2e-6 * (np.diff(UNEQUAL) / 2 - 10) * np.diff(UNEQUAL))), rel=0.01)
    assert left[1] < left[0] / 3


def test_the_minus_that_8_prints_would_lose_the_rest_of_the_pitch() -> None:
    a = np.array([0.0, 60.0, 120.0])
    b = a + 20
    slopes = np.ones(3)
    printed = slopes[:-1] * (b - a)[:-1] + (slopes[:-1] - slopes[1:]) / 2 * (a[1:] - b[:-1])
    assert printed.sum() == pytest.approx(40.0)  # of 120 mm, on a machine without any error
    assert calibration_curve(a, b, 20.0, "improved")[-1] == pytest.approx(120.0)


def test_compensated_positions_start_at_the_first_reading_and_accumulate() -> None:
    a = np.array([5.0, 25.0, 45.0])
    b = np.array([24.9, 45.0, 65.0])
    slope = 20 / (b - a)
    second = a[0] + slope[0] * (a[1] - a[0])
    third = second + slope[1] * (a[2] - a[1])
    np.testing.assert_allclose(a[0] + calibration_curve(a, b, 20.0), [5.0, second, third])


def test_with_a_known_length_the_shift_need_not_be_known() -> None:
    a, b = UNEQUAL, UNEQUAL + 20 + 0.003 * np.sin(UNEQUAL / 70)
    curves = [with_known_length(calibration_curve(a, b, shift), 0, 11, 440.0) for shift in (19.0, 20.0, None)]
    np.testing.assert_allclose(curves[0], curves[1], atol=1e-10)
    np.testing.assert_allclose(curves[0], curves[2], atol=1e-10)


READINGS = UNEQUAL, UNEQUAL + 20 + 0.003 * np.sin(UNEQUAL / 70)
NOISE = np.full((2, 12), 0.35e-3)


@pytest.mark.parametrize("method", ["pitch", "improved"])
@pytest.mark.parametrize("known", [None, KnownSpan(0, 11, 440.0, 0.5e-3)])
def test_the_law_of_propagation_agrees_with_monte_carlo(method: Method, known: KnownSpan | None) -> None:
    """100 000 trials give a standard deviation to 0.22 %: five of those is 1.2 %."""
    shift = {"shift": 20.0, "u_shift": 0.2e-3} if known is None else {}
    law = integrated(*READINGS, NOISE, method=method, known=known, **shift)
    trials = integrated_by_monte_carlo(*READINGS, NOISE, method=method, known=known, **shift)
    np.testing.assert_allclose(trials.u, law.u, rtol=0.012, atol=1e-12)
    np.testing.assert_allclose(trials.error, law.error, atol=5 * law.u.max() / 300)


def test_without_a_known_length_the_uncertainty_grows_to_the_end() -> None:
    """By hand, equal pitch equal to the shift: h[i] = Σ(2a − b + …) sums i independent slopes, so u grows like √i."""
    a = 20.0 * np.arange(23)
    law = integrated(a, a + 20, np.full((2, 23), 1e-3), shift=20.0)
    steps = np.arange(23)
    # e[i] − e[0] = Σ (a[k] − b[k]) + rounding of second order: variance 2·i·u²
    np.testing.assert_allclose(law.u, 1e-3 * np.sqrt(2 * steps), rtol=1e-6)


def test_a_known_length_pins_both_of_its_ends_and_leaves_the_middle_worst() -> None:
    """By hand: the bridge of n steps is 2·i·(n − i)/n; 2·i/n comes from the two readings that the length meets."""
    a = 20.0 * np.arange(23)
    law = integrated(a, a + 20, np.full((2, 23), 1e-3), known=KnownSpan(0, 22, 440.0, 0.0))
    i = np.arange(23)
    np.testing.assert_allclose(law.u, 1e-3 * np.sqrt(2 * i * (22 - i) / 22 + 2 * i / 22), rtol=1e-6)


@pytest.mark.parametrize(
    ("a", "b", "said"),
    [
        ([0.0, 20.0, 40.0], [20.0, 40.0], "3 readings, the shifted one 2"),
        ([0.0, 20.0, 40.0], [0.0, 20.0, 40.0], "not shifted"),
        ([0.0, 20.0, 40.0], [100.0, 120.0, 140.0], "no range twice"),
        ([0.0, 40.0, 20.0, 60.0], [20.0, 40.0, 60.0, 80.0], "first series is out of order at point 3"),
        ([0.0, 20.0, 40.0], [20.0, float("nan"), 60.0], "no finite number"),
        ([0.0], [20.0], "fewer than two"),
    ],
)
def test_series_that_no_shift_can_have_given_are_refused(a: list[float], b: list[float], said: str) -> None:
    with pytest.raises(CmmUqError, match=said) as caught:
        integrated(np.array(a), np.array(b), np.ones((2, len(a))))
    assert caught.value.fix
