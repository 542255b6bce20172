"""Marginal likelihoods of rival explanations, alone and together, in closed form.

Everything enters linearly with a normal prior whose standard deviation is a multiple of the noise, so that the evidence of
explanations depends on the data through one quadratic form; its integral over the noise is tabulated once, and the multiples
are summed over a grid. What the job's model could absorb is projected out.

Explanations that are *granted* join the covariance of the noise, at a given size. So the evidence of one more explanation
beside them needs nothing but the inner products of all columns, which are computed once.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import linalg, special

from cmm_uq.mismatch.explanations import Explanation
from cmm_uq.mismatch.noise import Kind
from cmm_uq.points import Floats, Ints

AMPLITUDES = 7
_SMALLEST = 0.4
"""Smallest rms of an explanation that is considered, over the noise."""

_ABSORBED = 1e-5
"""Part of its length below which a column is the baseline's own."""

_BLOCK = 1_500_000


@dataclass(frozen=True)
class Version:
    """One version of an explanation at one size.

    Parameters
    ----------
    explanation, member : which.
    amplitude : standard deviation of its coefficients, in units of the noise.
    """

    explanation: int
    member: int
    amplitude: float


@dataclass(frozen=True, eq=False)
class _Group:
    """Members with the same number of columns, r.

    ``explanation``, ``member`` (M,) say which; ``weight`` (M,) is the log probability of each within its explanation;
    ``start`` (M,) the first of its columns in the stack; ``amplitudes`` (M, a) the sizes to try.
    """

    explanation: Ints
    member: Ints
    weight: Floats
    start: Ints
    amplitudes: Floats
    r: int

    def columns(self, stack: Floats) -> Floats:
        """Their columns (m', M·r)."""
        first, last = int(self.start[0]), int(self.start[-1]) + self.r
        if last - first == len(self.start) * self.r:
            return stack[:, first:last]
        return stack[:, (self.start[:, None] + np.arange(self.r)).ravel()]

    def only(self, explanations: Sequence[int] | None) -> _Group:
        if explanations is None:
            return self
        chosen = np.isin(self.explanation, explanations)
        return _Group(
            self.explanation[chosen], self.member[chosen], self.weight[chosen], self.start[chosen],
            self.amplitudes[chosen], self.r,
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Whitened:
    """Under one kind of noise.

    ``factor`` (``None`` for one), ``stack`` (m', K), ``blocks`` (M, r, r) the inner products of each group's members, and
    ``log``, the logarithm of its probability less that of its determinant.
    """

    factor: Floats | None
    stack: Floats
    blocks: tuple[Floats, ...]
    log: float

    def of(self, data: Floats) -> Floats:
        """Data (m', b) in units of this noise."""
        return _white(self.factor, data)


@dataclass(frozen=True, eq=False)
class Comparison:
    """Explanations against "nothing is missing".

    Parameters
    ----------
    observed : (m,) observations over their noise scale, mm.
    baseline : (m, p) columns over their noise scale that may take any coefficient.
    kinds : of noise.
    sigma, log_sigma : (s,) grid of the noise, mm, and its log probability.
    explanations : rivals; columns in mm.
    noise_scale : (m,).
    least_noise : mm, the least that the noise may be; with it the largest coefficients are as large as physics allows.
    """

    observed: Floats
    baseline: Floats
    kinds: Sequence[Kind]
    sigma: Floats
    log_sigma: Floats
    explanations: Sequence[Explanation]
    noise_scale: Floats
    least_noise: float

    @cached_property
    def rest(self) -> Floats:
        """(m, m') orthonormal basis of what the baseline leaves."""
        if not self.baseline.shape[1]:
            return np.eye(len(self.observed))
        length = np.linalg.norm(self.baseline, axis=0)
        U, s, _ = linalg.svd(self.baseline / np.where(length > 0, length, 1.0), full_matrices=True)
        return np.asarray(U[:, int(np.sum(s > 1e-9 * s[0])) :], dtype=np.float64)

    @cached_property
    def left(self) -> Floats:
        """(m',) what the baseline leaves of the observations."""
        return self.rest.T @ self.observed

    @cached_property
    def _stack(self) -> tuple[Floats, tuple[_Group, ...]]:
        """Columns (m', K) that the baseline leaves of all members, those with equally many together."""
        found: dict[int, list[tuple[int, int, float, Floats]]] = {}
        whole = [
            (owner, j, np.log(member.weight / total), member.columns / self.noise_scale[:, None])
            for owner, explanation in enumerate(self.explanations)
            for total in [sum(member.weight for member in explanation.members)]
            for j, member in enumerate(explanation.members)
        ]
        lefts = np.split(
            self.rest.T @ np.hstack([columns for *_, columns in whole]),
            np.cumsum([columns.shape[1] for *_, columns in whole])[:-1], axis=1,
        ) if whole else []  # fmt: skip
        for (owner, j, log, columns), left in zip(whole, lefts, strict=True):
            if linalg.norm(left) > _ABSORBED * linalg.norm(columns):
                found.setdefault(columns.shape[1], []).append((owner, j, log, left))
        groups, stack, start = [], [np.zeros((self.rest.shape[1], 0))], 0
        for r in sorted(found):
            chosen = found[r]
            rms = np.array([linalg.norm(left) for *_, left in chosen]) / np.sqrt(max(self.rest.shape[1], 1))
            largest = 1 / self.least_noise
            smallest = np.minimum(_SMALLEST / rms, largest)
            amplitudes = largest * (smallest / largest)[:, None] ** np.linspace(0, 1, AMPLITUDES)
            explanation, member = (np.array([item[k] for item in chosen], dtype=np.int64) for k in (0, 1))
            weight = np.array([item[2] for item in chosen])
            starts = start + r * np.arange(len(chosen))
            groups.append(_Group(explanation, member, weight, starts, amplitudes, r))
            stack += [left for *_, left in chosen]
            start += r * len(chosen)
        return np.hstack(stack), tuple(groups)

    @cached_property
    def _where(self) -> dict[tuple[int, int], slice]:
        """Columns of the stack of each explanation's members."""
        return {
            (int(i), int(j)): slice(int(start), int(start) + group.r)
            for group in self._stack[1]
            for i, j, start in zip(group.explanation, group.member, group.start, strict=True)
        }

    @cached_property
    def visible(self) -> frozenset[int]:
        """Explanations of which the baseline leaves anything."""
        return frozenset(i for i, _ in self._where)

    @cached_property
    def factors(self) -> list[Floats | None]:
        """Lower triangular factor (m', m') of each kind's covariance; ``None`` where that is one."""
        return [
            None
            if np.array_equal(kind.correlation, np.eye(len(kind.correlation)))
            else np.asarray(linalg.cholesky(self.rest.T @ kind.correlation @ self.rest, lower=True))
            for kind in self.kinds
        ]

    @cached_property
    def _whitened(self) -> list[_Whitened]:
        stack, groups = self._stack
        found = []
        for kind, factor in zip(self.kinds, self.factors, strict=True):
            white = _white(factor, stack)
            blocks = []
            for group in groups:
                each = group.columns(white).reshape(len(white), -1, group.r).transpose(1, 2, 0)
                blocks.append(each @ each.transpose(0, 2, 1))
            found.append(_Whitened(factor, white, tuple(blocks), self._log_kind(kind, factor)))
        return found

    def _log_kind(self, kind: Kind, factor: Floats | None) -> float:
        """Log probability of a kind of noise, less the logarithm of its determinant."""
        determinant = 0.0 if factor is None else float(np.log(np.diag(factor)).sum())
        return float(np.log(kind.probability)) + kind.log_factor - determinant

    def over_sigma(self, squares: Floats) -> Floats:
        """Log of ∫ p(σ) σ^(−m') exp(−squares/2σ²) dσ, same shape, from a table over ln(squares)."""
        nodes, values = self._table
        return np.interp(np.log(np.maximum(squares, 1e-300)), nodes, values)

    @cached_property
    def _table(self) -> tuple[Floats, Floats]:
        nodes = np.linspace(-16.0, 8.0, 1500) + np.log(float(self.left @ self.left))
        exponent = self.log_sigma - len(self.left) * np.log(self.sigma) - 0.5 * np.exp(nodes)[:, None] / self.sigma**2
        return nodes, np.asarray(special.logsumexp(exponent, axis=1), dtype=np.float64)

    def noise_posterior(self) -> Floats:
        """Probability (kinds, s) of each kind and size of the noise, given nothing beyond the baseline."""
        log = np.stack([
            self._log_kind(kind, factor) + self.log_sigma - len(self.left) * np.log(self.sigma)
            - 0.5 * float(np.sum(_white(factor, self.left[:, None]) ** 2)) / self.sigma**2
            for kind, factor in zip(self.kinds, self.factors, strict=True)
        ])  # fmt: skip
        return np.asarray(np.exp(log - special.logsumexp(log)), dtype=np.float64)

    def log_evidence(
        self,
        left: Floats | None = None,
        granted: Sequence[Version] = (),
        explanations: Sequence[int] | None = None,
    ) -> tuple[Floats, Floats]:
        """Log evidence (b,) of what is granted, and (c, b) of each explanation beside it.

        Parameters
        ----------
        left : (m', b) data, by default the recording's.
        granted : explanations taken for granted.
        explanations : to consider, by default all; minus infinity for the others.
        """
        data = self.left[:, None] if left is None else left
        total = np.full((len(self.explanations), data.shape[1]), -np.inf)
        for group, each in self.each(data, granted, explanations):
            gains = special.logsumexp(each, axis=1) - np.log(AMPLITUDES) + group.weight[:, None]
            for explanation, gain in zip(group.explanation, gains, strict=True):
                total[explanation] = np.logaddexp(total[explanation], gain)
        return self.log_evidence_of(granted, data), total

    def beside(
        self, granted: Sequence[Version] = (), explanations: Sequence[int] | None = None
    ) -> dict[int, tuple[float, Version]]:
        """Log evidence of each explanation beside what is granted, and its best version."""
        found: dict[int, tuple[float, Version]] = {}
        best: dict[int, float] = {}
        for group, cube in self.each(self.left[:, None], granted, explanations):
            each = cube[:, :, 0]
            gains = special.logsumexp(each, axis=1) - np.log(AMPLITUDES) + group.weight
            at = each.argmax(axis=1)
            for m, (i, j) in enumerate(zip(group.explanation.tolist(), group.member.tolist(), strict=True)):
                total = float(gains[m])
                if i in found:
                    total = float(np.logaddexp(found[i][0], total))
                if each[m, at[m]] >= best.get(i, -np.inf):
                    best[i] = float(each[m, at[m]])
                    found[i] = total, Version(i, j, float(group.amplitudes[m, at[m]]))
                else:
                    found[i] = total, found[i][1]
        return found

    def best(self, left: Floats, explanations: Sequence[int]) -> list[Version]:
        """Version with most evidence among some visible explanations, for each column of data (m', b)."""
        found = [Version(0, 0, 0.0)] * left.shape[1]
        most = np.full(left.shape[1], -np.inf)
        for group, each in self.each(left, (), explanations):
            flat = each.reshape(-1, left.shape[1])
            at = flat.argmax(axis=0)
            for column in np.flatnonzero(flat.max(axis=0) > most):
                m, a = divmod(int(at[column]), AMPLITUDES)
                found[column] = Version(int(group.explanation[m]), int(group.member[m]), float(group.amplitudes[m, a]))
                most[column] = flat[at[column], column]
        return found

    def log_evidence_of(self, granted: Sequence[Version], left: Floats | None = None) -> Floats:
        """Log evidence (b,) of what is granted, at the size granted, for data (m', b)."""
        data = self.left[:, None] if left is None else left
        every = [
            self.over_sigma(known.squares) + known.log
            for known in (self._beside(some, data, granted) for some in self._whitened)
        ]
        return np.asarray(special.logsumexp(np.stack(every), axis=0), dtype=np.float64)

    def each(
        self, data: Floats, granted: Sequence[Version], explanations: Sequence[int] | None = None
    ) -> Iterator[tuple[_Group, Floats]]:
        """Log evidence (M, a, b) of every member at every size beside what is granted, by groups of members."""
        _, groups = self._stack
        known = [self._beside(some, data, granted) for some in self._whitened]
        for index, group in enumerate(groups):
            chosen = group.only(explanations)
            if not len(chosen.start):
                continue
            position = (chosen.start - group.start[0]) // group.r
            total = np.full((len(position), AMPLITUDES, data.shape[1]), -np.inf)
            for white, beside in zip(self._whitened, known, strict=True):
                np.logaddexp(total, self._under(white, beside, chosen, white.blocks[index][position]), out=total)
            yield chosen, total

    def _under(self, white: _Whitened, beside: _Beside, group: _Group, blocks: Floats) -> Floats:
        """Log evidence (M, a, b) of a group's members under one kind of noise."""
        columns = group.columns(white.stack)
        shape = len(group.start), group.r
        shown = (columns.T @ beside.data).reshape(*shape, -1)  # (M, r, b)
        if beside.rows.shape[0]:
            hidden = (beside.rows @ columns).reshape(-1, *shape).transpose(1, 2, 0)
            blocks = blocks - hidden @ hidden.transpose(0, 2, 1)
        strengths, turn = (blocks[:, 0], None) if group.r == 1 else np.linalg.eigh(blocks)
        strengths = np.maximum(strengths, 1e-300)
        if turn is not None:
            shown = turn.transpose(0, 2, 1) @ shown
        ratio = group.amplitudes[:, :, None] ** 2 * strengths[:, None, :]  # (M, a, r)
        taken = group.amplitudes[:, :, None] ** 2 / (1 + ratio)
        found = np.empty((len(group.start), AMPLITUDES, shown.shape[2]))
        block = max(1, _BLOCK // (AMPLITUDES * shown.shape[2]))
        for begin in range(0, len(found), block):
            part = slice(begin, begin + block)
            squares = beside.squares - taken[part] @ shown[part] ** 2
            found[part] = self.over_sigma(squares)
        found += beside.log - 0.5 * np.log1p(ratio).sum(axis=2)[..., None]
        return found

    def _beside(self, white: _Whitened, data: Floats, granted: Sequence[Version]) -> _Beside:
        """Data whitened by one kind of noise and what is granted."""
        residual = white.of(data)
        squares = np.sum(residual**2, axis=0)
        if not granted:
            return _Beside(residual, np.zeros((0, len(residual))), squares, white.log)
        columns = np.hstack([v.amplitude * white.stack[:, self._where[v.explanation, v.member]] for v in granted])
        factor = np.linalg.cholesky(np.eye(columns.shape[1]) + columns.T @ columns)
        rows = np.linalg.solve(factor, columns.T)
        seen = rows @ residual
        log = white.log - float(np.log(np.diag(factor)).sum())
        return _Beside(residual - rows.T @ seen, rows, squares - np.sum(seen**2, axis=0), log)


def _white(factor: Floats | None, data: Floats) -> Floats:
    return data if factor is None else np.asarray(linalg.solve_triangular(factor, data, lower=True), dtype=np.float64)


@dataclass(frozen=True, eq=False)
class _Beside:
    """Data beside what is granted: what is left (m', b), the rows (g, m') that take it, its squares (b,), log determinant.

    With Σ = 1 + C·Cᵀ and rows = chol(1 + CᵀC)⁻¹·Cᵀ, Σ⁻¹ = 1 − rowsᵀ·rows.
    """

    data: Floats
    rows: Floats
    squares: Floats
    log: float
