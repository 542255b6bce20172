"""The noise of a comparison as full matrices, to check what is computed without them."""

import numpy as np
from scipy import linalg

from cmm_uq.diagnosis.comparison.evidence import Comparison
from cmm_uq.diagnosis.noise import Kind
from cmm_uq.points import Floats


def rest(c: Comparison) -> Floats:
    """(m, m') orthonormal basis of what the baseline does not reach."""
    return np.asarray(linalg.null_space(c.baseline.T))


def covariance(kind: Kind) -> Floats:
    """(m, m) over the variance of a reading."""
    whitening = kind.white(np.eye(kind.whitening.shape[0]))
    return np.asarray(linalg.inv(whitening.T @ whitening))
