"""What makes damaged points fit their artefact: copies, exchanges and every known mistake, undone in turn."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations, pairwise

import numpy as np
from numpy.typing import NDArray

from cmm_uq.mismatch.screening_artefact import Shape
from cmm_uq.mismatch.screening_changes import Change, changes, changes_of_blocks
from cmm_uq.mismatch.screening_finding import Finding, at_lines, finding
from cmm_uq.points import AXES, Floats, Ints, Points

MOST = 0.2
"""Part of the rows that may be left out; with more damage the recording is refused."""

_MOST_PAIRS = 60
_MOST_BALLS = 400
_SAME_PLACE = 10.0
_TRAVEL_TOLERANCE = 1.0


@dataclass(frozen=True, eq=False)
class Search:
    """The points that miss the artefact, and what makes them fit."""

    points: Points
    shape: Shape

    @cached_property
    def misfit(self) -> Floats:
        """(n,) how far each point misses the artefact, mm."""
        return self.shape.misfit(self.points.xyz, self.shape.reference)

    @cached_property
    def bad(self) -> NDArray[np.bool_]:
        """(n,) points that miss the artefact, and a few that lie as far outside the travel as that is long."""
        low, high = self.points.machine.travel_mm.T
        beyond = np.maximum(low - self.points.readings, self.points.readings - high)
        astray = np.any(beyond > high - low, axis=1)
        missed = self.misfit > self.shape.tolerance
        return np.asarray(missed | astray if astray.mean() <= MOST else missed)

    @cached_property
    def fine(self) -> float:
        """Misfit, mm, of a point that fits as well as the sound ones."""
        sound = self.misfit[~self.bad]
        usual = 0.05 + 10 * float(np.median(sound)) if len(sound) else np.inf
        return min(self.shape.tolerance, usual)

    @cached_property
    def placing(self) -> Ints:
        """(n,) placing of each point, −1 for none."""
        placing = np.full(len(self.points), -1)
        for i, rows in enumerate(self.shape.rows):
            placing[rows] = i
        return placing

    def findings(self) -> list[Finding]:
        """What is damaged, by its cause where that is known, each with the rows to leave out."""
        open_, found = self.bad.copy(), []
        for look in (self._copies, self._swapped, self._blocks, self._singles):
            for kind, rows, why, column in look(open_):
                open_[self._lost_with(rows)] = False
                found.append(self._finding(kind, rows, why, column))
        groups = self.points.group if self.shape.together else np.arange(len(self.points))
        unknown = [np.flatnonzero(open_ & (groups == group)) for group in np.unique(groups[open_])]
        why = "no known mistake explains it: measure again"
        return found + [self._finding("outlier", rows, why, None) for rows in unknown]

    def _finding(self, kind: str, rows: Ints, why: str, column: str | None) -> Finding:
        lost = self._lost_with(rows)
        amount = float(self.misfit[rows].max())
        by = f"by {amount:.3g} mm, " if np.isfinite(amount) else ""
        missed = f"the artefact is missed {by}far more than any machine's error"
        what = missed if amount > self.shape.tolerance else "the readings lie far outside the travel"
        told = f"{at_lines(self.points, rows)}: {what}; {why}"
        return replace(
            finding(kind, self.points, rows, told, column), set_aside=True, rows=tuple(int(row) for row in lost)
        )

    def _lost_with(self, rows: Ints) -> Ints:
        """Rows that cannot be used without these: the other end of a bar, the other corners of a triangle."""
        return np.flatnonzero(np.isin(self.points.group, self.points.group[rows])) if self.shape.together else rows

    def _copies(self, open_: NDArray[np.bool_]) -> Iterator[tuple[str, Ints, str, str | None]]:
        """Rows with all three coordinates of another row, where they do not fit; those of one block together."""
        _, first, same = np.unique(self.points.xyz, axis=0, return_index=True, return_inverse=True)
        original = first[same.ravel()]
        rows = np.flatnonzero(open_ & (original != np.arange(len(original))))
        rows = rows[self._other_place(rows, original[rows])]
        offset = np.diff(rows - original[rows], prepend=-1, append=-1)
        for start, end in pairwise(np.flatnonzero(offset).tolist()):
            block = rows[start:end]
            copied = (
                f"the coordinates of {at_lines(self.points, original[block])} to the last digit: copied, not measured"
            )
            kind, has = ("duplicate", "it has") if len(block) == 1 else ("repeated block", "they have")
            yield kind, block, f"{has} {copied}", None

    def _other_place(self, rows: Ints, others: Ints) -> NDArray[np.bool_]:
        keys = np.column_stack([self.points.measurement, self.points.point])
        return np.asarray(np.any(keys[rows] != keys[others], axis=1))

    def _swapped(self, open_: NDArray[np.bool_]) -> Iterator[tuple[str, Ints, str, str | None]]:
        """Two points that fit once they are exchanged."""
        rows = np.flatnonzero(open_)
        if len(rows) > _MOST_PAIRS:
            return
        for pair in combinations(rows.tolist(), 2):
            chosen = np.array(pair)
            if not open_[chosen].all() or (self.shape.together and np.ptp(self.placing[chosen]) == 0):
                continue
            xyz = self.points.xyz.copy()
            xyz[chosen] = xyz[chosen[::-1]]
            if self._fit(chosen, xyz, self.shape.reference):
                names = [f"point {self.points.point[i]} of measurement {self.points.measurement[i]}" for i in chosen]
                other = ", or the other ends of these bars," if self.shape.is_bar else ""
                why = f"{names[0]} and {names[1]}{other} are exchanged: exchange their coordinates"
                yield "swapped", chosen, why, None

    def _blocks(self, open_: NDArray[np.bool_]) -> Iterator[tuple[str, Ints, str, str | None]]:
        """Measurements, runs of rows and repeats most of whose rows are damaged in the same way."""
        both = (*changes(self.shape), *changes_of_blocks(self.shape))
        for rows in self._candidates(open_):
            if open_[rows].mean() < 0.5:
                continue
            told = self._first(both, rows)
            if told is None and self._numbered_otherwise(rows):
                told = (
                    "swapped",
                    "its points seem numbered in another order than the references: number them alike",
                    None,
                )
            if told is not None:
                yield told[0], rows, told[1], told[2]

    def _candidates(self, open_: NDArray[np.bool_]) -> Iterator[Ints]:
        several = 1 if self.shape.together else 3
        if self.shape.names or not self.shape.together:
            for number in np.unique(self.points.measurement[open_]):
                yield np.flatnonzero(self.points.measurement == number)
        rows = np.flatnonzero(open_)
        if len(rows) > several:
            yield np.arange(rows[0], rows[-1] + 1)
        for group in np.unique(self.points.group[open_]):
            rows = np.flatnonzero(self.points.group == group)
            if len(rows) > several:
                yield rows

    def _singles(self, open_: NDArray[np.bool_]) -> Iterator[tuple[str, Ints, str, str | None]]:
        every = changes(self.shape)
        outside: NDArray[np.bool_] = np.any(outside_travel(self.points), axis=1)
        rows = np.flatnonzero(open_)
        for row in rows[np.argsort(~outside[rows], kind="stable")].tolist():
            if not open_[row]:
                continue
            chosen = np.array([row])
            told = self._stuck(row) or self._first(every, chosen)
            if told is not None:
                yield told[0], chosen, told[1], told[2]

    def _stuck(self, row: int) -> tuple[str, str, str | None] | None:
        """One coordinate repeated from the row before, digit for digit, while the others moved on."""
        if row == 0:
            return None
        same = self.points.xyz[row] == self.points.xyz[row - 1]
        if same.sum() != 1:
            return None
        axis = AXES[int(np.argmax(same))]
        return "stuck", f"{axis}_mm seems stuck at the value of the row before. Measure again", f"{axis}_mm"

    def _first(self, every: Iterable[Change], rows: Ints) -> tuple[str, str, str | None] | None:
        for change in every:
            if change.edges and len(rows) < 4:
                continue
            xyz, reference = self.changed(change, rows)
            if self._fit(rows, xyz, reference, change.edges):
                return change.kind, f"{change.what}. {change.fix}", change.columns[0]
        return None

    def changed(self, change: Change, rows: Ints) -> tuple[Floats, Floats]:
        """Coordinates and references with a mistake undone in some rows."""
        xyz, reference = self.points.xyz.copy(), self.shape.reference.copy()
        xyz[rows], reference[rows] = change.apply(xyz[rows], reference[rows])
        return xyz, reference

    def _fit(self, rows: Ints, xyz: Floats, reference: Floats, edges: int = 0) -> bool:
        """Whether these rows fit as well as the sound ones, inside the travel, where their repeats are."""
        placings = np.unique(self.placing[rows])
        after = self.shape.misfit(xyz, reference, placings[placings >= 0].tolist())[rows]
        return (
            int(np.sum(after > self.fine)) <= edges
            and not np.any(outside_travel(self.points.at(xyz))[rows])
            and self._near_repeats(rows, xyz) >= len(rows) - edges
        )

    def _near_repeats(self, rows: Ints, xyz: Floats) -> int:
        """How many of some rows lie where sound repeats of the same points lie, or have none."""
        near, points = 0, self.points
        for row in rows:
            same = (points.measurement == points.measurement[row]) & (points.point == points.point[row]) & ~self.bad
            same[rows] = False
            near += not same.any() or bool(np.linalg.norm(xyz[same] - xyz[row], axis=1).min() < _SAME_PLACE)
        return near

    def _numbered_otherwise(self, rows: Ints) -> bool:
        """Whether a placing has the artefact's distances, in another order."""
        if not self.shape.names[2:] or self.shape.names[0] == "nx" or len(rows) > _MOST_BALLS:
            return False
        found, own = (
            np.sort(np.linalg.norm(v[:, None] - v[None], axis=2)[np.triu_indices(len(v), 1)])
            for v in (self.points.xyz[rows], self.shape.reference[rows])
        )
        return bool(np.abs(found - own).max(initial=0.0) < self.shape.tolerance)


def outside_travel(points: Points) -> NDArray[np.bool_]:
    """(n, 3) whether a scale reading lies outside its travel."""
    low, high = points.machine.travel_mm.T
    readings = points.readings
    return np.asarray((readings < low - _TRAVEL_TOLERANCE) | (readings > high + _TRAVEL_TOLERANCE))
