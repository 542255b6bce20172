"""From error factors to what a technician turns: US 4,437,151, claim 1 e.

X stays where it is; Y is turned square to it, then Z square to both. The signs follow from *true = indicated + e*: with
e_x = −S·y the Y axis leans towards −X by S, and turning its guide by −S about Z sets it upright.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from cmm_uq.physics.rigid_body import SCALE, SQUARENESS


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
    what: str
    sign: float
    axis: str


ADJUSTMENTS: Mapping[str, Adjustment] = MappingProxyType(
    {
        adjustment.effect: adjustment
        for adjustment in (
            Adjustment(SCALE["x"].name, "Scale of X: lengthen what it reads by", 1.0, "x"),
            Adjustment(SCALE["y"].name, "Scale of Y: lengthen what it reads by", 1.0, "y"),
            Adjustment(SCALE["z"].name, "Scale of Z: lengthen what it reads by", 1.0, "z"),
            Adjustment(SQUARENESS["xy"].name, "Guide of Y: turn about +Z by", -1.0, "y"),
            Adjustment(SQUARENESS["yz"].name, "Guide of Z: turn about +X by", -1.0, "z"),
            Adjustment(SQUARENESS["zx"].name, "Guide of Z: turn about +Y by", 1.0, "z"),
        )
    }
)
"""What takes away each of the six factors; right-handed turns."""

ANGLES: Mapping[str, str] = MappingProxyType(
    {effect.name: "–".join(plane.upper()) for plane, effect in SQUARENESS.items()}
)
"""Angle between two axes that is 90° plus the squareness error."""
