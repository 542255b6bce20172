"""Risks of a wrong decision, with what is known beforehand of the quantity: of this item, and of all that are tested alike.

A prior is a normal distribution; of a quantity that is never negative the part above zero. JCGM 106:2012: clause 7.2 for the
posterior distribution, clause 9.5 for the consumer's and the producer's global risk. All integrals are Gauss–Legendre sums
over panels that are narrow where the integrand bends.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy import special

from cmm_uq.base.points import Floats
from cmm_uq.maths.inference.root import root

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(24)
_REACH = 9.0
"""Standard deviations beyond which a normal distribution is nothing: 1e-19."""


@dataclass(frozen=True)
class Known:
    """A quantity before it is measured.

    Parameters
    ----------
    mean, sd : of the normal distribution.
    """

    mean: float
    sd: float

    def after(self, value: float, u: float) -> Known:
        """The same after a measurement of it: precisions add (JCGM 106:2012, formula (A.9))."""
        weight = self.sd**2 / (self.sd**2 + u**2)
        return Known(self.mean + weight * (value - self.mean), u * float(np.sqrt(weight)))

    def within(self, limit: float, *, signed: bool) -> float:
        """Probability of conforming."""
        high = float(special.ndtr((limit - self.mean) / self.sd))
        if signed:
            return max(0.0, high - float(special.ndtr((-limit - self.mean) / self.sd)))
        below = float(special.ndtr(-self.mean / self.sd))
        return max(0.0, high - below) / (1.0 - below) if below < 1.0 else 1.0

    def beyond(self, limit: float, *, signed: bool) -> float:
        """The rest, which keeps its digits where it is small."""
        high = float(special.ndtr((self.mean - limit) / self.sd))
        if signed:
            return high + float(special.ndtr((-limit - self.mean) / self.sd))
        above = float(special.ndtr(self.mean / self.sd))
        return high / above if above > 0.0 else 0.0


@dataclass(frozen=True)
class Risks:
    """Of all items that are tested alike.

    Parameters
    ----------
    consumer : that an item does not conform and is accepted.
    producer : that an item conforms and is not accepted.
    """

    consumer: float
    producer: float


@lru_cache(maxsize=4096)
def global_risks(acceptance: float, limit: float, u: float, prior: Known, *, signed: bool) -> Risks:
    """Global risks of accepting values up to an acceptance limit (JCGM 106:2012, 9.5.3 and 9.5.4).

    Parameters
    ----------
    acceptance : largest accepted size of a measured value; negative where none is accepted.
    limit : of the quantity itself.
    u : standard uncertainty of a measurement.
    """
    low = max(prior.mean - _REACH * prior.sd, -np.inf if signed else 0.0)
    high = max(prior.mean, 0.0) + _REACH * prior.sd
    total = 1.0 if signed else float(special.ndtr(prior.mean / prior.sd))
    edges = {low, high, *(np.clip(x, low, high) for x in (-limit, limit))}
    for at in (-acceptance, acceptance):
        edges |= {float(np.clip(at + k * u, low, high)) for k in range(-8, 9)}
    edges |= {float(np.clip(prior.mean + k * prior.sd, low, high)) for k in range(-9, 10)}
    values, weights = _panels(np.array(sorted(edges)))
    density = weights * np.exp(-0.5 * ((values - prior.mean) / prior.sd) ** 2) / (prior.sd * np.sqrt(2 * np.pi) * total)
    accepted = _accepted(values, acceptance, u, signed=signed)
    conforming = np.abs(values) <= limit
    return Risks(float(density[~conforming] @ accepted[~conforming]),
                 float(density[conforming] @ (1.0 - accepted[conforming])))  # fmt: skip


@lru_cache(maxsize=4096)
def acceptance_limit(risk: float, limit: float, u: float, prior: Known, *, signed: bool) -> float | None:
    """The largest acceptance limit, not beyond the limit itself, that keeps the consumer's global risk at most ``risk``.

    ``None`` where accepting any value at all would exceed it.
    """

    def excess(acceptance: float) -> float:
        return global_risks(acceptance, limit, u, prior, signed=signed).consumer - risk

    if excess(limit) <= 0:
        return limit
    if excess(0.0) > 0:
        return None
    return root(excess, 0.0, limit, 1e-9 * limit)


def _accepted(values: Floats, acceptance: float, u: float, *, signed: bool) -> Floats:
    """Probability that a measurement of each of some true values is accepted."""
    upper = special.ndtr((acceptance - values) / u)
    if not signed:
        return np.asarray(upper)
    return np.asarray(np.maximum(0.0, upper - special.ndtr((-acceptance - values) / u)))


def _panels(edges: Floats) -> tuple[Floats, Floats]:
    """Nodes and weights of a sum over panels between edges."""
    half, middle = 0.5 * np.diff(edges)[:, None], 0.5 * (edges[1:] + edges[:-1])[:, None]
    return (middle + half * _NODES).ravel(), (half * _WEIGHTS).ravel()
