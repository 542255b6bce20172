"""Intervals of zones do not end too early where errors act in one direction more than in others."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.parts.zones import short


@pytest.mark.parametrize("times", [1.0, 3.0])
def test_what_was_measured_small_may_be_large_where_errors_are(times: float) -> None:
    """Whatever direction is left of it: the upper end fails in 2.5 %, to three standard deviations of 400 measurements."""
    assert short(times, 400) < 0.025 + 3 * np.sqrt(0.025 * 0.975 / 400)
