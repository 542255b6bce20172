"""Posterior of a recording whose readings have Student's t distributions, beside every other component but slow noise.

A reading of scale s is s·t = s·z/√λ with a normal z and a latent weight λ ~ χ²(ν)/ν of its own. Given the weights all is
normal again: with w = λ/s², τ the set-up offset, z the noise scale of a reading and x its row of [X, y], columns and
observation,

    [X, y]ᵀ·V⁻¹·[X, y] = Σ w·x·xᵀ − Σ_q c·g·gᵀ,   g = Σ_q w·z·x,   c = τ²/(1 + τ²·Σ_q w·z²)

over the quantities q that readings repeat (Sherman and Morrison). So coefficients and offsets are integrated out and drawn
exactly, as without weights. But weights are those of readings: neither the mean and the contrasts of repeats nor classes of
equal variance are independent any more, and every new set of weights costs the sum over all readings.

One sweep: Metropolis steps of the sizes given the weights; coefficients and offsets given both; degrees of freedom given
what is left, the weights integrated out; weights given those. Normal readings are one more of the degrees of freedom,
infinitely many, so that tails are weighed and not chosen. What stays when ν changes is the quartile of the readings.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import special

from cmm_uq.base.units import unit
from cmm_uq.machine.model.measurement import RecordingModel
from cmm_uq.machine.model.noise import (
    axis_variances,
    growing_lengths,
    machine_axes,
    noise_of,
    repeated_quantity,
    sensitivities,
)
from cmm_uq.maths.inference.draws import Draws
from cmm_uq.maths.inference.noise import AXES, GROWTH, PLACING, Components, Sizes

DOF = np.array([2.5, 3.0, 4.0, 6.0, 10.0, 20.0, np.inf])
"""Degrees of freedom that are weighed; the last is a normal distribution."""
_FINITE = np.where(np.isfinite(DOF), DOF, 1.0)
_QUARTILE = np.where(np.isfinite(DOF), special.stdtrit(_FINITE, 0.75) / special.ndtri(0.75), 1.0)
"""Quartile of each over that of a normal distribution, both of scale one."""
_LOG_T = np.where(
    np.isfinite(DOF),
    special.gammaln((_FINITE + 1) / 2) - special.gammaln(_FINITE / 2) - 0.5 * np.log(np.pi * _FINITE),
    -0.5 * np.log(2 * np.pi),
)

CHAINS, SWEEPS, BURN_IN = 16, 500, 150
_STEP = 0.5
"""Of a random walk of the standard normal numbers."""
_JITTER = 1e-11


def prior(tails: float) -> np.ndarray:
    """Logarithm of the probability of each of :data:`DOF` beforehand, where tails have the probability ``tails``."""
    with np.errstate(divide="ignore"):
        return np.log(np.append(np.full(len(DOF) - 1, tails / (len(DOF) - 1)), 1 - tails))


@dataclass(frozen=True, eq=False)
class Readings:
    """Observations as readings, sorted by what they repeat.

    Parameters
    ----------
    whole : (m, P + 1) columns of coefficients and placings, each of length about one over the noise, and observations, mm.
    known : (p, P + 1) what is known beforehand, as rows of unit variance.
    axes, growth, scale : (m, 3), (m,), (m,) shares of the axes' and of the growing variance, and the noise scale.
    quantity : (m,) which quantity each repeats, ascending.
    noise : the components.
    centre, length : (k,) estimate about which ``whole`` is, and length of the coefficients' columns.
    sigma : mm, of the residuals.
    """

    whole: np.ndarray
    known: np.ndarray
    axes: np.ndarray
    growth: np.ndarray
    scale: np.ndarray
    quantity: np.ndarray
    noise: Components
    centre: np.ndarray
    length: np.ndarray
    sigma: float

    @classmethod
    def of(cls, model: RecordingModel) -> Readings:
        """Of a model's recording, without the time.

        Raises
        ------
        ValueError : slow noise or a display's steps could show.
        """
        estimate, used, noise = model.estimate(), model.used, noise_of(model)
        if noise.slow.size or noise.display:
            raise ValueError("slow noise and steps are not reckoned with")
        linear, fitted = estimate.linear, estimate.least_squares
        xyz = model.placed(estimate.about)
        turn, along = machine_axes(model.artefact.rows[used], sensitivities(model, xyz)[used])
        length = growing_lengths(model, xyz)[used]
        scale = linear.noise_scale
        rows, given = linear.priors
        order = np.argsort(repeated_quantity(model, used), kind="stable")
        left = linear.observed - linear.design @ fitted.value
        free = linear.freedoms.reached.dense()
        whole = np.asarray(turn @ np.hstack([linear.design, free[:, np.any(free, axis=0)], left[:, None]]))
        known = np.zeros((len(rows), whole.shape[1]))
        known[:, : linear.design.shape[1]], known[:, -1] = rows, given - rows @ fitted.value
        sigma = fitted.sigma_of_residuals
        size = np.sqrt(np.sum(whole**2, axis=0) / sigma**2 + np.sum(known**2, axis=0))
        size[-1] = 1.0
        return cls(
            (whole / size)[order], known / size, axis_variances(along, scale)[order],
            (scale**2 * (length / max(length.max(), 1e-9)) ** 2)[order], scale[order],
            repeated_quantity(model, used)[order], noise, fitted.value, size[: len(fitted.value)], sigma,
        )  # fmt: skip

    def variances(self, sizes: Sizes) -> np.ndarray:
        """(w, m) of readings without the offset, mm²."""
        return sizes.reading**2 @ self.axes.T + sizes.growth[:, None] ** 2 * self.growth

    def by_quantity(self, values: np.ndarray) -> np.ndarray:
        """Sums (w, q) of values (w, m)."""
        return np.add.reduceat(values, self._first, axis=1)

    @cached_property
    def _first(self) -> np.ndarray:
        """(q,) first reading of each quantity."""
        return np.flatnonzero(np.diff(self.quantity, prepend=-1))

    @cached_property
    def _products(self) -> np.ndarray:
        """(m, (P + 1)²) of the columns with each other, of each reading."""
        return (self.whole[:, :, None] * self.whole[:, None, :]).reshape(len(self.whole), -1)

    def factors(self, weight: np.ndarray, placing: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Lower factors (w, P + 1, P + 1) of the precision bordered by the observations, and the log likelihood (w,).

        Parameters
        ----------
        weight : (w, m) one over the variance of each reading.
        placing : (w,) set-up offset, mm.
        """
        w, size = len(weight), self.whole.shape[1]
        matrix = (weight @ self._products).reshape(w, size, size) + self.known.T @ self.known
        log, square = 0.5 * np.log(weight).sum(axis=1), placing[:, None] ** 2
        some = np.flatnonzero(placing)
        if len(some):
            seen = weight[some] * self.scale
            total = 1 + square[some] * self.by_quantity(seen * self.scale)
            sums = np.add.reduceat(seen[:, :, None] * self.whole, self._first, axis=1)
            sums *= np.sqrt(square[some] / total)[:, :, None]
            matrix[some] -= sums.transpose(0, 2, 1) @ sums
            log[some] -= 0.5 * np.log(total).sum(axis=1)
        matrix.reshape(w, -1)[:, :: size + 1] *= 1 + _JITTER
        factor = np.linalg.cholesky(matrix)
        diagonal = np.einsum("wii->wi", factor)
        return factor, log - np.log(diagonal[:, :-1]).sum(axis=1) - 0.5 * diagonal[:, -1] ** 2


