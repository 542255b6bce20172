"""The least of the largest of many smooth functions: zones, inscribed, circumscribed and tangent features, of one or many.

Every zone and every inscribed, circumscribed or tangent feature of one measurement is such a problem: the state s with the
least of the largest c_i(s). A descent by sequential quadratic programming comes near; Newton's method on the conditions of
Karush, Kuhn and Tucker then holds the contact points exactly: Σ λ_i ∇c_i = 0, Σ λ_i = 1, λ_i ≥ 0, and all other c_i below
those of the contacts.

Of many measurements at once, a zone of k parameters is held by k + 1 contact points. For any k + 1 points there is one set
of signs and multipliers with which they prove a lower bound of the half width; the point that lies farthest outside replaces
the one whose leaving keeps all multipliers positive, and the bound grows. Where none lies outside, the bound is the half
width: the multipliers are the proof that no neighbouring zone is narrower (E. Stiefel, Numer. Math. 1 (1959) 1; G. A. Watson,
*Approximation Theory and Numerical Methods*, 1980). Linearised anew at what was found, this is Newton's method on contacts.

The smallest feature about all points, the largest within them, is the least of the largest distance over its places and
slopes. About any place the distances are nearly linear, and within a box about it the least is found by a dual simplex of the
same exchanges. Where the points themselves hold the feature the box is of no matter and each step is Newton's; where curvature
holds it, as two opposite points hold a circle about them, the box shrinks until nothing is left to be gained (R. Fletcher,
*Practical Methods of Optimization*, 2nd ed. 1987, chapter 14).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from cmm_uq.base.points import Floats, Ints
from cmm_uq.base.values import dataclass

if TYPE_CHECKING:
    from cmm_uq.maths.geometry.placed import FeatureShape

# from a state (k,): values (m,) and derivatives (m, k), in units in which states and values are about one
Rows = Callable[[Floats], tuple[Floats, Floats]]
EXACT = 1e-11  # of values, stationarity and step, unless the rounding of the coordinates is coarser
WORKING = 16  # rows a parameter that the descent looks at together; others join when they come out above


@dataclass(frozen=True, eq=False)
class Extremum:
    state: Floats  # (k,)
    value: float  # the largest c_i
    contacts: Ints  # (p,) rows that hold it
    multipliers: Floats  # (p,) of sum 1, none negative but for rounding
    proved: bool  # by contacts, multipliers and, where the contacts alone do not hold the state, curvature


def least_largest(rows: Rows, start: Floats, rounding: float = 0.0) -> Extremum:
    """The local minimum of the largest row below a start (k,), and whether it is proved."""
    exact, state = max(EXACT, 100 * rounding), start
    found = _polished(rows, state, exact)
    for _ in range(4):
        if found is not None and found.proved:
            break
        state = _descended(rows, state)
        polished = _polished(rows, state, exact)
        if polished is not None and (found is None or polished.proved or polished.value < found.value):
            found = polished
    if found is None:
        c = rows(state)[0]
        found = Extremum(state, float(c.max()), np.array([int(c.argmax())]), np.ones(1), False)
    return found


def _descended(rows: Rows, start: Floats) -> Floats:
    """Descend on the rows that are largest, until none of the others comes out above them."""
    k, state = len(start), start
    c = rows(state)[0]
    working = np.argsort(c)[::-1][: WORKING * k]
    for _ in range(12):
        state = _programmed(rows, state, working)
        c = rows(state)[0]
        above = np.flatnonzero(c > c[working].max() + 1e-12)
        if not len(above):
            break
        working = np.union1d(working, above[np.argsort(c[above])[::-1]][: WORKING * k])
    return state


def _programmed(rows: Rows, start: Floats, of: Ints) -> Floats:
    """Sequential quadratic programming (SLSQP) in the state and a bound z above some of the rows: the least z."""
    from scipy.optimize import minimize

    def height(z: Floats) -> float:
        return float(z[-1])

    first, uphill = np.append(start, rows(start)[0][of].max()), np.eye(len(start) + 1)[-1]
    above: Any = {
        "type": "ineq",
        "fun": lambda z: z[-1] - rows(z[:-1])[0][of],
        "jac": lambda z: np.column_stack([-rows(z[:-1])[1][of], np.ones(len(of))]),
    }
    settings: Any = {"jac": lambda _: uphill, "constraints": above, "options": {"maxiter": 200, "ftol": 1e-14}}
    found = minimize(height, first, method="SLSQP", **settings)
    return np.asarray(found.x[:-1]) if np.isfinite(found.x).all() else start


def _polished(rows: Rows, start: Floats, exact: float) -> Extremum | None:
    """Newton's method on the contacts that a finer or a coarser look suggests: the first that is proved, or the best."""
    best: Extremum | None = None
    for near in (max(1e-8, exact), 1e-6, 1e-4, 1e-2):
        for redundant in (False, True):
            found = _newton(rows, start, near, exact, redundant)
            if found is not None and (best is None or (found.proved, -found.value) > (best.proved, -best.value)):
                best = found
            if best is not None and best.proved:
                return best
    return best


