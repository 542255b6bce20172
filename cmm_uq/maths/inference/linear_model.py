"""A linear measurement model: observations, what explains them, and what is known beforehand.

    observed = design · parameters + placing · (anything) + noise,   noise_i ~ N(0, (σ · noise_scale_i)²)

Observed values are mm. Columns of ``placing`` have no prior and are of no interest (where the artefact stood); they are
projected out exactly. Everything else in this room works on the reduced form that :meth:`LinearModel.reduced` gives.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from cmm_uq.base.points import Floats
from cmm_uq.base.units import Unit
from cmm_uq.maths.inference.freedoms import Freedoms

Whiten = Callable[[Floats], Floats]


@dataclass(frozen=True)
class Unknown:
    """A parameter of a linear model.

    Parameters
    ----------
    key : effect (or ``artefact``) and parameter name, as in results.json.
    unit : as printed.
    prior_mean, prior_sd : what is known beforehand; an infinite standard deviation means nothing.
    scale : a typical size, for columns of comparable length.
    known : whether the prior comes from a certificate, so that least squares may use it too.
    """

    key: tuple[str, str]
    unit: Unit
    prior_mean: float
    prior_sd: float
    scale: float
    known: bool = False


@dataclass(frozen=True, eq=False)
class LinearModel:
    """See the module's docstring.

    Parameters
    ----------
    observed : (m,) mm.
    design : (m, k) mm per unit of each parameter.
    unknowns : k of them.
    placing : (m, q) columns to be projected out, or those of each placing by itself.
    noise_scale : (m,) positive.
    sigma : standard uncertainty of one coordinate, mm; ``None`` when it is to be estimated.
    """

    observed: Floats
    design: Floats
    unknowns: tuple[Unknown, ...]
    placing: Floats | Freedoms
    noise_scale: Floats
    sigma: float | None

    @cached_property
    def reduced(self) -> Reduced:
        """Whitened by the noise scale, the placing projected out by QR: (observed, design, degrees of freedom)."""
        y = self.reduce(self.observed[:, None])[:, 0]
        return Reduced(y, self.reduce(self.design), len(y) - self._whitened.rank)

    def reduce(self, columns: Floats) -> Floats:
        """Columns (m, r), mm, in units of the noise scale, the placing projected out."""
        return self._whitened.without(columns / self.noise_scale[:, None])

    @cached_property
    def freedoms(self) -> Freedoms:
        """The columns of the placing, by placing where that is known."""
        return Freedoms.of(self.placing)

    @cached_property
    def _whitened(self) -> Freedoms:
        """The same in units of the noise scale."""
        return self.freedoms.over(self.noise_scale)

    def at(self, rows: NDArray[np.bool_]) -> LinearModel:
        """The model of some of its observations."""
        return replace(
            self, observed=self.observed[rows], design=self.design[rows], placing=self.freedoms.at(rows),
            noise_scale=self.noise_scale[rows],
        )  # fmt: skip

    def only(self, parameters: Sequence[int]) -> LinearModel:
        """The model with some of its parameters, the others zero."""
        chosen = list(parameters)
        return replace(self, design=self.design[:, chosen], unknowns=tuple(self.unknowns[i] for i in chosen))

    def uncorrelated(self, whiten: Whiten) -> LinearModel:
        """The same model in observations without correlation.

        Parameters
        ----------
        whiten : what turns columns (m, r) of noise, mm, into white noise of one coordinate's standard deviation.
        """
        observed = whiten(self.observed[:, None])[:, 0]
        return replace(
            self, observed=observed, design=whiten(self.design), placing=whiten(self.freedoms.dense()),
            noise_scale=np.ones(len(observed)),
        )  # fmt: skip

    @property
    def priors(self) -> tuple[Floats, Floats]:
        """What is known beforehand as p observations of unit variance: rows (p, k), and what they give, (p,).

        A certificate without uncertainty is taken as good to a millionth of a typical size.
        """
        known = np.isfinite(self.prior_sd)
        scale = np.array([u.scale for u in self.unknowns])
        sd = np.maximum(self.prior_sd, 1e-6 * scale)[known]
        return np.eye(len(known))[known] / sd[:, None], self.prior_mean[known] / sd

    @property
    def prior_mean(self) -> Floats:
        """(k,)."""
        return np.array([u.prior_mean for u in self.unknowns])

    @property
    def prior_sd(self) -> Floats:
        """(k,); infinite where nothing is known."""
        return np.array([u.prior_sd for u in self.unknowns])


@dataclass(frozen=True, eq=False)
class Reduced:
    """Observations (m,) and design (m, k) in units of the noise scale, and how many observations they are worth."""

    observed: Floats
    design: Floats
    count: int
