"""Errors of drives, scales and guideways: periodic error, what changes when an axis turns round, drift, air on a laser.

What changes at reversal shares a sign: half of it each way. A scale that is not parallel to its axis, or a gauge not parallel
to a line (cosine error), is a constant factor −½θ² at any place and cannot be told from the scale error of that axis; so it is
no effect of its own.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from cmm_uq.base.messages import Text, Verbatim
from cmm_uq.base.points import AXES, Floats, Points
from cmm_uq.base.units import ARCSECOND, METRE, MICROMETRE, REFERENCE_TEMPERATURE, unit
from cmm_uq.machine.physics.effect import (
    AXIS,
    FURTHER,
    SIZE,
    Amount,
    Effect,
    Harmonic,
    Nonparametric,
    OfAxis,
    Parameter,
    Shape,
    along,
    filled,
    say,
)
from cmm_uq.machine.physics.effects import Law
from cmm_uq.machine.physics.effects.rigid_body import bow, turned
from cmm_uq.maths.uncertainty.air.state import harris_2004

_MILLISECOND = 1e-3  # 1 ms in s
_PASCAL_PER_HPA = 100.0
_CO2_PPM, _HENE_NM = 450.0, 632.991
AIR = ("temp_air_c", "pressure_hpa", "humidity_pct")
_STANDARD = tuple(np.array(value) for value in (REFERENCE_TEMPERATURE, 101325.0, 50.0, _CO2_PPM, _HENE_NM))


class PeriodicScale(OfAxis, Harmonic):
    """Periodic error of a scale, leadscrew or rack."""

    family, title = "periodic_scale", say("Periodic scale error of {axis}")
    formula, mechanism = "e_a = A·sin(2π a/λ + φ)", "scale"
    points_to = say("an error that repeats with the period: scale interpolation, leadscrew or rack")
    means = say("the error of {axis} swings to either side by {amplitude} and repeats every {period}")
    several = say("the error of {axis} swings to either side by {amplitude} and repeats with one of several periods")
    amplitude = Parameter("amplitude_um", unit("µm"), 10.0, say("amplitude"))
    coefficients = (Parameter("cosine_um", unit("µm"), 10.0), Parameter("sine_um", unit("µm"), 10.0))
    # errors that it is the sum of, where that is stated: each of any one period in its bands (from, to, mm; prior sd of sine
    # and of cosine, µm)
    errors: tuple[tuple[tuple[float, float, float], ...], ...] = ()

    shape = (Shape("period_mm", unit("mm"), 0.5, 1000.0, period_along="{a}", what=say("period")),)
    imitated_by = (Nonparametric("{a}_mm", "{a}"),)

    def meaning(self, amounts: Mapping[str, Amount]) -> Text:
        if self.shape[0].name in amounts:
            return super().meaning(amounts)
        blanks: dict[Text, Text] = {AXIS: Verbatim(self.axis.upper()), SIZE: amounts[self.amplitude.name].size}
        return filled(self.several, blanks)

    def component(self, points: Points, shape: Sequence[float]) -> Floats:
        angle = 2 * np.pi * points.readings[self.axis] / shape[0]
        return MICROMETRE * np.column_stack([np.sin(angle), np.cos(angle)])


def travel(points: Points) -> Floats:
    """Unit vectors (n, 3) of travel into each point; zero where none was recorded."""
    signs = np.column_stack([points.column(f"approach_{a}") for a in AXES])
    length = np.linalg.norm(signs, axis=1, keepdims=True)
    return np.asarray(signs / np.where(length > 0, length, 1.0), dtype=np.float64)


def index_change(points: Points) -> Floats:
    """Refractive index of the recorded air less that of standard air, (n,)."""
    temperature, hectopascal, humidity = (points.column(name) for name in AIR)
    recorded = harris_2004(temperature, _PASCAL_PER_HPA * hectopascal, humidity, _CO2_PPM, _HENE_NM)
    return np.asarray(recorded - harris_2004(*_STANDARD), dtype=np.float64)


def _winding(points: Points, axis: str, _: str, __: Sequence[float]) -> Floats:
    low, high = points.machine.travel(axis)
    place = (points.readings[axis] - 0.5 * (low + high)) / METRE
    return along(axis, 0.5 * MICROMETRE * points.column(f"approach_{axis}") * place)


_APPROACH = ("approach_{a}",)
HYSTERESIS, DRIFT, PLAY, YAW_PLAY, WIND_UP, SPEED_LAG, SCALE_CURVATURE, AIR_SCALE, DEAD_PATH = (
    Law("hysteresis", "Different readings from either side", say("Hysteresis of {axis}"), "e_a = ½·gap·approach_a", "drive",
        say("backlash or friction in this drive: the reading depends on the side it is reached from"),
        (Parameter("gap_um", unit("µm"), 30.0),),
        lambda p, a, b, s: along(a, 0.5 * MICROMETRE * p.column(f"approach_{a}")), _APPROACH,
        means=say("at the same reading {axis} stands {size} further towards {side} when it comes from minus than when it "
                  "comes from plus"),
        along_motion=True, idealised_over="{a}", imitated_by=(Nonparametric("approach_{a}"),)),
    Law("drift", "Drift of an axis with time", say("Drift of {axis} with time"), "e_a = v · time", "temperature",
        say("the axis drifts with time: warm-up, or the room's temperature"), (Parameter("um_per_h", unit("µm/h"), 10.0),),
        lambda p, a, b, s: along(a, MICROMETRE * p.hours), ("time_s",), along_motion=True, idealised_over="time_s",
        means=say("at the same reading {axis} moves towards {side} by {size}")),
    # worn or badly set bearings of the guideway; along its own direction the same is hysteresis
    Law("play", "Lateral play: carriage a steps sideways along b when it turns round",
        say("Lateral play of {axis} along {direction}"), "e_b = ½·gap·approach_a", "guideway",
        say("play across the guideway of {axis}: check wear, preload and air gap of the bearings that hold the carriage "
            "along {direction}"), (Parameter("gap_um", unit("µm"), 10.0),),
        lambda p, a, b, s: along(b, 0.5 * MICROMETRE * p.column(f"approach_{a}")), _APPROACH, FURTHER,
        means=say("at the same reading the probe stands {size} further towards {side} {direction} when {axis} comes from "
                  "minus than when it comes from plus")),
    # a bridge that is driven at one leg, or a drive that is not in line with friction and mass
    Law("yaw_play", "Carriage a yaws when it turns round, and moves the ram by what it carries",
        say("Yaw of carriage {axis} at reversal"), "e = ε × what carriage a carries, ε_z = ½·angle·approach_a", "guideway",
        say("carriage {axis} yaws when it turns round: check the side bearings of its guideway, and where its drive takes "
            "hold beside its middle"), (Parameter("angle_arcsec", unit("″"), 2.0),),
        lambda p, a, b, s: turned(p, a, "z", 0.5 * ARCSECOND * p.column(f"approach_{a}")), _APPROACH, FURTHER),
    # a leadscrew or belt that winds up between motor and carriage, or is worn at one end ("unequal backlash")
    Law("windup", "Hysteresis that grows along the travel", say("Wind-up of the drive of {axis}"),
        "e_a = ½·w·approach_a·(a − middle of the travel)", "drive",
        say("the drive of {axis} winds up, or is worn more at one end of the travel: check leadscrew, belt or rack, its "
            "tension and its end bearings"), (Parameter("um_per_m", unit("µm/m"), 20.0),), _winding, _APPROACH, FURTHER,
        along_motion=True),
    # a positive lag: the scale was read before the probe was where it triggered; speed along a is the recorded speed times
    # the direction of travel
    Law("speed_lag", "Scale and trigger read at different moments", say("Lag of {axis} in proportion to speed"),
        "e_a = lag·speed along a, in the sense of travel", "controller",
        say("the scale of {axis} and the trigger are read at different moments: check how the controller latches this scale, "
            "and probe more slowly until then"), (Parameter("lag_ms", unit("ms"), 1.0),),
        lambda p, a, b, s: along(a, _MILLISECOND * p.column("speed_mm_s") * travel(p)[:, AXES.index(a)]),
        ("speed_mm_s", *(f"approach_{a}" for a in AXES)), FURTHER, along_motion=True),
    # a scale clamped at both ends, a tape that is stretched unevenly, a rack of two pieces
    Law("scale_curvature", "Position error of second order, over the travel T from a0",
        say("Curvature of the scale of {axis}"), "e_a = bow·(1 − (2(a − a0)/T − 1)²)", "scale",
        say("the scale of {axis} is stretched unevenly: check how its ends are clamped and its joints, and compensate "
            "position by a table, which one factor cannot replace"), (Parameter("bow_um", unit("µm"), 10.0),),
        lambda p, a, b, s: along(a, MICROMETRE * bow(p, a)), tier=FURTHER, along_motion=True,
        means=say("in the middle of its travel {axis} stands {size} further towards {side} than it reads")),
    # part 1 is no correction at all; about −1 ppm/K, +0.27 ppm/hPa, −0.01 ppm/% in n (Harris 2004 section 3.3)
    Law("air_scale", "A laser scale whose wavelength is not corrected for air; n₀ at 20 °C, 1013.25 hPa, 50 %",
        say("Refractive index of air on the laser scale of {axis}"), "e_a = −part·(n − n₀)·a", "scale",
        say("the laser of {axis} is not, or wrongly, corrected for air: check its sensors of air temperature, pressure and "
            "humidity, and that the compensation uses them"), (Parameter("part", unit("1"), 1.0),),
        lambda p, a, b, s: along(a, -index_change(p) * p.readings[a]), AIR, FURTHER, along_motion=True),
    # the air between interferometer and zero changes its optical length while nothing moves
    Law("dead_path", "Dead path of a laser scale: the path d that the zero of the scale leaves out",
        say("Dead path of the laser scale of {axis}"), "e_a = −d·(n − n at the first point)", "scale",
        say("the dead path of the laser of {axis} is not compensated: enter it in the compensation, or zero the axis close "
            "to the interferometer"), (Parameter("path_mm", unit("mm"), 300.0),),
        lambda p, a, b, s: along(a, (change := index_change(p))[0] - change), AIR, FURTHER, along_motion=True),
)  # fmt: skip
CURVATURE = SCALE_CURVATURE.each(AXES)
EFFECTS: tuple[Effect, ...] = (
    *(PeriodicScale(a) for a in AXES), *HYSTERESIS.each(AXES), *DRIFT.each(AXES),
    *PLAY.each(f"{a} {b}" for a in AXES for b in AXES if a != b), *YAW_PLAY.each("xy"), *WIND_UP.each(AXES),
    *SPEED_LAG.each(AXES), *CURVATURE, *AIR_SCALE.each(AXES), *DEAD_PATH.each(AXES),
)  # fmt: skip