def _newton(rows: Rows, start: Floats, near: float, exact: float, redundant: bool) -> Extremum | None:
    """From a start, with the rows within ``near`` of the largest that multipliers need, or with all of these rows."""
    state, k = start, len(start)
    c, A = rows(state)
    contacts = np.flatnonzero(c >= c.max() - near)
    multipliers = _multipliers(A[contacts])
    if not redundant:
        needed = multipliers > 1e-9
        contacts, multipliers = contacts[needed], multipliers[needed]
    last, p = np.inf, len(contacts)
    # steps are small against the feature, so that the curvature does not change on the way
    H = _curvature(rows, state, contacts, multipliers)
    for _ in range(20):
        off = c[contacts] - c[contacts].mean()
        residual = np.concatenate([multipliers @ A[contacts], off, [multipliers.sum() - 1]])
        system = np.zeros((k + p + 1, k + p + 1))
        system[:k, :k], system[:k, k + 1 :] = H, A[contacts].T
        system[k : k + p, :k], system[k : k + p, k] = A[contacts], -1.0
        system[-1, k + 1 :] = 1.0
        step = np.linalg.lstsq(system, -residual, rcond=1e-13)[0]
        if not np.isfinite(step).all() or np.abs(step[:k]).max() > 10:
            return None
        state, multipliers = state + step[:k], multipliers + step[k + 1 :]
        c, A = rows(state)
        size = float(np.abs(step[:k]).max())
        # steps at the level of rounding no longer shrink
        if size <= exact and size > 0.1 * last:
            break
        last = size
    met = (
        np.linalg.norm(multipliers @ A[contacts]) < 10 * exact
        and multipliers.min() >= -exact
        and np.ptp(c[contacts]) < exact
        and c.max() - c[contacts].max() < exact
    )
    if met and len(contacts) > A.shape[1] + 1:
        multipliers = _spread(A[contacts], multipliers)
    proved = bool(met and _curved_up(_curvature(rows, state, contacts, multipliers), A[contacts[multipliers > 1e-9]]))
    return Extremum(state, float(c.max()), contacts, multipliers, proved)


def _curved_up(H: Floats, A: Floats) -> bool:
    """Whether the Lagrangian curves upward in every direction in which no contact rises: the condition of second order."""
    _, s, Vt = np.linalg.svd(A)
    rank = int((s > 1e-9 * s[0]).sum())
    free = Vt[rank:]
    return not len(free) or bool(np.linalg.eigvalsh(free @ H @ free.T)[0] > -1e-7)


def _multipliers(A: Floats) -> Floats:
    """(p,) not negative, of sum 1, that bring Σ λ ∇c nearest to zero: few of them positive."""
    from scipy.optimize import nnls

    wanted = np.zeros(A.shape[1] + 1)
    wanted[-1] = 1.0
    found = nnls(np.vstack([A.T, np.ones(len(A))]), wanted)[0]
    return np.asarray(found / found.sum())


def _spread(A: Floats, multipliers: Floats) -> Floats:
    """Of more contacts than hold the state, multipliers whose smallest is the largest: all that can hold it do."""
    from scipy.optimize import linprog

    p, k = A.shape
    stationary = np.column_stack([np.vstack([A.T, np.ones(p)]), np.zeros(k + 1)])
    above = np.column_stack([-np.eye(p), np.ones(p)])
    found = linprog(-np.eye(p + 1)[-1], above, np.zeros(p), stationary, np.eye(k + 1)[-1], method="highs")
    return multipliers if found.x is None or found.x[-1] <= 0 else np.asarray(found.x[:-1])


