"""What moves the points of a measured part: each cause with its draws, linear in them, and its name in the budget.

A cause is displacements of all points for one unit of each of its coefficients, and draws of these together. What points have
in common (a tip, a temperature, the machine) is one coefficient, so that it is as common in every characteristic. A
coefficient may be any function of what is not known, such as the product of an expansion coefficient and a temperature.
Displacements are of measured points in the frame of the part, about their mean: *indicated = true − e*.

Components of random fields on many points come without the covariance of each with each: a pivoted Cholesky decomposition
(Harbrecht, Peters, Schneider 2012, Appl. Numer. Math. 62, 428) asks for one column of the covariance after the other, always
that of the point of which most is left, and ends when nothing is. A smooth field has far fewer components than points.

Causes that move each point on its own, of features of thousands of points, are condensed to as few numbers as characteristics
are of. Where only the values of a feature are asked for, these follow to first order from the displacements of all its points,
so that their joint normal distribution is drawn and not the points. Where a form or a zone is of the points themselves, they
are moved along their normals: a displacement across the normal changes a distance from the surface in second order.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike

from cmm_uq.analysis.parts.plan import Plan
from cmm_uq.base.messages import Text
from cmm_uq.base.points import Floats, Ints
from cmm_uq.base.values import dataclass, field, replace

LARGE = 1000  # points of a feature from which on its points are not drawn one coordinate after the other
_AT_ONCE = 1000  # rows of a table
_NOTHING = 1e-12  # part of the largest variance below which a component of a random field is rounding
_UNSEEN_MM = 1e-11  # root mean square displacement for one unit of a coefficient below which a component is left out
_FACTORED = 32  # coefficients up to which no components are looked for; a field, one factor, has the fewest already
_ROUNDING = 1e-15  # of the largest, a square of components that is rounding
MANY = 1000  # points up to which the eigenvectors of the whole covariance are quickly found
_LEFT = 1e-7  # of the largest variance that may be left of a point's
_LEAST = 1e-6  # of the variance of a field's points that its least components may have together: a thousandth of u
HEIGHTS: Any = np.float32  # in which points of large features are raised: 1 µm is then off by 10⁻⁷ µm
Covariance = Callable[[slice], Floats]  # covariance (m, n) of some points with all n


@dataclass(frozen=True, eq=False)
class Rows:
    """Coefficients (N, K), rows of a table less its mean: what follows from them linearly needs following once a row of it.

    The difference is as large as the table, and is held by nobody.
    """

    table: Floats  # (M, K)
    mean: Floats  # (K,)
    rows: Ints  # (N,) of the table

    def __len__(self) -> int:
        return len(self.rows)

    def of(self, columns: Ints) -> Floats:
        """(N, k) of some coefficients."""
        found = self.table[np.ix_(self.rows, columns)]
        found -= self.mean[columns]
        return found

    def parts(self) -> Iterator[Floats]:
        """(m, K) of all rows of the table, some at a time."""
        return (self.table[i : i + _AT_ONCE] - self.mean for i in range(0, len(self.table), _AT_ONCE))

    def __array__(self, dtype: DTypeLike | None = None, copy: bool | None = None) -> Floats:
        found = self.table[self.rows]
        found -= self.mean
        return np.asarray(found, dtype=dtype)


Drawn = Floats | Rows  # coefficients (N, K)
Draw = Callable[[np.random.Generator, int], Drawn]  # coefficients of so many draws


@dataclass(frozen=True, eq=False, kw_only=True)
class PartCause(ABC):
    """What moves points in proportion to coefficients."""

    name: str  # of the cause: ``machine``, ``stylus``, …
    factors: tuple[str, ...]  # K names in the budget, one a coefficient; those that share a name are one line of it
    draw: Draw  # of the coefficients, together
    named: Mapping[str, Text] = field(default_factory=dict)  # by factor, why it should be told beside the result

    @abstractmethod
    def through(self, derivative: Floats) -> Floats:
        """(K, p) change of p values for one unit of each coefficient, of their derivative (p, n, 3) by the points."""

    @abstractmethod
    def moved(self, coefficients: Floats, rows: slice) -> Floats:
        """(N, m, 3) displacements of m points for coefficients (N, K), mm."""

    def raised(self, coefficients: Floats, rows: slice, normals: Floats) -> Floats:
        """(N, m) of these along normals (m, 3), of seven digits at least; (N, 1) of zero where it moves none."""
        return np.asarray(np.einsum("nmi,mi->nm", self.moved(coefficients, rows), normals))


@dataclass(frozen=True, eq=False, kw_only=True)
class CommonCause(PartCause):
    basis: Floats  # (K, n, 3) displacements of the points for one unit of each coefficient, mm
    into: Floats | None = None  # (K, r) components of each coefficient, where ``basis`` is of r components

    def through(self, derivative: Floats) -> Floats:
        K, n, _ = self.basis.shape
        found = self.basis.reshape(K, 3 * n) @ derivative.reshape(len(derivative), 3 * n).T
        return np.asarray(found if self.into is None else self.into @ found)

    def moved(self, coefficients: Floats, rows: slice) -> Floats:
        part, acting = self.basis[:, rows], coefficients if self.into is None else coefficients @ self.into
        K, m, _ = part.shape
        return np.asarray((acting @ part.reshape(K, 3 * m)).reshape(len(coefficients), m, 3))

    def raising(self, rows: slice, normals: Floats) -> tuple[Floats, Floats]:
        """Factors (K, r) and (r, m) by which coefficients raise points along normals (m, 3), of those that do."""
        raised = np.einsum("kmi,mi->km", self.basis[:, rows], normals)
        acting = np.abs(raised).max(axis=1, initial=0.0) > 0
        return (np.eye(len(raised)) if self.into is None else self.into)[:, acting], raised[acting].astype(HEIGHTS)


@dataclass(frozen=True, eq=False, kw_only=True)
class PointScatter(PartCause):
    """What moves each coordinate of each point on its own: a coefficient a coordinate, in standard deviations."""

    size: Floats  # (n, 3) standard deviations along three axes, mm
    # (3, 3) unit vectors of these axes in the frame of the part, a row each
    turn: Floats = field(default_factory=lambda: np.eye(3))
    # draws (N, 3) of a factor on the size along each axis, common to all points; none where it is one
    scale: Draw | None = None

    @classmethod
    def of(
        cls, name: str, factor: str, size: Floats, turn: Floats | None = None, scale: Draw | None = None
    ) -> PointScatter:
        """A normal one; with draws (N, 3) of a factor on the size along each axis, common to all points, a mixture."""

        def draw(random: np.random.Generator, n: int) -> Floats:
            drawn = random.standard_normal((n, *size.shape))
            for axis, factor in enumerate([] if scale is None else np.asarray(scale(random, n)).T):
                drawn[:, :, axis] *= factor[:, None]
            return drawn.reshape(n, -1)

        axes = np.eye(3) if turn is None else turn
        return cls(name=name, factors=(factor,) * size.size, draw=draw, size=size, turn=axes, scale=scale)

    def through(self, derivative: Floats) -> Floats:
        return np.asarray(((derivative @ self.turn.T) * self.size).reshape(len(derivative), self.size.size).T)

    def moved(self, coefficients: Floats, rows: slice) -> Floats:
        along = coefficients.reshape(len(coefficients), -1, 3)[:, rows] * self.size[rows]
        return np.asarray((along.reshape(-1, 3) @ self.turn).reshape(along.shape))


def _few(heights: Floats) -> Floats:
    """(K, r) orthonormal, of which heights (K, m) are components, of as few as these have where they are many.

    Components show in a few random sums of the columns (Halko, Martinsson, Tropp 2011, SIAM Rev. 53, 217).
    """
    K, m = heights.shape
    sums = _FACTORED
    while 2 * sums < K:
        some = heights @ np.random.default_rng(0).standard_normal((m, sums))
        left, sizes, _ = np.linalg.svd(some, full_matrices=False)
        seen = sizes**2 > m * _UNSEEN_MM**2 + _ROUNDING * sizes[0] ** 2
        if not seen[-1]:
            return left[:, seen]
        sums *= 2
    return np.eye(K)


def normal(sd: ArrayLike) -> Draw:
    """Independent normal coefficients about zero of standard deviations (K,)."""
    each = np.asarray(sd, dtype=np.float64)
    return lambda random, n: np.multiply(drawn := random.standard_normal((n, len(each))), each, out=drawn)


def components(kernel: Floats) -> Floats:
    """(K, n) of a random field of covariance (n, n): times independent standard normal numbers they add up to it."""
    values, vectors = np.linalg.eigh(kernel)
    kept = values > _NOTHING * max(float(values[-1]), np.finfo(np.float64).tiny)
    return np.asarray((vectors[:, kept] * np.sqrt(values[kept])).T)


def field_along(name: str, factor: str, shapes: Floats, along: Floats) -> CommonCause:
    """A random field of components (K, n), mm, on the points along one direction (n, 3) of each."""
    draw = normal(np.ones(len(shapes)))
    return CommonCause(name=name, factors=(factor,) * len(shapes), draw=draw, basis=shapes[:, :, None] * along)


def field_components(covariance: Covariance, variances: Floats) -> Floats:
    """(K, n) of a random field on n points: times independent standard normal numbers they add up to it.

    ``variances``: (n,) of each point.
    """
    n = len(variances)
    if n <= MANY:
        return components(covariance(slice(None)))
    left, least = variances.copy(), _LEFT * float(variances.max())
    found, count = np.empty((64, n)), 0
    while count < n and left.max() > least:
        if count == len(found):
            found = np.concatenate([found, np.empty_like(found)])
        pivot = int(np.argmax(left))
        column = covariance(slice(pivot, pivot + 1))[0] - found[:count, pivot] @ found[:count]
        found[count] = column / np.sqrt(left[pivot])
        left -= found[count] ** 2
        left[pivot] = 0.0
        count += 1
    values, vectors = np.linalg.eigh(found[:count] @ found[:count].T)
    return np.asarray(vectors[:, np.cumsum(values) > _LEAST * values.sum()].T @ found[:count])


@dataclass(frozen=True, eq=False, kw_only=True)
class Rough(PartCause):
    """What moves each point of a feature on its own along its normal, in standard deviations."""

    along: Floats  # (m, 3) displacements of its points for one unit of each coefficient, mm
    rows: slice  # of these among the plan's points
    count: int  # of the plan's points

    def through(self, derivative: Floats) -> Floats:
        return np.asarray(np.einsum("pmi,mi->mp", derivative[:, self.rows], self.along))

    def moved(self, coefficients: Floats, rows: slice) -> Floats:
        start, stop, _ = rows.indices(self.count)
        found = np.zeros((len(coefficients), stop - start, 3))
        first, last = max(start, self.rows.start), min(stop, self.rows.stop)
        if first < last:
            own = slice(first - self.rows.start, last - self.rows.start)
            found[:, first - start : last - start] = coefficients[:, own, None] * self.along[own]
        return found


@dataclass(frozen=True, eq=False, kw_only=True)
class CondensedCause(PartCause):
    """A cause that moves each point on its own along a axes, by fewer coefficients."""

    vectors: Floats  # (a, n, 3) displacements of each point for one standard deviation along each axis, mm
    # (w,) rows of points that are moved along every axis: a coefficient an axis, of one point after the other
    whole: Ints
    single: Ints  # (s,) rows of points that are moved along their normals: then a coefficient each
    normals: Floats  # (n, 3) of all points
    sums: Floats  # (a, r, p) changes of what follows to first order from all other points: then r coefficients an axis
    scale: Draw | None  # draws (N, a) of factors on the sizes along the axes; none where these are one
    share: Floats  # (a, s) of the variance along each normal that is along each axis; (a, 1) where it is that of all points

    def through(self, derivative: Floats) -> Floats:
        p = len(derivative)
        along = np.einsum("pwi,awi->wap", derivative[:, self.whole], self.vectors[:, self.whole])
        normal = np.einsum("psi,si->sp", derivative[:, self.single], self.normals[self.single])
        axes, r = self.sums.shape[:2]
        return np.concatenate(
            [along.reshape(axes * len(self.whole), p), self._sizes[:, None] * normal, self.sums.reshape(axes * r, p)]
        )

    @cached_property
    def _sizes(self) -> Floats:
        """(s,) standard deviations along the normals, mm."""
        each = np.einsum("asi,si->as", self.vectors[:, self.single], self.normals[self.single])
        return np.asarray(np.sqrt(np.sum(each**2, axis=0)))

    def moved(self, coefficients: Floats, rows: slice) -> Floats:
        start, stop, _ = rows.indices(len(self.normals))
        a, w = len(self.vectors), len(self.whole)
        found = np.zeros((len(coefficients), stop - start, 3))
        own = np.flatnonzero((start <= self.whole) & (self.whole < stop))
        if len(own):
            each = coefficients[:, : a * w].reshape(len(coefficients), w, a)[:, own]
            found[:, self.whole[own] - start] = np.einsum("nwa,awi->nwi", each, self.vectors[:, self.whole[own]])
        raised, which = self._of_single(coefficients, rows)
        found[:, which - start] += raised[:, :, None] * self.normals[which]
        return found

    def raised(self, coefficients: Floats, rows: slice, normals: Floats) -> Floats:
        raised, which = self._of_single(coefficients, rows)
        if len(which) == len(normals):
            return raised
        if not len(which):
            return np.zeros((len(coefficients), 1))
        found = np.zeros((len(coefficients), len(normals)))
        found[:, which - rows.start] = raised
        return found

    def _of_single(self, coefficients: Floats, rows: slice) -> tuple[Floats, Ints]:
        start, stop, _ = rows.indices(len(self.normals))
        first, last = np.searchsorted(self.single, [start, stop]).tolist()
        skipped = len(self.vectors) * len(self.whole)
        own, sizes = coefficients[:, skipped + first : skipped + last], self._sizes[first:last]
        return own if (sizes == 1).all() else own * sizes.astype(own.dtype), self.single[first:last]


def together(causes: Sequence[PartCause]) -> list[PartCause]:
    """The same in distribution: sums of what moves each point on its own, along its normal and nothing else, as one cause."""
    alone = [one for one in causes if isinstance(one, CondensedCause) and len(one.single) == len(one.factors)]
    if len(alone) < 2:
        return list(causes)
    first, squares = alone[0], [one._sizes**2 for one in alone]
    squares = [square if np.ptp(square) else square[:1] for square in squares]

    def draw(random: np.random.Generator, n: int) -> Floats:
        variance = np.zeros((n, 1))
        for one, square in zip(alone, squares, strict=True):
            each = square if one.scale is None else square * (np.asarray(one.scale(random, n)) ** 2 @ one.share)
            variance = variance + each
        drawn = random.standard_normal((n, len(first.single)), dtype=HEIGHTS)
        return np.multiply(drawn, np.sqrt(variance, dtype=HEIGHTS), out=drawn)

    one = replace(first, draw=draw, vectors=first.normals[None], scale=None, share=np.ones((1, 1)))
    return [*(cause for cause in causes if cause not in alone), one]


def condensed(cause: PartCause, plan: Plan, on_points: Collection[str], derivative: Floats) -> PartCause:
    """A cause by fewer coefficients, where it moves each point of a large feature on its own, or by fewer components.

    ``derivative``: (p, n, 3) of all that follows to first order.
    """
    scale: Draw | None = None
    vectors = np.zeros((1, *plan.points.shape))
    if isinstance(cause, PointScatter):
        scale, vectors = cause.scale, cause.size.T[:, :, None] * cause.turn[:, None, :]
    elif isinstance(cause, Rough):
        vectors[0, cause.rows] = cause.along
    large = {name for name, rows in plan.rows.items() if rows.stop - rows.start >= LARGE}
    single = _rows(plan, large & set(on_points))
    if isinstance(cause, CommonCause) and len(cause.basis) > _FACTORED and len(set(cause.factors)) > 1:
        return _factored(cause, single, _rows(plan, set(plan.rows) - large), plan.normals, derivative)
    if not isinstance(cause, PointScatter | Rough):
        return cause
    rest, acts = _rows(plan, large - set(on_points)), np.abs(vectors).max(axis=(0, 2)) > 0
    whole = np.setdiff1d(np.flatnonzero(acts), np.concatenate([single, rest]))
    sums = _summed(vectors[:, rest], derivative[:, rest])
    single = single if acts[single].any() else single[:0]
    a, w, s, r = len(vectors), len(whole), len(single), sums.shape[1]
    along = np.einsum("asi,si->as", vectors[:, single], plan.normals[single]) ** 2
    share = along / np.maximum(along.sum(axis=0), np.finfo(np.float64).tiny)
    share = share[:, :1] if s and not np.ptp(share, axis=1).any() else share

    def draw(random: np.random.Generator, n: int) -> Floats:
        drawn = random.standard_normal((n, a * w + s + a * r))
        if scale is not None:
            times = np.asarray(scale(random, n))
            drawn[:, : a * w] *= np.tile(times, w)
            drawn[:, a * w : a * w + s] *= np.sqrt(times**2 @ share)
            drawn[:, a * w + s :] *= np.repeat(times, r, axis=1)
        return drawn

    return CondensedCause(
        name=cause.name, factors=(cause.factors[0],) * (a * w + s + a * r), draw=draw, named=cause.named, vectors=vectors,
        whole=whole, single=single, normals=plan.normals, sums=sums, scale=scale, share=share,
    )  # fmt: skip


def _factored(cause: CommonCause, single: Ints, others: Ints, normals: Floats, derivative: Floats) -> CommonCause:
    """By as few components as rows that are moved along their normals, other rows and a derivative tell apart."""
    heights = np.einsum("kmi,mi->km", cause.basis, normals)[:, single]
    of_others = cause.basis[:, others].reshape(len(heights), -1)
    left = _few(np.hstack([heights, of_others, cause.through(derivative)]))
    basis = np.tensordot(left.T, cause.basis, axes=1)
    return cause if left.shape[1] == len(left) else replace(cause, basis=basis, into=left)


def _rows(plan: Plan, names: Collection[str]) -> Ints:
    """(m,) rows of the points of some features, in order."""
    found = [np.arange(rows.start, rows.stop) for name, rows in plan.rows.items() if name in names]
    return np.concatenate([np.zeros(0, dtype=np.int64), *found])


def _summed(vectors: Floats, derivative: Floats) -> Floats:
    """(a, r, p) of the covariance that displacements (a, m, 3) of m points give p values, of derivative (p, m, 3).

    Of all its roots the one that is nearly the same where the part lies elsewhere.
    """
    p = len(derivative)
    if not vectors.shape[1] or not p:
        return np.zeros((len(vectors), 0, p))
    found = []
    for axis in vectors:
        left, sizes, _ = np.linalg.svd(np.einsum("pmi,mi->pm", derivative, axis), full_matrices=False)
        found.append((left * sizes) @ left.T)
    return np.array(found)
