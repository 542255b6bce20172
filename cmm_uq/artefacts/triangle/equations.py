"""The source's way to a machine's parameters: sides of aligned triangles, one equation after the other.

After Manlay, *Fast checking of CMM geometry with a patented tool*, section 3, for the chain YXZ: the triangle's longest side
lies along a machine axis, and what its measured sides lack of the certified ones is split into three defects of each placing:
of the side along the axis (H), of the height over it (K), and the shift of the apex along it (A). Differences between
placings give rotations; what is left of a defect gives scale or squareness.

Two things of the source are mended. It projects the defect of a slanted side on an axis by the cosine of the triangle's
angle, which holds only for a defect along that side; here the apex follows from all three sides. And its perpendicularity
finds a part only of the squareness, half of it at most.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cmm_uq.artefacts.triangle.observe import PLANES, SIDES_OF_DIMENSIONS, Triangle, corners
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, Verbatim, say
from cmm_uq.base.points import AXES, Floats
from cmm_uq.base.units import ARCSECOND, METRE, PPM
from cmm_uq.machine.model.artefact import Placings
from cmm_uq.machine.physics.effects.rigid_body import ROTATION, SCALE, SQUARENESS, tip_offsets

_ALIGNED = np.cos(np.radians(3.0))
_ANOTHER_PLACE = 20.0  # mm between readings, or between tips, from which on two placings differ
_X, _, _Z, _TIP_X, _TIP_Y, _ = range(6)

# what the equations give, by the names of the effects, in their units (ppm, ″, ″/m)
PARAMETERS = tuple(effect.name for family in (SCALE, SQUARENESS, ROTATION) for effect in family.values())


@dataclass(frozen=True, eq=False)
class Defects:
    """What one aligned placing lacks of the certified triangle."""

    measurement: int  # its number
    plane: str  # key of ``PLANES``
    H: float  # H, K, A: mm, see the module's docstring
    K: float
    A: float
    base: float  # base, height: of the certified triangle, mm
    height: float
    start: Floats  # start, apex: (3,) scale readings of corner 1 and of corner 3, mm
    apex: Floats
    tip: Floats  # (3,) stylus tip offset, mm


@dataclass(frozen=True, eq=False)
class TriangleSolution:
    """Parameters by the source's equations, mended."""

    values: Floats  # (15,) in the order of :data:`PARAMETERS`
    per_coordinate: Floats  # (15, 3n) change of each for 1 mm of each recorded coordinate
    per_dimension: Floats  # (15, 6) change of each for 1 mm of each dimension of the standard

    def u(self, coordinate: float, dimensions: Floats) -> Floats:
        """(15,) standard uncertainties from those of a coordinate and of the six dimensions, mm."""
        noise = coordinate**2 * np.sum(self.per_coordinate**2, axis=1)
        return np.asarray(np.sqrt(noise + np.sum((self.per_dimension * dimensions) ** 2, axis=1)), dtype=np.float64)


def solve_equations(triangle: Triangle) -> TriangleSolution:
    machine = triangle.points.machine
    if machine.chain != "YXZ":
        raise CmmUqError(
            say("the source's equations are those of the chain YXZ, not {chain}", chain=Verbatim(machine.chain)),
            where="job.toml [machine] chain",
            fix=say("Use the fitted model, which serves every chain"),
        )
    lower = np.array([machine.travel(axis)[0] for axis in AXES])
    xyz, dimensions = triangle.points.xyz, triangle.standard.dimensions

    def solved(at: Floats, sized: Floats) -> Floats:
        return _in_turn(defects(triangle, at, sized), lower)

    values, step = solved(xyz, dimensions), 1e-3
    changes = [
        (solved(xyz + step * unit, dimensions) - values) / step for unit in np.eye(xyz.size).reshape(-1, *xyz.shape)
    ]
    sized = [(solved(xyz, dimensions + step * unit) - values) / step for unit in np.eye(len(dimensions))]
    return TriangleSolution(values, np.column_stack(changes), np.column_stack(sized))


def defects(triangle: Triangle, xyz: Floats, dimensions: Floats) -> list[Defects]:
    """Defects of every placing, the mean of its repeats.

    ``xyz`` (n, 3) recorded coordinates, mm; ``dimensions`` (6,) of the standard, mm.
    """
    points, nominal = triangle.points, corners(SIDES_OF_DIMENSIONS @ dimensions)
    readings = (xyz + points.machine.origin_mm) / triangle.expansion[:, None]
    tips = tip_offsets(points)
    found = []
    for number in triangle.placings.numbers:
        rows = points.measurement == number
        runs = Placings.of(points.group[rows])
        corner = readings[rows][np.lexsort((points.point[rows], runs.index))].reshape(-1, 3, 3)
        measured = np.mean([corners(np.linalg.norm(np.roll(run, -1, axis=0) - run, axis=1)) for run in corner], axis=0)
        base, (x, height) = nominal[1, 0], nominal[2, :2]
        H, K = base - measured[1, 0], height - measured[2, 1]
        shift = x - measured[2, 0] - H * x / base
        mean = corner.mean(axis=0)
        found.append(Defects(
            int(number), _plane(mean, int(number)), float(H), float(K), float(shift), float(base), float(height),
            mean[0], mean[2], tips[rows].mean(axis=0),
        ))  # fmt: skip
    return found


