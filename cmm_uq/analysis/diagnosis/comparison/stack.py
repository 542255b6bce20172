"""All versions of all explanations as columns side by side, those with equally many columns together."""

from __future__ import annotations

from collections.abc import Callable, Container, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cmm_uq.analysis.diagnosis.comparison.explanations import Explanation
from cmm_uq.base.points import Floats, Ints

AMPLITUDES = 7
_SMALLEST = 0.4
"""Smallest rms of an explanation that is considered, over the noise."""

_ABSORBED = 1e-5
"""Part of its length below which a column is the baseline's own."""


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
class Group:
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
        others = self.explanation[1:] != self.explanation[:-1]
        return np.flatnonzero(np.concatenate([[True], others]))

    def part(self, among: Container[int] | None) -> slice:
        """Members from the first to the last of some explanations; all by default."""
        if among is None:
            return slice(None)
        chosen = [part for i, part in self._parts if i in among]
        return slice(chosen[0].start, chosen[-1].stop) if chosen else slice(0, 0)

    @cached_property
    def _parts(self) -> list[tuple[int, slice]]:
        """Each explanation with its members."""
        begin = self.first.tolist()
        owners = self.explanation[self.first].tolist()
        return [(i, slice(*ends)) for i, *ends in zip(owners, begin, [*begin[1:], len(self.explanation)], strict=True)]

    def only(self, part: slice) -> Group:
        """The group of some members."""
        if part == slice(None):
            return self
        return Group(
            self.explanation[part],
            self.member[part],
            self.weight[part],
            self.start[part],
            self.amplitudes[part],
            self.r,
        )


def stacked(
    explanations: Sequence[Explanation],
    rest: Callable[[Floats], Floats],
    noise_scale: Floats,
    least_noise: float,
    degrees_of_freedom: int,
) -> tuple[Floats, tuple[Group, ...]]:
    """Columns (m, K) that the baseline leaves of all members, over the noise scale (m,), and their groups.

    Parameters
    ----------
    rest : what the baseline leaves of columns (m, b).
    least_noise : mm; with it the largest coefficients are as large as physics allows.
    degrees_of_freedom : how many observations are left.
    """
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
    left = rest(every)
    ends = np.cumsum([columns.shape[1] for *_, columns in whole])
    starts_of = np.append(0, ends[:-1])
    lengths, of_whole = (np.sqrt(np.add.reduceat(np.sum(each**2, axis=0), starts_of)) for each in (left, every))
    seen = lengths > _ABSORBED * of_whole
    for k in np.flatnonzero(seen).tolist():
        owner, j, log, columns = whole[k]
        own = left[:, starts_of[k] : ends[k]]
        found.setdefault(columns.shape[1], []).append((owner, j, log, own, float(lengths[k])))
    groups, stack, start = [], [np.zeros((len(noise_scale), 0))], 0
    for r in sorted(found):
        chosen = found[r]
        rms = np.array([length for *_, length in chosen]) / np.sqrt(max(degrees_of_freedom, 1))
        largest = 1 / least_noise
        smallest = np.minimum(_SMALLEST / rms, largest)
        amplitudes = largest * (smallest / largest)[:, None] ** np.linspace(0, 1, AMPLITUDES)
        explanation, member = (np.array([item[k] for item in chosen], dtype=np.int64) for k in (0, 1))
        weight = np.array([item[2] for item in chosen])
        starts = start + r * np.arange(len(chosen))
        groups.append(Group(explanation, member, weight, starts, amplitudes, r))
        stack += [left for *_, left, _ in chosen]
        start += r * len(chosen)
    return np.hstack(stack), tuple(groups)
