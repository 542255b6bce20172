"""Observations explained by smooth functions: the marginal density of what shapes them, and exact draws of the rest.

    observed = flat · (anything) + columns · N(0, sd²) + Σ factor · f(position) + noise,   noise_i ~ N(0, (σ · noise_scale_i)²)

Whatever enters linearly is integrated exactly. What remains to be sampled is a handful of numbers θ: the logarithms of each
function's amplitude, of the correlation length as a part of the range, of the ends' size over the middle's, and of σ unless
it is stated. Given θ, all coefficients are drawn at once from their exact conditional (Matheron's rule).

A function is a Gaussian process with Matérn correlation of order 7/2 (three times differentiable), whose size may differ
between the middle of the range and its ends. It is written as a sum of sines (the Hilbert-space basis of Solin & Särkkä
2020, eq. 56 and 68), so that for given amplitude A, correlation length ℓ and growth r it is linear in Gaussian coefficients:

    f(x) = (1 + (r − 1)·u⁶) · Σ_j w_j · sin(ω_j (x − x₀)),   w_j ~ N(0, A²·S(ω_j, ℓ)),   u = −1 … 1 over the range.

Few observations: factor their covariance. Fewer coefficients: factor their precision (Rasmussen & Williams 2006, A.3).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from functools import cached_property
from math import gamma, pi, sqrt

import numpy as np
from scipy import linalg

from cmm_uq.base.points import Floats
from cmm_uq.base.values import dataclass
from cmm_uq.maths.inference.draws import evenly
from cmm_uq.maths.inference.ensembles import Chains, Progress, run_ensembles
from cmm_uq.maths.inference.marginal import SIGMA_BOUNDS
from cmm_uq.maths.inference.proposals import refined

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
    """Observations, whitened and freed of all of which nothing is known beforehand.

    observed = (even + (r − 1)·ends) · w + columns · x + noise,   w ~ N(0, sd²), x ~ N(0, column_sd²), noise ~ N(0, σ²)
    """

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


def _bordered(matrix: Floats, right: Floats, corner: Floats) -> tuple[Floats, Floats]:
    """Diagonal (w, p) of the triangular factor L of (w, p, p), and L⁻¹·right (w, p): one factorisation gives both."""
    size = right.shape[1]
    bordered = np.empty((len(matrix), size + 1, size + 1))
    bordered[:, :size, :size], bordered[:, size, :size] = matrix, right
    bordered[:, size, size] = corner
    factor = np.linalg.cholesky(bordered)
    return np.einsum("wii->wi", factor)[:, :size], factor[:, size, :size]


DRAWS = 2000  # of everything linear, taken evenly from the chains
EFFECTIVE_SAMPLES = 2000
_AMPLITUDE_BOUNDS = (1e-4, 1e2)  # of each amplitude over its typical size
# median correlation length as a part of the range, and the standard deviation of its logarithm: five hills or so
_LENGTH, _LENGTH_SPREAD = 0.2, 0.6
_GROWTH_SPREAD = 1.5  # standard deviation of the logarithm of the ends' size over the middle's
_GROWTH_BOUNDS = 0.5, 8.0  # quieter ends look all the same: a plateau on which chains would get stuck


@dataclass(frozen=True)
class Scatter:
    """Repeated readings about their means: sum of squares over noise_scale², mm², and its degrees of freedom."""

    squares: float
    dof: int

    @property
    def sigma(self) -> float:
        return float(np.sqrt(self.squares / self.dof))


@dataclass(frozen=True, eq=False)
class SmoothModel:
    observed: Floats  # (n,) mm
    noise_scale: Floats  # (n,) positive
    flat: Floats  # (n, q) columns of which nothing is known beforehand; of full rank
    columns: Floats  # columns, column_sd: (n, c) and (c,) columns with Gaussian coefficients about zero
    column_sd: Floats
    functions: tuple[SmoothFunction, ...]  # at least one
    scatter: Scatter | None  # of repeats, where σ is to be estimated from them too
    sigma: float | None  # standard uncertainty of one reading, mm; ``None`` when it is to be estimated

    @property
    def dimension(self) -> int:
        return len(self.functions) + 2 + (self.sigma is None)

    @cached_property
    def _reduced(self) -> SmoothMarginal:
        """Whitened, and projected on what the flat columns cannot explain."""
        Q, _ = linalg.qr(self.flat / self.noise_scale[:, None])
        rest = Q[:, self.flat.shape[1] :].T / self.noise_scale
        seen = [(f.factor, f.growth(f.position), f.sines(f.position)) for f in self.functions]
        even = np.hstack([rest @ (factor[:, None] * sines) for factor, _, sines in seen])
        ends = np.hstack([rest @ ((factor * growth)[:, None] * sines) for factor, growth, sines in seen])
        observed, columns = rest @ self.observed, rest @ self.columns
        every = np.hstack([even, ends, columns])
        squares, dof = 0.0, 0
        if every.shape[1] < len(observed):
            Q, _ = linalg.qr(every, mode="economic")
            squares = float(observed @ observed - np.sum((Q.T @ observed) ** 2))
            dof = len(observed) - Q.shape[1]
            observed, even, ends, columns = Q.T @ observed, Q.T @ even, Q.T @ ends, Q.T @ columns
        if self.scatter is not None:
            squares, dof = squares + self.scatter.squares, dof + self.scatter.dof
        fewer = even.shape[1] + columns.shape[1] < len(observed)
        smaller = ByCoefficients if fewer else ByObservations
        return smaller(observed, even, ends, columns, self.column_sd, max(squares, 0.0), dof)

    def _unpacked(self, theta: Floats) -> tuple[Floats, Floats, Floats]:
        """Standard deviations of the coefficients (w, J), growths r (w,) and σ (w,) mm."""
        count = len(self.functions)
        spectra = [
            (f.typical * np.exp(theta[:, i]))[:, None] * f.spectrum(np.exp(theta[:, count]) * f.range)
            for i, f in enumerate(self.functions)
        ]
        sigma = np.exp(theta[:, -1]) if self.sigma is None else np.full(len(theta), self.sigma)
        return np.concatenate(spectra, axis=1), np.exp(theta[:, count + 1]), sigma

    def _bounds(self) -> tuple[Floats, Floats]:
        shortest = max(f.shortest / f.range for f in self.functions)
        low = [*[_AMPLITUDE_BOUNDS[0]] * len(self.functions), min(shortest, LONGEST / 2), _GROWTH_BOUNDS[0]]
        high = [*[_AMPLITUDE_BOUNDS[1]] * len(self.functions), LONGEST, _GROWTH_BOUNDS[1]]
        if self.sigma is None:
            low, high = [*low, SIGMA_BOUNDS[0]], [*high, SIGMA_BOUNDS[1]]
        return np.log(low), np.log(high)

    def log_density(self, theta: Floats) -> Floats:
        """Log posterior density of θ, up to a constant: (w, dimension) → (w,)."""
        count = len(self.functions)
        amplitudes = theta[:, :count]
        value = np.sum(amplitudes - np.log1p(np.exp(2 * amplitudes)), axis=1)
        value -= 0.5 * ((theta[:, count] - np.log(_LENGTH)) / _LENGTH_SPREAD) ** 2
        value -= 0.5 * (theta[:, count + 1] / _GROWTH_SPREAD) ** 2
        low, high = self._bounds()
        value = np.where(np.all((theta > low) & (theta < high), axis=1), value, -np.inf)
        if (inside := np.flatnonzero(np.isfinite(value))).size:
            value[inside] += self._reduced.log_likelihood(*self._unpacked(theta[inside]))
        return value

    def laplace(self) -> tuple[Floats, Floats]:
        """Mode (d,) and triangular factor (d, d) of the covariance about it."""
        from scipy import optimize  # takes longer to import than most commands run

        # the best of a few hundred places to start from
        count, inner = len(self.functions), self._inner()
        sigmas = [1e-4, 3e-4, 1e-3, 3e-3, 1e-2] if self.scatter is None else [self.scatter.sigma]
        noise = [[s] for s in np.log(sigmas)] if self.sigma is None else [[]]
        starts = [
            [*[a] * count, np.log(length), growth, *s]
            for a in np.log([0.1, 0.5, 2.0, 8.0]) for length in (0.12, 0.2, 0.33) for growth in (0.0, 1.0) for s in noise
        ]  # fmt: skip
        theta = np.clip(np.array(starts), *np.array(inner).T)
        start = np.asarray(theta[np.argmax(self.log_density(theta))])
        found = optimize.minimize(self._value_and_slope, start, jac=True, method="L-BFGS-B", bounds=inner)
        centre = np.asarray(found.x, dtype=np.float64)
        size, axes = linalg.eigh(self._curvature(centre))
        covariance = (axes / np.maximum(size, 0.25)) @ axes.T  # nothing in θ is left wider than 2 in its logarithm
        return centre, np.asarray(linalg.cholesky(covariance, lower=True))

    def _inner(self) -> list[tuple[float, float]]:
        low, high = self._bounds()
        return list(zip(low + 0.02, high - 0.02, strict=True))

    def _value_and_slope(self, centre: Floats) -> tuple[float, Floats]:
        d, step = self.dimension, 1e-4
        around = np.vstack([centre, centre + step * np.eye(d), centre - step * np.eye(d)])
        value = -self.log_density(around)
        return float(value[0]), (value[1 : d + 1] - value[d + 1 :]) / (2 * step)

    def _curvature(self, centre: Floats) -> Floats:
        d, step = self.dimension, 0.05
        low, high = np.array(self._inner()).T
        centre, unit = np.clip(centre, low + 2 * step, high - 2 * step), step * np.eye(d)
        corners = [centre + a * one + b * other for one in unit for other in unit for a in (1, -1) for b in (1, -1)]
        value = self.log_density(np.array(corners)).reshape(d, d, 4)
        return -(value[:, :, 0] - value[:, :, 1] - value[:, :, 2] + value[:, :, 3]) / (4 * step**2)

    def draw(self, theta: Floats, random: np.random.Generator) -> Coefficients:
        """One exact draw of everything linear for each θ (N, dimension)."""
        Q, R = linalg.qr(self.flat / self.noise_scale[:, None], mode="economic")
        parts = []
        for begin in range(0, len(theta), BATCH):
            sd, growth, sigma = self._unpacked(theta[begin : begin + BATCH])
            w, x = self._reduced.draw(sd, growth, sigma, random)
            left = (self.observed - self._explained(w, growth, x)) / self.noise_scale
            spread = sigma[:, None] * random.standard_normal((len(sd), Q.shape[1]))
            parts.append((w, x, linalg.solve_triangular(R, (left @ Q + spread).T).T))
        w, x, flat = (np.concatenate(part) for part in zip(*parts, strict=True))
        _, growth, sigma = self._unpacked(theta)
        return Coefficients(self, w, growth, x, flat, sigma)

    def without_functions(self, sigma: float) -> Floats:
        """(n,) residuals of the flat and other columns alone, mm, by least squares.

        The other columns keep to what is known of them: free ones would explain any reading by a scale of nothing.
        """
        design = np.hstack([self.flat, self.columns])
        held = np.hstack([np.zeros((len(self.column_sd), self.flat.shape[1])), np.diag(sigma / self.column_sd)])
        weighted = np.vstack([design / self.noise_scale[:, None], held])
        wanted = np.r_[self.observed / self.noise_scale, np.zeros(len(held))]
        return np.asarray(self.observed - design @ np.linalg.lstsq(weighted, wanted, rcond=None)[0])

    def _explained(self, w: Floats, growth: Floats, x: Floats) -> Floats:
        """What functions and columns explain of every observation, (N, n)."""
        explained: Floats = x @ self.columns.T
        for f, part in zip(self.functions, self._split(w), strict=True):
            explained += f.factor * f.values(f.position, part, growth)
        return explained

    def _split(self, w: Floats) -> list[Floats]:
        ends = np.cumsum([f.sines(np.zeros(1)).shape[1] for f in self.functions])
        return np.split(w, ends[:-1], axis=1)


@dataclass(frozen=True, eq=False)
class Coefficients:
    model: SmoothModel
    coefficients: Floats  # (N, J) of all functions' sines
    growth: Floats  # (N,) the ends' size over the middle's
    columns: Floats  # columns, flat: (N, c) and (N, q)
    flat: Floats
    sigma: Floats  # (N,) mm

    def function(self, index: int, x: Floats) -> Floats:
        """One of the functions at positions (m,): (N, m)."""
        return self.model.functions[index].values(x, self.model._split(self.coefficients)[index], self.growth)

    @property
    def left(self) -> Floats:
        """(n,) observed minus the posterior mean of everything that explains it, mm."""
        model = self.model
        fitted = self.flat.mean(axis=0) @ model.flat.T + self.columns.mean(axis=0) @ model.columns.T
        for index, f in enumerate(model.functions):
            fitted += f.factor * self.function(index, f.position).mean(axis=0)
        return np.asarray(model.observed - fitted)


def sampled(model: SmoothModel, seed: int, progress: Progress | None) -> tuple[Coefficients, Chains]:
    """Draws of everything linear, evenly along chains of θ, and the chains."""
    proposal = refined(model.log_density, *model.laplace(), seed)
    chains = run_ensembles(
        model.log_density, proposal, seed, progress, effective_samples=EFFECTIVE_SAMPLES, steps_at_once=200
    )
    chosen = chains.draws[evenly(len(chains.draws), DRAWS)]
    return model.draw(chosen, np.random.default_rng(np.random.SeedSequence([seed, 1]))), chains
