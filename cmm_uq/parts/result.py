"""What is stated of a part's characteristics: values where points were measured, and uncertainty with or without them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cmm_uq.errors import CmmUqError
from cmm_uq.parts.evaluating import Evaluator
from cmm_uq.parts.plan import Plan
from cmm_uq.points import Floats
from cmm_uq.uncertainty.monte_carlo import Simulated


@dataclass(frozen=True)
class Stated:
    """One characteristic.

    Parameters
    ----------
    name : of it.
    value : mm or rad, less the mean error; ``None`` where nothing was measured.
    error : mean of the errors: by how much such a measurement is off on average, mm or rad.
    u : standard uncertainty, mm or rad.
    interval : shortest coverage interval of the value; of its error, with the opposite sign, where nothing was measured.
    k : half of the interval over u.
    """

    name: str
    value: float | None
    error: float
    u: float
    interval: tuple[float, float]
    k: float


def stated(simulated: Simulated, measured: Floats | None = None) -> tuple[Stated, ...]:
    """Every characteristic, of its errors in virtual measurements and its measured values (c,)."""
    found = []
    for i, name in enumerate(simulated.outputs):
        error, u = float(simulated.value[i]), float(simulated.u[i])
        low, high = simulated.interval[i].tolist()
        at = 0.0 if measured is None else float(measured[i])
        value = None if measured is None else at - error
        k = 0.5 * (high - low) / u if u else float("nan")
        found.append(Stated(name, value, error, u, (at - high, at - low), k))
    return tuple(found)


def evaluated(plan: Plan, points: Floats) -> Floats:
    """Characteristics (c,) of measured points (n, 3) in the frame of the part, mm, in the order of the plan's.

    Raises
    ------
    CmmUqError : points of another number, or so far from their nominal places that they are not those.
    """
    if points.shape != plan.points.shape:
        raise CmmUqError(f"{len(points)} points were measured, the plan has {len(plan.points)}", where="the recording",
                         fix="Measure each point of the plan once")  # fmt: skip
    return np.asarray(Evaluator(plan, points - plan.points, [])([], exact=True)[0])


def conforming(plan: Plan, errors: Floats, measured: Floats) -> tuple[Floats, float]:
    """Probabilities that the true values lie within the limits of the drawing.

    Parameters
    ----------
    errors : (N, c) of virtual measurements.
    measured : (c,) values.

    Returns
    -------
    each : (c,) of every characteristic; ``nan`` where it has no limits.
    together : of all that have some at once; ``nan`` where none has.
    """
    true = measured - errors
    inside = np.ones(true.shape, dtype=bool)
    limited = np.zeros(len(plan.characteristics), dtype=bool)
    for i, one in enumerate(plan.characteristics):
        low = -np.inf if one.lower is None else one.lower
        high = np.inf if one.upper is None else one.upper
        inside[:, i] = (low <= true[:, i]) & (true[:, i] <= high)
        limited[i] = np.isfinite(low) or np.isfinite(high)
    each = np.where(limited, inside.mean(axis=0), np.nan)
    return each, float(inside[:, limited].all(axis=1).mean()) if limited.any() else float("nan")
