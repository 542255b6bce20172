"""Least-squares cones and cylinders.

Distances and derivatives follow Shakarji, J. Res. NIST 103 (1998) 633: with f the distance from the axis and g the
height along it, d = f·cos ψ − g·sin ψ − s, s being the distance of the surface from a point of the axis and ψ the
half angle; ψ = 0 is the cylinder.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats
from cmm_uq.maths.geometry.feature import Feature, frame_about, prepared, tilted, upward, with_known_radius
from cmm_uq.maths.geometry.orthogonal_distance import Minimum, axis_candidates, minimise, minimum_at, section

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
    """Cone through at least six points, not all in one plane.

    ``points``: (n, 3) in mm. ``u_point``: standard uncertainty of a point along the normal, mm; estimated from the residuals
    when left out.
    """
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
    with_known_radius(cone, radius)
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
            frame = frame_about(upward(w))
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
    frame = tilted(state.frame, step[2], step[3])
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
    """Cylinder through at least five points, not all in one plane.

    ``points``: (n, 3) in mm. ``u_point``: standard uncertainty of a point along the normal, mm; estimated from the residuals
    when left out.
    """
    about, centroid, extent = prepared(points, "cylinder", 5, extended=3)
    found = axis_minimum(about, "cylinder", tapered=False)
    natural = axis_derivatives(found.state, extent, 7)
    natural[6, 4] = extent
    direction = upward(found.state.frame[2])
    # the covariance of a direction is that of its opposite but for the sign of its correlations
    natural[3:6] *= np.sign(direction @ found.state.frame[2])
    figures = found, extent, "x y z dx dy dz r", natural, u_point
    point, radius = centroid + extent * found.state.point, float(extent * found.state.distance)
    return with_known_radius(Cylinder.of_minimum(*figures, point=point, direction=direction, radius=radius), radius)
