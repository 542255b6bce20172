"""The rotation nearest to what paired vectors say (Kabsch 1976)."""

from __future__ import annotations

import numpy as np

from cmm_uq.base.points import Floats


def nearest_rotations(moments: Floats) -> Floats:
    """Rotations (q, 3, 3) R with the largest tr(Rᵀ·moment), proper ones.

    Parameters
    ----------
    moments : (q, 3, 3) sums of found · ownᵀ, both about their means. Where these lie on a line, the turn about it is any.
    """
    U, _, Vt = np.linalg.svd(moments)
    U[:, :, 2] *= np.sign(np.linalg.det(U @ Vt))[:, None]
    return np.asarray(U @ Vt, dtype=np.float64)
