"""What is stated of a part's characteristics: values where points were measured, and uncertainty with or without them.

The width of a zone is never negative. Where draws of its true value are, they are impossible, and what is stated comes of
the others: a value that is known to be at least zero, and nothing else (JCGM 106:2012, 7.2.2, with a prior that is flat
above zero).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cmm_uq.errors import CmmUqError
from cmm_uq.parts.evaluating import characteristics_of
from cmm_uq.parts.plan import ZONES, Plan
from cmm_uq.points import Floats
from cmm_uq.uncertainty.coverage_intervals import Tails
from cmm_uq.uncertainty.monte_carlo import Simulated

FEWEST = 500
"""Draws that are possible, from which on an interval or a probability is taken from them alone."""

_AT_ZERO = 0.05
"""Of the draws outside of an interval: fewer than so many below it are none, and it begins at zero."""


@dataclass(frozen=True)
class Stated:
    """One characteristic.

    Parameters
    ----------
    name : of it.
    value : mm or rad, less the mean error, of a zone zero at least; ``None`` where nothing was measured.
    error : mean of the errors: by how much such a measurement is off on average, mm or rad.
    u : standard uncertainty, mm or rad.
    interval : shortest coverage interval of the value; of its error, with the opposite sign, where nothing was measured.
    k : half of the shortest interval of the errors over u.
    """

    name: str
    value: float | None
    error: float
    u: float
    interval: tuple[float, float]
    k: float

    @property
    def U(self) -> float:  # noqa: N802
        """Half of the shortest interval of the errors, mm or rad: of a zone near zero more than half of its own interval."""
        return self.k * self.u if self.u else 0.5 * (self.interval[1] - self.interval[0])


def stated(
    simulated: Simulated, measured: Floats | None = None, plan: Plan | None = None, errors: Floats | None = None
) -> tuple[Stated, ...]:
    """Every characteristic, of its errors in virtual measurements and its measured values (c,).

    Parameters
    ----------
    plan, errors : characteristics, and draws (N, c) of their errors, by which intervals of zones are those of what is
        possible; without them an interval is that of the errors alone.
    """
    found = []
    zones = np.zeros(len(simulated.outputs), dtype=bool) if plan is None else zones_of(plan)
    for i, name in enumerate(simulated.outputs):
        error, u = float(simulated.value[i]), float(simulated.u[i])
        low, high = simulated.interval[i].tolist()
        at = 0.0 if measured is None else float(measured[i])
        value = None if measured is None else at - error
        interval = at - high, at - low
        if value is not None and zones[i]:
            value = max(0.0, value)
            if errors is not None:
                interval = _possible(at - errors[:, i], interval, simulated.coverage)
        k = 0.5 * (high - low) / u if u else float("nan")
        found.append(Stated(name, value, error, u, interval, k))
    return tuple(found)


def zones_of(plan: Plan) -> NDArray[np.bool_]:
    """(c,) whether each characteristic is the width of a zone."""
    return np.array([one.what in ZONES for one in plan.characteristics], dtype=bool)


def _possible(true: Floats, interval: tuple[float, float], coverage: float) -> tuple[float, float]:
    """The shortest interval of the draws that are not negative; of few, from zero to the width that it has with all.

    The density of errors falls the faster the farther out, so that what is left beyond zero is no wider than all of it.
    """
    left = np.sort(true[true >= 0])
    if len(left) == len(true):
        return interval
    if len(left) < FEWEST:
        return 0.0, interval[1] - interval[0]
    tails = Tails(coverage)
    tails.add(left)
    low, high = tails.intervals()[:2].tolist()
    below = np.searchsorted(left, low)
    return 0.0 if below < _AT_ZERO * (1 - coverage) * len(left) else low, high


def evaluated(plan: Plan, points: Floats) -> Floats:
    """Characteristics (c,) of measured points (n, 3) in the frame of the part, mm, in the order of the plan's.

    Raises
    ------
    CmmUqError : points of another number, or so far from their nominal places that they are not those.
    """
    if points.shape != plan.points.shape:
        raise CmmUqError(f"{len(points)} points were measured, the plan has {len(plan.points)}", where="the recording",
                         fix="Measure each point of the plan once")  # fmt: skip
    return characteristics_of(plan, points)


def conforming(plan: Plan, errors: Floats, measured: Floats) -> tuple[Floats, float]:
    """Probabilities that the true values lie within the limits of the drawing, given that no zone is negative.

    Parameters
    ----------
    errors : (N, c) of virtual measurements.
    measured : (c,) values.

    Returns
    -------
    each : (c,) of every characteristic; ``nan`` where it has no limits.
    together : of all that have some at once; ``nan`` where none has.
    """
    true, zones = measured - errors, zones_of(plan)
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
    all_inside, all_possible = (np.asarray(of[:, limited].all(axis=1)) for of in (inside, possible))
    return each, _share(all_inside, all_possible)


def _share(inside: NDArray[np.bool_], possible: NDArray[np.bool_]) -> float:
    """Of the draws that are possible; of all, where these are few."""
    return float(np.mean(inside[possible] if np.count_nonzero(possible) >= FEWEST else inside))
