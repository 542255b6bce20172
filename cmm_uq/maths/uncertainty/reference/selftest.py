"""Runs the reference cases: evidence that the software computes what its documents say (ISO/IEC 17025:2017 7.11.2).

Beside those of :mod:`~cmm_uq.maths.uncertainty.reference.jcgm`: the refractive index of air, a fitted sphere and a ballbar.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import Any

import numpy as np

from cmm_uq.base.values import dataclass
from cmm_uq.maths.uncertainty.air import state as air
from cmm_uq.maths.uncertainty.budgets.measurements import harris_compensated, harris_uncompensated, sphere_covariance
from cmm_uq.maths.uncertainty.measurement_model import derivatives
from cmm_uq.maths.uncertainty.quantity import MINUS
from cmm_uq.maths.uncertainty.reference import jcgm
from cmm_uq.maths.uncertainty.reference.jcgm import ReferenceCase, cases
from cmm_uq.maths.uncertainty.type_a import correlation_of

# °C, %, kPa, nm; 10⁹ (n − 1) by Ciddor and by the modified Edlén equation
_AIR_TABLE = (
    (20, 0, 101.325, 633, 271800, 271799), (20, 0, 60, 633, 160924, 160920), (20, 0, 120, 633, 321916, 321918),
    (50, 0, 100, 633, 243285, 243270), (5, 0, 100, 633, 282756, 282750), (-40, 0, 100, 633, 337580, 337471),
    (50, 100, 120, 633, 287924, 287864), (40, 75, 120, 633, 299418, 299406), (20, 100, 100, 633, 267394, 267394),
    (40, 100, 110, 1700, 270247, 270237), (20, 0, 101.325, 1700, 268479, 268483), (40, 100, 110, 300, 289000, 288922),
    (20, 0, 101.325, 300, 286581, 286579), (-40, 0, 120, 300, 427233, 427072),
)  # fmt: skip
# °C, kPa; 10⁸ (n − 1)
_DRY = ((20, 80, 21458.0), (20, 100, 26824.4), (20, 120, 32191.6), (10, 100, 27774.7), (30, 100, 25937.2))


def _table_of_air(equation: Callable[..., Any]) -> list[float]:
    return [1e9 * equation(t, 1e3 * kpa, h, 450.0, nm) for t, h, kpa, nm, *_ in _AIR_TABLE]


def _laboratory_air() -> list[float]:
    at_20 = derivatives(lambda t, p, h, c: [air.ciddor(t, p, h, c, 633.0)], [20.0, 101325.0, 50.0, 450.0])
    return [1e8 * at_20.value[0], *at_20.jacobian[0]]


def _harris_air() -> list[float]:
    at_20 = derivatives(
        lambda t, p, h: [1e6 * air.harris_2004(t, p * 101325 / 760, h, 0.0, 633.0)], [20.0, 760.0, 50.0]
    )
    return [at_20.value[0], *at_20.jacobian[0]]


def _water_constant() -> list[float]:
    wet, dry = (air.birch_downs_1994(20.0, 1e5, h, 0.0, 633.0) for h in (100.0, 0.0))
    return [float((dry - wet) / air.saturation_pressure(20.0)) * 1e10 + 0.0401 / 0.633**2]


def _hemisphere() -> list[float]:
    n = 17_000
    z = (np.arange(n) + 0.5) / n
    angle = np.pi * (3 - np.sqrt(5)) * np.arange(n)
    radius = np.sqrt(1 - z * z)
    covariance = sphere_covariance(np.column_stack([radius * np.cos(angle), radius * np.sin(angle), z]), 9.0)
    return [*np.sqrt(np.diagonal(covariance)), correlation_of(covariance)[2, 3]]


def _harris() -> list[float]:
    uncompensated = [harris_uncompensated(limits).u for limits in ((12, 18, 6), (21, 30, 12), (26, 38, 20))]
    compensated = harris_compensated()
    return [1e3 * u for u in (compensated.lines[0].u or 0.0, compensated.u, *uncompensated)]


_MEASUREMENTS = (
    *(
        ReferenceCase(
            f"Refractivity of air by {name}, (n − 1)·10⁹",
            "NIST Engineering Metrology Toolbox, table 1",
            {f"{t} °C, {h} %, {kpa} kPa, {nm} nm": (float(n[k]), 1.0) for t, h, kpa, nm, *n in _AIR_TABLE},
            partial(_table_of_air, equation),
        )
        for k, (name, equation) in enumerate(
            (("Ciddor", air.ciddor), ("the modified Edlén equation", air.modified_edlen))
        )
    ),
    ReferenceCase(
        "Refractivity of dry air, 633 nm, (n − 1)·10⁸",
        "Ciddor 1996, table 1",
        {f"{t} °C, {kpa} kPa": (value, 0.05) for t, kpa, value in _DRY},
        lambda: [1e8 * air.ciddor(t, 1e3 * kpa, 0.0, 450.0, 633.0) for t, kpa, _ in _DRY],
    ),
    *cases(
        """
        Laboratory air by Ciddor and its sensitivities | recomputed with forty digits
        (n − 1)·10⁸: 27137.275 ± 1e-3; dn/dt, /K: -9.548e-7 ± 5e-11; dn/dp, /Pa: 2.683e-9 ± 5e-13;
        dn/dRH, /%: -8.50e-9 ± 5e-12; dn/dCO2, /ppm: 1.435e-10 ± 5e-14

        Constant of water vapour | Birch and Downs, Metrologia 31 (1994) 315
        constant: 3.7345 ± 1e-9

        Refractivity by the formula of Harris 2004, exponent mended | Harris 2004 section 3.3, recomputed
        N: 271.307 ± 5e-4; dN/dT: -0.958 ± 5e-4; dN/dP: 0.358 ± 5e-4; dN/dH: -0.0096 ± 5e-5

        Sphere from 17,000 points on a hemisphere, 9 µm each | information matrix in closed form
        u(x), µm: 0.120 ± 1e-3; u(y), µm: 0.120 ± 1e-3; u(z), µm: 0.240 ± 1e-3; u(R), µm: 0.138 ± 1e-3;
        r(z,R): -0.866 ± 1e-3

        Ballbar length as printed | Harris 2004 sections 6.2.3 and 6.4.1
        centre, µm: 14 ± 0.6; length, compensated, µm: 20 ± 1; length, 20 °C, µm: 26 ± 0.5; length, 25 °C, µm: 41 ± 0.5;
        length, 30 °C, µm: 52 ± 0.5
        """,
        _laboratory_air,
        _water_constant,
        _harris_air,
        _hemisphere,
        _harris,
    ),
)

REFERENCE_CASES = (*jcgm.CASES, *_MEASUREMENTS)
HEADINGS = ("Case", "Expected", "Tolerance", "Got", "Source", "Result")
_ROUNDING = 1e-12


@dataclass(frozen=True)
class SelfTestResult:
    case: str  # title and figure
    expected: float
    tolerance: float
    got: float
    source: str

    @property
    def passed(self) -> bool:
        """Whether the figure is near enough; not one that is no number."""
        return abs(self.got - self.expected) <= self.tolerance + _ROUNDING * abs(self.expected)


def run(cases: Iterable[ReferenceCase] = REFERENCE_CASES) -> list[SelfTestResult]:
    return [
        SelfTestResult(f"{case.title}: {name}", expected, tolerance, float(got), case.source)
        for case in cases
        for (name, (expected, tolerance)), got in zip(case.expected.items(), case.compute(), strict=True)
    ]


def as_text(outcomes: Sequence[SelfTestResult]) -> list[tuple[str, ...]]:
    """Rows of text under :data:`HEADINGS`; what came out has two digits more than the tolerance."""
    rows = []
    for outcome in outcomes:
        decimals = 1 - int(f"{outcome.tolerance:.0e}".split("e")[1])
        digits = ".10g" if outcome.tolerance < 1e-9 else f".{max(0, decimals)}f" if decimals < 9 else ".6g"
        numbers = f"{outcome.expected:.10g}", f"{outcome.tolerance:.2g}", f"{outcome.got:{digits}}"
        written = (number.replace("-", MINUS) for number in numbers)
        rows.append((outcome.case, *written, outcome.source, "pass" if outcome.passed else "FAIL"))
    return rows
