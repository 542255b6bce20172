"""Least-squares plane."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from cmm_uq.base.points import Floats
from cmm_uq.maths.geometry.feature import Feature, centred, checked_points, fit_figures, no_line
from cmm_uq.maths.geometry.frame import frame_about, upward
from cmm_uq.maths.geometry.orthogonal_distance import minimum_at, principal


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

    Parameters
    ----------
    points : (n, 3) in mm.
    u_point : standard uncertainty of a point along the normal, mm; estimated from the residuals when left out.

    Raises
    ------
    CmmUqError : too few points, or points on one line.
    """
    array = checked_points(points, "plane", 3)
    about, centroid, extent = centred(array)
    no_line(about, "plane")
    frame = frame_about(upward(principal(about)[2]))
    x, y, z = frame @ about
    found = minimum_at(frame, np.array([x, y, np.full(len(array), -1.0), z]), "plane")
    natural = np.zeros((6, 3))
    natural[3:, :2] = frame[:2].T
    natural[:3, 2] = extent * frame[2]
    return Plane(
        point=centroid,
        normal=frame[2],
        **fit_figures(found, extent, ("x", "y", "z", "nx", "ny", "nz"), natural, u_point, "plane"),
    )