def _curvature(rows: Rows, state: Floats, contacts: Ints, multipliers: Floats) -> Floats:
    """(k, k) second derivatives of the Lagrangian, by central differences of first ones: they only guide the steps."""
    k, h = len(state), 1e-4
    H = np.empty((k, k))
    for j, e in enumerate(h * np.eye(k)):
        up, down = rows(state + e)[1][contacts], rows(state - e)[1][contacts]
        H[j] = multipliers @ (up - down) / (2 * h)
    return np.asarray(0.5 * (H + H.T))


# steps, mm, below which a zone is where its contact points hold it; Newton's steps before it were their square root
SETTLED = 1e-11
MOST_EXCHANGES = 200
MOST_STEPS = 12
SCREENED = 1000  # points from which on only those that stand out in their neighbourhood are looked at together
RUNS = 64  # parts of these, one after the other, whose highest and lowest points are looked at
MOST_ROUNDS = 40
ROUNDING = 1e-13  # share of the coordinates by which a point may lie outside by rounding


def least_zones(shape: FeatureShape, start: Floats, local: Floats, units: Floats) -> tuple[Floats, Floats, Ints]:
    """States (N, k) and widths (N,) of the minimum zones of points (d, N, n), and the draws that did not settle.

    A draw does not settle where fewer contact points than k + 1 hold the zone by its curvature. Of many points exchanges are
    among those that stand out, which all others then join that lie outside: the highest and the lowest of all are among them.
    Where these no longer move the zone, no point lies outside, and the proof is that of all points.

    ``start``: (N, k) the least-squares features. ``units``: (k,) see :meth:`Placed.units`.
    """
    k, N, many = start.shape[1], local.shape[1], local.shape[2] >= SCREENED
    state, width = start.copy(), np.empty(N)
    floor = ROUNDING * float(np.abs(local).max())
    pending, stuck = np.arange(N), np.zeros(N, dtype=np.bool_)
    held = np.zeros((N, 0), dtype=np.int64)
    for _ in range(MOST_ROUNDS if many else MOST_STEPS):
        seen = local if many and len(pending) == N else local[:, pending]
        if many:
            d = shape.distances(state[pending], seen)[0]
            if not held.shape[1]:
                J = shape.distances(state[:1], local[:, :1])[1]
                held = np.tile(_independent((J[:, 0] / units[:, None]).T), (N, 1))
            index = np.concatenate([_standing_out(d), held], axis=1)
            seen = np.take_along_axis(seen, index[None], axis=2)
            contacts = np.tile(np.arange(index.shape[1] - k - 1, index.shape[1]), (len(pending), 1))
        d, J = shape.distances(state[pending], seen)
        A = np.ascontiguousarray((J / units[:, None, None]).transpose(1, 2, 0))
        try:
            if many or not held.shape[1]:
                held = contacts if many else np.tile(_independent(A[0]), (N, 1))
                sides = _sides(A, held)
            step, half = _exchange(A, d, held, sides, floor)
        except np.linalg.LinAlgError:  # contact points of one draw that determine nothing
            break
        state[pending] += step / units
        width[pending] = 2 * half
        stuck[pending] = ~np.isfinite(half)
        left = (np.abs(step).max(axis=1) > SETTLED) & ~stuck[pending]
        held, sides = (np.take_along_axis(index, held, axis=1) if many else held)[left], sides[left]
        pending = pending[left]
        if not len(pending):
            break
    stuck[pending] = True
    return state, width, np.flatnonzero(stuck)


def _standing_out(d: Floats) -> Ints:
    """(N, 2c) the highest and the lowest point of each run of neighbours, in the order in which they were probed."""
    N, n = d.shape
    length = n // RUNS
    whole = d[:, : RUNS * length].reshape(N, RUNS, length)
    first = length * np.arange(RUNS)
    found = [first + whole.argmax(axis=2), first + whole.argmin(axis=2)]
    if rest := n - RUNS * length:
        last = d[:, -rest:]
        found += [n - rest + last.argmax(axis=1)[:, None], n - rest + last.argmin(axis=1)[:, None]]
    return np.concatenate(found, axis=1)


