"""What is stated of a part's characteristics: values where points were measured, and uncertainty with or without them.

The width of a zone is never negative. Draws of its true value are quantiles of a confidence distribution
(``inverting``), of which those with which even a perfect part would have been measured wider are negative.
Its value is the median of all, as often too large as too small, and zero where that is negative. Its interval lies between the
tails of ``unified``: it holds as often however small the zone is, and is not empty because a measurement
happened to be better than its errors. Probabilities are those of possible draws.

How far measured points lie from the features that are associated with them: what of a part's form was seen.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cmm_uq.analysis.conformity.limits import SCARCE
from cmm_uq.analysis.parts.characteristics import never_negative
from cmm_uq.analysis.parts.evaluation import characteristics_of
from cmm_uq.analysis.parts.plan import FEWEST as FEWEST_POINTS, PartFeature, Plan
from cmm_uq.analysis.parts.zones import tails
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats
from cmm_uq.maths.geometry.association import associate
from cmm_uq.maths.uncertainty.monte_carlo import Simulated

FEWEST = 500  # draws that are possible, from which on a probability is taken from them alone


@dataclass(frozen=True)
class StatedCharacteristic:
    """One characteristic."""

    name: str
    # mm or rad, less the mean error, of a zone the median one, and zero at least; ``None`` where nothing was measured
    value: float | None
    error: float  # mean of the errors: by how much such a measurement is off on average, mm or rad
    u: float  # standard uncertainty, mm or rad
    # shortest coverage interval of the value, of a zone the unified one; where nothing was measured the shortest of the
    # error, with the opposite sign
    interval: tuple[float, float]
    # half of the shortest interval of the errors over u; of a zone half of its own interval where that is more, and so much
    # that U reaches to the end of an interval that begins at zero
    k: float

    @property
    def U(self) -> float:  # noqa: N802
        """Half of the interval, mm or rad; see ``k``. Of a zone near zero it may reach below zero."""
        return self.k * self.u if self.u else 0.5 * (self.interval[1] - self.interval[0])


def stated(
    simulated: Simulated, measured: Floats | None = None, plan: Plan | None = None, errors: Floats | None = None
) -> tuple[StatedCharacteristic, ...]:
    """Every characteristic, of its errors in virtual measurements and its measured values (c,).

    Parameters
    ----------
    plan, errors : characteristics, and draws (N, c) of their errors, by which values and intervals of zones are those of what
        is possible; without them they are those of the errors alone.
    """
    found = []
    zones = np.zeros(len(simulated.outputs), dtype=bool) if plan is None else never_negative(plan)
    for i, name in enumerate(simulated.outputs):
        error, u = float(simulated.value[i]), float(simulated.u[i])
        low, high = simulated.interval[i].tolist()
        at = 0.0 if measured is None else float(measured[i])
        value = None if measured is None else at - error
        interval = at - high, at - low
        k = 0.5 * (high - low) / u if u else float("nan")
        if value is not None and zones[i]:
            if errors is not None:
                value = at - middle(errors[:, i])
                interval = possible_interval(at - errors[:, i], simulated.coverage)
            value = max(0.0, value)
            low, high = interval
            k = max(k, 0.5 * (high - low) / u, (high - value) / u if low <= 0 else 0.0) if u else k
        found.append(StatedCharacteristic(name, value, error, u, interval, k))
    return tuple(found)


def middle(errors: Floats) -> float:
    """Of the errors (N,) of a zone: about which it is as often too large as too small."""
    return float(np.median(errors))


def possible_interval(true: Floats, coverage: float) -> tuple[float, float]:
    """Between tails of all draws that hold as often however small the zone is (:func:`.tails`).

    Where few are possible it ends where errors of a perfect part do: draws are negative by as much as these are larger.
    """
    negative = float(np.mean(true < 0))
    below, above = tails(negative, coverage)
    scarce = 1 - negative < SCARCE
    high = np.quantile(np.abs(true), coverage) if scarce else np.quantile(true, 1 - above)
    return max(0.0, float(np.quantile(true, below))), float(high)


def evaluated(plan: Plan, points: Floats) -> Floats:
    """Characteristics (c,) of measured points (n, 3) in the frame of the part, mm, in the order of the plan's."""
    if points.shape != plan.points.shape:
        raise CmmUqError(f"{len(points)} points were measured, the plan has {len(plan.points)}", where="the recording",
                         fix="Measure each point of the plan once")  # fmt: skip
    return characteristics_of(plan, points)


