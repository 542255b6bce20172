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
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from cmm_uq.base.errors import CmmUqError, suggestion
from cmm_uq.base.messages import say
from cmm_uq.base.points import Floats
from cmm_uq.base.units import REFERENCE_TEMPERATURE
from cmm_uq.maths.uncertainty.air import refractivity as by
from cmm_uq.maths.uncertainty.budget import Labels
from cmm_uq.maths.uncertainty.distributions import Distribution, Number, constant, normal, rectangular
from cmm_uq.maths.uncertainty.measurement_model import MeasurementModel
from cmm_uq.maths.uncertainty.propagation import first_order

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
    "ciddor": AirEquation("Ciddor 1996", by.ciddor, 1.0e-8),
    "modified_edlen": AirEquation("modified Edlén (NIST)", by.modified_edlen, 1.5e-8),
    "birch_downs_1994": AirEquation("Birch and Downs 1994", by.birch_downs_1994, 1.5e-8, (350.0, 1064.0), (0.0, 40.0)),
    "edlen_1966": AirEquation("Edlén 1966", by.edlen_1966, 5.0e-8, (230.0, 2060.0), (0.0, 40.0)),
    "harris_2004": AirEquation("Harris 2004", by.harris_2004, 5.0e-8, (632.0, 634.0), (0.0, 40.0)),
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
        humidity = by.relative_humidity(values["temperature_c"], values["dew_point_c"])
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
        "temperature_c": equation.temperature_c,
        "pressure_pa": (10e3, 140e3),
        "humidity_pct": (0.0, 100.0),
        "co2_ppm": (0.0, 2000.0),
        "wavelength_nm": equation.wavelength_nm,
    }
    inputs = air.inputs
    if "dew_point_c" in inputs:
        dew = by.relative_humidity(np.asarray(air.temperature_c.mean), np.asarray(inputs["dew_point_c"].mean))
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
