"""Whether another centre has a narrower ring or shell: a search that leaves out no place where one could be.

With the centre c moved by δ, distances change by at most |δ|, so a box of half width h about c holds no ring narrower than
that about c less 2·h·√d. Far away a ring is nearly a strip, and no narrower than the points are wide. Next to a ring that is
held by its contact points it is their multipliers that exclude a narrower one: see :func:`safe_radius`. What is left are
boxes between, halved until each is excluded, or holds a narrower ring. Whatever some of the points exclude, all of them do,
so that of many points a sample is looked at.
"""

from __future__ import annotations

from itertools import product

import numpy as np

from cmm_uq.base.points import Floats, Ints
from cmm_uq.maths.geometry.width import narrowest

MOST_BOXES = 200_000
SAMPLE = 100


def safe_radius(gradients: Floats, nearest: float) -> float:
    """Distance from the centre within which no other has a narrower ring, mm.

    Some contact's distance, linearised, rises by κ times the move at least, κ being the distance from zero to the surface
    of the hull of the contacts' gradients; against their curvature, below 1/(nearest − δ), that suffices up to
    δ = 2κ·(nearest − δ).

    Parameters
    ----------
    gradients : (p, d + 1) of the contacts with respect to centre and mean radius, signed as they hold the zone.
    nearest : distance of the nearest point from the centre, mm.
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

    Parameters
    ----------
    points : (n, d).
    centre : (d,) of the ring found, within ``safe`` of which there is no narrower one.
    contacts : rows of the points that hold it.
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
