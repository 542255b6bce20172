"""Marginal likelihoods of candidate explanations, alone and together, in closed form.

Everything enters linearly with a normal prior whose standard deviation is a multiple of the noise; what the model could absorb
is projected out. What the evidence is conditional on joins the covariance of the noise, each at a fixed size.
"""

from __future__ import annotations

from collections.abc import Collection, Container, Iterator, Sequence
from functools import cached_property

import numpy as np
import scipy

from cmm_uq.analysis.diagnosis.comparison import algebra
from cmm_uq.analysis.diagnosis.comparison.algebra import Precision, SigmaIntegral
from cmm_uq.analysis.diagnosis.comparison.conditional import (
    AMPLITUDES,
    ConditionedData,
    Conditioning,
    MemberGroup,
    Version,
    stack_members,
)
from cmm_uq.analysis.diagnosis.comparison.explanations import Explanation
from cmm_uq.analysis.diagnosis.noise import OFTEN, NoiseKind
from cmm_uq.base.points import Floats, Ints
from cmm_uq.base.values import dataclass, field, replace
from cmm_uq.machine.model.recorded import Display

_KEPT = 8_000_000  # numbers that are kept of what follows from what was given last

# columns of a member over those of what is given, from which on its principal axes are corrected for that
_CORRECTED = 3

_BLOCK, _COLUMNS = 150_000, 500  # numbers of a block that a processor's cache holds; columns weighed at a time


