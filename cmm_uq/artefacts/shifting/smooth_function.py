"""A smooth error of one position, and the density of observations with everything linear integrated out.

A function is a Gaussian process with Matérn correlation of order 7/2 (three times differentiable), whose size may differ
between the middle of the range and its ends. It is written as a sum of sines (the Hilbert-space basis of Solin & Särkkä
2020, eq. 56 and 68), so that for given amplitude A, correlation length ℓ and growth r it is linear in Gaussian coefficients:

    f(x) = (1 + (r − 1)·u⁶) · Σ_j w_j · sin(ω_j (x − x₀)),   w_j ~ N(0, A²·S(ω_j, ℓ)),   u = −1 … 1 over the range.
    observed = (even + (r − 1)·ends) · w + columns · x + noise,   w ~ N(0, sd²), x ~ N(0, column_sd²), noise ~ N(0, σ²)

Few observations: factor their covariance. Fewer coefficients: factor their precision (Rasmussen & Williams 2006, A.3).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from math import gamma, pi, sqrt

import numpy as np

from cmm_uq.base.points import Floats

LONGEST = 0.8  # longest correlation length as a part of the range; a longer one looks the same with a larger amplitude
FINEST = 1 / 40  # shortest correlation length as a part of the range that is tried, however dense the readings
_BOUNDARY = 2.5  # the sines vanish at this many half ranges from the middle, so far that the range hardly feels it
_ORDER = 3.5
_GROWTH_POWER = 6
# of the Matérn spectral density (Rasmussen & Williams 2006, eq. 4.15, one dimension)
_DENSITY = 2 * sqrt(pi) * gamma(_ORDER + 0.5) / gamma(_ORDER) * (2 * _ORDER) ** _ORDER


@dataclass(frozen=True, eq=False)
class SmoothFunction:
    """One error as a function of one position, and where the observations look it up."""

    name: str  # as in results.json, such as ``linearity_x``
    low: float  # low, high: range of positions, mm
    high: float
    shortest: float  # shortest correlation length, mm; the shortest sine is two of them long
    position: Floats  # (n,) where each observation looks the function up, mm
    factor: Floats  # (n,) what the observation shows of one unit of the function
    typical: float  # size that such an error usually has, in the function's unit (mm, or rad)

    @property
    def range(self) -> float:
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


BATCH = 250  # parameter vectors handled at once


@dataclass(frozen=True, eq=False)
class SmoothMarginal(ABC):
    """Observations, whitened and freed of all of which nothing is known beforehand."""

    observed: Floats  # (p,) mm
    even: Floats  # even, ends: (p, J) design of the coefficients
    ends: Floats
    columns: Floats  # columns, column_sd: (p, c) and (c,)
    column_sd: Floats
    squares: float  # squares, dof: sum of squares, mm², and degrees of freedom that tell of σ alone
    dof: int

    def log_likelihood(self, sd: Floats, growth: Floats, sigma: Floats) -> Floats:
        """For standard deviations of the coefficients (w, J), growths r (w,) and σ (w,): (w,), up to a constant."""
        rest = -0.5 * self.squares / sigma**2 - self.dof * np.log(sigma)
        some = [slice(i, i + BATCH) for i in range(0, len(sd), BATCH)]
        return np.asarray(rest + np.concatenate([self._log_density(sd[s], growth[s], sigma[s]) for s in some]))

    @abstractmethod
    def _log_density(self, sd: Floats, growth: Floats, sigma: Floats) -> Floats: ...

    @abstractmethod
    def draw(self, sd: Floats, growth: Floats, sigma: Floats, random: np.random.Generator) -> tuple[Floats, Floats]:
        """One draw of w (N, J) and x (N, c) for each parameter vector, from their exact conditional distribution."""


class ByObservations(SmoothMarginal):
    """For few observations; draws by Matheron's rule."""

    def _covariance(self, sd: Floats, growth: Floats, sigma: Floats) -> tuple[Floats, Floats]:
        """Design (w, p, J) and covariance of the observations (w, p, p)."""
        design = self.even + (growth - 1)[:, None, None] * self.ends
        scaled = design * sd[:, None, :]
        covariance = scaled @ scaled.transpose(0, 2, 1)
        known = self.columns * self.column_sd
        rounding = 1e-15 * np.einsum("wii->w", covariance)
        covariance += known @ known.T + (sigma**2 + rounding)[:, None, None] * np.eye(len(self.observed))
        return design, covariance

    def _log_density(self, sd: Floats, growth: Floats, sigma: Floats) -> Floats:
        _, covariance = self._covariance(sd, growth, sigma)
        values = np.broadcast_to(self.observed, (len(sd), len(self.observed)))
        factor, explained = _bordered(covariance, values, 1 + 2 * (self.observed @ self.observed) / sigma**2)
        return np.asarray(-0.5 * np.einsum("wi,wi->w", explained, explained) - np.log(factor).sum(axis=1))

    def draw(self, sd: Floats, growth: Floats, sigma: Floats, random: np.random.Generator) -> tuple[Floats, Floats]:
        design, covariance = self._covariance(sd, growth, sigma)
        w = sd * random.standard_normal(sd.shape)
        x = self.column_sd * random.standard_normal((len(sd), len(self.column_sd)))
        noise = sigma[:, None] * random.standard_normal((len(sd), len(self.observed)))
        prior = np.einsum("wpj,wj->wp", design, w) + x @ self.columns.T + noise
        weight = np.linalg.solve(covariance, (self.observed - prior)[:, :, None])[:, :, 0]
        w += sd**2 * np.einsum("wpj,wp->wj", design, weight)
        x += self.column_sd**2 * (weight @ self.columns)
        return w, x


