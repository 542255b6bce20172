"""Least-squares sphere, and what it shares with the circle in a plane."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from cmm_uq.base.points import Floats
from cmm_uq.maths.geometry.feature import Feature, centred, checked_points, determined_radius, fit_figures, no_plane
from cmm_uq.maths.geometry.orthogonal_distance import Minimum, minimise


@dataclass(frozen=True, eq=False, kw_only=True)
class Sphere(Feature):
    """Least-squares sphere; the covariance is of x, y, z of the centre and r."""

    centre: Floats
    radius: float


def fit_sphere(points: ArrayLike, *, u_point: float | None = None) -> Sphere:
    """Sphere through at least four points, not all in one plane.

    Parameters
    ----------
    points : (n, 3) in mm.
    u_point : standard uncertainty of a point along the normal, mm; estimated from the residuals when left out.

    Raises
    ------
    CmmUqError : too few points, points in one plane, or a cap so small that the radius is not determined.
    """
    array = checked_points(points, "sphere", 4)
    about, centroid, extent = centred(array)
    no_plane(about, "sphere")
    found = radial_minimum(about, "sphere")
    sphere = Sphere(
        centre=centroid + extent * found.state[:3],
        radius=float(extent * found.state[3]),
        **fit_figures(found, extent, ("x", "y", "z", "r"), extent * np.eye(4), u_point, "sphere"),
    )
    determined_radius(sphere, sphere.radius, "sphere")
    return sphere


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

    return minimise(_algebraic(about), linearise, np.add, what)


def _algebraic(about: Floats) -> Floats:
    """Start (d + 1,) from |p|² = 2c·p + r² − |c|², linear in c."""
    squares = np.einsum("ij,ij->j", about, about)
    centre = 0.5 * np.linalg.lstsq(about @ about.T, about @ squares, rcond=None)[0]
    return np.append(centre, np.sqrt(squares.mean() + centre @ centre))
