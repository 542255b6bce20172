"""Residuals in units of their own standard deviations, under a noise of several components.

What has been fitted takes part of the noise with it, and of some observations nearly all: of the mean of three repeats, where
each placing is fitted by itself, nothing may be left. Residuals that are taken for the noise are then a mixture of large and
small ones, and look as if a normal noise had heavy tails.
"""

from __future__ import annotations

import numpy as np

from cmm_uq.base.points import Floats
from cmm_uq.maths.inference.linear_model import LinearModel
from cmm_uq.maths.inference.noise import Components, Sizes

# part of its variance that must be left of an observation: a smaller one is mostly what the model lacks, made large
_LEAST_LEFT = 0.1
_DEPENDENT = 1e-9  # part of the largest singular value below which another counts as zero


def studentised(model: LinearModel, noise: Components, sizes: Sizes, residuals: Floats) -> Floats:
    """Residuals (n,), each of variance one over that of a reading, of the observations that the fit leaves enough of.

    The design's columns and the placings are projected out under the noise without its slow part (Cook & Weisberg 1982,
    Residuals and Influence in Regression, 2.2.1).

    ``residuals``: (m,) of least squares, mm.
    """
    variance = (noise.variances(sizes)[0] @ noise.shares.T)[0]
    scale = np.sqrt(variance) / float(sizes.coordinate[0])
    placed = model.freedoms.turned(noise.turn).over(scale)
    fitted = [i for i, unknown in enumerate(model.unknowns) if not unknown.known]
    typical = np.array([model.unknowns[i].scale for i in fitted])
    design = placed.without(np.asarray(noise.turn @ (model.design[:, fitted] * typical)) / scale[:, None])
    U, s, _ = np.linalg.svd(design, full_matrices=False)
    U = U[:, s > _DEPENDENT * s.max(initial=0.0)]
    left = 1 - np.sum(placed.reached.columns**2, axis=1) - np.sum(U**2, axis=1)
    own = placed.without(noise.white(sizes)(residuals[:, None]))[:, 0]
    own = own - U @ (U.T @ own)
    kept = left > _LEAST_LEFT
    return np.asarray(own[kept] / np.sqrt(left[kept]))
