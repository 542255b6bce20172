"""Arms: serial chains of joints by Denavit–Hartenberg rows; where the tool is, and what each parameter of a row moves of it.

A row is a, α, d and θ (Denavit, Hartenberg, J. Appl. Mech. 22 (1955) 215), *standard* as Paul 1981 or *modified* as Craig
1989, and β, the angle of nearly parallel axes that no other parameter tells well (Hayati, Mirmirani, J. Robot. Syst. 2 (1985)
397).
From the base to the flange the motions of each joint are

    standard  Rz(θ) Tz(d) Tx(a) Rx(α) Ry(β)        modified  Rx(α) Tx(a) Ry(β) Rz(θ) Tz(d)

A revolute joint adds its reading to θ, a prismatic one to d. Either way a chain is a sequence of turns about, and shifts
along, axes that the motions before them carry: a turn moves the tool by u × (tool − origin), a shift by u. That is the exact
derivative with respect to every parameter, whatever the convention.

An arm may be stated by its screw axes at home too (Brockett 1984; Lynch, Park, Modern Robotics (2017), 4.1), which become such
rows without approximation.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import AXES, Floats, Machine
from cmm_uq.base.values import dataclass, field, replace

A, ALPHA, D, THETA, BETA = range(5)  # parameters of a row
_TURNS = np.array([False, True, False, True, True])
# parameters in the order of their motions, from the base outwards, and the axes of the motions
_STANDARD, _MODIFIED = (THETA, D, A, ALPHA, BETA), (ALPHA, A, BETA, THETA, D)
_ALONG = {A: 0, ALPHA: 0, BETA: 1, D: 2, THETA: 2}


_ROUNDS, _SETTLED, _DIGITS = 30, 1e-9, 7  # mm; of readings, with which a recording prints them whole
_SINGULAR = 1e-6  # part of the joints' largest motion of the tool, below which a direction is none


@dataclass(frozen=True, eq=False)
class ArmPose:
    """A chain of j joints at n sets of readings, in the frame of its base."""

    tool: Floats  # (n, 3) mm
    # (n, j, 5, 3) unit vectors along which, or about which, each parameter of each row moves what follows
    axes: Floats
    origins: Floats  # (n, j, 5, 3) a point that each goes through, mm
    flange: Floats  # (n, 3, 3) attitude of the last frame, in which the tool's offset is given
    path: Floats  # (n, 5 j + 2, 3) where each motion begins, from the base outwards, then flange and tool, mm

    @cached_property
    def jacobian(self) -> Floats:
        """(n, 3, 5 j + 3) how far the tool moves for one mm or rad of each parameter of each row, and of its own offset."""
        turned = np.cross(self.axes, self.tool[:, None, None] - self.origins)
        moved = np.where(_TURNS[:, None], turned, self.axes).reshape(len(self.tool), -1, 3)
        return np.concatenate([moved.transpose(0, 2, 1), self.flange], axis=2)


@dataclass(frozen=True, eq=False)
class Arm(Machine):
    """A machine of joints q1, q2, …, whose coordinates are those of its tool in the frame of its base.

    What the tool measures with, or a reflector on it, is offset from the flange by ``tool_mm``, and by ``tip_x_mm``,
    ``tip_y_mm`` and ``tip_z_mm`` where these are recorded. Of an arm without rows coordinates alone are known, from its base.
    """

    rows: Floats = field(default_factory=lambda: np.zeros((0, 5)))  # (j, 5) a, α, d, θ, β at reading 0, mm and rad
    revolute: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, dtype=bool))  # (j,) else prismatic
    sense: Floats = field(default_factory=lambda: np.zeros(0))  # (j,) +1, or −1 of a reading that counts the other way
    tool_mm: Floats = field(default_factory=lambda: np.zeros(3))
    modified: bool = False
    base: Floats = field(
        default_factory=lambda: np.eye(4)
    )  # frame in which the first row begins, in that of the base, mm
    by_screws: bool = False  # whether it is stated by screw axes
    # (3,) against gravity, in the frame of the base
    up: Floats = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))
    limits: Floats = field(default_factory=lambda: np.zeros((0, 2)))  # (j, 2) lowest and highest readings, ° or mm
    reach_mm: float = np.nan  # from its base to the farthest place that it measures
    # (5 j + 3,) or (n, 5 j + 3) by how much parameters of rows and tool differ from these
    change: Floats | None = None
    axes: tuple[str, ...] = field(init=False)
    commanded: ClassVar[bool] = True

    def __post_init__(self) -> None:
        object.__setattr__(self, "axes", (*AXES, *self.joints))

    @property
    def joints(self) -> tuple[str, ...]:
        return tuple(f"q{i}" for i in range(1, len(self.rows) + 1))

    @property
    def columns_of_joints(self) -> tuple[str, ...]:
        return tuple(f"{q}_{'deg' if turns else 'mm'}" for q, turns in zip(self.joints, self.revolute, strict=True))

    def readings(self, xyz: Floats, columns: Mapping[str, Floats]) -> Floats:
        for name in self.columns_of_joints:
            if name not in columns:
                raise CmmUqError(f"no column {name!r}", where="the recording", fix="Record what each joint reads")
        return np.column_stack([self.place(xyz, columns), *(columns[name] for name in self.columns_of_joints)])

    def coordinates(self, readings: Floats) -> Floats:
        own = readings[:, -len(self.rows) :]
        return self.at(own).tool - self.origin_mm if self.joints else super().coordinates(readings)

    def columns_at(self, xyz: Floats, columns: Mapping[str, Floats]) -> Mapping[str, Floats]:
        """With the readings next to the recorded ones by which the rows have the tool at these coordinates."""
        if not self.joints:
            return columns
        which = 5 * np.arange(len(self.rows)) + np.where(self.revolute, THETA, D)
        units = self.sense * np.where(self.revolute, np.pi / 180, 1.0)
        moved: dict[str, Floats] = {}
        for _ in range(_ROUNDS):
            pose = self.posed(columns)
            off = xyz + self.origin_mm - pose.tool
            if not np.abs(off).max(initial=0.0) > _SETTLED:
                return {**columns, **{name: np.round(columns[name], _DIGITS) for name in moved}}
            step = np.einsum("nji,ni->nj", np.linalg.pinv(pose.jacobian[:, :, which], rcond=_SINGULAR), off) / units
            moved = {name: columns[name] + step[:, i] for i, name in enumerate(self.columns_of_joints)}
            columns = {**columns, **moved}
        row = int(np.argmax(np.linalg.norm(off, axis=1)))
        place = ", ".join(f"{value:.3f}" for value in xyz[row])
        raise CmmUqError(
            f"no readings of the joints bring the tool to {place}",
            where="the simulated recording",
            fix="Plan poses farther from where the arm is stretched out, or smaller errors",
        )

    def limits_of(self, axis: str) -> tuple[Floats, str, str]:
        if axis in AXES:
            raise CmmUqError(
                f"an arm has no carriage {axis}", where="job.toml [machine]", fix="Name effects of its joints"
            )
        return self.limits[self.joints.index(axis)], "[[machine.joint]] travel", "travel = [lowest, highest]"

    def posed(self, columns: Mapping[str, Floats]) -> ArmPose:
        """Its pose at recorded readings."""
        q = np.column_stack([columns[name] for name in self.columns_of_joints])
        tips = np.column_stack([columns.get(f"tip_{axis}_mm", np.zeros(len(q))) for axis in AXES])
        key = q.tobytes() + tips.tobytes()
        if key not in self._poses:
            self._poses.clear()
            self._poses[key] = self.at(q, tips)
        return self._poses[key]

    @cached_property
    def _poses(self) -> dict[bytes, ArmPose]:
        return {}

    def changed(self, change: Floats) -> Arm:
        """The same arm with other rows and another tool, by a change as of :attr:`change`."""
        return replace(self, change=change)

    def at(self, q: Floats, tips: Floats | None = None) -> ArmPose:
        """Its pose at readings (n, j), ° or mm, with ``tips`` (n, 3) mm beyond the tool's offset."""
        (n, j), change = q.shape, np.zeros(1) if self.change is None else self.change
        change = np.broadcast_to(change, (n, 5 * j + 3))
        values = self.rows + change[:, : 5 * j].reshape(n, j, 5)
        values[:, np.arange(j), np.where(self.revolute, THETA, D)] += (
            self.sense * q * np.where(self.revolute, np.pi / 180, 1.0)
        )
        frame, origin = np.tile(self.base[:3, :3], (n, 1, 1)), np.tile(self.base[:3, 3], (n, 1))
        axes, origins = np.empty((2, n, j, 5, 3))
        for i in range(j):
            for name in self._order:
                along, value = _ALONG[name], values[:, i, name, None]
                axes[:, i, name], origins[:, i, name] = frame[:, :, along], origin
                if not _TURNS[name]:
                    origin = origin + value * frame[:, :, along]
                    continue
                one, other = frame[:, :, (along + 1) % 3], frame[:, :, (along + 2) % 3]
                cosine, sine = np.cos(value), np.sin(value)
                turned = cosine * one + sine * other, cosine * other - sine * one
                frame[:, :, (along + 1) % 3], frame[:, :, (along + 2) % 3] = turned
        offset = self.tool_mm + change[:, 5 * j :] + (0.0 if tips is None else tips)
        tool = origin + np.einsum("nij,nj->ni", frame, offset)
        ends = (origins[:, :, self._order].reshape(n, -1, 3), origin[:, None], tool[:, None])
        return ArmPose(tool, axes, origins, frame, np.concatenate(ends, axis=1))

    @property
    def _order(self) -> tuple[int, ...]:
        return _MODIFIED if self.modified else _STANDARD


