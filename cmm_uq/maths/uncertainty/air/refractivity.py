"""Refractivity of air by Ciddor and by Edlén, and water vapour in air, for floats, arrays or jets.

Saturation over water by the equation of IAPWS-IF97 region 4, over ice by Wagner, Saul and Pruß 1994, as the NIST
Engineering Metrology Toolbox uses them (Stone and Zimmerman, Index of Refraction of Air, appendix A-I and A-II). The
successors of Edlén's equation of 1966 keep its form with new constants. They know no carbon dioxide; their standard air has
450 ppm (1966: 300 ppm). All take the vacuum wavelength.
"""

from __future__ import annotations

from typing import Any

import numpy as np

KELVIN = 273.15  # 0 °C in K
_TRIPLE_POINT_K, _TRIPLE_POINT_PA = 273.16, 611.657


def saturation_pressure(temperature_c: Any) -> Any:
    """Pressure of saturated water vapour, Pa: over water above the triple point, over ice below."""
    kelvin = temperature_c + KELVIN
    return np.where(kelvin > _TRIPLE_POINT_K, _over_water(kelvin), _over_ice(kelvin))


def _over_water(kelvin: Any) -> Any:
    omega = kelvin + -2.38555575678e-1 / (kelvin - 6.50175348448e2)
    a = omega**2 + 1.16705214528e3 * omega + -7.24213167032e5
    b = -1.70738469401e1 * omega**2 + 1.20208247025e4 * omega + -3.23255503223e6
    c = 1.49151086135e1 * omega**2 + -4.82326573616e3 * omega + 4.05113405421e5
    x = -b + np.sqrt(b**2 - 4.0 * a * c)
    return 1e6 * (2.0 * c / x) ** 4


def _over_ice(kelvin: Any) -> Any:
    ratio = kelvin / _TRIPLE_POINT_K
    return _TRIPLE_POINT_PA * np.exp(-13.928169 * (1.0 - ratio**-1.5) + 34.7078238 * (1.0 - ratio**-1.25))


def vapour_pressure(temperature_c: Any, humidity_pct: Any) -> Any:
    """Partial pressure of water vapour from the relative humidity, Pa."""
    return 0.01 * humidity_pct * saturation_pressure(temperature_c)


def mole_fraction(temperature_c: Any, pressure_pa: Any, humidity_pct: Any) -> Any:
    """Mole fraction of water vapour, with the enhancement factor of moist air (Ciddor 1996, appendix A)."""
    enhancement = 1.00062 + 3.14e-8 * pressure_pa + 5.60e-7 * temperature_c**2
    return enhancement * vapour_pressure(temperature_c, humidity_pct) / pressure_pa


def relative_humidity(temperature_c: Any, dew_point_c: Any) -> Any:
    """Relative humidity from the dew point (frost point below 0 °C), %."""
    return 100.0 * saturation_pressure(dew_point_c) / saturation_pressure(temperature_c)


_GAS_CONSTANT, _MOLAR_MASS_WATER = 8.314472, 0.018015
_STANDARD_PA, _STANDARD_K = 101325.0, 288.15
_STANDARD_COMPRESSIBILITY, _STANDARD_VAPOUR_DENSITY = 0.9995922115, 0.00985938
_TORR = 101325.0 / 760.0  # 1 mm Hg in Pa


def ciddor(temperature_c: Any, pressure_pa: Any, humidity_pct: Any, co2_ppm: Any, wavelength_nm: Any) -> Any:
    """Phase refractivity n − 1; ``wavelength_nm`` is the vacuum wavelength."""
    kelvin = temperature_c + KELVIN
    water = mole_fraction(temperature_c, pressure_pa, humidity_pct)
    sigma2 = 1e6 / (wavelength_nm * wavelength_nm)  # µm⁻²
    dry = 1e-8 * (5792105.0 / (238.0185 - sigma2) + 167917.0 / (57.362 - sigma2)) * (1.0 + 5.34e-7 * (co2_ppm - 450.0))
    vapour = 1.022e-8 * (295.235 + sigma2 * (2.6422 + sigma2 * (-0.03238 + sigma2 * 0.004028)))
    molar_mass = 0.0289635 + 1.2011e-8 * (co2_ppm - 400.0)
    ratio, t = pressure_pa / kelvin, temperature_c
    moist = 5.707e-6 + -2.051e-8 * t + water * (1.9898e-4 + -2.376e-6 * t)  # Davis, Metrologia 29 (1992) 67
    virial = 1.58123e-6 + t * (-2.9331e-8 + t * 1.1043e-10) + water * moist
    compressibility = 1.0 - ratio * virial + ratio * ratio * (1.83e-11 + -0.765e-8 * water * water)
    moles = ratio / (compressibility * _GAS_CONSTANT)
    # the molar mass of dry air is in its density and in that of standard air, and cancels but for what CO2 changes
    standard = _STANDARD_PA / (_STANDARD_COMPRESSIBILITY * _GAS_CONSTANT * _STANDARD_K) * molar_mass
    dry_density = moles * (1.0 - water) * molar_mass
    vapour_density = moles * water * _MOLAR_MASS_WATER
    return dry_density / standard * dry + vapour_density / _STANDARD_VAPOUR_DENSITY * vapour


