"""Marginal likelihoods of rival explanations, alone and together, in closed form.

Everything enters linearly with a normal prior whose standard deviation is a multiple of the noise, so that the evidence of
explanations depends on the data through one quadratic form; its integral over the noise is tabulated once, and the multiples
are summed over a grid. What the job's model could absorb is projected out.

Explanations that are *granted* join the covariance of the noise, at a given size. So the evidence of one more explanation
beside them needs nothing but the inner products of all columns, which are computed once.
"""

from __future__ import annotations

from collections.abc import Container, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, sparse, special

from cmm_uq.mismatch.explanations import Explanation
from cmm_uq.mismatch.noise import Kind
from cmm_uq.points import Floats, Ints

AMPLITUDES = 7
_SMALLEST = 0.4
"""Smallest rms of an explanation that is considered, over the noise."""

_ABSORBED = 1e-5
"""Part of its length below which a column is the baseline's own."""

_BLOCK, _COLUMNS = 1_500_000, 500


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
        """Their columns (m, M·r), one after the other."""
        return stack[:, int(self.start[0]) : int(self.start[-1]) + self.r]

    @cached_property
    def first(self) -> Ints:
        """Where each explanation's members begin; they follow one another."""
        return np.flatnonzero(np.diff(self.explanation, prepend=-1))

    def part(self, among: Container[int] | None) -> slice:
        """Members from the first to the last of some explanations; all by default."""
        if among is None:
            return slice(None)
        chosen = [k for k, i in enumerate(self.explanation[self.first].tolist()) if i in among]
        if not chosen:
            return slice(0, 0)
        ends = np.append(self.first[1:], len(self.explanation))
        return slice(int(self.first[chosen[0]]), int(ends[chosen[-1]]))

    def only(self, part: slice) -> _Group:
        """The group of some members."""
        if part == slice(None):
            return self
        return _Group(
            self.explanation[part],
            self.member[part],
            self.weight[part],
            self.start[part],
            self.amplitudes[part],
            self.r,
        )


