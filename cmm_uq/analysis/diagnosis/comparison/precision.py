"""The precision of what the baseline leaves, under one kind of noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse

from cmm_uq.analysis.diagnosis.comparison.quick import log_diagonal
from cmm_uq.analysis.diagnosis.noise import Kind
from cmm_uq.base.points import Floats


@dataclass(frozen=True, eq=False)
class Precision:
    """Of one kind of noise, what the baseline reaches projected out.

    The precision of what is left is WᵀW − rowsᵀ·rows, with the whitening W (m, m); ``log``, the log probability less that of
    the determinant. ``basis`` (m, g) see :meth:`explained`.
    """

    whitening: sparse.csr_array
    rows: Floats
    log: float
    basis: Floats

    def __call__(self, columns: Floats) -> Floats:
        """Precision times columns (m, b)."""
        if self._diagonal is None:
            whole = self._transposed @ (self.whitening @ columns)
        else:
            whole = self._diagonal * (self._diagonal * columns)
        return np.asarray(whole - self.rows.T @ (self.rows @ columns), dtype=np.float64)

    def explained(self, white: Floats) -> Floats:
        """Of whitened observations (m, b), what the baseline takes, and what noise in common explains of the rest."""
        return np.asarray(self.basis @ (self.basis.T @ white), dtype=np.float64)

    @cached_property
    def _diagonal(self) -> Floats | None:
        """Of the whitening (m, 1), where it mixes no observations."""
        each = np.arange(self.whitening.shape[0])
        if self.whitening.nnz != len(each) or not np.array_equal(self.whitening.indices, each):
            return None
        return self.whitening.diagonal()[:, None]

    @cached_property
    def _transposed(self) -> sparse.csc_array:
        return self.whitening.T


def precisions(kinds: Sequence[Kind], reached: Floats, certified: Floats) -> list[Precision]:
    """Of each kind of noise.

    Parameters
    ----------
    kinds : of noise.
    reached : (m, q) orthonormal basis of what the baseline reaches.
    certified : (m, c) what a certificate leaves open, for one standard deviation, in units of the noise.
    """
    found = []
    for kind in kinds:
        Q, R = np.linalg.qr(kind.white(reached))
        log = float(np.log(kind.probability)) + kind.log_factor + kind.log_whitening - log_diagonal(R)
        rows, basis = kind.whitening.T @ Q, Q
        shared = [columns for columns in (certified, kind.slow) if columns.size]
        if shared:
            white = kind.white(np.hstack(shared))
            white -= Q @ (Q.T @ white)
            factor = np.linalg.cholesky(np.eye(white.shape[1]) + white.T @ white)
            log -= log_diagonal(factor)
            own = np.linalg.solve(factor, white.T)
            rows, basis = np.hstack([rows, kind.whitening.T @ own.T]), np.hstack([Q, own.T])
        found.append(Precision(kind.whitening, np.asarray(rows.T, dtype=np.float64), log, basis))
    return found
