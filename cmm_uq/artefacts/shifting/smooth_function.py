"""A smooth error of one position: what it may look like before anything is measured.

A function is a Gaussian process with Matérn correlation of order 7/2 (three times differentiable), whose size may differ
between the middle of the range and its ends. It is written as a sum of sines (the Hilbert-space basis of Solin & Särkkä
2020, eq. 56 and 68), so that for given amplitude A, correlation length ℓ and growth r it is linear in Gaussian coefficients:

    f(x) = (1 + (r − 1)·u⁶) · Σ_j w_j · sin(ω_j (x − x₀)),   w_j ~ N(0, A²·S(ω_j, ℓ)),   u = −1 … 1 over the range.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import gamma, pi, sqrt

import numpy as np

from cmm_uq.base.points import Floats

LONGEST = 0.8
"""Longest correlation length as a part of the range; a longer one looks the same with a larger amplitude."""
FINEST = 1 / 40
"""Shortest correlation length as a part of the range that is tried, however dense the readings."""

_BOUNDARY = 2.5
"""The sines vanish at this many half ranges from the middle, so far that the range hardly feels it."""
_ORDER = 3.5
_GROWTH_POWER = 6
_DENSITY = 2 * sqrt(pi) * gamma(_ORDER + 0.5) / gamma(_ORDER) * (2 * _ORDER) ** _ORDER
"""Of the Matérn spectral density (Rasmussen & Williams 2006, eq. 4.15, one dimension)."""


@dataclass(frozen=True, eq=False)
class SmoothFunction:
    """One error as a function of one position, and where the observations look it up.

    Parameters
    ----------
    name : as in results.json, such as ``linearity_x``.
    low, high : range of positions, mm.
    shortest : shortest correlation length, mm; the shortest sine is two of them long.
    position : (n,) where each observation looks the function up, mm.
    factor : (n,) what the observation shows of one unit of the function.
    typical : size that such an error usually has, in the function's unit (mm, or rad).
    """

    name: str
    low: float
    high: float
    shortest: float
    position: Floats
    factor: Floats
    typical: float

    @property
    def range(self) -> float:
        """Length of the range, mm."""
        return self.high - self.low

    @cached_property
    def frequency(self) -> Floats:
        """Angular frequencies of the sines, (j,) rad/mm."""
        count = int(np.ceil(_BOUNDARY * self.range / self.shortest))
        return np.asarray(np.arange(1, count + 1) * pi / (_BOUNDARY * self.range), dtype=np.float64)

    def sines(self, x: Floats) -> Floats:
        """(m,) positions → (m, j)."""
        start = (self.low + self.high - _BOUNDARY * self.range) / 2
        scale = sqrt(2 / (_BOUNDARY * self.range))
        return np.asarray(scale * np.sin(np.multiply.outer(x - start, self.frequency)))

    def growth(self, x: Floats) -> Floats:
        """(m,) positions → u⁶: zero about the middle, one at the ends."""
        return np.asarray(((2 * x - self.low - self.high) / self.range) ** _GROWTH_POWER, dtype=np.float64)

    def spectrum(self, length: Floats) -> Floats:
        """Standard deviations of the coefficients for unit amplitude, (w,) correlation lengths in mm → (w, j)."""
        corner = 2 * _ORDER / length[:, None] ** 2
        power = _DENSITY * length[:, None] ** (-2 * _ORDER) * (corner + self.frequency**2) ** (-_ORDER - 0.5)
        return np.asarray(np.sqrt(power))

    def values(self, x: Floats, coefficients: Floats, end_to_middle: Floats) -> Floats:
        """The function at positions (m,), for coefficients (N, j) and growths r (N,): (N, m)."""
        envelope = 1 + np.multiply.outer(end_to_middle - 1, self.growth(x))
        return np.asarray(envelope * (coefficients @ self.sines(x).T))
