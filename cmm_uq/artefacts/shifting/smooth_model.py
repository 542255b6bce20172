"""Observations explained by smooth functions: the marginal density of what shapes them, and exact draws of the rest.

    observed = flat · (anything) + columns · N(0, sd²) + Σ factor · f(position) + noise,   noise_i ~ N(0, (σ · noise_scale_i)²)

Whatever enters linearly is integrated exactly. What remains to be sampled is a handful of numbers θ: the logarithms of each
function's amplitude, of the correlation length as a part of the range, of the ends' size over the middle's, and of σ unless
it is stated. Given θ, all coefficients are drawn at once from their exact conditional (Matheron's rule).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import linalg

from cmm_uq.artefacts.shifting.smooth_function import BATCH, LONGEST, SmoothFunction, SmoothMarginal, marginal
from cmm_uq.base.points import Floats
from cmm_uq.maths.inference.draws import evenly
from cmm_uq.maths.inference.ensembles import Chains, Progress, run_ensembles
from cmm_uq.maths.inference.posterior import SIGMA_BOUNDS
from cmm_uq.maths.inference.proposals import refined

DRAWS = 2000  # of everything linear, taken evenly from the chains
EFFECTIVE_SAMPLES = 2000
_AMPLITUDE_BOUNDS = (1e-4, 1e2)  # of each amplitude over its typical size
# median correlation length as a part of the range, and the standard deviation of its logarithm: five hills or so
_LENGTH, _LENGTH_SPREAD = 0.2, 0.6
_GROWTH_SPREAD = 1.5  # standard deviation of the logarithm of the ends' size over the middle's
# ends that are quieter than the middle by more than this look all the same: a plateau on which chains would get
# stuck
_GROWTH_BOUNDS = 0.5, 8.0


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
    """See the module's docstring."""

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
        even = np.hstack([rest @ (f.factor[:, None] * f.sines(f.position)) for f in self.functions])
        ends = np.hstack(
            [rest @ ((f.factor * f.growth(f.position))[:, None] * f.sines(f.position)) for f in self.functions]
        )
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
        return marginal(observed, even, ends, columns, self.column_sd, max(squares, 0.0), dof)

    def _unpacked(self, theta: Floats) -> tuple[Floats, Floats, Floats]:
        """Standard deviations of the coefficients (w, J), growths r (w,) and σ (w,) mm."""
        count = len(self.functions)
        spectra = []
        for i, f in enumerate(self.functions):
            amplitude = f.typical * np.exp(theta[:, i])
            spectra.append(amplitude[:, None] * f.spectrum(np.exp(theta[:, count]) * f.range))
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
        inside = np.flatnonzero(np.isfinite(value))
        if not inside.size:
            return value
        value[inside] += self._reduced.log_likelihood(*self._unpacked(theta[inside]))
        return value

    def laplace(self) -> tuple[Floats, Floats]:
        """Mode (d,) and triangular factor (d, d) of the covariance about it."""
        from scipy import optimize  # takes longer to import than most commands run

        # the best of a few hundred places to start from
        count = len(self.functions)
        noise = [0.0] if self.scatter is None else [np.log(self.scatter.sigma)]
        if self.sigma is None and self.scatter is None:
            noise = list(np.log([1e-4, 3e-4, 1e-3, 3e-3, 1e-2]))
        starts = [
            [*[a] * count, np.log(length), growth, *([s] if self.sigma is None else [])]
            for a in np.log([0.1, 0.5, 2.0, 8.0]) for length in (0.12, 0.2, 0.33) for growth in (0.0, 1.0) for s in noise
        ]  # fmt: skip
        low, high = np.array(self._inner()).T
        theta = np.clip(np.array(starts), low, high)
        start = np.asarray(theta[np.argmax(self.log_density(theta))])
        found = optimize.minimize(self._value_and_slope, start, jac=True, method="L-BFGS-B", bounds=self._inner())
        centre = np.asarray(found.x, dtype=np.float64)
        curvature = self._curvature(centre)
        size, axes = linalg.eigh(curvature)
        covariance = (axes / np.maximum(size, 0.25)) @ axes.T  # nothing in θ is left wider than 2 in its logarithm
        return centre, np.asarray(linalg.cholesky(covariance, lower=True))

    def _inner(self) -> list[tuple[float, float]]:
        low, high = self._bounds()
        margin = 0.02
        return list(zip(low + margin, high - margin, strict=True))

    def _value_and_slope(self, centre: Floats) -> tuple[float, Floats]:
        d, step = self.dimension, 1e-4
        around = np.vstack([centre, centre + step * np.eye(d), centre - step * np.eye(d)])
        value = -self.log_density(around)
        return float(value[0]), (value[1 : d + 1] - value[d + 1 :]) / (2 * step)

    def _curvature(self, centre: Floats) -> Floats:
        d, step = self.dimension, 0.05
        low, high = np.array(self._inner()).T
        centre = np.clip(centre, low + 2 * step, high - 2 * step)
        unit = step * np.eye(d)
        corners = [
            centre + a * unit[i] + b * unit[j] for i in range(d) for j in range(d) for a in (1, -1) for b in (1, -1)
        ]
        value = self.log_density(np.array(corners)).reshape(d, d, 4)
        return -(value[:, :, 0] - value[:, :, 1] - value[:, :, 2] + value[:, :, 3]) / (4 * step**2)

    def draw(self, theta: Floats, random: np.random.Generator) -> Coefficients:
        """One exact draw of everything linear for each θ (N, dimension)."""
        parts = list(self._draws(theta, random))
        coefficients, columns, flat = (np.concatenate(part) for part in zip(*parts, strict=True))
        _, growth, sigma = self._unpacked(theta)
        return Coefficients(self, coefficients, growth, columns, flat, sigma)

    def _draws(self, theta: Floats, random: np.random.Generator) -> Iterator[tuple[Floats, Floats, Floats]]:
        Q, R = linalg.qr(self.flat / self.noise_scale[:, None], mode="economic")
        for begin in range(0, len(theta), BATCH):
            sd, growth, sigma = self._unpacked(theta[begin : begin + BATCH])
            w, x = self._reduced.draw(sd, growth, sigma, random)
            left = (self.observed - self._explained(w, growth, x)) / self.noise_scale
            spread = sigma[:, None] * random.standard_normal((len(sd), Q.shape[1]))
            yield w, x, linalg.solve_triangular(R, (left @ Q + spread).T).T

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
        explained = x @ self.columns.T
        for f, part in zip(self.functions, self._split(w), strict=True):
            explained += f.factor * f.values(f.position, part, growth)
        return np.asarray(explained)

    def _split(self, w: Floats) -> list[Floats]:
        ends = np.cumsum([f.sines(np.zeros(1)).shape[1] for f in self.functions])
        return np.split(w, ends[:-1], axis=1)


@dataclass(frozen=True, eq=False)
class Coefficients:
    """Joint draws of everything linear."""

    model: SmoothModel
    coefficients: Floats  # (N, J) of all functions' sines
    growth: Floats  # (N,) the ends' size over the middle's
    columns: Floats  # (N, c); flat : (N, q)
    flat: Floats
    sigma: Floats  # (N,) mm

    def function(self, index: int, x: Floats) -> Floats:
        """One of the functions at positions (m,): (N, m)."""
        part = self.model._split(self.coefficients)[index]
        return self.model.functions[index].values(x, part, self.growth)

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
