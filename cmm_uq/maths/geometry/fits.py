"""Least-squares lines, planes, circles and spheres; the narrowest parallels, and a search for narrower rings or shells.

Of every fit ``points`` are (n, 3), mm, of lines and circles also (n, 2), and ``u_point`` is the standard uncertainty of a
point along the normal, mm, of lines and circles in space in either direction: estimated from the residuals when left out.

The least distance of two parallels that hold all points comes from their convex hull: in a plane one of the lines runs along
an edge of it; in space the planes touch a face and a corner, or two edges that face each other (M. E. Houle & G. T. Toussaint,
IEEE Trans. PAMI 10 (1988) 761). All of these are looked at, so that the narrowest is the narrowest of all.

With the centre c of a ring moved by δ, distances change by at most |δ|, so a box of half width h about c holds no ring
narrower than that about c less 2·h·√d. Far away a ring is nearly a strip, and no narrower than the points are wide. Next to a
ring that is held by its contact points it is their multipliers that exclude a narrower one: see :func:`safe_radius`. What is
left are boxes between, halved until each is excluded, or holds a narrower ring. Whatever some of the points exclude, all of
them do, so that of many points a sample is looked at.
"""

from __future__ import annotations

from itertools import combinations, product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats, Ints
from cmm_uq.base.values import dataclass
from cmm_uq.maths.geometry import feature
from cmm_uq.maths.geometry.feature import Feature, Minimum, minimise, minimum_at, prepared, principal


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
    """Line through at least two points that do not coincide."""
    about, centroid, extent = prepared(points, "line", 2, (2, 3), extended=1)
    if extent == 0:
        raise CmmUqError("line: all points are in one place", fix="Measure points that spread along the line")
    direction = feature.upward(principal(about)[0])
    # (d − 1, d) unit vectors across it
    across = np.array([[-direction[1], direction[0]]]) if len(direction) == 2 else feature.frame_about(direction)[:2]
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
    """Plane through at least three points, not on one line."""
    about, centroid, extent = prepared(points, "plane", 3)
    frame = feature.frame_about(feature.upward(principal(about)[2]))
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
    normals = (np.asarray(hull.equations[:, :2]) if len(local) == 2 else _hull_normals(stretched, hull)) / spread
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    parts = np.array_split(normals, len(normals) // 4096 + 1)
    widths = np.concatenate([np.ptp(part @ local, axis=1) for part in parts])
    best = int(np.argmin(widths))
    return np.asarray(normals[best] @ frame), float(widths[best])


def _hull_normals(points: Floats, hull: Any) -> Floats:
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


@dataclass(frozen=True, eq=False, kw_only=True)
class Sphere(Feature):
    """Least-squares sphere; the covariance is of x, y, z of the centre and r."""

    centre: Floats
    radius: float


def fit_sphere(points: ArrayLike, *, u_point: float | None = None) -> Sphere:
    """Sphere through at least four points, not all in one plane; refused where a cap leaves the radius open."""
    about, centroid, extent = prepared(points, "sphere", 4, extended=3)
    found = radial_minimum(about, "sphere")
    centre, radius = centroid + extent * found.state[:3], float(extent * found.state[3])
    figures = found, extent, "x y z r", extent * np.eye(4), u_point
    return feature.with_known_radius(Sphere.of_minimum(*figures, centre=centre, radius=radius), radius)


def radial_minimum(about: Floats, what: str) -> Minimum[Floats]:
    """Centre and radius (d + 1,) for centred points (d, n): circle in a plane (d = 2) or sphere (d = 3)."""
    dimension, n = about.shape

    def linearise(state: Floats) -> Floats:
        rows = np.empty((dimension + 2, n))
        np.subtract(state[:-1, None], about, out=rows[:-2])
        distance = np.sqrt(np.einsum("ij,ij->j", rows[:-2], rows[:-2]))
        rows[:-2] /= np.maximum(distance, np.finfo(np.float64).tiny)
        rows[-2] = -1.0
        np.subtract(distance, state[-1], out=rows[-1])
        return rows

    # start from |p|² = 2c·p + r² − |c|², linear in c
    squares = np.einsum("ij,ij->j", about, about)
    centre = 0.5 * np.linalg.lstsq(about @ about.T, about @ squares, rcond=None)[0]
    return minimise(np.append(centre, np.sqrt(squares.mean() + centre @ centre)), linearise, np.add, what)


@dataclass(frozen=True, eq=False, kw_only=True)
class Circle(Feature):
    """Least-squares circle.

    In a plane the covariance is of x, y of the centre and r, and there is no normal. In space it is of x, y, z, the
    components nx, ny, nz of the unit normal, whose largest is positive, and r; residuals are then (n, 2): radial, and
    along the normal.
    """

    centre: Floats
    radius: float
    normal: Floats | None

    @property
    def form_deviation(self) -> float:
        """Roundness deviation: peak to valley of the radial distances, mm."""
        radial = self.residuals if self.residuals.ndim == 1 else self.residuals[:, 0]
        return float(np.ptp(radial))


def fit_circle(points: ArrayLike, *, u_point: float | None = None) -> Circle:
    """Circle through at least three points, not on one line."""
    about, centroid, extent = prepared(points, "circle", 3, (2, 3))
    if len(about) == 3:
        circle = _circle_in_space(about, centroid, extent, u_point)
    else:
        found = radial_minimum(about, "circle")
        centre, radius = centroid + extent * found.state[:2], float(extent * found.state[2])
        figures = found, extent, "x y r", extent * np.eye(3), u_point
        circle = Circle.of_minimum(*figures, centre=centre, radius=radius, normal=None)
    return feature.with_known_radius(circle, circle.radius)


class _Placed(NamedTuple):
    """A circle's frame (its normal last), centre and radius."""

    frame: Floats
    centre: Floats
    radius: float


def _circle_in_space(about: Floats, centroid: Floats, extent: float, u_point: float | None) -> Circle:
    n = about.shape[1]

    def linearise(state: _Placed) -> Floats:
        x, y, z = state.frame @ (about - state.centre[:, None])
        rho = np.hypot(x, y)
        ex, ey = x / rho, y / rho
        none = np.zeros(n)
        # step: centre along u, v, w; tilts of w to u and v; radius. First the radial distances, then those along w
        radial = [-ex, -ey, none, -z * ex, -z * ey, np.full(n, -1.0), rho - state.radius]
        axial = [none, none, np.full(n, -1.0), x, y, none, z]
        return np.hstack([radial, axial])

    def move(state: _Placed, step: Floats) -> _Placed:
        centre = state.centre + step[:3] @ state.frame
        return _Placed(feature.tilted(state.frame, step[3], step[4]), centre, float(state.radius + step[5]))

    frame = feature.frame_about(feature.upward(principal(about)[2]))
    flat = radial_minimum((frame @ about)[:2], "circle")
    start = _Placed(frame, flat.state[:2] @ frame[:2], float(flat.state[2]))
    found = minimise(start, linearise, move, "circle")
    placed = found.state
    natural = np.zeros((7, 6))
    natural[:3, :3] = extent * placed.frame.T
    natural[3:6, 3:5] = placed.frame[:2].T
    natural[6, 5] = extent
    centre, radius = centroid + extent * placed.centre, float(extent * placed.radius)
    figures = found, extent, "x y z nx ny nz r", natural, u_point, 2
    return Circle.of_minimum(*figures, centre=centre, radius=radius, normal=placed.frame[2])


MOST_BOXES, SAMPLE = 200_000, 100


def safe_radius(gradients: Floats, nearest: float) -> float:
    """Distance from the centre within which no other has a narrower ring, mm.

    Some contact's distance, linearised, rises by κ times the move at least, κ being the distance from zero to the surface
    of the hull of the contacts' gradients; against their curvature, below 1/(nearest − δ), that suffices up to
    δ = 2κ·(nearest − δ).

    ``gradients``: (p, d + 1) of the contacts with respect to centre and mean radius, signed as they hold the zone.
    ``nearest``: distance of the nearest point from the centre, mm.
    """
    from scipy.spatial import ConvexHull, QhullError

    if len(gradients) <= gradients.shape[1]:
        return 0.0
    try:
        kappa = -float(ConvexHull(gradients).equations[:, -1].max())
    except QhullError:
        return 0.0
    return 2 * kappa * nearest / (1 + 2 * kappa) if kappa > 0 else 0.0


def narrower(
    points: Floats, width: float, centre: Floats, safe: float, contacts: Ints | None = None
) -> tuple[bool, Floats | None]:
    """Whether the search came to an end, and a centre (d,) with a ring narrower than ``width``, mm, if there is one.

    ``points``: (n, d). ``centre``: (d,) of the ring found, within ``safe`` of which there is no narrower one.
    """
    sample = points[:: len(points) // SAMPLE + 1]
    if contacts is not None:
        sample = np.concatenate([sample, points[contacts]])
    middle = points.mean(axis=0)
    largest = float(np.linalg.norm(points - middle, axis=1).max())
    strip = narrowest(sample)[1]
    if strip <= width * (1 + 1e-9):
        return False, None
    reach = largest + largest**2 / (strip - width)
    d = points.shape[1]
    boxes, half, seen = middle[None], reach, 0
    corners = np.array(list(product((-0.5, 0.5), repeat=d)))
    smaller = width - 1e-12 * largest
    while len(boxes):
        seen += len(boxes)
        if seen > MOST_BOXES:
            return False, None
        widths = _ring_widths(sample, boxes)
        best = int(np.argmin(widths))
        if widths[best] < smaller and _ring_widths(points, boxes[best : best + 1])[0] < smaller:
            return True, boxes[best]
        diagonal = half * np.sqrt(d)
        open_ = (widths - 2 * diagonal < smaller) & (np.linalg.norm(boxes - centre, axis=1) + diagonal > safe)
        boxes = (boxes[open_, None] + half * corners).reshape(-1, d)
        half /= 2
    return True, None


def _ring_widths(points: Floats, centres: Floats) -> Floats:
    parts = np.array_split(centres, len(centres) * len(points) // 1_000_000 + 1)
    return np.concatenate([np.ptp(np.linalg.norm(points - part[:, None], axis=2), axis=1) for part in parts])


def largest_empty(points: Floats) -> tuple[Floats, float] | None:
    """Centre (d,) and radius of the largest circle or sphere that holds none of the points (n, d) and is held by them.

    Its centre is a corner of the Voronoi diagram, inside the triangle or tetrahedron of the points that it touches; all of
    those are looked at. None where the points surround no such centre.
    """
    from scipy.spatial import Delaunay, QhullError

    try:
        simplices = np.asarray(Delaunay(points).simplices)
    except QhullError:
        return None
    corners = points[simplices]
    edges = corners[:, 1:] - corners[:, :1]
    regular = np.abs(np.linalg.det(edges)) > 1e-14 * np.linalg.norm(edges, axis=2).prod(axis=1)
    corners, edges = corners[regular], edges[regular]
    squares = 0.5 * np.einsum("sij,sij->si", edges, edges)
    offset = np.linalg.solve(edges, squares[:, :, None])[:, :, 0]
    share = np.linalg.solve(edges.transpose(0, 2, 1), offset[:, :, None])[:, :, 0]
    surrounded = (share >= -1e-9).all(axis=1) & (share.sum(axis=1) <= 1 + 1e-9)
    if not surrounded.any():
        return None
    radii = np.where(surrounded, np.linalg.norm(offset, axis=1), -1.0)
    best = int(np.argmax(radii))
    return corners[best, 0] + offset[best], float(radii[best])


def enclosing_diameter(points: Floats) -> float:
    """Of the smallest sphere that holds points (n, 3), through two, three or four of them, in their unit; 0 of a single one.

    The point that lies farthest outside the smallest sphere of some joins them, until none lies outside.
    """
    slack = 1e-9 * (float(np.ptp(points, axis=0).max()) + np.finfo(float).tiny)
    held = [0]
    while True:
        centre, radius, held = _smallest_sphere(points, held, slack)
        away = np.linalg.norm(points - centre, axis=1)
        farthest = int(np.argmax(away))
        if away[farthest] <= radius + slack or farthest in held:
            return 2 * radius
        held.append(farthest)


def _smallest_sphere(points: Floats, some: list[int], slack: float) -> tuple[Floats, float, list[int]]:
    """Centre and radius of the smallest sphere through some of these points that holds them all, and those that hold it."""
    found = points[some[0]], np.inf, some
    for count in range(1, min(len(some), 4) + 1):
        for chosen in combinations(some, count):
            first, others = points[chosen[0]], points[list(chosen[1:])] - points[chosen[0]]
            away = np.linalg.lstsq(2 * others, np.sum(others**2, axis=1), rcond=None)[0] if count > 1 else np.zeros(3)
            centre, radius = first + away, float(np.linalg.norm(away))
            holds = np.all(np.linalg.norm(points[some] - centre, axis=1) <= radius + slack)
            if holds and radius < found[1]:
                found = centre, radius, list(chosen)
    return found
