"""The state of the air as it was measured, the refractive index that follows, and lengths by laser interferometer in it.

What is not measured gets a default with the uncertainty of not knowing it, and the budget says so: weather moves the
pressure by some ± 3 kPa about its mean at an altitude, the humidity of a room lies between 10 % and 90 %, its carbon
dioxide between 300 and 600 ppm, and a helium-neon laser that nobody calibrated at (632.9908 ± 0.0019) nm (relative
standard uncertainty 1.5·10⁻⁶, CIPM recommendation 2007).

The counter of an interferometer adds up half wavelengths. Between zeroing (air of index n₀ all along the way) and reading
(index n) the optical path difference changes by 2 [n (D + L) − n₀ D], where D is the dead path between the interferometer and
the place of zeroing; so with V the displacement as vacuum wavelengths count it,

    L = [V − D (n − n₀)] / (n cos θ)

where θ is the angle between beam and motion. A workpiece of temperature t is 1 + α (t − 20) longer than at 20 °C.

Refractivity of air by Ciddor and by Edlén, and water vapour in air, for floats, arrays or jets.

Saturation over water by the equation of IAPWS-IF97 region 4, over ice by Wagner, Saul and Pruß 1994, as the NIST
Engineering Metrology Toolbox uses them (Stone and Zimmerman, Index of Refraction of Air, appendix A-I and A-II). The
successors of Edlén's equation of 1966 keep its form with new constants. They know no carbon dioxide; their standard air has
450 ppm (1966: 300 ppm). All take the vacuum wavelength.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np

from cmm_uq.base.errors import CmmUqError, suggestion
from cmm_uq.base.messages import say
from cmm_uq.base.points import Floats
from cmm_uq.base.units import REFERENCE_TEMPERATURE
from cmm_uq.base.values import dataclass, field
from cmm_uq.maths.uncertainty.budget import Labels
from cmm_uq.maths.uncertainty.distributions import Distribution, Number, constant, normal, rectangular
from cmm_uq.maths.uncertainty.measurement_model import MeasurementModel
from cmm_uq.maths.uncertainty.propagation import first_order

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


Range = tuple[float, float]
HELIUM_NEON_NM = 632.9908
_AIR = {"temperature_c": "degC", "pressure_pa": "Pa", "humidity_pct": "percent", "dew_point_c": "degC"}
_AIR |= {"co2_ppm": "ppm", "wavelength_nm": "nm"}
_BEAM = {"vacuum_mm": "mm", "dead_path_mm": "mm", "zero_refractivity": "1", "angle_rad": "rad"}
_BEAM |= {"material_c": "degC", "cte_per_k": "1/K"}


@dataclass(frozen=True)
class AirEquation:
    name: str  # as budgets cite it
    refractivity: Callable[..., Any]  # n − 1 of temperature, pressure, relative humidity, CO2 and vacuum wavelength
    u: float  # standard uncertainty of the equation itself, as its source or NIST's comparison states it
    wavelength_nm: Range = (300.0, 1700.0)  # range of vacuum wavelengths
    temperature_c: Range = (-40.0, 100.0)  # range of temperatures


EQUATIONS: Mapping[str, AirEquation] = {
    "ciddor": AirEquation("Ciddor 1996", ciddor, 1.0e-8),
    "modified_edlen": AirEquation("modified Edlén (NIST)", modified_edlen, 1.5e-8),
    "birch_downs_1994": AirEquation("Birch and Downs 1994", birch_downs_1994, 1.5e-8, (350.0, 1064.0), (0.0, 40.0)),
    "edlen_1966": AirEquation("Edlén 1966", edlen_1966, 5.0e-8, (230.0, 2060.0), (0.0, 40.0)),
    "harris_2004": AirEquation("Harris 2004", harris_2004, 5.0e-8, (632.0, 634.0), (0.0, 40.0)),
}


def _known(setup: object, names: Iterable[str]) -> dict[str, Distribution]:
    return {name: known for name in names if (known := getattr(setup, name)) is not None}


@dataclass(frozen=True, eq=False)
class Air:
    """What is known of the air on the way of a beam; ``None`` where it was not measured.

    The humidity is relative, %; the dew point may be given instead. Carbon dioxide is in parts per million by volume, the
    wavelength that in vacuum. The mean pressure at the altitude stands in for one that was not measured.
    """

    temperature_c: Distribution
    pressure_pa: Distribution | None = None
    humidity_pct: Distribution | None = None
    dew_point_c: Distribution | None = None
    co2_ppm: Distribution | None = None
    wavelength_nm: Distribution | None = None
    altitude_m: float = 0.0

    def __post_init__(self) -> None:
        if self.humidity_pct is not None and self.dew_point_c is not None:
            raise CmmUqError("both relative humidity and dew point are given", fix="Give one of them")

    @property
    def assumed(self) -> dict[str, Distribution]:
        mean = standard_pressure(self.altitude_m)
        defaults = {
            "pressure_pa": (self.pressure_pa, rectangular(mean - 3e3, mean + 3e3)),
            "humidity_pct": (self.humidity_pct or self.dew_point_c, rectangular(10.0, 90.0)),
            "co2_ppm": (self.co2_ppm, rectangular(300.0, 600.0)),
            "wavelength_nm": (self.wavelength_nm, normal(HELIUM_NEON_NM, 1.5e-6 * HELIUM_NEON_NM)),
        }
        return {name: default for name, (measured, default) in defaults.items() if measured is None}

    @property
    def inputs(self) -> dict[str, Distribution]:
        return _known(self, _AIR) | self.assumed

    @property
    def labels(self) -> Labels:
        """Units, and where each figure comes from."""
        assumed = dict.fromkeys(self.assumed, say("judgement: not measured"))
        return Labels(
            _AIR | {"equation": "1"},
            {**dict.fromkeys(self.inputs, say("measured")), **assumed, "equation": say("literature")},
        )


def standard_pressure(altitude_m: Number) -> Any:
    """Mean pressure at an altitude below 11 km, Pa (ISO 2533 standard atmosphere)."""
    return 101325.0 * (1.0 - 2.25577e-5 * np.asarray(altitude_m)) ** 5.25588


def equation_by_name(name: str) -> AirEquation:
    if name not in EQUATIONS:
        problem = f"there is no equation {name!r} for the refractive index of air"
        raise CmmUqError(problem, fix=suggestion(name, EQUATIONS))
    return EQUATIONS[name]


def refractivity_of(equation: AirEquation, values: Mapping[str, Any]) -> Any:
    """Refractivity n − 1 from the inputs of :class:`Air` and the error of the equation, floats, arrays or jets."""
    humidity = values.get("humidity_pct")
    if humidity is None:
        humidity = relative_humidity(values["temperature_c"], values["dew_point_c"])
    found = equation.refractivity(
        values["temperature_c"], values["pressure_pa"], humidity, values["co2_ppm"], values["wavelength_nm"]
    )
    return found + values.get("equation", 0.0)


def air_model(air: Air, equation: str = "ciddor") -> MeasurementModel:
    """Measurement model of the refractivity n − 1; the equation's own error is an input of it."""
    chosen = equation_by_name(equation)
    check_range(air, chosen)
    inputs = {**air.inputs, "equation": normal(0.0, chosen.u)}
    return MeasurementModel(lambda **values: refractivity_of(chosen, values), inputs, ("refractivity",))


