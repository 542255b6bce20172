"""Least-squares line in space or in a plane."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats
from cmm_uq.maths.geometry.feature import Feature, centred, checked_points, fit_figures
from cmm_uq.maths.geometry.frame import frame_about, upward
from cmm_uq.maths.geometry.orthogonal_distance import minimum_at, principal


@dataclass(frozen=True, eq=False, kw_only=True)
class Line(Feature):
    """Least-squares line through the centroid of its points.

    The covariance is of the coordinates of that point, which is free across the line only, and of the components of the
    unit direction, whose largest is positive. Residuals are (n,) in a plane, (n, 2) in space: two directions across it.
    """

    point: Floats
    direction: Floats

    @property
    def form_deviation(self) -> float:
        """In a plane peak to valley, in space the diameter of the cylinder about the line that holds all points, mm."""
        if self.residuals.ndim == 1:
            return float(np.ptp(self.residuals))
        return float(2 * np.linalg.norm(self.residuals, axis=1).max())


def fit_line(points: ArrayLike, *, u_point: float | None = None) -> Line:
    """Line through at least two points that do not coincide.

    Parameters
    ----------
    points : (n, 3) or (n, 2) in mm.
    u_point : standard uncertainty of a point across the line in each direction, mm; estimated when left out.

    Raises
    ------
    CmmUqError : too few points, or all in one place.
    """
    array = checked_points(points, "line", 2, (2, 3))
    about, centroid, extent = centred(array)
    if extent == 0:
        raise CmmUqError("line: all points are in one place", fix="Measure points that spread along the line")
    direction = upward(principal(about)[0])
    across = _across(direction)
    along, offsets = direction @ about, across @ about
    k = len(across)
    rows = np.zeros((2 * k + 1, k, len(array)))
    for i in range(k):
        rows[i, i], rows[k + i, i] = -1.0, -along
    rows[-1] = offsets
    found = minimum_at(direction, rows.reshape(2 * k + 1, -1), "line")
    natural = np.asarray(np.kron(np.diag([extent, 1.0]), across.T), dtype=np.float64)
    letters = "xyz"[: k + 1]
    names = (*letters, *(f"d{a}" for a in letters))
    return Line(point=centroid, direction=direction, **fit_figures(found, extent, names, natural, u_point, "line", k))


def _across(direction: Floats) -> Floats:
    """Unit vectors (d − 1, d) across a direction (d,)."""
    if len(direction) == 2:
        return np.array([[-direction[1], direction[0]]])
    return frame_about(direction)[:2]
