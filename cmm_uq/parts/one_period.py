"""Periods of several errors at once, one of each, drawn by the evidence of a recording: enumerated, not searched for.

All else is normal, so that a combination of periods has evidence in closed form. A gauge has faces at a regular pitch: on one
line frequencies that differ by a multiple of its inverse are the same, and only diagonals tell them apart, so that the
combinations that explain a recording are many, isolated and narrow. Frequencies are therefore divided into cells that a
recording hardly resolves. A cell has the columns of its middle and their derivatives by the frequency, with the spread of a
cell: its evidence is that of all its frequencies. Cells of one error are weighed with the others as normal sums over all of
their cells, then pairs of cells with the third as such a sum, then triples; the heaviest are all kept, of the others a fair
sample that stands for the rest (Fearnhead, Clifford 2003, J. R. Statist. Soc. B 65, 887). Within the cells frequencies follow
one after the other, and weights make them exact.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from cmm_uq.points import Floats, Ints

CELLS = 4
"""In one over the span of the readings."""

FIRST, PAIRS, EACH, WHOLE = 40, 150, 100, 2000
"""Cells, pairs and whole combinations that are followed."""

TEMPER = 0.5
"""Power of their weight by which cells and pairs are chosen: those that look poor beside normal sums may be the right ones."""

NEAR, ROUNDS, _NEAR = 40, 2, 10.0

FINE = 16
"""Frequencies in a cell."""

_BLOCK = 500


@dataclass(frozen=True, eq=False)
class Wave:
    """An error A·sin(2πf·x) + B·cos(2πf·x) of a reading x, f evenly distributed in its logarithm.

    Parameters
    ----------
    reading : (n,) mm.
    shown : (r, n) of a millimetre of error at each reading in r whitened observations.
    sd : of A and of B, mm.
    low, high : bounds of f, 1/mm.
    """

    reading: Floats
    shown: Floats
    sd: float
    low: float
    high: float

    @property
    def cells(self) -> Floats:
        """(c + 1,) their bounds."""
        span = max(float(np.ptp(self.reading)), 1.0 / self.high)
        count = int(np.ceil((self.high - self.low) * CELLS * span))
        return np.linspace(self.low, self.high, count + 1)

    def columns(self, frequency: Floats) -> Floats:
        """(…, r, 2) of frequencies (…), for one standard deviation of either."""
        angle = 2 * np.pi * frequency[..., None] * (self.reading - self._middle)
        waves = np.stack([np.sin(angle), np.cos(angle)], axis=-1)
        return np.asarray(self.sd * (self.shown @ waves))

    @property
    def _middle(self) -> float:
        return 0.5 * float(self.reading.min() + self.reading.max())

    def of_cells(self, bounds: Floats) -> Floats:
        """(c, r, 4) of cells: their middles, and changes for one standard deviation of the frequency."""
        x = self.reading - self._middle
        angle = np.pi * (bounds[1:] + bounds[:-1])[:, None] * x
        spread = 2 * np.pi * np.diff(bounds)[:, None] / np.sqrt(12) * x
        s, c = np.sin(angle), np.cos(angle)
        return np.asarray(self.sd * (self.shown @ np.stack([s, c, spread * c, -spread * s], axis=-1)))

    def beforehand(self) -> Floats:
        """(r, r) covariance of what observations show, of any frequency."""
        bounds = self.cells
        own = self.of_cells(bounds)[:, :, :2] * np.sqrt(mass(bounds, self))[:, None, None]
        own = own.transpose(1, 0, 2).reshape(own.shape[1], -1)
        return np.asarray(own @ own.T)

    def at_origin(self, frequency: Floats, coefficients: Floats) -> Floats:
        """Coefficients (N, 2), in standard deviations about the middle of the readings, as those about zero, in mm."""
        turn = 2 * np.pi * frequency * self._middle
        a, b = self.sd * coefficients.T
        return np.column_stack([a * np.cos(turn) + b * np.sin(turn), b * np.cos(turn) - a * np.sin(turn)])


def mass(bounds: Floats, wave: Wave) -> Floats:
    """Probabilities of cells beforehand."""
    return np.diff(np.log(bounds)) / np.log(wave.high / wave.low)


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


@dataclass(frozen=True, eq=False)
class Given:
    """Whitened observations (r,) and columns of cells (r, 4, c) of each wave, where some waves are normal sums."""

    v: Floats
    cells: Sequence[Floats]

    def evidence(self, base: Floats, wave: int) -> Floats:
        """(c,) log evidence of all cells of a wave beside columns (r, b) that are there."""
        F = self.cells[wave]
        r, _, c = F.shape
        log, U = _orthogonal(base)
        T = (U.T.astype(self._F[wave].dtype) @ self._F[wave]).reshape(-1, 4, c)
        own = U.T @ self.v
        g = self._g[wave] - np.tensordot(own, T, axes=(0, 0)).astype(np.float64)
        G = self._G[wave]
        pairs = [(i, j) for i in range(4) for j in range(i + 1)]
        A = {(i, j): G[i, j] - np.einsum("bc,bc->c", T[:, i], T[:, j]) for i, j in pairs}
        return log + 0.5 * float(own @ own) + _evidence(A, [g[i] for i in range(4)])

    def __post_init__(self) -> None:
        G = [np.einsum("ric,rjc->ijc", F, F) for F in self.cells]
        g = [np.tensordot(self.v, F, axes=(0, 0)) for F in self.cells]
        fits = all(each.max(initial=0.0) < 1e5 for each in G)
        kind = np.float32 if fits else np.float64
        object.__setattr__(self, "_F", [F.reshape(len(F), -1).astype(kind) for F in self.cells])
        G = [(each + np.eye(4)[:, :, None]).astype(kind) for each in G]
        object.__setattr__(self, "_G", G)
        object.__setattr__(self, "_g", g)


def _orthogonal(base: Floats) -> tuple[float, Floats]:
    """−½ log det(1 + BᵀB), and U (…, r, b) with (1 + BBᵀ)⁻¹ = 1 − UUᵀ."""
    b = base.shape[-1]
    L = np.linalg.cholesky(np.eye(b) + np.swapaxes(base, -1, -2) @ base)
    U = np.swapaxes(np.linalg.solve(L, np.swapaxes(base, -1, -2)), -1, -2)
    return -np.log(np.einsum("...ii->...i", L)).sum(axis=-1), U


def _evidence(A: dict[tuple[int, int], Floats], g: list[Floats]) -> Floats:
    """−½ log det A + ½ gᵀA⁻¹g of symmetric matrices by their entries, by elimination; A and g are used up."""
    k = len(g)
    square, det = np.zeros_like(g[0]), np.ones_like(g[0])
    for i in range(k):
        pivot = A[i, i]
        det = det * pivot
        square = square + g[i] ** 2 / pivot
        for j in range(i + 1, k):
            ratio = A[j, i] / pivot
            g[j] = g[j] - ratio * g[i]
            for m in range(i + 1, j + 1):
                A[j, m] = A[j, m] - ratio * A[m, i]
    return np.asarray(0.5 * square - 0.5 * np.log(det))


@dataclass(frozen=True, eq=False)
class Found:
    """N frequencies of each wave (N, w), and what they are worth.

    Attributes
    ----------
    evidence : log of it, over that of no wave.
    effective : number of independent draws that weights leave, of those that were weighed.
    """

    frequency: Floats
    evidence: float
    effective: float


def draw(
    v: Floats, waves: Sequence[Wave], count: int, random: np.random.Generator, follow=(FIRST, PAIRS, WHOLE)
) -> Found:
    """Draws of all waves given whitened observations v (r,), with noise of variance one and nothing else."""
    bounds = [wave.cells for wave in waves]
    cells = [wave.of_cells(each) for wave, each in zip(waves, bounds, strict=True)]
    prior = [np.log(mass(each, wave)) for wave, each in zip(waves, bounds, strict=True)]
    cells_, log_weight = _combinations(v, cells, prior, random, follow)
    return _within(v, waves, bounds, cells, prior, cells_, log_weight, count, random)


def _combinations(
    v: Floats, cells: Sequence[Floats], prior: Sequence[Floats], random: np.random.Generator, follow
) -> tuple[Ints, Floats]:
    """Cells (P, w) of whole combinations, and their log weights."""
    w = len(cells)
    first, pairs, whole = follow
    # covariance of each wave beforehand, by its middles
    sums = []
    for F, p in zip(cells, prior, strict=True):
        own = F[:, :, :2] * np.exp(0.5 * p)[:, None, None]
        r = own.shape[1]
        own = own.transpose(1, 0, 2).reshape(r, -1)
        sums.append(own @ own.T)

    def given(absent: tuple[int, ...]) -> tuple[Given, float]:
        K = np.eye(len(v)) + sum((sums[i] for i in absent), np.zeros((len(v), len(v))))
        L = np.linalg.cholesky(K)
        turned = []
        for i, F in enumerate(cells):
            if i in absent:
                turned.append(np.zeros((len(v), 4, 0)))
                continue
            c, r, _ = F.shape
            flat = np.ascontiguousarray(F.transpose(1, 2, 0)).reshape(r, -1)
            turned.append(np.linalg.solve(L, flat).reshape(r, 4, c))
        x = np.linalg.solve(L, v)
        return Given(x, turned), float(0.5 * (x @ x) - np.log(np.diag(L)).sum())

    none = np.zeros((len(v), 0))
    start = []  # of each wave: chosen cells and the probability with which
    for i in range(w):
        beside, _ = given(tuple(j for j in range(w) if j != i))
        log = beside.evidence(none, i) + prior[i]
        at, p = chosen(TEMPER * log, first, random)
        full = np.zeros(len(prior[i]))
        full[at] = p
        start.append((at, full, log))
    if w == 1:
        log = start[0][2]
        at, p = chosen(log, whole, random)
        return at[:, None], log[at] - np.log(p)
    found: dict[tuple[int, ...], list[float]] = {}
    if w == 2:
        whole_pairs = [(0, 1)]
    else:
        whole_pairs = list(combinations(range(w), 2))
    rows_all, logs_all, probs_all = [], [], []
    last, last_log = given(())
    for i, j in whole_pairs:
        beside, log0 = given(tuple(k for k in range(w) if k not in (i, j)))
        entries, logs = [], []
        ci, cj = len(prior[i]), len(prior[j])
        for a, b, flip in ((i, j, False), (j, i, True)):
            at = start[a][0]
            for one in at.tolist():
                log = beside.evidence(np.ascontiguousarray(beside.cells[a][:, :, one]), b) + prior[a][one] + prior[b]
                other = np.arange(len(prior[b]))
                if flip:  # those that start from the other wave are there already
                    keep = start[b][1] == 0
                    other, log = other[keep], log[keep]
                pa, pb = start[a][1][one], start[b][1][other]
                pi = 1 - (1 - pa) * (1 - pb)
                entries.append(np.column_stack([np.full(len(other), one), other])[:, :: -1 if flip else 1])
                logs.append(np.stack([log, np.log(pi)]))
        entry, log = np.concatenate(entries), np.concatenate(logs, axis=1)
        if w == 2:
            at, p = chosen(log[0] - log[1], whole, random)
            return entry[at], log[0][at] - log[1][at] - np.log(p)
        at, p = chosen(TEMPER * log[0] - log[1], pairs, random)
        k = 3 - i - j
        for row, pr in zip(entry[at], np.exp(log[1][at]) * p, strict=True):
            base = np.concatenate([last.cells[i][:, :, row[0]], last.cells[j][:, :, row[1]]], axis=1)
            logk = last.evidence(base, k) + prior[i][row[0]] + prior[j][row[1]] + prior[k]
            best, pk = chosen(logk, EACH, random)
            rows = np.empty((len(best), 3), dtype=np.int64)
            rows[:, i], rows[:, j], rows[:, k] = row[0], row[1], best
            rows_all.append(rows)
            logs_all.append(logk[best])
            probs_all.append(pr * pk)
    rows, logs, probs = np.concatenate(rows_all), np.concatenate(logs_all), np.concatenate(probs_all)
    rows, log, share = _united(rows, logs, 1 / (3 * probs), probs > 0.999)
    looked: set[tuple[int, ...]] = set()
    for _ in range(ROUNDS):
        heavy = np.argsort(log + np.log(share))[::-1][:NEAR]
        new = []
        least = log.max() - _NEAR
        for row in rows[heavy]:
            for k in range(w):
                pair = (*(int(row[i]) if i != k else -1 for i in range(w)),)
                if pair in looked:
                    continue
                looked.add(pair)
                others = [i for i in range(w) if i != k]
                base = np.concatenate([last.cells[i][:, :, row[i]] for i in others], axis=1)
                logk = last.evidence(base, k) + prior[k] + sum(prior[i][row[i]] for i in others)
                best = np.flatnonzero(logk > least)
                more = np.repeat(row[None], len(best), axis=0)
                more[:, k] = best
                new.append((more, logk[best]))
        if not new:
            break
        count = len(rows)
        rows = np.concatenate([rows, *(each for each, _ in new)])
        log = np.concatenate([log, *(each for _, each in new)])
        share = np.append(share, np.ones(len(rows) - count))
        rows, log, share = _united(rows, log, share, np.arange(len(rows)) >= count)
    log = log + np.log(share)
    kept, p = chosen(log, whole, random)
    return rows[kept], log[kept] - np.log(p)


def _united(rows: Ints, log: Floats, share: Floats, certain) -> tuple[Ints, Floats, Floats]:
    """Each row once, with all that its copies stand for; of what was certain to be found with itself."""
    different, at, index = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    index = index.ravel()
    total = np.bincount(index, share)
    total[index[certain]] = 1.0
    return different, log[at], total


def _within(v, waves, bounds, cells, prior, which, log_weight, count, random) -> Found:
    """Frequencies within cells, weighed, and coefficients."""
    w = len(waves)
    top = log_weight.max()
    weight = np.exp(log_weight - top)
    total = float(np.log(weight.sum()) + top)
    at = systematic(weight / weight.sum(), count, random)
    f, log = np.empty((count, w)), np.empty(count)
    for begin in range(0, count, _BLOCK):
        part = slice(begin, begin + _BLOCK)
        f[part], log[part] = _fine(v, waves, bounds, cells, which[at[part]], random)
    weights = np.exp(log - log.max())
    evidence = total + float(np.log(weights.mean()) + log.max())
    again = systematic(weights / weights.sum(), count, random)
    f = f[again]
    random.shuffle(f)
    return Found(f, evidence, float(weights.sum() ** 2 / (weights**2).sum()))


def evidence_of(v: Floats, waves: Sequence[Wave], frequency: Floats) -> Floats:
    """(N,) log of the evidence of frequencies (N, w), over that of no wave."""
    found = np.empty(len(frequency))
    for part, base in _columns(waves, frequency):
        log, U = _orthogonal(base)
        found[part] = log + 0.5 * np.sum((v @ U) ** 2, axis=-1)
    return found


def coefficients_given(v: Floats, waves: Sequence[Wave], frequency: Floats, random: np.random.Generator) -> Floats:
    """(N, 2w) exact draws of the amplitudes of sine and cosine, mm, at frequencies (N, w)."""
    w = len(waves)
    found = np.empty((len(frequency), 2 * w))
    for part, base in _columns(waves, frequency):
        L = np.linalg.cholesky(np.eye(2 * w) + np.swapaxes(base, 1, 2) @ base)
        normal = np.linalg.solve(L, (v @ base)[:, :, None]) + random.standard_normal((len(base), 2 * w, 1))
        found[part] = np.linalg.solve(np.swapaxes(L, 1, 2), normal)[:, :, 0]
    turned = [wave.at_origin(frequency[:, i], found[:, 2 * i : 2 * i + 2]) for i, wave in enumerate(waves)]
    return np.hstack(turned)


def _columns(waves: Sequence[Wave], frequency: Floats) -> Iterator[tuple[slice, Floats]]:
    """Columns (…, r, 2w) of frequencies (N, w), block by block."""
    for begin in range(0, len(frequency), _BLOCK):
        part = slice(begin, begin + _BLOCK)
        yield part, np.concatenate([wave.columns(frequency[part, i]) for i, wave in enumerate(waves)], axis=2)


def _fine(v, waves, bounds, cells, which, random) -> tuple[Floats, Floats]:
    """Frequencies (P, w) in cells (P, w), and the log of their evidence over that of the cells and of how they were drawn."""
    P, w = which.shape
    columns = [cells[i][which[:, i]] for i in range(w)]
    base = np.concatenate(columns, axis=2)
    log0, U = _orthogonal(base)
    own = v @ U
    of_cells = log0 + 0.5 * np.sum(own**2, axis=-1)
    f, log_q = np.empty((P, w)), np.zeros(P)
    last = np.zeros(P)
    for i in random.permutation(w).tolist():
        low, high = bounds[i][which[:, i]], bounds[i][which[:, i] + 1]
        steps = (np.arange(FINE) + random.random((P, 1))) / FINE
        at = low[:, None] + steps * (high - low)[:, None]
        F = waves[i].columns(at)  # (P, FINE, r, 2)
        others = [columns[j] for j in range(w) if j != i]
        if others:
            log, U = _orthogonal(np.concatenate(others, axis=2))
        else:
            log, U = np.zeros(P), np.zeros((P, len(v), 0))
        T = np.einsum("prb,pfrk->pfbk", U, F, optimize=True)
        left = v @ U
        g = np.einsum("r,pfrk->pfk", v, F, optimize=True) - np.einsum("pb,pfbk->pfk", left, T)
        G = np.einsum("pfrk,pfrl->pfkl", F, F, optimize=True) - np.einsum("pfbk,pfbl->pfkl", T, T, optimize=True)
        A = {(0, 0): 1 + G[..., 0, 0], (1, 0): G[..., 1, 0], (1, 1): 1 + G[..., 1, 1]}
        each = _evidence(A, [g[..., 0], g[..., 1]]) - np.log(at)
        each += (log + 0.5 * np.sum(left**2, axis=-1))[:, None]
        top = each.max(axis=1)
        weight = np.exp(each - top[:, None])
        sums = np.cumsum(weight, axis=1)
        pick = (sums < random.random((P, 1)) * sums[:, -1:]).sum(axis=1).clip(max=FINE - 1)
        row = np.arange(P)
        f[:, i] = at[row, pick]
        chance = each[row, pick] - top - np.log(sums[:, -1])
        log_q += chance + np.log(FINE)
        log_q -= 0.0
        last = each[row, pick] + np.log(at[row, pick])
        log_q += np.log(at[row, pick]) + np.log(np.log(high / low)) - np.log(high - low)
        columns[i] = F[row, pick]
    return f, last - log_q - of_cells


def systematic(weight: Floats, count: int, random: np.random.Generator) -> Ints:
    """Indices (count,), each as often as its weight says."""
    marks = np.cumsum(weight)
    return np.searchsorted(marks / marks[-1], (np.arange(count) + random.random()) / count).clip(max=len(weight) - 1)
