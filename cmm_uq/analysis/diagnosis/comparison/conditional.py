"""Columns of all candidates side by side, and data conditional on some of them under each kind of noise."""

from __future__ import annotations

from collections.abc import Callable, Container, Sequence
from functools import cached_property

import numpy as np

from cmm_uq.analysis.diagnosis.comparison.explanations import Explanation
from cmm_uq.base.points import Floats, Ints
from cmm_uq.base.values import dataclass, field

AMPLITUDES = 7
_SMALLEST = 0.4  # smallest rms of an explanation that is considered, over the noise
_ABSORBED = 1e-5  # part of its length below which a column is the baseline's own


@dataclass(frozen=True)
class Version:
    explanation: int
    member: int
    amplitude: float  # standard deviation of its coefficients, in units of the noise


@dataclass(frozen=True, eq=False)
class MemberGroup:
    """Members with the same number of columns, r."""

    explanation: Ints  # explanation, member: (M,) say which
    member: Ints
    weight: Floats  # (M,) is the log probability of each within its explanation
    start: Ints  # (M,) the first of its columns in the stack
    amplitudes: Floats  # (M, a) the sizes to try
    r: int

    @property
    def where(self) -> slice:
        """Of their columns in the stack, one after the other."""
        return slice(int(self.start[0]), int(self.start[-1]) + self.r)

    def columns(self, stack: Floats) -> Floats:
        """Their columns (m, M·r), one after the other."""
        return stack[:, self.where]

    @cached_property
    def first(self) -> Ints:
        """Where each explanation's members begin; they follow one another."""
        return np.flatnonzero(np.concatenate([[True], self.explanation[1:] != self.explanation[:-1]]))

    def part(self, among: Container[int] | None) -> slice:
        """Members from the first to the last of some explanations; all by default."""
        if among is None:
            return slice(None)
        chosen = [part for i, part in self._parts if i in among]
        return slice(chosen[0].start, chosen[-1].stop) if chosen else slice(0, 0)

    @cached_property
    def _parts(self) -> list[tuple[int, slice]]:
        begin = self.first.tolist()
        ends = zip(self.explanation[self.first].tolist(), begin, [*begin[1:], len(self.explanation)], strict=True)
        return [(i, slice(*end)) for i, *end in ends]

    def only(self, part: slice) -> MemberGroup:
        if part == slice(None):
            return self
        own, numbers = (self.explanation[part], self.member[part]), (self.weight[part], self.start[part])
        return MemberGroup(*own, *numbers, self.amplitudes[part], self.r)


def stack_members(
    explanations: Sequence[Explanation], rest: Callable[[Floats], Floats], noise_scale: Floats, least_noise: float,
    degrees_of_freedom: int,
) -> tuple[Floats, tuple[MemberGroup, ...]]:  # fmt: skip
    """Columns (m, K) over the noise scale (m,) that the baseline leaves of all members, and their groups."""
    found: dict[int, list[tuple[int, int, float, Floats, float]]] = {}
    whole = [
        (owner, j, np.log(member.weight / total), member.columns)
        for owner, explanation in enumerate(explanations)
        for total in [sum(member.weight for member in explanation.members)]
        for j, member in enumerate(explanation.members)
    ]
    if not whole:
        return np.zeros((len(noise_scale), 0)), ()
    every = np.hstack([columns for *_, columns in whole]) / noise_scale[:, None]
    left, ends = rest(every), np.cumsum([columns.shape[1] for *_, columns in whole])
    begin = np.append(0, ends[:-1])
    lengths, of_whole = (np.sqrt(np.add.reduceat(np.sum(each**2, axis=0), begin)) for each in (left, every))
    for k in np.flatnonzero(lengths > _ABSORBED * of_whole).tolist():
        owner, j, log, columns = whole[k]
        member = owner, j, log, left[:, begin[k] : ends[k]], float(lengths[k])
        found.setdefault(columns.shape[1], []).append(member)
    groups, stack, start, largest = [], [np.zeros((len(noise_scale), 0))], 0, 1 / least_noise
    for r in sorted(found):
        chosen = found[r]
        rms = np.array([length for *_, length in chosen]) / np.sqrt(max(degrees_of_freedom, 1))
        smallest = np.minimum(_SMALLEST / rms, largest)
        amplitudes = largest * (smallest / largest)[:, None] ** np.linspace(0, 1, AMPLITUDES)
        owners, members = (np.array([item[k] for item in chosen], dtype=np.int64) for k in (0, 1))
        weight, starts = np.array([item[2] for item in chosen]), start + r * np.arange(len(chosen))
        groups.append(MemberGroup(owners, members, weight, starts, amplitudes, r))
        stack += [columns for *_, columns, _ in chosen]
        start += r * len(chosen)
    return np.hstack(stack), tuple(groups)


