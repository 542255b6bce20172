"""Which cells of frequency of several waves explain a recording together: enumerated, not searched for.

All else is normal, so that a combination of periods has evidence in closed form. A gauge has faces at a regular pitch: on one
line frequencies that differ by a multiple of its inverse are the same, and only diagonals tell them apart, so that the
combinations that explain a recording are many, isolated and narrow. Frequencies are therefore divided into cells that a
recording hardly resolves. A cell has the columns of its middle and their derivatives by the frequency, with the spread of a
cell: its evidence is that of all its frequencies. Cells of one error are weighed with the others as normal sums over all of
their cells, then pairs of cells with the third as such a sum, then triples; the heaviest are all kept, of the others a fair
sample that stands for the rest (Fearnhead, Clifford 2003, J. R. Statist. Soc. B 65, 887).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import combinations, product

import numpy as np
from numpy.typing import NDArray

from cmm_uq.parts.waves import Wave, evidence, orthogonal
from cmm_uq.points import Floats, Ints

FIRST, PAIRS, EACH, WHOLE = 40, 150, 100, 2000
"""Cells of a wave, pairs of two, combinations that follow from a pair, and combinations in all that are followed."""

NEAR, ROUNDS = 40, 2
"""How many of the heaviest combinations what is near is looked for, and how often."""

_NEAR = 10.0
"""By how much the logarithm of a weight may be less than the largest for what is near to be followed."""

_CERTAIN = 0.999
"""Probability of having been found from which on a combination stands for itself alone."""

_SINGLE = 1e5
"""Largest square of a column, in variances of the noise, up to which single precision does for choosing."""

TEMPER = 0.5
"""Power of their weight by which cells and pairs are chosen: those that look poor beside normal sums may be the right ones."""


class Combinations:
    """Cells of all waves together: those of one, then pairs, then all, then what differs from the heaviest in one.

    Parameters
    ----------
    v : (r,) whitened observations.
    waves : w of them.
    cells, prior : of each, columns (c, r, 4) and log probabilities (c,) of its cells.
    """

    def __init__(
        self,
        v: Floats,
        waves: Sequence[Wave],
        cells: Sequence[Floats],
        prior: Sequence[Floats],
        random: np.random.Generator,
    ) -> None:
        self.v, self.cells, self.prior, self.random, self.w = v, cells, prior, random, len(waves)
        self._sums = [wave.beforehand() for wave in waves] if self.w > 1 else []
        self._last = self._beside(range(self.w))

    def _beside(self, acting: Iterable[int]) -> Beside:
        own = list(acting)
        none = np.zeros((len(self.v), len(self.v)))
        others = [each for i, each in enumerate(self._sums) if i not in own]
        return Beside(self.v, {i: self.cells[i] for i in own}, sum(others, none))

    def found(self) -> tuple[Ints, Floats]:
        """Cells (P, w), and the logarithms of what each stands for (P,)."""
        if self.w == 1:
            log = self._last.evidence({}, 0) + self.prior[0]
            at, p = chosen(log, WHOLE, self.random)
            return at[:, None], log[at] - np.log(p)
        singles = []
        for i in range(self.w):
            at, p = chosen(TEMPER * (self._beside([i]).evidence({}, i) + self.prior[i]), FIRST, self.random)
            every = np.zeros(len(self.prior[i]))
            every[at] = p
            singles.append(every)
        pairs = list(combinations(range(self.w), 2))
        each = [self._whole(i, j, singles) for i, j in pairs]
        rows, log, p = (np.concatenate(parts) for parts in zip(*each, strict=True))
        rows, log, share = self._near(*_united(rows, log, 1 / (len(pairs) * p), p > _CERTAIN))
        log = log + np.log(share)
        kept, p = chosen(log, WHOLE, self.random)
        return rows[kept], log[kept] - np.log(p)

    def _pairs(self, i: int, j: int, singles: Sequence[Floats]) -> tuple[Ints, Floats, Floats]:
        """Pairs of cells (q, 2), their log weights, and the probabilities that they are here."""
        beside, rows, logs = self._beside([i, j]), list[Ints](), list[Floats]()
        for a, b in ((i, j), (j, i)):
            for one in np.flatnonzero(singles[a]).tolist():
                log = beside.evidence({a: one}, b) + self.prior[a][one] + self.prior[b]
                # what starts from the other wave is there already
                other = np.flatnonzero(singles[b] == 0) if a == j else np.arange(len(log))
                pair = np.column_stack([np.full(len(other), one), other])
                rows.append(pair if a == i else pair[:, ::-1])
                logs.append(log[other])
        row = np.concatenate(rows)
        return row, np.concatenate(logs), 1 - (1 - singles[i][row[:, 0]]) * (1 - singles[j][row[:, 1]])

    def _whole(self, i: int, j: int, singles: Sequence[Floats]) -> tuple[Ints, Floats, Floats]:
        """Cells (P, w) that follow from pairs of two waves, their log weights and probabilities."""
        pair, log, here = self._pairs(i, j, singles)
        if self.w == 2:
            at, p = chosen(log - np.log(here), WHOLE, self.random)
            return pair[at], log[at], here[at] * p
        at, p = chosen(TEMPER * log - np.log(here), PAIRS, self.random)
        found = list[tuple[Ints, Floats, Floats]]()
        for (a, b), here_too in zip(pair[at].tolist(), here[at] * p, strict=True):
            row, own = self._completed({i: a, j: b}, 3 - i - j)
            some, share = chosen(own, EACH, self.random)
            found.append((row[some], own[some], here_too * share))
        rows, logs, shares = zip(*found, strict=True)
        return np.concatenate(rows), np.concatenate(logs), np.concatenate(shares)

    def _completed(self, others: Mapping[int, int], k: int) -> tuple[Ints, Floats]:
        """All combinations (c, w) of given cells with one of the wave k, and their log weights."""
        log = self._last.evidence(others, k) + self.prior[k] + sum(self.prior[i][cell] for i, cell in others.items())
        rows = np.empty((len(log), self.w), dtype=np.int64)
        rows[:, k] = np.arange(len(log))
        for i, cell in others.items():
            rows[:, i] = cell
        return rows, log

    def _near(self, rows: Ints, log: Floats, share: Floats) -> tuple[Ints, Floats, Floats]:
        """With what differs from the heaviest in one wave."""
        looked: set[tuple[int, ...]] = set()
        for _ in range(ROUNDS):
            least, new = log.max() - _NEAR, list[tuple[Ints, Floats]]()
            for row, k in product(rows[np.argsort(log + np.log(share))[::-1][:NEAR]].tolist(), range(self.w)):
                others = {i: cell for i, cell in enumerate(row) if i != k}
                if (k, *others.values()) not in looked:
                    looked.add((k, *others.values()))
                    every, own = self._completed(others, k)
                    new.append((every[own > least], own[own > least]))
            if not new:
                break
            more, logs = (np.concatenate(parts) for parts in zip(*new, strict=True))
            certain = np.arange(len(rows) + len(more)) >= len(rows)
            rows, log, share = _united(
                np.concatenate([rows, more]), np.append(log, logs), np.append(share, np.ones(len(more))), certain
            )
        return rows, log, share


def _united(rows: Ints, log: Floats, share: Floats, certain: NDArray[np.bool_]) -> tuple[Ints, Floats, Floats]:
    """Each row once, with all that its copies stand for; of what was certain to be found with itself."""
    different, at, index = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    index = index.ravel()
    total = np.bincount(index, share)
    total[index[certain]] = 1.0
    return np.asarray(different, dtype=np.int64), log[at], np.asarray(total, dtype=np.float64)


class Beside:
    """Evidence of cells beside columns that are there, in whitened observations.

    Parameters
    ----------
    v : (r,) observations.
    cells : columns (c, r, 4) of the cells of each wave.
    sums : (r, r) covariance of waves that are normal sums.
    """

    def __init__(self, v: Floats, cells: Mapping[int, Floats], sums: Floats) -> None:
        L = np.linalg.cholesky(np.eye(len(v)) + sums)
        self.v = np.linalg.solve(L, v)
        flat = {i: np.linalg.solve(L, F.transpose(1, 2, 0).reshape(len(v), -1)) for i, F in cells.items()}
        self.columns = {i: F.reshape(len(v), 4, -1) for i, F in flat.items()}
        G = {i: np.einsum("ric,rjc->ijc", F, F) + np.eye(4)[:, :, None] for i, F in self.columns.items()}
        kind = np.float32 if max(float(each.max()) for each in G.values()) < _SINGLE else np.float64
        self._flat = {i: F.astype(kind) for i, F in flat.items()}
        self._G = {i: each.astype(kind) for i, each in G.items()}
        self._g = {i: np.tensordot(self.v, F, axes=(0, 0)) for i, F in self.columns.items()}

    def base(self, cells: Mapping[int, int]) -> Floats:
        """(r, 4w) columns of one cell of each of w waves."""
        return np.hstack([np.zeros((len(self.v), 0)), *(self.columns[i][:, :, cell] for i, cell in cells.items())])

    def evidence(self, cells: Mapping[int, int], wave: int) -> Floats:
        """(c,) log evidence of all cells of a wave beside one of each of others."""
        log, U = orthogonal(self.base(cells))
        T = (U.T.astype(self._flat[wave].dtype) @ self._flat[wave]).reshape(U.shape[1], *self.columns[wave].shape[1:])
        own = U.T @ self.v
        g = self._g[wave] - np.tensordot(own, T, axes=(0, 0))
        pairs = [(i, j) for i in range(4) for j in range(i + 1)]
        A = {(i, j): self._G[wave][i, j] - np.einsum("bc,bc->c", T[:, i], T[:, j]) for i, j in pairs}
        return log + 0.5 * float(own @ own) + evidence(A, list(g))


def chosen(log_weight: Floats, count: int, random: np.random.Generator) -> tuple[Ints, Floats]:
    """So many of weights at most, the heaviest all, and the probability with which each was chosen."""
    if len(log_weight) <= count:
        return np.arange(len(log_weight)), np.ones(len(log_weight))
    weight = np.exp(log_weight - log_weight.max())
    top = np.argpartition(weight, len(weight) - count)[len(weight) - count :]
    top = top[np.argsort(weight[top])[::-1]]
    left = float(np.delete(weight, top).sum())
    rest = np.append(np.cumsum(weight[top][::-1])[::-1], 0.0) + left
    heavy = weight[top] * (count - np.arange(count)) >= rest[:-1]
    kept = count if heavy.all() else int(np.argmin(heavy))
    probability, found = np.ones(len(weight)), top[:kept]
    if kept < count and rest[kept] > 0:
        others = np.delete(np.arange(len(weight)), top[:kept])
        probability[others] = np.minimum((count - kept) * weight[others] / rest[kept], 1.0)
        marks = np.cumsum(probability[others])
        at = np.searchsorted(marks, np.arange(count - kept) + random.random())
        found = np.concatenate([found, others[np.unique(at.clip(max=len(others) - 1))]])
    found = np.sort(found)
    return found, probability[found]
