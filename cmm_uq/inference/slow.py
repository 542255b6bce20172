"""Slow noise integrated out ahead of all else, axis by axis: so its many cosines cost what one axis of them costs.

Observations that see one axis of the machine each share no cosine with those of another. The precision of the cosines is then
made of blocks, and what is left of all other columns once they are eliminated is a small matrix.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cmm_uq.points import Floats, Ints

_NOTHING = 1e-9
"""Part of the largest below which a cosine is zero for an observation."""

_LARGEST = 2.0
"""Times the largest product of the other columns: what makes a bordered matrix positive definite; its value has no effect."""


@dataclass(frozen=True, eq=False)
class SlowFirst:
    """Inner products of the cosines with each other and with all other columns, by class of the observations.

    Parameters
    ----------
    cosines : (m, c), turned.
    others : (m, R), turned.
    classes : (m,) the class of each observation, 0 to ``count`` − 1.
    """

    cosines: Floats
    others: Floats
    classes: Ints
    count: int

    @cached_property
    def groups(self) -> tuple[tuple[Ints, Ints], ...]:
        """Columns and rows of cosines that share an observation, directly or through others."""
        seen = np.abs(self.cosines) > _NOTHING * np.abs(self.cosines).max(initial=0.0)
        reached = seen.T.astype(np.float64) @ seen > 0
        while np.any(further := (reached.astype(np.float64) @ reached > 0) & ~reached):
            reached |= further
        found = []
        for first in np.unique(reached.argmax(axis=1)):
            columns = np.flatnonzero(reached[first])
            found.append((columns, np.flatnonzero(seen[:, columns].any(axis=1))))
        return tuple(found)

    @cached_property
    def _others(self) -> Floats:
        """(classes, R²)."""
        return products(self.others, self.others, self.classes, self.count)

    @cached_property
    def _bordered(self) -> list[tuple[Ints, Ints, Floats]]:
        """Of each group: its columns, its classes, and the products (classes, (c + R)²) of its cosines with everything.

        Those of the other columns with each other stay zero.
        """
        found = []
        for columns, rows in self.groups:
            own, index = np.unique(self.classes[rows], return_inverse=True)
            cosines, size = self.cosines[np.ix_(rows, columns)], len(columns) + self.others.shape[1]
            whole = np.zeros((len(own), size, size))
            every = np.hstack([cosines, self.others[rows]])
            whole[:, :, : len(columns)] = products(every, cosines, index, len(own)).reshape(len(own), size, -1)
            found.append((columns, own, whole.reshape(len(own), -1)))
        return found

    @cached_property
    def numbers(self) -> int:
        """In the largest matrices that one of the densities takes."""
        return max((len(columns) + self.others.shape[1]) ** 2 for columns, _ in self.groups)

    def precision(
        self, v: Floats, prior: Floats, of_cosines: Floats, tied: Floats, ties: Floats
    ) -> tuple[Floats, Floats]:
        """What is left of the other columns' precision (w, R, R), and half the logarithm of the cosines' determinant (w,).

        Parameters
        ----------
        v : (w, classes) variance of the observations of each class.
        prior : (R²,) precision of the other columns beforehand.
        of_cosines : (w, c) precision of the cosines beforehand.
        tied : (c, c) what ties those of one axis to each other.
        ties : (w,) how much of it.
        """
        w, R, tying = len(v), self.others.shape[1], np.flatnonzero(ties)
        left = ((1 / v) @ self._others + prior).reshape(w, R, R)
        most = _LARGEST * np.einsum("wii->wi", left).sum(axis=1)
        logs = np.zeros(w)
        for columns, own, of_classes in self._bordered:
            c = len(columns)
            bordered = ((1 / v[:, own]) @ of_classes).reshape(w, c + R, c + R)
            if len(tying):
                bordered[tying, :c, :c] += ties[tying, None, None] * tied[np.ix_(columns, columns)]
            diagonal = bordered.reshape(w, -1)[:, :: c + R + 1]
            diagonal[:, :c] += of_cosines[:, columns]
            diagonal[:, c:] = most[:, None]
            factor = np.linalg.cholesky(bordered)
            rows = factor[:, c:, :c]
            left -= rows @ rows.transpose(0, 2, 1)
            logs += np.log(np.einsum("wii->wi", factor)[:, :c]).sum(axis=1)
        return left, logs


def products(first: Floats, second: Floats, classes: Ints, count: int) -> Floats:
    """Inner products (classes, columns of the first · columns of the second) over the observations of each class."""
    order = np.argsort(classes, kind="stable")
    parts = np.split(order, np.cumsum(np.bincount(classes, minlength=count))[:-1])
    return np.stack([(first[rows].T @ second[rows]).ravel() for rows in parts])
