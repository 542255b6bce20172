"""Least-squares cylinder."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from cmm_uq.base.points import Floats
from cmm_uq.maths.geometry.cone import axis_derivatives, axis_minimum
from cmm_uq.maths.geometry.feature import Feature, centred, checked_points, determined_radius, fit_figures, no_plane
from cmm_uq.maths.geometry.frame import upward


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

    Parameters
    ----------
    points : (n, 3) in mm.
    u_point : standard uncertainty of a point along the normal, mm; estimated from the residuals when left out.

    Raises
    ------
    CmmUqError : too few points, points in one plane, or an arc so short that the radius is not determined.
    """
    array = checked_points(points, "cylinder", 5)
    about, centroid, extent = centred(array)
    no_plane(about, "cylinder")
    found = axis_minimum(about, "cylinder", tapered=False)
    natural = axis_derivatives(found.state, extent, 7)
    natural[6, 4] = extent
    direction = upward(found.state.frame[2])
    # the covariance of a direction is that of its opposite but for the sign of its correlations
    natural[3:6] *= np.sign(direction @ found.state.frame[2])
    names = ("x", "y", "z", "dx", "dy", "dz", "r")
    cylinder = Cylinder(
        point=centroid + extent * found.state.point,
        direction=direction,
        radius=float(extent * found.state.distance),
        **fit_figures(found, extent, names, natural, u_point, "cylinder"),
    )
    determined_radius(cylinder, cylinder.radius, "cylinder")
    return cylinder
