"""Effects of many coefficients that have one size in common: errors of which only the size is known beforehand.

Reported is the root mean square of what they do. Its draws are those of a posterior in which that common size is known as well
as the coefficients tell it: without that, noise would add to it.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from cmm_uq.base.errors import CmmUqError, suggestion
from cmm_uq.base.points import Floats
from cmm_uq.machine.physics.effect import Effect, Parameter, Shape

SEED = "seed"
"""Beside the size, in a truth: which of all errors of this size."""


_GRID, _HELD = 2000, 1e-9
"""Of sizes; part of the largest variance below which a combination is held."""

_GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)
"""Multiples of it spread evenly over the unit interval, and neighbours lie apart: draws of a chain share nothing with them."""


class CommonSize(Effect):
    """See the module's docstring.

    Attributes
    ----------
    size : reported, in the unit of the coefficients.
    """

    size: Parameter

    @property
    def reported(self) -> tuple[Parameter | Shape, ...]:
        """The size alone."""
        return (self.size,)

    def errors(self, coefficients: Floats) -> Floats:
        """(…, j) what coefficients (…, k) are of, in their unit: the coefficients themselves, where nothing else is said."""
        return coefficients

    def to_reported(self, coefficients: Floats, shape: Floats) -> dict[str, Floats]:
        """Root mean square of the errors, for one vector of coefficients, or for each of many draws (N, k)."""
        errors = self.errors(coefficients)
        if errors.ndim == 2 and len(errors) > 1:
            errors = _shrunk(errors)
        return {self.size.name: np.sqrt(np.mean(errors**2, axis=-1))}

    def from_reported(self, parameters: Mapping[str, float]) -> tuple[Floats, tuple[float, ...]]:
        """Coefficients (k,) of exactly this size, drawn by the ``seed`` that may stand beside it.

        Raises
        ------
        CmmUqError : the size is missing, a parameter is unknown, or the seed is no whole number.
        """
        for name in parameters:
            if name not in (self.size.name, SEED):
                raise CmmUqError(f"{self.name} has no parameter {name!r}", fix=suggestion(name, [self.size.name, SEED]))
        if self.size.name not in parameters:
            raise CmmUqError(f"{self.name} needs the parameter {self.size.name!r}")
        seed = parameters.get(SEED, 0.0)
        if seed < 0 or seed != int(seed):
            raise CmmUqError(f"{self.name}: seed = {seed:g} is no whole number", fix="Give 0, 1, 2, …")
        drawn = np.random.default_rng(int(seed)).standard_normal(len(self.coefficients))
        rms = float(np.sqrt(np.mean(self.errors(drawn) ** 2)))
        return drawn * (parameters[self.size.name] / rms if rms > 0 else 0.0), ()


def _shrunk(draws: Floats) -> Floats:
    """Draws (N, j) of errors with their common size for a hyper-parameter, known as well as they themselves tell.

    Along each principal axis of their covariance an error ĉ of variance v is, given a size s, normal about k·ĉ with variance
    k·v, k = s²/(s² + v). Each draw has its own s, of the posterior p(s) ∝ Π N(ĉ; 0, s² + v) under a constant prior (A. Gelman,
    Bayesian Analysis 1 (2006) 515, section 4), so that what is not known of the size widens its interval.
    """
    mean = draws.mean(axis=0)
    v, axes = np.linalg.eigh(np.atleast_2d(np.cov(draws, rowvar=False)))
    v = np.maximum(v, 0.0)
    about, c = (draws - mean) @ axes, mean @ axes
    free = v > _HELD * v.max(initial=0.0)  # what no coefficient does is no error
    k = np.ones(draws.shape)
    if free.any():
        squares = _sizes(c[free], v[free], len(draws))[:, None] ** 2
        k[:, free] = squares / (squares + v[free])
    return np.asarray((k * c + np.sqrt(k) * about) @ axes.T, dtype=np.float64)


def _sizes(c: Floats, v: Floats, count: int) -> Floats:
    """(count,) sizes of their posterior, given errors c (j,) of variances v (j,): even probabilities in mixed order."""
    part = (np.arange(_GRID) + 0.5) / _GRID
    turn = 0.5 * np.pi * part
    s = np.sqrt(np.mean(c**2) + np.mean(v)) * np.tan(turn)  # the whole half line
    variance = s[:, None] ** 2 + v
    logs = -0.5 * np.sum(c**2 / variance + np.log(variance), axis=1) - 2.0 * np.log(np.cos(turn))
    weights = np.exp(logs - logs.max())
    probability = (np.cumsum(weights) - 0.5 * weights) / weights.sum()
    return np.asarray(np.interp((np.arange(1, count + 1) * _GOLDEN) % 1.0, probability, s), dtype=np.float64)
