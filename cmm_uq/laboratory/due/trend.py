"""A straight line through the values of one machine since it was last adjusted.

Generalised least squares: the values are as uncertain as their certificates say, and what comes from the artefact is common
to all that were made with it. A common error shifts the line and does not tilt it. Where the values scatter about the line by
more than their uncertainties allow, the line is as much more uncertain (Birge ratio).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cmm_uq.base.points import Floats
from cmm_uq.laboratory.due.change import common_part
from cmm_uq.laboratory.records import Series

YEAR = 365.2425
"""Days."""

_LEAST = 1e-9
"""Standard uncertainty of a value that is stated without one, as a part of the largest value."""


@dataclass(frozen=True)
class Line:
    """The line.

    Parameters
    ----------
    count : values that it was fitted to.
    day : ordinal, at which ``value`` stands: that of the last of them.
    value, slope : then, and its change a year.
    covariance : (2, 2) of both.
    excess : Birge ratio: scatter about the line over what the uncertainties allow; 1 where it is no more, and for two values.
    """

    count: int
    day: int
    value: float
    slope: float
    covariance: Floats
    excess: float

    def at(self, day: Floats) -> tuple[Floats, Floats]:
        """Value and standard uncertainty (n,) on days (n,), ordinals."""
        years = (np.asarray(day, dtype=np.float64) - self.day) / YEAR
        terms = np.column_stack([np.ones_like(years), years])
        u = np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", terms, self.covariance, terms), 0))
        return self.value + self.slope * years, u

    @property
    def u_slope(self) -> float:
        """Standard uncertainty of the slope."""
        return float(np.sqrt(self.covariance[1, 1]))


def epochs(series: Series) -> list[slice]:
    """Rows between adjustments, in turn."""
    starts = np.flatnonzero(np.diff(series.adjusted_since, prepend=-1))
    return [slice(int(a), int(b)) for a, b in zip(starts, [*starts[1:], len(series.day)], strict=True)]


def covariance_of(u: Floats, u_artefact: Floats, artefact: NDArray[np.str_]) -> Floats:
    """Covariance (n, n) of values (n,): what the artefact contributes is common to all with the same one."""
    same = (np.asarray(artefact)[:, None] == np.asarray(artefact)[None, :]) & (np.asarray(artefact) != "")
    covariance = np.where(same, np.outer(u_artefact, u_artefact), 0.0)
    np.fill_diagonal(covariance, np.asarray(u, dtype=np.float64) ** 2)
    return np.asarray(covariance, dtype=np.float64)


def trend(series: Series) -> Line | None:
    """The line through the values since the last adjustment; ``None`` where they are of fewer than two days."""
    rows = epochs(series)[-1] if len(series.day) else slice(0, 0)
    day, value = series.day[rows], series.value[rows]
    if len(np.unique(day)) < 2:
        return None
    pairs = zip(series.u[rows], series.u_artefact[rows], strict=True)
    common = np.array([common_part(float(u), float(shared)) for u, shared in pairs])
    covariance = covariance_of(series.u[rows], common, series.artefact[rows])
    floor = _LEAST * max(float(np.abs(value).max()), 1e-30)
    covariance += np.diag(np.full(len(day), floor**2))
    terms = np.column_stack([np.ones(len(day)), (day - day[-1]) / YEAR])
    weighed = np.linalg.solve(covariance, terms)
    spread = np.linalg.inv(terms.T @ weighed)
    found = spread @ (weighed.T @ value)
    left = value - terms @ found
    freedoms = len(day) - 2
    chi2 = float(left @ np.linalg.solve(covariance, left))
    excess = max(1.0, float(np.sqrt(chi2 / freedoms))) if freedoms else 1.0
    return Line(len(day), int(day[-1]), float(found[0]), float(found[1]), excess**2 * spread, excess)