class ByCoefficients(SmoothMarginal):
    """For many observations of few coefficients; draws from the factor of their precision."""

    @cached_property
    def _products(self) -> tuple[Floats, Floats, Floats, Floats, Floats]:
        """Normal matrix as a polynomial in r − 1, its three terms (K, K), and the right-hand side's two (K,)."""
        even = np.hstack([self.even, self.columns])
        ends = np.hstack([self.ends, np.zeros_like(self.columns)])
        cross = even.T @ ends
        return even.T @ even, cross + cross.T, ends.T @ ends, even.T @ self.observed, ends.T @ self.observed

    def _precision(self, sd: Floats, growth: Floats, sigma: Floats) -> tuple[Floats, Floats, Floats]:
        """All standard deviations (w, K); precision (w, K, K) and right-hand side (w, K) of coefficients in units of them."""
        even, cross, ends, right_even, right_ends = self._products
        every = np.hstack([sd, np.broadcast_to(self.column_sd, (len(sd), len(self.column_sd)))])
        r = (growth - 1)[:, None, None]
        scaled = every / sigma[:, None]
        precision = r * ends  # in place from here on: a sampler spends its time in these matrices
        precision += cross
        precision *= r
        precision += even
        precision *= scaled[:, :, None]
        precision *= scaled[:, None, :]
        np.einsum("wii->wi", precision)[:] += 1.0
        return every, precision, scaled / sigma[:, None] * (right_even + r[:, :, 0] * right_ends)

    def _log_density(self, sd: Floats, growth: Floats, sigma: Floats) -> Floats:
        _, precision, right = self._precision(sd, growth, sigma)
        total = self.observed @ self.observed / sigma**2
        factor, explained = _bordered(precision, right, 1 + 2 * total)
        fitted = np.einsum("wi,wi->w", explained, explained)
        return np.asarray(-0.5 * (total - fitted) - np.log(factor).sum(axis=1) - len(self.observed) * np.log(sigma))

    def draw(self, sd: Floats, growth: Floats, sigma: Floats, random: np.random.Generator) -> tuple[Floats, Floats]:
        every, precision, right = self._precision(sd, growth, sigma)
        factor = np.linalg.cholesky(precision)
        mean = np.linalg.solve(factor, right[:, :, None])
        spread = random.standard_normal(right.shape)[:, :, None]
        both = every * np.linalg.solve(factor.transpose(0, 2, 1), mean + spread)[:, :, 0]
        return both[:, : sd.shape[1]], both[:, sd.shape[1] :]


def marginal(
    observed: Floats, even: Floats, ends: Floats, columns: Floats, column_sd: Floats, squares: float, dof: int
) -> SmoothMarginal:
    """In the space that is smaller."""
    few = even.shape[1] + columns.shape[1] < len(observed)
    return (ByCoefficients if few else ByObservations)(observed, even, ends, columns, column_sd, squares, dof)


def _bordered(matrix: Floats, right: Floats, corner: Floats) -> tuple[Floats, Floats]:
    """Diagonal (w, p) of the triangular factor L of (w, p, p), and L⁻¹·right (w, p): one factorisation gives both."""
    size = right.shape[1]
    bordered = np.empty((len(matrix), size + 1, size + 1))
    bordered[:, :size, :size], bordered[:, size, :size] = matrix, right
    bordered[:, size, size] = corner
    factor = np.linalg.cholesky(bordered)
    return np.einsum("wii->wi", factor)[:, :size], factor[:, size, :size]