@dataclass(frozen=True, eq=False)
class CandidateComparison:
    """Explanations against "nothing is missing"."""

    observed: Floats  # (m,) observations over their noise scale, mm
    baseline: Floats  # (m, p) columns over their noise scale that may take any coefficient
    kinds: Sequence[NoiseKind]
    sigma: Floats  # sigma, log_sigma: (s,) grid of the noise, mm, and its log probability
    log_sigma: Floats
    explanations: Sequence[Explanation]  # candidates; columns in mm
    noise_scale: Floats  # (m,)
    # mm, the least that the noise may be; with it the largest coefficients are as large as physics allows
    least_noise: float
    # (m, c) what a certificate leaves open, for one standard deviation, in units of the noise
    certified: Floats = field(default_factory=lambda: np.zeros((0, 0)))
    display: Display | None = None  # steps to which all coordinates are rounded, where they matter
    often_heavy: float = OFTEN  # probability, beforehand, that recordings of which nothing is missing have heavy tails
    _best: dict[frozenset[Version], dict[int, tuple[float, Version]]] = field(default_factory=dict, init=False)
    _weighed: dict[frozenset[Version], ConditionedData] = field(default_factory=dict, init=False)

    @cached_property
    def reached(self) -> Floats:
        """(m, m − m') orthonormal basis of what the baseline reaches."""
        if not self.baseline.shape[1]:
            return np.zeros((len(self.observed), 0))
        length = np.linalg.norm(self.baseline, axis=0)
        U, s, _ = scipy.linalg.svd(self.baseline / np.where(length > 0, length, 1.0), full_matrices=False)
        return np.asarray(U[:, s > 1e-9 * s[0]], dtype=np.float64)

    def rest(self, columns: Floats) -> Floats:
        """What the baseline leaves of columns (m, b)."""
        return columns - self.reached @ (self.reached.T @ columns)

    def rest_of(self, change: Floats) -> Floats:
        """The same of changes (m, b) of the observations, mm."""
        return self.rest(change / self.noise_scale[:, None])

    @cached_property
    def left(self) -> Floats:
        """(m,) what the baseline leaves of the observations."""
        return self.rest(self.observed[:, None])[:, 0]

    @property
    def degrees_of_freedom(self) -> int:
        """m', how many observations that is worth."""
        return int(len(self.observed) - self.reached.shape[1])

    @cached_property
    def _stack(self) -> tuple[Floats, tuple[MemberGroup, ...]]:
        return stack_members(self.explanations, self.rest, self.noise_scale, self.least_noise, self.degrees_of_freedom)

    @cached_property
    def _where(self) -> dict[tuple[int, int], slice]:
        return {
            (int(i), int(j)): slice(int(start), int(start) + group.r)
            for group in self._stack[1]
            for i, j, start in zip(group.explanation, group.member, group.start, strict=True)
        }

    @cached_property
    def visible(self) -> frozenset[int]:
        return frozenset(i for i, _ in self._where)

    @cached_property
    def precisions(self) -> list[Precision]:
        return algebra.precisions(self.kinds, self.reached, self.certified)

    @property
    def _logs(self) -> Floats:
        return np.array([noise.log for noise in self.precisions])

    @cached_property
    def _blocks(self) -> list[Floats]:
        """Inner products (k, M, r, r) of each member's columns under each kind of noise, by group."""
        stack, groups = self._stack
        found = []
        for group in groups:
            columns = group.columns(stack)
            each = columns.T.reshape(-1, group.r, len(stack))
            blocks = np.empty((len(self.precisions), len(each), group.r, group.r))
            for block, noise in zip(blocks, self.precisions, strict=True):
                parts = np.array_split(columns, max(1, columns.shape[1] // _COLUMNS), axis=1)
                other = np.hstack([noise(part) for part in parts]).T.reshape(each.shape)
                block[:] = each @ other.transpose(0, 2, 1)
            found.append(blocks)
        return found

    @cached_property
    def _axes(self) -> list[tuple[Floats, Floats]]:
        """Strengths (k, M, r) of each member's principal axes, and these (k, M, r, r), by group."""
        return [algebra.eigen(blocks) for blocks in self._blocks]

    @cached_property
    def _left_weighed(self) -> Floats:
        """Precision times what the baseline leaves (k, m, 1), by kind of noise."""
        return self._by_noise(self.left[:, None])

    def _by_noise(self, columns: Floats) -> Floats:
        """Precision times columns (m, b), by kind of noise (k, m, b)."""
        return np.stack([noise(columns) for noise in self.precisions])

    @cached_property
    def squares(self) -> Floats:
        """Sum of squares (k,) of what the baseline leaves, mm², whitened by each kind of noise."""
        return np.asarray(self._left_weighed[:, :, 0] @ self.left, dtype=np.float64)

    @cached_property
    def _integral(self) -> SigmaIntegral:
        return SigmaIntegral(self.sigma, self.log_sigma, self.degrees_of_freedom, float(self.left @ self.left))

    def integrated(self, squares: Floats) -> Floats:
        """Log evidence of sums of squares under one kind of noise, mm², which are overwritten, its size integrated out."""
        return self._integral(squares)

    def of_nothing(self, data: Floats) -> Floats:
        """Log evidence (k, b) of nothing beyond the baseline, by kind of noise, for data (m, b)."""
        known = self._weigh(data, ())
        return np.asarray(self._integral(known.squares.copy()) + known.log[:, None], dtype=np.float64)

    def only(self, kinds: Sequence[int]) -> CandidateComparison:
        found = self.under([self.kinds[k] for k in kinds], self.left)
        index = list(kinds)
        found.__dict__["precisions"] = [self.precisions[k] for k in index]
        found.__dict__["_blocks"] = [blocks[index] for blocks in self._blocks]
        return found

    def under(self, kinds: Sequence[NoiseKind], left: Floats) -> CandidateComparison:
        """The same candidates for what the baseline leaves (m,) of other observations, under other kinds of noise."""
        found = replace(self, observed=left, kinds=kinds)
        shared = {name: getattr(self, name) for name in ("reached", "_stack", "_where", "_integral", "visible")}
        found.__dict__.update(shared, left=left)  # what none of the two changes
        return found

    def noise_posterior(self, left: Floats | None = None) -> Floats:
        """Probability (kinds, s) of each kind and size of the noise, given what the baseline leaves (m,)."""
        every = self.squares if left is None else self._by_noise(left[:, None])[:, :, 0] @ left
        log = self._logs[:, None] + self.log_sigma - self.degrees_of_freedom * np.log(self.sigma)
        log -= 0.5 * every[:, None] / self.sigma**2
        return np.asarray(np.exp(log - scipy.special.logsumexp(log)), dtype=np.float64)

    def log_evidence(
        self, left: Floats | None = None, conditions: Sequence[Version] = (), among: Container[int] | None = None
    ) -> tuple[Floats, Floats]:
        """Log evidence (b,) of what is given, and (c, b) of each explanation beside it, for ``left`` (m, b)."""
        known = self._beside(left, conditions)
        return self._of_given(known), self._total(known, among)

    def _total(self, known: ConditionedData, among: Container[int] | None = None) -> Floats:
        """Log evidence (c, b) of each explanation, its versions and sizes summed."""
        total = np.full((len(self.explanations), known.squares.shape[1]), -np.inf)
        for group, each in self._each(known, among, sizes=False):
            gains = each[:, 0] - np.log(AMPLITUDES) + group.weight[:, None]
            chosen = group.explanation[group.first]
            total[chosen] = np.logaddexp(total[chosen], np.logaddexp.reduceat(gains, group.first, axis=0))
        return total

    def of_versions(self, index: int, conditions: Sequence[Version] = ()) -> tuple[Ints, Floats, Floats]:
        """Visible versions (v,) of an explanation, log evidence of each beside what is given, and its log weight."""
        found = [
            (group.member, scipy.special.logsumexp(cube[:, :, 0], axis=1), group.weight)
            for group, cube in self.each(None, conditions, (index,))
        ]
        if not found:
            return np.zeros(0, dtype=np.int64), np.zeros(0), np.zeros(0)
        member, evidence, weight = (np.concatenate(each) for each in zip(*found, strict=True))
        return member, evidence, weight

    def lengths(self, columns: Floats) -> Floats:
        """Sum of squares (k, b) of columns (m, b), of which the baseline has been taken, whitened by each kind of noise."""
        return np.asarray(np.einsum("mb,kmb->kb", columns, self._by_noise(columns)))

    def of_signal(self, signal: Floats, noise: Floats) -> Floats:
        """Log evidence (c, b) over nothing for signals (m, b) in noise (m,) at right angles: what one shows on average."""
        known = self._beside(signal, ())
        known = replace(known, squares=known.squares + self.lengths(noise[:, None]))
        return self._total(known) - self._of_given(known)

    def beside(
        self, conditions: Sequence[Version] = (), among: Collection[int] | None = None
    ) -> dict[int, tuple[float, Version]]:
        """Log evidence of each explanation beside what is given, at least of those wanted, and its best version."""
        known = self._best.setdefault(frozenset(conditions), {})
        if among is None or not known.keys() >= set(among):
            total = np.full(len(self.explanations), -np.inf)
            most, best = total.copy(), {}
            for group, cube in self.each(None, conditions, among):
                each = cube[:, :, 0]
                gains = algebra.log_sum_in(each.copy(), 1) - np.log(AMPLITUDES) + group.weight
                chosen = group.explanation[group.first]
                total[chosen] = np.logaddexp(total[chosen], np.logaddexp.reduceat(gains, group.first))
                largest = each.max(axis=1) + group.weight
                better = np.maximum.reduceat(largest, group.first) > most[chosen]
                order = np.lexsort((-largest, group.explanation))[group.first[better]]
                for m, a in zip(order.tolist(), each[order].argmax(axis=1).tolist(), strict=True):
                    i = int(group.explanation[m])
                    most[i] = largest[m]
                    best[i] = Version(i, int(group.member[m]), float(group.amplitudes[m, a]))
            found = {i: (float(total[i]), version) for i, version in best.items()}
            known.update(found if among is None else {i: found[i] for i in found.keys() & set(among)})
        return known

    def left_of(self, version: Version, conditions: Sequence[Version]) -> float:
        """Part of the squared visible length of a version that is left beside what is given."""
        columns = self._given.columns(version)
        alone, beside = (self._weigh(columns, others).squares.sum(axis=1) for others in ((), conditions))
        probability = self.noise_probability(conditions)
        return float(probability @ beside / max(float(probability @ alone), 1e-300))

    def log_evidence_of(self, conditions: Sequence[Version]) -> Floats:
        """Log evidence (1,) of what is given, at its size, for the recording."""
        return self._of_given(self._beside(None, conditions))

    def _of_given(self, known: ConditionedData) -> Floats:
        """Log evidence (b,) of what data are beside."""
        return algebra.log_sum(self._integral(known.squares.copy()) + known.log[:, None], 0)

    def noise_probability(self, conditions: Sequence[Version]) -> Floats:
        """Probability (kinds,) of each kind of noise, conditional on explanations at their sizes."""
        known = self._beside(None, conditions)
        log = self._integral(known.squares.copy())[:, 0] + known.log
        return np.asarray(np.exp(log - scipy.special.logsumexp(log)), dtype=np.float64)

    def each(
        self, data: Floats | None, conditions: Sequence[Version], among: Container[int] | None = None
    ) -> Iterator[tuple[MemberGroup, Floats]]:
        """Log evidence (M, a, b) of members at every size beside what is given, by groups; ``among`` are wanted at least."""
        yield from self._each(self._beside(data, conditions), among)

    def _each(
        self, known: ConditionedData, among: Container[int] | None, *, sizes: bool = True
    ) -> Iterator[tuple[MemberGroup, Floats]]:
        """Log evidence (M, a, b) of members at every size, or (M, 1, b) of all sizes together, by groups."""
        groups, b = self._stack[1], known.squares.shape[1]
        parts = [group.part(among) for group in groups]
        chosen = [group.only(part) for group, part in zip(groups, parts, strict=True)]
        most = 2 * sum(some.r * len(some.start) for some in chosen) > self._stack[0].shape[1]
        kept = known.made_of is not None and (most or self._given.kept(known))
        size = max(1, _BLOCK // (len(known.squares) * AMPLITUDES * b))
        for part, some, blocks, axes in zip(parts, chosen, self._blocks, self._axes, strict=True):
            if not len(some.start):
                continue
            kinds = len(known.squares)
            if kept:
                columns = some.where
                found = np.zeros((kinds, columns.stop - columns.start, known.width))
                found[:, :, :1] = self._left_with_all[:, columns]
                for basis, factor in known.made_of or ():
                    found += self._given.products(basis)[:, columns] @ factor
            else:
                found = (some.columns(self._stack[0]).T @ known.seen_by).reshape(some.r * len(some.start), kinds, -1)
                found = found.transpose(1, 0, 2)
            seen = found.reshape(kinds, len(some.start), some.r, -1)
            if sizes and (each := self._of_wide(known, some, axes, part, seen)) is not None:
                yield some, each
                continue
            total = np.empty((len(some.start), AMPLITUDES if sizes else 1, b))
            for begin in range(0, len(total), size):
                these = slice(begin, begin + size)
                if known.width > b:
                    strengths, turn = algebra.eigen(blocks[:, part][:, these] - algebra.squared(seen[:, these, :, b:]))
                else:
                    strengths, turn = (each[:, part][:, these] for each in axes)
                total[these] = self._under(known, some.amplitudes[these], strengths, turn, seen[:, these, :, :b], sizes)
            yield some, total

    def _of_wide(
        self, known: ConditionedData, group: MemberGroup, axes: tuple[Floats, Floats], part: slice, seen: Floats
    ) -> Floats | None:
        """As :meth:`_under`, where members have far more columns than what is given beside the recording; else ``None``."""
        given = seen.shape[3] - 1
        if known.squares.shape[1] > 1 or not given or group.r < _CORRECTED * given:
            return None
        strengths, turn = (each[:, part] for each in axes)
        variance = (group.amplitudes**2)[:, :, None]
        ratio = variance * np.maximum(strengths, 1e-300)[:, :, None, :]  # (k, M, a, r)
        gains = algebra.woodbury(variance / (1 + ratio), turn.swapaxes(2, 3) @ seen)
        if gains is None:
            return None
        explained, log = gains
        found = self._integral(known.squares[:, None, None, 0] - explained)
        found += known.log[:, None, None] - 0.5 * np.log1p(ratio).sum(axis=3) - log
        return algebra.log_sum_in(found, 0)[..., None]

    def _under(
        self, known: ConditionedData, amplitudes: Floats, strengths: Floats, turn: Floats, shown: Floats, sizes: bool
    ) -> Floats:
        """Log evidence (M, a, b) of members with r columns, summed over the kinds of noise, or (M, 1, b) over the sizes too.

        ``amplitudes`` (M, a) to try; ``strengths`` (k, M, r) and ``turn`` (k, M, r, r) of their principal axes; ``shown``
        (k, M, r, b) their inner products with the data.
        """
        b = known.squares.shape[1]
        if strengths.shape[2] > 1:
            shown = turn.swapaxes(2, 3) @ shown
        variance = (amplitudes**2)[:, :, None]
        ratio = variance * np.maximum(strengths, 1e-300)[:, :, None, :]  # (k, M, a, r)
        gain, square = variance / (1 + ratio), shown**2
        constant = known.log[:, None, None] - 0.5 * np.einsum("kmar->kma", np.log1p(ratio))
        log = self._integral.beside(known.squares, gain, square, constant, sizes=sizes)
        return log.reshape(len(amplitudes), -1, b)

    def _beside(self, data: Floats | None, conditions: Sequence[Version]) -> ConditionedData:
        """Data (m, b), the recording's by default, weighed by each kind of noise and what is given."""
        if data is not None:
            return self._weigh(data, conditions)
        kept, key = self._weighed, frozenset(conditions)
        if key not in kept:
            new = self._weigh(None, conditions)
            most = max(1, _KEPT // (len(new.squares) * len(self.left) * new.width))
            while len(kept) >= most:
                del kept[next(iter(kept))]
            kept[key] = new
        return kept[key]

    def _weigh(self, data: Floats | None, conditions: Sequence[Version]) -> ConditionedData:
        plain, weighed = (self.left[:, None], self._left_weighed) if data is None else (data, self._by_noise(data))
        return self._given.beside(conditions, plain, weighed, self._logs, own=data is None)

    @cached_property
    def _given(self) -> Conditioning:
        return Conditioning(self._stack[0], self._where, self._by_noise)

    @cached_property
    def _left_with_all(self) -> Floats:
        """Inner products (k, K, 1) of the stack's columns with what the baseline leaves."""
        return self._given.with_all(self._left_weighed)