@dataclass(frozen=True, eq=False)
class Found:
    """A posterior.

    Parameters
    ----------
    draws : (N, k) of the parameters.
    dof : (N,) which of :data:`DOF`.
    sizes : of the noise, their scales those of the quartiles.
    rhat, ess : worst of all parameters, ln σ and whether there are tails.
    """

    draws: np.ndarray
    dof: np.ndarray
    sizes: Sizes
    rhat: float
    ess: float

    @property
    def tails(self) -> float:
        """Probability of tails."""
        return float(np.mean(self.dof < len(DOF) - 1))


def log_tails(squares: np.ndarray) -> np.ndarray:
    """Log density (w, ν) of readings by each of :data:`DOF`, of their squares (w, m) over those of a normal one's scale."""
    found = np.empty((len(squares), len(DOF)))
    for i, dof in enumerate(DOF):
        at = squares * _QUARTILE[i] ** 2
        each = 0.5 * at if np.isinf(dof) else 0.5 * (dof + 1) * np.log1p(at / dof)
        found[:, i] = squares.shape[1] * (_LOG_T[i] + np.log(_QUARTILE[i])) - each.sum(axis=1)
    return found


class _Chains:
    """Chains of one posterior, all in step."""

    def __init__(self, of: Readings, log_prior: np.ndarray, random: np.random.Generator) -> None:
        self.of, self.log_prior, self.random = of, log_prior, random
        self.latent = random.standard_normal((CHAINS, of.noise.dimension))
        self.latent[:, 0] = np.log(of.sigma) + 0.3 * random.standard_normal(CHAINS)
        self.dof = random.choice(np.flatnonzero(np.isfinite(log_prior)), CHAINS)
        self.weight = np.ones((CHAINS, len(of.whole)))

    def sweep(self) -> np.ndarray:
        """Parameters (w, k) of the next step."""
        self._resize()
        left, values = self._explain()
        self._retail(left)
        return values

    def _log(self, latent: np.ndarray) -> tuple[Sizes, np.ndarray, np.ndarray, np.ndarray]:
        """Sizes, weights w (w, m), factors, and the log density (w,) of numbers (w, d), given the latent weights."""
        sizes = self.of.noise.sizes(latent)
        weight = self.weight * _QUARTILE[self.dof, None] ** 2 / self.of.variances(sizes)
        factor, log = self.of.factors(weight, sizes.placing)
        return sizes, weight, factor, log + self.of.noise.log_prior(latent, sizes)

    def _moves(self) -> list[tuple[list[int], str]]:
        names = self.of.noise.names
        groups = [["log_sigma"]] + [
            each for each in (["spread", "first", "second"], [PLACING], [GROWTH]) if each[0] in names
        ]
        assert {AXES, PLACING, GROWTH}.issuperset(self.of.noise.possible)
        columns = [[names.index(name) for name in group] for group in groups]
        return [(columns[0], "sigma"), *((each, str(self.random.choice(["walk", "anew"]))) for each in columns[1:])]

    def _resize(self) -> None:
        self.state = self._log(self.latent)
        for columns, how in self._moves():
            tried = self.latent.copy()
            normal = self.random.standard_normal((CHAINS, len(columns)))
            before = 0.0
            if how == "sigma":
                tried[:, columns] += 1.7 / np.sqrt(len(self.of.whole)) * normal
            elif how == "walk":
                tried[:, columns] += _STEP * normal
            else:  # from the prior, whose ratio then cancels
                tried[:, columns] = normal
                before = 0.5 * np.sum(normal**2 - self.latent[:, columns] ** 2, axis=1)
            state = self._log(tried)
            accepted = np.log(self.random.random(CHAINS)) < state[3] - self.state[3] + before
            self.latent[accepted] = tried[accepted]
            sizes = self.of.noise.sizes(self.latent)
            for old, new in zip(self.state[1:], state[1:], strict=True):
                old[accepted] = new[accepted]
            self.state = (sizes, *self.state[1:])

    def _explain(self) -> tuple[np.ndarray, np.ndarray]:
        """What coefficients and offsets, drawn exactly, leave of the observations (w, m); the parameters (w, k)."""
        sizes, weight, factor, _ = self.state
        of, random = self.of, self.random
        size = factor.shape[1] - 1
        target = factor[:, -1, :-1] + random.standard_normal((CHAINS, size))
        coefficients = np.linalg.solve(factor[:, :-1, :-1].transpose(0, 2, 1), target[:, :, None])[:, :, 0]
        left = of.whole[:, -1] - coefficients @ of.whole[:, :-1].T
        square = sizes.placing[:, None] ** 2
        known = 1 + square * of.by_quantity(weight * of.scale**2)
        mean = square * of.by_quantity(weight * of.scale * left) / known
        offset = mean + np.sqrt(square / known) * random.standard_normal(mean.shape)
        k = len(of.length)
        _, number = np.unique(of.quantity, return_inverse=True)
        return left - of.scale * offset[:, number.ravel()], of.centre + coefficients[:, :k] / of.length

    def _retail(self, left: np.ndarray) -> None:
        """Degrees of freedom given what is left (w, m), and weights given those."""
        squares = left**2 / self.of.variances(self.state[0])
        log = log_tails(squares) + self.log_prior
        part = np.exp(log - log.max(axis=1, keepdims=True))
        part = np.cumsum(part / part.sum(axis=1, keepdims=True), axis=1)
        self.dof = np.minimum(np.sum(part < self.random.random((CHAINS, 1)), axis=1), len(DOF) - 1)
        dof, normal = _FINITE[self.dof][:, None], np.isinf(DOF[self.dof])[:, None]
        rate = 0.5 * (dof + squares * _QUARTILE[self.dof][:, None] ** 2)
        gamma = self.random.standard_gamma(np.broadcast_to(0.5 * (dof + 1), rate.shape))
        self.weight = np.where(normal, 1.0, gamma / rate)


def sample(of: Readings, log_prior: np.ndarray, seed: int) -> Found:
    """The posterior where each of :data:`DOF` has the prior ``log_prior``; minus infinity of what is not weighed."""
    chains = _Chains(of, log_prior, np.random.default_rng(seed))
    values, numbers, dof = [], [], []
    for i in range(BURN_IN + SWEEPS):
        found = chains.sweep()
        if i >= BURN_IN:
            values.append(found)
            numbers.append(chains.latent.copy())
            dof.append(chains.dof)
    every = np.concatenate([np.array(values), np.array(numbers)[:, :, :1]], axis=2).swapaxes(0, 1)
    names = {str(i): unit("1") for i in range(every.shape[2])}
    judged = Draws(names, every)
    sizes = of.noise.sizes(np.array(numbers).reshape(-1, of.noise.dimension))
    return Found(
        np.array(values).reshape(-1, len(of.length)), np.array(dof).ravel(), sizes, judged.rhat_max, judged.ess_bulk_min
    )
