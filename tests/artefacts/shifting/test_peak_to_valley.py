"""Peak to valley of a curve: an interval that holds, also where the curve is straight."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.artefacts.shift.result import peak_to_valley
from cmm_uq.base.points import Floats

AT = np.linspace(0, 1, 12)


def smooth(random: np.random.Generator, count: int) -> Floats:
    """Draws (count, 12) of curves with a standard deviation of 1 µm, correlated over a fifth of the way; zero at the start."""
    covariance = 1e-6 * np.exp(-0.5 * ((AT[:, None] - AT) / 0.2) ** 2)
    drawn = random.multivariate_normal(np.zeros(len(AT)), covariance, count, method="eigh")
    return np.asarray(drawn - drawn[:, :1])


@pytest.mark.parametrize("size_um", [0.0, 2.0, 10.0])
def test_the_interval_holds_in_at_least_ninety_five_of_a_hundred(size_um: float) -> None:
    """Estimates scatter about the truth as draws scatter about the estimate: 300 of them, 95 % less 3.5 standard errors."""
    random = np.random.default_rng(11)
    true = 1e-3 * size_um * np.sin(np.pi * AT)
    held, before = 0, 0
    for error in smooth(random, 300):
        draws = true + error + smooth(random, 400)
        low, high = peak_to_valley(draws).interval95
        held += low <= size_um <= high
        ends = np.quantile(1e3 * np.ptp(draws, axis=1), [0.025, 0.975])
        before += bool(ends[0] <= size_um <= ends[1])
    assert held >= 300 * 0.95 - 3.5 * (300 * 0.95 * 0.05) ** 0.5
    assert size_um or before == 0


def test_the_largest_of_all_differences_bounds_it_from_both_sides() -> None:
    """Two positions: c₂ − c₁ of 5 µm ± 1 µm is the only difference, and its interval the ordinary ± 1.96 u."""
    random = np.random.default_rng(12)
    step = 5e-3 + 1e-3 * random.standard_normal(200_000)
    found = peak_to_valley(np.column_stack([0 * step, step]))
    assert found.value == pytest.approx(5.0, abs=0.02)
    assert found.interval95 == pytest.approx((5 - 1.96, 5 + 1.96), abs=0.1)


def test_a_curve_far_from_straight_is_not_said_to_be_straight_and_a_straight_one_may_be() -> None:
    random = np.random.default_rng(13)
    bent = peak_to_valley(20e-3 * np.sin(np.pi * AT) + smooth(random, 1000))
    straight = peak_to_valley(smooth(random, 1000))
    assert bent.interval95[0] > 14
    assert straight.interval95[0] == 0
    assert straight.value < straight.interval95[1]


def test_the_value_lies_in_its_interval_whatever_the_draws() -> None:
    for seed in range(20):
        random = np.random.default_rng(seed)
        found = peak_to_valley(random.standard_normal((50, 300)).cumsum(axis=1))
        assert found.interval95[0] <= found.value <= found.interval95[1]


def test_a_curve_that_is_known_exactly_has_no_uncertainty() -> None:
    found = peak_to_valley(np.tile(1e-3 * AT, (10, 1)))
    assert (found.value, found.u) == pytest.approx((1.0, 0.0), abs=1e-9)
    assert found.interval95 == pytest.approx((1.0, 1.0), abs=1e-9)