def conforming(plan: Plan, errors: Floats, measured: Floats) -> tuple[Floats, float]:
    """Probabilities that the true values lie within the limits of the drawing, given that no zone is negative.

    ``errors``: (N, c) of virtual measurements. ``measured``: (c,) values.

    Returns ``each``: (c,) of every characteristic; ``nan`` where it has no limits. ``together``: of all that have some at
    once; ``nan`` where none has.
    """
    true, zones = measured - errors, never_negative(plan)
    scarce = zones & (np.mean(true >= 0, axis=0) < SCARCE)
    true[:, scarce] = np.abs(true[:, scarce])
    inside = np.ones(true.shape, dtype=bool)
    limited = np.zeros(len(plan.characteristics), dtype=bool)
    for i, one in enumerate(plan.characteristics):
        low = -np.inf if one.lower is None else one.lower
        high = np.inf if one.upper is None else one.upper
        inside[:, i] = (low <= true[:, i]) & (true[:, i] <= high)
        limited[i] = np.isfinite(low) or np.isfinite(high)
    possible = ~zones | (true >= 0)
    each = np.array([_share(inside[:, i], possible[:, i]) if limited[i] else np.nan for i in range(len(limited))])
    if not limited.any():
        return each, float("nan")
    together = _share(*(np.asarray(of[:, limited].all(axis=1)) for of in (inside, possible)))
    return each, within_bounds(
        together, each[limited]
    )  # what is possible of all at once is not what is possible of each


def within_bounds(together: float, each: Floats) -> float:
    """The probability of all at once, as near as Fréchet's bounds allow: no more than that of one, no less than all leave."""
    return float(np.clip(together, max(0.0, 1 - np.sum(1 - each)), each.min()))


def _share(inside: NDArray[np.bool_], possible: NDArray[np.bool_]) -> float:
    """Of the draws that are possible; of all, where these are few."""
    return float(np.mean(inside[possible] if np.count_nonzero(possible) >= FEWEST else inside))


def deviations_of(plan: Plan, measured: Floats) -> Floats:
    """(n,) signed distances of measured points (n, 3) from their least-squares features, out of the material, mm.

    ``nan`` of features whose number of points alone determines them, which have no form.
    """
    found = np.full(len(measured), np.nan)
    for feature in plan.features:
        if len(feature.points) > FEWEST_POINTS[feature.kind]:
            rows = plan.rows[feature.name]
            found[rows] = _deviations(feature, measured[rows])
    return found


def _deviations(feature: PartFeature, points: Floats) -> Floats:
    if feature.kind == "point":
        return np.asarray(np.einsum("ni,ni->n", points - points.mean(axis=0), feature.normals))
    if feature.kind == "line" and feature.nominal.direction is not None:
        along = np.asarray(feature.nominal.direction)
        out = feature.normals.mean(axis=0)
        out = out - (out @ along) * along
        out /= np.linalg.norm(out)
        flat = np.column_stack([points @ along, points @ out])
        flat -= flat.mean(axis=0)
        across = np.linalg.svd(flat, full_matrices=False)[2][1]
        return np.asarray(np.sign(across[1]) * (flat @ across))
    if feature.kind == "plane":
        return associate("plane", points, outward=feature.normals.mean(axis=0)).deviations
    sign = -1.0 if feature.internal else 1.0
    return np.asarray(sign * associate(feature.kind, points).deviations)
