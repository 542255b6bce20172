"""Errors of scales beyond a constant factor: curvature, and a laser's wavelength in air that nobody corrected.

A scale that is not parallel to its axis, or a gauge not parallel to a line (cosine error), is a constant factor −½θ² at any
place, and cannot be told from the scale error of that axis; so it is no effect of its own.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from cmm_uq.base.messages import Text, Verbatim, say
from cmm_uq.base.points import AXES, Floats, Points
from cmm_uq.base.units import MICROMETRE, REFERENCE_TEMPERATURE, unit
from cmm_uq.machine.physics.effect import FURTHER, Amount, Effect, Parameter, along
from cmm_uq.maths.uncertainty.air.refractivity import harris_2004

AIR = ("temp_air_c", "pressure_hpa", "humidity_pct")
_PASCAL_PER_HPA = 100.0
_CO2_PPM, _HENE_NM = 450.0, 632.991
_STANDARD = (REFERENCE_TEMPERATURE, 101325.0, 50.0)


class ScaleCurvature(Effect):
    """Position error of second order, over the travel T from a0.

    A scale clamped at both ends, a tape that is stretched unevenly, a rack of two pieces.
    """

    formula = "e_a = bow·(1 − (2(a − a0)/T − 1)²)"
    mechanism = "scale"
    coefficients = (Parameter("bow_um", unit("µm"), 10.0),)
    tier = FURTHER

    def __init__(self, axis: str) -> None:
        self.axis = self.along_motion = axis
        self.name = f"scale_curvature_{axis}"
        self.title = say("Curvature of the scale of {axis}", axis=Verbatim(axis.upper()))
        self.points_to = say(
            "the scale of {axis} is stretched unevenly: check how its ends are clamped and its joints, "
            "and compensate position by a table, which one factor cannot replace",
            axis=Verbatim(axis.upper()),
        )

    def meaning(self, amounts: Mapping[str, Amount]) -> Text:
        amount = amounts[self.coefficients[0].name]
        return say(
            "in the middle of its travel {axis} stands {size} further towards {side} than it reads",
            axis=Verbatim(self.axis.upper()), size=amount.size, side=amount.side,
        )  # fmt: skip

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        low, high = points.machine.travel(self.axis)
        place = 2 * (points.readings[self.axis] - low) / (high - low) - 1
        return along(self.axis, MICROMETRE * (1 - place**2))


class AirScale(Effect):
    """A laser scale whose wavelength is not corrected for air; n₀ at 20 °C, 1013.25 hPa, 50 %.

    Part 1 is no correction at all. About −1 ppm/K, +0.27 ppm/hPa, −0.01 ppm/% in n (Harris 2004 section 3.3).
    """

    formula = "e_a = −part·(n − n₀)·a"
    mechanism = "scale"
    coefficients = (Parameter("part", unit("1"), 1.0),)
    columns = AIR
    tier = FURTHER

    def __init__(self, axis: str) -> None:
        self.axis = self.along_motion = axis
        self.name = f"air_scale_{axis}"
        self.title = say("Refractive index of air on the laser scale of {axis}", axis=Verbatim(axis.upper()))
        self.points_to = say(
            "the laser of {axis} is not, or wrongly, corrected for air: check its sensors of air "
            "temperature, pressure and humidity, and that the compensation uses them",
            axis=Verbatim(axis.upper()),
        )

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        return along(self.axis, -index_change(points) * points.readings[self.axis])


class DeadPath(Effect):
    """Dead path of a laser scale: the path d that the zero of the scale leaves out.

    The air between interferometer and zero changes its optical length while nothing moves.
    """

    formula = "e_a = −d·(n − n at the first point)"
    mechanism = "scale"
    coefficients = (Parameter("path_mm", unit("mm"), 300.0),)
    columns = AIR
    tier = FURTHER

    def __init__(self, axis: str) -> None:
        self.axis = self.along_motion = axis
        self.name = f"dead_path_{axis}"
        self.title = say("Dead path of the laser scale of {axis}", axis=Verbatim(axis.upper()))
        self.points_to = say(
            "the dead path of the laser of {axis} is not compensated: enter it in the compensation, or "
            "zero the axis close to the interferometer",
            axis=Verbatim(axis.upper()),
        )

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        change = index_change(points)
        return along(self.axis, change[0] - change)


def index_change(points: Points) -> Floats:
    """Refractive index of the recorded air less that of standard air, (n,)."""

    def refractivity(temperature: Floats, pascal: Floats, humidity: Floats) -> Floats:
        return np.asarray(harris_2004(temperature, pascal, humidity, _CO2_PPM, _HENE_NM), dtype=np.float64)

    temperature, hectopascal, humidity = (points.column(name) for name in AIR)
    standard = refractivity(*(np.array(value) for value in _STANDARD))
    return refractivity(temperature, _PASCAL_PER_HPA * hectopascal, humidity) - standard


EFFECTS: tuple[Effect, ...] = (
    *(ScaleCurvature(a) for a in AXES),
    *(AirScale(a) for a in AXES),
    *(DeadPath(a) for a in AXES),
)
