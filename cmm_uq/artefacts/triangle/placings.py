"""The placings of the triangle standard: where it stands, which way, and with which tip.

The source counts seven placings and describes eight. The horizontal one shifted along X gives the yaw of Y, which the
vertical ones on the left and on the right give as well and over a longer lever; it is the eighth.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from cmm_uq.artefacts.triangle.standard import corners
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, say
from cmm_uq.base.points import AXES, Floats, Machine, Points

PLANES: Mapping[str, tuple[int, int]] = MappingProxyType({"XY": (0, 1), "YZ": (1, 2), "ZX": (0, 2)})
"""Axis of the longest side, axis of the height over it."""


@dataclass(frozen=True)
class Placing:
    """One placing.

    Parameters
    ----------
    title : in words.
    plane : key of :data:`PLANES`.
    place : where along the room that the machine has for it, 0 … 1 for X, Y, Z.
    long_tip : whether the longer of two tips is mounted.
    """

    title: Text
    plane: str
    place: tuple[float, float, float]
    long_tip: bool = False


SEVEN_PLACINGS = (
    Placing(say("horizontal, low"), "XY", (0.0, 0.5, 0.0)),
    Placing(say("horizontal, high"), "XY", (0.0, 0.5, 1.0)),
    Placing(say("vertical in YZ, left"), "YZ", (0.0, 0.5, 0.0)),
    Placing(say("vertical in YZ, right"), "YZ", (1.0, 0.5, 0.0)),
    Placing(say("vertical in YZ, right, longer tip"), "YZ", (1.0, 0.5, 0.0), long_tip=True),
    Placing(say("vertical in ZX"), "ZX", (0.5, 0.5, 0.0)),
    Placing(say("vertical in ZX, longer tip"), "ZX", (0.5, 0.5, 0.0), long_tip=True),
)

SHIFTED = Placing(say("horizontal, low, shifted along X"), "XY", (1.0, 0.5, 0.0))
"""The eighth."""


def placed_triangle(
    machine: Machine, sides: Floats, placings: Sequence[Placing] = SEVEN_PLACINGS, *,
    tips_mm: tuple[float, float] = (80.0, 240.0), repeats: int = 1,
) -> Points:  # fmt: skip
    """Nominal readings of a triangle in these placings, one measurement each.

    Parameters
    ----------
    machine : with its travel, which the placings keep 5 % away from.
    sides : (3,) 1–2, 2–3, 3–1 of the triangle, mm; 1–2 is laid along an axis.
    placings : where it stands.
    tips_mm : lengths of the short and of the long tip: down in horizontal placings, along X in YZ, along Y in ZX. The
        readings are those of the machine's scales, so a longer tip wants the triangle moved, not the machine.
    repeats : of every point.

    Raises
    ------
    CmmUqError : the travel is not known, or the triangle is longer than it.
    """
    travel = np.array([machine.travel(axis) for axis in AXES])
    room = travel + 0.05 * np.ptp(travel, axis=1)[:, None] * [1, -1]
    body = corners(sides)
    xyz, tips = [], []
    for placing in placings:
        along, up = PLANES[placing.plane]
        size = np.zeros(3)
        size[[along, up]] = np.ptp(body[:, :2], axis=0)
        spare = room[:, 1] - room[:, 0] - size
        if np.any(spare < 0):
            axis = int(np.argmin(spare))
            raise CmmUqError(
                f"the triangle is {size[axis]:.4g} mm long along {AXES[axis].upper()}, of which the machine has "
                f"{np.ptp(room[axis]):.4g} mm to spare", where=placing.title, fix="Use a smaller triangle",
            )  # fmt: skip
        corner = np.tile(room[:, 0] + spare * placing.place, (3, 1))
        corner[:, [along, up]] += body[:, :2] - body[:, :2].min(axis=0)
        tip = np.zeros(3)
        tip[3 - along - up] = tips_mm[placing.long_tip] * (-1 if placing.plane == "XY" else 1)
        xyz.append(np.tile(corner, (repeats, 1)))
        tips.append(np.tile(tip, (3 * repeats, 1)))
    n = 3 * repeats * len(placings)
    readings, offsets = np.vstack(xyz), np.vstack(tips)
    return Points(
        machine.coordinates(readings), np.repeat(np.arange(1, len(placings) + 1), 3 * repeats),
        np.tile([1, 2, 3], n // 3), np.tile(np.repeat(np.arange(1, repeats + 1), 3), len(placings)), machine,
        {f"tip_{axis}_mm": offsets[:, i] for i, axis in enumerate(AXES)},
    )  # fmt: skip
