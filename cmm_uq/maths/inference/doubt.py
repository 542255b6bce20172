"""What observations err by together, as far as it is known, carried into what is estimated from them.

An error of the artefact's temperature changes every length of a recording at once. Residuals do not show it, and no repeat
averages it out: its standard uncertainty is stated, not estimated, and reaches estimates by their sensitivities to the
observations (JCGM 100:2008, 5.1.2 and F.1.2.3). Where it is not known whether an error is the same in all set-ups or each
set-up has its own, both are computed, and of each figure the larger variance stands. Of every correlation between them, from
none to one, the variance lies between the two, for it is linear in that correlation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cmm_uq.base.messages import Text
from cmm_uq.base.points import Floats, Ints
from cmm_uq.maths.inference.linear_model import Freedoms, LinearModel
from cmm_uq.maths.inference.posterior import Density
from cmm_uq.maths.uncertainty.quantity import Quantity


@dataclass(frozen=True, eq=False)
class Cause:
    name: Text  # in words
    common: Floats  # (m, r) change of each observation, mm, for one standard uncertainty of each of r independent parts
    apart: Freedoms | None = None  # where each block errs by itself; ``None`` where all are known to err together
    # (m,) change for one standard uncertainty of what is in the draws already, as that of a certified size is: it stands for
    # ``common``, which is then zero, and of ``apart`` only what is more counts
    included: Floats | None = None

    @classmethod
    def of_blocks(cls, name: Text, changes: Floats, block: Ints) -> Cause:
        """One that changes observations by ``changes`` (m,) mm, all together or those of one ``block`` (m,) by themselves."""
        _, index = np.unique(block, return_inverse=True)
        columns = changes[:, None]
        return cls(name, columns, Freedoms(columns, index.ravel(), int(index.max(initial=-1)) + 1))

    def at(self, rows: NDArray[np.bool_]) -> Cause:
        apart = None if self.apart is None else self.apart.at(rows)
        included = None if self.included is None else self.included[rows]
        return Cause(self.name, self.common[rows], apart, included)

    def drawn(self, shape: tuple[int, ...], random: np.random.Generator, *, apart: bool) -> Floats:
        if not apart or self.apart is None:
            return np.asarray(random.standard_normal((*shape, self.common.shape[1])) @ self.common.T)
        own = random.standard_normal((*shape, self.apart.blocks, self.apart.columns.shape[1]))
        return np.asarray(np.einsum("...mj,mj->...m", own[..., self.apart.index, :], self.apart.columns))

    def carried(self, weights: Floats) -> tuple[Floats, Floats]:
        """Change of combinations (k, m) of the observations, for one standard uncertainty: (k, r) common, (k, q) apart."""
        common = weights @ self.common
        if self.apart is None:
            return common, common
        each = np.vstack([self.apart.sums(weights.T * column[:, None]) for column in self.apart.columns.T]).T
        if self.included is not None:
            whole, known = np.sum(each**2, axis=1), (weights @ self.included) ** 2
            more = np.divide(whole - known, whole, out=np.zeros_like(whole), where=whole > known)
            each = each * np.sqrt(more)[:, None]
        return common, each


@dataclass(frozen=True, eq=False)
class Doubt:
    """What is in doubt about k estimates by causes that the residuals do not show."""

    # of each cause the changes of the estimates, all observations erring together (k, r) and apart (k, q)
    carried: tuple[tuple[Floats, Floats], ...]

    @classmethod
    def of(cls, causes: Sequence[Cause], weights: Floats) -> Doubt:
        return cls(tuple(cause.carried(weights) for cause in causes))

    def variance(self, combination: Floats) -> float:
        """Of a combination (k,) of the estimates, in their units: of each cause the larger one."""
        return float(sum(max(*(np.sum((combination @ part) ** 2) for part in each)) for each in self.carried))

    def covariance(self) -> Floats:
        """(k, k), its diagonal of each cause the larger; estimates that different readings decide for do not correlate."""
        whole = 0.0
        for common, apart in self.carried:
            own = np.sum(apart**2, axis=1) > np.sum(common**2, axis=1)
            together, alone = np.where(own[:, None], 0.0, common), np.where(own[:, None], apart, 0.0)
            whole = whole + together @ together.T + alone @ alone.T
        return np.asarray(whole)

    def widened(self, draws: Floats, seed: int) -> Floats:
        """Draws (N, k) with what is in doubt, about the same mean."""
        random = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(23,)))
        covariance = self.covariance()
        scale = np.sqrt(np.diag(covariance))
        scale = np.where(scale > 0, scale, 1.0)
        values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
        # The symmetric root: axes of equal length turn with the last digits, their sum does not.
        root = scale[:, None] * ((vectors * np.sqrt(np.maximum(values, 0.0))) @ vectors.T)
        normal = random.standard_normal(draws.shape)
        return np.asarray(draws + (normal - normal.mean(axis=0)) @ root.T)

    def larger(self, quantity: Quantity, combination: Floats) -> Quantity:
        """A combination (k,) of widened draws, its variance not below what is in doubt of it by itself."""
        more = self.variance(combination) - float(combination @ self.covariance() @ combination)
        if more <= 1e-9 * quantity.u**2:
            return quantity
        wider = float(np.sqrt(1 + more / quantity.u**2))
        low, high = (quantity.value + wider * (end - quantity.value) for end in quantity.interval95)
        return replace(quantity, u=wider * quantity.u, interval95=(low, high))


def gain(linear: LinearModel, sigma: float) -> Floats:
    """By how much each estimate changes with each observation, (k, m), under noise ``sigma``, mm, of a coordinate."""
    _, covariance, _ = Density(replace(linear, sigma=sigma)).conditional(float(np.log(sigma)))
    return np.asarray(covariance @ linear.reduced.design.T / sigma**2 / linear.noise_scale)