def _plane(corner: Floats, number: int) -> str:
    base, apex = corner[1] - corner[0], corner[2] - corner[0]
    along = base / np.linalg.norm(base)
    up = apex - (apex @ along) * along
    up = up / np.linalg.norm(up)
    for plane, (a, b) in PLANES.items():
        if along[a] > _ALIGNED and up[b] > _ALIGNED:
            return plane
    raise CmmUqError(
        say("measurement {number}: side 1–2 and the height over it do not lie along X and Y, Y and Z, or X and Z",
            number=number),
        where="recording", fix=say("Align the triangle, or use the fitted model, which serves every placing"),
    )  # fmt: skip


def _in_turn(found: list[Defects], lower: Floats) -> Floats:
    """The fifteen parameters (15,), each from what is known before it."""
    low, high = _pair(found, "XY", _Z, say("horizontal again, higher, over the same place"))
    left, right = _pair(found, "YZ", _X, say("vertical in YZ again, at the other end of X, with the same tip"))
    short, long = _pair(
        found, "YZ", _TIP_X, say("vertical in YZ again, at the same scale readings, with a longer tip along X")
    )
    zx, zx_long = _pair(
        found, "ZX", _TIP_Y, say("vertical in ZX again, at the same scale readings, with a longer tip along Y")
    )
    c, h = low.base, low.height
    z_low, z_high = (float(d.start[2] + d.tip[2]) for d in (low, high))
    x_left, x_right = (float(d.start[0] + d.tip[0]) for d in (left, right))

    x_pitch = (high.H - low.H) / (c * (z_high - z_low))
    x_scale = low.H / c - x_pitch * z_low
    y_pitch = -(high.K - low.K) / (h * (z_high - z_low))
    y_yaw = (right.H - left.H) / (c * (x_right - x_left))
    y_scale = left.H / c - y_yaw * x_left + y_pitch * float(left.start[2] + left.tip[2])
    z_yaw = -(long.K - short.K) / (h * (long.tip[0] - short.tip[0]))
    z_scale = short.K / h + z_yaw * short.tip[0]
    x_yaw = -(zx_long.H - zx.H) / (c * (zx_long.tip[1] - zx.tip[1]))
    z_pitch = (zx_long.K - zx.K) / (h * (zx_long.tip[1] - zx.tip[1]))

    difference = (high.A - low.A) / (h * (z_high - z_low))  # roll of Y minus roll of X
    total = -(right.A - left.A) / (h * (x_right - x_left))  # roll of X plus roll of Y
    x_roll, y_roll = (total - difference) / 2, (total + difference) / 2
    z_roll = (long.A - short.A) / (h * (long.tip[0] - short.tip[0])) + y_roll

    def turned(rate: float, reading: float, axis: int) -> float:
        return rate * (reading - float(lower[axis]))

    xy = -low.A / h + difference * z_low + turned(y_yaw, low.start[1], 1)
    yz = (
        -left.A / h - turned(y_pitch, left.apex[1], 1) - turned(x_roll, left.start[0], 0)
        + z_roll * left.tip[0] - y_roll * x_left
    )  # fmt: skip
    szx = -zx.A / h + turned(x_pitch, zx.apex[0], 0) + (x_roll - z_roll) * zx.tip[1]
    scales = np.array([x_scale, y_scale, z_scale]) / PPM
    rates = np.array([x_roll, x_pitch, x_yaw, y_pitch, y_roll, y_yaw, z_pitch, z_yaw, z_roll]) * METRE / ARCSECOND
    return np.concatenate([scales, np.array([xy, yz, szx]) / ARCSECOND, rates])


def _pair(found: list[Defects], plane: str, differing: int, missing: Text) -> tuple[Defects, Defects]:
    """The two placings in a plane farthest apart in one of readings and tip (6,), and alike in the rest."""
    own = [d for d in found if d.plane == plane]
    at = np.array([[*d.start, *d.tip] for d in own]).reshape(-1, 6)
    apart = np.abs(at[:, None] - at[None, :])
    alike = np.all(np.delete(apart, differing, axis=2) < _ANOTHER_PLACE, axis=2)
    gain = np.where(alike, apart[:, :, differing], 0.0)
    if not len(own) or gain.max() < _ANOTHER_PLACE:
        raise CmmUqError(
            say(
                "{count} placings in {plane} lack one that the source's equations compare",
                count=len(own),
                plane=Verbatim(plane),
            ),
            where="recording",
            fix=say("Add a placing: {missing}", missing=missing),
        )
    i, j = sorted(np.unravel_index(int(np.argmax(gain)), gain.shape), key=lambda k: float(at[k, differing]))
    return own[i], own[j]
