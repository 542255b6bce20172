"""Least-squares circle in a plane or in space."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from cmm_uq.base.points import Floats
from cmm_uq.maths.geometry.feature import Feature, centred, checked_points, determined_radius, fit_figures, no_line
from cmm_uq.maths.geometry.frame import frame_about, tilted, upward
from cmm_uq.maths.geometry.orthogonal_distance import minimise, principal
from cmm_uq.maths.geometry.sphere import radial_minimum


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
    """Circle through at least three points, not on one line.

    Parameters
    ----------
    points : (n, 2), or (n, 3) for a circle in space, mm.
    u_point : standard uncertainty of a point radially, and in space along the normal, mm; estimated when left out.

    Raises
    ------
    CmmUqError : too few points, points on one line, or an arc so short that the radius is not determined.
    """
    array = checked_points(points, "circle", 3, (2, 3))
    about, centroid, extent = centred(array)
    no_line(about, "circle")
    circle = (_in_plane if len(about) == 2 else _in_space)(about, centroid, extent, u_point)
    determined_radius(circle, circle.radius, "circle")
    return circle


def _in_plane(about: Floats, centroid: Floats, extent: float, u_point: float | None) -> Circle:
    found = radial_minimum(about, "circle")
    return Circle(
        centre=centroid + extent * found.state[:2],
        radius=float(extent * found.state[2]),
        normal=None,
        **fit_figures(found, extent, ("x", "y", "r"), extent * np.eye(3), u_point, "circle"),
    )


class _Placed(NamedTuple):
    """A circle's frame (its normal last), centre and radius."""

    frame: Floats
    centre: Floats
    radius: float


def _in_space(about: Floats, centroid: Floats, extent: float, u_point: float | None) -> Circle:
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
        return _Placed(tilted(state.frame, step[3], step[4]), centre, float(state.radius + step[5]))

    frame = frame_about(upward(principal(about)[2]))
    flat = radial_minimum((frame @ about)[:2], "circle")
    start = _Placed(frame, flat.state[:2] @ frame[:2], float(flat.state[2]))
    found = minimise(start, linearise, move, "circle")
    placed = found.state
    natural = np.zeros((7, 6))
    natural[:3, :3] = extent * placed.frame.T
    natural[3:6, 3:5] = placed.frame[:2].T
    natural[6, 5] = extent
    return Circle(
        centre=centroid + extent * placed.centre,
        radius=float(extent * placed.radius),
        normal=placed.frame[2],
        **fit_figures(found, extent, ("x", "y", "z", "nx", "ny", "nz", "r"), natural, u_point, "circle", 2),
    )
