"""What is free in each of many placings by itself: columns that are zero outside their placing, kept without the zeros."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, sparse

from cmm_uq.base.points import Floats, Ints

_DEPENDENT = 1e-10
"""Part of the largest diagonal element below which another counts as zero."""


@dataclass(frozen=True, eq=False)
class Freedoms:
    """Columns (m, blocks·j), of which every observation has those of its own block.

    Parameters
    ----------
    columns : (m, j) of each observation's own block.
    index : (m,) its block.
    blocks : how many there are; one that no observation belongs to is free altogether.
    """

    columns: Floats
    index: Ints
    blocks: int

    @classmethod
    def of(cls, columns: Floats | Freedoms) -> Freedoms:
        """Columns (m, q) as one block; none without columns."""
        if isinstance(columns, Freedoms):
            return columns
        return cls(columns, np.zeros(len(columns), dtype=np.int64), int(columns.shape[1] > 0))

    @property
    def count(self) -> int:
        """Of all columns."""
        return self.blocks * int(self.columns.shape[1])

    def dense(self) -> Floats:
        """All columns (m, blocks·j), the zeros too."""
        whole = np.zeros((len(self.index), self.blocks, self.columns.shape[1]))
        if self.blocks:
            whole[np.arange(len(self.index)), self.index] = self.columns
        return whole.reshape(len(self.index), -1)

    def at(self, rows: NDArray[np.bool_] | Ints) -> Freedoms:
        """Of some of the observations."""
        return Freedoms(self.columns[rows], self.index[rows], self.blocks)

    def over(self, scale: Floats) -> Freedoms:
        """Divided by the noise scale (m,) of the observations."""
        return Freedoms(self.columns / scale[:, None], self.index, self.blocks)

    def turned(self, turn: sparse.csr_array) -> Freedoms:
        """Of observations mixed by a matrix (m, m); one block where it mixes those of several."""
        among = turn.tocoo()
        whole = Freedoms.of(self.dense()) if np.any(self.index[among.row] != self.index[among.col]) else self
        return Freedoms(np.asarray(turn @ whole.columns), whole.index, whole.blocks)

    @cached_property
    def rows(self) -> list[Ints]:
        """Observations of each block."""
        order = np.argsort(self.index, kind="stable")
        return np.split(order, np.cumsum(np.bincount(self.index, minlength=self.blocks))[:-1]) if self.blocks else []

    @cached_property
    def reached(self) -> Freedoms:
        """Orthonormal columns of the same span; as many as a block lacks are zero."""
        found = np.zeros_like(self.columns)
        for rows in self.rows:
            basis = reached(self.columns[rows])
            found[rows, : basis.shape[1]] = basis
        return Freedoms(found, self.index, self.blocks)

    def apart(self, group: Ints) -> Freedoms:
        """The same span by orthogonal columns of the same length, as many as can be zero outside one group (m,) each.

        Columns are orthogonal and of one length, or zero; those that are zero stay where they are.
        """
        found = np.zeros_like(self.columns)
        for rows in self.rows:
            columns = self.columns[rows]
            kept = np.flatnonzero(np.any(columns, axis=0))
            basis, taken, span = columns[:, kept], [], np.zeros((0, len(kept)))
            for number in np.unique(group[rows]):
                outside = group[rows] != number
                _, s, Vt = np.linalg.svd(basis[outside], full_matrices=True)
                within = Vt[np.sum(s > _DEPENDENT * np.linalg.norm(basis)) :]
                taken.append(np.where(outside[:, None], 0.0, basis @ within.T))
                span = np.vstack([span, within])
            rest = np.linalg.svd(span, full_matrices=True)[2][len(span) :]
            found[np.ix_(rows, kept)] = np.hstack([*taken, basis @ rest.T])
        return Freedoms(found, self.index, self.blocks)

    @cached_property
    def rank(self) -> int:
        """How many of the columns are independent."""
        return int(np.sum(self.sums(self.reached.columns**2) > 0.5))

    def sums(self, values: Floats) -> Floats:
        """Sums of values (m, …) over the observations of each block, (blocks, …)."""
        found = np.zeros((self.blocks, *values.shape[1:]))
        if self.blocks and len(values):
            order = np.argsort(self.index, kind="stable")
            starts = np.flatnonzero(np.diff(self.index[order], prepend=-1))
            found[self.index[order][starts]] = np.add.reduceat(values[order], starts, axis=0)
        return found

    def without(self, columns: Floats) -> Floats:
        """Columns (m, b) without what the freedoms reach."""
        left = columns
        for basis in self.reached.columns.T if self.blocks else ():
            left = left - basis[:, None] * self.sums(basis[:, None] * left)[self.index]
        return left


def reached(columns: Floats) -> Floats:
    """Orthonormal basis (m, r) of what columns (m, q) reach, by QR with pivoting."""
    if not columns.size:
        return np.zeros((len(columns), 0))
    Q, R, _ = linalg.qr(columns, mode="economic", pivoting=True)
    diagonal = np.abs(np.diag(R))
    return np.asarray(Q[:, diagonal > _DEPENDENT * diagonal[0]], dtype=np.float64)
