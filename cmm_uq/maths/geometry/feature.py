"""What every least-squares feature shares: the descent to it, its covariance, residuals and form; frames; the form of a ball.

Gauss–Newton steps by QR, damped where a step would not descend, end at the least sum of squared orthogonal distances. The
features are given in centred data of unit extent. Each says how to linearise its distances at a state and how to move the
state by a small step; frames that follow the axis keep every step free of singularities.

A ball that is slightly oblate or prolate does not show its centre to a sensor that sees only one side of it (Harris
2004 appendix A), and more points do not help. The deviation of the surface is radial, so to first order the centre
and the radius move by its least-squares projection on n·δc + δr: a systematic line of the budget.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Generic, Self, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats
from cmm_uq.base.values import dataclass

State = TypeVar("State")
MAX_ITERATIONS = 200
SETTLED = 1e-13  # step, in units of the extent of the data, below which nothing is left to gain
SHRINKING = 1e-7  # steps below this that no longer shrink are rounding
SINGULAR = 1e12  # condition number from which the points do not determine the feature


@dataclass(frozen=True, eq=False)
class Minimum(Generic[State]):
    state: State  # the feature, in the units of the data given
    distances: Floats  # (m,) orthogonal distances there
    root: Floats  # (k, k) upper triangular R of the Jacobian: (RᵀR)⁻¹ is the covariance for distances of unit variance
    condition: float  # of the Jacobian with columns of unit length
    iterations: int  # steps taken

    @property
    def cost(self) -> float:
        return float(self.distances @ self.distances)

    def covariance(self) -> Floats:
        """(k, k) covariance of the step's parameters for distances of unit variance."""
        inverse = np.linalg.inv(self.root)
        return np.asarray(inverse @ inverse.T)


def triangle(rows: Floats) -> Floats:
    """Upper triangular R (k, k) of the QR factorisation of ``rows.T``, for rows (k, m) with m ≥ k or padded to it."""
    from scipy.linalg import lapack

    k, m = rows.shape
    if m < k:
        rows = np.hstack([rows, np.zeros((k, k - m))])
    # the transpose of C-ordered rows is what LAPACK wants, so that nothing is copied but once
    factored = lapack.dgeqrf(rows.T)[0]
    return np.asarray(np.triu(factored[:k]))


def principal(about: Floats) -> Floats:
    """(d, d) principal directions of centred points (d, n), rows, longest extent first."""
    return np.asarray(np.linalg.svd(triangle(about))[2])


def extents(about: Floats) -> Floats:
    """Singular values (d,) of centred points (d, n), largest first."""
    return np.asarray(np.linalg.svd(triangle(about), compute_uv=False))


def minimise(
    start: State, linearise: Callable[[State], Floats], move: Callable[[State, Floats], State], what: str
) -> Minimum[State]:
    """Descend from a start to the least sum of squared distances.

    ``linearise``: (k + 1, m) derivatives of the distances with respect to the step's k parameters, and the distances last.
    ``move``: the state after a step (k,).
    """
    state, rows = start, linearise(start)
    k = len(rows) - 1
    cost, damping, rise, last = float(rows[-1] @ rows[-1]), 0.0, 2.0, np.inf
    for iteration in range(1, MAX_ITERATIONS + 1):
        R = triangle(rows)
        while True:
            step, expected = _step(R, damping)
            moved = move(state, step)
            trial = linearise(moved)
            gain = cost - float(trial[-1] @ trial[-1])
            size = float(np.abs(step).max())
            # at the level of rounding the cost says nothing any more, the size of the step does
            if gain >= 0 or size < SHRINKING:
                break
            damping, rise = max(rise * damping, 1e-4), 2 * rise
        state, rows, cost = moved, trial, cost - gain
        if size < SETTLED or (size < SHRINKING and size > 0.5 * last):
            return minimum_at(state, rows, what, iteration)
        # the more of the expected gain came true, the less damping (Nielsen 1999); none where the model holds well
        damping *= max(1 / 3, 1 - (2 * gain / expected - 1) ** 3) if expected > 0 else 1 / 3
        last, damping, rise = size, damping if damping > 1e-9 else 0.0, 2.0
    fix = f"Cover more of the {what} (k = {k} parameters), and remove points that are not on it"
    raise CmmUqError(f"{what}: the fit does not settle on these {rows.shape[1]} points", fix=fix)


