"""A feature's own frame on the part: from measured points to the state of its shape, and back to what ISO calls it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats
from cmm_uq.maths.geometry.axial import fit_cone, fit_cylinder
from cmm_uq.maths.geometry.feature import Feature, centred, frame_about
from cmm_uq.maths.geometry.fits import fit_circle, fit_line, fit_plane, fit_sphere
from cmm_uq.maths.geometry.minimax import CIRCLE, CONE, CYLINDER, LINE, LINE_IN_PLANE, PLANE, SPHERE, FeatureShape

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
        if self.shape in (PLANE, LINE_IN_PLANE):
            return np.asarray(self.origin + state[:, :1] * self.frame[-1])
        m = 3 if self.shape is SPHERE else 2
        return np.asarray(self.origin + state[:, :m] @ self.frame[:m])

    def direction(self, state: Floats) -> Floats | None:
        """(N, d) unit direction of axis or normal, of a line in a plane along it; None of a circle in it and of a sphere."""
        if self.shape in (CIRCLE, SPHERE):
            return None
        slopes = -state[:, 1:] if self.shape in (PLANE, LINE_IN_PLANE) else state[:, 2:4]
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
