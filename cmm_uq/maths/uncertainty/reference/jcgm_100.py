"""Reference cases of JCGM 100:2008 (GUM), annex H."""

from __future__ import annotations

from typing import Any

import numpy as np

from cmm_uq.maths.uncertainty.correlation import correlation_of
from cmm_uq.maths.uncertainty.distributions import arcsine, normal, rectangular
from cmm_uq.maths.uncertainty.measurement_model import MeasurementModel
from cmm_uq.maths.uncertainty.propagation import first_order, second_order
from cmm_uq.maths.uncertainty.quantity import rounded
from cmm_uq.maths.uncertainty.reference.case import ReferenceCase
from cmm_uq.maths.uncertainty.type_a import coverage_factor, simultaneous_readings, straight_line

# table H.2: five simultaneous readings of voltage (V), current (A) and phase (rad)
READINGS = {
    "V": [5.007, 4.994, 5.005, 4.990, 4.999],
    "I": [19.663e-3, 19.639e-3, 19.640e-3, 19.685e-3, 19.678e-3],
    "phi": [1.0456, 1.0438, 1.0468, 1.0428, 1.0433],
}
_THERMOMETER_C = (21.521, 22.012, 22.512, 23.003, 23.507, 23.999, 24.513, 25.002, 25.503, 26.010, 26.511)
_CORRECTION_C = (-0.171, -0.169, -0.166, -0.159, -0.164, -0.165, -0.156, -0.157, -0.159, -0.161, -0.160)


def end_gauge() -> MeasurementModel:
    """JCGM 100:2008 annex H.1, nm and °C."""
    inputs = {
        "ls": normal(50_000_623.0, 25.0, 18),
        "d": normal(215.0, 5.8, 24),
        "d1": normal(0.0, 3.9, 5),
        "d2": normal(0.0, 6.7, 8),
        "a": rectangular(9.5e-6, 13.5e-6),
        "t": normal(-0.1, 0.2),
        "swing": arcsine(-0.5, 0.5),
        "da": rectangular(-1e-6, 1e-6, dof=50),
        "dt": rectangular(-0.05, 0.05, dof=2),
    }
    return MeasurementModel(comparison, inputs)


def comparison(ls: Any, d: Any, d1: Any, d2: Any, a: Any, t: Any, swing: Any, da: Any, dt: Any) -> Any:
    """Length at 20 °C of a gauge from that of the standard, their difference, and what warmth makes of it (equation H.2)."""
    return ls + d + d1 + d2 - ls * (da * (t + swing) + a * dt)


def _end_gauge() -> list[float]:
    first, second = first_order(end_gauge()), second_order(end_gauge())
    part = dict(zip(first.inputs, np.abs(first.contribution[0]).tolist(), strict=True))
    u, k = float(first.u[0]), float(coverage_factor(first.dof, 0.99)[0])
    t, swing, da = (first.inputs.index(name) for name in ("t", "swing", "da"))
    bent = second.bending[0]
    u_d = np.sqrt(part["d"] ** 2 + part["d1"] ** 2 + part["d2"] ** 2)
    parts = part["ls"], u_d, part["da"], part["dt"], np.sqrt(bent[t, da] + bent[swing, da])
    return [first.value[0], u, first.dof[0], k, k * u, *parts, second.u[0]]


def _impedance() -> list[float]:
    joint = simultaneous_readings(READINGS)

    def model(**q: Any) -> dict[str, Any]:
        z = q["V"] / q["I"]
        return {"R": z * np.cos(q["phi"]), "X": z * np.sin(q["phi"]), "Z": z}

    found = first_order(MeasurementModel(model, joint.inputs, ("R", "X", "Z"), joint.correlation))
    r = correlation_of(found.covariance)
    low, high = found.interval(0.95)
    return [*found.value, *found.u, r[0, 1], r[0, 2], r[1, 2], *found.dof, *(high - low) / 2]


def _thermometer() -> list[float]:
    line = straight_line(_THERMOMETER_C, _CORRECTION_C, reference=20.0)
    (v11, _), (_, v22) = line.covariance
    r = correlation_of(line.covariance)[0, 1]
    return [line.intercept, line.slope, np.sqrt(v11), np.sqrt(v22), r, line.residual_sd, *map(float, line.at(30.0))]


CASES = (
    ReferenceCase(
        "End gauge by comparison",
        "JCGM 100:2008 annex H.1",
        {
            "length, nm": (50_000_838, 0.5),
            "u, nm": (31.66, 0.005),
            "ν": (16.75, 0.005),
            "t99": (2.92, 0.005),
            "U99, nm": (92.5, 0.05),
            "u(ls)": (25, 0.05),
            "u(d)": (9.682, 0.005),
            "u(δα)": (2.887, 0.0005),
            "u(δθ)": (16.599, 0.0005),
            "second order, δα and θ": (11.73, 0.05),
            "u with second order, nm": (33.8, 0.05),
        },
        _end_gauge,
    ),
    ReferenceCase(
        "Resistance, reactance and impedance from simultaneous readings",
        "JCGM 100:2008 annex H.2",
        {
            "R": (127.7322, 5e-5),
            "X": (219.8465, 5e-5),
            "Z": (254.2597, 5e-5),
            "u(R)": (0.07107, 5e-6),
            "u(X)": (0.29558, 5e-6),
            "u(Z)": (0.23634, 5e-6),
            "r(R,X)": (-0.588, 5e-4),
            "r(R,Z)": (-0.485, 5e-4),
            "r(X,Z)": (0.9925, 5e-5),
            **{f"ν({name})": (4, 1e-6) for name in "RXZ"},
            "U95(R)": (0.197, 5e-4),
            "U95(X)": (0.821, 5e-4),
            "U95(Z)": (0.656, 5e-4),
        },
        _impedance,
    ),
    ReferenceCase(
        "Thermometer calibration line",
        "JCGM 100:2008 annex H.3",
        {
            "intercept": (-0.17120, 5e-6),
            "slope": (0.0021827, 5e-6),
            "u(intercept)": (0.00288, 5e-6),
            "u(slope)": (0.000668, 1e-6),
            "r": (-0.9304, 1e-4),
            "s": (0.0035, 5e-5),
            "b(30 °C)": (-0.1494, 5e-5),
            "u(b(30 °C))": (0.0041, 5e-5),
        },
        _thermometer,
    ),
    ReferenceCase(
        "Rounding of a result",
        "JCGM 100:2008 7.2.6, ILAC-P14:09/2020",
        {"value": (10.058, 0), "u": (0.027, 0)},
        lambda: map(float, rounded(10.05762, 0.02712)),
    ),
)
