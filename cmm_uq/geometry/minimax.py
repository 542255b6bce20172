"""The least of the largest of many smooth functions, with the contact points and multipliers that prove it.

Every zone and every inscribed, circumscribed or tangent feature of one measurement is such a problem: min over s of the
largest c_i(s). A descent by sequential quadratic programming comes near; Newton's method on the conditions of Karush, Kuhn and Tucker
then holds the contact points exactly: Σ λ_i ∇c_i = 0, Σ λ_i = 1, λ_i ≥ 0, and all other c_i below those of the
contacts.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from cmm_uq.points import Floats, Ints

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
    multipliers : (p,) positive, of sum 1.
    stationarity : length of Σ λ_i ∇c_i: zero but for rounding.
    proved : contacts, multipliers and, where the contacts alone do not hold the state, curvature prove a local minimum.
    """

    state: Floats
    value: float
    contacts: Ints
    multipliers: Floats
    stationarity: float
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
        found = Extremum(state, float(c.max()), np.array([int(c.argmax())]), np.ones(1), np.inf, False)
    return found


def _descended(rows: Rows, start: Floats) -> Floats:
    """Sequential quadratic programming on the rows that are largest, until none of the others comes out above them."""
    from scipy.optimize import minimize

    k, state = len(start), start
    rise = np.eye(k + 1)[k]
    c = rows(state)[0]
    working = np.argsort(c)[::-1][: WORKING * k]
    for _ in range(12):
        chosen = np.sort(working)

        def values(z: Floats, of: Ints = chosen) -> Floats:
            return np.asarray(z[-1] - rows(z[:-1])[0][of])

        def height(z: Floats) -> float:
            return float(z[-1])

        def derivatives(z: Floats, of: Ints = chosen) -> Floats:
            return np.column_stack([-rows(z[:-1])[1][of], np.ones(len(of))])

        found = minimize(
            height, np.append(state, rows(state)[0][chosen].max()), jac=lambda _: rise, method="SLSQP",
            constraints=[{"type": "ineq", "fun": values, "jac": derivatives}], options={"maxiter": 200, "ftol": 1e-14},
        )  # fmt: skip
        if not np.isfinite(found.x).all():
            return state
        state = np.asarray(found.x[:-1])
        c = rows(state)[0]
        above = np.flatnonzero(c > c[chosen].max() + 1e-12)
        if not len(above):
            break
        working = np.union1d(chosen, above[np.argsort(c[above])[::-1]][: WORKING * k])
    return state


def _polished(rows: Rows, start: Floats, exact: float) -> Extremum | None:
    """Newton's method on the contact points that multipliers of a coarser and a finer look suggest; the best of them."""
    best: Extremum | None = None
    for near in (max(1e-8, exact), 1e-6, 1e-4, 1e-2):
        found = _newton(rows, start, near, exact)
        if found is not None and (best is None or (found.proved, -found.value) > (best.proved, -best.value)):
            best = found
        if best is not None and best.proved:
            break
    return best


def _newton(rows: Rows, start: Floats, near: float, exact: float) -> Extremum | None:
    state, k = start, len(start)
    c, A = rows(state)
    contacts, multipliers = _multipliers(A, np.flatnonzero(c >= c.max() - near))
    last = np.inf
    for _ in range(20):
        p = len(contacts)
        H = _curvature(rows, state, contacts, multipliers)
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
    stationarity = float(np.linalg.norm(multipliers @ A[contacts]))
    met = (
        stationarity < 10 * exact
        and multipliers.min() >= -exact
        and np.ptp(c[contacts]) < exact
        and c.max() - c[contacts].max() < exact
    )
    proved = bool(met and _curved_up(_curvature(rows, state, contacts, multipliers), A[contacts]))
    return Extremum(state, float(c.max()), contacts, multipliers, stationarity, proved)


def _curved_up(H: Floats, A: Floats) -> bool:
    """Whether the Lagrangian curves upward in every direction in which no contact rises: the condition of second order."""
    _, s, Vt = np.linalg.svd(A)
    rank = int((s > 1e-9 * s[0]).sum())
    free = Vt[rank:]
    return not len(free) or bool(np.linalg.eigvalsh(free @ H @ free.T)[0] > -1e-7)


def _multipliers(A: Floats, near: Ints) -> tuple[Ints, Floats]:
    """Of the rows near the largest, those with positive multipliers that bring Σ λ ∇c nearest to zero."""
    from scipy.optimize import nnls

    wanted = np.zeros(A.shape[1] + 1)
    wanted[-1] = 1.0
    found = nnls(np.vstack([A[near].T, np.ones(len(near))]), wanted)[0]
    chosen = found > 1e-9
    return near[chosen], found[chosen] / found[chosen].sum()


def _curvature(rows: Rows, state: Floats, contacts: Ints, multipliers: Floats) -> Floats:
    """(k, k) second derivatives of the Lagrangian, by central differences of first ones: they only guide the steps."""
    k, h = len(state), 1e-4
    H = np.empty((k, k))
    for j, e in enumerate(h * np.eye(k)):
        up, down = rows(state + e)[1][contacts], rows(state - e)[1][contacts]
        H[j] = multipliers @ (up - down) / (2 * h)
    return np.asarray(0.5 * (H + H.T))