def _independent(A: Floats) -> Ints:
    """K + 1 of the rows (n, k), as independent as they allow."""
    from scipy.linalg import qr

    return np.asarray(qr(A.T, pivoting=True, mode="r")[1][: A.shape[1] + 1], dtype=np.int64)


def _sides(A: Floats, index: Ints) -> Floats:
    """Signs (N, k + 1) with which the multipliers of these points are positive."""
    rows = np.take_along_axis(A, index[:, :, None], axis=1)
    others = np.linalg.solve(rows[:, :-1].transpose(0, 2, 1), -rows[:, -1, :, None])[:, :, 0]
    multipliers = np.append(others, np.ones((len(A), 1)), axis=1)
    return np.where(multipliers < 0, -1.0, 1.0)


def _exchange(A: Floats, b: Floats, contacts: Ints, sides: Floats, floor: float) -> tuple[Floats, Floats]:
    """Exchange until no point lies outside; contact points and on which side each lies, ±1, become those of the answer.

    Returns x (N, k) and t (N,) with the least t ≥ |b + A·x| for all points; t is ``nan`` where exchanges find no end.
    """
    N, _, k = A.shape
    x, t = np.zeros((N, k)), np.empty(N)
    live = np.arange(N)
    for _ in range(MOST_EXCHANGES):
        index, sign = contacts[live], sides[live]
        M = np.concatenate([np.take_along_axis(A[live], index[:, :, None], axis=1), -sign[:, :, None]], axis=2)
        inverse = np.linalg.inv(M)
        # y·rows = 0 and y·signs = 1: with new derivatives the signs may have to follow y, and with y those of the width
        y = -inverse[:, -1, :]
        turned = np.flatnonzero((y * sign < 0).any(axis=1))
        if len(turned):
            sign[turned] = np.where(y[turned] < 0, -1.0, 1.0)
            M[turned, :, -1] = -sign[turned]
            inverse[turned] = np.linalg.inv(M[turned])
            y = -inverse[:, -1, :]
        found = -np.einsum("bij,bj->bi", inverse, np.take_along_axis(b[live], index, axis=1))
        negative = found[:, -1] < 0
        sign[negative], y[negative], found[negative, -1] = -sign[negative], -y[negative], -found[negative, -1]
        inverse[negative, -1] *= -1
        sides[live] = sign
        x[live], t[live] = found[:, :-1], found[:, -1]
        outside = b[live] + np.einsum("bnk,bk->bn", A[live], found[:, :-1])
        entering = np.abs(outside).argmax(axis=1)
        value = outside[np.arange(len(live)), entering]
        left = np.abs(value) > found[:, -1] + floor
        if not left.any():
            return x, t
        live, entering, side, sign = live[left], entering[left], np.sign(value[left]), sign[left]
        row = np.append(A[live, entering], -side[:, None], axis=1)
        weight = np.einsum("bi,bij->bj", row, inverse[left]) * sign * side[:, None]
        leaving = _leaving(weight, np.maximum(y[left] * sign, 0))
        contacts[live, leaving], sides[live, leaving] = entering, side
    t[live] = np.nan
    return x, t


def _leaving(weight: Floats, multipliers: Floats) -> Ints:
    """Of contact points (N, k + 1) the one whose leaving keeps the other multipliers positive, (N,)."""
    eligible = weight > 1e-12 * np.abs(weight).max(axis=1, keepdims=True)
    return np.asarray(np.where(eligible, multipliers / np.where(eligible, weight, 1.0), np.inf).argmin(axis=1))


# mm: what may be left to be gained in a step; and after the most of them, where they wind along a curved valley
GAINED, ENOUGH, MOST_BOXES = 1e-10, 1e-7, 50
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
    for _ in range(MOST_BOXES):
        A = np.ascontiguousarray((side * J[:free] / units[:free, None, None]).transpose(1, 2, 0))
        try:
            step, least = _boxed(A, side * d, box[pending], floor)
        except np.linalg.LinAlgError:  # contact points of one draw that determine nothing
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
        left = foretold > GAINED
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
        index[live, _leaving(weight, np.maximum(-inverse[:, -1, :], 0.0))] = entering
    return found[:, :-1], found[:, -1]
