"""Directions spread evenly over part of a sphere."""

from __future__ import annotations

import numpy as np

from cmm_uq.base.points import Floats


def cap_directions(polar_angle: float, n: int = 20_000) -> Floats:
    """Unit directions (n, 3) spread evenly over the cap of a sphere about +z, as a digitizer sees it from above.

    Parameters
    ----------
    polar_angle : of the cap's edge from +z, rad: π/2 for a hemisphere.
    """
    i = np.arange(n)
    z = 1 - (1 - np.cos(polar_angle)) * (i + 0.5) / n
    turn = np.pi * (3 - np.sqrt(5)) * i
    r = np.sqrt(1 - z**2)
    return np.column_stack([r * np.cos(turn), r * np.sin(turn), z])
