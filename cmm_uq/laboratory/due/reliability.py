"""Method S2 of NCSLI RP-1: the interval at whose end a reliability target is met, from ten models of it over time.

Each model is fitted by maximum likelihood to the numbers in tolerance after intervals of different lengths, in units of the
longest, so that every parameter is of the order of one. Models that the numbers reject (F test of the lack of fit) do not
count; of the others the one with the largest figure of merit is taken.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import scipy

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, Verbatim, say
from cmm_uq.base.points import Floats
from cmm_uq.base.values import dataclass, replace

_LARGEST = 1e4  # of a parameter: beyond, no model changes any more
_EXPONENT = 700.0  # of e, within a double's range


class ReliabilityModel(NamedTuple):
    name: Text
    form: Callable[[Floats, Floats], Floats]  # of times (n,) since calibration, and parameters
    starts: tuple[tuple[float, ...], ...]  # parameters that a search begins with

    def reliability(self, t: Floats, p: Floats) -> Floats:
        """At times (n,) in units of the longest interval, with parameters of which none is negative."""
        with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
            return np.asarray(self.form(t, p))


def _within_one(variance: Floats) -> Floats:
    """Probability that a normal deviate of this variance lies within ±1."""
    return np.asarray(2 * scipy.special.ndtr(1 / np.sqrt(variance)) - 1)


def _modified_gamma(t: Floats, p: Floats) -> Floats:
    x = p[0] * t
    return np.asarray(np.exp(-x) * (1 + x + x**2 / 2 + x**3 / 6))


MODELS: Mapping[str, ReliabilityModel] = {model[0]: ReliabilityModel(*model) for model in (
    (say("exponential"), lambda t, p: np.exp(-p[0] * t), ((1.0,), (0.1,))),
    (Verbatim("Weibull"), lambda t, p: np.exp(-((p[0] * t) ** p[1])), ((1.0, 1.0), (0.3, 0.5), (0.3, 2.0))),
    (say("mixed exponential"), lambda t, p: (1 + p[0] * t) ** -p[1], ((1.0, 1.0), (10.0, 0.3))),
    (say("random walk"), lambda t, p: _within_one(p[0] + p[1] * t), ((0.3, 1.0), (0.1, 5.0))),
    (say("restricted walk"), lambda t, p: _within_one(p[0] - p[1] * np.expm1(-p[2] * t)),
     ((0.3, 1.0, 1.0), (0.1, 3.0, 5.0), (0.1, 20.0, 0.2))),
    (say("modified gamma"), _modified_gamma, ((3.0,), (1.0,))),
    (say("mortality drift"), lambda t, p: np.exp(-(p[0] * t + p[1] * t**2)), ((0.5, 0.5), (0.1, 1.0))),
    (say("warranty"), lambda t, p: 1 / (1 + np.exp(np.clip(p[0] * (t - p[1]), -_EXPONENT, _EXPONENT))),
     ((4.0, 1.0), (1.0, 0.5))),
    (say("drift"), lambda t, p: scipy.special.ndtr(p[0] + p[2] * t) + scipy.special.ndtr(p[1] - p[2] * t) - 1,
     ((2.0, 2.0, 2.0), (4.0, 1.0, 1.0))),
    (say("log-normal"), lambda t, p: scipy.special.ndtr(-np.log(p[0] * t) / p[1]), ((1.0, 1.0), (1.0, 3.0))),
)}  # fmt: skip


LEVEL = 0.95  # of the test of lack of fit, and of the range of the interval
_SURE = 1e-12  # no reliability is 0 or 1: one more calibration could show otherwise
_FAR, _STEPS = 50.0, 2000  # times, in units of the longest observed one, within which a reliability is sought
_SEARCHED = 200  # evaluations of a model in one search
_STEP = 1e-6  # of a parameter, for a gradient
_APART = 1.5  # two intervals are not alike where the step between them is so many times the mean step


@dataclass(frozen=True)
class ReliabilityData:
    """Calibrations by the length of the interval that they ended."""

    days: Floats  # (k,) length of the intervals of each group
    tested: Floats  # and in_tolerance: (k,) how many there were, and how many were found in tolerance
    in_tolerance: Floats


@dataclass(frozen=True)
class ReliabilityFit:
    name: Text
    parameters: Floats  # that maximise the likelihood, for times in days / ``scale``
    scale: float  # the longest observed interval, days
    interval: float | None  # days after which the reliability is the target; ``None`` where it never is
    rejection: float  # confidence with which the numbers reject the model, 0 to 1
    accepted: bool  # whether they do not, at 95 %
    merit: float  # RP-1's figure of merit, N_G/C · t^¼

    def reliability(self, days: Floats) -> Floats:
        """At times (n,) after calibration."""
        return MODELS[self.name].reliability(np.asarray(days, dtype=np.float64) / self.scale, self.parameters)


@dataclass(frozen=True)
class ReliabilityRegression:
    """What method S2 found: the best model first, and the range of its interval at 95 %."""

    models: tuple[ReliabilityFit, ...]
    low: float
    high: float

    @property
    def best(self) -> ReliabilityFit:
        return self.models[0]

    @property
    def interval(self) -> float:
        """Days, of the best model."""
        assert self.best.interval is not None  # noqa: S101 - of those that met the target
        return self.best.interval


def grouped(days: Sequence[float], in_tolerance: Sequence[bool], groups: int = 8) -> ReliabilityData:
    """Calibrations in groups of equal width of their intervals; each group has the mean of its intervals."""
    length, passed = np.asarray(days, dtype=np.float64), np.asarray(in_tolerance, dtype=np.float64)
    edges = np.histogram_bin_edges(length, bins=groups)
    index = np.clip(np.digitize(length, edges[1:-1]), 0, groups - 1)
    tested = np.bincount(index, minlength=groups)
    kept = tested > 0
    mean = np.bincount(index, length, groups)[kept] / tested[kept]
    return ReliabilityData(
        mean, tested[kept].astype(np.float64), np.asarray(np.bincount(index, passed, groups)[kept], dtype=np.float64)
    )


def reliability_regression(data: ReliabilityData, target: float) -> ReliabilityRegression:
    """The interval at whose end the reliability is the target."""
    _sufficient(data)
    scale = float(data.days.max())
    fitted = [_fitted(model, data, scale, target) for model in MODELS.values()]
    sizes = _alike([found.interval for found, _ in fitted])
    # C in per cent of 100 would be zero for a perfect fit; a thousandth is as good as none
    ranked = [
        replace(found, merit=size / max(found.rejection, 1e-3) * reach**0.25)
        for (found, reach), size in zip(fitted, sizes, strict=True)
    ]
    fit = [found for found in ranked if found.accepted and found.interval]
    if not fit:
        fix = "Take a lower reliability, or a fixed interval"
        raise CmmUqError(say("no model of the reliability both fits the intervals and meets the target"), fix=fix)
    best = max(fit, key=lambda found: found.merit)
    others = sorted((found for found in ranked if found is not best), key=lambda found: -found.merit)
    low, high = _range(best, data, target)
    return ReliabilityRegression((best, *others), low, high)


def _sufficient(data: ReliabilityData) -> None:
    if len(data.days) < 4 or data.tested.sum() <= len(data.days):
        raise CmmUqError(
            say("a regression of the reliability needs intervals of four lengths or more, some of them several times")
        )
    if (data.in_tolerance == data.tested).all():
        raise CmmUqError(say("nothing was ever out of tolerance, so that the reliability over time cannot be fitted"),
                         fix="Use method A3 or the drift of the values")  # fmt: skip


def _fitted(
    model: ReliabilityModel, data: ReliabilityData, scale: float, target: float
) -> tuple[ReliabilityFit, float]:
    """A model without its figure of merit, and the time (days) at which its reliability is 1 − target."""
    parameters = _most_likely(model, data, scale)
    count, groups, free = data.tested.sum(), len(data.days), len(parameters)
    observed = data.in_tolerance / data.tested
    error = (data.tested * observed * (1 - observed)).sum() / (count - groups)
    lack = (data.tested * (observed - model.reliability(data.days / scale, parameters)) ** 2).sum() / (groups - free)
    ratio = lack / error if error > 0 else np.inf
    freedoms = groups - free, count - groups
    rejection = float(scipy.special.fdtr(*freedoms, ratio)) if np.isfinite(ratio) else 1.0
    interval = _time_of(model, parameters, target)
    reach = _time_of(model, parameters, 1 - target) or _FAR
    accepted = bool(ratio < scipy.special.fdtri(*freedoms, LEVEL))
    days = None if interval is None else interval * scale
    return ReliabilityFit(model.name, parameters, scale, days, rejection, accepted, 0.0), reach * scale


def _most_likely(model: ReliabilityModel, data: ReliabilityData, scale: float) -> Floats:
    t, out = data.days / scale, data.tested - data.in_tolerance
    passed, out_of, tested = (scipy.special.xlogy(count, count) for count in (data.in_tolerance, out, data.tested))
    fullest = passed + out_of - tested

    def deviances(parameters: Floats) -> Floats:
        """Signed roots, whose squares add up to twice what the logarithm of the likelihood lacks."""
        r = np.clip(np.nan_to_num(model.reliability(t, parameters)), _SURE, 1 - _SURE)
        lacking = fullest - data.in_tolerance * np.log(r) - out * np.log1p(-r)
        return np.asarray(np.sign(data.in_tolerance - data.tested * r) * np.sqrt(2 * np.maximum(lacking, 0)))

    found = [
        scipy.optimize.least_squares(deviances, start, bounds=(0.0, _LARGEST), max_nfev=_SEARCHED)
        for start in model.starts
    ]
    return np.asarray(min(found, key=lambda one: float(one.cost)).x)


def _time_of(model: ReliabilityModel, parameters: Floats, level: float) -> float | None:
    """First time at which the reliability falls through a level; ``None`` where it begins below it or never does."""
    times = np.geomspace(1e-6, _FAR, _STEPS)
    above = np.nan_to_num(model.reliability(times, parameters)) >= level
    if not above[0] or above.all():
        return None
    i = int(np.argmin(above))

    def excess(t: float) -> float:
        return float(model.reliability(np.array([t]), parameters)[0]) - level

    return float(scipy.optimize.brentq(excess, times[i - 1], times[i]))


def _alike(intervals: Sequence[float | None]) -> list[int]:
    """For each interval, how many there are about as long (N_G of RP-1); 0 where there is none."""
    known = np.sort([interval for interval in intervals if interval is not None])
    steps = np.diff(known)
    bounds = known[1:][steps > _APART * steps.mean()] if len(steps) else known[:0]
    group = [None if one is None else int(np.searchsorted(bounds, one, side="right")) for one in intervals]
    return [0 if one is None else group.count(one) for one in group]


def _range(best: ReliabilityFit, data: ReliabilityData, target: float) -> tuple[float, float]:
    """Days between which the reliability may well be the target (RP-1 eq. D-29, from the likelihood's curvature)."""
    model, t = MODELS[best.name], data.days / best.scale
    r = np.clip(model.reliability(t, best.parameters), _SURE, 1 - _SURE)
    slopes = _gradients(model, t, best.parameters)
    covariance = np.linalg.pinv(slopes.T @ ((data.tested / (r * (1 - r)))[:, None] * slopes))
    factor = float(scipy.special.ndtri(0.5 + LEVEL / 2))
    times = np.linspace(1e-6, 1.0, 400)
    gradient = _gradients(model, times, best.parameters)
    half = factor * np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", gradient, covariance, gradient), 0))
    line = model.reliability(times, best.parameters)
    surely, maybe = times[line - half >= target], times[line + half >= target]
    low = float(surely.max()) * best.scale if len(surely) else 0.0
    high = float(maybe.max()) * best.scale if len(maybe) and maybe.max() < 1.0 else float("inf")
    return low, high


def _gradients(model: ReliabilityModel, t: Floats, parameters: Floats) -> Floats:
    """Of the reliability at times (n,) by the m parameters, (n, m)."""
    line = model.reliability(t, parameters)
    steps = _STEP * np.eye(len(parameters))
    return np.column_stack([(model.reliability(t, parameters + step) - line) / _STEP for step in steps])
