"""A machine of three carriages with rotary axes: tables that turn what is measured, and a head that turns the probe.

Coordinates lie on the last table, errors in the axes of the machine. With all rotary axes at 0 both frames are one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from cmm_uq.base.points import AXES, Floats, Machine
from cmm_uq.base.values import dataclass, field

ROTARY = dict(zip("abc", AXES, strict=True))  # by the letter of a rotary axis the axis that it is parallel to (ISO 841)
NORMALS = tuple(f"n{axis}" for axis in AXES)  # columns, along the axes of the coordinates


@dataclass(frozen=True, eq=False)
class RotaryAxis:
    """An axis that turns a table, or the probe."""

    letter: str = "c"
    # (3,) a point on it, with all rotary axes at 0, mm: of a table in the frame of the scales, by default the origin of the
    # coordinates; of a head from the end of the ram, by default that
    axis_mm: Floats | None = None
    travel_deg: Floats = field(default_factory=lambda: np.full(2, np.nan))  # lowest and highest reading
    clockwise: bool = False  # how it turns while its reading grows, seen against its axis's positive direction
    head: bool = False  # whether it turns the probe

    @property
    def column(self) -> str:
        """Recorded column of its reading."""
        return f"{self.letter}_deg"

    @property
    def about(self) -> int:
        """Index of the axis of the coordinates that it is parallel to."""
        return AXES.index(ROTARY[self.letter])

    def angle(self, columns: Mapping[str, Floats]) -> Floats | None:
        """(n,) rad by which it has turned, by the right hand; ``None`` where none is recorded."""
        read = columns.get(self.column)
        return None if read is None else np.radians(-read if self.clockwise else read)

    def turned(self, vectors: Floats, columns: Mapping[str, Floats], *, back: bool = False) -> Floats:
        """Vectors (n, 3, k) that it carries, along the axes of what carries it; ``back``: the other way."""
        angle = self.angle(columns)
        return vectors if angle is None else _rotated(vectors, self.about, -angle if back else angle)


@dataclass(frozen=True, eq=False)
class RotaryMachine(Machine):
    """Carriages x, y, z, and rotary axes: tables from the bed to the workpiece, then those of the head, from the ram on.

    Coordinates are those of the machine with all tables at 0, turned with the last: what stands still on it keeps them. The
    carriages go where that is after the turn R of each table about a point p of its axis, p + R·(xyz − p), the last first;
    with a head by as much less as that moved the tip. Where a recording has no column of an angle, that axis stood at 0.
    """

    rotary: tuple[RotaryAxis, ...] = (RotaryAxis(),)
    stylus_mm: Floats = field(default_factory=lambda: np.zeros(3))  # (3,) tip from the end of the ram, the head at 0
    recorded_in_machine: bool = False  # whether recorded coordinates are those of the machine, and not of the table
    normals_in_machine: bool = False  # the same of recorded normals
    recorded_at_ram: bool = False  # whether they are those of the carriages, and not of the tip that a head turned
    still: bool = False  # whether the carriages stood still, wherever on the table things are
    axes: tuple[str, ...] = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "axes", (*AXES, *(axis.letter for axis in self.rotary)))

    @property
    def tables(self) -> tuple[RotaryAxis, ...]:
        return tuple(axis for axis in self.rotary if not axis.head)

    @property
    def head(self) -> tuple[RotaryAxis, ...]:
        return tuple(axis for axis in self.rotary if axis.head)

    @property
    def fourth(self) -> RotaryAxis | None:
        """The table of a machine that has nothing else that turns."""
        return self.rotary[0] if len(self.rotary) == 1 and not self.rotary[0].head else None

    def named(self, letter: str, *, head: bool) -> RotaryAxis | None:
        return next((axis for axis in self.rotary if (axis.letter, axis.head) == (letter, head)), None)

    def pivot(self, axis: RotaryAxis) -> Floats:
        """(3,) the point on an axis: of a table in coordinates, of a head from the end of the ram."""
        if axis.head:
            return np.zeros(3) if axis.axis_mm is None else axis.axis_mm
        return np.zeros(3) if axis.axis_mm is None else np.asarray(axis.axis_mm - self.origin_mm)

    def tip(self, columns: Mapping[str, Floats]) -> Floats:
        """(n, 3) or (3,) the tip from the end of the ram, as it is recorded, or as the head has turned the stylus, mm."""
        if "tip_x_mm" in columns:
            return np.column_stack([columns.get(f"tip_{axis}_mm", np.zeros(len(columns["tip_x_mm"]))) for axis in AXES])
        return self._turned(self.stylus_mm, self.head, columns)

    def standing(self, axis: RotaryAxis, xyz: Floats, columns: Mapping[str, Floats]) -> Floats:
        """(n, 3) from the stated point of a table's axis to what stands on it, along axes that turn with it, mm."""
        return self._turned(xyz, self.tables[self.tables.index(axis) + 1 :], columns) - self.pivot(axis)

    def by_turn(self, axis: RotaryAxis, xyz: Floats, columns: Mapping[str, Floats]) -> tuple[Floats, Floats]:
        """(n, 3) from the stated point of an axis to what it carries, and (n, 3) the axis, along those of the coordinates."""
        along = np.tile(np.eye(3)[axis.about], (len(xyz), 1))
        if axis.head:
            pair = np.stack([np.broadcast_to(self.arm(axis, xyz, columns), xyz.shape), along], axis=2)
            pair = self.turned_back(self.carried(axis, pair, columns), columns)
        else:
            pair = np.stack([self.standing(axis, xyz, columns), along], axis=2)
            for after in self.tables[self.tables.index(axis) + 1 :]:
                pair = after.turned(pair, columns, back=True)
        return pair[:, :, 0], pair[:, :, 1]

    def arm(self, axis: RotaryAxis, xyz: Floats, columns: Mapping[str, Floats]) -> Floats:
        """(n, 3) from the stated point of an axis to what it carries, along the axes of what carries it, mm."""
        if axis.head:
            before = self.head[: self.head.index(axis)]
            return self._turned(self.tip(columns), before, columns, back=True) - self.pivot(axis)
        there = self._turned(xyz, self.tables[self.tables.index(axis) :], columns)
        # by way of the readings, whose rounding the figures of issued certificates have
        return np.asarray(there + self.origin_mm - self.origin_mm - self.pivot(axis))

    def carried(self, axis: RotaryAxis, vectors: Floats, columns: Mapping[str, Floats]) -> Floats:
        """Vectors (n, 3, k) along the axes of what carries an axis, along those of the machine."""
        side = self.head if axis.head else self.tables
        for before in reversed(side[: side.index(axis)]):
            vectors = before.turned(vectors, columns)
        return vectors

    def coordinates(self, readings: Floats) -> Floats:
        columns = {axis.column: read for axis, read in zip(self.rotary, readings[:, 3:].T, strict=False)}
        there = super().coordinates(readings[:, :3]) + self._by_head(columns)
        return self._turned(there, self.tables, columns, back=True)

    def readings(self, xyz: Floats, columns: Mapping[str, Floats]) -> Floats:
        read = (columns.get(axis.column, np.zeros(len(xyz))) for axis in self.rotary)
        place = np.tile(self.origin_mm, (len(xyz), 1)) if self.still else self.place(xyz, columns)
        return np.column_stack([place - self._by_head(columns), *read])

    def place(self, xyz: Floats, columns: Mapping[str, Floats]) -> Floats:
        return np.asarray(self._turned(xyz, self.tables, columns) + self.origin_mm)

    def turned_back(self, vectors: Floats, columns: Mapping[str, Floats]) -> Floats:
        for axis in self.tables:
            vectors = axis.turned(vectors, columns, back=True)
        return vectors

    def turned(self, vectors: Floats, columns: Mapping[str, Floats]) -> Floats:
        for axis in reversed(self.tables):
            vectors = axis.turned(vectors, columns)
        return vectors

    def from_recorded(self, xyz: Floats, columns: Mapping[str, Floats]) -> Floats:
        there = xyz + self._by_head(columns) if self.recorded_at_ram else xyz
        return self._turned(there, self.tables, columns, back=True) if self.recorded_in_machine else there

    def as_recorded(self, xyz: Floats, columns: Mapping[str, Floats]) -> Floats:
        there = self._turned(xyz, self.tables, columns) if self.recorded_in_machine else xyz
        return there - self._by_head(columns) if self.recorded_at_ram else there

    def columns_as_recorded(self, columns: Mapping[str, Floats]) -> Mapping[str, Floats]:
        return {**columns, **self.normals(columns)} if NORMALS[0] in columns else columns

    def normals(self, columns: Mapping[str, Floats], *, back: bool = False) -> Mapping[str, Floats]:
        """Columns of normals as recorded, of those along the axes of the coordinates; ``back``: the other way."""
        if not self.normals_in_machine:
            return {}
        vectors = np.column_stack([columns[name] for name in NORMALS])[:, :, None]
        turn = self.turned_back if back else self.turned
        return dict(zip(NORMALS, turn(vectors, columns)[:, :, 0].T, strict=True))

    def limits_of(self, axis: str) -> tuple[Floats, str, str]:
        found = next((each for each in self.rotary if each.letter == axis), None)
        if found is None:
            return super().limits_of(axis)
        key = "[machine.table]" if len(self.rotary) == 1 and not found.head else "[[machine.rotary]]"
        return found.travel_deg, f"{key} travel_deg", "travel_deg = [lowest, highest] in degrees"

    def _by_head(self, columns: Mapping[str, Floats]) -> Floats | float:
        """By how much the head has moved the tip, mm."""
        return self.tip(columns) - self.stylus_mm if self.head else 0.0

    def _turned(
        self, xyz: Floats, axes: Sequence[RotaryAxis], columns: Mapping[str, Floats], *, back: bool = False
    ) -> Floats:
        """Places (n, 3) or (3,) turned by axes, each carried by the one before; ``back``: the other way."""
        for axis in axes if back else reversed(axes):
            if axis.column in columns:
                p = self.pivot(axis)
                xyz = np.asarray(p + axis.turned(np.atleast_2d(xyz - p)[:, :, None], columns, back=back)[:, :, 0])
        return xyz


def _rotated(vectors: Floats, about: int, angle: Floats) -> Floats:
    """Vectors (n, 3, k), or (1, 3, k), turned about an axis of the coordinates by angles (n,), rad."""
    i, j = (about + 1) % 3, (about + 2) % 3
    cosine, sine = np.cos(angle)[:, None], np.sin(angle)[:, None]
    found = np.array(np.broadcast_to(vectors, (len(angle), *vectors.shape[1:])))
    found[:, i] = cosine * vectors[:, i] - sine * vectors[:, j]
    found[:, j] = sine * vectors[:, i] + cosine * vectors[:, j]
    return found