def _dry_updated(temperature_c: Any, pressure_pa: Any, sigma2: Any) -> Any:
    """Birch and Downs, Metrologia 30 (1993) 155, with the constants of Metrologia 31 (1994) 315."""
    standard = 1e-8 * (8342.54 + 2406147.0 / (130.0 - sigma2) + 15998.0 / (38.9 - sigma2))
    density = (1.0 + 1e-8 * (0.601 - 0.00972 * temperature_c) * pressure_pa) / (1.0 + 0.0036610 * temperature_c)
    return pressure_pa * standard * density / 96095.43


def birch_downs_1994(temperature_c: Any, pressure_pa: Any, humidity_pct: Any, co2_ppm: Any, wavelength_nm: Any) -> Any:
    """Phase refractivity n − 1 by the updated Edlén equation, Birch and Downs, Metrologia 31 (1994) 315."""
    sigma2 = 1e6 / (wavelength_nm * wavelength_nm)
    vapour = vapour_pressure(temperature_c, humidity_pct)
    return _dry_updated(temperature_c, pressure_pa, sigma2) - 1e-10 * (3.7345 - 0.0401 * sigma2) * vapour


def modified_edlen(temperature_c: Any, pressure_pa: Any, humidity_pct: Any, co2_ppm: Any, wavelength_nm: Any) -> Any:
    """Phase refractivity n − 1 by the updated equation with NIST's water term, right away from 20 °C too.

    Stone and Zimmerman, NIST Engineering Metrology Toolbox, appendix A-IV.
    """
    sigma2 = 1e6 / (wavelength_nm * wavelength_nm)
    vapour = vapour_pressure(temperature_c, humidity_pct)
    water = 1e-10 * 292.75 / (temperature_c + KELVIN) * (3.7345 - 0.0401 * sigma2) * vapour
    return _dry_updated(temperature_c, pressure_pa, sigma2) - water


def edlen_1966(temperature_c: Any, pressure_pa: Any, humidity_pct: Any, co2_ppm: Any, wavelength_nm: Any) -> Any:
    """Phase refractivity n − 1, Edlén, Metrologia 2 (1966) 71, equations 1, 12 and 22 (pressures there in torr)."""
    sigma2 = 1e6 / (wavelength_nm * wavelength_nm)
    standard = 1e-8 * (8342.13 + 2406030.0 / (130.0 - sigma2) + 15997.0 / (38.9 - sigma2))
    torr, vapour = pressure_pa / _TORR, vapour_pressure(temperature_c, humidity_pct) / _TORR
    density = torr * (1.0 + 1e-6 * torr * (0.817 - 0.0133 * temperature_c)) / (1.0 + 0.0036610 * temperature_c)
    return standard * density / 720.775 - 1e-8 * (5.722 - 0.0457 * sigma2) * vapour


def harris_2004(temperature_c: Any, pressure_pa: Any, humidity_pct: Any, co2_ppm: Any, wavelength_nm: Any) -> Any:
    """Phase refractivity n − 1 at 633 nm by the formula of Harris 2004 section 3.3 (after Kneppers 1999).

    Its printed factor 10⁶ is 10⁻⁶: it is Edlén's equation of 1966 at 633 nm with an exponential for saturation.
    """
    torr = pressure_pa / _TORR
    density = (1.0 + 1e-6 * torr * (0.817 - 0.0133 * temperature_c)) / (1.0 + 0.0036610 * temperature_c)
    water = 3.033e-3 * humidity_pct * np.exp(0.057627 * temperature_c)
    return 1e-6 * (0.3836391 * torr * density - water)
