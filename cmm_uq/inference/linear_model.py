"""A linear measurement model: observations, what explains them, and what is known beforehand.

    observed = design · parameters + placing · (anything) + noise,   noise_i ~ N(0, (σ · noise_scale_i)²)

Observed values are mm. Columns of ``placing`` have no prior and are of no interest (where the artefact stood); they are
projected out exactly. Everything else in this room works on the reduced form that :meth:`LinearModel.reduced` gives.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import linalg

from cmm_uq.points import Floats


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
    unit: str
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
    placing : (m, q) columns to be projected out.
    noise_scale : (m,) positive.
    sigma : standard uncertainty of one coordinate, mm; ``None`` when it is to be estimated.
    """

    observed: Floats
    design: Floats
    unknowns: tuple[Unknown, ...]
    placing: Floats
    noise_scale: Floats
    sigma: float | None

    @cached_property
    def reduced(self) -> Reduced:
        """Whitened by the noise scale, the placing projected out by QR: (observed, design, degrees of freedom)."""
        y, A = self.observed / self.noise_scale, self.design / self.noise_scale[:, None]
        if self.placing.shape[1]:
            Q, R, _ = linalg.qr(self.placing / self.noise_scale[:, None], mode="economic", pivoting=True)
            diagonal = np.abs(np.diag(R))
            Q = Q[:, diagonal > 1e-10 * diagonal[0]]
            y, A = y - Q @ (Q.T @ y), A - Q @ (Q.T @ A)
            return Reduced(y, A, len(y) - Q.shape[1])
        return Reduced(y, A, len(y))

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
