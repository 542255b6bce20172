"""``[[machine.joint]]``: the rows of an arm, and its coordinates by what its joints read."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from cmm_uq.base.arm import Arm
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.table import JobTable, Position, Range, Triple, key
from cmm_uq.base.points import AXES, Floats, Machine
from cmm_uq.jobs.columns import COORDINATES, REQUIRED

MOST_JOINTS = 12
Turn = Annotated[float, Field(ge=-720, le=720)]
_FINEST = 9  # decimals of a number that is looked at as printed


class JointFacts(JobTable):
    """One ``[[machine.joint]]``: a Denavit–Hartenberg row. The joints read `q1_deg`, `q2_deg` and so on."""

    type: Literal["revolute", "prismatic"] = key("revolute", "Whether the joint turns, or shifts and reads `q3_mm`.")
    a_mm: Position = key(0.0, "Length a of the link, along x.")
    alpha_deg: Turn = key(0.0, "Twist α of the link, about x.")
    d_mm: Position = key(0.0, "Offset d along z; of a prismatic joint where it reads 0.")
    theta_deg: Turn = key(0.0, "Angle θ about z; of a revolute joint where it reads 0.")
    beta_deg: Turn = key(0.0, "Hayati's angle β about y, between axes that are nearly parallel.")
    reversed: bool = key(False, "Whether the reading counts against the right hand about z, or against z.")
    travel: Range | None = key(None, "Lowest and highest reading, in degrees or mm.")

    def problems(self) -> Iterator[str]:
        if self.travel and not self.travel[0] < self.travel[1]:
            yield f"travel = {self.travel}: the first number must be the lower one"

    @property
    def row(self) -> tuple[float, ...]:
        angles = self.alpha_deg, self.theta_deg, self.beta_deg
        alpha, theta, beta = (float(np.radians(angle)) for angle in angles)
        return self.a_mm, alpha, self.d_mm, theta, beta


class ArmFacts(JobTable):
    """``arm``: what holds for all of its joints."""

    convention: Literal["standard", "modified"] = "standard"
    """Whether rows are standard, θ d a α from this joint to the next, or modified (Craig), α a θ d from the one before."""
    tool_mm: Triple = [0.0, 0.0, 0.0]
    """What is measured on the flange, in the frame of the last row: a ball, a stylus, a reflector. Of several reflectors the
    recording has how far each is beyond it, `tip_x_mm`, `tip_y_mm`, `tip_z_mm`."""
    up: Triple = [0.0, 0.0, 1.0]
    """The direction against gravity in the frame of the base, for how joints sag: an arm on the ceiling has [0, 0, -1]."""

    def problems(self) -> Iterator[str]:
        if not any(self.up):
            yield "up = [0, 0, 0] is no direction"


def arm(name: str, joints: Sequence[JointFacts], facts: ArmFacts) -> Arm:
    up = np.array(facts.up, dtype=np.float64)
    return Arm(
        name,
        rows=np.array([joint.row for joint in joints]),
        modified=facts.convention == "modified",
        revolute=np.array([joint.type == "revolute" for joint in joints]),
        sense=np.array([-1.0 if joint.reversed else 1.0 for joint in joints]),
        tool_mm=np.array(facts.tool_mm),
        up=up / np.linalg.norm(up),
        limits=np.array([joint.travel or [np.nan, np.nan] for joint in joints]),
    )


def required_columns(machine: Machine, header: Collection[str]) -> Sequence[str]:
    """Columns that a recording must have; coordinates of an arm follow from what its joints read, and may be left out."""
    if not isinstance(machine, Arm):
        return REQUIRED
    recorded = COORDINATES if any(name in header for name in COORDINATES) else ()
    return (*(name for name in REQUIRED if name not in COORDINATES), *recorded, *machine.columns_of_joints)


def coordinates(machine: Machine, table: Mapping[str, Floats], lines: Sequence[int], name: str) -> Floats:
    """Coordinates (n, 3), mm, of a recording: as recorded, or by the joints of an arm."""
    if isinstance(machine, Arm):
        return by_joints(machine, table, lines, name)
    return np.column_stack([table[column] for column in COORDINATES])


def by_joints(machine: Arm, table: Mapping[str, Floats], lines: Sequence[int], name: str) -> Floats:
    """Coordinates (n, 3), mm, by what the joints read. Others, and readings beyond a joint's travel, are refused.

    Recorded coordinates and readings may be rounded as their digits show.
    """
    if missing := [column for column in machine.columns_of_joints if column not in table]:
        raise CmmUqError(f"no column {missing[0]!r}", where=name, fix="Record what each joint reads")
    read = np.column_stack([table[column] for column in machine.columns_of_joints])
    beyond = (read < machine.limits[:, 0] - 1e-6) | (read > machine.limits[:, 1] + 1e-6)
    if beyond.any():
        row, joint = np.argwhere(beyond)[0]
        low, high = machine.limits[joint]
        raise CmmUqError(
            f"{read[row, joint]:g} lies outside the travel of the joint, {low:g} to {high:g}",
            where=f"{name} line {lines[row]}, column {machine.columns_of_joints[joint]}",
            fix="Mend it, or travel in [[machine.joint]]",
        )
    pose = machine.posed(table)
    xyz = np.asarray(pose.tool - machine.origin_mm)
    if f"{AXES[0]}_mm" in table:
        recorded = np.column_stack([table[f"{axis}_mm"] for axis in AXES])
        turns, shifts = _step(read[:, machine.revolute]), _step(read[:, ~machine.revolute])
        reach = 1.0 + float(np.linalg.norm(pose.tool[:, None, None] - pose.origins, axis=3).max(initial=0.0))
        off = np.linalg.norm(recorded - xyz, axis=1)
        rounded = reach * np.radians(turns) * machine.revolute.sum() + shifts * (~machine.revolute).sum()
        allowed = _step(recorded) + 0.5 * float(rounded)
        if np.any(off > allowed):
            row = int(np.argmax(off))
            raise CmmUqError(
                f"x_mm, y_mm, z_mm lie {off[row]:.4g} mm from where [[machine.joint]] has the tool at these readings",
                where=f"{name} line {lines[row]}",
                fix="Mend rows, convention, reversed or tool_mm; or leave the coordinates out: they follow from the joints",
            )
    return xyz


def _step(values: Floats) -> float:
    """The last decimal that numbers are printed with."""
    decimals = (d for d in range(_FINEST) if np.allclose(values, np.round(values, d), rtol=0, atol=10.0 ** (-d - 4)))
    return 10.0 ** -next(decimals, _FINEST)
