"""How the reliability of equipment falls with the time since its calibration: the ten models of NCSLI RP-1, method S2.

Times are in units of the longest observed one, so that every parameter is of the order of one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy import special

from cmm_uq.base.messages import Text, Verbatim, say
from cmm_uq.base.points import Floats

_LARGEST = 1e4
"""Of a parameter: beyond, no model changes any more."""

_EXPONENT = 700.0
"""Of e, within a double's range."""


@dataclass(frozen=True)
class ReliabilityModel:
    """One model.

    Parameters
    ----------
    name : as RP-1 calls it.
    reliability : of times (n,) since calibration, and parameters.
    starts : parameters that a search begins with.
    """

    name: Text
    reliability: Callable[[Floats, Floats], Floats]
    starts: tuple[tuple[float, ...], ...]

    @property
    def bounds(self) -> list[tuple[float, float]]:
        """Of the parameters: none is negative."""
        return [(0.0, _LARGEST)] * len(self.starts[0])


def _exponential(t: Floats, p: Floats) -> Floats:
    return np.asarray(np.exp(-p[0] * t))


def _weibull(t: Floats, p: Floats) -> Floats:
    with np.errstate(over="ignore"):
        return np.asarray(np.exp(-((p[0] * t) ** p[1])))


def _mixed_exponential(t: Floats, p: Floats) -> Floats:
    return np.asarray((1 + p[0] * t) ** -p[1])


def _within_one(variance: Floats) -> Floats:
    """Probability that a normal deviate of this variance lies within ±1."""
    with np.errstate(divide="ignore"):
        return np.asarray(2 * special.ndtr(1 / np.sqrt(variance)) - 1)


def _random_walk(t: Floats, p: Floats) -> Floats:
    return _within_one(p[0] + p[1] * t)


def _restricted_walk(t: Floats, p: Floats) -> Floats:
    return _within_one(p[0] - p[1] * np.expm1(-p[2] * t))


def _modified_gamma(t: Floats, p: Floats) -> Floats:
    x = p[0] * t
    return np.asarray(np.exp(-x) * (1 + x + x**2 / 2 + x**3 / 6))


def _mortality_drift(t: Floats, p: Floats) -> Floats:
    return np.asarray(np.exp(-(p[0] * t + p[1] * t**2)))


def _warranty(t: Floats, p: Floats) -> Floats:
    return np.asarray(1 / (1 + np.exp(np.clip(p[0] * (t - p[1]), -_EXPONENT, _EXPONENT))))


def _drift(t: Floats, p: Floats) -> Floats:
    return np.asarray(special.ndtr(p[0] + p[2] * t) + special.ndtr(p[1] - p[2] * t) - 1)


def _log_normal(t: Floats, p: Floats) -> Floats:
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(special.ndtr(-np.log(p[0] * t) / p[1]))


MODELS: Mapping[str, ReliabilityModel] = {
    model.name: model
    for model in (
        ReliabilityModel(say("exponential"), _exponential, ((1.0,), (0.1,))),
        ReliabilityModel(Verbatim("Weibull"), _weibull, ((1.0, 1.0), (0.3, 0.5), (0.3, 2.0))),
        ReliabilityModel(say("mixed exponential"), _mixed_exponential, ((1.0, 1.0), (10.0, 0.3))),
        ReliabilityModel(say("random walk"), _random_walk, ((0.3, 1.0), (0.1, 5.0))),
        ReliabilityModel(
            say("restricted walk"), _restricted_walk, ((0.3, 1.0, 1.0), (0.1, 3.0, 5.0), (0.1, 20.0, 0.2))
        ),
        ReliabilityModel(say("modified gamma"), _modified_gamma, ((3.0,), (1.0,))),
        ReliabilityModel(say("mortality drift"), _mortality_drift, ((0.5, 0.5), (0.1, 1.0))),
        ReliabilityModel(say("warranty"), _warranty, ((4.0, 1.0), (1.0, 0.5))),
        ReliabilityModel(say("drift"), _drift, ((2.0, 2.0, 2.0), (4.0, 1.0, 1.0))),
        ReliabilityModel(say("log-normal"), _log_normal, ((1.0, 1.0), (1.0, 3.0))),
    )
}
