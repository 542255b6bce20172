"""Normal vectors of which no more is observed than that each component lies within limits: how probable, and drawn exactly.

Each limit is replaced by a normal factor, so that mean and variance of its component are right given all others (expectation
propagation: Minka 2001; of boxes: Cunningham, Hennig, Lacoste-Julien 2011, arXiv:1111.6832). Draws are taken one component
after the other, with the limits before it as they are and those after it by their factors; what is left of the density is
their weight, whose mean is the probability itself (sequential importance sampling: Genz 1992, J. Comput. Graph. Stat. 1, 141).
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
import scipy

from cmm_uq.base.points import Floats
from cmm_uq.base.values import dataclass

_SWEEPS, _SETTLED = 30, 1e-4  # over all components; change of a mean, in standard deviations
_LOG_DENSITY = -0.5 * np.log(2 * np.pi)


@dataclass(frozen=True, eq=False)
class WithinLimits:
    mean: Floats  # (w, m)
    covariance: Floats  # (w, m, m)
    limit: Floats  # (m,): every component lies between minus and plus this

    @cached_property
    def _fitted(self) -> tuple[Floats, Floats, Floats, Floats, Floats]:
        """Factors exp(νx − ½τx²) of x, the deviation from ``mean``: τ, ν (w, m), mean and covariance with them, ln det."""
        covariance, (w, m) = self.covariance.copy(), self.mean.shape
        tau, nu, mean, log_det = np.zeros((w, m)), np.zeros((w, m)), np.zeros((w, m)), np.zeros(w)
        for _ in range(_SWEEPS):
            before = mean.copy()
            for j in range(m):
                column = covariance[:, :, j]
                precision, shift = 1 / column[:, j] - tau[:, j], mean[:, j] / column[:, j] - nu[:, j]
                _, at, variance = truncated(self.mean[:, j] + shift / precision, precision**-0.5, self.limit[j])
                more = np.maximum(1 / variance - precision, 0.0) - tau[:, j]
                push = (at - self.mean[:, j]) / variance - shift - nu[:, j]
                log_det += np.log1p(more * column[:, j])
                part = more / (1 + more * column[:, j])
                mean += column * (push - part * (mean[:, j] + column[:, j] * push))[:, None]
                covariance -= part[:, None, None] * column[:, :, None] * column[:, None, :]
                tau[:, j], nu[:, j] = tau[:, j] + more, nu[:, j] + push
            if np.all((mean - before) ** 2 < _SETTLED**2 * np.einsum("wjj->wj", covariance)):
                break
        return tau, nu, mean, covariance, log_det

    @cached_property
    def _by_factors(self) -> Floats:
        """(w,) logarithm of the mean of the product of all factors."""
        _, nu, mean, _, log_det = self._fitted
        return np.asarray(0.5 * (np.einsum("wj,wj->w", nu, mean) - log_det))

    @cached_property
    def log_probability(self) -> Floats:
        """(w,) that all components are within their limits, by expectation propagation."""
        tau, nu, mean, covariance, _ = self._fitted
        variance = np.einsum("wjj->wj", covariance)
        precision, shift = 1 / variance - tau, mean / variance - nu
        log, _, _ = truncated(self.mean + shift / precision, precision**-0.5, self.limit)
        own = log + _integral(shift, precision) - _integral(shift + nu, precision + tau)
        return np.asarray(own.sum(axis=1) + self._by_factors)

    def draw(self, random: np.random.Generator, count: int) -> tuple[Floats, Floats]:
        """Draws (w, count, m), and logarithms (w, count) of weights whose mean is the probability."""
        tau, nu, mean, covariance, _ = self._fitted
        w, m = mean.shape
        factor = np.linalg.cholesky(covariance)
        drawn, white = np.empty((w, count, m)), np.zeros((w, count, m))
        log = np.repeat(self._by_factors[:, None], count, axis=1)
        for j in range(m):
            sd = factor[:, j, j, None]
            at = mean[:, j, None] + np.einsum("wqi,wi->wq", white[:, :, :j], factor[:, j, :j])
            precision, shift = 1 / sd**2 - tau[:, j, None], at / sd**2 - nu[:, j, None]
            place, spread = self.mean[:, j, None] + shift / precision, precision**-0.5
            log += truncated(place, spread, self.limit[j])[0]
            log += _integral(shift, precision) - _integral(at / sd**2, 1 / sd**2)
            drawn[:, :, j] = truncated_draws(place, spread, self.limit[j], random.random((w, count)))
            white[:, :, j] = (drawn[:, :, j] - self.mean[:, j, None] - at) / sd
        return drawn, log


def _integral(shift: Floats, precision: Floats) -> Floats:
    """Logarithm of the integral of exp(shift·x − ½·precision·x²), up to a constant."""
    return np.asarray(0.5 * (shift**2 / precision - np.log(precision)))


def _ends(mean: Floats, sd: Floats, limit: Floats | float) -> tuple[Floats, Floats, Floats]:
    """Where, in standard deviations, the limits are of a normal quantity whose mean is turned positive; (…) its sign."""
    return (-limit - np.abs(mean)) / sd, (limit - np.abs(mean)) / sd, np.where(mean < 0, -1.0, 1.0)


def truncated(mean: Floats, sd: Floats, limit: Floats | float) -> tuple[Floats, Floats, Floats]:
    """Logarithm of the probability that normal quantities are within ±limit; their mean and variance if they are."""
    low, high, sign = _ends(mean, sd, limit)
    log = scipy.special.log_ndtr(high) + np.log(-np.expm1(scipy.special.log_ndtr(low) - scipy.special.log_ndtr(high)))
    below, above = (np.exp(_LOG_DENSITY - 0.5 * end**2 - log) for end in (low, high))
    variance = np.maximum(1 + low * below - high * above - (below - above) ** 2, 1e-12)
    return log, np.asarray(mean + sign * sd * (below - above)), np.asarray(sd**2 * variance)


def truncated_draws(mean: Floats, sd: Floats, limit: float, uniform: Floats) -> Floats:
    """Of these, for numbers uniform between 0 and 1."""
    low, high, sign = _ends(mean, sd, limit)
    with np.errstate(divide="ignore"):
        below, above = scipy.special.log_ndtr(low), scipy.special.log_ndtr(high)
        log = np.logaddexp(np.log(uniform) + above, np.log1p(-uniform) + below)
    return np.asarray(np.clip(mean + sign * sd * scipy.special.ndtri_exp(log), -limit, limit))