def _step(R: Floats, damping: float) -> tuple[Floats, float]:
    """Damped least-squares step from R of Jacobian and distances, and the gain expected of it."""
    J, d = R[:, :-1], R[:, -1]
    scale = np.linalg.norm(J, axis=0)
    scale[scale == 0] = 1.0
    J = J / scale
    k = J.shape[1]
    step = np.linalg.lstsq(np.vstack([J, np.sqrt(damping) * np.eye(k)]), -np.append(d, np.zeros(k)), rcond=1e-14)[0]
    return step / scale, float(d @ d - np.sum((J @ step + d) ** 2))


def minimum_at(state: State, rows: Floats, what: str, iterations: int = 0) -> Minimum[State]:
    """The minimum, given that ``state`` is it, from its linearisation ``rows`` (see :func:`minimise`)."""
    R = triangle(rows)[:-1, :-1]
    scale = np.linalg.norm(R, axis=0)
    s = np.linalg.svd(R / np.where(scale > 0, scale, 1.0), compute_uv=False)
    if s[-1] * SINGULAR <= s[0]:
        raise CmmUqError(f"{what}: the points do not determine it", fix=f"Cover more of the {what}")
    return Minimum(state, rows[-1], R, float(s[0] / s[-1]), iterations)


DEGENERATE = 1e-9  # ratio of extents below which points count as lying on one line or in one plane


@dataclass(frozen=True, eq=False, kw_only=True)
class Feature:
    """A feature fitted to n points by least squares of the orthogonal distances.

    ``covariance`` (k, k) is of the parameters ``names``, mm² and rad². It carries redundant parameters (a unit vector has
    three components and two freedoms), so it may be singular; it propagates as it is. ``residuals`` are the signed
    orthogonal distances of the points, mm, positive outside: (n,), or (n, 2) where a distance has two components (a line or
    a circle in space). ``u_point`` is the standard uncertainty of a point along the normal, mm, given or estimated from
    them. ``condition`` is that of the Jacobian with columns of unit length, large where the coverage is poor;
    ``iterations`` is 0 where the fit is solved directly.
    """

    names: tuple[str, ...]
    covariance: Floats
    residuals: Floats
    u_point: float
    u_point_given: bool
    degrees_of_freedom: int
    condition: float
    iterations: int

    @property
    def rms(self) -> float:
        """Root mean square of the orthogonal distances, mm."""
        return float(np.sqrt(np.sum(self.residuals**2) / len(self.residuals)))

    @property
    def form_deviation(self) -> float:
        """Peak to valley of the orthogonal distances, mm."""
        return float(np.ptp(self.residuals))

    def u(self, name: str) -> float:
        i = self.names.index(name)
        return float(np.sqrt(self.covariance[i, i]))

    @classmethod
    def of_minimum(
        cls, found: Minimum[Any], extent: float, names: str, natural: Floats, u_point: float | None,
        components: int = 1, **own: Any,
    ) -> Self:  # fmt: skip
        """From a minimum in data whose unit is ``extent``, mm, and what only this feature has.

        ``natural``: (k, j) derivatives of the parameters ``names`` in mm and rad with respect to the step's j parameters.
        ``components``: of each point's distance.
        """
        what, distances = cls.__name__.lower(), extent * found.distances
        freedom = len(distances) - natural.shape[1]
        if u_point is not None and not (np.isfinite(u_point) and u_point > 0):
            problem = f"{what}: u_point = {u_point} is no standard uncertainty"
            raise CmmUqError(problem, fix="Give a positive number, mm")
        if u_point is None and freedom < 1:
            fix = "Measure more points, or give the standard uncertainty of a point (u_point)"
            raise CmmUqError(f"{what}: so few points leave nothing to estimate their uncertainty from", fix=fix)
        u = float(np.sqrt(np.sum(distances**2) / freedom)) if u_point is None else float(u_point)
        return cls(
            names=tuple(names.split()), covariance=(u / extent) ** 2 * natural @ found.covariance() @ natural.T,
            residuals=distances if components == 1 else distances.reshape(components, -1).T, u_point=u,
            u_point_given=u_point is not None, degrees_of_freedom=freedom, condition=found.condition,
            iterations=found.iterations, **own,
        )  # fmt: skip

    def correlation(self, one: str, other: str) -> float:
        return float(self.covariance[self.names.index(one), self.names.index(other)] / (self.u(one) * self.u(other)))


