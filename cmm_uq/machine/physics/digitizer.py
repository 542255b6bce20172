"""Laser digitizer on the ram: from scan plane and scale readings to true coordinates, and its alignment (Harris 2004 ch. 4–5).

The digitizer measures u and v in its scan plane, w = 0. Its attitude is three Euler angles 3-1-3; its mount, the end of the
ram, lies at [U1 V1 W1] in its own frame. So a point lies at q = E·([u v 0] − [U1 V1 W1]) from the mount, the mount's own
attitude turns q by A, and the mount is at scale readings plus their error:

    X = A·q + D + e(D)                                                                                       (35)

An alignment is the scale reading at which the origin of the scan plane falls on the centre of the reference sphere. Three
of them, in different attitudes, tell the offset of the mount and the place of the sphere: nine equations for six unknowns.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import AXES, Floats
from cmm_uq.base.values import dataclass
from cmm_uq.machine.physics.compensation import BLOCK, Compensation, PointConditions
from cmm_uq.machine.physics.kinematics import MOST_LEAN, axis_directions, euler_313, on_leaning_axes
from cmm_uq.machine.physics.map_interpolation import LookedUp
from cmm_uq.machine.physics.point_cloud import COORDINATES, DIGITIZER_COLUMNS
from cmm_uq.maths.geometry import fit_plane, fit_sphere
from cmm_uq.maths.geometry.feature import frame_about, minimise

LEANS = 0.01  # part of its radius by which a sphere that was scanned in several attitudes is none, where the axes lean


@dataclass(frozen=True, eq=False)
class ScanPlane:
    """Direction of the scan plane: α, β in rad and their covariance (2, 2) in rad²."""

    alpha: float
    beta: float
    covariance: Floats


def scan_plane(readings: Floats, towards: Floats, *, u_point: float | None = None) -> ScanPlane:
    """Euler angles α and β from discrete points of the scan plane (Harris 2004 eq. 6).

    A fixed detector finds the plane; the scale readings at which the light falls on it span a plane parallel to it.

    ``readings``: (n, 3) scale readings, n ≥ 3, mm. ``towards``: (3,) roughly the way w points, out of the digitizer's back:
    three points do not tell it from its opposite. ``u_point``: standard uncertainty of a point along w, mm; needed for three
    points, else estimated when left out.
    """
    if len(readings) == 3 and u_point is None:
        problem = "three points leave nothing to estimate their uncertainty from"
        raise CmmUqError(problem, fix="Give u_point, or more points")
    plane = fit_plane(readings, u_point=u_point)
    across = float(plane.normal @ towards / np.linalg.norm(towards))
    if abs(across) < 0.1:
        fix = "Give roughly the way the digitizer's back points"
        raise CmmUqError("the direction of w lies in the scan plane", fix=fix)
    w = plane.normal * np.sign(across)
    level = w[0] ** 2 + w[1] ** 2
    if level < 1e-12:
        raise CmmUqError("w points along Z, so that α is not determined", fix="Use γ alone for this attitude")
    to_angles = np.array([[-w[1] / level, w[0] / level, 0.0], [0.0, 0.0, -1 / np.sqrt(level)]])
    alpha, beta = float(np.arctan2(w[0], -w[1])), float(np.arctan2(np.sqrt(level), w[2]))
    return ScanPlane(alpha, beta, to_angles @ plane.covariance[3:, 3:] @ to_angles.T)


def scan_roll(scan: Floats, readings: Floats, alpha: float, beta: float, nominal: float) -> float:
    """Euler angle γ in rad from the scan of a plane surface: the angle with which its points lie in one plane.

    ``scan``: (n, 2) u, v, mm. ``readings``: (n, 3) scale readings, mm. They must move in two directions, else γ and the
    surface's slope are one. ``alpha, beta``: rad. ``nominal``: γ as the wrist is indexed, rad; moves in two directions leave
    a second solution, half a turn away.
    """

    def placed(gamma: float) -> Floats:
        return np.asarray(scan @ euler_313(alpha, beta, gamma)[:, :2].T + readings)

    plane = fit_plane(placed(nominal), u_point=1.0)
    size = float(np.abs(readings - readings.mean(axis=0)).max()) or 1.0

    def linearise(state: Floats) -> Floats:
        gamma, n, d = state[0], state[1:4] / np.linalg.norm(state[1:4]), state[4]
        u, v, _ = euler_313(alpha, beta, gamma).T
        points = placed(gamma) - plane.point
        turned = scan[:, :1] * v - scan[:, 1:] * u
        across = frame_about(n)[:2]
        rows = [turned @ n, *(across @ points.T), np.full(len(points), -size), points @ n - d]
        return np.array(rows) / size

    def move(state: Floats, step: Floats) -> Floats:
        n = state[1:4] / np.linalg.norm(state[1:4])
        n = n + step[1:3] @ frame_about(n)[:2]
        return np.array([state[0] + step[0], *(n / np.linalg.norm(n)), state[4] + size * step[3]])

    found = minimise(np.array([nominal, *plane.normal, 0.0]), linearise, move, "roll of the scan plane")
    if found.condition > 1e6:
        fix = "Scan the plane while moving in two directions across it"
        raise CmmUqError("these motions do not determine γ", fix=fix)
    gamma = float(found.state[0])
    if abs(gamma - nominal) > np.pi / 12:
        problem = f"γ = {np.degrees(gamma):.2f}° from the scan, the wrist is indexed at {np.degrees(nominal):.2f}°"
        raise CmmUqError(problem, fix="Check the index of the wrist, and that every point lies on the plane")
    return gamma


def mount_axes(rotation: Floats) -> tuple[Floats, Floats, Floats]:
    """Axes X, Y, Z (each (3, n)) of the mount after its summed rotations (Harris 2004 eq. 29–32).

    Z follows from εX and εY, X from Z and εZ, Y is their cross product. The source prints −tan εZ in (30), which is a
    left-handed rotation and contradicts its own (11); here every rotation follows the right hand.

    ``rotation``: (3, n) sums of the carriages' rotations about X, Y, Z, rad (eq. 26–28).
    """
    tx, ty, tz = np.tan(rotation)
    Z = np.array([ty, -tx, np.ones_like(tx)])
    Z /= np.sqrt(ty * ty + tx * tx + 1)
    X = np.array([np.ones_like(tz), tz, tx * tz - ty])
    X /= np.sqrt(1 + tz * tz + X[2] * X[2])
    Y = np.array([Z[1] * X[2] - Z[2] * X[1], Z[2] * X[0] - Z[0] * X[2], Z[0] * X[1] - Z[1] * X[0]])
    return X, Y, Z


@dataclass(frozen=True, eq=False)
class Digitizer:
    """A laser digitizer in one pose on a machine."""

    attitude: Floats  # (3, 3); see :func:`euler_313`
    offset: Floats  # (3,) [U1 V1 W1], the mount in the digitizer's frame, mm
    compensation: Compensation  # of the machine; its origin is that of the scale readings, so usually 0

    def coordinates(
        self, scan: Floats, readings: Floats, temperatures: Floats | float | None = None
    ) -> tuple[Floats, NDArray[np.bool_]]:
        """True coordinates (n, 3), mm, of digitized points in the machine's home frame (Harris 2004 eq. 35).

        Also (n,) whether a point was extrapolated beyond the error maps. ``scan``: (n, 2) u, v in the scan plane, mm.
        ``readings``: (n, 3) scale readings D, E, F, mm. ``temperatures``: of the scales; see
        :meth:`cmm_uq.machine.physics.map_interpolation.ErrorMaps.at`.
        """
        n, when = len(readings), PointConditions(temperatures=temperatures)
        xyz, extrapolated = np.empty((n, 3)), np.empty(n, dtype=bool)
        for start in range(0, n, BLOCK):
            rows = slice(start, start + BLOCK)
            here = when.of(rows).temperatures
            looked_up = self._block(scan[rows], readings[rows], here, start + 1, xyz[rows])
            extrapolated[rows] = looked_up.extrapolated
        return xyz, extrapolated

    def tips(self, scan: Floats) -> Floats:
        """(n, 3) from the mount to points at u, v (n, 2) of the scan plane, along the machine's axes, mm."""
        return np.asarray((np.column_stack([scan, np.zeros(len(scan))]) - self.offset) @ self.attitude.T)

    def transform(
        self, temperatures_at: Callable[[Floats], Floats] | float | None = None
    ) -> Callable[[Floats], Floats]:
        """Function from rows u, v, D, E, F (and a time, where temperatures are a log) to coordinates (n, 3).

        ``temperatures_at``: temperatures (n, 3) at times (n,), such as :meth:`TemperatureLog.at`; or one temperature.
        """

        def coordinates(rows: Floats) -> Floats:
            given = temperatures_at(rows[:, 5]) if callable(temperatures_at) else temperatures_at
            return self.coordinates(rows[:, :2], rows[:, 2:5], given)[0]

        return coordinates

    def _block(
        self, scan: Floats, readings: Floats, temperatures: Floats | float | None, first: int, out: Floats
    ) -> LookedUp:
        # by components throughout, each of them contiguous
        D = np.ascontiguousarray((readings + np.asarray(self.compensation.origin)).T)
        u, v = np.ascontiguousarray(scan.T)
        looked_up = self.compensation.maps.at(D.T, temperatures, beyond=self.compensation.beyond, first=first)
        e = on_leaning_axes(D.T, looked_up.errors, looked_up.squareness, chain=self.compensation.chain).T
        X, Y, Z = mount_axes(looked_up.errors[:, :, 3:].sum(axis=1).T)
        E, mount = self.attitude, -self.attitude @ self.offset
        qx, qy, qz = (mount[i] + E[i, 0] * u + E[i, 1] * v for i in range(3))
        for i in range(3):
            np.add(readings[:, i] + e[i], X[i] * qx + Y[i] * qy + Z[i] * qz, out=out[:, i])
        return looked_up


