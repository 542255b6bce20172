"""From error factors to what a technician turns: US 4,437,151, claim 1 e.

X stays where it is; Y is turned square to it, then Z square to both. The signs follow from *true = indicated + e*: with
e_x = −S·y the Y axis leans towards −X by S, and turning its guide by −S about Z sets it upright.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType


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
            Adjustment("scale_x", "Scale of X: lengthen what it reads by", 1.0, "x"),
            Adjustment("scale_y", "Scale of Y: lengthen what it reads by", 1.0, "y"),
            Adjustment("scale_z", "Scale of Z: lengthen what it reads by", 1.0, "z"),
            Adjustment("squareness_xy", "Guide of Y: turn about +Z by", -1.0, "y"),
            Adjustment("squareness_yz", "Guide of Z: turn about +X by", -1.0, "z"),
            Adjustment("squareness_zx", "Guide of Z: turn about +Y by", 1.0, "z"),
        )
    }
)
"""What takes away each of the six factors; right-handed turns."""

ANGLES: Mapping[str, str] = MappingProxyType({"squareness_xy": "X–Y", "squareness_yz": "Y–Z", "squareness_zx": "Z–X"})
"""Angle between two axes that is 90° plus the squareness error."""
