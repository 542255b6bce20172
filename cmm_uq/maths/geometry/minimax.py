"""The least of the largest of many smooth functions, with the contact points and multipliers that prove it.

Every zone and every inscribed, circumscribed or tangent feature of one measurement is such a problem: the state s with the
least of the largest c_i(s). A descent by sequential quadratic programming comes near; Newton's method on the conditions of
Karush, Kuhn and Tucker then holds the contact points exactly: Σ λ_i ∇c_i = 0, Σ λ_i = 1, λ_i ≥ 0, and all other c_i below
those of the contacts.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from cmm_uq.base.points import Floats, Ints

Rows = Callable[[Floats], tuple[Floats, Floats]]
"""From a state (k,): values (m,) and derivatives (m, k), in units in which states and values are about one."""

EXACT = 1e-11
"""Of values, stationarity and step: where the conditions are met, unless the rounding of the coordinates is coarser."""

WORKING = 16
"""Rows a parameter that the descent looks at together; others join when they come out above."""


@dataclass(frozen=True, eq=False)
class Extremum:
    """A state with its proof.

    Parameters
    ----------
    state : (k,).
    value : the largest c_i.
    contacts : (p,) rows that hold it.
    multipliers : (p,) of sum 1, none negative but for rounding.
    proved : contacts, multipliers and, where the contacts alone do not hold the state, curvature prove a local minimum.
    """

    state: Floats
    value: float
    contacts: Ints
    multipliers: Floats
    proved: bool


def least_largest(rows: Rows, start: Floats, rounding: float = 0.0) -> Extremum:
    """The local minimum of the largest row below a start (k,), and whether it is proved.

    Parameters
    ----------
    rounding : of the values, in their own unit.
    """
    exact = max(EXACT, 100 * rounding)
    state = start
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

    def uphill(z: Floats) -> Floats:
        return np.asarray(np.eye(len(z))[-1])

    def below(z: Floats) -> Floats:
        return np.asarray(z[-1] - rows(z[:-1])[0][of])

    def slopes(z: Floats) -> Floats:
        return np.column_stack([-rows(z[:-1])[1][of], np.ones(len(of))])

    bounded: Any = {"type": "ineq", "fun": below, "jac": slopes}
    first = np.append(start, rows(start)[0][of].max())
    options: Any = {"maxiter": 200, "ftol": 1e-14}
    found = minimize(height, first, jac=uphill, method="SLSQP", constraints=bounded, options=options)
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
        residual = np.concatenate(
            [multipliers @ A[contacts], c[contacts] - c[contacts].mean(), [multipliers.sum() - 1]]
        )
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
    return _judged(rows, state, contacts, multipliers, exact)


def _judged(rows: Rows, state: Floats, contacts: Ints, multipliers: Floats, exact: float) -> Extremum:
    c, A = rows(state)
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