@dataclass(frozen=True, eq=False)
class _Noise:
    """One kind of noise, what the baseline reaches projected out.

    The precision of what is left is WᵀW − rowsᵀ·rows, with the whitening W (m, m); ``log``, the log probability less that of
    the determinant.
    """

    whitening: sparse.csr_array
    rows: Floats
    log: float

    def __call__(self, columns: Floats) -> Floats:
        """Precision times columns (m, b)."""
        whole = self.whitening.T @ (self.whitening @ columns)
        return np.asarray(whole - self.rows.T @ (self.rows @ columns), dtype=np.float64)


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
    certified : (m, c) what a certificate leaves open, for one standard deviation, in units of the noise.
    """

    observed: Floats
    baseline: Floats
    kinds: Sequence[Kind]
    sigma: Floats
    log_sigma: Floats
    explanations: Sequence[Explanation]
    noise_scale: Floats
    least_noise: float
    certified: Floats = field(default_factory=lambda: np.zeros((0, 0)))

    @cached_property
    def _reached(self) -> Floats:
        """(m, m − m') orthonormal basis of what the baseline reaches."""
        if not self.baseline.shape[1]:
            return np.zeros((len(self.observed), 0))
        length = np.linalg.norm(self.baseline, axis=0)
        U, s, _ = linalg.svd(self.baseline / np.where(length > 0, length, 1.0), full_matrices=False)
        return np.asarray(U[:, s > 1e-9 * s[0]], dtype=np.float64)

    def rest(self, columns: Floats) -> Floats:
        """What the baseline leaves of columns (m, b)."""
        return columns - self._reached @ (self._reached.T @ columns)

    @cached_property
    def left(self) -> Floats:
        """(m,) what the baseline leaves of the observations."""
        return self.rest(self.observed[:, None])[:, 0]

    @property
    def degrees_of_freedom(self) -> int:
        """m', how many observations that is worth."""
        return int(len(self.observed) - self._reached.shape[1])

    @cached_property
    def _stack(self) -> tuple[Floats, tuple[_Group, ...]]:
        """Columns (m, K) that the baseline leaves of all members, those with equally many together."""
        found: dict[int, list[tuple[int, int, float, Floats]]] = {}
        whole = [
            (owner, j, np.log(member.weight / total), member.columns / self.noise_scale[:, None])
            for owner, explanation in enumerate(self.explanations)
            for total in [sum(member.weight for member in explanation.members)]
            for j, member in enumerate(explanation.members)
        ]
        lefts = np.split(
            self.rest(np.hstack([columns for *_, columns in whole])),
            np.cumsum([columns.shape[1] for *_, columns in whole])[:-1], axis=1,
        ) if whole else []  # fmt: skip
        for (owner, j, log, columns), left in zip(whole, lefts, strict=True):
            if linalg.norm(left) > _ABSORBED * linalg.norm(columns):
                found.setdefault(columns.shape[1], []).append((owner, j, log, left))
        groups, stack, start = [], [np.zeros((len(self.observed), 0))], 0
        for r in sorted(found):
            chosen = found[r]
            rms = np.array([linalg.norm(left) for *_, left in chosen]) / np.sqrt(max(self.degrees_of_freedom, 1))
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

    def noise(self, kind: Kind, random: np.random.Generator, draws: int) -> Floats:
        """What the baseline leaves (m, draws) of noise of one kind, a reading's standard deviation being one."""
        found = kind.noise(random.standard_normal((len(self.observed), draws)))
        if self.certified.size:
            found += self.certified @ random.standard_normal((self.certified.shape[1], draws))
        return self.rest(found)

    @cached_property
    def _noises(self) -> list[_Noise]:
        found = []
        for kind in self.kinds:
            Q, R = np.linalg.qr(kind.white(self._reached))
            log = float(np.log(kind.probability)) + kind.log_factor + kind.log_whitening - _log_diagonal(R)
            rows = kind.whitening.T @ Q
            if self.certified.size:
                white = kind.white(self.certified)
                white -= Q @ (Q.T @ white)
                factor = np.linalg.cholesky(np.eye(white.shape[1]) + white.T @ white)
                log -= _log_diagonal(factor)
                certified = np.linalg.solve(factor, white.T)
                rows = np.hstack([rows, kind.whitening.T @ certified.T])
            found.append(_Noise(kind.whitening, np.asarray(rows.T, dtype=np.float64), log))
        return found

    @cached_property
    def _blocks(self) -> list[list[Floats]]:
        """Inner products (M, r, r) of each member's columns, by kind of noise and group."""
        stack, groups = self._stack
        found = []
        for noise in self._noises:
            blocks = []
            for group in groups:
                parts = np.array_split(group.columns(stack), max(1, len(group.start) * group.r // _COLUMNS), axis=1)
                other = np.hstack([noise(part) for part in parts]).T.reshape(-1, group.r, len(stack))
                each = group.columns(stack).T.reshape(-1, group.r, len(stack))
                blocks.append(each @ other.transpose(0, 2, 1))
            found.append(blocks)
        return found

    @cached_property
    def _left_weighed(self) -> list[Floats]:
        """Precision times what the baseline leaves (m, 1), by kind of noise."""
        return [noise(self.left[:, None]) for noise in self._noises]

    @cached_property
    def squares(self) -> Floats:
        """Sum of squares of what the baseline leaves, mm², whitened by each kind of noise."""
        return np.array([float(self.left @ weighed[:, 0]) for weighed in self._left_weighed])

    @cached_property
    def _weighed(self) -> dict[tuple[int, int], list[Floats]]:
        """Precision times the columns of members that were ever granted, by kind of noise."""
        return {}

    def over_sigma(self, squares: Floats) -> Floats:
        """Log of ∫ p(σ) σ^(−m') exp(−squares/2σ²) dσ, same shape, from a table over ln(squares)."""
        nodes, values = self._table
        return np.interp(np.log(np.maximum(squares, 1e-300)), nodes, values)

    @cached_property
    def _table(self) -> tuple[Floats, Floats]:
        nodes = np.linspace(-16.0, 8.0, 1500) + np.log(float(self.left @ self.left))
        exponent = (
            self.log_sigma - self.degrees_of_freedom * np.log(self.sigma) - 0.5 * np.exp(nodes)[:, None] / self.sigma**2
        )
        return nodes, np.asarray(special.logsumexp(exponent, axis=1), dtype=np.float64)

    def noise_posterior(self) -> Floats:
        """Probability (kinds, s) of each kind and size of the noise, given nothing beyond the baseline."""
        log = np.stack([
            noise.log + self.log_sigma - self.degrees_of_freedom * np.log(self.sigma)
            - 0.5 * squares / self.sigma**2
            for noise, squares in zip(self._noises, self.squares, strict=True)
        ])  # fmt: skip
        return np.asarray(np.exp(log - special.logsumexp(log)), dtype=np.float64)

    def log_evidence(
        self,
        left: Floats | None = None,
        granted: Sequence[Version] = (),
        among: Container[int] | None = None,
    ) -> tuple[Floats, Floats]:
        """Log evidence (b,) of what is granted, and (c, b) of each explanation beside it.

        Parameters
        ----------
        left : (m, b) data, by default the recording's.
        granted : explanations taken for granted.
        among : explanations that are wanted, by default all; of others the evidence may be minus infinity.
        """
        total = np.full((len(self.explanations), 1 if left is None else left.shape[1]), -np.inf)
        for group, each in self.each(left, granted, among):
            gains = special.logsumexp(each, axis=1) - np.log(AMPLITUDES) + group.weight[:, None]
            chosen = group.explanation[group.first]
            total[chosen] = np.logaddexp(total[chosen], np.logaddexp.reduceat(gains, group.first, axis=0))
        return self.log_evidence_of(granted, left), total

    def beside(
        self, granted: Sequence[Version] = (), among: Container[int] | None = None
    ) -> dict[int, tuple[float, Version]]:
        """Log evidence of each explanation beside what is granted, at least of those wanted, and its best version."""
        total = np.full(len(self.explanations), -np.inf)
        most, best = total.copy(), {}
        for group, cube in self.each(None, granted, among):
            each = cube[:, :, 0]
            gains = special.logsumexp(each, axis=1) - np.log(AMPLITUDES) + group.weight
            chosen = group.explanation[group.first]
            total[chosen] = np.logaddexp(total[chosen], np.logaddexp.reduceat(gains, group.first))
            largest = each.max(axis=1) + group.weight
            better = np.maximum.reduceat(largest, group.first) > most[chosen]
            order = np.lexsort((-largest, group.explanation))[group.first[better]]
            for m, a in zip(order.tolist(), each[order].argmax(axis=1).tolist(), strict=True):
                i = int(group.explanation[m])
                most[i] = largest[m]
                best[i] = Version(i, int(group.member[m]), float(group.amplitudes[m, a]))
        return {i: (float(total[i]), version) for i, version in best.items()}

    def best(self, left: Floats, explanations: Sequence[int]) -> list[Version]:
        """Version with most evidence among some visible explanations, for each column of data (m, b)."""
        found = [Version(0, 0, 0.0)] * left.shape[1]
        most = np.full(left.shape[1], -np.inf)
        for group, each in self.each(left, (), explanations):
            weight = np.where(np.isin(group.explanation, explanations), group.weight, -np.inf)
            flat = (each + weight[:, None, None]).reshape(-1, left.shape[1])
            at = flat.argmax(axis=0)
            for column in np.flatnonzero(flat.max(axis=0) > most):
                m, a = divmod(int(at[column]), AMPLITUDES)
                found[column] = Version(int(group.explanation[m]), int(group.member[m]), float(group.amplitudes[m, a]))
                most[column] = flat[at[column], column]
        return found

    def log_evidence_of(self, granted: Sequence[Version], left: Floats | None = None) -> Floats:
        """Log evidence (b,) of what is granted, at the size granted, for data (m, b)."""
        every = [self.over_sigma(known.squares) + known.log for known in self._beside(left, granted)]
        return np.asarray(special.logsumexp(np.stack(every), axis=0), dtype=np.float64)

    def each(
        self, data: Floats | None, granted: Sequence[Version], among: Container[int] | None = None
    ) -> Iterator[tuple[_Group, Floats]]:
        """Log evidence (M, a, b) of members at every size beside what is granted, by groups; ``among`` are wanted at least."""
        stack, groups = self._stack
        known = self._beside(data, granted)
        ends = np.cumsum([each.seen_by.shape[1] for each in known])[:-1]
        seen_by = np.hstack([each.seen_by for each in known])
        for index, group in enumerate(groups):
            part = group.part(among)
            chosen = group.only(part)
            if not len(chosen.start):
                continue
            seen = (chosen.columns(stack).T @ seen_by).reshape(len(chosen.start), group.r, -1)
            total = np.full((len(chosen.start), AMPLITUDES, len(known[0].squares)), -np.inf)
            for beside, blocks, its in zip(known, self._blocks, np.split(seen, ends, axis=2), strict=True):
                one = self._under(beside, chosen, blocks[index][part], its)
                np.logaddexp(total, one, out=total)
            yield chosen, total

    def _under(self, beside: _Beside, group: _Group, blocks: Floats, seen: Floats) -> Floats:
        """Log evidence (M, a, b) of a group's members under one kind of noise.

        Parameters
        ----------
        blocks : (M, r, r) their inner products.
        seen : (M, r, b + g) theirs with the data and with what is granted.
        """
        shown = seen[:, :, : len(beside.squares)]
        if seen.shape[2] > len(beside.squares):
            hidden = seen[:, :, len(beside.squares) :]
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

    def _beside(self, data: Floats | None, granted: Sequence[Version]) -> list[_Beside]:
        """Data (m, b), the recording's by default, weighed by each kind of noise and what is granted."""
        plain = self.left[:, None] if data is None else data
        columns = [version.amplitude * self._columns(version) for version in granted]
        taken = np.hstack(columns) if granted else None
        found = []
        for index, noise in enumerate(self._noises):
            weighed = self._left_weighed[index] if data is None else noise(data)
            squares = np.einsum("mb,mb->b", plain, weighed)
            if taken is None:
                found.append(_Beside(weighed, squares, noise.log))
                continue
            other = np.hstack([v.amplitude * self._weighed_columns(v)[index] for v in granted])
            factor = np.linalg.cholesky(np.eye(taken.shape[1]) + taken.T @ other)
            rows = np.linalg.solve(factor, other.T)
            seen = rows @ plain
            log = noise.log - _log_diagonal(factor)
            found.append(_Beside(np.hstack([weighed - rows.T @ seen, rows.T]), squares - np.sum(seen**2, axis=0), log))
        return found

    def _columns(self, version: Version) -> Floats:
        return self._stack[0][:, self._where[version.explanation, version.member]]

    def _weighed_columns(self, version: Version) -> list[Floats]:
        key = version.explanation, version.member
        if key not in self._weighed:
            self._weighed[key] = [noise(self._columns(version)) for noise in self._noises]
        return self._weighed[key]


def _log_diagonal(triangular: NDArray[np.floating[Any]]) -> float:
    return float(np.log(np.abs(np.diag(triangular))).sum())


@dataclass(frozen=True, eq=False)
class _Beside:
    """Data beside what is granted, under one kind of noise.

    ``seen_by`` (m, b + g): Σ⁻¹·data and the rows of what is granted, side by side; ``squares`` (b,) dataᵀ·Σ⁻¹·data; ``log``
    probability of this noise less that of its determinant.

    With Σ = N + C·Cᵀ and rows = chol(1 + CᵀN⁻¹C)⁻¹·CᵀN⁻¹, Σ⁻¹ = N⁻¹ − rowsᵀ·rows.
    """

    seen_by: Floats
    squares: Floats
    log: float
