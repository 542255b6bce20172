"""Refractivity of air by Edlén's equation of 1966 and its successors.

The successors keep Edlén's form with new constants. They know no carbon dioxide; their standard air has 450 ppm (1966:
300 ppm). All take the vacuum wavelength.
"""

from __future__ import annotations

import numpy as np

from cmm_uq.maths.uncertainty.air.water_vapour import KELVIN, Quantity, vapour_pressure

_TORR = 101325.0 / 760.0
"""1 mm Hg in Pa."""


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