PARALLEL = np.cos(np.radians(5.0))  # from which on the common normal of two axes says little of where it is


def rows_of_screws(directions: Floats, through: Floats, revolute: NDArray[np.bool_], home: Floats) -> dict[str, Floats]:
    """``base``, ``rows`` and ``tool_mm`` of a product of exponentials e^ξ₁q₁ … e^ξⱼqⱼ·M, equal to it at all readings.

    ``directions``, ``through``: (j, 3) unit vectors, and points of the axes at home, mm, in the frame of the base; ``home``:
    (4, 4) M, the last frame there. Each row carries a frame along one axis into a frame along the next: by their
    common normal, or by Hayati's β in place of d where they are nearly parallel.
    """
    z = directions[0]
    x = np.eye(3)[0] - z[0] * z if abs(z[0]) < 1 - 1e-9 else np.eye(3)[1]
    frame, rows = np.eye(4), np.zeros((len(directions), 5))
    x = x / np.linalg.norm(x)
    frame[:3, :3] = np.column_stack([x, np.cross(z, x), z])
    frame[:3, 3] = (through[0] - (through[0] @ z) * z) if revolute[0] else 0.0
    base = frame.copy()
    for i, (direction, point) in enumerate(zip(directions[1:], through[1:], strict=True)):
        axis = frame[:3, :3].T @ direction
        at = frame[:3, :3].T @ (point - frame[:3, 3]) if revolute[i + 1] else np.zeros(3)  # a shift has no place
        rows[i] = _to_parallel(axis, at) if abs(axis[2]) > PARALLEL else _to_crossing(axis, at)
        frame = frame @ _motion(rows[i])
    last = np.linalg.inv(frame) @ home
    rows[-1, ALPHA] = np.arcsin(np.clip(last[2, 1], -1.0, 1.0))  # Rz(θ) Rx(α) Ry(β)
    rows[-1, THETA], rows[-1, BETA] = np.arctan2(-last[0, 1], last[1, 1]), np.arctan2(-last[2, 0], last[2, 2])
    return {"base": base, "rows": rows, "tool_mm": last[:3, :3].T @ last[:3, 3]}


