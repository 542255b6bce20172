"""Least-squares cones and cylinders, and where to begin for them; arguments are those of :mod:`~cmm_uq.maths.geometry.fits`.

Distances and derivatives follow Shakarji, J. Res. NIST 103 (1998) 633: with f the distance from the axis and g the
height along it, d = f·cos ψ − g·sin ψ − s, s being the distance of the surface from a point of the axis and ψ the
half angle; ψ = 0 is the cylinder.

For a given axis the surface is linear in what remains: |p⊥|² = 2c·p⊥ + k of a cylinder, with b·h + t²·h² more of a cone
(h along the axis, t the tangent of the half angle). Its least-squares misfit depends on the points only through their
moments up to the fourth order, so that hundreds of directions over the whole hemisphere cost nothing. That finds the
axis from short arcs too, where the principal directions of the points mislead.
"""

from __future__ import annotations

from contextlib import suppress
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats
from cmm_uq.base.values import dataclass
from cmm_uq.maths.geometry import feature
from cmm_uq.maths.geometry.feature import Feature, Minimum, cap_directions, minimise, minimum_at, prepared, principal

DIRECTIONS, CANDIDATES = 600, 6
APART = np.cos(np.radians(12))  # candidates nearer to each other than this descend to the same minimum


def axis_candidates(about: Floats, *, tapered: bool) -> list[Floats]:
    """A few unit directions (3,): the principal ones, then the most promising, for centred points (3, n) of unit extent."""
    x, y, z = about
    monomials = np.array([np.ones_like(x), x, y, z, x * x, y * y, z * z, x * y, x * z, y * z])
    directions = np.vstack([principal(about), cap_directions(np.pi / 2, DIRECTIONS)])
    misfits = _misfits(monomials @ monomials.T / len(x), directions, tapered)
    # short rings and long thin bodies have their axis among the principal directions, whatever the misfits say
    chosen: list[Floats] = list(directions[:3])
    for i in 3 + np.argsort(misfits[3:]):
        if len(chosen) == 3 + CANDIDATES:
            break
        if all(abs(directions[i] @ w) < APART for w in chosen):
            chosen.append(directions[i])
    return chosen


def section(about: Floats, frame: Floats, *, tapered: bool) -> tuple[Floats, float, float]:
    """Centre (2,) across an axis given by its frame, radius at the centroid, and tangent of the half angle."""
    p, h = (frame @ about)[:2], frame[2] @ about
    regressors = [*p, np.ones_like(h), h, h * h] if tapered else [*p, np.ones_like(h)]
    fitted = np.linalg.lstsq(np.array(regressors).T, np.einsum("ij,ij->j", p, p), rcond=None)[0]
    centre = 0.5 * fitted[:2]
    squared = max(float(fitted[2] + centre @ centre), 1e-12)
    radius = np.sqrt(squared)
    return centre, float(radius), float(0.5 * fitted[3] / radius) if tapered else 0.0


def _misfits(M: Floats, directions: Floats, tapered: bool) -> Floats:
    """Mean squared misfit of |p⊥|² for axes (m, 3), brought to squares of distance: divided by (2r)²."""
    x, y, z = directions.T
    along = np.zeros((len(directions), 10))
    along[:, 4:] = np.array([x * x, y * y, z * z, 2 * x * y, 2 * x * z, 2 * y * z]).T
    across = np.array([0, 0, 0, 0, 1.0, 1, 1, 0, 0, 0]) - along
    G = np.zeros((len(directions), 10, 6 if tapered else 4))
    G[:, 0, 0] = 1.0
    G[:, 1:4, 1:4] = np.eye(3) - directions[:, :, None] * directions[:, None, :]
    if tapered:
        G[:, 1:4, 4], G[:, :, 5] = directions, along
    Gt = G.transpose(0, 2, 1)
    # the ridge keeps it solvable along the axis, where a projection has nothing, and where the points say nothing
    normal = Gt @ M @ G + 1e-12 * np.eye(G.shape[2])
    fitted = np.linalg.solve(normal, Gt @ M @ across[:, :, None])[:, :, 0]
    left = across - np.einsum("mij,mj->mi", G, fitted)
    squared = fitted[:, 0] + 0.25 * np.sum(fitted[:, 1:4] ** 2, axis=1)
    misfits = np.einsum("ij,jk,ik->i", left, M, left) / (4 * np.where(squared > 0, squared, np.inf))
    return np.where(squared > 0, misfits, np.inf)


SAMPLE = 1500  # points on which the candidates for the axis are tried; the fit itself takes all


@dataclass(frozen=True, eq=False, kw_only=True)
class Cone(Feature):
    """Least-squares cone.

    The axis runs towards the wide end, through ``point``, where it pierces the plane across it through the centroid
    of the points; ``radius`` is there. The covariance is of x, y, z of that point (free in that plane), dx, dy, dz of
    the direction, r, and the half angle psi.
    """

    point: Floats
    direction: Floats
    radius: float
    half_angle: float

    @property
    def apex(self) -> Floats:
        """(3,) where the surface meets its axis, mm."""
        return np.asarray(self.point - self.direction * self.radius / np.tan(self.half_angle))


