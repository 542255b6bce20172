"""``[[machine.joint]]`` and ``[machine.arm]``: an arm by Denavit–Hartenberg rows, or by screw axes where all joints read 0."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Literal

import numpy as np
from pydantic import AfterValidator, Field

from cmm_uq.base.files.table import JobTable, Length, Position, Range, Triple, key
from cmm_uq.base.points import Floats

MOST_JOINTS = 12


def _somewhere(direction: list[float]) -> list[float]:
    if not any(direction):
        raise ValueError("[0, 0, 0] is no direction")
    return direction


Direction = Annotated[Triple, AfterValidator(_somewhere)]
JointAngle = Annotated[float, Field(ge=-720, le=720)]


class JointFacts(JobTable):
    """One ``[[machine.joint]]``: a Denavit–Hartenberg row, or a screw axis. The joints read `q1_deg`, `q2_deg` and so on."""

    type: Literal["revolute", "prismatic"] = key("revolute", "Whether the joint turns, or shifts and reads `q3_mm`.")
    a_mm: Position = key(0.0, "Length a of the link, along x.")
    alpha_deg: JointAngle = key(0.0, "Twist α of the link, about x.")
    d_mm: Position = key(0.0, "Offset d along z; of a prismatic joint where it reads 0.")
    theta_deg: JointAngle = key(0.0, "Angle θ about z; of a revolute joint where it reads 0.")
    beta_deg: JointAngle = key(0.0, "Hayati's angle β about y, between axes that are nearly parallel.")
    direction: Direction | None = None
    """In place of the row its screw axis, where all joints read 0: its direction in the frame of the base."""
    point_mm: Triple | None = key(None, "A point that the screw axis goes through; of a prismatic joint none.")
    v_mm: Triple | None = key(None, "In its place v = −ω × point, ω being the direction as a unit vector.")
    reversed: bool = key(False, "Whether the reading counts against the right hand about z, or against z.")
    travel: Range | None = key(None, "Lowest and highest reading, in degrees or mm.")

    def problems(self) -> Iterator[str]:
        stated = self.model_fields_set
        yield from map("{} is a number of right angles in radians: give degrees".format, self._in_radians())
        if wrong := sorted(stated & _OF_ROWS) if self.direction is not None else sorted(stated & {"point_mm", "v_mm"}):
            other = "a row" if self.direction is not None else "a screw axis, whose direction is missing"
            yield f"{wrong[0]} is of {other}: give a row (a_mm, alpha_deg, d_mm, theta_deg), or direction with point_mm"
        if self.direction is None:
            return
        places = [one for one in (self.point_mm, self.v_mm) if one is not None]
        if len(places) != (self.type == "revolute"):
            yield f"a {self.type} joint has {len(places)} of point_mm and v_mm: give one of a revolute joint, else none"
        elif self.v_mm is not None and abs(np.dot(self.unit, self.v_mm)) > PITCH * np.linalg.norm(self.v_mm):
            yield f"v_mm = {self.v_mm} has a part along the direction, as a thread has: give v = −ω × point, or point_mm"

    def _in_radians(self) -> Iterator[str]:
        angles = {name: [getattr(self, name)] for name in ("alpha_deg", "theta_deg", "beta_deg")}
        if self.type == "revolute" and self.travel is not None:
            angles["travel"] = list(self.travel)
        for name, values in angles.items():
            count = np.round(np.array(values) / RIGHT)
            if np.any(count) and np.all(np.abs(values - count * RIGHT) < RADIAN_DIGITS) and np.abs(count).max() <= 4:
                yield f"{name} = {values[0] if len(values) == 1 else values}"

    @property
    def unit(self) -> Floats:
        """(3,) of the screw axis."""
        direction = np.array(self.direction, dtype=np.float64)
        return np.asarray(direction / np.linalg.norm(direction))

    @property
    def through(self) -> Floats:
        """(3,) a point of the screw axis, mm."""
        if self.v_mm is not None:
            return np.cross(self.unit, self.v_mm)
        return np.array(self.point_mm or (0.0, 0.0, 0.0), dtype=np.float64)

    @property
    def row(self) -> tuple[float, ...]:
        angles = self.alpha_deg, self.theta_deg, self.beta_deg
        alpha, theta, beta = (float(np.radians(angle)) for angle in angles)
        return self.a_mm, alpha, self.d_mm, theta, beta


_OF_ROWS = {"a_mm", "alpha_deg", "d_mm", "theta_deg", "beta_deg"}
RIGHT, RADIAN_DIGITS = np.pi / 2, 3e-4  # a right angle in radians, and how far figures printed with four digits are off
PITCH = 1e-6  # part of v along the direction from which on it is a screw that moves along as it turns
_SQUARE = 1e-4  # by which figures of a rotation may be off, as they are printed
_FrameRow = Annotated[list[Position], Field(min_length=4, max_length=4)]


class ArmFacts(JobTable):
    """``arm``: what holds for all of its joints."""

    convention: Literal["standard", "modified"] = "standard"
    """Whether rows are standard, θ d a α from this joint to the next, or modified (Craig), α a θ d from the one before."""
    tool_mm: Triple = [0.0, 0.0, 0.0]
    """What is measured on the flange, in the frame of the last row: a ball, a stylus, a reflector. Of several reflectors the
    recording has how far each is beyond it, `tip_x_mm`, `tip_y_mm`, `tip_z_mm`."""
    home: Annotated[list[_FrameRow], Field(min_length=3, max_length=4)] | None = None
    """Of an arm by screw axes the last frame where all joints read 0: three rows of a rotation with x, y and z in mm."""
    up: Triple = [0.0, 0.0, 1.0]
    """The direction against gravity in the frame of the base, for how joints sag: an arm on the ceiling has [0, 0, -1]."""
    reach_mm: Length | None = None
    """From the base to the farthest place that it measures, half of the measuring range; without `[[machine.joint]]` the
    recording has coordinates alone, and `origin_mm` says where its origin lies from the base."""

    def problems(self) -> Iterator[str]:
        if not any(self.up):
            yield "up = [0, 0, 0] is no direction"
        if self.home and self.home[3:] not in ([], [[0.0, 0.0, 0.0, 1.0]]):
            yield f"home: the fourth row {self.home[3]} is not [0, 0, 0, 1]: leave it out"
        turn = np.array(self.home or np.eye(4))[:3, :3]
        if np.abs(turn @ turn.T - np.eye(3)).max() > _SQUARE or np.linalg.det(turn) < 0:
            yield "home: its first three columns are no rotation: give unit vectors at right angles, right-handed"
