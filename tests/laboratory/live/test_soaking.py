"""A temperature has settled when its change with twice its uncertainty keeps the criterion over the whole stated time."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.laboratory.live.screen import Soak


def fed(k_per_h: float, minutes: float, noise: float = 0.0) -> Soak:
    soak, random = Soak("temp_air_c", 0.5, 10.0), np.random.default_rng(1)
    for i in range(int(minutes * 60)):
        soak.add(i * 10**9, 20 + k_per_h * i / 3600 + noise * float(random.standard_normal()))
    return soak


def test_the_change_is_that_of_the_straight_line() -> None:
    change = fed(0.4, 15).change
    assert change is not None
    assert change[0] == pytest.approx(0.4)
    assert change[1] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(("k_per_h", "settled"), [(0.4, True), (-0.4, True), (0.6, False), (-0.6, False)])
def test_the_criterion_counts_both_ways(k_per_h: float, settled: bool) -> None:
    assert fed(k_per_h, 15).settled is settled


def test_before_the_stated_time_nothing_is_said() -> None:
    assert fed(0.0, 8).settled is None
    assert "seen for 8 of 10 min" in str(fed(0.0, 8).words)


def test_noise_that_hides_the_change_does_not_settle_it() -> None:
    """Sixty means of ten readings of 0.1 K: s(slope) = 0.1/√10/√(60·(1/6 h)²/12) = 0.085 K/h, so 0.4 + 2·0.085 > 0.5."""
    soak = fed(0.4, 15, noise=0.1)
    assert soak.change is not None
    assert soak.change[1] == pytest.approx(0.085, rel=0.25)
    assert soak.settled is False