def prepared(
    points: ArrayLike, what: str, least: int, dimensions: tuple[int, ...] = (3,), extended: int = 2
) -> tuple[Floats, Floats, float]:
    """Points (n, d) as :func:`centred` gives them: finite numbers, n ≥ ``least``, that extend in 2 or 3 directions, or any."""
    array = np.asarray(points, dtype=np.float64)
    if array.ndim != 2 or array.shape[1] not in dimensions:
        shapes = " or ".join(f"(n, {d})" for d in dimensions)
        raise CmmUqError(f"{what}: points have the shape {array.shape}", fix=f"Give them as {shapes} in mm")
    if len(array) < least:
        raise CmmUqError(f"{what}: {len(array)} points are too few", fix=f"Measure at least {least}")
    if not np.isfinite(array).all():
        bad = int(np.flatnonzero(~np.isfinite(array).all(axis=1))[0])
        problem = f"{what}: point {bad + 1} has a coordinate that is no finite number"
        raise CmmUqError(problem, fix="Correct or remove it")
    about, centroid, extent = centred(array)
    if extended > 1:
        s = extents(about)
        if s[1] <= DEGENERATE * s[0]:
            spread = "across it too" if extended == 2 else "in all directions"
            raise CmmUqError(f"{what}: the points lie on one line", fix=f"Measure points that spread {spread}")
        if extended > 2 and s[2] <= DEGENERATE * s[0]:
            raise CmmUqError(f"{what}: the points lie in one plane", fix="Measure points out of that plane too")
    return about, centroid, extent


def centred(points: Floats) -> tuple[Floats, Floats, float]:
    """Points (d, n) about their centroid in units of their extent; the centroid (d,); the extent in mm, or 0."""
    centroid = points.mean(axis=0)
    # a second pass takes away the rounding of the first far from the origin
    centroid = centroid + (points - centroid).mean(axis=0)
    about = np.ascontiguousarray((points - centroid).T)
    extent = float(np.sqrt(np.mean(np.einsum("ij,ij->j", about, about))))
    return about / (extent or 1.0), centroid, extent


Round = TypeVar("Round", bound=Feature)


def with_known_radius(feature: Round, radius: float) -> Round:
    """Refuse a radius known to less than a quarter of itself: within their scatter the points are as good as flat."""
    what = type(feature).__name__.lower()
    if not feature.u("r") < radius / 4:
        problem = f"{what}: the points do not determine its radius (r = {radius:.6g} mm, u = {feature.u('r'):.2g} mm)"
        raise CmmUqError(problem, fix=f"Cover more of the {what}")
    return feature


def frame_about(axis: Floats) -> Floats:
    """(3, 3) right-handed orthonormal rows u, v, w with w along ``axis`` (3,)."""
    w = axis / np.linalg.norm(axis)
    u = np.zeros(3)
    u[np.argmin(np.abs(w))] = 1.0
    u -= (u @ w) * w
    u /= np.linalg.norm(u)
    return np.array([u, np.cross(w, u), w])


