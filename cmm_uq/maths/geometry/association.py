"""Association of a feature with measured points, by least squares or as a zone, an extreme size or a datum asks for it.

One question, :func:`associate`, and one answer, :class:`Associated`, for every feature of ISO 17450-1 and every criterion of
ISO 1101, ISO 5459 and ISO 14405-1 that this room knows. What is proved of an answer it says itself (``gap``): each starts at
the least-squares feature, descends, and is held by contact points, which proves a local optimum; what excludes every other is
the convex hull for straightness in a plane and flatness, a search without gaps for rings and shells, the Voronoi diagram for
inscribed, and convexity for circumscribed circles and spheres.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from itertools import chain
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats, Ints
from cmm_uq.base.values import dataclass, replace
from cmm_uq.maths.geometry.fits import largest_empty, narrower, narrowest, safe_radius
from cmm_uq.maths.geometry.minimax import Extremum, least_largest
from cmm_uq.maths.geometry.placed import BALLS, CYLINDER, LINE, PLANE, SIZED, STRAIGHT, FeatureKind, Placed, placed

ROUNDING = 4 * float(np.finfo(np.float64).eps)  # of distances, as a share of the coordinates
PERFECT = 1e4 * ROUNDING  # share of the coordinates below which contact points cannot be told from their neighbours
SAME = 1e-9  # mm: two ways to the same optimum agree within this
LEANING = 1e-6  # cosine between the normals of least squares and of the narrowest zone: they are across each other
_NONE = np.zeros(0, dtype=np.int64)


@dataclass(frozen=True, eq=False)
class Extreme:
    state: Floats  # (k,) of the feature
    contacts: Ints
    multipliers: Floats
    gap: float  # see :class:`Associated`


@dataclass(frozen=True, eq=False)
class _Problem:
    """Rows in units of the form: a row is a point on one side, ``sides`` (m,) of them ±1 after each other."""

    of: Placed
    local: Floats
    sides: Floats
    sized: bool
    scale: float

    def state(self, s: Floats) -> Floats:
        free = len(s)
        state = self.of.state.copy()
        state[:free] += s * self.scale / self.of.units()[:free]
        if not self.sized:
            state[free] = 0.0
        return state

    def rows(self, s: Floats) -> tuple[Floats, Floats]:
        d, J = self.of.shape.distances(self.state(s)[None], self.local[:, None])
        rows = J[: len(s), 0] / self.of.units()[: len(s), None]
        value = np.concatenate([side * d[0] for side in self.sides]) / self.scale
        return value, np.concatenate([side * rows.T for side in self.sides])

    def extreme(self, found: Extremum, gap: float) -> Extreme:
        return Extreme(self.state(found.state), found.contacts % self.local.shape[-1], found.multipliers, gap)

    def solve(self, starts: Iterator[Floats]) -> Extremum:
        """The first minimum that is proved."""
        rounding = ROUNDING * float(np.abs(self.local).max()) / self.scale
        for start in starts:
            found = least_largest(self.rows, start, rounding)
            if found.proved:
                return found
        fix = f"Cover more of the {self.of.shape.name}, or associate by least squares"
        raise CmmUqError(f"{self.of.shape.name}: no contact points hold it", fix=fix)


def _problem(of: Placed, local: Floats, sides: tuple[float, ...], *, sized: bool) -> _Problem | Extreme:
    """The problem; where the points lie on the feature to rounding, nothing fits better by more than they lie off."""
    d = of.shape.distances(of.state[None], local[:, None])[0][0]
    scale = float(d.max() if of.shape is LINE else np.ptp(d))
    if scale > PERFECT * float(np.abs(local).max()):
        return _Problem(of, local, np.array(sides), sized, scale)
    return Extreme(of.state, _NONE, np.zeros(0), float(2 * d.max() if of.shape is LINE else np.ptp(d)))


def _starts(k: int) -> Iterator[Floats]:
    """The least-squares feature, then places a form deviation away from it."""
    yield np.zeros(k)
    for e in np.eye(k):
        yield e
        yield -e


def least_zone(of: Placed, local: Floats, near: Floats | None = None) -> Extreme:
    """The minimum zone: of a line in space the narrowest cylinder.

    ``near``: (k,) a state that is thought near it, of cylinders, cones and lines in space.
    """
    if of.shape in STRAIGHT:
        return _least_slab(of, local)
    sides = (1.0,) if of.shape is LINE else (1.0, -1.0)
    problem = _problem(of, local, sides, sized=True)
    if isinstance(problem, Extreme):
        return problem
    k = len(of.state)
    if of.shape in BALLS:
        return _least_ring(problem, k)
    first = [] if near is None else [(near - of.state) * of.units() / problem.scale]
    found = problem.solve(chain(first, _starts(k)))
    return problem.extreme(found, _line_gap(problem, found) if of.shape is LINE else np.inf)


def _least_slab(of: Placed, local: Floats) -> Extreme:
    """Straightness in a plane, flatness: the narrowest of all, by the convex hull, and its contact points."""
    points = local.reshape(len(local), -1).T
    normal, width = narrowest(points)
    if abs(normal[-1]) < LEANING:
        fix = f"Measure points that spread along the {of.shape.name}"
        raise CmmUqError(f"{of.shape.name}: the points are as wide as they are long", fix=fix)
    problem = _problem(of, local, (1.0, -1.0), sized=True)
    if isinstance(problem, Extreme):
        return problem
    heights = points @ normal
    state = np.append(0.5 * (heights.max() + heights.min()), -normal[:-1]) / normal[-1]
    found = problem.solve(iter([(state - of.state) * of.units() / problem.scale, *_starts(len(state))]))
    # by either way the same width: the contact points are those of the narrowest
    return problem.extreme(found, 0.0 if abs(2 * found.value * problem.scale - width) <= SAME else np.inf)


def _least_ring(problem: _Problem, k: int) -> Extreme:
    """Roundness, sphericity: descents until no centre is left that could have a narrower ring."""
    points = problem.local.reshape(k - 1, -1).T
    starts = _starts(k)
    for _ in range(8):
        found = problem.solve(starts)
        ring = problem.extreme(found, np.inf)
        centre, width = ring.state[:-1], 2 * found.value * problem.scale
        A = problem.rows(found.state)[1][found.contacts]
        nearest = float(np.linalg.norm(points - centre, axis=1).min())
        ended, better = narrower(points, width, centre, safe_radius(A, nearest), ring.contacts)
        if better is None:
            return replace(ring, gap=0.0 if ended else np.inf)
        radii = np.linalg.norm(points - better, axis=1)
        start = np.append(better, 0.5 * (radii.max() + radii.min()))
        starts = iter([(start - problem.of.state) / problem.scale])
    return ring


def _line_gap(problem: _Problem, found: Extremum) -> float:
    """How much narrower a cylinder than the one found could be, mm.

    With distances taken across the line found the problem is convex, and the one found its least, t. A line whose direction
    leans by the slope m has distances of at least F/√(1 + m²), F ≥ t being those across. Over the length L of the points it
    moves by m·L, so that F ≥ m·L/2 − t, and to be narrower it must have m < 4t/(L − 2t).
    """
    radius = found.value * problem.scale
    length = float(np.ptp(problem.local[2]))
    slope = 4 * radius / (length - 2 * radius) if length > 4 * radius else np.inf
    return float(2 * radius * (1 - 1 / np.sqrt(1 + slope**2)))


def circumscribed(of: Placed, local: Floats) -> Extreme:
    """The smallest circle, sphere or cylinder about all points; of circles and spheres there is but one."""
    return _one_sided(of, local, 1.0, 0.0 if of.shape in BALLS else np.inf)


def inscribed(of: Placed, local: Floats) -> Extreme:
    """The largest circle, sphere or cylinder inside the points that is held by them."""
    if of.shape is CYLINDER:
        return _one_sided(of, local, -1.0, np.inf)
    points = local.reshape(len(local), -1).T
    found = largest_empty(points)
    if found is None:
        name = of.shape.name
        raise CmmUqError(f"{name}: the points surround no inscribed one", fix=f"Measure all round the {name}")
    centre, radius = found
    largest = _one_sided(of, local, -1.0, 0.0, centre)
    return replace(largest, gap=0.0 if radius - largest.state[-1] <= SAME else np.inf)


def _one_sided(of: Placed, local: Floats, side: float, gap: float, centre: Floats | None = None) -> Extreme:
    problem = _problem(of, local, (side,), sized=False)
    if isinstance(problem, Extreme):
        return problem
    k = len(of.state) - 1
    first = [] if centre is None else [(centre - of.state[:k]) / problem.scale]
    found = problem.solve(chain(first, _starts(k)))
    extreme = problem.extreme(found, gap)
    extreme.state[k] = side * found.value * problem.scale
    return extreme


Association = Literal["least_squares", "minimum_zone", "maximum_inscribed", "minimum_circumscribed", "tangent"]
ASSOCIATIONS: tuple[Association, ...] = get_args(Association)
ALONG = 0.05  # cosine of the angle between a normal and ``outward`` below which the latter names no side
_CRITERIA: Mapping[Association, Callable[[Placed, Floats], Extreme]] = {
    "minimum_zone": least_zone,
    "maximum_inscribed": inscribed,
    "minimum_circumscribed": circumscribed,
}


@dataclass(frozen=True, eq=False)
class Associated:
    feature: FeatureKind
    association: Association
    # (d,) centre; or where the axis pierces the plane across the least-squares axis through the least-squares point; of a
    # plane, and of a line in a plane, the point of it above the centroid. mm.
    position: Floats
    # (d,) unit direction of the axis or line, of a plane its normal (outward where the material was told); None of a sphere
    # and of a circle, whose plane is that of least squares
    direction: Floats | None
    # diameter, mm; of a minimum zone that of its middle, of a cone at its position; None where there is none
    size: float | None
    half_angle: float | None  # of a cone, rad; None of others
    # form deviation against this feature, mm: range of the signed distances; of a line in space the diameter of the cylinder
    # about it that holds all points
    form: float
    deviations: Floats  # (n,) signed orthogonal distances, mm: positive outside, of a plane on the side of its normal
    contacts: Ints  # (p,) points that hold the feature; none of least squares
    multipliers: Floats  # (p,) of sum 1, none negative: the proof that the contacts hold it
    # of the least-squares problem with columns of unit length: large where the points cover little of the feature
    condition: float
    # no feature of this kind meets the criterion better by more than this, mm. Zero where all others were excluded; infinite
    # where only a local optimum is proved, as of cylinders and cones; ``nan`` of least squares.
    gap: float


def associate(
    feature: FeatureKind, points: ArrayLike, association: Association = "least_squares", *,
    outward: ArrayLike | None = None,
) -> Associated:  # fmt: skip
    """The feature that the criterion asks for.

    ``points``: (n, 3) in mm; (n, 2) of a line or circle in a plane. Points of a circle in space are projected along the normal
    of its least-squares plane. ``association``: ``"tangent"`` is of planes and of lines in a plane: outside the material, its
    largest distance from it the least, as ISO 5459 asks of datums. Its direction is that of the minimum zone. ``outward``:
    (d,) direction out of the material, roughly: needed for ``"tangent"``; gives the normal of any plane its sense.

    Raises :class:`CmmUqError` for an unknown feature or criterion, points that do not determine the feature, or a criterion
    that neither they nor such a feature can meet.
    """
    if association not in ASSOCIATIONS:
        raise CmmUqError(f"{association!r} is no association", fix=f"Associations are {', '.join(ASSOCIATIONS)}")
    array = np.asarray(points, dtype=np.float64)
    of = placed(feature, array)
    local = of.local(array)
    if association == "tangent":
        return _tangent(feature, of, local, outward)
    if association in ("maximum_inscribed", "minimum_circumscribed") and of.shape not in SIZED:
        raise CmmUqError(
            f"{feature}: it has no size to be inscribed or circumscribed", fix="Ask for circles, spheres and cylinders"
        )
    if association == "least_squares":
        extreme = Extreme(of.state, np.zeros(0, dtype=np.int64), np.zeros(0), np.nan)
    else:
        extreme = _CRITERIA[association](of, local)
    return _answer(feature, association, of, local, extreme, outward)


def _answer(
    feature: FeatureKind, association: Association, of: Placed, local: Floats, found: Extreme, outward: ArrayLike | None
) -> Associated:
    state = found.state[None]
    deviations = of.shape.distances(state, local[:, None])[0][0]
    direction, size, angle = of.direction(state), of.size(state), of.half_angle(state)
    pointing = None if direction is None else direction[0]
    if outward is not None and of.shape is PLANE and pointing is not None and _against(pointing, outward, feature):
        pointing, deviations = -pointing, -deviations
    form = float(2 * deviations.max() if of.shape is LINE else np.ptp(deviations))
    diameter, opening = (None if one is None else float(one[0]) for one in (size, angle))
    figures = pointing, diameter, opening, form, deviations
    held = found.contacts, found.multipliers, of.condition, found.gap
    return Associated(feature, association, of.position(state)[0], *figures, *held)


def _tangent(feature: FeatureKind, of: Placed, local: Floats, outward: ArrayLike | None) -> Associated:
    """The side of the minimum zone that looks out of the material."""
    if of.shape not in STRAIGHT:
        raise CmmUqError(
            f"{feature}: a tangent feature is a plane, or a line in a plane",
            fix="Ask for maximum_inscribed or minimum_circumscribed",
        )
    if outward is None:
        problem = f"{feature}: a tangent needs the side of the material"
        raise CmmUqError(problem, fix="Give the direction out of it (outward)")
    found = least_zone(of, local)
    slopes = np.append(-found.state[1:], 1.0)
    normal = slopes @ of.frame
    side = -1.0 if _against(normal, outward, feature) else 1.0
    d = of.shape.distances(found.state[None], local[:, None])[0][0]
    found.state[0] += side * (side * d).max() * np.linalg.norm(slopes)
    return _answer(feature, "tangent", of, local, found, outward)


def _against(normal: Floats, outward: ArrayLike, feature: str) -> bool:
    toward = np.asarray(outward, dtype=np.float64)
    if toward.shape != normal.shape or not np.isfinite(toward).all():
        raise CmmUqError(f"{feature}: outward has to be {len(normal)} finite numbers", fix="Give a direction")
    share = float(normal @ toward)
    if abs(share) <= ALONG * float(np.linalg.norm(toward)) * float(np.linalg.norm(normal)):
        raise CmmUqError(f"{feature}: outward lies along it", fix="Give the direction out of the material, across it")
    return share < 0
