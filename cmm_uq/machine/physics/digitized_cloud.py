"""The whole chain for a cloud: every point by the digitizer in its pose, at the temperatures of the scales at its time."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import AXES, Floats
from cmm_uq.machine.physics.digitizer import Digitizer
from cmm_uq.machine.physics.point_cloud import COORDINATES, DIGITIZER_COLUMNS

POSE, TIME, EXTRAPOLATED = "pose", "time_s", "extrapolated"
TEMPERATURES = tuple(f"temp_{axis}_c" for axis in AXES)


@dataclass(frozen=True, eq=False)
class DigitizedCloud:
    """What makes coordinates of the rows of a cloud."""

    poses: Mapping[int, Digitizer]  # the digitizer in each of its poses, by number
    columns: tuple[str, ...]  # of the rows; the first five are u, v, D, E, F
    # temperatures (n, 3) of the scales at times (n,), where a log gives them
    temperatures_at: Callable[[Floats], Floats] | None = None
    flagged: bool = False  # whether the result has a fourth column, 1 where a point was extrapolated beyond the maps

    @property
    def names(self) -> tuple[str, ...]:
        return (*COORDINATES, EXTRAPOLATED) if self.flagged else COORDINATES

    def __call__(self, rows: Floats) -> Floats:
        """Coordinates (n, 3), or (n, 4) with the flag, of rows (n, k)."""
        finite = np.isfinite(rows)
        if not finite.all():
            row, column = np.argwhere(~finite)[0]
            raise CmmUqError(f"{self.columns[column]} is no finite number", where=f"point {row + 1}",
                             fix="Leave out the point")  # fmt: skip
        temperatures = self._temperatures(rows)
        if POSE not in self.columns:
            (digitizer,) = self.poses.values()
            return self._joined(*digitizer.coordinates(rows[:, :2], rows[:, 2:5], temperatures))
        numbers = rows[:, self.columns.index(POSE)]
        xyz, extrapolated = np.empty((len(rows), 3)), np.empty(len(rows), dtype=bool)
        for number in np.unique(numbers):
            here = numbers == number
            if number not in self.poses:
                raise CmmUqError(
                    f"pose {number:g} is not described", where=f"point {np.flatnonzero(here)[0] + 1}",
                    fix=f"Known: {', '.join(map(str, self.poses))}; add it to [machine] digitizer poses",
                )  # fmt: skip
            part = rows[here]
            given = temperatures[here] if temperatures is not None else None
            try:
                xyz[here], extrapolated[here] = self.poses[int(number)].coordinates(part[:, :2], part[:, 2:5], given)
            except CmmUqError as error:
                raise CmmUqError(
                    error.problem, where=f"pose {number:g}, {error.where} of those in this pose", fix=error.fix
                ) from error
        return self._joined(xyz, extrapolated)

    def _temperatures(self, rows: Floats) -> Floats | None:
        if TEMPERATURES[0] in self.columns:
            return rows[:, [self.columns.index(name) for name in TEMPERATURES]]
        if self.temperatures_at is not None:
            return self.temperatures_at(rows[:, self.columns.index(TIME)])
        return None

    def _joined(self, xyz: Floats, extrapolated: NDArray[np.bool_]) -> Floats:
        return np.column_stack([xyz, extrapolated]) if self.flagged else xyz


def columns_for(header: Sequence[str] | None, poses: int, *, logged: bool, where: str) -> tuple[str, ...]:
    """Columns that a cloud is read by.

    ``header``: its columns; ``None`` for arrays, which have no names: u, v, D, E, F, and the time where there is a log.
    ``logged``: whether a log gives the temperatures of the scales.
    """
    if header is None:
        if poses > 1:
            raise CmmUqError(f"has no column {POSE}, and the digitizer has {poses} poses", where=where,
                             fix="Save the cloud as CSV or Parquet, with the pose of each point")  # fmt: skip
        return (*DIGITIZER_COLUMNS, TIME) if logged else DIGITIZER_COLUMNS
    own = [name for name in TEMPERATURES if name in header]
    if own and logged:
        raise CmmUqError(f"has {own[0]}, and [machine] temperature_log gives it as well", where=where,
                         fix="Leave out one of the two")  # fmt: skip
    needed = [
        *DIGITIZER_COLUMNS,
        *((POSE,) if poses > 1 or POSE in header else ()),
        *((TIME,) if logged else ()),
        *(TEMPERATURES if own else ()),
    ]
    missing = [name for name in needed if name not in header]
    if missing:
        raise CmmUqError(f"has no column {missing[0]}", where=where, fix=f"This cloud needs {', '.join(needed)}")
    return tuple(needed)
