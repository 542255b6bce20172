"""Refractivity of air by Ciddor and by Edlén, and water vapour in air.

Water vapour in air: saturation pressure and mole fraction.

Saturation over water by the equation of IAPWS-IF97 region 4, over ice by Wagner, Saul and Pruß 1994, as the NIST
Engineering Metrology Toolbox uses them (Stone and Zimmerman, Index of Refraction of Air, appendix A-I and A-II).
Quantities are floats, arrays or jets.

Refractivity of air by Edlén's equation of 1966 and its successors.

The successors keep Edlén's form with new constants. They know no carbon dioxide; their standard air has 450 ppm (1966:
300 ppm). All take the vacuum wavelength.
"""

from __future__ import annotations

from typing import Any

import numpy as np

Quantity = Any
KELVIN = 273.15  # 0 °C in K

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


_W = (295.235, 2.6422, -0.03238, 0.004028)  # µm⁻², … of water vapour
_K = (238.0185, 5792105.0, 57.362, 167917.0)  # µm⁻² of dry air
_A = (1.58123e-6, -2.9331e-8, 1.1043e-10)  # compressibility (Davis 1992)
_B = (5.707e-6, -2.051e-8)
_C = (1.9898e-4, -2.376e-6)
_D, _E = 1.83e-11, -0.765e-8
_GAS_CONSTANT = 8.314472
_MOLAR_MASS_WATER = 0.018015
_STANDARD_PA, _STANDARD_K, _STANDARD_COMPRESSIBILITY = 101325.0, 288.15, 0.9995922115
_STANDARD_VAPOUR_DENSITY = 0.00985938


def ciddor(
    temperature_c: Quantity,
    pressure_pa: Quantity,
    relative_humidity_pct: Quantity,
    co2_ppm: Quantity,
    wavelength_nm: Quantity,
) -> Quantity:
    """Phase refractivity n − 1; ``wavelength_nm`` is the vacuum wavelength."""
    kelvin = temperature_c + KELVIN
    water = mole_fraction(temperature_c, pressure_pa, relative_humidity_pct)
    sigma2 = 1e6 / (wavelength_nm * wavelength_nm)  # µm⁻²
    k0, k1, k2, k3 = _K
    w0, w1, w2, w3 = _W
    dry = 1e-8 * (k1 / (k0 - sigma2) + k3 / (k2 - sigma2)) * (1.0 + 5.34e-7 * (co2_ppm - 450.0))
    vapour = 1.022e-8 * (w0 + sigma2 * (w1 + sigma2 * (w2 + sigma2 * w3)))
    molar_mass = 0.0289635 + 1.2011e-8 * (co2_ppm - 400.0)
    a0, a1, a2 = _A
    (b0, b1), (c0, c1) = _B, _C
    ratio, t = pressure_pa / kelvin, temperature_c
    virial = a0 + t * (a1 + t * a2) + water * (b0 + b1 * t + water * (c0 + c1 * t))
    compressibility = 1.0 - ratio * virial + ratio * ratio * (_D + _E * water * water)
    moles = ratio / (compressibility * _GAS_CONSTANT)
    # the molar mass of dry air is in its density and in that of standard air, and cancels but for what CO2 changes
    standard = _STANDARD_PA / (_STANDARD_COMPRESSIBILITY * _GAS_CONSTANT * _STANDARD_K) * molar_mass
    dry_density = moles * (1.0 - water) * molar_mass
    vapour_density = moles * water * _MOLAR_MASS_WATER
    return dry_density / standard * dry + vapour_density / _STANDARD_VAPOUR_DENSITY * vapour


_TORR = 101325.0 / 760.0  # 1 mm Hg in Pa


def _dry_updated(temperature_c: Quantity, pressure_pa: Quantity, sigma2: Quantity) -> Quantity:
    """Birch and Downs, Metrologia 30 (1993) 155, with the constants of Metrologia 31 (1994) 315."""
    standard = 1e-8 * (8342.54 + 2406147.0 / (130.0 - sigma2) + 15998.0 / (38.9 - sigma2))
    density = (1.0 + 1e-8 * (0.601 - 0.00972 * temperature_c) * pressure_pa) / (1.0 + 0.0036610 * temperature_c)
    return pressure_pa * standard * density / 96095.43


def birch_downs_1994(
    temperature_c: Quantity,
    pressure_pa: Quantity,
    relative_humidity_pct: Quantity,
    co2_ppm: Quantity,
    wavelength_nm: Quantity,
) -> Quantity:
    """Phase refractivity n − 1 by the updated Edlén equation, Birch and Downs, Metrologia 31 (1994) 315."""
    sigma2 = 1e6 / (wavelength_nm * wavelength_nm)
    vapour = vapour_pressure(temperature_c, relative_humidity_pct)
    return _dry_updated(temperature_c, pressure_pa, sigma2) - 1e-10 * (3.7345 - 0.0401 * sigma2) * vapour


def modified_edlen(
    temperature_c: Quantity,
    pressure_pa: Quantity,
    relative_humidity_pct: Quantity,
    co2_ppm: Quantity,
    wavelength_nm: Quantity,
) -> Quantity:
    """Phase refractivity n − 1 by the updated equation with NIST's water term, right away from 20 °C too.

    Stone and Zimmerman, NIST Engineering Metrology Toolbox, appendix A-IV.
    """
    sigma2 = 1e6 / (wavelength_nm * wavelength_nm)
    vapour = vapour_pressure(temperature_c, relative_humidity_pct)
    water = 1e-10 * 292.75 / (temperature_c + KELVIN) * (3.7345 - 0.0401 * sigma2) * vapour
    return _dry_updated(temperature_c, pressure_pa, sigma2) - water


def edlen_1966(
    temperature_c: Quantity,
    pressure_pa: Quantity,
    relative_humidity_pct: Quantity,
    co2_ppm: Quantity,
    wavelength_nm: Quantity,
) -> Quantity:
    """Phase refractivity n − 1, Edlén, Metrologia 2 (1966) 71, equations 1, 12 and 22 (pressures there in torr)."""
    sigma2 = 1e6 / (wavelength_nm * wavelength_nm)
    standard = 1e-8 * (8342.13 + 2406030.0 / (130.0 - sigma2) + 15997.0 / (38.9 - sigma2))
    torr, vapour = pressure_pa / _TORR, vapour_pressure(temperature_c, relative_humidity_pct) / _TORR
    density = torr * (1.0 + 1e-6 * torr * (0.817 - 0.0133 * temperature_c)) / (1.0 + 0.0036610 * temperature_c)
    return standard * density / 720.775 - 1e-8 * (5.722 - 0.0457 * sigma2) * vapour


def harris_2004(
    temperature_c: Quantity,
    pressure_pa: Quantity,
    relative_humidity_pct: Quantity,
    co2_ppm: Quantity,
    wavelength_nm: Quantity,
) -> Quantity:
    """Phase refractivity n − 1 at 633 nm by the formula of Harris 2004 section 3.3 (after Kneppers 1999).

    Its printed factor 10⁶ is 10⁻⁶: it is Edlén's equation of 1966 at 633 nm with an exponential for saturation.
    """
    torr = pressure_pa / _TORR
    density = (1.0 + 1e-6 * torr * (0.817 - 0.0133 * temperature_c)) / (1.0 + 0.0036610 * temperature_c)
    water = 3.033e-3 * relative_humidity_pct * np.exp(0.057627 * temperature_c)
    return 1e-6 * (0.3836391 * torr * density - water)
