"""Slow noise integrated out ahead of all else, axis by axis, and where a function of one number crosses zero.

Observations that see one axis of the machine each share no cosine with those of another. The precision of the cosines is then
made of blocks, and what is left of all other columns once they are eliminated is a small matrix.

Where the noise beside a random walk is alike in all observations of an axis, the cosines are turned once into what they and
that noise make independent of each other, and at new sizes there is nothing to factorise.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from math import copysign, isnan

import numpy as np
import scipy

from cmm_uq.base.points import Floats, Ints
from cmm_uq.base.values import dataclass

_NOTHING = 1e-9  # part of the largest below which a cosine is zero for an observation
_NONE = 1e-13  # part of the largest below which another column's value is zero
_ALIKE = 1e-12  # relative difference up to which variances are the same
_RELATIVE, _ROUNDS = 8.881784197001252e-16, 100  # of a root: four times the spacing of floats at one, and steps at most


@dataclass(frozen=True, eq=False)
class SlowFirst:
    """Inner products of the cosines with each other and with all other columns, by class of the observations."""

    cosines: Floats  # (m, c), turned
    others: Floats  # (m, R), turned
    classes: Ints  # (m,) the class of each observation, 0 to ``count`` − 1
    base: Floats  # (count,) variance of each class, of any size, where the noise is alike in all observations
    walk: Floats  # (c, c) precision beforehand of the cosines of a random walk of some size

    @property
    def count(self) -> int:
        return len(self.base)

    @cached_property
    def groups(self) -> tuple[tuple[Ints, Ints], ...]:
        return groups(self.cosines)

    @cached_property
    def _near(self) -> list[Ints]:
        """Of each group: which of the other columns its observations see."""
        seen = np.abs(self.others) > _NONE * np.abs(self.others).max(axis=0, initial=0.0)
        return [np.flatnonzero(seen[rows].any(axis=0)) for _, rows in self.groups]

    @cached_property
    def _others(self) -> Floats:
        return products(self.others, self.others, self.classes, self.count)

    @cached_property
    def counts(self) -> Floats:
        return np.bincount(self.classes, minlength=self.count).astype(np.float64)

    @cached_property
    def _products(self) -> list[tuple[Ints, Ints, Floats, Floats]]:
        """Of each group: columns, classes, products (classes, c²) of its cosines, (classes, r·c) of what is near with them."""
        found = []
        for (columns, rows), near in zip(self.groups, self._near, strict=True):
            own, index = np.unique(self.classes[rows], return_inverse=True)
            cosines, others = self.cosines[np.ix_(rows, columns)], self.others[np.ix_(rows, near)]
            of_cosines, across = (products(each, cosines, index, len(own)) for each in (cosines, others))
            found.append((columns, own, of_cosines, across))
        return found

    @cached_property
    def numbers(self) -> int:
        """In the largest matrices that one of the densities takes."""
        each = [len(c) * (len(c) + len(near)) for (c, _), near in zip(self.groups, self._near, strict=True)]
        return int(max(*each, self.others.shape[1] ** 2))

    @cached_property
    def _turned(self) -> list[_Turned]:
        found = []
        for columns, own, of_cosines, across in self._products:
            c, weights = len(columns), 1 / self.base[own]
            every = np.concatenate([weights @ of_cosines, weights @ across]).reshape(-1, c)
            found.append(_Turned.of(every, self.walk[np.ix_(columns, columns)]))
        return found

    def precision(self, v: Floats, prior: Floats, known: Floats, walks: Floats) -> tuple[Floats, Floats]:
        """What is left of the other columns' precision (w, R, R), and half the logarithm of the cosines' determinant (w,).

        ``v``: (w, classes) variance of the observations of each class. ``prior``: (R²,) precision of the other columns
        beforehand. ``known``: (w, c) precision of the cosines beforehand, but for walks. ``walks``: (w,) by what that of a
        walk is to be multiplied; zero of what is none.
        """
        w, R = len(v), self.others.shape[1]
        left = ((1 / v) @ self._others + prior).reshape(w, R, R)
        logs = np.zeros(w)
        for group, near, turned in zip(self._products, self._near, self._turned, strict=True):
            columns, own, of_cosines, across = group
            times = v[:, own] / self.base[own]
            alike = (walks > 0) & (np.ptp(times, axis=1) <= _ALIKE * times[:, 0])
            if alike.any():
                lost, log = turned.lost(times[alike, 0], walks[alike])
                left[np.ix_(alike, near, near)] -= lost
                logs[alike] += log
            at = np.flatnonzero(~alike)
            if not len(at):
                continue
            c, walking, weights = len(columns), np.flatnonzero(walks[at]), 1 / v[np.ix_(at, own)]
            precision = (weights @ of_cosines).reshape(len(at), c, c)
            if len(walking):
                precision[walking] += walks[at][walking, None, None] * self.walk[np.ix_(columns, columns)]
            precision.reshape(len(at), -1)[:, :: c + 1] += known[np.ix_(at, columns)]
            factor = np.linalg.cholesky(precision)
            solved = (weights @ across).reshape(len(at), -1, c)
            for lower, each in zip(factor, solved, strict=True):
                each[:] = scipy.linalg.lapack.dtrtrs(lower.T, each.T, trans=1, overwrite_b=1)[0].T
            rows = np.zeros((len(at), R, c))
            rows[:, near] = solved
            left[at] -= rows @ rows.transpose(0, 2, 1)
            logs[at] += np.log(np.einsum("wii->wi", factor)).sum(axis=1)
        return left, logs


@dataclass(frozen=True, eq=False)
class _Turned:
    """Cosines of a walk in coordinates in which they are independent of each other, before and after noise that is alike."""

    known: Floats  # (c,) precision that noise of variance one leaves of each, where that beforehand is one
    taken: Floats  # (c, r²) what each takes from the precision of the other columns
    log: float  # half the logarithm of the determinant of the walk's precision

    @classmethod
    def of(cls, products: Floats, walk: Floats) -> _Turned:
        """From inner products (c + r, c) of cosines with all columns, and the precision of a walk (c, c)."""
        c, factor = len(walk), np.linalg.cholesky(walk)
        own = np.linalg.solve(factor, np.linalg.solve(factor, products[:c].T).T)
        known, axes = np.linalg.eigh(0.5 * (own + own.T))
        across = axes.T @ np.linalg.solve(factor, products[c:].T)
        taken = (across[:, :, None] * across[:, None, :]).reshape(c, -1)
        return cls(np.maximum(known, 0.0), taken, float(np.log(np.diag(factor)).sum()))

    def lost(self, variance: Floats, times: Floats) -> tuple[Floats, Floats]:
        """What other columns' precision loses (w, r, r), and half the logarithm of the cosines' determinant (w,).

        ``variance``: (w,) of the noise. ``times``: (w,) by what the precision of the walk is multiplied.
        """
        each = self.known / variance[:, None] + times[:, None]
        size = int(np.sqrt(self.taken.shape[1]))
        lost = (1 / (each * variance[:, None] ** 2)) @ self.taken
        return lost.reshape(-1, size, size), self.log + 0.5 * np.log(each).sum(axis=1)


def groups(cosines: Floats) -> tuple[tuple[Ints, Ints], ...]:
    """Columns and rows of cosines (m, c) that share an observation, directly or through others."""
    seen = np.abs(cosines) > _NOTHING * np.abs(cosines).max(initial=0.0)
    reached = seen.T.astype(np.float64) @ seen > 0
    while np.any(further := (reached.astype(np.float64) @ reached > 0) & ~reached):
        reached |= further
    found = []
    for first in np.unique(reached.argmax(axis=1)):
        columns = np.flatnonzero(reached[first])
        found.append((columns, np.flatnonzero(seen[:, columns].any(axis=1))))
    return tuple(found)


def products(first: Floats, second: Floats, classes: Ints, count: int) -> Floats:
    """Inner products (classes, columns of the first · columns of the second) over the observations of each class."""
    order = np.argsort(classes, kind="stable")
    parts = np.split(order, np.cumsum(np.bincount(classes, minlength=count))[:-1])
    return np.stack([(first[rows].T @ second[rows]).ravel() for rows in parts])


def root(function: Callable[[float], float], low: float, high: float, tolerance: float) -> float:
    """Root between two numbers at which a function has opposite signs, to within ``tolerance``.

    Brent's method (R. P. Brent 1973, Algorithms for Minimization without Derivatives, chapter 4) in the steps of
    ``scipy.optimize.brentq``, whose package takes longer to import than most commands run.
    """
    before, now, far = float(low), float(high), 0.0
    at_before, at_now, at_far = _value(function, before), _value(function, now), 0.0
    if not at_before or not at_now:
        return now if at_before else before
    if not _opposite(at_before, at_now):
        raise ValueError("the function has one sign at both ends")
    last = step = 0.0
    for _ in range(_ROUNDS):
        if at_before and _opposite(at_before, at_now):
            far, at_far = before, at_before
            last = step = now - before
        if abs(at_far) < abs(at_now):
            before, now, far = now, far, now
            at_before, at_now, at_far = at_now, at_far, at_now
        least, half = (tolerance + _RELATIVE * abs(now)) / 2, (far - now) / 2
        if not at_now or abs(half) < least:
            return now
        last, step, earlier = half, half, (last, step)
        if abs(earlier[0]) > least and abs(at_now) < abs(at_before):
            if before == far:  # zero of a line through two of the values
                tried = -at_now * (now - before) / (at_now - at_before)
            else:  # of the inverse quadratic function through three
                to_before, to_far = (at_before - at_now) / (before - now), (at_far - at_now) / (far - now)
                tried = (
                    -at_now * (at_far * to_far - at_before * to_before) / (to_far * to_before * (at_far - at_before))
                )
            if 2 * abs(tried) < min(abs(earlier[0]), 3 * abs(half) - least):
                last, step = earlier[1], tried
        before, at_before = now, at_now
        now += step if abs(step) > least else copysign(least, half)
        at_now = _value(function, now)
    raise ArithmeticError(f"no root found within {_ROUNDS} rounds")


def _value(function: Callable[[float], float], place: float) -> float:
    found = float(function(place))
    if isnan(found):
        raise ValueError(f"the function is not a number at {place}")
    return found


def _opposite(a: float, b: float) -> bool:
    return copysign(1.0, a) != copysign(1.0, b)
