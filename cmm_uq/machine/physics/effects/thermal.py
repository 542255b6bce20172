"""Temperature: expansion of scales and artefact, bending by gradients, drift that settles, and what lags behind.

The coefficients are what the compensation left out: a machine whose software corrects its scales has the coefficient of
thermal expansion zero here. A temperature sensor that reads wrong by a constant makes a constant scale error of α·ΔT and
cannot be told from one; so it is no effect of its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from types import MappingProxyType

import numpy as np

from cmm_uq.base.messages import Text
from cmm_uq.base.points import AXES, Floats, Points
from cmm_uq.base.units import ARCSECOND, METRE, MICROMETRE, PPM, REFERENCE_TEMPERATURE, unit
from cmm_uq.machine.physics.effect import (
    AXIS,
    CONTRACT,
    FURTHER,
    Effect,
    Harmonic,
    OfAxis,
    Parameter,
    Shape,
    along,
    say,
)
from cmm_uq.machine.physics.effects import Law
from cmm_uq.machine.physics.effects.rigid_body import LEANING, Lean, turned

# coefficient of thermal expansion; glass 8, steel 11.5, aluminium 23 ppm/K bound what is possible.
EXPANSION = Parameter("cte_per_k", unit("1/K"), 12e-6, say("expansion"))
# time constant of warming: an electric cabinet takes minutes, a granite table a day
SETTLING = Shape("settling_h", unit("h"), 0.2, 20.0, what=say("time to settle"))
# time constant of an artefact behind its thermometer: a thin bar minutes, a solid one an hour or more
LAG = Shape("lag_h", unit("h"), 0.05, 5.0, what=say("lag"))
_HALF_A_DAY = 12.0  # h


def lagging(hours: Floats, temperature: Floats, lag: float) -> Floats:
    """Temperature (n,) of a body that follows another with a time constant, exact for lines between the records, °C."""
    moments, index = np.unique(hours, return_inverse=True)
    index = index.ravel()
    driving = np.bincount(index, temperature) / np.bincount(index)
    body = np.empty_like(driving)
    body[0] = driving[0]
    for k, step in enumerate(np.diff(moments)):
        behind = lag * (driving[k + 1] - driving[k]) / step
        body[k + 1] = driving[k + 1] - behind + (body[k] - driving[k] + behind) * np.exp(-step / lag)
    return np.asarray(body[index], dtype=np.float64)


class Daily(OfAxis, Harmonic):
    """The zero of an axis that goes with the day: sun, heating at night, shifts (ISO/TR 16015, ISO 230-3).

    Of less than half a day no cycle is to be told from a drift.
    """

    family, title = "daily", say("Daily cycle of {axis}")
    formula, mechanism = "e_a = A·sin(2π·time/24 h + φ)", "temperature"
    points_to = say(
        "{axis} moves with the time of day: look for sun, a heating that is lowered at night, doors and shifts"
    )
    amplitude = Parameter("amplitude_um", unit("µm"), 10.0, say("amplitude"))
    coefficients = (Parameter("cosine_um", unit("µm"), 10.0), Parameter("sine_um", unit("µm"), 10.0))
    columns, tier = ("time_s",), FURTHER

    def shown_in(self, points: Points) -> bool:
        return "time_s" in points.columns and float(np.ptp(points.hours)) >= _HALF_A_DAY

    def component(self, points: Points, shape: Sequence[float]) -> Floats:
        angle = np.pi * points.hours / _HALF_A_DAY
        return MICROMETRE * np.column_stack([np.sin(angle), np.cos(angle)])


class DailyScale(Daily):
    """A scale that goes with the day."""

    family, title = "daily_scale", say("Daily cycle of the scale of {axis}")
    formula = "e_a = s·sin(2π·time/24 h + φ)·a"
    points_to = say(
        "lengths along {axis} go with the time of day: check the temperature compensation of this scale, and look for sun "
        "and a heating that is lowered at night"
    )
    amplitude = Parameter("amplitude_ppm", unit("ppm"), 10.0, say("amplitude"))
    coefficients = (Parameter("cosine_ppm", unit("ppm"), 10.0), Parameter("sine_ppm", unit("ppm"), 10.0))

    def component(self, points: Points, shape: Sequence[float]) -> Floats:
        return PPM / MICROMETRE * points.readings[self.axis][:, None] * super().component(points, shape)


class CarriageGradient(Effect):
    """A carriage bent by a gradient across it: bridge: y turns about x; ram: z turns about y.

    As the table under ``thermal_gradient``: the bridge between its upper and lower side, the ram between front and back.
    """

    formula, mechanism = "e = ε × what carriage a carries, ε_b = k·(difference)·(a − a0)", "temperature"
    coefficients = (Parameter("arcsec_per_m_k", unit("″/(m·K)"), 20.0),)
    tier = FURTHER

    def __init__(self, part: str, words: Text, axes: str, sides: tuple[str, str], points_to: Text) -> None:
        self.axis, self.about = axes[0], axes[1]
        self.name = f"thermal_gradient_{part}"
        self.title = say("Bending by the temperature gradient in the {what}", what=words)
        self.points_to = points_to
        self.columns = tuple(f"temp_{part}_{side}_c" for side in sides)

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        low, _ = points.machine.travel(self.axis)
        gradient = points.column(self.columns[0]) - points.column(self.columns[1])
        return turned(points, self.axis, self.about, ARCSECOND * gradient * (points.readings[self.axis] - low) / METRE)


class ThermalGradient(CarriageGradient):
    """Table bent by a gradient: carriage x turns about y."""

    formula = "e = ε × what carriage x carries, ε_y = k·(temp_table_top − temp_table_bottom)·(x − x0)"
    tier = CONTRACT

    def __init__(self) -> None:
        bent = say("the table bends: top and bottom differ in temperature")
        super().__init__("table", say("table"), "xy", ("top", "bottom"), bent)
        self.name = "thermal_gradient"


class ThermalSquareness(Lean):
    """Squareness that changes with temperature.

    A frame of two materials. Harris 2004 table 7 looked for it, and found XY free of it and YZ, ZX by up to 4″/K.
    """

    family, title = "thermal_squareness", say("Squareness {one}–{other} with temperature", one=AXIS)
    formula, mechanism = "as of squareness, with S = k·(mean of temp_x, temp_y, temp_z − 20 °C)", "temperature"
    points_to = say(
        "the angle between {one} and {other} follows the temperature of the frame: keep the machine at the temperature of its "
        "calibration, or compensate squareness by temperature",
        one=AXIS,
    )
    coefficients = (Parameter("arcsec_per_k", unit("″/K"), 4.0),)
    columns, tier = tuple(f"temp_{a}_c" for a in AXES), FURTHER

    def lean(self, points: Points) -> Floats:
        excess = np.mean([points.column(name) for name in self.columns], axis=0) - REFERENCE_TEMPERATURE
        return np.asarray(ARCSECOND * excess)


def _expanding(points: Points, axis: str, _: str, __: Sequence[float]) -> Floats:
    return along(axis, (points.column(f"temp_{axis}_c") - REFERENCE_TEMPERATURE) * points.readings[axis])


def _behind(points: Points, axis: str, _: str, shape: Sequence[float]) -> Floats:
    temperature = points.column(f"temp_{axis}_c")
    return along(axis, (lagging(points.hours, temperature, shape[0]) - temperature) * points.readings[axis])


def _drawn_together(points: Points, excess: Floats) -> Floats:
    """Of points about their middle, at a temperature (n,) above that to which lengths are brought, K."""
    return (-excess[:, None] * (points.xyz - points.group_means(points.xyz)))[:, :, None]


def _artefact_behind(points: Points, _: str, __: str, shape: Sequence[float]) -> Floats:
    temperature = points.column("temp_artefact_c")
    return _drawn_together(points, lagging(points.hours, temperature, shape[0]) - temperature)


THERMAL_SCALE, SCALE_DRIFT, SETTLING_OF_ZERO, SCALE_SETTLING, THERMAL_LAG, THERMAL_ARTEFACT, ARTEFACT_LAG = (
    Law("thermal_scale", "Expansion of a scale", say("Thermal expansion of scale {axis}"), "e_a = α·(temp_a − 20 °C)·a",
        "temperature", say("the scale expands and its temperature is not, or wrongly, compensated"), (EXPANSION,), _expanding,
        ("temp_{a}_c",), means=say("the scale of {axis} expands by {size} {more} than is compensated"),
        sense=(say("more"), say("less")), along_motion=True),
    Law("scale_drift", "A scale that grows with time. A room or a machine that warms steadily",
        say("Scale of {axis} growing with time"), "e_a = r·time·a", "temperature",
        say("the scale of {axis} changes steadily while the machine or the room warms or cools: measure in thermal "
            "equilibrium, and check the temperature compensation of this scale"),
        (Parameter("ppm_per_h", unit("ppm/h"), 5.0),), lambda p, a, b, s: along(a, PPM * p.hours * p.readings[a]),
        ("time_s",), FURTHER, means=say("lengths along {axis} are indicated ever {wrong}, by {size}"),
        sense=(say("shorter"), say("longer")), along_motion=True),
    Law("settling", "Drift that settles. What follows switching on, or a door left open", say("Settling of {axis}"),
        "e_a = A·(1 − exp(−time/τ))", "temperature",
        say("the zero of {axis} moves and comes to rest: let machine, probe and artefact settle longer after switching on, "
            "setting up or an open door"), (Parameter("um", unit("µm"), 20.0, say("way")),),
        lambda p, a, b, s: along(a, MICROMETRE * -np.expm1(-p.hours / s[0])), ("time_s",), FURTHER, shape=(SETTLING,),
        means=say("at the same reading {axis} moves towards {side} by {size} in all, and settles with {settling}"),
        along_motion=True),
    Law("scale_settling", "A scale that settles. An axis warmed by its motor, an air supply that was switched on",
        say("Scale of {axis} settling"), "e_a = s·(1 − exp(−time/τ))·a", "temperature",
        say("the scale of {axis} takes on another temperature and comes to rest: move the axis to warm it up before "
            "measuring, and look at what heats or cools it, its motor or the air supply"),
        (Parameter("ppm", unit("ppm"), 20.0, say("change")),),
        lambda p, a, b, s: along(a, PPM * -np.expm1(-p.hours / s[0]) * p.readings[a]), ("time_s",), FURTHER,
        shape=(SETTLING,), sense=(say("short"), say("long")), along_motion=True,
        means=say("lengths along {axis} come to be indicated {size} too {wrong}, settling with {settling}")),
    # it stands beside the scale's expansion, compensated or thermal_scale, which follows the thermometer (ISO/TR 16907)
    Law("thermal_lag", "A scale behind its thermometer", say("Scale of {axis} lagging behind its thermometer"),
        "e_a = α·(T′ − temp_a)·a, τ·dT′/dt = temp_a − T′", "temperature",
        say("the scale of {axis} takes on the temperature later than its thermometer: fix the thermometer to the body of "
            "the scale, and measure when the room has been steady for longer"), (EXPANSION,), _behind,
        ("temp_{a}_c", "time_s"), FURTHER, shape=(LAG,), along_motion=True),
    Law("thermal_artefact", "Expansion of the artefact", say("Thermal expansion of the artefact"),
        "length = length at 20 °C · (1 + α·(temp_artefact − 20 °C))", "artefact",
        say("the artefact expands and its temperature is not, or wrongly, compensated"), (EXPANSION,),
        lambda p, a, b, s: _drawn_together(p, p.column("temp_artefact_c") - REFERENCE_TEMPERATURE), ("temp_artefact_c",),
        means=say("the artefact expands by {size} {more} than is reckoned with"), sense=(say("more"), say("less"))),
    # it stands beside the artefact's expansion (stated, or thermal_artefact), which follows the thermometer; T′ begins at the
    # first recorded temperature, and temperatures between two records lie on a line
    Law("artefact_lag", "Artefact behind its thermometer", say("Artefact lagging behind its thermometer"),
        "longer by α·(T′ − temp_artefact)·length, τ·dT′/dt = temp_artefact − T′", "artefact",
        say("the artefact takes on the temperature later than its thermometer: let it soak longer, and fix the thermometer "
            "to its body"), (EXPANSION,), _artefact_behind, ("temp_artefact_c", "time_s"), FURTHER, shape=(LAG,)),
)  # fmt: skip
SCALE_EXPANSION = MappingProxyType({a: THERMAL_SCALE.of(a) for a in AXES})  # by axis
EFFECTS: tuple[Effect, ...] = (
    *SCALE_EXPANSION.values(), THERMAL_ARTEFACT.of(), ThermalGradient(), *SCALE_DRIFT.each(AXES),
    *SETTLING_OF_ZERO.each(AXES), *SCALE_SETTLING.each(AXES), *THERMAL_LAG.each(AXES),
    *(family(a) for family in (Daily, DailyScale) for a in AXES), *(ThermalSquareness(plane) for plane in LEANING),
    CarriageGradient("bridge", say("bridge"), "yx", ("top", "bottom"), say(
        "the bridge bends: its upper and lower side differ in temperature, look for warm air, lamps or a draught above it"
    )),
    CarriageGradient("ram", say("ram"), "zy", ("front", "back"), say(
        "the ram bends: its front and back differ in temperature, look for a motor, a lamp, sun or a draught at one side"
    )),
    ARTEFACT_LAG.of(),
)  # fmt: skip
