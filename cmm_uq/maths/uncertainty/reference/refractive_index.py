"""Reference cases of the refractive index of air."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from cmm_uq.maths.uncertainty.air.refractivity import birch_downs_1994, ciddor, harris_2004, modified_edlen
from cmm_uq.maths.uncertainty.measurement_model import derivatives
from cmm_uq.maths.uncertainty.reference.case import Expected, Figures, ReferenceCase

_AIR_TABLE = (
    (20, 0, 101.325, 633, 271800, 271799),
    (20, 0, 60, 633, 160924, 160920),
    (20, 0, 120, 633, 321916, 321918),
    (50, 0, 100, 633, 243285, 243270),
    (5, 0, 100, 633, 282756, 282750),
    (-40, 0, 100, 633, 337580, 337471),
    (50, 100, 120, 633, 287924, 287864),
    (40, 75, 120, 633, 299418, 299406),
    (20, 100, 100, 633, 267394, 267394),
    (40, 100, 110, 1700, 270247, 270237),
    (20, 0, 101.325, 1700, 268479, 268483),
    (40, 100, 110, 300, 289000, 288922),
    (20, 0, 101.325, 300, 286581, 286579),
    (-40, 0, 120, 300, 427233, 427072),
)

_DRY = ((20, 80, 21458.0), (20, 100, 26824.4), (20, 120, 32191.6), (10, 100, 27774.7), (30, 100, 25937.2))


def _air(equation: Callable[..., Any]) -> Callable[[], Figures]:
    return lambda: {
        f"{t} °C, {h} %, {kpa} kPa, {nm} nm": float(1e9 * equation(t, 1e3 * kpa, h, 450.0, nm))
        for t, h, kpa, nm, *_ in _AIR_TABLE
    }


def _air_expected(column: int) -> Expected:
    return {f"{row[0]} °C, {row[1]} %, {row[2]} kPa, {row[3]} nm": (float(row[column]), 1.0) for row in _AIR_TABLE}


def _laboratory_air() -> Figures:
    found = derivatives(lambda t, p, h, c: [ciddor(t, p, h, c, 633.0)], [20.0, 101325.0, 50.0, 450.0])
    slopes = found.jacobian[0].tolist()
    names = ("dn/dt, /K", "dn/dp, /Pa", "dn/dRH, /%", "dn/dCO2, /ppm")
    return {"(n − 1)·10⁸": float(1e8 * found.value[0]), **dict(zip(names, slopes, strict=True))}


def _harris_air() -> Figures:
    found = derivatives(lambda t, p, h: [1e6 * harris_2004(t, p * 101325 / 760, h, 0.0, 633.0)], [20.0, 760.0, 50.0])
    slopes = found.jacobian[0].tolist()
    return {"N": float(found.value[0]), **dict(zip(("dN/dT", "dN/dP", "dN/dH"), slopes, strict=True))}


def _water_constant() -> Figures:
    wet, dry = (birch_downs_1994(20.0, 1e5, h, 0.0, 633.0) for h in (100.0, 0.0))
    from cmm_uq.maths.uncertainty.air.refractivity import saturation_pressure

    slope = float((dry - wet) / saturation_pressure(20.0)) * 1e10
    return {"constant": slope + 0.0401 / 0.633**2}


CASES: Sequence[ReferenceCase] = (
    ReferenceCase(
        "Refractivity of air by Ciddor, (n − 1)·10⁹",
        "NIST Engineering Metrology Toolbox, table 1",
        _air_expected(4),
        _air(ciddor),
    ),
    ReferenceCase(
        "Refractivity of air by the modified Edlén equation, (n − 1)·10⁹",
        "NIST Engineering Metrology Toolbox, table 1",
        _air_expected(5),
        _air(modified_edlen),
    ),
    ReferenceCase(
        "Refractivity of dry air, 633 nm, (n − 1)·10⁸",
        "Ciddor 1996, table 1",
        {f"{t} °C, {kpa} kPa": (value, 0.05) for t, kpa, value in _DRY},
        lambda: {f"{t} °C, {kpa} kPa": float(1e8 * ciddor(t, 1e3 * kpa, 0.0, 450.0, 633.0)) for t, kpa, _ in _DRY},
    ),
    ReferenceCase(
        "Laboratory air by Ciddor and its sensitivities",
        "recomputed with forty digits",
        {
            "(n − 1)·10⁸": (27137.275, 1e-3),
            "dn/dt, /K": (-9.548e-7, 5e-11),
            "dn/dp, /Pa": (2.683e-9, 5e-13),
            "dn/dRH, /%": (-8.50e-9, 5e-12),
            "dn/dCO2, /ppm": (1.435e-10, 5e-14),
        },
        _laboratory_air,
    ),
    ReferenceCase(
        "Constant of water vapour",
        "Birch and Downs, Metrologia 31 (1994) 315",
        {"constant": (3.7345, 1e-9)},
        _water_constant,
    ),
    ReferenceCase(
        "Refractivity by the formula of Harris 2004, exponent mended",
        "Harris 2004 section 3.3, recomputed",
        {"N": (271.307, 5e-4), "dN/dT": (-0.958, 5e-4), "dN/dP": (0.358, 5e-4), "dN/dH": (-0.0096, 5e-5)},
        _harris_air,
    ),
)
