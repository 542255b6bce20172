"""Points whose least-squares feature is known exactly, to test fitting software as ISO 10360-6 and NIST's ATS do.

The sum of squares is stationary at a feature when the deviations of the points from it are orthogonal to every way in
which it can move or grow. So deviations are drawn, made orthogonal to those, and put on the surface along its normals; the
feature one began with is then the least-squares feature, to the rounding of the coordinates and without any fit.
"""

from __future__ import annotations

import numpy as np

from cmm_uq.points import Floats


def points_with_known_fit(surface: Floats, normals: Floats, growth: Floats, form: float, seed: int) -> Floats:
    """Points about a surface whose least-squares feature is that surface.

    Parameters
    ----------
    surface : (n, 3) points of the feature, mm.
    normals : (n, m, 3) unit normals at each: m = 1 of a surface, 2 of a curve in space.
    growth : (n, m, k) how far the feature moves along its normals per unit of each of its k sizes: 1 of a radius; of a
        plane or line k = 0.
    form : largest deviation, mm; small against the feature.
    seed : of the deviations.

    Returns
    -------
    (n, 3) in mm.
    """
    n, m, _ = normals.shape
    turning = np.cross(surface[:, None, :], normals)
    ways = np.concatenate([normals, turning, growth], axis=2).reshape(n * m, -1)
    ways = ways / np.maximum(np.linalg.norm(ways, axis=0), np.finfo(np.float64).tiny)
    basis, size, _ = np.linalg.svd(ways, full_matrices=False)
    basis = basis[:, size > 1e-12 * size[0]]
    deviation = np.random.default_rng(seed).uniform(-1, 1, n * m)
    for _ in range(3):
        deviation -= basis @ (basis.T @ deviation)
    deviation *= form / np.abs(deviation).max()
    return np.asarray(surface + np.einsum("nm,nmi->ni", deviation.reshape(n, m), normals))