def refractive_index(air: Air, equation: str = "ciddor") -> tuple[Floats, Floats]:
    """Refractive index n and its standard uncertainty, for one state of the air or for arrays of them."""
    found = first_order(air_model(air, equation))
    return 1.0 + found.value[0], found.u[0]


def check_range(air: Air, equation: AirEquation) -> None:
    """Refuse estimates out of the range of an equation."""
    ranges = {
        "temperature_c": equation.temperature_c, "pressure_pa": (10e3, 140e3), "humidity_pct": (0.0, 100.0),
        "co2_ppm": (0.0, 2000.0), "wavelength_nm": equation.wavelength_nm,
    }  # fmt: skip
    inputs = air.inputs
    if "dew_point_c" in inputs:
        dew = relative_humidity(np.asarray(air.temperature_c.mean), np.asarray(inputs["dew_point_c"].mean))
        inputs["humidity_pct"] = constant(dew)
    for name, (low, high) in ranges.items():
        means = np.atleast_1d(inputs[name].mean)
        outside = means[(means < low) | (means > high)]
        if len(outside):
            problem = f"{name} = {outside[0]:g} is out of the range {low:g} to {high:g} of {equation.name}"
            raise CmmUqError(problem, fix="Check its unit, or choose another equation")


@dataclass(frozen=True, eq=False)
class Interferometer:
    """What a displacement measured by laser rests on."""

    vacuum_mm: Distribution  # displacement in vacuum wavelengths; its uncertainty is that of resolution and noise
    air: Air  # at the time of the reading
    dead_path_mm: Distribution | None = None  # between the interferometer and the place of zeroing
    zero_refractivity: Distribution | None = None  # n₀ − 1 at zeroing; None means the air has not changed since
    angle_rad: Distribution | None = None  # between beam and motion
    material_c: Distribution | None = None  # temperature of what is measured; None leaves the length as it is
    cte_per_k: Distribution | None = None  # its expansion coefficient
    origins: Mapping[str, str] = field(default_factory=dict)  # of the figures, by the names of the model's inputs

    @property
    def labels(self) -> Labels:
        """Units and origins of the inputs and of the length."""
        air = self.air.labels
        return Labels({**air.units, **_BEAM, "length": "mm"}, {**air.origins, **self.origins})


def interferometer_model(setup: Interferometer, equation: str = "ciddor") -> MeasurementModel:
    """Measurement model of the length, mm, at 20 °C where the material's temperature is given.

    The wavelength enters twice: through the count, as a relative error of V, and (hardly) through the dispersion of air.
    Raises :class:`CmmUqError` for an unknown equation, or air out of its range.
    """
    chosen = equation_by_name(equation)
    check_range(setup.air, chosen)
    nominal = setup.air.inputs["wavelength_nm"].mean
    inputs = _known(setup, _BEAM) | setup.air.inputs | {"equation": normal(0.0, chosen.u)}
    inputs.setdefault("dead_path_mm", constant(0.0))

    def length(**values: Any) -> Any:
        refractivity = refractivity_of(chosen, values)
        counted = values["vacuum_mm"] * values["wavelength_nm"] / nominal
        changed = refractivity - values["zero_refractivity"] if "zero_refractivity" in values else 0.0
        along_beam = (counted - values["dead_path_mm"] * changed) / (1.0 + refractivity)
        straight = along_beam / np.cos(values["angle_rad"]) if "angle_rad" in values else along_beam
        if "material_c" not in values:
            return straight
        return straight / (1.0 + values["cte_per_k"] * (values["material_c"] - REFERENCE_TEMPERATURE))

    return MeasurementModel(length, inputs, ("length",))
