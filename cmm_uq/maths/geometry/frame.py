"""A frame that follows an axis: the axis is its third row, and small tilts are taken about the other two."""

from __future__ import annotations

import numpy as np

from cmm_uq.base.points import Floats


def frame_about(axis: Floats) -> Floats:
    """(3, 3) right-handed orthonormal rows u, v, w with w along ``axis`` (3,)."""
    w = axis / np.linalg.norm(axis)
    u = np.zeros(3)
    u[np.argmin(np.abs(w))] = 1.0
    u -= (u @ w) * w
    u /= np.linalg.norm(u)
    return np.array([u, np.cross(w, u), w])


def tilted(frame: Floats, a: float, b: float) -> Floats:
    """The frame after its axis w has become the direction w + a·u + b·v."""
    w = frame[2] + a * frame[0] + b * frame[1]
    w /= np.linalg.norm(w)
    u = frame[0] - (frame[0] @ w) * w
    u /= np.linalg.norm(u)
    return np.array([u, np.cross(w, u), w])


def upward(direction: Floats) -> Floats:
    """The direction or its opposite, whichever has its largest component positive: for axes without a sense."""
    return np.asarray(direction * np.sign(direction[np.argmax(np.abs(direction))]))