_WIDE = 30  # columns of a version from which on its principal axes are kept where it is given
_KEPT = 12_000_000  # numbers that are kept of the inner products of what was given last
# Observations over columns that are given, from which on it pays to make inner products of those that are kept
_FEW = 3

MemberKey = tuple[int, int]  # an explanation and its member
Basis = tuple[MemberKey, bool]  # a member, and whether it is seen along its principal axes in place of its columns


@dataclass(frozen=True, eq=False)
class ConditionedData:
    """Data beside what is given, under each of k kinds of noise.

    With Σ = N + C·Cᵀ and rows = root(1 + CᵀN⁻¹C)⁻¹·CᵀN⁻¹, any square root, Σ⁻¹ = N⁻¹ − rowsᵀ·rows.

    ``weighed`` (k, m, b) N⁻¹·data; ``rows`` (k, g, m) of what is given; ``seen`` (k, g, b) rows·data; ``squares`` (k,
    b) dataᵀ·Σ⁻¹·data; ``log`` (k,) probability of the noise less that of its determinant; ``made_of`` of the
    recording's own data beside few columns, how ``seen_by`` follows from what the members that are given are by
    themselves, besides N⁻¹·data: a factor (k, r, b + g) of each.
    """

    weighed: Floats
    rows: Floats
    seen: Floats
    squares: Floats
    log: Floats
    made_of: tuple[tuple[Basis, Floats], ...] | None = None

    @property
    def width(self) -> int:
        """How many columns of ``seen_by`` each kind of noise has, b + g."""
        return int(self.weighed.shape[2] + self.rows.shape[1])

    @cached_property
    def seen_by(self) -> Floats:
        """Of each kind Σ⁻¹·data and the rows, side by side (m, k·(b + g)): needed where no inner products are kept."""
        if not self.rows.shape[1]:
            return _flat(self.weighed)
        turned = self.rows.swapaxes(1, 2)
        return _flat(np.concatenate([self.weighed - turned @ self.seen, turned], axis=2))


