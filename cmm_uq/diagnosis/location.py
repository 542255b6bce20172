"""Where a mismatch lives: the covariate that an unknown function of it explains, the function, and the region."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import special

from cmm_uq.diagnosis.comparison.explanations import UNKNOWN
from cmm_uq.diagnosis.comparison.lack_of_fit import tail_probability
from cmm_uq.diagnosis.comparison.search import ModelComparison
from cmm_uq.diagnosis.comparison.stack import Version
from cmm_uq.messages import Text
from cmm_uq.points import Floats, Ints
from cmm_uq.units import MICROMETRE

_UNSEEN = 0.05
"""Part of a constant or a line that must show in the observations; with less, nothing is known of it."""


@dataclass(frozen=True, eq=False)
class Place:
    """Where a mismatch lives.

    Parameters
    ----------
    covariate : column that it depends on.
    region : of that covariate, where it is larger than half its maximum, or between which values it jumps.
    p_value : corrected for having looked at every covariate.
    amplitude_um : largest value of the smooth function.
    what : the unknown function, in words.
    curve : covariate, function and its standard uncertainty in µm, each (p,).
    """

    covariate: str
    region: tuple[float, float]
    p_value: float
    amplitude_um: float
    what: Text
    curve: tuple[Floats, Floats, Floats]


def located(compared: ModelComparison, alpha: float) -> tuple[Place, ...]:
    """Every covariate of which a function is significant at ``alpha``, the most significant first."""
    if compared.p_value >= alpha:
        return ()
    found = []
    unknowns = {i for i, e in enumerate(compared.explanations) if e.kind == UNKNOWN}
    for i, (_, version) in compared.comparison.beside((), unknowns).items():
        explanation = compared.explanations[i]
        if i not in unknowns:
            continue
        name, covariate = explanation.covariate_name, explanation.covariate
        p_value = tail_probability(compared.null_maximum, float(compared.log_odds[i]))
        if name is None or covariate is None or p_value >= alpha:
            continue
        x, order = np.unique(covariate, return_index=True)
        values = explanation.members[version.member].values
        y, u = _function(compared, version, x, values[order])
        region = region_of(x, y) if values.shape[1] > 1 else _jump(compared, i, x, order)
        curve = (x, y / MICROMETRE, u / MICROMETRE)
        found.append(Place(name, region, p_value, float(np.abs(y).max()) / MICROMETRE, explanation.name, curve))
    return tuple(sorted(found, key=lambda place: place.p_value))


def _function(compared: ModelComparison, version: Version, x: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Best linear estimate of an unknown function and its standard uncertainty, mm, each (p,).

    A constant or a line that no observation shows, or that the baseline absorbs, is no part of the function.
    """
    comparison, member = compared.comparison, compared.explanations[version.explanation].members[version.member]
    columns = member.columns / comparison.noise_scale[:, None]
    left = comparison.rest(columns)
    least = comparison.left - left @ np.linalg.lstsq(left, comparison.left, rcond=None)[0]
    degrees = max(comparison.degrees_of_freedom - left.shape[1], 1)
    variance = max(float(least @ least) / degrees, comparison.least_noise**2)
    precision = left.T @ left / variance + np.eye(left.shape[1]) / (version.amplitude**2 * variance)
    covariance = np.linalg.inv(precision)
    lines = np.column_stack([np.ones_like(x), (x - x.mean()) / np.ptp(x)])
    among = np.linalg.lstsq(values, lines, rcond=None)[0]
    shown = np.sqrt(np.mean((left @ among) ** 2, axis=0))
    unseen = shown < _UNSEEN * np.sqrt(np.mean((values @ among) ** 2, axis=0))
    lines = lines[:, unseen]
    values = values - lines @ np.linalg.lstsq(lines, values, rcond=None)[0]
    estimate = values @ (covariance @ (left.T @ comparison.left)) / variance
    return estimate, np.sqrt(np.einsum("pi,ij,pj->p", values, covariance, values))


def _jump(compared: ModelComparison, index: int, x: Floats, order: Ints) -> tuple[float, float]:
    """Range of the sorted covariate that holds a step with 95 % probability."""
    members = compared.explanations[index].members
    evidence = np.full(len(members), -np.inf)
    for group, cube in compared.comparison.each(None, (), (index,)):
        if group.r == 1:
            evidence[group.member] = special.logsumexp(cube[:, :, 0], axis=1)
    probability = np.exp(evidence - special.logsumexp(evidence))
    likely = np.argsort(-probability)
    likely = likely[: int(np.searchsorted(np.cumsum(probability[likely]), 0.95)) + 1]
    jumps = [int(np.flatnonzero(np.diff(members[m].values[order, 0]))[0]) for m in likely]
    return float(x[min(jumps)]), float(x[max(jumps) + 1])


def region_of(covariate: Floats, curve: Floats) -> tuple[float, float]:
    """Range of the sorted covariate about the curve's largest value where it exceeds half of it."""
    high = np.abs(curve) >= 0.5 * np.abs(curve).max()
    first = last = int(np.argmax(np.abs(curve)))
    while first > 0 and high[first - 1]:
        first -= 1
    while last < len(high) - 1 and high[last + 1]:
        last += 1
    return float(covariate[first]), float(covariate[last])
