"""Errors of drives and scales: periodic error, backlash and friction, drift with time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cmm_uq.physics.effect import Effect, Harmonic, Parameter, Shape, along
from cmm_uq.points import AXES, Floats, Points
from cmm_uq.units import HOUR, MICROMETRE


class PeriodicScale(Harmonic):
    """Periodic error of a scale, leadscrew or rack: e_a = A·sin(2π a/λ + φ)."""

    amplitude = Parameter("amplitude_um", "µm", 10.0)
    coefficients = (Parameter("cosine_um", "µm", 10.0), Parameter("sine_um", "µm", 10.0))
    shape = (Shape("period_mm", "mm", 0.5, 1000.0),)

    def __init__(self, axis: str) -> None:
        self.axis = axis
        self.name = f"periodic_scale_{axis}"
        self.title = f"Periodic scale error of {axis.upper()}"

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        """See :meth:`Effect.basis`; the coefficients are A·cos φ and A·sin φ."""
        (period,) = shape
        angle = 2 * np.pi * points.readings[:, AXES.index(self.axis)] / period
        return np.concatenate(
            [along(self.axis, MICROMETRE * np.sin(angle)), along(self.axis, MICROMETRE * np.cos(angle))], axis=2
        )


class Hysteresis(Effect):
    """Different readings from either side: e_a = ½·gap·approach_a."""

    coefficients = (Parameter("gap_um", "µm", 30.0),)

    def __init__(self, axis: str) -> None:
        self.axis = axis
        self.name = f"hysteresis_{axis}"
        self.title = f"Hysteresis of {axis.upper()}"
        self.columns = (f"approach_{axis}",)

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        """See :meth:`Effect.basis`."""
        return along(self.axis, 0.5 * MICROMETRE * points.column(f"approach_{self.axis}"))


class Drift(Effect):
    """Drift of an axis with time: e_a = v · time."""

    coefficients = (Parameter("um_per_h", "µm/h", 10.0),)
    columns = ("time_s",)

    def __init__(self, axis: str) -> None:
        self.axis = axis
        self.name = f"drift_{axis}"
        self.title = f"Drift of {axis.upper()} with time"

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        """See :meth:`Effect.basis`."""
        return along(self.axis, MICROMETRE * points.column("time_s") / HOUR)


EFFECTS: tuple[Effect, ...] = (
    *(PeriodicScale(a) for a in AXES),
    *(Hysteresis(a) for a in AXES),
    *(Drift(a) for a in AXES),
)
