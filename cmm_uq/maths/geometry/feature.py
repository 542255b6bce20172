"""What every fitted feature tells: its covariance, residuals and form; frames, rotations, and the form of a ball.

A ball that is slightly oblate or prolate does not show its centre to a sensor that sees only one side of it (Harris
2004 appendix A), and more points do not help. The deviation of the surface is radial, so to first order the centre
and the radius move by its least-squares projection on n·δc + δr: a systematic line of the budget.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats
from cmm_uq.maths.geometry.orthogonal_distance import Minimum, extents

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
        """Standard uncertainty of one parameter."""
        i = self.names.index(name)
        return float(np.sqrt(self.covariance[i, i]))

    @classmethod
    def of_minimum(
        cls,
        found: Minimum[Any],
        extent: float,
        names: str,
        natural: Floats,
        u_point: float | None,
        components: int = 1,
        **own: Any,
    ) -> Self:
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
            names=tuple(names.split()),
            covariance=(u / extent) ** 2 * natural @ found.covariance() @ natural.T,
            residuals=distances if components == 1 else distances.reshape(components, -1).T,
            u_point=u,
            u_point_given=u_point is not None,
            degrees_of_freedom=freedom,
            condition=found.condition,
            iterations=found.iterations,
            **own,
        )

    def correlation(self, one: str, other: str) -> float:
        """Correlation coefficient of two parameters."""
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
