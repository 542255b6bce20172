"""The steps of a display: how fine a recording's coordinates are, as the recording itself shows."""

from __future__ import annotations

import numpy as np

from cmm_uq.points import Floats

INCH = 25.4
_EXACT = 1e-5
"""Part of a step by which a coordinate on the grid may be off, as from a unit's conversion."""

_LEAST_VALUES = 12
"""Different coordinates from which on a grid is no coincidence."""

_LEAST_SHARE = 0.01
"""Part of the variance of a coordinate from which on the steps matter."""


def display_step(xyz: Floats, scatter: float) -> float:
    """Largest step, mm, of which all coordinates are multiples; 0 where it is too fine to matter, or there is none.

    Parameters
    ----------
    xyz : (n, 3) mm as recorded.
    scatter : of a coordinate, mm, as the residuals show it: a step s has the variance s²/12.
    """
    values = np.unique(xyz[np.isfinite(xyz)])
    steps = [f * unit * 10.0**-k for unit in (1.0, INCH) for k in range(1, 6) for f in (5.0, 2.0, 1.0)]
    if len(values) < _LEAST_VALUES:
        return 0.0
    for step in sorted(steps, reverse=True):
        if step**2 / 12 < _LEAST_SHARE * scatter**2:
            return 0.0
        if np.abs(values / step - np.round(values / step)).max() < _EXACT:
            return step
    return 0.0
