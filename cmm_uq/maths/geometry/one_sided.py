"""Inscribed and circumscribed features of many measurements at once: linearised distances in a trust region.

The smallest feature about all points, the largest within them, is the least of the largest distance over its places and
slopes. About any place the distances are nearly linear, and within a box about it the least is found by a dual simplex:
contact rows whose multipliers are all positive give a lower bound, and the row that lies farthest outside replaces the one
whose leaving keeps them so. Where the points themselves hold the feature the box is of no matter and each step is Newton's;
where curvature holds it, as two opposite points hold a circle about them, the box shrinks until nothing is left to be gained
(R. Fletcher, *Practical Methods of Optimization*, 2nd ed. 1987, chapter 14).
"""

from __future__ import annotations

import numpy as np

from cmm_uq.base.points import Floats, Ints
from cmm_uq.maths.geometry.exchange import MOST_EXCHANGES, ROUNDING
from cmm_uq.maths.geometry.minimax import FeatureShape

# mm: what may be left to be gained in a step; and after the most of them, where they wind along a curved valley
SETTLED, ENOUGH, MOST_STEPS = 1e-10, 1e-7, 50
_WIDE = 10.0  # times the form: the half width of the first box
# parts of the gain foretold below which the box shrinks and above which it grows, and by how much
_POOR, _GOOD, _WIDER, _NARROWER = 0.25, 0.75, 2.0, 0.25


def held(shape: FeatureShape, start: Floats, local: Floats, units: Floats, side: float) -> tuple[Floats, Ints]:
    """States (N, k) of the circumscribed (side 1) or inscribed (−1) features of points (d, N, n), and which did not settle.

    Of several features that points hold it is the one that is reached from the start, as it is of one measurement alone.

    ``start``: (N, k) the least-squares features, whose size stands last. ``units``: (k,) see :meth:`Placed.units`.
    """
    state, free = start.copy(), start.shape[1] - 1
    floor = ROUNDING * float(np.abs(local).max(initial=0.0))
    d, J = shape.distances(state, local)
    box, largest = _WIDE * np.ptp(d, axis=1), (side * d).max(axis=1)
    pending, lost = np.arange(len(start)), np.ones(len(start), dtype=np.bool_)
    for _ in range(MOST_STEPS):
        A = np.ascontiguousarray((side * J[:free] / units[:free, None, None]).transpose(1, 2, 0))
        try:
            step, least = _boxed(A, side * d, box[pending], floor)
        except np.linalg.LinAlgError:  # contact rows of one draw that determine nothing
            break
        trial = state[pending]
        trial[:, :free] += step / units[:free]
        there, derivative = shape.distances(trial, local[:, pending])
        foretold, gained = largest[pending] - least, largest[pending] - (side * there).max(axis=1)
        reach = np.abs(step).max(axis=1)
        box[pending] = np.where(gained > _GOOD * foretold, np.maximum(box[pending], _WIDER * reach), box[pending])
        box[pending] = np.where(gained < _POOR * foretold, _NARROWER * reach, box[pending])
        better = gained > 0
        state[pending[better]] = trial[better]
        largest[pending] -= np.where(better, gained, 0.0)
        d, J = np.where(better[:, None], there, d), np.where(better[:, None], derivative, J)
        lost[pending] = ~(foretold <= ENOUGH)
        left = foretold > SETTLED
        pending, d, J = pending[left], d[left], J[:, left]
        if not len(pending):
            break
    else:
        pending = pending[:0]
    lost[pending] = True
    state[:, free] += side * largest
    return state, np.flatnonzero(lost)


def _boxed(A: Floats, b: Floats, box: Floats, floor: float) -> tuple[Floats, Floats]:
    """Steps x (N, k) within a box and the least t (N,) ≥ b + A·x for all rows (N, n); ``nan`` where exchanges find no end."""
    N, n, k = A.shape
    walls = np.broadcast_to(np.vstack([np.eye(k), -np.eye(k)]), (N, 2 * k, k))
    tops = np.concatenate([np.full((N, n, 1), -1.0), np.zeros((N, 2 * k, 1))], axis=1)
    rows = np.concatenate([np.concatenate([A, walls], axis=1), tops], axis=2)
    values = np.concatenate([b, np.repeat(-box[:, None], 2 * k, axis=1)], axis=1)
    first = b.argmax(axis=1)
    against = np.where(A[np.arange(N), first] > 0, k, 0) + np.arange(k)
    index = np.column_stack([first, n + against])
    found, live = np.full((N, k + 1), np.nan), np.arange(N)
    for _ in range(MOST_EXCHANGES):
        contacts = index[live]
        inverse = np.linalg.inv(np.take_along_axis(rows[live], contacts[:, :, None], axis=1))
        at = -np.einsum("bij,bj->bi", inverse, np.take_along_axis(values[live], contacts, axis=1))
        outside = values[live] + np.einsum("bnk,bk->bn", rows[live], at)
        entering = outside.argmax(axis=1)
        left = outside[np.arange(len(live)), entering] > floor
        found[live[~left]] = at[~left]
        live, entering, inverse = live[left], entering[left], inverse[left]
        if not len(live):
            break
        weight = np.einsum("bi,bij->bj", rows[live, entering], inverse)
        multipliers = np.maximum(-inverse[:, -1, :], 0.0)
        eligible = weight > 1e-12 * np.abs(weight).max(axis=1, keepdims=True)
        ratio = np.where(eligible, multipliers / np.where(eligible, weight, 1.0), np.inf)
        index[live, ratio.argmin(axis=1)] = entering
    return found[:, :-1], found[:, -1]
