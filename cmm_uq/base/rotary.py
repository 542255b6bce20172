"""A machine of three carriages and a rotary table: coordinates lie on the table, errors in the axes of the machine."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from cmm_uq.base.points import AXES, Floats, Machine

ROTARY = dict(zip("abc", AXES, strict=True))  # by the letter of a rotary axis the axis that it is parallel to (ISO 841)


@dataclass(frozen=True, eq=False)
class Turntable(Machine):
    """Carriages x, y, z, and a table that turns what is measured by its angle about its axis.

    Coordinates are those of the machine with the table at 0°, turned with the table: what stands still on it keeps them.
    The carriages go where that is after the turn R about a point p of the axis, p + R·(xyz − p). Where a recording has no
    column of the angle, the table stood at 0°, or nothing stood on it.
    """

    letter: str = "c"  # of the rotary axis
    # (3,) a point on its axis, in the frame of the scales, mm; by default the origin of the coordinates
    axis_mm: Floats | None = None
    travel_deg: Floats = field(default_factory=lambda: np.full(2, np.nan))  # lowest and highest reading
    clockwise: bool = False  # how the table turns while its reading grows, seen against its axis's positive direction
    recorded_in_machine: bool = False  # whether recorded coordinates are those of the carriages, and not of the table
    axes: tuple[str, ...] = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "axes", (*AXES, self.letter))

    @property
    def column(self) -> str:
        """Recorded column of its reading."""
        return f"{self.letter}_deg"

    @property
    def about(self) -> int:
        """Index of the axis of the coordinates that it is parallel to."""
        return AXES.index(ROTARY[self.letter])

    @property
    def pivot(self) -> Floats:
        """(3,) the point on its axis, in coordinates."""
        return np.zeros(3) if self.axis_mm is None else np.asarray(self.axis_mm - self.origin_mm)

    def angle(self, columns: Mapping[str, Floats]) -> Floats | None:
        """(n,) rad by which it has turned, by the right hand; ``None`` where none is recorded."""
        read = columns.get(self.column)
        return None if read is None else np.radians(-read if self.clockwise else read)

    def coordinates(self, readings: Floats) -> Floats:
        xyz = super().coordinates(readings[:, :3])
        return xyz if readings.shape[1] == 3 else self._turned(xyz, {self.column: readings[:, 3]}, back=True)

    def readings(self, xyz: Floats, columns: Mapping[str, Floats]) -> Floats:
        read = columns.get(self.column, np.zeros(len(xyz)))
        return np.column_stack([self.place(xyz, columns), read])

    def place(self, xyz: Floats, columns: Mapping[str, Floats]) -> Floats:
        return np.asarray(self._turned(xyz, columns) + self.origin_mm)

    def turned_back(self, vectors: Floats, columns: Mapping[str, Floats]) -> Floats:
        angle = self.angle(columns)
        return vectors if angle is None else _rotated(vectors, self.about, -angle)

    def turned(self, vectors: Floats, columns: Mapping[str, Floats]) -> Floats:
        angle = self.angle(columns)
        return vectors if angle is None else _rotated(vectors, self.about, angle)

    def from_recorded(self, xyz: Floats, columns: Mapping[str, Floats]) -> Floats:
        return self._turned(xyz, columns, back=True) if self.recorded_in_machine else xyz

    def as_recorded(self, xyz: Floats, columns: Mapping[str, Floats]) -> Floats:
        return self._turned(xyz, columns) if self.recorded_in_machine else xyz

    def limits_of(self, axis: str) -> tuple[Floats, str, str]:
        if axis != self.letter:
            return super().limits_of(axis)
        return self.travel_deg, "[machine.table] travel_deg", "travel_deg = [lowest, highest] in degrees"

    def _turned(self, xyz: Floats, columns: Mapping[str, Floats], *, back: bool = False) -> Floats:
        turn = self.turned_back if back else self.turned
        return np.asarray(self.pivot + turn((xyz - self.pivot)[:, :, None], columns)[:, :, 0])


def _rotated(vectors: Floats, about: int, angle: Floats) -> Floats:
    """Vectors (n, 3, k) turned about an axis of the coordinates by angles (n,), rad."""
    i, j = (about + 1) % 3, (about + 2) % 3
    cosine, sine = np.cos(angle)[:, None], np.sin(angle)[:, None]
    found = np.array(np.broadcast_to(vectors, (len(angle), *vectors.shape[1:])))
    found[:, i] = cosine * vectors[:, i] - sine * vectors[:, j]
    found[:, j] = sine * vectors[:, i] + cosine * vectors[:, j]
    return found
