"""Where the part lies on the table, and what the axes read at its points.

With an offset of the tip the scales read another place than that of the point: the ram stands where the tip is not. Errors of
scales and guideways go by readings, and rotations of carriages act on the tip too (:mod:`cmm_uq.base.points`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields

import numpy as np

from cmm_uq.analysis.parts.plan import Plan
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import AXES, Floats, Machine, Points, beyond_travel

OWN_COLUMNS = tuple(
    f"{begin}{axis}{end}" for begin, end in (("n", ""), ("tip_", "_mm"), ("approach_", "")) for axis in AXES
)
"""Columns that follow from how a point is probed."""

_SIDEWAYS = 1e-6  # component of a normal below which an axis does not move into the surface


@dataclass(frozen=True, eq=False)
class PartPose:
    """A place on the table: coordinates of the machine = rotation · those of the part + translation."""

    rotation: Floats = field(default_factory=lambda: np.eye(3))  # (3, 3), proper
    translation_mm: Floats = field(default_factory=lambda: np.zeros(3))  # (3,) where the part's origin lies

    def __post_init__(self) -> None:
        off = np.abs(self.rotation @ self.rotation.T - np.eye(3)).max()
        if self.rotation.shape != (3, 3) or not off < _SIDEWAYS or np.linalg.det(self.rotation) < 0:
            raise CmmUqError(
                "the rotation of the part is none", where="placing", fix="Give three angles, or a proper rotation"
            )

    def of(self, points: Floats) -> Floats:
        """Points (…, 3) of the part in the machine."""
        return np.asarray(points @ self.rotation.T + self.translation_mm)

    def turned(self, vectors: Floats) -> Floats:
        """Vectors (…, 3) of the part in the machine."""
        return np.asarray(vectors @ self.rotation.T)

    def back(self, vectors: Floats) -> Floats:
        """Vectors (…, 3) of the machine in the part."""
        return np.asarray(vectors @ self.rotation)


def around(
    pose: PartPose, u_translation_mm: Floats, u_angles_rad: Floats, count: int, seed: int = 0
) -> tuple[PartPose, ...]:
    """So many places where a part may lie that is put near one: normal in all six.

    ``u_translation_mm``: (3,) standard deviations. ``u_angles_rad``: (3,) of small rotations about the axes of the machine.
    """
    from scipy.spatial.transform import Rotation

    random, poses = np.random.default_rng(seed), []
    for moved, turned in zip(random.standard_normal((count, 3)), random.standard_normal((count, 3)), strict=True):
        turn = Rotation.from_rotvec(turned * u_angles_rad).as_matrix()
        poses.append(PartPose(turn @ pose.rotation, pose.translation_mm + moved * u_translation_mm))
    return tuple(poses)


@dataclass(frozen=True, eq=False)
class WithStyli(Machine):
    """A machine whose probe has an offset, point by point in the columns ``tip_x_mm``, ``tip_y_mm``, ``tip_z_mm``."""

    def readings(self, xyz: Floats, columns: Mapping[str, Floats]) -> Floats:
        return super().readings(xyz - np.column_stack([columns[f"tip_{axis}_mm"] for axis in AXES]), columns)

    @classmethod
    def of(cls, machine: Machine) -> WithStyli:
        """The machine with a probe; rotations of all its carriages act on the tip, as they do in truth."""
        own = {each.name: getattr(machine, each.name) for each in fields(Machine)}
        return cls(**own | {"tip_on_every_carriage": True})


def placed(plan: Plan, pose: PartPose, machine: Machine, columns: Mapping[str, Floats | float] | None = None) -> Points:
    """The plan's points as the machine stands at them: the centres of the tip, with their normals, travel, tips and times.

    ``columns``: further columns of effects, by name, (n,) or a number for all: temperatures.
    """
    radii = 0.5 * np.array([stylus.diameter_mm for stylus in plan.styli])[plan.stylus_of]
    n = len(radii)
    further = {"time_s": plan.times_s} if len(plan.times_s) else {}
    for name, values in (columns or {}).items():
        further[name] = np.broadcast_to(np.asarray(values, dtype=np.float64), (n,)).copy()
    points = probed(pose.of(plan.points), pose.turned(plan.normals), plan.tips, radii, machine, further)
    _refuse_out_of_travel(plan, points)
    return points


def probed(
    contacts: Floats, normals: Floats, tips: Floats, radii: Floats, machine: Machine, further: Mapping[str, Floats]
) -> Points:
    """The machine at points of contact (n, 3), with normals (n, 3), tips of offsets (n, 3) and radii (n,), mm."""
    n = len(contacts)
    known = {f"n{axis}": normals[:, i] for i, axis in enumerate(AXES)}
    known |= {f"tip_{axis}_mm": tips[:, i] for i, axis in enumerate(AXES)}
    travel = -np.sign(np.where(np.abs(normals) > _SIDEWAYS, normals, 0.0))
    known |= {f"approach_{axis}": travel[:, i] for i, axis in enumerate(AXES)}
    rows, ones = np.arange(1, n + 1), np.ones(n, dtype=np.int64)
    centres = contacts + radii[:, None] * normals
    return Points(centres, ones, rows, ones, WithStyli.of(machine), {**known, **further}, start_s=0.0)


def _refuse_out_of_travel(plan: Plan, points: Points) -> None:
    for axis, row in beyond_travel(points.carriages, points.machine.travel_mm):
        low, high = points.machine.travel_mm[axis]
        feature = next(f for f in plan.features if plan.rows[f.name].start <= row < plan.rows[f.name].stop)
        raise CmmUqError(
            f"{AXES[axis].upper()} would have to read {points.carriages[row, axis]:.1f} mm at feature {feature.name!r}, "
            f"beyond its travel of {low:g} to {high:g} mm", where="placing", fix="Move the part, or take another stylus",
        )  # fmt: skip
