"""Which points stand in one placing of an artefact, and sums over them without a loop."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from cmm_uq.base.points import Floats, Ints
from cmm_uq.maths.inference.freedoms import Freedoms

LAST_DIGIT = 1e-9
"""mm, of means over repeats, which rounding keeps from being the same."""

_ALONG = 0.99
"""Cosine from which on an axis of an artefact is one of the machine's."""


@dataclass(frozen=True, eq=False)
class Placings:
    """Points by their placing.

    Parameters
    ----------
    index : (n,) placing of each point, 0 … q − 1.
    numbers : (q,) the ``measurement`` that each placing is.
    """

    index: Ints
    numbers: Ints

    @classmethod
    def of(cls, numbers: Ints) -> Placings:
        """One placing for each different number of ``numbers`` (n,), in ascending order."""
        known, index = np.unique(numbers, return_inverse=True)
        return cls(index.ravel().astype(np.int64), known.astype(np.int64))

    @cached_property
    def _order(self) -> tuple[Ints, Ints]:
        return np.argsort(self.index, kind="stable"), np.cumsum(self.sizes) - self.sizes

    @cached_property
    def sizes(self) -> Ints:
        """(q,) points in each placing."""
        return np.bincount(self.index, minlength=len(self.numbers)).astype(np.int64)

    @cached_property
    def rows(self) -> tuple[Ints, ...]:
        """Points of each placing (k,), ascending."""
        order, starts = self._order
        return tuple(np.split(order, starts[1:])) if len(order) else ()

    def sums(self, values: Floats) -> Floats:
        """Sums of ``values`` (n, …) over the points of each placing, (q, …)."""
        order, starts = self._order
        return np.asarray(np.add.reduceat(values[order], starts, axis=0), dtype=np.float64)

    def means(self, values: Floats) -> Floats:
        """Means of ``values`` (n, …) over the points of each placing, given back to every point."""
        counts = self.sizes.reshape((-1,) + (1,) * (values.ndim - 1))
        return np.asarray((self.sums(values) / counts)[self.index], dtype=np.float64)

    def still(self, xyz: Floats) -> NDArray[np.bool_]:
        """(n, 3) which coordinates of ``xyz`` (n, 3) are the same to the last digit in all of a point's placing."""
        order, starts = self._order
        moved = np.abs(xyz - xyz[order[starts]][self.index]) > LAST_DIGIT
        return np.asarray((self.sums(moved.astype(np.float64)) == 0)[self.index])

    def unread(self, xyz: Floats, axes: Floats) -> NDArray[np.bool_]:
        """(n, j) which of an artefact's axes, the columns of ``axes`` (n, 3, j), lie along a coordinate that stood still.

        A coordinate that nobody read has no noise: it is no observation, and one too many makes the noise look smaller.
        """
        return np.asarray(np.any(self.still(xyz)[:, :, None] & (np.abs(axes) > _ALONG), axis=1))

    def columns(self, freedoms: Floats) -> Freedoms:
        """Freedoms that each placing has for itself, by what they do to its points' observations, (n, j) or (n, …, j)."""
        each = int(np.prod(freedoms.shape[1:-1]))
        return Freedoms(
            freedoms.reshape(-1, freedoms.shape[-1]), np.repeat(self.index, each), len(self.numbers)
        )  # fmt: skip
