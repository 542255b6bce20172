"""Distances of points from a feature, and their derivatives, for many measurements of it at once.

A feature stands near the origin of its own frame, its axis or normal along z. Its state says how far it has moved from
there: shifts across the axis, slopes of the axis, then sizes. Distances and derivatives are exact at any state, so that
least squares and minimum zones, of one measurement or of a million, share them. For round features they follow
Shakarji, J. Res. NIST 103 (1998) 633.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from cmm_uq.base.points import Floats

Distances = Callable[[Floats, Floats], tuple[Floats, Floats]]


@dataclass(frozen=True)
class Shape:
    """A kind of feature in its own frame.

    Parameters
    ----------
    name : as messages call it.
    least : points that determine it.
    slopes : places in the state of slopes of axis or normal, which belong to a length; the others are mm.
    size : place in the state of the radius (of a cone the distance of its surface), None where there is no size.
    distances : of a state (N, k) and local points (d, N, n): distances (N, n) and derivatives (k, N, n).
    """

    name: str
    least: int
    slopes: tuple[int, ...]
    size: int | None
    distances: Distances

    def normal_matrix(self, state: Floats, local: Floats) -> Floats:
        """(k, k) of the least-squares problem at the nominal state (k,) of points (d, n)."""
        J = self.distances(state[None], local[:, None])[1][:, 0]
        return np.asarray(J @ J.T)


class _LineInSpace(Shape):
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
    """Line in space: distance from it."""
    f, _, of_f, _ = _from_axis(state, local)
    return f, of_f


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


LINE_IN_PLANE = Shape("line", 2, (1,), None, _flat(1))
LINE = _LineInSpace("line", 2, (2, 3), None, _axis)
PLANE = Shape("plane", 3, (1, 2), None, _flat(2))
CIRCLE = Shape("circle", 3, (), 2, _ball)
SPHERE = Shape("sphere", 4, (), 3, _ball)
CYLINDER = Shape("cylinder", 5, (2, 3), 4, _cylinder)
CONE = Shape("cone", 6, (2, 3, 5), 4, _cone)