@dataclass(frozen=True, eq=False)
class Alignment:
    alpha: float  # alpha, beta, gamma: Euler angles 3-1-3, rad
    beta: float
    gamma: float
    reading: Floats  # (3,) [D0 E0 F0], the scale reading with the scan plane's origin at the centre of the sphere, mm
    covariance: Floats  # (3, 3) of the reading, mm²

    @property
    def attitude(self) -> Floats:
        """(3, 3) columns u, v, w in machine axes."""
        return euler_313(self.alpha, self.beta, self.gamma)

    def from_sphere(self, scan: Floats, readings: Floats) -> Floats:
        """Coordinates (n, 3) relative to the reference sphere, as the digitizer reports them uncompensated (eq. 9, 14)."""
        return np.asarray(scan @ self.attitude[:, :2].T + readings - self.reading)


def align_on_sphere(
    scan: Floats, readings: Floats, alpha: float, beta: float, gamma: float, *, u_point: float | None = None
) -> Alignment:
    """Alignment from a scan of the reference sphere.

    The covariance is that of the fitted centre, σ²(JᵀJ)⁻¹; systematic lines (the ball's form, the scales) are added to it.

    ``scan``: (n, 2) u, v in the scan plane, mm. ``readings``: (n, 3) scale readings, mm. ``alpha, beta, gamma``: attitude,
    rad. ``u_point``: standard uncertainty of a point, mm; from the residuals when left out.
    """
    sphere = fit_sphere(scan @ euler_313(alpha, beta, gamma)[:, :2].T + readings, u_point=u_point)
    return Alignment(alpha, beta, gamma, sphere.centre, sphere.covariance[:3, :3])


