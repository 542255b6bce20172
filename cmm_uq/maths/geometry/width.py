"""The least distance of two parallel lines or planes that hold all points: exact, from their convex hull.

In a plane one of the lines runs along an edge of the hull; in space the planes touch a face and a corner, or two edges
that face each other (M. E. Houle & G. T. Toussaint, IEEE Trans. PAMI 10 (1988) 761). All of these are looked at, so
that the narrowest is the narrowest of all.
"""

from __future__ import annotations

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats, Ints
from cmm_uq.maths.geometry.orthogonal_distance import principal

LENIENT = 1e-9
"""Edges count as facing each other within this: a pair too many is looked at in vain, a pair too few would be missed."""

FLAT = 1e-13
"""Share of the extent below which the points lie in the plane or on the line to rounding."""

CHUNK = 256
MOST_EDGES = 5000
"""Of a hull: points about a plane have a few hundred."""


def narrowest(points: Floats) -> tuple[Floats, float]:
    """Unit normal (d,) and distance, mm, of the narrowest pair of parallel lines (d = 2) or planes (3) about points (n, d)."""
    about = (points - points.mean(axis=0)).T
    frame = principal(about)
    local = frame @ about
    spread = np.ptp(local, axis=1)
    if spread[-1] <= FLAT * spread[0]:
        return np.asarray(frame[-1]), float(spread[-1])
    # stretching keeps faces, edges and which of them face each other, and lets the hull be found without merging
    stretched = (local / spread[:, None]).T
    normals = _in_plane(stretched) if len(local) == 2 else _in_space(stretched)
    normals = normals / spread
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    widths = np.concatenate(
        [np.ptp(part @ local, axis=1) for part in np.array_split(normals, len(normals) // 4096 + 1)]
    )
    best = int(np.argmin(widths))
    return np.asarray(normals[best] @ frame), float(widths[best])


def _in_plane(points: Floats) -> Floats:
    """(m, 2) normals of the hull's edges."""
    from scipy.spatial import ConvexHull

    return np.asarray(ConvexHull(points).equations[:, :2])


def _in_space(points: Floats) -> Floats:
    """(m, 3) normals of the hull's faces and of pairs of edges that face each other."""
    from scipy.spatial import ConvexHull

    hull = ConvexHull(points)
    faces = np.asarray(hull.equations[:, :3])
    ends, beside = _edges(np.asarray(hull.simplices, dtype=np.int64), np.asarray(hull.neighbors, dtype=np.int64))
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


def _edges(faces: Ints, neighbours: Ints) -> tuple[Ints, Ints]:
    """Corners (e, 2) of the edges of triangles, and the faces (e, 2) at each."""
    ends, beside = [], []
    for j in range(3):
        two = np.delete(faces, j, axis=1)
        ends.append(two)
        beside.append(np.column_stack([np.arange(len(faces)), neighbours[:, j]]))
    all_ends, all_beside = np.concatenate(ends), np.concatenate(beside)
    once = all_beside[:, 0] < all_beside[:, 1]
    return all_ends[once], all_beside[once]
