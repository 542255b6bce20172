from __future__ import annotations

from collections.abc import Callable

import pytest

from cmm_uq.uncertainty.distributions import arcsine, normal, rectangular
from cmm_uq.uncertainty.measurement_model import MeasurementModel


@pytest.fixture
def end_gauge() -> MeasurementModel:
    """JCGM 100:2008 annex H.1: length of an end gauge by comparison, nm and °C."""
    return MeasurementModel(
        lambda ls, d, d1, d2, a, t, swing, da, dt: ls + d + d1 + d2 - ls * (da * (t + swing) + a * dt),
        {
            "ls": normal(50000623.0, 25.0, 18),
            "d": normal(215.0, 5.8, 24),
            "d1": normal(0.0, 3.9, 5),
            "d2": normal(0.0, 6.7, 8),
            "a": rectangular(9.5e-6, 13.5e-6),
            "t": normal(-0.1, 0.2),
            "swing": arcsine(-0.5, 0.5),
            "da": rectangular(-1e-6, 1e-6, dof=50),
            "dt": rectangular(-0.05, 0.05, dof=2),
        },
    )


@pytest.fixture
def mass() -> MeasurementModel:
    """JCGM 101:2008 9.3: mass calibration, deviation from 100 g in mg."""
    return MeasurementModel(
        lambda m, dm, air, weight, reference: (m + dm) * (1 + (air - 1.2) * (1 / weight - 1 / reference)) - 1e5,
        {
            "m": normal(100000.0, 0.05),
            "dm": normal(1.234, 0.02),
            "air": rectangular(1.1, 1.3),
            "weight": rectangular(7000.0, 9000.0),
            "reference": rectangular(7950.0, 8050.0),
        },
    )


READINGS = {
    "V": [5.007, 4.994, 5.005, 4.990, 4.999],
    "I": [19.663e-3, 19.639e-3, 19.640e-3, 19.685e-3, 19.678e-3],
    "phi": [1.0456, 1.0438, 1.0468, 1.0428, 1.0433],
}


@pytest.fixture
def readings() -> dict[str, list[float]]:
    """JCGM 100:2008 table H.2: five simultaneous readings of voltage, current and phase."""
    return READINGS


@pytest.fixture
def loss() -> Callable[[float, float], MeasurementModel]:
    """JCGM 101:2008 9.4: comparison loss x1² + x2² at x1, 0 with correlation r; u(x1) = u(x2) = 0.005."""

    def at(x1: float, r: float) -> MeasurementModel:
        inputs = {"x1": normal(x1, 0.005), "x2": normal(0.0, 0.005)}
        return MeasurementModel(lambda x1, x2: x1**2 + x2**2, inputs, correlation={("x1", "x2"): r})

    return at
