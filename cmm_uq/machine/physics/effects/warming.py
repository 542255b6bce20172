"""Machines and artefacts that warm up: drift that settles, scales that grow with time, squareness that depends on temperature.

A temperature sensor that reads wrong by a constant makes a constant scale error of α·ΔT and cannot be told from one; so it is
no effect of its own.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from cmm_uq.base.messages import Text, Verbatim, say
from cmm_uq.base.points import AXES, Floats, Points
from cmm_uq.base.units import ARCSECOND, METRE, MICROMETRE, PPM, REFERENCE_TEMPERATURE, unit
from cmm_uq.machine.physics.effect import FURTHER, Amount, Effect, Parameter, Shape, along
from cmm_uq.machine.physics.effects.rigid_body import Lean, turned
from cmm_uq.machine.physics.effects.thermal import EXPANSION

# time constant of warming: an electric cabinet takes minutes, a granite table a day
SETTLING = Shape("settling_h", unit("h"), 0.2, 20.0, what=say("time to settle"))
# time constant of an artefact behind its thermometer: a thin bar minutes, a solid one an hour or more
LAG = Shape("lag_h", unit("h"), 0.05, 5.0, what=say("lag"))


class ScaleDrift(Effect):
    """A scale that grows with time. A room or a machine that warms steadily."""

    formula = "e_a = r·time·a"
    mechanism = "temperature"

    coefficients = (Parameter("ppm_per_h", unit("ppm/h"), 5.0),)
    columns = ("time_s",)
    tier = FURTHER

    def __init__(self, axis: str) -> None:
        self.axis = self.along_motion = axis
        self.name = f"scale_drift_{axis}"
        self.title = say("Scale of {axis} growing with time", axis=Verbatim(axis.upper()))
        self.points_to = say(
            "the scale of {axis} changes steadily while the machine or the room warms or cools: measure "
            "in thermal equilibrium, and check the temperature compensation of this scale",
            axis=Verbatim(axis.upper()),
        )

    def meaning(self, amounts: Mapping[str, Amount]) -> Text:
        amount = amounts[self.coefficients[0].name]
        return say(
            "lengths along {axis} are indicated ever {wrong}, by {size}",
            axis=Verbatim(self.axis.upper()), size=amount.size, wrong=amount.more(say("shorter"), say("longer")),
        )  # fmt: skip

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        return along(self.axis, PPM * points.hours * points.readings[self.axis])


class Settling(Effect):
    """Drift that settles. What follows switching on, or a door left open."""

    formula = "e_a = A·(1 − exp(−time/τ))"
    mechanism = "temperature"

    coefficients = (Parameter("um", unit("µm"), 20.0, say("way")),)
    shape = (SETTLING,)
    columns = ("time_s",)
    tier = FURTHER

    def __init__(self, axis: str) -> None:
        self.axis = self.along_motion = axis
        self.name = f"settling_{axis}"
        self.title = say("Settling of {axis}", axis=Verbatim(axis.upper()))
        self.points_to = say(
            "the zero of {axis} moves and comes to rest: let machine, probe and artefact settle longer "
            "after switching on, setting up or an open door",
            axis=Verbatim(axis.upper()),
        )

    def meaning(self, amounts: Mapping[str, Amount]) -> Text:
        amount = amounts[self.coefficients[0].name]
        return say(
            "at the same reading {axis} moves towards {side} by {size} in all, and settles with {settling}",
            axis=Verbatim(self.axis.upper()), size=amount.size, side=amount.side, settling=amounts[SETTLING.name].size,
        )  # fmt: skip

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        return along(self.axis, MICROMETRE * _settled(points, shape))


class ScaleSettling(Effect):
    """A scale that settles. An axis warmed by its motor, an air supply that was switched on."""

    formula = "e_a = s·(1 − exp(−time/τ))·a"
    mechanism = "temperature"

    coefficients = (Parameter("ppm", unit("ppm"), 20.0, say("change")),)
    shape = (SETTLING,)
    columns = ("time_s",)
    tier = FURTHER

    def __init__(self, axis: str) -> None:
        self.axis = self.along_motion = axis
        self.name = f"scale_settling_{axis}"
        self.title = say("Scale of {axis} settling", axis=Verbatim(axis.upper()))
        self.points_to = say(
            "the scale of {axis} takes on another temperature and comes to rest: move the axis to warm "
            "it up before measuring, and look at what heats or cools it, its motor or the air supply",
            axis=Verbatim(axis.upper()),
        )

    def meaning(self, amounts: Mapping[str, Amount]) -> Text:
        amount = amounts[self.coefficients[0].name]
        return say(
            "lengths along {axis} come to be indicated {size} too {wrong}, settling with {settling}",
            axis=Verbatim(self.axis.upper()), size=amount.size, wrong=amount.more(say("short"), say("long")),
            settling=amounts[SETTLING.name].size,
        )  # fmt: skip

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        return along(self.axis, PPM * _settled(points, shape) * points.readings[self.axis])


class ThermalSquareness(Lean):
    """Squareness that changes with temperature.

    A frame of two materials. Harris 2004 table 7 looked for it, and found XY free of it and YZ, ZX by up to 4″/K.
    """

    formula = "as of squareness, with S = k·(mean of temp_x, temp_y, temp_z − 20 °C)"
    mechanism = "temperature"
    coefficients = (Parameter("arcsec_per_k", unit("″/K"), 4.0),)
    columns = tuple(f"temp_{a}_c" for a in AXES)
    tier = FURTHER

    def __init__(self, plane: str) -> None:
        super().__init__(plane)
        self.name = f"thermal_squareness_{plane}"
        self.title = say(
            "Squareness {one}–{other} with temperature",
            one=Verbatim(plane[0].upper()),
            other=Verbatim(plane[1].upper()),
        )
        self.points_to = say(
            "the angle between {one} and {other} follows the temperature of the frame: keep the "
            "machine at the temperature of its calibration, or compensate squareness by temperature",
            one=Verbatim(plane[0].upper()),
            other=Verbatim(plane[1].upper()),
        )

    def lean(self, points: Points) -> Floats:
        excess = np.mean([points.column(name) for name in self.columns], axis=0) - REFERENCE_TEMPERATURE
        return np.asarray(ARCSECOND * excess)


class CarriageGradient(Effect):
    """A carriage bent by a gradient across it: bridge: y turns about x; ram: z turns about y.

    As the table under ``thermal_gradient``: the bridge between its upper and lower side, the ram between front and back.
    """

    formula = "e = ε × what carriage a carries, ε_b = k·(difference)·(a − a0)"
    mechanism = "temperature"
    coefficients = (Parameter("arcsec_per_m_k", unit("″/(m·K)"), 20.0),)
    tier = FURTHER

    def __init__(
        self, what: str, words: Text, axis: str, about: str, columns: tuple[str, str], points_to: Text
    ) -> None:
        self.axis, self.about = axis, about
        self.name = f"thermal_gradient_{what}"
        self.title = say("Bending by the temperature gradient in the {what}", what=words)
        self.points_to = points_to
        self.columns = columns

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        low, _ = points.machine.travel(self.axis)
        gradient = points.column(self.columns[0]) - points.column(self.columns[1])
        angle = ARCSECOND * gradient * (points.readings[self.axis] - low) / METRE
        return turned(points, self.axis, self.about, angle)


class ArtefactLag(Effect):
    """Artefact behind its thermometer.

    It stands beside the artefact's expansion (stated, or ``thermal_artefact``), which follows the thermometer. T′ begins at
    the first recorded temperature, and temperatures between two records lie on a line.
    """

    name = "artefact_lag"
    title = say("Artefact lagging behind its thermometer")
    formula = "longer by α·(T′ − temp_artefact)·length, τ·dT′/dt = temp_artefact − T′"
    mechanism = "artefact"
    points_to = say(
        "the artefact takes on the temperature later than its thermometer: let it soak longer, and "
        "fix the thermometer to its body"
    )
    coefficients = (EXPANSION,)
    shape = (LAG,)
    columns = ("temp_artefact_c", "time_s")
    tier = FURTHER

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        (lag,) = shape
        temperature = points.column("temp_artefact_c")
        behind = lagging(points.hours, temperature, lag) - temperature
        return (-behind[:, None] * (points.xyz - points.group_means(points.xyz)))[:, :, None]


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


def _settled(points: Points, shape: Sequence[float]) -> Floats:
    (settling,) = shape
    return np.asarray(-np.expm1(-points.hours / settling), dtype=np.float64)


EFFECTS: tuple[Effect, ...] = (
    *(ScaleDrift(a) for a in AXES),
    *(Settling(a) for a in AXES),
    *(ScaleSettling(a) for a in AXES),
    ThermalSquareness("xy"),
    ThermalSquareness("yz"),
    ThermalSquareness("zx"),
    CarriageGradient(
        "bridge",
        say("bridge"),
        "y",
        "x",
        ("temp_bridge_top_c", "temp_bridge_bottom_c"),
        say(
            "the bridge bends: its upper and lower side differ in temperature, look for warm air, lamps or a draught above it"
        ),
    ),
    CarriageGradient(
        "ram",
        say("ram"),
        "z",
        "y",
        ("temp_ram_front_c", "temp_ram_back_c"),
        say(
            "the ram bends: its front and back differ in temperature, look for a motor, a lamp, sun or a draught at one side"
        ),
    ),
    ArtefactLag(),
)
