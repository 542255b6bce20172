"""Points whose least-squares feature is known exactly, to test fitting software as ISO 10360-6 and NIST's ATS do.

The sum of squares is stationary at a feature when the deviations of the points from it are orthogonal to every way in
which it can move or grow. So deviations are drawn, made orthogonal to those, and put on the surface along its normals; the
feature one began with is then the least-squares feature, to the rounding of the coordinates and without any fit. A zone is
held by contact points whose motions, with positive weights, cancel: they are found by linear programming on the surface, and
put on either side of it.
"""

from __future__ import annotations

import numpy as np

from cmm_uq.base.points import Floats, Ints


def points_with_known_fit(surface: Floats, normals: Floats, growth: Floats, form: float, seed: int) -> Floats:
    """Points (n, 3) about a surface whose least-squares feature is that surface, mm.

    ``surface``: (n, 3) points of the feature, mm. ``normals``: (n, m, 3) unit normals at each: m = 1 of a surface, 2 of a
    curve in space. ``growth``: (n, m, k) how far the feature moves along its normals per unit of each of its k sizes: 1 of a
    radius; of a plane or line k = 0. ``form``: largest deviation, mm; small against the feature.
    """
    n, m, _ = normals.shape
    ways = _ways(surface, normals, growth)
    basis, size, _ = np.linalg.svd(ways, full_matrices=False)
    basis = basis[:, size > 1e-12 * size[0]]
    deviation = np.random.default_rng(seed).uniform(-1, 1, n * m)
    for _ in range(3):
        deviation -= basis @ (basis.T @ deviation)
    deviation *= form / np.abs(deviation).max()
    return np.asarray(surface + np.einsum("nm,nmi->ni", deviation.reshape(n, m), normals))


def points_with_known_zone(
    surface: Floats, normals: Floats, growth: Floats, width: float, seed: int, *, sides: tuple[float, ...] = (1.0, -1.0)
) -> tuple[Floats, Ints]:
    """Points (n, 3) whose minimum zone is a surface with half the width to either side, mm, and the rows of its contacts.

    The contacts are as many as hold a zone without any curvature, one more than the feature has freedoms.

    ``surface, normals, growth``: as for :func:`points_with_known_fit`, of a surface (m = 1). ``width``: of the zone, mm;
    small against the feature. ``sides``: on which contacts lie: ``(1.0,)`` outside only, so that without ``growth`` (k = 0)
    the feature grown by half the width is the smallest about the points; ``(-1.0,)`` inside only.
    """
    from scipy.optimize import linprog

    n = len(surface)
    ways = _ways(surface, normals, growth)
    _, size, Vt = np.linalg.svd(ways, full_matrices=False)
    free = ways @ Vt[size > 1e-12 * size[0]].T
    rng = np.random.default_rng(seed)
    rows = np.concatenate([side * free for side in sides])
    balance = np.column_stack([rows, np.ones(len(rows))]).T
    while True:
        # a corner of all balanced weights, whichever the drawn direction points to
        found = linprog(rng.normal(size=len(rows)), A_eq=balance, b_eq=np.eye(len(balance))[-1], method="highs-ds")
        held = np.flatnonzero(np.asarray(found.x) > 1e-3 / len(balance))
        if len(held) == len(balance):
            break
    deviation = rng.uniform(-0.4, 0.4, n)
    deviation[held % n] = 0.5 * np.repeat(sides, n)[held]
    return np.asarray(surface + width * deviation[:, None] * normals[:, 0]), np.sort(held % n)


def _ways(surface: Floats, normals: Floats, growth: Floats) -> Floats:
    """(n·m, ≤ 6 + k) how each point's distances follow the feature's motions and growth, in columns of unit length.

    Motions that leave the feature where it is have none.
    """
    turning = np.cross(surface[:, None, :], normals)
    ways = np.concatenate([normals, turning, growth], axis=2).reshape(len(surface) * normals.shape[1], -1)
    length = np.linalg.norm(ways, axis=0)
    moving = length > 1e-12 * length.max()
    return np.asarray(ways[:, moving] / length[moving])


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