def tilted(frame: Floats, a: float, b: float) -> Floats:
    """The frame after its axis w has become the direction w + a·u + b·v."""
    w = frame[2] + a * frame[0] + b * frame[1]
    w /= np.linalg.norm(w)
    u = frame[0] - (frame[0] @ w) * w
    u /= np.linalg.norm(u)
    return np.array([u, np.cross(w, u), w])


def upward(direction: Floats) -> Floats:
    """The direction or its opposite, whichever has its largest component positive: for axes without a sense."""
    return np.asarray(direction * np.sign(direction[np.argmax(np.abs(direction))]))


def nearest_rotations(moments: Floats) -> Floats:
    """Rotations (q, 3, 3) R with the largest tr(Rᵀ·moment), proper ones.

    ``moments``: (q, 3, 3) sums of found · ownᵀ, both about their means. Where these lie on a line, the turn about it is any.
    """
    U, _, Vt = np.linalg.svd(moments)
    U[:, :, 2] *= np.sign(np.linalg.det(U @ Vt))[:, None]
    return np.asarray(U @ Vt, dtype=np.float64)


def cap_directions(polar_angle: float, n: int = 20_000) -> Floats:
    """Unit directions (n, 3) spread evenly over the cap of a sphere about +z, whose edge is ``polar_angle`` from it, rad."""
    i = np.arange(n)
    z = 1 - (1 - np.cos(polar_angle)) * (i + 0.5) / n
    turn = np.pi * (3 - np.sqrt(5)) * i
    r = np.sqrt(1 - z**2)
    return np.column_stack([r * np.cos(turn), r * np.sin(turn), z])


@dataclass(frozen=True)
class BallForm:
    """A ball whose largest and smallest diameters differ, as an ellipsoid of revolution does."""

    sphericity: float  # largest less smallest diameter, mm (200 µin, that is 5.08e-3 mm, for a ball of grade 200).

    def __post_init__(self) -> None:
        if not (np.isfinite(self.sphericity) and self.sphericity >= 0):
            fix = "Give the difference of two diameters, mm, ≥ 0"
            raise CmmUqError(f"a sphericity of {self.sphericity} mm", fix=fix)

    def shift(self, directions: Floats, axis: Floats) -> Floats:
        """(4,) shift of the fitted x, y, z and r, mm, for a ball prolate by the sphericity along ``axis`` (3,).

        The oblate ball gives the opposite. ``directions``: (n, 3) unit vectors from the centre to the points measured.
        """
        k = axis / np.linalg.norm(axis)
        return np.asarray(_projection(directions) @ (0.5 * self.sphericity * (directions @ k) ** 2))

    def covariance(self, directions: Floats) -> Floats:
        """(4, 4) covariance of the fitted x, y, z and r, mm², when the ball's axis may point anywhere.

        Over all axes k the deviations s/2·((n·k)² − 1/3) at two points are correlated as (s/2)²·(4/45)·P₂(n₁·n₂), P₂
        the Legendre polynomial. What the same form does to the mean radius is left to the calibration of the
        diameter.
        """
        # P₂(n·m) = 3/2 (n·m)² − 1/2, and (n·m)² is a product of the second-order components of n and m
        x, y, z = directions.T
        root2 = np.sqrt(2.0)
        components = np.array([x * x, y * y, z * z, root2 * x * y, root2 * x * z, root2 * y * z])
        P = _projection(directions)
        seconds, mean = P @ components.T, P @ np.ones(len(directions))
        spread = 1.5 * seconds @ seconds.T - 0.5 * np.outer(mean, mean)
        return np.asarray((0.5 * self.sphericity) ** 2 * 4 / 45 * spread)


def _projection(directions: Floats) -> Floats:
    """(4, n) of the least-squares fit of n·δc + δr to radial deviations."""
    design = np.column_stack([directions, np.ones(len(directions))])
    if len(directions) < 4 or np.linalg.matrix_rank(design) < 4:
        raise CmmUqError("the directions do not determine a sphere", fix="Give at least four, not all in one plane")
    return np.asarray(np.linalg.pinv(design))
