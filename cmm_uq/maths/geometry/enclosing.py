"""The smallest sphere that holds some points: it goes through two, three or four of them."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from cmm_uq.base.points import Floats

_ROUNDING = 1e-9


def enclosing_diameter(points: Floats) -> float:
    """Of points (n, 3), in their unit; 0 of a single one.

    The point that lies farthest outside the smallest sphere of some joins them, until none lies outside.
    """
    slack = _ROUNDING * (float(np.ptp(points, axis=0).max()) + np.finfo(float).tiny)
    held = [0]
    while True:
        centre, radius, held = _smallest(points, held, slack)
        away = np.linalg.norm(points - centre, axis=1)
        farthest = int(np.argmax(away))
        if away[farthest] <= radius + slack or farthest in held:
            return 2 * radius
        held.append(farthest)


def _smallest(points: Floats, some: list[int], slack: float) -> tuple[Floats, float, list[int]]:
    """Centre and radius of the smallest sphere through some of these points that holds them all, and those that hold it."""
    found = points[some[0]], np.inf, some
    for count in range(1, min(len(some), 4) + 1):
        for chosen in combinations(some, count):
            first, others = points[chosen[0]], points[list(chosen[1:])] - points[chosen[0]]
            away = np.linalg.lstsq(2 * others, np.sum(others**2, axis=1), rcond=None)[0] if count > 1 else np.zeros(3)
            centre, radius = first + away, float(np.linalg.norm(away))
            holds = np.all(np.linalg.norm(points[some] - centre, axis=1) <= radius + slack)
            if holds and radius < found[1]:
                found = centre, radius, list(chosen)
    return found
