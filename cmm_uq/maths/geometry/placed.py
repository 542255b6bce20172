"""Shapes of features with distances and their derivatives; a feature's own frame on the part, and back to what ISO calls it.

A feature stands near the origin of its own frame, its axis or normal along z. Its state says how far it has moved from
there: shifts across the axis, slopes of the axis, then sizes. Distances and derivatives are exact at any state, so that
least squares and minimum zones, of one measurement or of a million, share them. For round features they follow
Shakarji, J. Res. NIST 103 (1998) 633.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats
from cmm_uq.base.values import dataclass
from cmm_uq.maths.geometry.axial import fit_cone, fit_cylinder
from cmm_uq.maths.geometry.feature import Feature, centred, frame_about
from cmm_uq.maths.geometry.fits import fit_circle, fit_line, fit_plane, fit_sphere

Distances = Callable[[Floats, Floats], tuple[Floats, Floats]]


@dataclass(frozen=True)
class FeatureShape:
    name: str  # as messages call it
    least: int  # points that determine it
    slopes: tuple[int, ...]  # places in the state of slopes of axis or normal; the others are mm
    size: int | None  # place of the radius (of a cone the distance of its surface), None where there is no size
    distances: Distances  # of a state (N, k) and local points (d, N, n): distances (N, n) and derivatives (k, N, n)

    def normal_matrix(self, state: Floats, local: Floats) -> Floats:
        """(k, k) of the least-squares problem at the nominal state (k,) of points (d, n)."""
        J = self.distances(state[None], local[:, None])[1][:, 0]
        return np.asarray(J @ J.T)


class _LineInSpace(FeatureShape):
    def normal_matrix(self, state: Floats, local: Floats) -> Floats:
        """Of both components across the line: on the line itself the distance has no derivative, its square has."""
        one = np.array([np.ones(local.shape[1]), local[2]])
        return np.asarray(np.kron(one @ one.T, np.eye(2)))


def _column(state: Floats, i: int) -> Floats:
    return np.asarray(state[:, i, None])


def _flat(across: int) -> Distances:
    """Line in a plane (``across`` = 1) or plane (2): (z − c − a·x …)/√(1 + a² + …)."""

    def distances(state: Floats, local: Floats) -> tuple[Floats, Floats]:
        slopes = [_column(state, 1 + j) for j in range(across)]
        over = 1 + sum((a * a for a in slopes), start=np.zeros((len(state), 1)))
        root = 1 / np.sqrt(over)
        d = local[across] - _column(state, 0)
        for j, a in enumerate(slopes):
            d -= a * local[j]
        d *= root
        J = np.empty((1 + across, *d.shape))
        J[0] = -root
        for j, a in enumerate(slopes):
            np.multiply(local[j], -root, out=J[1 + j])
            J[1 + j] -= d * (a / over)
        return d, J

    return distances


def _ball(state: Floats, local: Floats) -> tuple[Floats, Floats]:
    """Circle in a plane, sphere: |p − c| − r."""
    dimension = len(local)
    J = np.empty((dimension + 1, *local.shape[1:]))
    for j in range(dimension):
        np.subtract(_column(state, j), local[j], out=J[j])
    d = np.sqrt(np.einsum("jbn,jbn->bn", J[:-1], J[:-1]))
    J[:-1] /= np.maximum(d, np.finfo(np.float64).tiny)
    J[-1] = -1.0
    d -= _column(state, dimension)
    return d, J


def _from_axis(state: Floats, local: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """Distance f from the axis through (cx, cy, 0) with slopes (a, b), height g along it, derivatives (4, N, n) of f, of g."""
    a, b = _column(state, 2), _column(state, 3)
    root = 1 / np.sqrt(1 + a * a + b * b)
    x, y = local[0] - _column(state, 0), local[1] - _column(state, 1)
    g = (a * x + b * y + local[2]) * root
    h = g * root
    x -= h * a
    y -= h * b
    z = local[2] - h
    f = np.sqrt(x * x + y * y + z * z)
    inverse = 1 / np.maximum(f, np.finfo(np.float64).tiny)
    of_f, of_g = np.empty((2, 4, *f.shape))
    np.multiply(x, -inverse, out=of_f[0])
    np.multiply(y, -inverse, out=of_f[1])
    np.multiply(of_f[:2], g * root, out=of_f[2:])
    of_g[0], of_g[1] = -a * root, -b * root
    np.multiply(x, root, out=of_g[2])
    np.multiply(y, root, out=of_g[3])
    return f, g, of_f, of_g


def _axis(state: Floats, local: Floats) -> tuple[Floats, Floats]:
    return _from_axis(state, local)[::2]


def _cylinder(state: Floats, local: Floats) -> tuple[Floats, Floats]:
    f, _, of_f, _ = _from_axis(state, local)
    return f - _column(state, 4), np.concatenate([of_f, np.full((1, *f.shape), -1.0)])


def _cone(state: Floats, local: Floats) -> tuple[Floats, Floats]:
    """f·cos ψ − g·sin ψ − s: s is the distance of the surface from the point (cx, cy, 0), ψ the half angle."""
    f, g, of_f, of_g = _from_axis(state, local)
    cos, sin = np.cos(_column(state, 5)), np.sin(_column(state, 5))
    turned = -f * sin - g * cos
    J = np.concatenate([cos * of_f - sin * of_g, np.full((1, *f.shape), -1.0), turned[None]])
    return f * cos - g * sin - _column(state, 4), J


LINE_IN_PLANE = FeatureShape("line", 2, (1,), None, _flat(1))
LINE = _LineInSpace("line", 2, (2, 3), None, _axis)
PLANE = FeatureShape("plane", 3, (1, 2), None, _flat(2))
CIRCLE = FeatureShape("circle", 3, (), 2, _ball)
SPHERE = FeatureShape("sphere", 4, (), 3, _ball)
CYLINDER = FeatureShape("cylinder", 5, (2, 3), 4, _cylinder)
CONE = FeatureShape("cone", 6, (2, 3, 5), 4, _cone)
BALLS, SIZED, STRAIGHT = (CIRCLE, SPHERE), (CIRCLE, SPHERE, CYLINDER), (PLANE, LINE_IN_PLANE)

FeatureKind = Literal["line", "plane", "circle", "sphere", "cylinder", "cone"]
KINDS: tuple[FeatureKind, ...] = get_args(FeatureKind)


@dataclass(frozen=True, eq=False)
class Placed:
    """A shape in a frame near which the points lie."""

    shape: FeatureShape
    origin: Floats  # (d,) of the frame, mm
    # (m, d) orthonormal rows; the last is the axis or normal, of a line in a plane the direction across it. Of a circle in
    # space there are two, so that its points are projected along the normal.
    frame: Floats
    state: Floats  # (k,) of the least-squares feature
    extent: float  # root mean square distance of the points from their centroid, mm: slopes are multiplied by it
    condition: float  # of the least-squares problem with columns of unit length

    def local(self, points: Floats) -> Floats:
        """(m, …, n) coordinates in the frame of points (…, n, d)."""
        return np.ascontiguousarray(np.moveaxis((points - self.origin) @ self.frame.T, -1, 0))

    def units(self) -> Floats:
        """(k,) what one unit of each component of a state moves points by, about: 1 of a length, the extent of a slope."""
        units = np.ones(len(self.state))
        units[list(self.shape.slopes)] = self.extent
        return units

    def position(self, state: Floats) -> Floats:
        """(N, d) of states (N, k): centre, where the axis pierces z = 0 of the frame, of a plane the point over the origin."""
        if self.shape in STRAIGHT:
            return np.asarray(self.origin + state[:, :1] * self.frame[-1])
        m = 3 if self.shape is SPHERE else 2
        return np.asarray(self.origin + state[:, :m] @ self.frame[:m])

    def direction(self, state: Floats) -> Floats | None:
        """(N, d) unit direction of axis or normal, of a line in a plane along it; None of a circle in it and of a sphere."""
        if self.shape in BALLS:
            return None
        slopes = -state[:, 1:] if self.shape in STRAIGHT else state[:, 2:4]
        w = slopes @ self.frame[: slopes.shape[1]] + self.frame[-1]
        if self.shape is LINE_IN_PLANE:  # along the line: the direction across it, turned clockwise
            w = w @ np.array([[0.0, -1.0], [1.0, 0.0]])
        return np.asarray(w / np.linalg.norm(w, axis=1, keepdims=True))

    def size(self, state: Floats) -> Floats | None:
        """(N,) diameter, mm; of a cone at its position."""
        if self.shape.size is None:
            return None
        radius = state[:, self.shape.size]
        return np.asarray(2 * radius / np.cos(state[:, 5]) if self.shape is CONE else 2 * radius)

    def half_angle(self, state: Floats) -> Floats | None:
        return np.asarray(state[:, 5]) if self.shape is CONE else None


def placed(kind: FeatureKind, points: ArrayLike) -> Placed:
    """The least-squares feature of points (n, d), and its frame."""
    array = np.asarray(points, dtype=np.float64)
    match kind:
        case "line":
            line = fit_line(array, u_point=1.0)
            if array.shape[1] == 2:
                frame = np.array([line.direction, [-line.direction[1], line.direction[0]]])
                return _about(LINE_IN_PLANE, array, line, line.point, frame, [0, 0])
            return _about(LINE, array, line, line.point, frame_about(line.direction), [0, 0, 0, 0])
        case "plane":
            plane = fit_plane(array, u_point=1.0)
            return _about(PLANE, array, plane, plane.point, frame_about(plane.normal), [0, 0, 0])
        case "circle":
            circle = fit_circle(array, u_point=_scatter(array, CIRCLE))
            frame = np.eye(2) if circle.normal is None else frame_about(circle.normal)[:2]
            return _about(CIRCLE, array, circle, circle.centre, frame, [0, 0, circle.radius])
        case "sphere":
            sphere = fit_sphere(array, u_point=_scatter(array, SPHERE))
            return _about(SPHERE, array, sphere, sphere.centre, np.eye(3), [0, 0, 0, sphere.radius])
        case "cylinder":
            cylinder = fit_cylinder(array, u_point=_scatter(array, CYLINDER))
            frame, state = frame_about(cylinder.direction), [0, 0, 0, 0, cylinder.radius]
            return _about(CYLINDER, array, cylinder, cylinder.point, frame, state)
        case "cone":
            cone = fit_cone(array, u_point=_scatter(array, CONE))
            state = [0, 0, 0, 0, cone.radius * np.cos(cone.half_angle), cone.half_angle]
            return _about(CONE, array, cone, cone.point, frame_about(cone.direction), state)
    raise CmmUqError(f"{kind!r} is no feature", fix=f"Features are {', '.join(KINDS)}")


def _scatter(points: Floats, shape: FeatureShape) -> float | None:
    """Uncertainty of a point to be given to the fit: a millionth where no more points than needed leave it to be given."""
    if points.ndim != 2 or len(points) != shape.least or not np.isfinite(points).all():
        return None
    return 1e-6 * (centred(points)[2] or 1.0)


def _about(
    shape: FeatureShape, points: Floats, fit: Feature, origin: Floats, frame: Floats, state: Sequence[float]
) -> Placed:
    return Placed(
        shape, np.asarray(origin), frame, np.array(state, dtype=np.float64), centred(points)[2], fit.condition
    )
