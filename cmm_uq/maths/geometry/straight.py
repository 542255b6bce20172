"""Least-squares lines and planes, and the least distance of two parallels that hold all points, from their convex hull.

In a plane one of the lines runs along an edge of the hull; in space the planes touch a face and a corner, or two edges
that face each other (M. E. Houle & G. T. Toussaint, IEEE Trans. PAMI 10 (1988) 761). All of these are looked at, so
that the narrowest is the narrowest of all.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats
from cmm_uq.maths.geometry.feature import Feature, frame_about, prepared, upward
from cmm_uq.maths.geometry.orthogonal_distance import minimum_at, principal


@dataclass(frozen=True, eq=False, kw_only=True)
class Line(Feature):
    """Least-squares line through the centroid of its points.

    The covariance is of the coordinates of that point, which is free across the line only, and of the components of the
    unit direction, whose largest is positive. Residuals are (n,) in a plane, (n, 2) in space: two directions across it.
    """

    point: Floats
    direction: Floats

    @property
    def form_deviation(self) -> float:
        """In a plane peak to valley, in space the diameter of the cylinder about the line that holds all points, mm."""
        if self.residuals.ndim == 1:
            return float(np.ptp(self.residuals))
        return float(2 * np.linalg.norm(self.residuals, axis=1).max())


def fit_line(points: ArrayLike, *, u_point: float | None = None) -> Line:
    """Line through at least two points that do not coincide.

    ``points``: (n, 3) or (n, 2) in mm. ``u_point``: standard uncertainty of a point across the line in each direction, mm;
    estimated when left out.
    """
    about, centroid, extent = prepared(points, "line", 2, (2, 3), extended=1)
    if extent == 0:
        raise CmmUqError("line: all points are in one place", fix="Measure points that spread along the line")
    direction = upward(principal(about)[0])
    # (d − 1, d) unit vectors across it
    across = np.array([[-direction[1], direction[0]]]) if len(direction) == 2 else frame_about(direction)[:2]
    along, offsets = direction @ about, across @ about
    k = len(across)
    rows = np.zeros((2 * k + 1, k, about.shape[1]))
    for i in range(k):
        rows[i, i], rows[k + i, i] = -1.0, -along
    rows[-1] = offsets
    found = minimum_at(direction, rows.reshape(2 * k + 1, -1), "line")
    natural = np.asarray(np.kron(np.diag([extent, 1.0]), across.T), dtype=np.float64)
    names = "x y dx dy" if k == 1 else "x y z dx dy dz"
    return Line.of_minimum(found, extent, names, natural, u_point, k, point=centroid, direction=direction)


@dataclass(frozen=True, eq=False, kw_only=True)
class Plane(Feature):
    """Least-squares plane through the centroid of its points.

    The covariance is of x, y, z of that point, which is free along the normal only, and of the components nx, ny, nz of
    the unit normal. The normal's largest component is positive.
    """

    point: Floats
    normal: Floats


def fit_plane(points: ArrayLike, *, u_point: float | None = None) -> Plane:
    """Plane through at least three points, not on one line.

    ``points``: (n, 3) in mm. ``u_point``: standard uncertainty of a point along the normal, mm; estimated from the residuals
    when left out.
    """
    about, centroid, extent = prepared(points, "plane", 3)
    frame = frame_about(upward(principal(about)[2]))
    x, y, z = frame @ about
    found = minimum_at(frame, np.array([x, y, np.full(len(x), -1.0), z]), "plane")
    natural = np.zeros((6, 3))
    natural[3:, :2] = frame[:2].T
    natural[:3, 2] = extent * frame[2]
    return Plane.of_minimum(found, extent, "x y z nx ny nz", natural, u_point, point=centroid, normal=frame[2])


# edges count as facing each other within this: a pair too many is looked at in vain, a pair too few would be missed
LENIENT = 1e-9
FLAT = 1e-13  # share of the extent below which the points lie in the plane or on the line to rounding
CHUNK = 256
MOST_EDGES = 5000  # of a hull: points about a plane have a few hundred


def narrowest(points: Floats) -> tuple[Floats, float]:
    """Unit normal (d,) and distance, mm, of the narrowest pair of parallel lines (d = 2) or planes (3) about points (n, d)."""
    from scipy.spatial import ConvexHull

    about = (points - points.mean(axis=0)).T
    frame = principal(about)
    local = frame @ about
    spread = np.ptp(local, axis=1)
    if spread[-1] <= FLAT * spread[0]:
        return np.asarray(frame[-1]), float(spread[-1])
    # stretching keeps faces, edges and which of them face each other, and lets the hull be found without merging
    stretched = (local / spread[:, None]).T
    hull = ConvexHull(stretched)
    normals = (np.asarray(hull.equations[:, :2]) if len(local) == 2 else _in_space(stretched, hull)) / spread
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    parts = np.array_split(normals, len(normals) // 4096 + 1)
    widths = np.concatenate([np.ptp(part @ local, axis=1) for part in parts])
    best = int(np.argmin(widths))
    return np.asarray(normals[best] @ frame), float(widths[best])


def _in_space(points: Floats, hull: Any) -> Floats:
    """(m, 3) normals of the hull's faces and of pairs of edges that face each other."""
    faces, corners = np.asarray(hull.equations[:, :3]), np.asarray(hull.simplices, dtype=np.int64)
    # corners (e, 2) of the edges of the triangles, and the faces (e, 2) at each
    ends = np.concatenate([np.delete(corners, j, axis=1) for j in range(3)])
    neighbours = np.asarray(hull.neighbors, dtype=np.int64).T.ravel()
    beside = np.column_stack([np.tile(np.arange(len(corners)), 3), neighbours])
    once = beside[:, 0] < beside[:, 1]
    ends, beside = ends[once], beside[once]
    if len(ends) > MOST_EDGES:
        raise CmmUqError("plane: the points lie about no plane", fix="Measure one flat surface at a time")
    edges, one, other = points[ends[:, 1]] - points[ends[:, 0]], faces[beside[:, 0]], faces[beside[:, 1]]
    sense = np.sign(np.einsum("ij,ij->i", np.cross(one, other), edges))
    found = [faces]
    for i in range(0, len(edges), CHUNK):
        part = slice(i, i + CHUNK)
        n = np.cross(edges[part, None], edges[None])
        size = np.linalg.norm(n, axis=2, keepdims=True)
        n = n / np.maximum(size, np.finfo(np.float64).tiny)
        mine = _between(n, one[part, None], other[part, None], edges[part, None], sense[part, None])
        theirs = _between(n, one[None], other[None], edges[None], sense[None])
        facing = ((mine > 0) & (theirs < 0)) | ((mine < 0) & (theirs > 0))
        found.append(n[facing & (size[:, :, 0] > 0)])
    return np.concatenate(found)


def _between(n: Floats, one: Floats, other: Floats, edge: Floats, sense: Floats) -> Floats:
    """1 where normals n lie on the arc between those of the two faces at an edge, −1 where −n does, else 0."""
    a = np.einsum("...i,...i->...", np.cross(one, n), edge) * sense
    b = np.einsum("...i,...i->...", np.cross(n, other), edge) * sense
    length = np.linalg.norm(edge, axis=-1) * LENIENT
    toward = np.einsum("...i,...i->...", n, one + other)
    inside = ((a >= -length) & (b >= -length)) | ((a <= length) & (b <= length))
    return np.asarray(np.where(inside, np.sign(toward), 0.0))
