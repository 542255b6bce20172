"""Surfaces with their normals and growth, as reference sets ask for them."""

from __future__ import annotations

import numpy as np

from cmm_uq.base.points import Floats

Surface = tuple[Floats, Floats, Floats]


def radial(angle: float, n: int, rng: np.random.Generator) -> Floats:
    turn = rng.uniform(-angle / 2, angle / 2, n)
    return np.column_stack([np.cos(turn), np.sin(turn), np.zeros(n)])


def surface(kind: str, n: int, seed: int, angle: float = 2 * np.pi) -> Surface:
    """About the origin, axis or normal along z: plane 100 mm, radius 20 mm, length 60 mm, a cone of half angle 0.3."""
    rng = np.random.default_rng(seed)
    up = np.tile([0.0, 0, 1], (n, 1))
    if kind == "plane":
        return np.column_stack([rng.uniform(-50, 50, (n, 2)), np.zeros(n)]), up[:, None], np.zeros((n, 1, 0))
    if kind == "line":
        x = rng.uniform(-50, 50, n)
        return np.column_stack([x, 0 * x, 0 * x]), np.tile([0.0, 1, 0], (n, 1))[:, None], np.zeros((n, 1, 0))
    out, height = radial(angle, n, rng), rng.uniform(-30, 30, (n, 1))
    if kind == "sphere":
        out = rng.normal(size=(n, 3))
        out /= np.linalg.norm(out, axis=1, keepdims=True)
    if kind in ("circle", "sphere"):
        return 20 * out, out[:, None], np.ones((n, 1, 1))
    if kind == "cylinder":
        return 20 * out + height * up, out[:, None], np.ones((n, 1, 1))
    cos, sin = np.cos(0.3), np.sin(0.3)
    f = 20 + height * np.tan(0.3)
    growth = np.column_stack([np.ones(n), f[:, 0] * sin + height[:, 0] * cos])
    return f * out + height * up, (cos * out - sin * up)[:, None], growth[:, None, :]
