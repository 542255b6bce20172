"""Reference cases of coordinate metrology: a fitted sphere, a ballbar."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cmm_uq.maths.uncertainty.budgets.measurements import harris_compensated, harris_uncompensated, sphere_covariance
from cmm_uq.maths.uncertainty.correlation import correlation_of
from cmm_uq.maths.uncertainty.reference.case import Figures, ReferenceCase


def _hemisphere() -> Figures:
    n = 17_000
    z = (np.arange(n) + 0.5) / n
    angle = np.pi * (3 - np.sqrt(5)) * np.arange(n)
    radius = np.sqrt(1 - z * z)
    found = sphere_covariance(np.column_stack([radius * np.cos(angle), radius * np.sin(angle), z]), 9.0)
    u, r = np.sqrt(np.diagonal(found)).tolist(), correlation_of(found)
    return {"u(x), µm": u[0], "u(y), µm": u[1], "u(z), µm": u[2], "u(R), µm": u[3], "r(z,R)": float(r[2, 3])}


def _harris() -> Figures:
    centre = harris_compensated().lines[0].u or 0.0
    at = {"20 °C": (12, 18, 6), "25 °C": (21, 30, 12), "30 °C": (26, 38, 20)}
    return {
        "centre, µm": 1e3 * centre,
        "length, compensated, µm": 1e3 * harris_compensated().u,
        **{f"length, {t}, µm": 1e3 * harris_uncompensated(limits).u for t, limits in at.items()},
    }


CASES: Sequence[ReferenceCase] = (
    ReferenceCase(
        "Sphere from 17,000 points on a hemisphere, 9 µm each",
        "information matrix in closed form",
        {
            "u(x), µm": (0.120, 1e-3),
            "u(y), µm": (0.120, 1e-3),
            "u(z), µm": (0.240, 1e-3),
            "u(R), µm": (0.138, 1e-3),
            "r(z,R)": (-0.866, 1e-3),
        },
        _hemisphere,
    ),
    ReferenceCase(
        "Ballbar length as printed",
        "Harris 2004 sections 6.2.3 and 6.4.1",
        {
            "centre, µm": (14, 0.6),
            "length, compensated, µm": (20, 1.0),
            "length, 20 °C, µm": (26, 0.5),
            "length, 25 °C, µm": (41, 0.5),
            "length, 30 °C, µm": (52, 0.5),
        },
        _harris,
    ),
)
