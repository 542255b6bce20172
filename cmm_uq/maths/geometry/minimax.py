"""The least of the largest of many smooth functions; distances of points from a feature with their derivatives.

Every zone and every inscribed, circumscribed or tangent feature of one measurement is such a problem: the state s with the
least of the largest c_i(s). A descent by sequential quadratic programming comes near; Newton's method on the conditions of
Karush, Kuhn and Tucker then holds the contact points exactly: Σ λ_i ∇c_i = 0, Σ λ_i = 1, λ_i ≥ 0, and all other c_i below
those of the contacts.

A feature stands near the origin of its own frame, its axis or normal along z. Its state says how far it has moved from
there: shifts across the axis, slopes of the axis, then sizes. Distances and derivatives are exact at any state, so that
least squares and minimum zones, of one measurement or of a million, share them. For round features they follow
Shakarji, J. Res. NIST 103 (1998) 633.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from cmm_uq.base.points import Floats, Ints

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


Distances = Callable[[Floats, Floats], tuple[Floats, Floats]]


@dataclass(frozen=True)
class FeatureShape:
    """A kind of feature in its own frame."""

    name: str  # as messages call it
    least: int  # points that determine it
    slopes: tuple[
        int, ...
    ]  # places in the state of slopes of axis or normal, which belong to a length; the others are mm
    size: int | None  # place of the radius (of a cone the distance of its surface), None where there is no size
    distances: Distances  # of a state (N, k) and local points (d, N, n): distances (N, n) and derivatives (k, N, n)

    def normal_matrix(self, state: Floats, local: Floats) -> Floats:
        """(k, k) of the least-squares problem at the nominal state (k,) of points (d, n)."""
        J = self.distances(state[None], local[:, None])[1][:, 0]
        return np.asarray(J @ J.T)


class _LineInSpace(FeatureShape):
    def normal_matrix(self, state: Floats, local: Floats) -> Floats:
        """Of both components across the line: on the line itself the distance has no derivative, its square has."""
        one = np.array([np.ones(local.shape[1]), local[2]])
        return np.asarray(np.kron(one @ one.T, np.eye(2)))


def _column(state: Floats, i: int) -> Floats:
    return np.asarray(state[:, i, None])


def _flat(across: int) -> Distances:
    """Line in a plane (``across`` = 1) or plane (2): (z − c − a·x …)/√(1 + a² + …)."""

    def distances(state: Floats, local: Floats) -> tuple[Floats, Floats]:
        slopes = [_column(state, 1 + j) for j in range(across)]
        over = 1 + sum((a * a for a in slopes), start=np.zeros((len(state), 1)))
        root = 1 / np.sqrt(over)
        d = local[across] - _column(state, 0)
        for j, a in enumerate(slopes):
            d -= a * local[j]
        d *= root
        J = np.empty((1 + across, *d.shape))
        J[0] = -root
        for j, a in enumerate(slopes):
            np.multiply(local[j], -root, out=J[1 + j])
            J[1 + j] -= d * (a / over)
        return d, J

    return distances


def _ball(state: Floats, local: Floats) -> tuple[Floats, Floats]:
    """Circle in a plane, sphere: |p − c| − r."""
    dimension = len(local)
    J = np.empty((dimension + 1, *local.shape[1:]))
    for j in range(dimension):
        np.subtract(_column(state, j), local[j], out=J[j])
    d = np.sqrt(np.einsum("jbn,jbn->bn", J[:-1], J[:-1]))
    J[:-1] /= np.maximum(d, np.finfo(np.float64).tiny)
    J[-1] = -1.0
    d -= _column(state, dimension)
    return d, J


def _from_axis(state: Floats, local: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """Distance f from the axis through (cx, cy, 0) with slopes (a, b), height g along it, derivatives (4, N, n) of f, of g."""
    a, b = _column(state, 2), _column(state, 3)
    root = 1 / np.sqrt(1 + a * a + b * b)
    x, y = local[0] - _column(state, 0), local[1] - _column(state, 1)
    g = (a * x + b * y + local[2]) * root
    h = g * root
    x -= h * a
    y -= h * b
    z = local[2] - h
    f = np.sqrt(x * x + y * y + z * z)
    inverse = 1 / np.maximum(f, np.finfo(np.float64).tiny)
    of_f, of_g = np.empty((2, 4, *f.shape))
    np.multiply(x, -inverse, out=of_f[0])
    np.multiply(y, -inverse, out=of_f[1])
    np.multiply(of_f[:2], g * root, out=of_f[2:])
    of_g[0], of_g[1] = -a * root, -b * root
    np.multiply(x, root, out=of_g[2])
    np.multiply(y, root, out=of_g[3])
    return f, g, of_f, of_g


def _axis(state: Floats, local: Floats) -> tuple[Floats, Floats]:
    return _from_axis(state, local)[::2]


def _cylinder(state: Floats, local: Floats) -> tuple[Floats, Floats]:
    f, _, of_f, _ = _from_axis(state, local)
    return f - _column(state, 4), np.concatenate([of_f, np.full((1, *f.shape), -1.0)])


def _cone(state: Floats, local: Floats) -> tuple[Floats, Floats]:
    """f·cos ψ − g·sin ψ − s: s is the distance of the surface from the point (cx, cy, 0), ψ the half angle."""
    f, g, of_f, of_g = _from_axis(state, local)
    cos, sin = np.cos(_column(state, 5)), np.sin(_column(state, 5))
    turned = -f * sin - g * cos
    J = np.concatenate([cos * of_f - sin * of_g, np.full((1, *f.shape), -1.0), turned[None]])
    return f * cos - g * sin - _column(state, 4), J


LINE_IN_PLANE = FeatureShape("line", 2, (1,), None, _flat(1))
LINE = _LineInSpace("line", 2, (2, 3), None, _axis)
PLANE = FeatureShape("plane", 3, (1, 2), None, _flat(2))
CIRCLE = FeatureShape("circle", 3, (), 2, _ball)
SPHERE = FeatureShape("sphere", 4, (), 3, _ball)
CYLINDER = FeatureShape("cylinder", 5, (2, 3), 4, _cylinder)
CONE = FeatureShape("cone", 6, (2, 3, 5), 4, _cone)