@dataclass(frozen=True, eq=False)
class MountOffset:
    """Offset of the mount from the digitizer's origin, and the centre of the reference sphere."""

    offset: Floats  # (3,) [U1 V1 W1] in the digitizer's frame, mm
    sphere: Floats  # (3,) in the machine's home frame, mm
    covariance: Floats  # (6, 6) of offset and sphere, mm²
    residuals: Floats  # (m, 3) readings less those that offset and sphere give, mm
    chi_squared: float  # weighted sum of their squares
    degrees_of_freedom: int  # 3m − 6

    @property
    def u(self) -> Floats:
        """(3,) standard uncertainties of U1, V1, W1, mm."""
        return np.asarray(np.sqrt(np.diag(self.covariance)[:3]))


THREE_ATTITUDES = (
    "Align in three attitudes that differ by turns about two axes, such as γ = 0° and 90°, and α = 90° and 180°"
)


def mount_offset(alignments: Sequence[Alignment]) -> MountOffset:
    """Offset [U1 V1 W1] by weighted least squares over all components of all alignments (from eq. 16–18).

    Every alignment says D0 = S + E·[U1 V1 W1], S being the centre of the sphere.

    ``alignments``: three or more attitudes; two that turn about one axis only leave the offset along it unknown.
    """
    rows = np.vstack([np.hstack([a.attitude, np.eye(3)]) for a in alignments]) if alignments else np.zeros((0, 6))
    if len(rows) < 6 or np.linalg.matrix_rank(rows, tol=1e-6) < 6:
        problem = f"{len(alignments)} alignments do not determine the offset of the mount"
        raise CmmUqError(problem, fix=THREE_ATTITUDES)
    whitened, readings = [], []
    for alignment, block in zip(alignments, np.split(rows, len(alignments)), strict=True):
        try:
            root = np.linalg.cholesky(alignment.covariance)
        except np.linalg.LinAlgError:
            fix = "Give every reading an uncertainty"
            raise CmmUqError("the covariance of an alignment is not positive definite", fix=fix) from None
        whitened.append(np.linalg.solve(root, block))
        readings.append(np.linalg.solve(root, alignment.reading))
    A, y = np.vstack(whitened), np.concatenate(readings)
    Q, R = np.linalg.qr(A)
    found = np.linalg.solve(R, Q.T @ y)
    inverse = np.linalg.inv(R)
    misfit = y - A @ found
    residuals = np.array([a.reading for a in alignments]) - (rows @ found).reshape(-1, 3)
    return MountOffset(found[:3], found[3:], inverse @ inverse.T, residuals, float(misfit @ misfit), len(y) - 6)


