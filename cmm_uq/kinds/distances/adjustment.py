"""From error factors to what a technician turns: US 4,437,151, claim 1 e.

X stays where it is; Y is turned square to it, then Z square to both. The signs follow from *true = indicated + e*: with
e_x = −S·y the Y axis leans towards −X by S, and turning its guide by −S about Z sets it upright.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np

from cmm_uq.documents.result import Result
from cmm_uq.documents.results_file import quantity_data
from cmm_uq.messages import Text, say
from cmm_uq.physics.rigid_body import SCALE, SQUARENESS
from cmm_uq.uncertainty.quantity import Quantity
from cmm_uq.units import ARCSECOND, MICROMETRE, PPM, unit


@dataclass(frozen=True)
class Adjustment:
    """One screw to turn.

    Parameters
    ----------
    effect : error factor that it takes away.
    what : what is turned or entered, and the sense of a positive figure.
    sign : figure to set = sign × error factor.
    axis : whose guide or scale it is.
    """

    effect: str
    what: Text
    sign: float
    axis: str


ADJUSTMENTS: Mapping[str, Adjustment] = MappingProxyType(
    {
        adjustment.effect: adjustment
        for adjustment in (
            Adjustment(SCALE["x"].name, say("Scale of X: lengthen what it reads by"), 1.0, "x"),
            Adjustment(SCALE["y"].name, say("Scale of Y: lengthen what it reads by"), 1.0, "y"),
            Adjustment(SCALE["z"].name, say("Scale of Z: lengthen what it reads by"), 1.0, "z"),
            Adjustment(SQUARENESS["xy"].name, say("Guide of Y: turn about +Z by"), -1.0, "y"),
            Adjustment(SQUARENESS["yz"].name, say("Guide of Z: turn about +X by"), -1.0, "z"),
            Adjustment(SQUARENESS["zx"].name, say("Guide of Z: turn about +Y by"), 1.0, "z"),
        )
    }
)
"""What takes away each of the six factors; right-handed turns."""

ANGLES: Mapping[str, str] = MappingProxyType(
    {effect.name: "–".join(plane.upper()) for plane, effect in SQUARENESS.items()}
)
"""Angle between two axes that is 90° plus the squareness error."""


@dataclass(frozen=True)
class Setting:
    """What to turn or enter on a machine.

    Parameters
    ----------
    adjustment : which screw.
    parameter : of its effect that it takes away, a key with its unit.
    figure : to set, ppm or ″.
    over_travel : what it moves at the far end of its axis, µm; ``None`` where the travel is not stated.
    """

    adjustment: Adjustment
    parameter: str
    figure: Quantity
    over_travel: Quantity | None

    @property
    def beyond_doubt(self) -> bool:
        """Whether the 95 % interval does not contain zero."""
        low, high = self.figure.interval95
        return not low <= 0 <= high

    def as_data(self) -> dict[str, Any]:
        """For results.json."""
        return {
            "effect": self.adjustment.effect, "what": self.adjustment.what, self.parameter: quantity_data(self.figure),
            "over_travel_um": None if self.over_travel is None else quantity_data(self.over_travel),
            "beyond_doubt": self.beyond_doubt,
        }  # fmt: skip


def settings(result: Result) -> tuple[Setting, ...]:
    """What takes away each of the six factors that the recording determines."""
    found = []
    for effect, adjustment in ADJUSTMENTS.items():
        if effect not in result.parameters or effect in result.free:
            continue
        name, quantity = next(iter(result.parameters[effect].items()))
        figure = quantity.times(adjustment.sign, quantity.unit)
        low, high = result.artefact.points.machine.travel_mm["xyz".index(adjustment.axis)]
        per_unit = (PPM if quantity.unit == "ppm" else ARCSECOND) * float(high - low) / MICROMETRE
        found.append(
            Setting(adjustment, name, figure, figure.times(per_unit, unit("µm")) if np.isfinite(per_unit) else None)
        )
    return tuple(found)
