"""The staircase: its steps by hand, and the reliability at which it stands still."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cmm_uq.laboratory.due.attributes import staircase, steps
from cmm_uq.laboratory.due.rule import IntervalBounds

WIDE = IntervalBounds(factor=1e9, shortest_days=1e-9, longest_days=1e12)


def test_up_kept_down_by_hand() -> None:
    """At a reliability of one half a step down undoes a step up: 100 · 1.1 · 1.1 · 1 / 1.1."""
    found = staircase([0.3, 0.8, 0.81, 1.01], 100.0, 0.5, WIDE)
    assert (found.interval, found.up, found.kept, found.down) == (pytest.approx(110), 2, 1, 1)


@settings(deadline=None)
@given(st.floats(0.5, 0.99), st.floats(1.2, 1e6))
def test_at_the_wanted_reliability_the_interval_stands_still(reliability: float, factor: float) -> None:
    up, down = steps(reliability, factor)
    assert reliability * math.log(up) + (1 - reliability) * math.log(down) == pytest.approx(0, abs=1e-12)
    assert 1 < up <= 1.1 + 1e-12
    assert 1 / factor - 1e-12 <= down < 1


def test_a_high_reliability_takes_smaller_steps_up() -> None:
    """At 95 % nineteen steps up must be undone by one to the half: 2^(1/19)."""
    assert steps(0.95) == pytest.approx((2 ** (1 / 19), 0.5))
    assert steps(0.8) == pytest.approx((1.1, 1.1**-4))


def test_one_failure_at_most_halves_and_bounds_are_kept() -> None:
    assert staircase([2.0], 365, 0.95).interval == pytest.approx(182.5)
    assert staircase([2.0] * 20, 365, 0.95).interval == 14
    assert staircase([0.1] * 50, 365, 0.95).interval == 1826
