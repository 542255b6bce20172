"""Water vapour in air: saturation pressure and mole fraction.

Saturation over water by the equation of IAPWS-IF97 region 4, over ice by Wagner, Saul and Pruß 1994, as the NIST
Engineering Metrology Toolbox uses them (Stone and Zimmerman, Index of Refraction of Air, appendix A-I and A-II).
Quantities are floats, arrays or jets.
"""

from __future__ import annotations

from typing import Any

import numpy as np

Quantity = Any

KELVIN = 273.15
"""0 °C in K."""

_WATER = (
    1.16705214528e3,
    -7.24213167032e5,
    -1.70738469401e1,
    1.20208247025e4,
    -3.23255503223e6,
    1.49151086135e1,
    -4.82326573616e3,
    4.05113405421e5,
    -2.38555575678e-1,
    6.50175348448e2,
)
_ICE = (-13.928169, 34.7078238)
_TRIPLE_POINT_K, _TRIPLE_POINT_PA = 273.16, 611.657


def saturation_pressure(temperature_c: Quantity) -> Quantity:
    """Pressure of saturated water vapour, Pa: over water above the triple point, over ice below."""
    kelvin = temperature_c + KELVIN
    return np.where(kelvin > _TRIPLE_POINT_K, _over_water(kelvin), _over_ice(kelvin))


def _over_water(kelvin: Quantity) -> Quantity:
    k1, k2, k3, k4, k5, k6, k7, k8, k9, k10 = _WATER
    omega = kelvin + k9 / (kelvin - k10)
    a = omega**2 + k1 * omega + k2
    b = k3 * omega**2 + k4 * omega + k5
    c = k6 * omega**2 + k7 * omega + k8
    x = -b + np.sqrt(b**2 - 4.0 * a * c)
    return 1e6 * (2.0 * c / x) ** 4


def _over_ice(kelvin: Quantity) -> Quantity:
    a1, a2 = _ICE
    ratio = kelvin / _TRIPLE_POINT_K
    return _TRIPLE_POINT_PA * np.exp(a1 * (1.0 - ratio**-1.5) + a2 * (1.0 - ratio**-1.25))


def vapour_pressure(temperature_c: Quantity, relative_humidity_pct: Quantity) -> Quantity:
    """Partial pressure of water vapour from the relative humidity, Pa."""
    return 0.01 * relative_humidity_pct * saturation_pressure(temperature_c)


def mole_fraction(temperature_c: Quantity, pressure_pa: Quantity, relative_humidity_pct: Quantity) -> Quantity:
    """Mole fraction of water vapour, with the enhancement factor of moist air (Ciddor 1996, appendix A)."""
    enhancement = 1.00062 + 3.14e-8 * pressure_pa + 5.60e-7 * temperature_c**2
    return enhancement * vapour_pressure(temperature_c, relative_humidity_pct) / pressure_pa


def relative_humidity(temperature_c: Quantity, dew_point_c: Quantity) -> Quantity:
    """Relative humidity from the dew point (frost point below 0 °C), %."""
    return 100.0 * saturation_pressure(dew_point_c) / saturation_pressure(temperature_c)
