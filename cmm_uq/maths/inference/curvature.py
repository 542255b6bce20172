"""Draws of a posterior where the model bends within its width: from those of the linear model about the estimate.

    observed = explained(parameters) + noise,   explained = linear part + r,   r ≈ ½ H(δ, δ)

r is what the linear model about a point leaves out, δ the distance from there. It is measured, by differences over a few
posterior standard deviations. Where it moves no parameter by more than :data:`NEGLIGIBLE` of its standard uncertainty out to
:data:`FARTHEST` of them, draws of the linear model are those of the model. Otherwise each draw φ is bent to the δ that
explains as much, δ + K·r(δ) = φ with K the linear gain, and the bent draws are proposals of a Metropolis–Hastings chain
(Tierney 1994, Annals of Statistics 22(4), independence chains) whose stationary distribution is the posterior of the
second-order model.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields

import numpy as np

from cmm_uq.base.points import Floats, Ints
from cmm_uq.maths.inference.ensembles import ENSEMBLES
from cmm_uq.maths.inference.linear_model import LinearModel
from cmm_uq.maths.inference.posterior import NoisyPosterior

NEGLIGIBLE = 0.02
"""Of a standard uncertainty."""

FARTHEST = 4.0
"""Posterior standard deviations."""

_STEP = 2.0
"""Posterior standard deviations over which the second derivatives are taken: the middle of the range that counts."""

_ROUNDS = 4
"""Fixed-point rounds of bending; each gains the factor by which the model bends within a standard deviation."""

_BLOCK = 2_000_000
"""Numbers at a time."""

Remainder = Callable[[Floats], Floats]
"""What parameters (k,) explain of the observations, (m,) mm, beyond the linear model."""


@dataclass(frozen=True, eq=False)
class Bend:
    """The second-order model in units of posterior standard deviations z, whitened by the noise.

    Parameters
    ----------
    centre, axes : z = 0 and (k, k) columns: parameters = centre + axes · z; the linear posterior is N(z₀, 1).
    design : (m, k) of z.
    first, second : (m, k) and (m, k, k) derivatives of what the linear model leaves out: a design need not be exact.
    left : (m,) what z = 0 leaves unexplained.
    prior, prior_at : (p, k) and (p,): priors as observations, ``prior``·z − ``prior_at``.
    """

    centre: Floats
    axes: Floats
    design: Floats
    first: Floats
    second: Floats
    left: Floats
    prior: Floats
    prior_at: Floats

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

    Parameters
    ----------
    model : linear about ``about``; its observations without correlation, see :meth:`LinearModel.uncorrelated`.
    about : (k,) where it is linear.
    sigma : mm, of the noise.
    remainder : in the observations of ``model``.
    """
    reduced = model.reduced
    design, left = reduced.design / sigma, (reduced.observed - reduced.design @ about) / sigma
    scale = np.array([u.scale for u in model.unknowns])
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
    given = {field.name: getattr(posterior, field.name) for field in fields(posterior)}
    held = {"draws": draws, "sigma": posterior.sigma[kept], "sizes": posterior.sizes.at(kept)}
    return NoisyPosterior(**given | held | {"ess_min": posterior.ess_min * _evenness(weight)})


def _evenness(log_weight: Floats) -> float:
    """Part of draws that are worth as much as equally weighted ones (Kish): 1 where all weigh the same."""
    weight = np.exp(log_weight - log_weight.max())
    return float(weight.sum() ** 2 / (len(weight) * np.sum(weight**2)))


def _metropolis(log_weight: Floats, steps: int, seed: int) -> Ints:
    """Which draw each walker holds at each step, where it takes the next one or stays: indices (N,)."""
    walks = np.arange(len(log_weight)).reshape(ENSEMBLES, steps, -1)
    random = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(6,)))
    chance = np.log(random.random(walks.shape))
    held = walks.copy()
    for step in range(1, steps):
        before, now = held[:, step - 1], walks[:, step]
        better = np.where(np.isfinite(log_weight[now]), log_weight[now], -np.inf) - np.maximum(
            log_weight[before], -1e300
        )
        held[:, step] = np.where(chance[:, step] < better, now, before)
    return np.asarray(held.ravel(), dtype=np.int64)