def fit_cone(points: ArrayLike, *, u_point: float | None = None) -> Cone:
    """Cone through at least six points, not all in one plane."""
    about, centroid, extent = prepared(points, "cone", 6, extended=3)
    found = axis_minimum(about, "cone", tapered=True)
    if found.state.half_angle < 0:
        reverse = found.state.frame * np.array([1.0, -1.0, -1.0])[:, None]
        turned = found.state._replace(frame=reverse, half_angle=-found.state.half_angle)
        found = minimum_at(turned, linearised(about, turned, tapered=True), "cone", found.iterations)
    state = found.state
    cos, sin = np.cos(state.half_angle), np.sin(state.half_angle)
    natural = axis_derivatives(state, extent, 8)
    natural[6, 4:] = extent / cos, extent * state.distance * sin / cos**2
    natural[7, 5] = 1.0
    figures = found, extent, "x y z dx dy dz r psi", natural, u_point
    point, radius, half_angle = centroid + extent * state.point, float(extent * state.distance / cos), state.half_angle
    cone = Cone.of_minimum(*figures, point=point, direction=state.frame[2], radius=radius, half_angle=float(half_angle))
    feature.with_known_radius(cone, radius)
    if not cone.u("psi") < cone.half_angle:
        raise CmmUqError("cone: within their scatter the points lie on a cylinder", fix="Fit a cylinder")
    return cone


class Axis(NamedTuple):
    """Frame whose third row is the axis, a point of it, distance of the surface from that point, half angle."""

    frame: Floats
    point: Floats
    distance: float
    half_angle: float


def axis_minimum(about: Floats, what: str, *, tapered: bool) -> Minimum[Axis]:
    """Cylinder, or tapered cone, for centred points (3, n) of unit extent: the best descent from several directions."""
    n = about.shape[1]
    sample = about[:, :: -(-n // SAMPLE)]
    tried = []
    for w in axis_candidates(about, tapered=tapered):
        with suppress(CmmUqError):  # this direction leads nowhere; another one may
            frame = feature.frame_about(feature.upward(w))
            centre, radius, tangent = section(sample, frame, tapered=tapered)
            half_angle = float(np.arctan(tangent))
            start = Axis(frame, centre @ frame[:2], radius * np.cos(half_angle), half_angle)
            tried.append(_descend(sample, start, what, tapered))
    if not tried:
        raise CmmUqError(f"{what}: no {what} fits these points", fix=f"Cover more of the {what}")
    best = min(tried, key=lambda m: m.cost)
    return best if sample.shape[1] == n else _descend(about, best.state, what, tapered)


def linearised(about: Floats, state: Axis, *, tapered: bool) -> Floats:
    """Derivatives of the distances by shifts along u, v, tilts to u, v, distance and half angle; then the distances."""
    x, y, g = state.frame @ (about - state.point[:, None])
    f = np.hypot(x, y)
    # a point on the axis has no direction from it: any is a derivative's
    away = np.where(f > 0, f, 1.0)
    ex, ey = np.where(f > 0, x / away, 1.0), y / away
    cos, sin = np.cos(state.half_angle), np.sin(state.half_angle)
    lever = -(g * cos + f * sin)
    rows = [-ex * cos, -ey * cos, lever * ex, lever * ey, np.full(len(f), -1.0)]
    if tapered:
        rows.append(-f * sin - g * cos)
    return np.array([*rows, f * cos - g * sin - state.distance])


def axis_derivatives(state: Axis, extent: float, n: int) -> Floats:
    """(n, k) of which the first six rows are point and direction of the axis; k = 5 of a cylinder, 6 of a cone."""
    natural = np.zeros((n, n - 2))
    natural[:3, :2] = extent * state.frame[:2].T
    natural[3:6, 2:4] = state.frame[:2].T
    return natural


def _descend(about: Floats, start: Axis, what: str, tapered: bool) -> Minimum[Axis]:
    return minimise(start, lambda s: linearised(about, s, tapered=tapered), _moved, what)


def _moved(state: Axis, step: Floats) -> Axis:
    frame = feature.tilted(state.frame, step[2], step[3])
    point = state.point + step[:2] @ state.frame[:2]
    half_angle = state.half_angle + (step[5] if len(step) == 6 else 0.0)
    # back to the plane across the axis through the centroid, which changes the distance of a cone
    along = -frame[2] @ point
    distance = float(state.distance + step[4] + along * np.sin(half_angle))
    return Axis(frame, point + along * frame[2], distance, half_angle)


@dataclass(frozen=True, eq=False, kw_only=True)
class Cylinder(Feature):
    """Least-squares cylinder.

    The axis runs through ``point``, where it pierces the plane across it through the centroid of the points; the
    largest component of its direction is positive. The covariance is of x, y, z of that point (free in that plane),
    dx, dy, dz of the direction, and r.
    """

    point: Floats
    direction: Floats
    radius: float


def fit_cylinder(points: ArrayLike, *, u_point: float | None = None) -> Cylinder:
    """Cylinder through at least five points, not all in one plane."""
    about, centroid, extent = prepared(points, "cylinder", 5, extended=3)
    found = axis_minimum(about, "cylinder", tapered=False)
    natural = axis_derivatives(found.state, extent, 7)
    natural[6, 4] = extent
    direction = feature.upward(found.state.frame[2])
    # the covariance of a direction is that of its opposite but for the sign of its correlations
    natural[3:6] *= np.sign(direction @ found.state.frame[2])
    figures = found, extent, "x y z dx dy dz r", natural, u_point
    point, radius = centroid + extent * found.state.point, float(extent * found.state.distance)
    return feature.with_known_radius(
        Cylinder.of_minimum(*figures, point=point, direction=direction, radius=radius), radius
    )
