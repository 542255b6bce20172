"""Noise of maps along an axis: white, or each reading like the one before it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import sparse

from cmm_uq.analysis.diagnosis.noise import TAILS, NoiseKind
from cmm_uq.base.points import Ints

WHITE = "white"


def kinds_along(chain: Ints, white: float, correlations: Sequence[float]) -> list[NoiseKind]:
    """Kinds of noise of readings (m,) in the order of their positions.

    ``chain`` (m,) readings with one number follow each other.
    """
    identity = sparse.csr_array(sparse.eye_array(len(chain)))
    share = (1 - white) / len(correlations)
    return [NoiseKind(WHITE, identity, 0.0, white - TAILS), *(_correlated(phi, chain, share) for phi in correlations)]


def _correlated(phi: float, chain: Ints, probability: float) -> NoiseKind:
    """First-order autoregression along each chain."""
    m, innovation = len(chain), np.sqrt(1 - phi**2)
    follows = np.append(False, chain[1:] == chain[:-1])
    diagonal = np.where(follows, 1 / innovation, 1.0)
    after = np.flatnonzero(follows)
    rows, columns = np.append(np.arange(m), after), np.append(np.arange(m), after - 1)
    values = np.append(diagonal, np.full(len(after), -phi / innovation))
    whitening = sparse.csr_array((values, (rows, columns)), shape=(m, m))
    return NoiseKind("correlated", whitening, float(np.log(diagonal).sum()), probability)
