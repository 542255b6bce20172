"""Reference cases of JCGM 101:2008, clause 9, and of JCGM 102:2011 (GUM supplements 1 and 2)."""

from __future__ import annotations

from collections.abc import Callable
from itertools import chain

import numpy as np

from cmm_uq.maths.uncertainty.choice import compare
from cmm_uq.maths.uncertainty.coverage import elliptical_factor
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
from cmm_uq.maths.uncertainty.propagation import Propagated, first_order, second_order
from cmm_uq.maths.uncertainty.reference.case import SEED, ReferenceCase
from cmm_uq.maths.uncertainty.reference.jcgm_100 import comparison

_NORMAL, _FLAT, _WIDE = (
    normal(0.0, 1.0),
    rectangular(-np.sqrt(3), np.sqrt(3)),
    rectangular(-10 * np.sqrt(3), 10 * np.sqrt(3)),
)
_DELTA_MASS, _DELTA_BLOCK = 0.0005, 0.5


def gauge_block() -> MeasurementModel:
    """JCGM 101:2008 9.5: deviation from 50 mm, nm and °C."""
    inputs = {
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


def comparison_loss(x1: float) -> MeasurementModel:
    """JCGM 101:2008 9.4, in units of 10⁻⁶."""
    return MeasurementModel(lambda x1, x2: 1e6 * (x1**2 + x2**2), {"x1": normal(x1, 0.005), "x2": normal(0.0, 0.005)})


def _figures(result: Simulated | Propagated) -> tuple[float, ...]:
    """Value, u and the ends of the (95 %, or shortest) coverage interval of the first output."""
    if isinstance(result, Simulated):
        return result.value[0], result.u[0], *result.interval[0]
    return result.value[0], result.u[0], *(end[0] for end in result.interval(0.95))


def _four(*inputs: Distribution) -> Callable[[], list[float]]:
    def compute() -> list[float]:
        model = MeasurementModel(lambda a, b, c, d: a + b + c + d, dict(zip("abcd", inputs, strict=True)))
        drawn = simulate(model, 1_000_000, seed=SEED)
        return [drawn.u[0], np.ptp(drawn.symmetric_interval[0]) / 2, first_order(model).interval(0.95)[1][0]]

    return compute


def _mass() -> list[float]:
    drawn = simulate_adaptively(mass(), digits=2, seed=SEED)
    propagated = (_figures(propagate(mass()))[1:] for propagate in (first_order, second_order))
    return [*_figures(drawn), *chain(*propagated)]


def _clause_8() -> list[float]:
    one, two = (evaluate(mass(), Request(digits=digits, seed=SEED)) for digits in (1, 2))
    if one.ways.first is None or one.ways.simulated is None:
        return [np.nan] * 4
    first = compare(one.ways.first, one.ways.simulated, 0, 1)
    chosen = one.stated["y"].method == "second", two.stated["y"].method == "monte_carlo"
    return [max(first.low, first.high), first.tolerance, *chosen]


def _loss(x1: float) -> Callable[[], list[float]]:
    def compute() -> list[float]:
        model = comparison_loss(x1)
        second = second_order(model)
        drawn = simulate(model, 1_000_000, seed=SEED)
        return [*_figures(drawn), first_order(model).u[0], second.value[0], second.u[0]]

    return compute


def _gauge_block() -> list[float]:
    drawn = simulate_adaptively(gauge_block(), coverage=0.99, digits=2, seed=SEED)
    return [*_figures(drawn), first_order(gauge_block()).u[0]]


def _polar(x1: float) -> Callable[[], list[float]]:
    def compute() -> list[float]:
        model = MeasurementModel(
            lambda x1, x2: {"modulus": np.sqrt(x1**2 + x2**2), "phase": np.arctan2(x2, x1)},
            {"x1": normal(x1, 0.010), "x2": normal(0.0, 0.010)},
            ("modulus", "phase"),
        )
        drawn = simulate(model, 1_000_000, seed=SEED)
        return [drawn.value[0], drawn.u[0], drawn.value[1], drawn.u[1]]

    return compute


CASES = (
    *(
        ReferenceCase(
            title,
            f"JCGM 101:2008 {clause}, recomputed",
            {"u": u, "U by Monte Carlo": (drawn, 0.05), "U by first order": first},
            _four(*inputs),
        )
        for title, clause, u, drawn, first, inputs in (
            ("Sum of four normal quantities", "9.2.2", (2.0, 0.05), 3.91993, (3.91993, 5e-6), [_NORMAL] * 4),
            ("Sum of four rectangular quantities", "9.2.3", (2.0, 0.05), 3.87941, (3.91993, 5e-6), [_FLAT] * 4),
            ("One of the four ten times wider", "9.2.4", (10.149, 0.5), 17.0158, (19.891, 5e-4), [*[_FLAT] * 3, _WIDE]),
        )
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
        lambda: _figures(first_order(comparison_loss(0.050)))[2:],
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
    *(
        ReferenceCase(
            f"Polar from rectangular coordinates, x1 = {x1:g}",
            "JCGM 102:2011 9.3",
            {"modulus": (modulus, 1e-4), "u(modulus)": (u, 1e-4), "phase": (0.0, 0.01), "u(phase)": (u_phase, 2e-3)},
            _polar(x1),
        )
        for x1, modulus, u, u_phase in (
            (0.001, 0.0126, 0.0066, 1.744),
            (0.010, 0.0155, 0.0078, 1.118),
            (0.1, 0.1005, 0.0100, 0.101),
        )
    ),
    ReferenceCase(
        "Factor of the 95 % ellipse",
        "JCGM 102:2011 table 1",
        {"two outputs": (2.4477, 5e-5)},
        lambda: [elliptical_factor(2)],
    ),
)
