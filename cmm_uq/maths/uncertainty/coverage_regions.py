"""Joint coverage regions of several outputs (JCGM 102:2011 6.5 and 7.7): ellipsoid, rectangle, smallest region."""

from __future__ import annotations

from dataclasses import dataclass
from math import gamma, pi

import numpy as np
from numpy.typing import NDArray

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats
from cmm_uq.maths.uncertainty.degrees_of_freedom import check_coverage


@dataclass(frozen=True, eq=False)
class Ellipsoid:
    """All η with (η − y)ᵀ V⁻¹ (η − y) ≤ factor²; centre (p,), covariance (p, p)."""

    centre: Floats
    covariance: Floats
    factor: float

    @property
    def volume(self) -> float:
        """Area in two dimensions, volume in three."""
        p = len(self.centre)
        ball = pi ** (p / 2) / gamma(p / 2 + 1)
        return float(ball * self.factor**p * np.sqrt(np.linalg.det(self.covariance)))

    def contains(self, points: Floats) -> NDArray[np.bool_]:
        """Which of the points (p, n) lie inside."""
        return np.asarray(_distances(points, self.centre, self.covariance) <= self.factor)


@dataclass(frozen=True, eq=False)
class Rectangle:
    """All η with |ηⱼ − yⱼ| ≤ factor · uⱼ for every output."""

    centre: Floats
    u: Floats
    factor: float

    @property
    def volume(self) -> float:
        """Area in two dimensions, volume in three."""
        return float(np.prod(2 * self.factor * self.u))


@dataclass(frozen=True, eq=False)
class SmallestRegion:
    """Cells of a mesh that hold the coverage probability in the smallest area.

    Parameters
    ----------
    inside : (k, l) which cells belong to it.
    x, y : edges (k + 1,) and (l + 1,) of the cells.
    """

    inside: NDArray[np.bool_]
    x: Floats
    y: Floats

    @property
    def area(self) -> float:
        """Area of the region."""
        return float(np.sum(self.inside * np.outer(np.diff(self.x), np.diff(self.y))))


def elliptical_factor(outputs: int, coverage: float = 0.95) -> float:
    """Factor of the ellipsoid for normal outputs, √χ²: 2.4477 for two and 95 % (JCGM 102 table 1)."""
    from scipy import special

    check_coverage(coverage)
    return float(np.sqrt(special.chdtri(outputs, 1 - coverage)))


def elliptical_region(draws: Floats, coverage: float = 0.95) -> Ellipsoid:
    """Ellipsoid about the mean that holds the coverage probability of draws (p, n) (7.7.2).

    Raises
    ------
    CmmUqError : the outputs are bound to a line or a plane, where no ellipsoid has a volume.
    """
    check_coverage(coverage)
    centre, covariance = draws.mean(axis=1), np.atleast_2d(np.cov(draws))
    if np.linalg.matrix_rank(covariance / np.sqrt(np.outer(np.diag(covariance), np.diag(covariance)))) < len(draws):
        raise CmmUqError("the outputs depend on each other completely", fix="Leave out those that follow from others")
    return Ellipsoid(centre, covariance, _quantile(_distances(draws, centre, covariance), coverage))


def rectangular_region(draws: Floats, coverage: float = 0.95) -> Rectangle:
    """Rectangle about the mean, proportional to the uncertainties, that holds the coverage probability (7.7.3)."""
    check_coverage(coverage)
    centre, u = draws.mean(axis=1), draws.std(axis=1, ddof=1)
    largest = np.max(np.abs(draws - centre[:, None]) / u[:, None], axis=0)
    return Rectangle(centre, u, _quantile(largest, coverage))


def smallest_region(draws: Floats, coverage: float = 0.95, cells: int = 60) -> SmallestRegion:
    """Smallest region of two outputs, on a mesh (7.7.4): the fullest cells first, until they hold the probability.

    Parameters
    ----------
    draws : (2, n); a hundred times as many as there are cells, or more.
    cells : along each output.

    Raises
    ------
    CmmUqError : not two outputs, or too few draws for the mesh.
    """
    check_coverage(coverage)
    if len(draws) != 2 or draws.shape[1] < 100 * cells:
        raise CmmUqError(
            f"{draws.shape[1]} draws of {len(draws)} outputs for a mesh of {cells} × {cells} cells",
            fix="It takes two outputs and more draws, or fewer cells",
        )
    counts, x, y = np.histogram2d(draws[0], draws[1], bins=cells)
    fullest = np.argsort(-counts, axis=None, kind="stable")
    held = np.cumsum(counts.ravel()[fullest])
    needed = int(np.searchsorted(held, coverage * draws.shape[1])) + 1
    inside = np.zeros(counts.size, dtype=bool)
    inside[fullest[:needed]] = True
    return SmallestRegion(inside.reshape(counts.shape), x, y)


def _distances(points: Floats, centre: Floats, covariance: Floats) -> Floats:
    whitened = np.linalg.solve(np.linalg.cholesky(covariance), points - centre[:, None])
    return np.asarray(np.sqrt(np.sum(whitened**2, axis=0)))


def _quantile(distances: Floats, coverage: float) -> float:
    """Distance that the fraction ``coverage`` of the draws does not exceed."""
    return float(np.sort(distances)[int(np.ceil(coverage * len(distances))) - 1])
