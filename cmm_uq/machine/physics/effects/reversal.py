"""What changes when an axis turns round: lateral play, yaw, wind-up of its drive, and what speed adds to it.

They share a sign: half of it each way. Hysteresis of the axis itself is in :mod:`cmm_uq.machine.physics.effects.drives`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from cmm_uq.base.messages import Text, Verbatim, say
from cmm_uq.base.points import AXES, Floats, Points
from cmm_uq.base.units import ARCSECOND, METRE, MICROMETRE, unit
from cmm_uq.machine.physics.effect import FURTHER, Amount, Effect, Parameter, along
from cmm_uq.machine.physics.effects.rigid_body import turned

_MILLISECOND = 1e-3  # 1 ms in s


class Play(Effect):
    """Lateral play: carriage a steps sideways along b when it turns round.

    Worn or badly set bearings of the guideway. Along its own direction the same is hysteresis.
    """

    formula = "e_b = ½·gap·approach_a"
    mechanism = "guideway"
    coefficients = (Parameter("gap_um", unit("µm"), 10.0),)
    tier = FURTHER

    def __init__(self, axis: str, direction: str) -> None:
        self.axis, self.direction = axis, direction
        self.name = f"play_{axis}_{direction}"
        self.title = say(
            "Lateral play of {axis} along {direction}",
            axis=Verbatim(axis.upper()),
            direction=Verbatim(direction.upper()),
        )
        self.points_to = say(
            "play across the guideway of {axis}: check wear, preload and air gap of the bearings that "
            "hold the carriage along {direction}",
            axis=Verbatim(axis.upper()),
            direction=Verbatim(direction.upper()),
        )
        self.columns = (f"approach_{axis}",)

    def meaning(self, amounts: Mapping[str, Amount]) -> Text:
        amount = amounts[self.coefficients[0].name]
        return say(
            "at the same reading the probe stands {size} further towards {side} {direction} when {axis} comes "
            "from minus than when it comes from plus",
            axis=Verbatim(self.axis.upper()), direction=Verbatim(self.direction.upper()), size=amount.size, side=amount.side,
        )  # fmt: skip

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        return along(self.direction, 0.5 * MICROMETRE * points.column(f"approach_{self.axis}"))


class YawPlay(Effect):
    """Carriage a yaws when it turns round, and moves the ram by what it carries.

    A bridge that is driven at one leg, or a drive that is not in line with friction and mass.
    """

    formula = "e = ε × what carriage a carries, ε_z = ½·angle·approach_a"
    mechanism = "guideway"
    coefficients = (Parameter("angle_arcsec", unit("″"), 2.0),)
    tier = FURTHER

    def __init__(self, axis: str) -> None:
        self.axis = axis
        self.name = f"yaw_play_{axis}"
        self.title = say("Yaw of carriage {axis} at reversal", axis=Verbatim(axis.upper()))
        self.points_to = say(
            "carriage {axis} yaws when it turns round: check the side bearings of its guideway, and "
            "where its drive takes hold beside its middle",
            axis=Verbatim(axis.upper()),
        )
        self.columns = (f"approach_{axis}",)

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        return turned(points, self.axis, "z", 0.5 * ARCSECOND * points.column(f"approach_{self.axis}"))


class WindUp(Effect):
    """Hysteresis that grows along the travel.

    A leadscrew or belt that winds up between motor and carriage, or is worn at one end ("unequal backlash").
    """

    formula = "e_a = ½·w·approach_a·(a − middle of the travel)"
    mechanism = "drive"
    coefficients = (Parameter("um_per_m", unit("µm/m"), 20.0),)
    tier = FURTHER

    def __init__(self, axis: str) -> None:
        self.axis = self.along_motion = axis
        self.name = f"windup_{axis}"
        self.title = say("Wind-up of the drive of {axis}", axis=Verbatim(axis.upper()))
        self.points_to = say(
            "the drive of {axis} winds up, or is worn more at one end of the travel: check leadscrew, "
            "belt or rack, its tension and its end bearings",
            axis=Verbatim(axis.upper()),
        )
        self.columns = (f"approach_{axis}",)

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        low, high = points.machine.travel(self.axis)
        place = (points.readings[self.axis] - 0.5 * (low + high)) / METRE
        return along(self.axis, 0.5 * MICROMETRE * points.column(f"approach_{self.axis}") * place)


class SpeedLag(Effect):
    """Scale and trigger read at different moments.

    A positive lag: the scale was read before the probe was where it triggered. Speed along a is the recorded speed times
    the direction of travel.
    """

    formula = "e_a = lag·speed along a, in the sense of travel"
    mechanism = "controller"
    coefficients = (Parameter("lag_ms", unit("ms"), 1.0),)
    tier = FURTHER

    def __init__(self, axis: str) -> None:
        self.axis = self.along_motion = axis
        self.name = f"speed_lag_{axis}"
        self.title = say("Lag of {axis} in proportion to speed", axis=Verbatim(axis.upper()))
        self.points_to = say(
            "the scale of {axis} and the trigger are read at different moments: check how the controller "
            "latches this scale, and probe more slowly until then",
            axis=Verbatim(axis.upper()),
        )
        self.columns = ("speed_mm_s", *(f"approach_{a}" for a in AXES))

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        part = travel(points)[:, AXES.index(self.axis)]
        return along(self.axis, _MILLISECOND * points.column("speed_mm_s") * part)


def travel(points: Points) -> Floats:
    """Unit vectors (n, 3) of travel into each point; zero where none was recorded."""
    signs = np.column_stack([points.column(f"approach_{a}") for a in AXES])
    length = np.linalg.norm(signs, axis=1, keepdims=True)
    return np.asarray(signs / np.where(length > 0, length, 1.0), dtype=np.float64)


EFFECTS: tuple[Effect, ...] = (
    *(Play(a, b) for a in AXES for b in AXES if a != b),
    *(YawPlay(a) for a in "xy"),
    *(WindUp(a) for a in AXES),
    *(SpeedLag(a) for a in AXES),
)
