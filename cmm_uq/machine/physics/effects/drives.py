"""Errors of drives and scales: periodic error, backlash and friction, drift with time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from cmm_uq.base.messages import Text, Verbatim, say
from cmm_uq.base.points import AXES, Floats, Points
from cmm_uq.base.units import MICROMETRE, unit
from cmm_uq.machine.physics.effect import Amount, Effect, Harmonic, Nonparametric, Parameter, Shape, along


class PeriodicScale(Harmonic):
    """Periodic error of a scale, leadscrew or rack."""

    formula = "e_a = A·sin(2π a/λ + φ)"
    mechanism = "scale"
    points_to = say("an error that repeats with the period: scale interpolation, leadscrew or rack")

    amplitude = Parameter("amplitude_um", unit("µm"), 10.0, say("amplitude"))
    coefficients = (Parameter("cosine_um", unit("µm"), 10.0), Parameter("sine_um", unit("µm"), 10.0))

    def __init__(self, axis: str) -> None:
        self.axis = self.along_motion = axis
        self.name = f"periodic_scale_{axis}"
        self.title = say("Periodic scale error of {axis}", axis=Verbatim(axis.upper()))
        self.shape = (Shape("period_mm", unit("mm"), 0.5, 1000.0, period_along=axis, what=say("period")),)
        self.imitated_by = (Nonparametric(f"{axis}_mm", axis),)

    def meaning(self, amounts: Mapping[str, Amount]) -> Text:
        amplitude = amounts[self.amplitude.name].size
        if self.shape[0].name not in amounts:
            return say(
                "the error of {axis} swings to either side by {amplitude} and repeats with one of several periods",
                axis=Verbatim(self.axis.upper()), amplitude=amplitude,
            )  # fmt: skip
        period = amounts[self.shape[0].name].size
        return say(
            "the error of {axis} swings to either side by {amplitude} and repeats every {period}",
            axis=Verbatim(self.axis.upper()), amplitude=amplitude, period=period,
        )  # fmt: skip

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        (period,) = shape
        angle = 2 * np.pi * points.readings[self.axis] / period
        return np.concatenate(
            [along(self.axis, MICROMETRE * np.sin(angle)), along(self.axis, MICROMETRE * np.cos(angle))], axis=2
        )


class Hysteresis(Effect):
    """Different readings from either side."""

    formula = "e_a = ½·gap·approach_a"
    mechanism = "drive"
    points_to = say("backlash or friction in this drive: the reading depends on the side it is reached from")

    coefficients = (Parameter("gap_um", unit("µm"), 30.0),)

    def __init__(self, axis: str) -> None:
        self.axis = self.along_motion = axis
        self.name = f"hysteresis_{axis}"
        self.title = say("Hysteresis of {axis}", axis=Verbatim(axis.upper()))
        self.columns = (f"approach_{axis}",)
        self.idealised_over = axis
        self.imitated_by = (Nonparametric(f"approach_{axis}"),)

    def meaning(self, amounts: Mapping[str, Amount]) -> Text:
        amount = amounts[self.coefficients[0].name]
        return say(
            "at the same reading {axis} stands {size} further towards {side} when it comes from minus than when "
            "it comes from plus",
            axis=Verbatim(self.axis.upper()), size=amount.size, side=amount.side,
        )  # fmt: skip

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        return along(self.axis, 0.5 * MICROMETRE * points.column(f"approach_{self.axis}"))


class Drift(Effect):
    """Drift of an axis with time."""

    formula = "e_a = v · time"
    mechanism = "temperature"
    points_to = say("the axis drifts with time: warm-up, or the room's temperature")

    coefficients = (Parameter("um_per_h", unit("µm/h"), 10.0),)
    columns = ("time_s",)
    idealised_over = "time_s"

    def __init__(self, axis: str) -> None:
        self.axis = self.along_motion = axis
        self.name = f"drift_{axis}"
        self.title = say("Drift of {axis} with time", axis=Verbatim(axis.upper()))

    def meaning(self, amounts: Mapping[str, Amount]) -> Text:
        amount = amounts[self.coefficients[0].name]
        return say(
            "at the same reading {axis} moves towards {side} by {size}",
            axis=Verbatim(self.axis.upper()), size=amount.size, side=amount.side,
        )  # fmt: skip

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        return along(self.axis, MICROMETRE * points.hours)


EFFECTS: tuple[Effect, ...] = (
    *(PeriodicScale(a) for a in AXES),
    *(Hysteresis(a) for a in AXES),
    *(Drift(a) for a in AXES),
)