@dataclass(frozen=True, eq=False)
class Conditioning:
    stack: Floats  # (m, K) columns of all members
    where: dict[MemberKey, slice]  # columns of the stack of each
    by_noise: Callable[[Floats], Floats]  # precision times columns (m, b), by kind of noise (k, m, b)
    _products: dict[Basis, Floats] = field(default_factory=dict)
    _axes: dict[MemberKey, tuple[Floats, Floats]] = field(default_factory=dict)
    # precision times columns (k, m, r) of members given
    _weighed: dict[MemberKey, Floats] = field(default_factory=dict)

    def beside(
        self, conditions: Sequence[Version], plain: Floats, weighed: Floats, log: Floats, *, own: bool
    ) -> ConditionedData:
        """Data (m, b), and (k, m, b) times each kind's precision, beside explanations at their sizes; ``log`` (k,)."""
        squares = np.einsum("mb,kmb->kb", plain, weighed)
        if not conditions:
            none = np.zeros((len(weighed), 0, len(plain)))
            return ConditionedData(weighed, none, none @ plain, squares, log, () if own else None)
        order, rows, mixing, logs = self._rows(conditions)
        seen = rows @ plain
        made_of = None
        if own and _FEW * mixing.shape[2] <= len(plain):
            mixed = mixing.swapaxes(1, 2)
            factor = np.concatenate([-(mixed @ seen), mixed], axis=2)
            columns = [self.columns(version).shape[1] for version in order]
            first = max(columns) >= _WIDE  # and then along its principal axes
            bases = [((v.explanation, v.member), first and i == 0) for i, v in enumerate(order)]
            made_of = tuple(zip(bases, np.split(factor, np.cumsum(columns)[:-1], axis=1), strict=True))
        return ConditionedData(weighed, rows, seen, squares - np.sum(seen**2, axis=1), log - logs, made_of)

    def columns(self, version: Version) -> Floats:
        """Of a version (m, r), for coefficients of one."""
        return self.stack[:, self.where[version.explanation, version.member]]

    def _rows(self, conditions: Sequence[Version]) -> tuple[list[Version], Floats, Floats, Floats]:
        """Versions as taken; rows (k, g, m); factors (k, g, r) of weighed columns or axes; half the determinant's log (k,).

        The widest comes first and by its principal axes, of which a search, that gives it again and again at several sizes,
        needs another length only; to what it leaves the others are added by Cholesky's factors.
        """
        order = list(conditions)
        widest = max(order, key=lambda version: self.columns(version).shape[1])
        wide = self.columns(widest).shape[1]
        if wide < _WIDE:
            return order, *self._joined(order)
        order.remove(widest)
        strengths, axes = self._principal_axes(widest)
        ratio = widest.amplitude**2 * strengths
        lengths = (widest.amplitude / np.sqrt(1 + ratio))[:, :, None]
        rows, logs, mixing = lengths * axes, 0.5 * np.log1p(ratio).sum(axis=1), lengths * np.eye(wide)
        if not order:
            return [widest], rows, mixing, logs
        more, mixed, own = self._joined(order, rows)
        whole = np.concatenate([mixing, np.zeros((*mixing.shape[:2], mixed.shape[2] - wide))], axis=2)
        mixed[:, :, :wide] = mixed[:, :, :wide] @ mixing
        both = (np.concatenate(pair, axis=1) for pair in ((rows, more), (whole, mixed)))
        return [widest, *order], *both, logs + own

    def _joined(self, conditions: Sequence[Version], rows: Floats | None = None) -> tuple[Floats, Floats, Floats]:
        """Rows (k, g, m) of versions beside rows (k, h, m), what they are made of (k, g, h + g), and half the logarithm."""
        taken = np.hstack([version.amplitude * self.columns(version) for version in conditions])
        weighed = np.concatenate([v.amplitude * self._weighed_columns(v) for v in conditions], axis=2)
        before = np.zeros((len(weighed), 0, taken.shape[1]))
        if rows is not None:
            before = rows @ taken
            weighed = weighed - rows.swapaxes(1, 2) @ before
        factor = np.linalg.cholesky(np.eye(taken.shape[1]) + taken.T @ weighed)
        inverse = np.linalg.inv(factor)
        sizes = np.concatenate([np.full(self.columns(v).shape[1], v.amplitude) for v in conditions])
        mixing = np.concatenate([-inverse @ before.swapaxes(1, 2), inverse * sizes], axis=2)
        logs = np.log(np.diagonal(factor, axis1=1, axis2=2)).sum(axis=1)
        return inverse @ weighed.swapaxes(1, 2), mixing, logs

    def products(self, basis: Basis) -> Floats:
        """Inner products (k, K, r) of all columns with a member's weighed ones, or these along its principal axes."""
        kept = self._products
        if basis in kept:
            found = kept.pop(basis)
        else:
            version = Version(*basis[0], 1.0)
            turned = self._principal_axes(version)[1].swapaxes(1, 2) if basis[1] else self._weighed_columns(version)
            found = self.with_all(turned)
            while kept and sum(each.size for each in kept.values()) + found.size > _KEPT:
                del kept[next(iter(kept))]
        kept[basis] = found  # what was asked for last is at the end
        return found

    def with_all(self, columns: Floats) -> Floats:
        """Inner products (k, K, r) of the stack's columns with others (k, m, r)."""
        kinds, _, r = columns.shape
        return np.ascontiguousarray((self.stack.T @ _flat(columns)).reshape(-1, kinds, r).transpose(1, 0, 2))

    def kept(self, known: ConditionedData) -> bool:
        """Whether the inner products of all that is given are kept."""
        return known.made_of is not None and all(basis in self._products for basis, _ in known.made_of)

    def _principal_axes(self, version: Version) -> tuple[Floats, Floats]:
        """Eigenvalues (k, r) of a version's inner products by kind of noise, and its weighed columns along them (k, r, m)."""
        key = version.explanation, version.member
        if key not in self._axes:
            weighed = self._weighed_columns(version)
            strengths, turn = np.linalg.eigh(self.columns(version).T @ weighed)
            self._axes[key] = np.maximum(strengths, 0.0), turn.swapaxes(1, 2) @ weighed.swapaxes(1, 2)
        return self._axes[key]

    def _weighed_columns(self, version: Version) -> Floats:
        key = version.explanation, version.member
        if key not in self._weighed:
            self._weighed[key] = self.by_noise(self.columns(version))
        return self._weighed[key]


def _flat(columns: Floats) -> Floats:
    """Columns (k, m, b) of all kinds of noise side by side (m, k·b)."""
    return np.ascontiguousarray(columns.transpose(1, 0, 2)).reshape(columns.shape[1], -1)
