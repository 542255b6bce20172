"""Reference cases of JCGM 101:2008 (GUM supplement 1), clause 9."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from cmm_uq.maths.uncertainty.choice import compare
from cmm_uq.maths.uncertainty.distributions import (
    Distribution,
    arcsine,
    normal,
    rectangular,
    rectangular_uncertain,
    student_t,
)
from cmm_uq.maths.uncertainty.evaluation import Request, evaluate
from cmm_uq.maths.uncertainty.measurement_model import MeasurementModel
from cmm_uq.maths.uncertainty.monte_carlo import Simulated, simulate, simulate_adaptively
from cmm_uq.maths.uncertainty.propagation import first_order, second_order
from cmm_uq.maths.uncertainty.reference.case import SEED, Figures, ReferenceCase
from cmm_uq.maths.uncertainty.reference.jcgm_100 import comparison

_SIDE = np.sqrt(3)
_DELTA_MASS, _DELTA_BLOCK = 0.0005, 0.5


def gauge_block() -> MeasurementModel:
    """JCGM 101:2008 9.5: deviation from 50 mm, nm and °C."""
    inputs: dict[str, Distribution] = {
        "ls": student_t(623.0, 25.0, 18),
        "d": student_t(215.0, 6.0, 24),
        "d1": student_t(0.0, 4.0, 5),
        "d2": student_t(0.0, 7.0, 8),
        "a": rectangular(9.5e-6, 13.5e-6),
        "t": normal(-0.1, 0.2),
        "swing": arcsine(-0.5, 0.5),
        "da": rectangular_uncertain(-1e-6, 1e-6, 0.1e-6),
        "dt": rectangular_uncertain(-0.05, 0.05, 0.025),
    }
    return MeasurementModel(lambda ls, **rest: comparison(ls=ls + 50_000_000.0, **rest) - 50_000_000.0, inputs)


def mass() -> MeasurementModel:
    """JCGM 101:2008 9.3: deviation from 100 g, mg."""
    return MeasurementModel(
        lambda m, dm, air, weight, reference: (m + dm) * (1 + (air - 1.2) * (1 / weight - 1 / reference)) - 1e5,
        {
            "m": normal(100_000.0, 0.05),
            "dm": normal(1.234, 0.02),
            "air": rectangular(1.1, 1.3),
            "weight": rectangular(7000.0, 9000.0),
            "reference": rectangular(7950.0, 8050.0),
        },
    )


def comparison_loss(x1: float, r: float = 0.0) -> MeasurementModel:
    """JCGM 101:2008 9.4, in units of 10⁻⁶."""
    inputs = {"x1": normal(x1, 0.005), "x2": normal(0.0, 0.005)}
    return MeasurementModel(lambda x1, x2: 1e6 * (x1**2 + x2**2), inputs, correlation={("x1", "x2"): r} if r else {})


def _sum_of_four(*inputs: Distribution) -> MeasurementModel:
    return MeasurementModel(lambda a, b, c, d: a + b + c + d, dict(zip("abcd", inputs, strict=True)))


def _drawn(found: Simulated) -> Figures:
    return {
        "value": float(found.value[0]),
        "u": float(found.u[0]),
        "low": float(found.interval[0, 0]),
        "high": float(found.interval[0, 1]),
    }


def _four(*inputs: Distribution) -> Callable[[], Figures]:
    def compute() -> Figures:
        model = _sum_of_four(*inputs)
        found = simulate(model, 1_000_000, seed=SEED)
        return {
            "u": float(found.u[0]),
            "U by Monte Carlo": float(np.ptp(found.symmetric_interval[0])) / 2,
            "U by first order": float(first_order(model).interval(0.95)[1][0]),
        }

    return compute


def _mass() -> Figures:
    drawn = _drawn(simulate_adaptively(mass(), digits=2, seed=SEED))
    first, second = first_order(mass()), second_order(mass())
    figures = {f"Monte Carlo {name}": figure for name, figure in drawn.items()}
    for title, found in (("first order", first), ("second order", second)):
        low, high = found.interval(0.95)
        figures |= {f"{title} u": float(found.u[0]), f"{title} low": float(low[0]), f"{title} high": float(high[0])}
    return figures


def _clause_8() -> Figures:
    found = evaluate(mass(), Request(digits=1, seed=SEED))
    two = evaluate(mass(), Request(digits=2, seed=SEED))
    figures: dict[str, float] = {}
    if found.ways.first is not None and found.ways.simulated is not None:
        first = compare(found.ways.first, found.ways.simulated, 0, 1)
        figures |= {"d of first order": max(first.low, first.high), "δ for one digit": first.tolerance}
    return figures | {
        "second order chosen for one digit": float(found.stated["y"].method == "second"),
        "Monte Carlo chosen for two digits": float(two.stated["y"].method == "monte_carlo"),
    }


def _loss(x1: float, r: float = 0.0) -> Callable[[], Figures]:
    def compute() -> Figures:
        model = comparison_loss(x1, r)
        drawn = simulate(model, 1_000_000, seed=SEED)
        first, second = first_order(model), second_order(model)
        return {
            **_drawn(drawn),
            "u by first order": float(first.u[0]),
            "low by first order": float(first.interval(0.95)[0][0]),
            "high by first order": float(first.interval(0.95)[1][0]),
            "value by second order": float(second.value[0]),
            "u by second order": float(second.u[0]),
        }

    return compute


def _gauge_block() -> Figures:
    model = gauge_block()
    drawn = _drawn(simulate_adaptively(model, coverage=0.99, digits=2, seed=SEED))
    return {**drawn, "u by first order": float(first_order(model).u[0])}


CASES: Sequence[ReferenceCase] = (
    ReferenceCase(
        "Sum of four normal quantities",
        "JCGM 101:2008 9.2.2, recomputed",
        {"u": (2.0, 0.05), "U by Monte Carlo": (3.91993, 0.05), "U by first order": (3.91993, 5e-6)},
        _four(*(normal(0.0, 1.0),) * 4),
    ),
    ReferenceCase(
        "Sum of four rectangular quantities",
        "JCGM 101:2008 9.2.3, recomputed",
        {"u": (2.0, 0.05), "U by Monte Carlo": (3.87941, 0.05), "U by first order": (3.91993, 5e-6)},
        _four(*(rectangular(-_SIDE, _SIDE),) * 4),
    ),
    ReferenceCase(
        "One of the four ten times wider",
        "JCGM 101:2008 9.2.4, recomputed",
        {"u": (10.149, 0.5), "U by Monte Carlo": (17.0158, 0.05), "U by first order": (19.891, 5e-4)},
        _four(*(rectangular(-_SIDE, _SIDE),) * 3, rectangular(-10 * _SIDE, 10 * _SIDE)),
    ),
    ReferenceCase(
        "Mass calibration",
        "JCGM 101:2008 9.3, recomputed",
        {
            "Monte Carlo value": (1.2340, _DELTA_MASS),
            "Monte Carlo u": (0.075480, _DELTA_MASS),
            "Monte Carlo low": (1.08443, 2 * _DELTA_MASS),
            "Monte Carlo high": (1.38357, 2 * _DELTA_MASS),
            "first order u": (0.0539, 5e-5),
            "first order low": (1.1285, 5e-5),
            "first order high": (1.3395, 5e-5),
            "second order u": (0.07496, 5e-6),
            "second order low": (1.0871, 5e-5),
            "second order high": (1.3809, 5e-5),
        },
        _mass,
    ),
    ReferenceCase(
        "Validation of the mass calibration",
        "JCGM 101:2008 9.3 with clause 8",
        {
            "d of first order": (0.044, 0.005),
            "δ for one digit": (0.005, 1e-9),
            "second order chosen for one digit": (1, 0),
            "Monte Carlo chosen for two digits": (1, 0),
        },
        _clause_8,
    ),
    *(
        ReferenceCase(
            f"Comparison loss, x1 = {x1:g}, in 10⁻⁶",
            "JCGM 101:2008 9.4, recomputed",
            {
                "value": (value, delta),
                "u": (u, delta),
                "low": (low, delta),
                "high": (high, 2 * delta),
                "u by first order": (1e6 * 2 * x1 * 0.005, 1e-9),
                "value by second order": (value, 1e-6),
                "u by second order": (u, 0.05),
            },
            _loss(x1),
        )
        for x1, value, u, low, high, delta in (
            (0.0, 50, 50, 0, 149.8, 0.5),
            (0.010, 150, 111.8, 0, 366.0, 5),
            (0.050, 2550, 502.5, 1593.6, 3548.6, 5),
        )
    ),
    ReferenceCase(
        "Comparison loss by first order, in 10⁻⁶",
        "JCGM 101:2008 9.4.2",
        {"low by first order": (1520, 0.5), "high by first order": (3480, 0.5)},
        _loss(0.050),
    ),
    ReferenceCase(
        "Gauge block, 99 %, nm",
        "JCGM 101:2008 9.5, recomputed",
        {
            "value": (838.0, _DELTA_BLOCK),
            "u": (35.81, _DELTA_BLOCK),
            "low": (744.4, 2 * _DELTA_BLOCK),
            "high": (931.6, 2 * _DELTA_BLOCK),
            "u by first order": (32, 0.5),
        },
        _gauge_block,
    ),
)
