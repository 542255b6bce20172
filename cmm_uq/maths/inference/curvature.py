"""Posteriors where the model bends within its width, or where a nonlinear parameter shapes its columns.

    observed = explained(parameters) + noise,   explained = linear part + r,   r ≈ ½ H(δ, δ)

r is what the linear model about a point leaves out, δ the distance from there. It is measured, by differences over a few
posterior standard deviations. Where it moves no parameter by more than :data:`NEGLIGIBLE` of its standard uncertainty out to
:data:`FARTHEST` of them, draws of the linear model are those of the model. Otherwise each draw φ is bent to the δ that
explains as much, δ + K·r(δ) = φ with K the linear gain, and the bent draws are proposals of a Metropolis–Hastings chain
(Tierney 1994, Annals of Statistics 22(4), independence chains) whose stationary distribution is the posterior of the
second-order model.

Where a nonlinear parameter, such as a period, shapes some columns of a linear model, the parameters that enter linearly are
integrated exactly, and drawn exactly in the end. What emcee samples is the noise and
the shapes. A shape may have several modes: it is sampled through its own marginal distribution, which a fine grid gives, so
that the walkers step from mode to mode as easily as within one.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property

import numpy as np
import scipy

from cmm_uq.base.points import Floats, Ints
from cmm_uq.base.values import dataclass, replace
from cmm_uq.maths.inference.ensembles import ENSEMBLES, Progress, run_ensembles
from cmm_uq.maths.inference.linear_model import LinearModel
from cmm_uq.maths.inference.marginal import SIGMA_BOUNDS
from cmm_uq.maths.inference.posterior import NoisyPosterior, Posterior
from cmm_uq.maths.inference.proposals import Proposal

NEGLIGIBLE = 0.02  # of a standard uncertainty
FARTHEST = 4.0  # posterior standard deviations
_STEP = 2.0  # posterior standard deviations over which the second derivatives are taken: the middle of the range that counts
_ROUNDS = 4  # fixed-point rounds of bending; each gains the factor by which the model bends within a standard deviation
_BLOCK = 2_000_000  # numbers at a time
# what parameters (k,) explain of the observations, (m,) mm, beyond the linear model
Remainder = Callable[[Floats], Floats]


@dataclass(frozen=True, eq=False)
class Bend:
    """The second-order model in units of posterior standard deviations z, whitened by the noise."""

    centre: Floats  # (k,) parameters = centre + axes · z; the linear posterior is N(z₀, 1)
    axes: Floats  # (k, k)
    design: Floats  # (m, k) of z
    first: Floats  # (m, k) derivatives of what the linear model leaves out: a design need not be exact
    second: Floats  # (m, k, k)
    left: Floats  # (m,) what z = 0 leaves unexplained
    prior: Floats  # (p, k) priors as observations, ``prior``·z − ``prior_at``
    prior_at: Floats  # (p,)

    @property
    def largest(self) -> float:
        """Largest change of a parameter combination, in its standard deviations, by bending out to the farthest draws."""
        slope, gain = self._gain
        moved = 0.5 * FARTHEST**2 * np.abs(gain).max(initial=0.0)
        return float(moved + FARTHEST * np.abs(slope).max(initial=0.0))

    @property
    def _gain(self) -> tuple[Floats, Floats]:
        """The derivatives as changes of the parameters: (k, k) and (k, k, k)."""
        return self.design.T @ self.first, np.einsum("mi,mab->iab", self.design, self.second)

    def bent(self, flat: Floats) -> tuple[Floats, Floats]:
        """Draws z (w, k) bent from those of the linear model, and the logarithm (w,) of their weight."""
        slope, gain = self._gain

        def beyond(z: Floats) -> Floats:
            return np.asarray(z @ slope.T + 0.5 * np.einsum("iab,wa,wb->wi", gain, z, z, optimize=True))

        z = flat.copy()
        for _ in range(_ROUNDS):
            z = flat - beyond(z)
        reached = z + beyond(z)  # what z is the image of, to the last digit
        turned = np.eye(len(self.axes)) + slope + np.einsum("iab,wa->wib", gain, z)
        sign, log_volume = np.linalg.slogdet(turned)
        # density of z in the model, over that of the bent draw: of what it was bent from, times the change of volume
        weight = self._log(z, bends=True) - self._log(reached, bends=False) - log_volume
        return z, np.where((sign > 0) & np.isfinite(weight), weight, -np.inf)

    def _log(self, z: Floats, *, bends: bool) -> Floats:
        """Log density (w,), up to a constant, of the linear or of the second-order model."""
        found = np.empty(len(z))
        size = max(1, _BLOCK // max(1, self.design.size))
        flat_second = self.second.reshape(len(self.second), -1)
        for i in range(0, len(z), size):
            part = z[i : i + size]
            missing = self.left - part @ self.design.T
            if bends:
                squares = np.einsum("wa,wb->wab", part, part).reshape(len(part), -1)
                missing -= part @ self.first.T + 0.5 * squares @ flat_second.T
            off = part @ self.prior.T - self.prior_at
            found[i : i + size] = -0.5 * (np.sum(missing**2, axis=1) + np.sum(off**2, axis=1))
        return found


def bend(model: LinearModel, about: Floats, sigma: float, remainder: Remainder) -> Bend:
    """Measure how the model bends within its posterior.

    ``model``: linear about ``about``; its observations without correlation, see :meth:`LinearModel.uncorrelated`. ``about``:
    (k,) where it is linear. ``sigma``: mm, of the noise. ``remainder``: in the observations of ``model``.
    """
    reduced = model.reduced
    design, left = reduced.design / sigma, (reduced.observed - reduced.design @ about) / sigma
    scale = model.scale
    prior, given = model.priors
    _, s, Vt = np.linalg.svd(np.vstack([design, prior]) * scale, full_matrices=False)
    axes = scale[:, None] * Vt.T / s
    k = len(about)

    def beyond(z: Floats) -> Floats:
        return np.asarray(model.reduce(remainder(about + axes @ z)[:, None])[:, 0] / sigma)

    steps = _STEP * np.eye(k)
    second = np.zeros((len(left), k, k))
    alone = [(beyond(step), beyond(-step)) for step in steps]
    first = np.column_stack([(ahead - behind) / (2 * _STEP) for ahead, behind in alone])
    for a in range(k):
        second[:, a, a] = (alone[a][0] + alone[a][1]) / _STEP**2
        for b in range(a):
            both = beyond(steps[a] + steps[b]) - alone[a][0] - alone[b][0]
            second[:, a, b] = second[:, b, a] = both / _STEP**2
    return Bend(about, axes, design @ axes, first, second, left, prior @ axes, given - prior @ about)


def bent(posterior: NoisyPosterior, found: Bend) -> NoisyPosterior:
    """The posterior of the bent model, from the draws of the linear one; the same object where bending is negligible."""
    if found.largest <= NEGLIGIBLE:
        return posterior
    flat = np.asarray(np.linalg.solve(found.axes, (posterior.draws - found.centre).T).T, dtype=np.float64)
    z, weight = found.bent(flat)
    kept = _metropolis(weight, posterior.steps // posterior.every, posterior.seed)
    draws = (found.centre + z @ found.axes.T)[kept]
    even = np.exp(weight - weight.max())
    # part of draws that are worth as much as equally weighted ones (Kish)
    ess_min = posterior.ess_min * float(even.sum() ** 2 / (len(even) * np.sum(even**2)))
    sizes = posterior.sizes.at(kept)
    return replace(posterior, draws=draws, sigma=posterior.sigma[kept], sizes=sizes, ess_min=ess_min)


def _metropolis(log_weight: Floats, steps: int, seed: int) -> Ints:
    """Which draw each walker holds at each step, where it takes the next one or stays: indices (N,)."""
    walks = np.arange(len(log_weight)).reshape(ENSEMBLES, steps, -1)
    random = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(6,)))
    chance = np.log(random.random(walks.shape))
    held = walks.copy()
    for step in range(1, steps):
        before, now = held[:, step - 1], walks[:, step]
        weight = np.where(np.isfinite(log_weight[now]), log_weight[now], -np.inf)
        better = weight - np.maximum(log_weight[before], -1e300)
        held[:, step] = np.where(chance[:, step] < better, now, before)
    return np.asarray(held.ravel(), dtype=np.int64)


_ANYWHERE = 0.02  # part of a shape's proposal that is spread over the whole grid
_NEGLIGIBLE = 1e-9
_BATCH = 512
_COLUMNS = 256  # columns that are reduced at once: few enough for a processor's cache
_MANY = 4  # columns, over rows, from which on they are made a triangle before their span is sought


@dataclass(frozen=True, eq=False)
class Shaped:
    """Columns that a nonlinear parameter shapes."""

    where: Sequence[int]  # (r,) their place in the design
    nodes: Floats  # (N,) values of the parameter, sorted; uniform probability over them in their logarithm
    table: Floats  # (N, m, r) the columns at the nodes, mm


def sample_shaped(
    model: LinearModel, shaped: Sequence[Shaped], seed: int, progress: Progress | None = None
) -> Posterior:
    """Sample the posterior, whose ``shapes`` (N, q) belong to ``shaped``; ``progress`` gets the part done, from 0 to 1."""
    density = _Density(model, shaped)
    centre, factor = density.start
    chains = run_ensembles(density, Proposal.single(centre, factor), seed, progress)
    shapes, sigma = density.unpacked(chains.draws)
    random = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(5,)))
    parts = [slice(i, i + _BATCH) for i in range(0, len(sigma), _BATCH)]
    draws = np.vstack([density.draw(shapes[part], sigma[part], random) for part in parts])
    return Posterior(model.unknowns, draws, sigma, seed, **chains.quality, shapes=shapes)


class _Density:
    """Log density of (u₁ … u_q, ln σ): each u is normal where its shape follows the marginal of the grid."""

    def __init__(self, model: LinearModel, shaped: Sequence[Shaped]) -> None:
        self.model, self.shaped, reduced = model, shaped, model.reduced
        # deviations from the prior means: lengths of half a metre would leave no digits for nanometres
        observed = reduced.observed - reduced.design @ model.prior_mean
        flat = []
        for some in shaped:
            columns = np.hstack(list(some.table))
            parts = np.array_split(columns, columns.shape[1] // _COLUMNS + 1, axis=1)
            flat.append(np.hstack([model.reduce(part) for part in parts]))
        # the walkers need no more rows than the columns have dimensions
        every = np.hstack([reduced.design, *flat])
        every = every / np.maximum(np.linalg.norm(every, axis=0), 1e-300)
        if every.shape[1] > _MANY * len(every):  # of the same singular values, and vectors on the left
            every = scipy.linalg.qr(every.T, mode="r", overwrite_a=True)[0][: len(every)].T
        U, s, _ = scipy.linalg.svd(every, full_matrices=False)
        Q = U[:, s > _NEGLIGIBLE * s[0]]
        self.design, self.observed, self.count = Q.T @ reduced.design, Q.T @ observed, reduced.count
        self.squares = float(observed @ observed)
        self.tables = [
            (Q.T @ columns).reshape(Q.shape[1], len(some.nodes), -1).transpose(1, 0, 2)
            for some, columns in zip(shaped, flat, strict=True)
        ]

    def designs(self, shapes: Floats) -> Floats:
        """Reduced designs (w, m', k) for shapes (w, q), linear between the nodes."""
        design = np.repeat(self.design[None], len(shapes), axis=0)
        for j, (some, table) in enumerate(zip(self.shaped, self.tables, strict=True)):
            at = np.clip(np.searchsorted(some.nodes, shapes[:, j]), 1, len(some.nodes) - 1)
            low, high = some.nodes[at - 1], some.nodes[at]
            part = ((shapes[:, j] - low) / (high - low))[:, None, None]
            design[:, :, list(some.where)] = (1 - part) * table[at - 1] + part * table[at]
        return design

    def _gaussian(self, shapes: Floats, sigma: Floats) -> tuple[Floats, Floats, Floats]:
        """Means (w, k) less the prior ones, lower factors of the precisions, and ln p(observations | shapes, σ)."""
        design = self.designs(shapes)
        right = (design.transpose(0, 2, 1) @ self.observed) / sigma[:, None] ** 2
        precision = design.transpose(0, 2, 1) @ design / sigma[:, None, None] ** 2 + np.diag(
            1 / self.model.effective_sd**2
        )
        scale = 1 / np.sqrt(np.einsum("wii->wi", precision))
        factor = np.linalg.cholesky(precision * scale[:, :, None] * scale[:, None, :])
        half = np.linalg.solve(factor, (right * scale)[:, :, None])[:, :, 0]
        mean = scale * np.linalg.solve(factor.transpose(0, 2, 1), half[:, :, None])[:, :, 0]
        squares = self.squares / sigma**2 - np.sum(half**2, axis=1)
        log = -0.5 * squares - self.count * np.log(sigma)
        log += np.log(scale).sum(axis=1) - np.log(np.einsum("wii->wi", factor)).sum(axis=1)
        return mean, factor / scale[:, :, None], log

    def log_marginal(self, shapes: Floats, sigma: Floats) -> Floats:
        """Log density (w,) of the observations for shapes (w, q) and noise (w,), up to a constant."""
        parts = [slice(i, i + _BATCH) for i in range(0, len(sigma), _BATCH)]
        return np.concatenate([self._gaussian(shapes[part], sigma[part])[2] for part in parts])

    def draw(self, shapes: Floats, sigma: Floats, random: np.random.Generator) -> Floats:
        """One exact draw (w, k) of the linear parameters for each."""
        mean, factor, _ = self._gaussian(shapes, sigma)
        z = random.standard_normal(mean.shape)
        return self.model.prior_mean + mean + np.linalg.solve(factor.transpose(0, 2, 1), z[:, :, None])[:, :, 0]

    def _log_over_nodes(self, j: int, shapes: Floats, sigma: float) -> Floats:
        """:meth:`log_marginal` at all nodes of one shape, the others as they are."""
        nodes = self.shaped[j].nodes
        trial = np.repeat(shapes[None], len(nodes), axis=0)
        trial[:, j] = nodes
        return self.log_marginal(trial, np.full(len(trial), sigma))

    @cached_property
    def _best(self) -> tuple[Floats, float]:
        """Shapes (q,) and σ near the mode: one shape after the other over its grid, twice."""
        typical = float(np.sqrt(self.squares / self.count))
        shapes = np.array([some.nodes[len(some.nodes) // 2] for some in self.shaped])
        sigma = self.model.sigma or 0.0
        for _ in range(2):
            for j, some in enumerate(self.shaped):
                shapes[j] = some.nodes[int(np.argmax(self._log_over_nodes(j, shapes, sigma or typical)))]
            if self.model.sigma is None:
                grid = np.geomspace(1e-3, 2, 120) * typical
                log = self.log_marginal(np.repeat(shapes[None], len(grid), axis=0), grid)
                sigma = float(grid[int(np.argmax(log))])
        return shapes, sigma

    @cached_property
    def _quantiles(self) -> list[tuple[Floats, Floats, Floats]]:
        """For each shape: logarithms of the nodes, distribution function there, density between them."""
        best, sigma = self._best
        found = []
        for j, some in enumerate(self.shaped):
            log = self._log_over_nodes(j, best, sigma)
            t, p = np.log(some.nodes), np.exp(log - log.max())
            width = np.diff(t)
            mass = 0.5 * (p[1:] + p[:-1]) * width
            mass = (1 - _ANYWHERE) * mass / mass.sum() + _ANYWHERE * width / width.sum()
            found.append((t, np.concatenate([[0.0], np.cumsum(mass)]), mass / width))
        return found

    def unpacked(self, theta: Floats) -> tuple[Floats, Floats]:
        shapes = np.empty((len(theta), len(self.shaped)))
        for j, (t, distribution, _) in enumerate(self._quantiles):
            shapes[:, j] = np.exp(np.interp(scipy.special.ndtr(theta[:, j]), distribution, t))
        sigma = np.full(len(theta), self.model.sigma) if self.model.sigma is not None else np.exp(theta[:, -1])
        return shapes, sigma

    def __call__(self, theta: Floats) -> Floats:
        shapes, sigma = self.unpacked(theta)
        inside = (sigma > SIGMA_BOUNDS[0]) & (sigma < SIGMA_BOUNDS[1])
        value = self.log_marginal(shapes, np.where(inside, sigma, 1.0))
        for j, (t, _, density) in enumerate(self._quantiles):
            at = np.clip(np.searchsorted(t, np.log(shapes[:, j])), 1, len(density)) - 1
            value -= np.log(density[at]) + 0.5 * theta[:, j] ** 2
        return np.where(inside, value, -np.inf)

    @property
    def start(self) -> tuple[Floats, Floats]:
        q = len(self.shaped)
        if self.model.sigma is not None:
            return np.zeros(q), np.eye(q)
        _, sigma = self._best
        dof = max(self.count - len(self.model.unknowns), 1)
        return np.append(np.zeros(q), np.log(sigma)), np.diag(np.append(np.ones(q), 1 / np.sqrt(2 * dof)))
