"""A linear measurement model: observations, what explains them, what is known beforehand and what each set-up leaves free.

    observed = design · parameters + placing · (anything) + noise,   noise_i ~ N(0, (σ · noise_scale_i)²)

Observed values are mm. Columns of ``placing`` have no prior and are of no interest (where the artefact stood); they are
projected out exactly. Everything else in this room works on the reduced form that :meth:`LinearModel.reduced` gives.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, sparse

from cmm_uq.base.points import Floats, Ints
from cmm_uq.base.units import Unit

_DEPENDENT = 1e-10  # part of the largest diagonal element below which another counts as zero


@dataclass(frozen=True, eq=False)
class Freedoms:
    """Columns (m, blocks·j), of which every observation has those of its own block."""

    columns: Floats  # (m, j) of each observation's own block
    index: Ints  # (m,) its block
    blocks: int  # how many there are; one that no observation belongs to is free altogether

    @classmethod
    def of(cls, columns: Floats | Freedoms) -> Freedoms:
        """Columns (m, q) as one block; none without columns."""
        if isinstance(columns, Freedoms):
            return columns
        return cls(columns, np.zeros(len(columns), dtype=np.int64), int(columns.shape[1] > 0))

    @property
    def count(self) -> int:
        return self.blocks * int(self.columns.shape[1])

    def dense(self) -> Floats:
        """All columns (m, blocks·j), the zeros too."""
        whole = np.zeros((len(self.index), self.blocks, self.columns.shape[1]))
        if self.blocks:
            whole[np.arange(len(self.index)), self.index] = self.columns
        return whole.reshape(len(self.index), -1)

    def at(self, rows: NDArray[np.bool_] | Ints) -> Freedoms:
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
        """The same span by orthogonal columns of one length, as many as can be zero outside one group (m,) each.

        Columns that are zero stay where they are.
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


@dataclass(frozen=True)
class Unknown:
    key: tuple[str, str]  # effect (or ``artefact``) and parameter name, as in results.json.
    unit: Unit  # as printed
    prior_mean: float
    prior_sd: float  # infinite where nothing is known beforehand
    scale: float  # a typical size, for columns of comparable length
    known: bool = False  # whether the prior comes from a certificate, so that least squares may use it too


@dataclass(frozen=True, eq=False)
class LinearModel:
    observed: Floats  # (m,) mm
    design: Floats  # (m, k) mm per unit of each parameter
    unknowns: tuple[Unknown, ...]  # k of them
    placing: Floats | Freedoms  # (m, q) columns to be projected out, or those of each placing by itself
    noise_scale: Floats  # (m,) positive
    sigma: float | None  # standard uncertainty of one coordinate, mm; ``None`` when it is to be estimated

    @cached_property
    def reduced(self) -> Reduced:
        """Whitened by the noise scale, the placing projected out by QR."""
        y = self.reduce(self.observed[:, None])[:, 0]
        return Reduced(y, self.reduce(self.design), len(y) - self._whitened.rank)

    def reduce(self, columns: Floats) -> Floats:
        """Columns (m, r), mm, in units of the noise scale, the placing projected out."""
        return self._whitened.without(columns / self.noise_scale[:, None])

    @cached_property
    def freedoms(self) -> Freedoms:
        """The columns of the placing, by placing where that is known."""
        return Freedoms.of(self.placing)

    @cached_property
    def _whitened(self) -> Freedoms:
        return self.freedoms.over(self.noise_scale)

    def at(self, rows: NDArray[np.bool_]) -> LinearModel:
        of_rows = {name: getattr(self, name)[rows] for name in ("observed", "design", "noise_scale")}
        return replace(self, **of_rows, placing=self.freedoms.at(rows))

    def only(self, parameters: Sequence[int]) -> LinearModel:
        """The model with some of its parameters, the others zero."""
        chosen = list(parameters)
        return replace(self, design=self.design[:, chosen], unknowns=tuple(self.unknowns[i] for i in chosen))

    def uncorrelated(self, whiten: Callable[[Floats], Floats]) -> LinearModel:
        """The same model in observations whose noise ``whiten`` has made white, of one coordinate's standard deviation."""
        design, placing = whiten(self.design), whiten(self.freedoms.dense())
        observed, scale = whiten(self.observed[:, None])[:, 0], np.ones(len(self.observed))
        return replace(self, observed=observed, design=design, placing=placing, noise_scale=scale)

    @property
    def priors(self) -> tuple[Floats, Floats]:
        """What is known beforehand as p observations of unit variance: rows (p, k), and what they give, (p,)."""
        known = np.isfinite(self.prior_sd)
        sd = self.effective_sd[known]
        return np.eye(len(known))[known] / sd[:, None], self.prior_mean[known] / sd

    @property
    def scale(self) -> Floats:
        return np.array([u.scale for u in self.unknowns])

    @property
    def prior_mean(self) -> Floats:
        return np.array([u.prior_mean for u in self.unknowns])

    @property
    def prior_sd(self) -> Floats:
        return np.array([u.prior_sd for u in self.unknowns])

    @property
    def effective_sd(self) -> Floats:
        """(k,) prior ones; a certificate without uncertainty is taken as good to a millionth of a typical size."""
        return np.maximum(self.prior_sd, 1e-6 * self.scale)


@dataclass(frozen=True, eq=False)
class Reduced:
    """Observations (m,) and design (m, k) in units of the noise scale, and how many observations they are worth."""

    observed: Floats
    design: Floats
    count: int
