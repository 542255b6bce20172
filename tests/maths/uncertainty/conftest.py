from __future__ import annotations

from collections.abc import Callable

import pytest

from cmm_uq.maths.uncertainty.distributions import normal
from cmm_uq.maths.uncertainty.measurement_model import MeasurementModel
from cmm_uq.maths.uncertainty.reference import jcgm


@pytest.fixture
def end_gauge() -> MeasurementModel:
    """JCGM 100:2008 annex H.1: length of an end gauge by comparison, nm and °C."""
    return jcgm.end_gauge()


@pytest.fixture
def gauge_block() -> MeasurementModel:
    """JCGM 101:2008 9.5: the same with the distributions of the supplement, deviation from 50 mm, nm."""
    return jcgm.gauge_block()


@pytest.fixture
def mass() -> MeasurementModel:
    """JCGM 101:2008 9.3: mass calibration, deviation from 100 g in mg."""
    return jcgm.mass()


@pytest.fixture
def readings() -> dict[str, list[float]]:
    """JCGM 100:2008 table H.2: five simultaneous readings of voltage, current and phase."""
    return jcgm.READINGS


@pytest.fixture
def loss() -> Callable[[float, float], MeasurementModel]:
    """JCGM 101:2008 9.4: comparison loss x1² + x2² at x1, 0 with correlation r; u(x1) = u(x2) = 0.005."""

    def at(x1: float, r: float) -> MeasurementModel:
        inputs = {"x1": normal(x1, 0.005), "x2": normal(0.0, 0.005)}
        return MeasurementModel(lambda x1, x2: x1**2 + x2**2, inputs, correlation={("x1", "x2"): r})

    return at