def _to_crossing(axis: Floats, at: Floats) -> Floats:
    across = np.hypot(axis[0], axis[1])
    along = at - (at[:2] @ axis[:2]) / across**2 * axis  # foot of the common normal
    normal = np.array([-axis[1], axis[0]]) / across
    return np.array([normal @ at[:2], np.arctan2(across, axis[2]), along[2], np.arctan2(normal[1], normal[0]), 0.0])


def _to_parallel(axis: Floats, at: Floats) -> Floats:
    foot = (at - at[2] / axis[2] * axis)[:2]
    a, theta = float(np.hypot(*foot)), float(np.arctan2(foot[1], foot[0]))
    cosine, sine = np.cos(theta), np.sin(theta)
    x, y = cosine * axis[0] + sine * axis[1], cosine * axis[1] - sine * axis[0]
    return np.array([a, np.arctan2(-y, axis[2]), 0.0, theta, np.arcsin(np.clip(x, -1.0, 1.0))])


def _motion(row: Floats) -> Floats:
    """(4, 4) of a row at reading 0."""
    pose = Arm(rows=row[None], revolute=np.ones(1, dtype=bool), sense=np.ones(1)).at(np.zeros((1, 1)))
    found = np.eye(4)
    found[:3, :3], found[:3, 3] = pose.flange[0], pose.tool[0]
    return found
