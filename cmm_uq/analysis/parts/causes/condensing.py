"""Causes that move each point on its own, of features of thousands of points: as few numbers as their characteristics are of.

Where only the values of a feature are asked for, these follow to first order from the displacements of all its points, so that
their joint normal distribution is drawn and not the points. Where a form or a zone is of the points themselves, they are
moved along their normals: a displacement across the normal changes a distance from the surface in second order.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cmm_uq.analysis.parts.causes.cause import Draw, PartCause, PointScatter
from cmm_uq.analysis.parts.causes.form import Rough
from cmm_uq.analysis.parts.plan import Plan
from cmm_uq.base.points import Floats, Ints

LARGE = 1000  # points of a feature from which on its points are not drawn one coordinate after the other


@dataclass(frozen=True, eq=False, kw_only=True)
class CondensedCause(PartCause):
    """A cause that moves each point on its own along a axes, by fewer coefficients."""

    vectors: Floats  # (a, n, 3) displacements of each point for one standard deviation along each axis, mm
    # (w,) rows of points that are moved along every axis: a coefficient an axis, of one point after the other
    whole: Ints
    single: Ints  # (s,) rows of points that are moved along their normals: then a coefficient each
    normals: Floats  # (n, 3) of all points
    sums: Floats  # (a, r, p) changes of what follows to first order from all other points: then r coefficients an axis

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
        return coefficients[:, skipped + first : skipped + last] * self._sizes[first:last], self.single[first:last]


def condensed(cause: PartCause, plan: Plan, on_points: Collection[str], derivative: Floats) -> PartCause:
    """A cause by fewer coefficients, where it moves each point of a large feature on its own; else itself.

    ``derivative``: (p, n, 3) of all that follows to first order.
    """
    scale: Draw | None = None
    vectors = np.zeros((1, *plan.points.shape))
    if isinstance(cause, PointScatter):
        scale, vectors = cause.scale, cause.size.T[:, :, None] * cause.turn[:, None, :]
    elif isinstance(cause, Rough):
        vectors[0, cause.rows] = cause.along
    else:
        return cause
    large = {name for name, rows in plan.rows.items() if rows.stop - rows.start >= LARGE}
    single = _rows(plan, large & set(on_points))
    rest, acts = _rows(plan, large - set(on_points)), np.abs(vectors).max(axis=(0, 2)) > 0
    whole = np.setdiff1d(np.flatnonzero(acts), np.concatenate([single, rest]))
    sums = _summed(vectors[:, rest], derivative[:, rest])
    single = single[acts[single]]
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
        whole=whole, single=single, normals=plan.normals, sums=sums,
    )  # fmt: skip


def _rows(plan: Plan, names: Collection[str]) -> Ints:
    """(m,) rows of the points of some features, in order."""
    found = [np.arange(rows.start, rows.stop) for name, rows in plan.rows.items() if name in names]
    return np.concatenate([np.zeros(0, dtype=np.int64), *found])


def _summed(vectors: Floats, derivative: Floats) -> Floats:
    """(a, r, p) of the covariance that displacements (a, m, 3) of m points give p values, of derivative (p, m, 3)."""
    p = len(derivative)
    if not vectors.shape[1] or not p:
        return np.zeros((len(vectors), 0, p))
    found = []
    for axis in vectors:
        left, sizes, _ = np.linalg.svd(np.einsum("pmi,mi->pm", derivative, axis), full_matrices=False)
        found.append(
            (left * sizes) @ left.T
        )  # of all roots the one that is nearly the same where the part lies elsewhere
    return np.array(found)