def axes_of_scans(xyz: Floats, attitude: Floats, seen: Floats, start: MountOffset) -> tuple[Floats, Floats]:
    """Squarenesses (3,), rad, that make one sphere of all scans, and the offset (3,), mm, with them.

    Zero where those that a machine may have do not. ``xyz``: (n, 3) readings, mm; ``attitude``: (n, 3, 3);
    ``seen``: (n, 3) in the digitizer's frame, mm; ``start``: by the attitudes one by one, on square axes.
    """

    def left(p: Floats) -> Floats:
        true = xyz @ axis_directions(p[:3]) + np.einsum("nij,nj->ni", attitude, seen - p[3:6])
        return np.asarray(np.linalg.norm(true - p[6:9], axis=1) - p[9])

    about = np.concatenate([np.zeros(3), start.offset, start.sphere, [0.5 * np.ptp(seen)]])
    about[9] += left(about).mean()
    scatter = np.sqrt(np.mean(left(about) ** 2))
    if scatter < LEANS * about[9]:
        return np.zeros(3), start.offset
    found = scipy.optimize.least_squares(left, about, x_scale=np.repeat([0.01, 1.0], [3, 7]))
    lean, remains = np.abs(found.x[:3]).max(), np.sqrt(np.mean(found.fun**2))
    if lean > MOST_LEAN or remains > 0.1 * scatter:
        return np.zeros(3), start.offset
    return found.x[:3], found.x[3:6]


def three_alignment_offset(readings: Floats, u: Floats) -> tuple[Floats, Floats]:
    """Offset [U1 V1 W1] and its standard uncertainties by the closed form of Harris 2004 eq. 19–24, mm.

    It uses six of the nine equations with equal weight. The source prints u(U1) = 35.1 µm where (22) gives 15.9 µm.

    ``readings``: (3, 3) [D E F] of alignment 1 (α = β = 90°, γ = 0), 2 (the same, γ = 90°), 3 (α = 180°, β = 90°, γ = 0),
    mm. ``u``: (3,) standard uncertainties of D, E, F, mm.
    """
    (D1, E1, F1), (_, E2, F2), (D3, E3, _) = readings
    offset = 0.5 * np.array([E1 - E2 + F2 - F1, E1 - E2 - F2 + F1, D1 - D3 + E3 - E1])
    u_uv, u_w = np.sqrt(0.5 * (u[1] ** 2 + u[2] ** 2)), np.sqrt(0.5 * (u[0] ** 2 + u[1] ** 2))
    return offset, np.array([u_uv, u_uv, u_w])


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
            raise CmmUqError(
                f"{self.columns[column]} is no finite number", where=f"point {row + 1}", fix="Leave out the point"
            )
        temperatures = self._temperatures(rows)
        if POSE not in self.columns:
            (digitizer,) = self.poses.values()
            return self._joined(*digitizer.coordinates(rows[:, :2], rows[:, 2:5], temperatures))
        numbers = rows[:, self.columns.index(POSE)]
        xyz, extrapolated = np.empty((len(rows), 3)), np.empty(len(rows), dtype=bool)
        for number in np.unique(numbers):
            here = numbers == number
            if number not in self.poses:
                problem = f"pose {number:g} is not described"
                fix = f"Known: {', '.join(map(str, self.poses))}; add it to [machine] digitizer poses"
                raise CmmUqError(problem, where=f"point {np.flatnonzero(here)[0] + 1}", fix=fix)
            part = rows[here]
            given = temperatures[here] if temperatures is not None else None
            try:
                xyz[here], extrapolated[here] = self.poses[int(number)].coordinates(part[:, :2], part[:, 2:5], given)
            except CmmUqError as error:
                where = f"pose {number:g}, {error.where} of those in this pose"
                raise CmmUqError(error.problem, where=where, fix=error.fix) from error
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
        raise CmmUqError(
            f"has {own[0]}, and [machine] temperature_log gives it as well", where=where, fix="Leave out one of the two"
        )
    needed = [*DIGITIZER_COLUMNS, *([POSE] if poses > 1 or POSE in header else []), *([TIME] if logged else [])]
    needed += TEMPERATURES if own else ()
    missing = [name for name in needed if name not in header]
    if missing:
        raise CmmUqError(f"has no column {missing[0]}", where=where, fix=f"This cloud needs {', '.join(needed)}")
    return tuple(needed)
