"""Single readings of an error map that jump: judged against their neighbours, and against the same position in other maps.

What a map differs by from the others is followed along the travel. A spike leaves that course on both sides of it, and comes
back; a narrow feature that every map has is none, nor is the place where a map goes on at another level. The measure is how
far the readings of that very map usually lie off their neighbours, so that a column that is read coarsely, or is noisy
throughout, has no spikes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cmm_uq.base.points import Floats

SIDE, NEAR = 7, 3
"""Readings on each side that a reading is judged by: nearly half of the former may be spikes themselves, and the latter follow
a course that wanders."""

WIDEST = 2  # readings in a row that are a spike; more are a part of the travel where the map differs
_FEWEST = 6  # readings of a column

_AT_AN_END = 0.5
"""Weight of what the first and the last reading are off: there is no other side on which the course would come back."""

_FAR = 7.0  # of its robust standard deviations, by which a reading off its neighbours is a spike

_OWN = 0.5
"""Part of a spike that shows in the course of one of two maps, and not in that of the other, for it to be that one's."""

_SEEN = 3.0  # of the standard deviations between maps, by which a jump of a map's own course is off the others too
_BESIDE = 0.4  # part of a spike by which a reading beside it belongs to it
_ROUNDS = 5

DAMAGED = 0.25
"""Part of the readings of a map that may be spikes; with more, what is left of the column is not believed."""

_FINEST = 0.3  # part of the last digit that no reading is better than


def spikes(positions: Floats, values: Floats, unit: float) -> NDArray[np.bool_]:
    """Which readings (k, p) of one error in k maps are spikes.

    ``positions`` (p,) mm, ascending; ``values`` (k, p) mm; ``unit`` size of the column's unit in ``values``.
    """
    found, left = np.zeros(values.shape, dtype=bool), values.copy()
    if values.shape[1] < _FEWEST:
        return found
    beside, finest = (_Beside.of(positions, SIDE), _Beside.of(positions, NEAR)), _finest(values, unit)
    for _ in range(_ROUNDS):
        off, new = _round(beside, left, finest)
        new &= ~found
        if not new.any():
            break
        found |= new
        left = np.where(new, left - off, left)  # as the others say: maps may begin at different levels
    return found


def _round(beside: tuple[_Beside, _Beside], values: Floats, finest: float) -> tuple[Floats, NDArray[np.bool_]]:
    """How far the readings are off, and which of them are spikes, (k, p) each."""
    off, alike, courses = (np.zeros(values.shape) for _ in range(3))
    shown = np.zeros(values.shape, dtype=bool)
    wide, near = beside
    for k, own in enumerate(values):
        against = own - np.median(np.delete(values, k, axis=0), axis=0)
        off[k], alike[k] = wide.off(against)
        courses[k], jump = wide.off(own)
        closely, beside_it = near.off(against)
        scales = (max(1.4826 * float(np.median(np.abs(some))), finest) for some in (off[k], courses[k], closely))
        between, along, close = scales
        # against the others it is followed best, but where these are the noisy ones, the map's own course says more
        sure = (alike[k] > _FAR * between) | ((beside_it > _FAR * close) & (alike[k] > _OWN * beside_it))
        sure |= (jump > _FAR * along) & (off[k] * np.sign(courses[k]) > np.maximum(_OWN * jump, _SEEN * between))
        alike[k] = np.where(sure, np.maximum(alike[k], _OWN * jump), alike[k])
        shown[k] = sure & _narrow(alike[k] * np.sign(off[k]))
    if len(values) == 2:
        # one of the two: the one whose own course jumps
        apart = np.abs(courses - off)
        return off, shown & (apart + _OWN * np.abs(off) < apart[::-1])
    return off, shown & (np.abs(off) >= np.abs(off).max(axis=0))


def _finest(values: Floats, unit: float) -> float:
    """Least standard deviation of a reading that its digits allow, mm."""
    steps = np.diff(np.unique(np.round(values / unit, 6)))
    return _FINEST * float(steps.min()) * unit if len(steps) else 0.0


@dataclass(frozen=True, eq=False)
class _Beside:
    """The readings beside each of p readings."""

    positions: Floats
    index: NDArray[np.intp]  # (p, 2·side) says which, those before first
    there: NDArray[np.bool_]  # whether they are
    # (p, 2·side) which of the p − 1 steps lie about the reading, ``steps`` whether they are there
    slopes: NDArray[np.intp]
    steps: NDArray[np.bool_]

    @classmethod
    def of(cls, positions: Floats, side: int) -> _Beside:
        p = len(positions)
        about = np.concatenate([np.arange(-side, 0), np.arange(1, side + 1)])
        index = np.arange(p)[:, None] + about
        slopes = np.arange(p)[:, None] + np.arange(-side, side)
        return cls(
            positions, np.clip(index, 0, p - 1), (index >= 0) & (index < p), np.clip(slopes, 0, p - 2),
            (slopes >= 0) & (slopes < p - 1),
        )  # fmt: skip

    def off(self, values: Floats) -> tuple[Floats, Floats]:
        """How far each reading (p,) is off its neighbours, and by how much off those on either side alike; 0 where it is not.

        By medians of what the neighbours say, brought along by the usual slope about the reading.
        """
        slope = _median((np.diff(values) / np.diff(self.positions))[self.slopes], self.steps)
        apart = self.positions[:, None] - self.positions[self.index]
        gap = values[:, None] - values[self.index] - slope[:, None] * apart
        off, alike = _median(gap, self.there), np.full(len(values), np.inf)
        half = self.index.shape[1] // 2
        for side in (slice(None, half), slice(half, None)):
            there = self.there[:, side]
            own = _median(gap[:, side], there) * np.sign(off)
            alike = np.where(there.any(axis=1), np.minimum(alike, np.maximum(own, 0.0)), alike)
        alike = np.minimum(alike, np.abs(off))
        alike[[0, -1]] *= _AT_AN_END
        return off, alike


def _median(values: Floats, there: NDArray[np.bool_]) -> Floats:
    """Of those of each row (p, n) that are there; 0 where none is."""
    ordered, count = np.sort(np.where(there, values, np.inf), axis=1), there.sum(axis=1)
    low, high = (
        np.take_along_axis(ordered, i[:, None], axis=1)[:, 0] for i in (np.maximum(count - 1, 0) // 2, count // 2)
    )
    return np.where(count > 0, 0.5 * (low + high), 0.0)


def _narrow(alike: Floats) -> NDArray[np.bool_]:
    """Which readings (p,) are not part of a longer stretch that lies off in the same direction."""
    kept = np.ones(len(alike), dtype=bool)
    for i in np.flatnonzero(alike):
        beside = alike * np.sign(alike[i]) > _BESIDE * abs(alike[i])
        low = high = int(i)
        while low > 0 and beside[low - 1]:
            low -= 1
        while high < len(alike) - 1 and beside[high + 1]:
            high += 1
        kept[i] = high - low < WIDEST
    return kept
