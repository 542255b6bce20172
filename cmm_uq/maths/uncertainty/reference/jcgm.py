"""Reference cases of the GUM (JCGM 100:2008, annex H) and of its supplements JCGM 101:2008, clause 9, and JCGM 102:2011.

A case has published or independently recomputed figures that the engine must reproduce, to half a unit of the last printed
digit, or to the numerical tolerance of JCGM 101:2008 7.9.2 where trials are made. Where a source prints a figure from rounded
intermediate results, the recomputed one is expected.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from itertools import chain
from typing import Any

import numpy as np

from cmm_uq.base.values import dataclass
from cmm_uq.maths.uncertainty import distributions as known, propagation
from cmm_uq.maths.uncertainty.coverage import elliptical_factor
from cmm_uq.maths.uncertainty.distributions import Distribution, arcsine, normal, rectangular, student_t
from cmm_uq.maths.uncertainty.evaluation import Request, compare, evaluate
from cmm_uq.maths.uncertainty.measurement_model import MeasurementModel
from cmm_uq.maths.uncertainty.quantity import rounded
from cmm_uq.maths.uncertainty.type_a import correlation_of, coverage_factor, simultaneous_readings, straight_line

SEED = 1  # of every case that makes trials


@dataclass(frozen=True, eq=False)
class ReferenceCase:
    title: str  # what is computed
    source: str  # document and clause, or how the figures were recomputed
    expected: Mapping[str, tuple[float, float]]  # value and tolerance by the name of the figure
    compute: Callable[[], Iterable[float]]  # gives the figures, in the same order


def figures(text: str) -> dict[str, tuple[float, float]]:
    """Values and their tolerances by name, as in ``length, nm: 50000838 ± 0.5; ν: 16.75 ± 0.005``."""
    entries = re.findall(r"(.+?): (\S+) ± ([^;]+)(?:; |$)", text)
    return {name: (float(value), float(tolerance)) for name, value, tolerance in entries}


def cases(text: str, *computed: Callable[[], Iterable[float]]) -> tuple[ReferenceCase, ...]:
    """Cases of a text with an empty line between them: title and source of each, then its figures."""
    found = []
    for block, compute in zip(text.strip().split("\n\n"), computed, strict=True):
        head, expected = block.split("\n", 1)
        title, source = head.strip().split(" | ")
        found.append(ReferenceCase(title, source, figures(" ".join(expected.split())), compute))
    return tuple(found)


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
        "ls": normal(50_000_623.0, 25.0, 18), "d": normal(215.0, 5.8, 24), "d1": normal(0.0, 3.9, 5),
        "d2": normal(0.0, 6.7, 8), "a": rectangular(9.5e-6, 13.5e-6), "t": normal(-0.1, 0.2),
        "swing": arcsine(-0.5, 0.5), "da": rectangular(-1e-6, 1e-6, dof=50), "dt": rectangular(-0.05, 0.05, dof=2),
    }  # fmt: skip
    return MeasurementModel(comparison, inputs)


def comparison(ls: Any, d: Any, d1: Any, d2: Any, a: Any, t: Any, swing: Any, da: Any, dt: Any) -> Any:
    """Length at 20 °C of a gauge from that of the standard, their difference, and what warmth makes of it (equation H.2)."""
    return ls + d + d1 + d2 - ls * (da * (t + swing) + a * dt)


def _end_gauge() -> list[float]:
    first, second = propagation.first_order(end_gauge()), propagation.second_order(end_gauge())
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

    found = propagation.first_order(MeasurementModel(model, joint.inputs, ("R", "X", "Z"), joint.correlation))
    r = correlation_of(found.covariance)
    low, high = found.interval(0.95)
    return [*found.value, *found.u, r[0, 1], r[0, 2], r[1, 2], *found.dof, *(high - low) / 2]


def _thermometer() -> list[float]:
    line = straight_line(_THERMOMETER_C, _CORRECTION_C, reference=20.0)
    (v11, _), (_, v22) = line.covariance
    r = correlation_of(line.covariance)[0, 1]
    return [line.intercept, line.slope, np.sqrt(v11), np.sqrt(v22), r, line.residual_sd, *map(float, line.at(30.0))]


_NORMAL = normal(0.0, 1.0)
_FLAT, _WIDE = (rectangular(-width * np.sqrt(3), width * np.sqrt(3)) for width in (1, 10))


def gauge_block() -> MeasurementModel:
    """JCGM 101:2008 9.5: deviation from 50 mm, nm and °C."""
    inputs = {
        "ls": student_t(623.0, 25.0, 18), "d": student_t(215.0, 6.0, 24), "d1": student_t(0.0, 4.0, 5),
        "d2": student_t(0.0, 7.0, 8), "a": rectangular(9.5e-6, 13.5e-6), "t": normal(-0.1, 0.2),
        "swing": arcsine(-0.5, 0.5), "da": known.rectangular_uncertain(-1e-6, 1e-6, 0.1e-6),
        "dt": known.rectangular_uncertain(-0.05, 0.05, 0.025),
    }  # fmt: skip
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


def _figures(result: propagation.Simulated | propagation.Propagated) -> tuple[float, ...]:
    """Value, u and the ends of the (95 %, or shortest) coverage interval of the first output."""
    if isinstance(result, propagation.Simulated):
        return result.value[0], result.u[0], *result.interval[0]
    return result.value[0], result.u[0], *(end[0] for end in result.interval(0.95))


def _four(*inputs: Distribution) -> list[float]:
    model = MeasurementModel(lambda a, b, c, d: a + b + c + d, dict(zip("abcd", inputs, strict=True)))
    drawn = propagation.simulate(model, 1_000_000, seed=SEED)
    return [drawn.u[0], np.ptp(drawn.symmetric_interval[0]) / 2, propagation.first_order(model).interval(0.95)[1][0]]


def _mass() -> list[float]:
    drawn = propagation.simulate_adaptively(mass(), digits=2, seed=SEED)
    propagated = (_figures(propagate(mass()))[1:] for propagate in (propagation.first_order, propagation.second_order))
    return [*_figures(drawn), *chain(*propagated)]


def _clause_8() -> list[float]:
    one, two = (evaluate(mass(), Request(digits=digits, seed=SEED)) for digits in (1, 2))
    if one.ways.first is None or one.ways.simulated is None:
        return [np.nan] * 4
    first = compare(one.ways.first, one.ways.simulated, 0, 1)
    chosen = one.stated["y"].method == "second", two.stated["y"].method == "monte_carlo"
    return [max(first.low, first.high), first.tolerance, *chosen]


def _loss(x1: float) -> list[float]:
    model = comparison_loss(x1)
    second, drawn = propagation.second_order(model), propagation.simulate(model, 1_000_000, seed=SEED)
    return [*_figures(drawn), propagation.first_order(model).u[0], second.value[0], second.u[0]]


def _gauge_block() -> list[float]:
    drawn = propagation.simulate_adaptively(gauge_block(), coverage=0.99, digits=2, seed=SEED)
    return [*_figures(drawn), propagation.first_order(gauge_block()).u[0]]


def _polar(x1: float) -> list[float]:
    def polar(x1: Any, x2: Any) -> dict[str, Any]:
        return {"modulus": np.sqrt(x1**2 + x2**2), "phase": np.arctan2(x2, x1)}

    inputs = {"x1": normal(x1, 0.010), "x2": normal(0.0, 0.010)}
    drawn = propagation.simulate(MeasurementModel(polar, inputs, ("modulus", "phase")), 1_000_000, seed=SEED)
    return [drawn.value[0], drawn.u[0], drawn.value[1], drawn.u[1]]


_SUMS = (
    ("Sum of four normal quantities", "9.2.2", "2 ± 0.05", 3.91993, "3.91993 ± 5e-6", [_NORMAL] * 4),
    ("Sum of four rectangular quantities", "9.2.3", "2 ± 0.05", 3.87941, "3.91993 ± 5e-6", [_FLAT] * 4),
    ("One of the four ten times wider", "9.2.4", "10.149 ± 0.5", 17.0158, "19.891 ± 5e-4", [*[_FLAT] * 3, _WIDE]),
)
_LOSSES = ((0.0, 50, 50, 0, 149.8, 0.5), (0.01, 150, 111.8, 0, 366.0, 5), (0.05, 2550, 502.5, 1593.6, 3548.6, 5))
_POLAR = ((0.001, 0.0126, 0.0066, 1.744), (0.010, 0.0155, 0.0078, 1.118), (0.1, 0.1005, 0.0100, 0.101))

CASES = (
    *cases(
        """
        End gauge by comparison | JCGM 100:2008 annex H.1
        length, nm: 50000838 ± 0.5; u, nm: 31.66 ± 0.005; ν: 16.75 ± 0.005; t99: 2.92 ± 0.005; U99, nm: 92.5 ± 0.05;
        u(ls): 25 ± 0.05; u(d): 9.682 ± 0.005; u(δα): 2.887 ± 0.0005; u(δθ): 16.599 ± 0.0005;
        second order, δα and θ: 11.73 ± 0.05; u with second order, nm: 33.8 ± 0.05

        Resistance, reactance and impedance from simultaneous readings | JCGM 100:2008 annex H.2
        R: 127.7322 ± 5e-5; X: 219.8465 ± 5e-5; Z: 254.2597 ± 5e-5; u(R): 0.07107 ± 5e-6; u(X): 0.29558 ± 5e-6;
        u(Z): 0.23634 ± 5e-6; r(R,X): -0.588 ± 5e-4; r(R,Z): -0.485 ± 5e-4; r(X,Z): 0.9925 ± 5e-5; ν(R): 4 ± 1e-6;
        ν(X): 4 ± 1e-6; ν(Z): 4 ± 1e-6; U95(R): 0.197 ± 5e-4; U95(X): 0.821 ± 5e-4; U95(Z): 0.656 ± 5e-4

        Thermometer calibration line | JCGM 100:2008 annex H.3
        intercept: -0.17120 ± 5e-6; slope: 0.0021827 ± 5e-6; u(intercept): 0.00288 ± 5e-6; u(slope): 0.000668 ± 1e-6;
        r: -0.9304 ± 1e-4; s: 0.0035 ± 5e-5; b(30 °C): -0.1494 ± 5e-5; u(b(30 °C)): 0.0041 ± 5e-5

        Rounding of a result | JCGM 100:2008 7.2.6, ILAC-P14:09/2020
        value: 10.058 ± 0; u: 0.027 ± 0
        """,
        _end_gauge,
        _impedance,
        _thermometer,
        lambda: map(float, rounded(10.05762, 0.02712)),
    ),
    *(
        ReferenceCase(
            title, f"JCGM 101:2008 {clause}, recomputed",
            figures(f"u: {u}; U by Monte Carlo: {drawn} ± 0.05; U by first order: {first}"), partial(_four, *inputs),
        )
        for title, clause, u, drawn, first, inputs in _SUMS
    ),
    *cases(
        """
        Mass calibration | JCGM 101:2008 9.3, recomputed
        Monte Carlo value: 1.2340 ± 0.0005; Monte Carlo u: 0.075480 ± 0.0005; Monte Carlo low: 1.08443 ± 0.001;
        Monte Carlo high: 1.38357 ± 0.001; first order u: 0.0539 ± 5e-5; first order low: 1.1285 ± 5e-5;
        first order high: 1.3395 ± 5e-5; second order u: 0.07496 ± 5e-6; second order low: 1.0871 ± 5e-5;
        second order high: 1.3809 ± 5e-5

        Validation of the mass calibration | JCGM 101:2008 9.3 with clause 8
        d of first order: 0.044 ± 0.005; δ for one digit: 0.005 ± 1e-9; second order chosen for one digit: 1 ± 0;
        Monte Carlo chosen for two digits: 1 ± 0
        """,
        _mass,
        _clause_8,
    ),
    *(
        ReferenceCase(
            f"Comparison loss, x1 = {x1:g}, in 10⁻⁶", "JCGM 101:2008 9.4, recomputed",
            figures(
                f"value: {value} ± {delta}; u: {u} ± {delta}; low: {low} ± {delta}; high: {high} ± {2 * delta}; u by first "
                f"order: {1e6 * 2 * x1 * 0.005} ± 1e-9; value by second order: {value} ± 1e-6; u by second order: {u} ± 0.05"
            ),
            partial(_loss, x1),
        )
        for x1, value, u, low, high, delta in _LOSSES
    ),
    *cases(
        """
        Comparison loss by first order, in 10⁻⁶ | JCGM 101:2008 9.4.2
        low by first order: 1520 ± 0.5; high by first order: 3480 ± 0.5

        Gauge block, 99 %, nm | JCGM 101:2008 9.5, recomputed
        value: 838 ± 0.5; u: 35.81 ± 0.5; low: 744.4 ± 1; high: 931.6 ± 1; u by first order: 32 ± 0.5
        """,
        lambda: _figures(propagation.first_order(comparison_loss(0.050)))[2:],
        _gauge_block,
    ),
    *(
        ReferenceCase(
            f"Polar from rectangular coordinates, x1 = {x1:g}", "JCGM 102:2011 9.3",
            figures(f"modulus: {modulus} ± 1e-4; u(modulus): {u} ± 1e-4; phase: 0 ± 0.01; u(phase): {u_phase} ± 2e-3"),
            partial(_polar, x1),
        )
        for x1, modulus, u, u_phase in _POLAR
    ),
    *cases(
        """
        Factor of the 95 % ellipse | JCGM 102:2011 table 1
        two outputs: 2.4477 ± 5e-5
        """,
        lambda: [elliptical_factor(2)],
    ),
)  # fmt: skip
