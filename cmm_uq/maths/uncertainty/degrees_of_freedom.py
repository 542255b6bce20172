"""Effective degrees of freedom (Welch–Satterthwaite) and the coverage factors that follow.

The formula of JCGM 100:2008 G.4.1 asks for independent inputs. Means of simultaneous readings are not: their covariances
rest on the same readings, and a quantity computed from them has the degrees of freedom of the set (annex H.2, approach
2), whatever the correlation. So each set of correlated inputs with equal finite degrees of freedom counts as one
contribution here. Its known limits: it holds approximately, and poorly where a contribution with very few degrees of
freedom dominates or where the model is not linear (JCGM 100 G.4.1; JCGM 101 D.3; Ballico, Metrologia 37, 2000).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats
from cmm_uq.maths.uncertainty.correlation import tied
from cmm_uq.maths.uncertainty.quantity import Quantity

_ROUNDING = 1e-9


def effective_dof(contributions: Floats, matrix: Floats, dof: Sequence[Floats | float], variance: Floats) -> Floats:
    """Effective degrees of freedom of the outputs.

    Parameters
    ----------
    contributions : (p, m, ...) sensitivity × standard uncertainty of each input, with its sign.
    matrix : (m, m) correlation of the inputs.
    dof : m degrees of freedom, floats or (...).
    variance : (p, ...) combined variance, which may hold further terms of infinite degrees of freedom.

    Returns
    -------
    (p, ...) degrees of freedom, infinite where all that contributes is known.

    Notes
    -----
    A set of correlated inputs whose degrees of freedom differ was not read simultaneously; the formula does not cover
    it, and the smallest of them is taken for the whole set.
    """
    # fourth powers leave a double's range long before u does; a power of two in common changes no digit of the ratio
    _, exponent = np.frexp(np.max(np.abs(contributions), initial=0.0))
    contributions, variance = np.ldexp(contributions, -exponent), np.ldexp(variance, -2 * exponent)
    known = [bool(np.all(np.isinf(nu))) for nu in dof]
    denominator = np.zeros_like(variance)
    for group in tied(matrix):
        doubtful = [i for i in group if not known[i]]
        if not doubtful:
            continue
        part = contributions[:, doubtful]
        together = np.einsum("pi...,ij,pj...->p...", part, matrix[np.ix_(doubtful, doubtful)], part)
        nu = np.min(np.broadcast_arrays(*(np.asarray(dof[i], dtype=np.float64) for i in doubtful)), axis=0)
        denominator += together**2 / nu
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(denominator > 0, variance**2 / denominator, np.inf)


def coverage_factor(dof: Floats | float, coverage: float) -> Floats:
    """K for a symmetric interval: the t quantile for ν truncated to an integer (JCGM 100 G.4.1, G.6.4), shape of ``dof``.

    Raises
    ------
    CmmUqError : fewer than one degree of freedom, or a probability that is not between 0 and 1.
    """
    from scipy import special

    check_coverage(coverage)
    nu = np.asarray(dof, dtype=np.float64)
    truncated = np.floor(nu * (1 + _ROUNDING))
    if np.any(truncated < 1) or np.any(np.isnan(nu)):
        raise CmmUqError(
            f"{float(np.min(nu)):.3g} effective degrees of freedom support no coverage interval",
            fix="Repeat the readings that dominate the uncertainty",
        )
    p = (1 + coverage) / 2
    # a t quantile with very many degrees of freedom is that of the normal distribution
    many = truncated > 1e10
    return np.asarray(np.where(many, special.ndtri(p), special.stdtrit(np.where(many, 1.0, truncated), p)))


def factor_of_noise(noise: Quantity, u_noise: float = 1.0, u_known: float = 0.0) -> float:
    """K for 95 % of what is uncertain by a noise whose size is itself uncertain, and besides by what is known well.

    Parameters
    ----------
    noise : its standard deviation, with the standard uncertainty of that.
    u_noise, u_known : standard uncertainties by the noise, and by all else, in one unit.
    """
    more = float(np.hypot(u_noise, u_known)) / u_noise if u_noise > 0 else np.inf
    return float(coverage_factor(noise.degrees_of_freedom * more**4, 0.95))


def check_coverage(coverage: float) -> None:
    """Refuse what is no coverage probability."""
    if not 0 < coverage < 1:
        raise CmmUqError(f"a coverage probability of {coverage}", fix="It lies between 0 and 1, such as 0.95")
