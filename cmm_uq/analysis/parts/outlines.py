"""Features as lines that can be drawn: circles about an axis, generators, the border of what is probed of a plane.

Lines are as a view along one direction shows them, so that the generators of a cylinder are those at its edge.
"""

from __future__ import annotations

import numpy as np

from cmm_uq.analysis.parts.plan import PartFeature
from cmm_uq.base.points import Floats
from cmm_uq.maths.geometry.feature import frame_about

_STEPS = 48  # of a circle
_ALONG = 1e-6  # sine of the angle to the view below which an axis is seen end on
_FLAT = 1e-9  # of the size of a set of points, below which it has no second direction


def outline(feature: PartFeature, view: Floats) -> list[Floats]:
    """Polylines (m, 3) of a nominal feature as far as it is probed; none of a point.

    ``view``: (3,) direction along which one looks.
    """
    points, nominal = feature.points, feature.nominal
    if nominal.direction is None:
        radius = 0.5 * (nominal.diameter_mm or 0.0)
        return [_ring(nominal.point, view, radius)] if radius else []
    axis = nominal.direction
    if nominal.diameter_mm is None or feature.kind in ("line", "plane"):
        return [_border(points, axis)] if feature.kind == "plane" else [_ends(points, axis)]
    along = (points - nominal.point) @ axis
    ends = [nominal.point + at * axis for at in (along.min(), along.max())]
    slope = np.tan(nominal.half_angle_rad or 0.0)
    radii = [0.5 * nominal.diameter_mm + slope * at for at in (along.min(), along.max())]
    if feature.kind == "circle":
        return [_ring(nominal.point, axis, radii[0])]
    rings = [_ring(end, axis, radius) for end, radius in zip(ends, radii, strict=True)]
    across = np.cross(axis, view)
    size = float(np.linalg.norm(across))
    if size < _ALONG:
        return rings
    sides = [np.array([end + sign * radius * across / size for end, radius in zip(ends, radii, strict=True)])
             for sign in (-1.0, 1.0)]  # fmt: skip
    return [*rings, *sides]


def _ring(centre: Floats, axis: Floats, radius: float) -> Floats:
    angle = np.linspace(0.0, 2 * np.pi, _STEPS + 1)
    one, other = frame_about(axis / np.linalg.norm(axis))[:2]
    return np.asarray(centre + radius * (np.outer(np.cos(angle), one) + np.outer(np.sin(angle), other)))


def _ends(points: Floats, axis: Floats) -> Floats:
    along = points @ axis
    return points[[int(along.argmin()), int(along.argmax())]]


def _border(points: Floats, normal: Floats) -> Floats:
    """The convex border of points on a plane, closed."""
    flat = (points - points.mean(axis=0)) @ frame_about(normal)[:2].T
    _, spread, along = np.linalg.svd(flat, full_matrices=False)
    if spread[-1] <= _FLAT * max(float(spread[0]), _FLAT):
        return _ends(points, along[0] @ frame_about(normal)[:2])
    from scipy.spatial import ConvexHull

    corners = ConvexHull(flat).vertices
    return points[[*corners, corners[0]]]
