"""Reference cases of JCGM 102:2011 (GUM supplement 2)."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from cmm_uq.maths.uncertainty.coverage import elliptical_factor
from cmm_uq.maths.uncertainty.distributions import (
    normal,
)
from cmm_uq.maths.uncertainty.measurement_model import MeasurementModel
from cmm_uq.maths.uncertainty.monte_carlo import simulate
from cmm_uq.maths.uncertainty.reference.case import SEED, Figures, ReferenceCase


def _polar(x1: float) -> Callable[[], Figures]:
    def compute() -> Figures:
        model = MeasurementModel(
            lambda x1, x2: {"modulus": np.sqrt(x1**2 + x2**2), "phase": np.arctan2(x2, x1)},
            {"x1": normal(x1, 0.010), "x2": normal(0.0, 0.010)},
            ("modulus", "phase"),
        )
        found = simulate(model, 1_000_000, seed=SEED)
        return {
            "modulus": float(found.value[0]),
            "u(modulus)": float(found.u[0]),
            "phase": float(found.value[1]),
            "u(phase)": float(found.u[1]),
        }

    return compute


CASES: Sequence[ReferenceCase] = (
    *(
        ReferenceCase(
            f"Polar from rectangular coordinates, x1 = {x1:g}",
            "JCGM 102:2011 9.3",
            {
                "modulus": (modulus, 1e-4),
                "u(modulus)": (u_modulus, 1e-4),
                "phase": (0.0, 0.01),
                "u(phase)": (u_phase, 2e-3),
            },
            _polar(x1),
        )
        for x1, modulus, u_modulus, u_phase in (
            (0.001, 0.0126, 0.0066, 1.744),
            (0.010, 0.0155, 0.0078, 1.118),
            (0.1, 0.1005, 0.0100, 0.101),
        )
    ),
    ReferenceCase(
        "Factor of the 95 % ellipse",
        "JCGM 102:2011 table 1",
        {"two outputs": (2.4477, 5e-5)},
        lambda: {"two outputs": elliptical_factor(2)},
    ),
)
