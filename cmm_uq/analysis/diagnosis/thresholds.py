"""From which size on effects are detected and named: thresholds of the recording's own null distribution, interpolated."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import comb, sqrt

import numpy as np
from scipy import special

from cmm_uq.analysis.diagnosis.comparison.explanations import EFFECT, UNKNOWN, Explanation
from cmm_uq.analysis.diagnosis.comparison.lack_of_fit import NOTHING, log_prior, tail_probability
from cmm_uq.analysis.diagnosis.comparison.prior import EFFECTS
from cmm_uq.analysis.diagnosis.detection import LONGEST, SHORTEST, Thresholds
from cmm_uq.analysis.diagnosis.power import CERTAIN, Naming
from cmm_uq.analysis.diagnosis.showing import View
from cmm_uq.base.points import Floats
from cmm_uq.maths.inference.root import root

SIZES = (1.0, 2.0, 5.0)
"""Visible lengths, over a first guess of the threshold, at which the statistic is computed."""

LENGTHS = np.geomspace(SHORTEST, LONGEST, 160)

_CLOSEST = 0.9999
_RIVALS = 4


def thresholds(view: View, which: Sequence[int], columns: Floats, alpha: float) -> Iterator[Thresholds]:
    """Of each effect, from the statistic on the bare effect at :data:`SIZES`.

    Parameters
    ----------
    view : of the search.
    which : (n,) place of each effect among the explanations.
    columns : (n, m) what is left of each, of visible length one.
    alpha : rate of false alarms.
    """
    if not which:
        return
    first = view.found.first
    comparison, explanations = first.comparison, first.explanations
    gate = _gate(first.null, alpha)
    prior = log_prior(explanations)
    sizes = np.array([[sqrt(max(2 * (gate - prior[i] + 1.0), 4.0)) * size for size in SIZES] for i in which])
    data = (sizes[:, :, None] * columns[:, None, :]).reshape(-1, columns.shape[1]).T
    odds = comparison.of_signal(data, view.noise).reshape(len(explanations), len(which), len(SIZES))
    dof = max(view.known + view.left, 1.0)
    naming = Naming(explanations)
    pair = _pair(explanations, comparison.visible)
    for i, index in enumerate(which):
        each = _between(dof * np.log1p(sizes[i] ** 2 / dof), odds[:, i], dof * np.log1p(LENGTHS**2 / dof))
        statistic = special.logsumexp(prior[:, None] + each, axis=0)
        if pair is not None:
            statistic = np.logaddexp(statistic, pair + each[index])
        (detected,) = _passes((statistic - gate)[None])
        yield Thresholds(float(detected), *_rivals(naming, each, index), view.known, view.left)


def _between(v: Floats, odds: Floats, at: Floats) -> Floats:
    """Log odds (c, d) at lengths ``at`` (d,) from those (c, s) at ``v`` (s,), by straight lines, the outer ones prolonged."""
    known = np.where(np.isfinite(odds), odds, -1e6)
    part = np.clip(np.searchsorted(v, at) - 1, 0, len(v) - 2)
    slope = np.diff(known, axis=1) / np.diff(v)
    return np.asarray(known[:, part] + slope[:, part] * (at - v[part]))


def _pair(explanations: Sequence[Explanation], visible: frozenset[int]) -> float | None:
    """Logarithm of what a second effect adds to the statistic beside the first: nothing but its prior, on average."""
    count = sum(
        e.kind == EFFECT and e.weight == 1 and not e.shaped and i in visible for i, e in enumerate(explanations)
    )
    if count < 2:
        return None
    return float(np.log(EFFECTS[2] / EFFECTS[0]) - np.log(comb(count, 2)) + np.log(NOTHING) + np.log(count - 1))


def _gate(null: Floats, alpha: float) -> float:
    """Statistic that the test rejects from."""
    low, high = float(null.min()) - 1.0, float(null.max()) + 50.0
    return root(lambda value: float(np.log(tail_probability(null, value) / alpha)), low, high, 1e-6)


def _passes(margins: Floats) -> Floats:
    """Length (r,) from which on margins (r, d) over :data:`LENGTHS` stay positive; infinite where one never does."""
    count = len(LENGTHS)
    last = count - 1 - np.argmax(margins[:, ::-1] <= 0, axis=1)  # where it is not positive for the last time
    before, each = np.minimum(last, count - 2), np.arange(len(margins))
    low, high = margins[each, before], margins[each, before + 1]
    with np.errstate(divide="ignore", invalid="ignore"):
        found = -low * ((LENGTHS[before + 1] - LENGTHS[before]) / (high - low)) + LENGTHS[before]
    found[last == count - 1] = np.inf
    found[(margins > 0).all(axis=1)] = LENGTHS[0]
    return np.asarray(found, dtype=np.float64)


def _rivals(naming: Naming, odds: Floats, true: int) -> tuple[Floats, Floats]:
    """Length (r,) from which on the true effect exceeds each of its closest rivals, and the cosines (r,) with them.

    A cosine follows from how fast the two gain evidence.

    Parameters
    ----------
    odds : (c, d) log odds of each explanation at :data:`LENGTHS`.
    """
    kinds = np.array([explanation.kind for explanation in naming.explanations])
    weight = odds + naming.priors[:, None]
    known = (kinds == EFFECT) & (np.arange(len(kinds)) != true)
    functions = special.logsumexp(weight[kinds == UNKNOWN], axis=0, keepdims=True)
    others = np.vstack([weight[known] + CERTAIN, functions])
    lengths = _passes(weight[true] - others)
    closest = np.argsort(-lengths, kind="stable")[:_RIVALS]
    at = np.searchsorted(LENGTHS, np.minimum(lengths[closest], LONGEST)).clip(1, len(LENGTHS) - 1)
    own, other = (rows[..., at] - rows[..., at - 1] for rows in (weight[true], others[closest]))
    gained = np.diagonal(other) / np.maximum(own, 1e-12)
    return lengths[closest], np.sqrt(np.clip(gained, 0.0, _CLOSEST))
