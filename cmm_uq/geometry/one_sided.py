"""Inscribed and circumscribed features of many measurements at once: a dual simplex on linear distances, then Newton steps.

The smallest feature about all points, the largest within them, is held by one contact point more than it has places and
slopes. For so many rows whose multipliers are all positive the least of their largest is a lower bound; the point that lies
farthest outside replaces the one whose leaving keeps the multipliers positive, and the bound grows until none lies outside.
The first rows are artificial: far away, and left by all measurements whose points hold the feature. Linearised anew at what
was found this is Newton's method on the contact points, as for minimum zones (:mod:`cmm_uq.geometry.exchange`).
"""

from __future__ import annotations

import numpy as np

from cmm_uq.geometry.exchange import MOST_EXCHANGES, MOST_STEPS, ROUNDING, SETTLED
from cmm_uq.geometry.shapes import CIRCLE, SPHERE, Shape
from cmm_uq.points import Floats, Ints

_FAR = 1e3
"""Times the form: how far away artificial rows are."""


def held(shape: Shape, start: Floats, local: Floats, units: Floats, side: float) -> tuple[Floats, Ints]:
    """States (N, k) of the circumscribed (side 1) or inscribed (−1) features of points (d, N, n), and which did not settle.

    A draw does not settle where fewer contact points hold the feature by its curvature, as two opposite points hold a circle
    about them, or where points do not surround it.

    Parameters
    ----------
    start : (N, k) the least-squares features, whose size stands last.
    units : (k,) see :meth:`Placed.units`.
    """
    state, free = start.copy(), start.shape[1] - 1
    floor = ROUNDING * float(np.abs(local).max(initial=0.0))
    pending, stuck = np.arange(len(start)), np.zeros(len(start), dtype=np.bool_)
    for _ in range(MOST_STEPS):
        d, J = shape.distances(state[pending], local[:, pending])
        A = np.ascontiguousarray((side * J[:free] / units[:free, None, None]).transpose(1, 2, 0))
        try:
            step, largest = _exchanged(A, side * d, floor)
        except np.linalg.LinAlgError:  # contact points of one draw that determine nothing
            break
        state[pending, :free] += step / units[:free]
        state[pending, free] += side * largest
        stuck[pending] = ~np.isfinite(largest)
        moved = np.maximum(np.abs(step).max(axis=1), np.abs(largest))
        pending = pending[(moved > SETTLED) & ~stuck[pending]]
        if not len(pending):
            break
    stuck[pending] = True
    if shape in (CIRCLE, SPHERE) and side > 0:
        stuck[_about_two(state, local, np.flatnonzero(stuck), floor)] = False
    return state, np.flatnonzero(stuck)


def _about_two(state: Floats, local: Floats, draws: Ints, floor: float) -> Ints:
    """Those of the draws whose points the circle or sphere about the farthest two of them holds; ``state`` becomes that."""
    if not len(draws):
        return draws
    points = local[:, draws].transpose(1, 2, 0)
    n = points.shape[1]
    far = np.array([np.argmax(np.sum((each[:, None] - each) ** 2, axis=2)) for each in points])
    ends = np.stack([points[np.arange(len(draws)), far // n], points[np.arange(len(draws)), far % n]])
    centre, radius = ends.mean(axis=0), 0.5 * np.linalg.norm(ends[0] - ends[1], axis=1)
    holds = np.linalg.norm(points - centre[:, None], axis=2).max(axis=1) <= radius + floor
    state[draws[holds]] = np.column_stack([centre, radius])[holds]
    return np.asarray(draws[holds])


def _exchanged(A: Floats, b: Floats, floor: float) -> tuple[Floats, Floats]:
    """X (N, k) and t (N,) with the least t ≥ b + A·x for all rows; ``nan`` where nothing holds them."""
    N, n, k = A.shape
    far = -_FAR * max(float(np.ptp(b, axis=1).max(initial=0.0)), np.finfo(np.float64).tiny)
    artificial = np.broadcast_to(np.vstack([np.eye(k), -np.ones(k)]), (N, k + 1, k))
    rows, values = np.concatenate([A, artificial], axis=1), np.concatenate([b, np.full((N, k + 1), far)], axis=1)
    index = np.tile(np.arange(n, n + k + 1), (N, 1))
    x, t, live = np.zeros((N, k)), np.full(N, np.nan), np.arange(N)
    for _ in range(MOST_EXCHANGES):
        contacts = index[live]
        own = np.take_along_axis(rows[live], contacts[:, :, None], axis=1)
        inverse = np.linalg.inv(np.concatenate([own, np.full((len(live), k + 1, 1), -1.0)], axis=2))
        found = -np.einsum("bij,bj->bi", inverse, np.take_along_axis(values[live], contacts, axis=1))
        outside = b[live] + np.einsum("bnk,bk->bn", A[live], found[:, :-1])
        entering = outside.argmax(axis=1)
        left = outside[np.arange(len(live)), entering] > found[:, -1] + floor
        done = ~left & (contacts < n).all(axis=1)
        x[live[done]], t[live[done]] = found[done, :-1], found[done, -1]
        live, entering, inverse = live[left], entering[left], inverse[left]
        if not len(live):
            break
        row = np.append(A[live, entering], np.full((len(live), 1), -1.0), axis=1)
        weight = np.einsum("bi,bij->bj", row, inverse)
        multipliers = np.maximum(-inverse[:, -1, :], 0.0)
        eligible = weight > 1e-12 * np.abs(weight).max(axis=1, keepdims=True)
        ratio = np.where(eligible, multipliers / np.where(eligible, weight, 1.0), np.inf)
        index[live, ratio.argmin(axis=1)] = entering
    return x, t
