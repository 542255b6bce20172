"""Refractivity of air by Ciddor, Applied Optics 35 (1996) 1566, with the molar constants that the NIST toolbox uses."""

from __future__ import annotations

from cmm_uq.maths.uncertainty.air.water_vapour import KELVIN, Quantity, mole_fraction

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
