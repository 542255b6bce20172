"""Which coordinates of a recording are damaged, and how: found against the artefact's own shape, before anything is fitted."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from functools import partial
from itertools import combinations, pairwise

import numpy as np
import scipy
from numpy.typing import NDArray

from cmm_uq.analysis.screening.columns import Finding, at_lines, finding
from cmm_uq.analysis.screening.shape import ArtefactShape, Mistake, block_mistakes, row_mistakes
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, Verbatim, plural, say
from cmm_uq.base.points import AXES, Floats, Ints, Points
from cmm_uq.base.values import dataclass, replace
from cmm_uq.machine.model.artefact import Placings
from cmm_uq.machine.model.kind import Observed
from cmm_uq.machine.physics.kinematics import MOST_LEAN, axis_directions

MOST = 0.2  # part of the rows that may be left out; with more damage the recording is refused
_PART, _STRAYS = 0.2, 0.05
_FEW, _MANY = 16, 60
_MOST_BALLS = 400
_SAME_PLACE, _TRAVEL_TOLERANCE = 10.0, 1.0  # mm
_SEVERAL, _EDGES = 4, 0.05
_FOR_ANGLES = 10  # set-ups or points from which on three angles are no mere adaptation
_EXPLAINED = 0.25  # part of its misfit that a point has left which other axes explain
_ABSURD = (1.0, 2e4)  # mm; a bar shorter or longer than this is in another unit


@dataclass(frozen=True, eq=False)
class Damage:
    kind: str
    rows: Ints
    why: Text
    column: str | None = None
    mended: tuple[Floats, Floats] | None = None


class DamageSearch:
    """The points that miss an artefact by ``misfit`` (n,), mm, and what makes them fit; ``bad`` (n,) are astray as well."""

    def __init__(self, points: Points, shape: ArtefactShape) -> None:
        self.points, self.shape = points, shape
        self.misfit = shape.misfit(points.xyz, shape.reference)
        self.bad = self._wrong(self.misfit)
        sound = self.misfit[~self.bad]
        usual = 0.05 + 10 * float(np.median(sound)) if len(sound) else np.inf
        self._fine = min(shape.tolerance, usual)
        self._placing = np.full(len(points), -1)
        for i, rows in enumerate(shape.rows):
            self._placing[rows] = i
        self._inside = bool(np.any(outside_travel(points)[~self.bad], axis=1).mean() < _STRAYS) if len(sound) else False
        self._xyz, self._reference = points.xyz, shape.reference
        self._open, self._settled = self.bad.copy(), np.zeros(len(points), dtype=bool)

    def findings(self) -> list[Finding]:
        """What is damaged, by its cause where that is known, each with the rows to leave out."""
        found = []
        for causes in (self._copies(), self._swapped(_FEW), self._blocks(), self._swapped(_MANY), self._singles()):
            for cause in causes:
                self._settled[self._lost_with(cause.rows)] = True
                if cause.mended is not None:
                    self._xyz, self._reference = cause.mended
                again = np.isin(self._placing, self._placing[cause.rows])
                misfit = self.shape.misfit(self._xyz, self._reference, self._placings(cause.rows))
                self._open[again] = (self._wrong(misfit) & ~self._settled)[again]
                found.append(self._finding(cause))
        groups = self.points.group if self.shape.together else np.arange(len(self.points))
        unknown = [np.flatnonzero(self._open & (groups == group)) for group in np.unique(groups[self._open])]
        why = say("no known mistake explains it: measure again")
        return found + [self._finding(Damage("outlier", rows, why)) for rows in unknown]

    def changed(self, change: Mistake, rows: Ints) -> tuple[Floats, Floats]:
        """Coordinates and references with a mistake undone in some rows, beside those that are undone already."""
        xyz, reference = self._xyz.copy(), self._reference.copy()
        xyz[rows], reference[rows] = change.apply(xyz[rows], reference[rows])
        return xyz, reference

    def _wrong(self, misfit: Floats) -> NDArray[np.bool_]:
        low, high = self.points.machine.travel_mm.T
        beyond = np.maximum(low - self.points.carriages, self.points.carriages - high)
        astray = np.any(beyond > high - low, axis=1)
        missed = misfit > self.shape.tolerance
        return np.asarray(missed | astray if astray.mean() <= MOST else missed)

    def _finding(self, cause: Damage) -> Finding:
        rows, amount = cause.rows, float(self.misfit[cause.rows].max())
        what = say("the readings lie far outside the travel")
        if amount > self.shape.tolerance and np.isfinite(amount):
            what = say("the artefact is missed by {amount:.3g} mm, far more than any machine's error", amount=amount)
        elif amount > self.shape.tolerance:
            what = say("the artefact is missed far more than any machine's error")
        why = say("{at_lines}: {what}; {why}", at_lines=at_lines(self.points, rows), what=what, why=cause.why)
        lost = tuple(self._lost_with(rows).tolist())
        return replace(finding(cause.kind, self.points, rows, why, cause.column), set_aside=True, rows=lost)

    def _lost_with(self, rows: Ints) -> Ints:
        return np.flatnonzero(np.isin(self.points.group, self.points.group[rows])) if self.shape.together else rows

    def _placings(self, rows: Ints) -> list[int]:
        return [int(i) for i in np.unique(self._placing[rows]) if i >= 0]

    def _copies(self) -> Iterator[Damage]:
        """Rows with all three coordinates of another row, where they do not fit; those of one block together."""
        _, same = np.unique(self.points.xyz, axis=0, return_inverse=True)
        keys = np.column_stack([self.points.measurement, self.points.point])
        copies: list[tuple[int, int]] = []
        for row in np.flatnonzero(self._open):
            others = np.flatnonzero((same.ravel() == same.ravel()[row]) & np.any(keys != keys[row], axis=1))
            copies += [(int(row), int(others[0]))] if len(others) else []
        block, source = np.array(copies, dtype=np.int64).reshape(-1, 2).T
        offset = np.diff(block - source, prepend=0, append=0) if len(block) else block
        for start, end in pairwise(sorted({0, *np.flatnonzero(offset).tolist(), len(block)})):
            lines = at_lines(self.points, source[start:end])
            one = say("it has the coordinates of {lines} to the last digit: copied, not measured", lines=lines)
            many = say("they have the coordinates of {lines} to the last digit: copied, not measured", lines=lines)
            why = plural(end - start, one=one, many=many)
            yield Damage("duplicate" if end - start == 1 else "repeated block", block[start:end], why)

    def _swapped(self, most: int) -> Iterator[Damage]:
        rows, points = np.flatnonzero(self._open), self.points
        for pair in combinations(rows.tolist(), 2) if len(rows) <= most else ():
            chosen = np.array(pair)
            if not self._open[chosen].all() or (self.shape.together and np.ptp(self._placing[chosen]) == 0):
                continue
            xyz = self._xyz.copy()
            xyz[chosen] = xyz[chosen[::-1]]
            if self._fit(chosen, xyz, self._reference):
                one, other = (
                    say("point {point} of measurement {measurement}", point=point, measurement=measurement)
                    for point, measurement in zip(points.point[chosen], points.measurement[chosen], strict=True)
                )
                why = say("{one} and {other} are exchanged: exchange their coordinates", one=one, other=other)
                if self.shape.is_bar:
                    why = say("{one} and {other}, or the other ends of these bars, are exchanged: exchange their coordinates",
                              one=one, other=other)  # fmt: skip
                yield Damage("swapped", chosen, why, None, (xyz, self._reference))

    def _blocks(self) -> Iterator[Damage]:
        both = (*row_mistakes(self.shape), *block_mistakes(self.shape))
        for rows in self._candidates():
            if self._open[rows].mean() >= _PART and (cause := self._first(both, rows)) is not None:
                yield cause
        for rows in self._candidates():
            if self._open[rows].mean() >= _PART and self._numbered_otherwise(rows):
                why = say("its points seem numbered in another order than the references: number them alike")
                yield Damage("swapped", rows, why)

    def _candidates(self) -> Iterator[Ints]:
        several = 1 if self.shape.together else 3
        if self.shape.names or not self.shape.together:
            for number in np.unique(self.points.measurement[self._open]):
                yield np.flatnonzero(self.points.measurement == number)
        rows = np.flatnonzero(self._open)
        if len(rows) > several:
            yield np.arange(rows[0], rows[-1] + 1)
        for group in np.unique(self.points.group[self._open]):
            rows = np.flatnonzero(self.points.group == group)
            if len(rows) > several:
                yield rows

    def _singles(self) -> Iterator[Damage]:
        every = row_mistakes(self.shape)
        outside: NDArray[np.bool_] = np.any(outside_travel(self.points), axis=1)
        rows = np.flatnonzero(self._open)
        for row in rows[np.argsort(~outside[rows], kind="stable")].tolist():
            if self._open[row] and (cause := self._stuck(row) or self._first(every, np.array([row]))) is not None:
                yield cause

    def _stuck(self, row: int) -> Damage | None:
        same = self.points.xyz[row] == self.points.xyz[row - 1] if row else np.zeros(3, dtype=bool)
        if same.sum() != 1:
            return None
        column = f"{AXES[int(np.argmax(same))]}_mm"
        why = say("{column} seems stuck at the value of the row before. Measure again", column=Verbatim(column))
        return Damage("stuck", np.array([row]), why, column)

    def _first(self, every: Iterable[Mistake], rows: Ints) -> Damage | None:
        for change in every:
            if change.edges and len(rows) < 4:
                continue
            xyz, reference = self.changed(change, rows)
            if self._fit(rows, xyz, reference, change.edges):
                why = say("{what}. {fix}", what=change.what, fix=change.fix)
                return Damage(change.kind, rows, why, change.columns[0], (xyz, reference))
        return None

    def _fit(self, rows: Ints, xyz: Floats, reference: Floats, edges: int = 0) -> bool:
        after, points, near = self.shape.misfit(xyz, reference, self._placings(rows))[rows], self.points, 0
        if np.sum(after > self._fine) > edges or (self._inside and np.any(outside_travel(points.at(xyz))[rows])):
            return False
        for row in rows:
            same = (points.measurement == points.measurement[row]) & (points.point == points.point[row]) & ~self.bad
            same[rows] = False
            near += not same.any() or bool(np.linalg.norm(xyz[same] - xyz[row], axis=1).min() < _SAME_PLACE)
        return near >= len(rows) - edges

    def _numbered_otherwise(self, rows: Ints) -> bool:
        if not self.shape.names[2:] or self.shape.names[0] == "nx" or len(rows) > _MOST_BALLS:
            return False
        xyz, reference = (self.points.xyz @ self.shape.axes)[rows], self.shape.reference[rows]
        if np.median(self.shape.misfit_of(xyz, reference, self.shape.size)) <= self.shape.tolerance:
            return False
        pairs = np.triu_indices(len(xyz), 1)
        found, own = (np.sort(np.linalg.norm(v[:, None] - v, axis=2)[pairs]) for v in (xyz, reference))
        return bool(np.abs(found - own).max(initial=0.0) < self.shape.tolerance)


def outside_travel(points: Points) -> NDArray[np.bool_]:
    """(n, 3) whether a scale reading lies outside its travel."""
    (low, high), readings = points.machine.travel_mm.T, points.carriages
    return np.asarray((readings < low - _TRAVEL_TOLERANCE) | (readings > high + _TRAVEL_TOLERANCE))


def coordinate_findings(
    points: Points, shape: ArtefactShape, observe: Observed, set_aside: Collection[int], where: str
) -> list[Finding]:
    """Damaged coordinates, each with the rows to leave out. ``where`` the recording's name, for messages."""
    low, high = _ABSURD
    if shape.is_bar and not np.isfinite(shape.size) and not low <= shape.extent <= high:
        unit = "metres" if shape.extent < low else "micrometres"
        problem = f"the recorded bars are about {shape.extent:.3g} mm long: the coordinates look like {unit}, not mm"
        raise CmmUqError(problem, where=where, fix="Give x_mm, y_mm, z_mm in mm")
    search = DamageSearch(points, shape)
    if search.bad.any() and (axes := _leaning_axes(points, shape, search.misfit)) is not None:
        shape = replace(shape, axes=axes)
        search = DamageSearch(points, shape)
    counted, bad = ~np.isin(points.measurement, list(set_aside)), int(search.bad.sum())
    missed = f"{bad} of {len(points)} points miss the artefact by up to {search.misfit.max():.3g} mm"
    if bad >= _SEVERAL:
        _refuse_whole(search, missed, where)
    if 2 * int(search.bad[counted].sum()) > counted.sum():
        observe(points)  # refuses another artefact in its own words, where its checks see it
        raise CmmUqError(missed, where=where, fix="Check [artefact] in job.toml, and the order of rows and columns")
    found = search.findings() if bad else []
    lost = {row for f in found for row in f.rows if counted[row]}
    if len(lost) > max(MOST * len(points), 2):
        problem = f"{len(lost)} of {len(points)} points do not fit the artefact; {found[0].why}"
        fix = "So much of a recording cannot be left out: mend it, or measure again"
        raise CmmUqError(problem, where=where, fix=fix)
    return found + _reversed_bars(points, shape)


def _leaning_axes(points: Points, shape: ArtefactShape, misfit: Floats) -> Floats | None:
    """Unit vectors of axes out of square on which most of what missed the artefact fits it; ``None`` where none do so.

    Where most fits as it is, the angles are those of what fits: only so they foretell what does not.
    """
    missed, count = misfit > shape.tolerance, len(np.unique(points.group)) if shape.together else len(points)
    few = missed.mean() <= MOST
    if count < _FOR_ANGLES or not np.isfinite(misfit).all():
        return None
    every = np.ones(len(points), dtype=bool)

    def left(angles: Floats, rows: NDArray[np.bool_]) -> Floats:
        return replace(shape, axes=axis_directions(angles)).misfit(points.xyz, shape.reference)[rows]

    most, fitted = np.full(3, MOST_LEAN), (~missed if few else every,)
    fit = partial(scipy.optimize.least_squares, left, np.zeros(3), bounds=(-most, most), x_scale=0.01, loss="cauchy")
    angles = fit(args=fitted, f_scale=0.1 * shape.tolerance).x
    after = left(angles, every)
    explained = missed & (after < _EXPLAINED * misfit)
    sound = not np.any(after[~missed] > shape.tolerance)
    return axis_directions(angles) if sound and 2 * explained.sum() > (0 if few else missed.sum()) else None


def _refuse_whole(search: DamageSearch, missed: str, where: str) -> None:
    points, shape = search.points, search.shape
    bad = int(search.bad.sum())
    best, fewest = None, min(max(2, int(_EDGES * len(points))), bad // _SEVERAL)
    strays = max(_EDGES, _astray(points))
    free = np.isnan(shape.size) and not shape.reference.shape[1]
    for change in (*row_mistakes(shape), *block_mistakes(shape)):
        if free and change.kind == "unit" and change.apply(np.ones((1, 3)), np.zeros((1, 0)))[0].min() < 1:
            continue
        xyz, reference = search.changed(change, np.arange(len(points)))
        left = int(np.sum(shape.misfit(xyz, reference) > shape.tolerance))
        if left <= fewest and _astray(points.at(xyz)) <= strays:
            best, fewest = change, left - 1
    if best is not None:
        problem = f"{missed}, and fit once one mistake is undone: {best.what}"
        raise CmmUqError(problem, where=f"{where}, column {best.columns[0]}", fix=best.fix)
    for axis, column in zip(AXES, points.xyz.T, strict=True):
        if np.ptp(column) == 0 and bad > MOST * len(points):
            problem = f"{missed}: {axis}_mm is stuck at {column[0]:g} in every row"
            raise CmmUqError(problem, where=f"{where}, column {axis}_mm", fix="Export the recording again")


def _astray(points: Points) -> float:
    return float(np.any(outside_travel(points), axis=1).mean())


def _reversed_bars(points: Points, shape: ArtefactShape) -> list[Finding]:
    if not shape.together or shape.reference.shape[1]:
        return []
    ends = np.array([rows[np.argsort(points.point[rows])] for rows in shape.rows])
    bars, found = points.xyz[ends[:, 1]] - points.xyz[ends[:, 0]], []
    placings = Placings.of(points.measurement[ends[:, 0]])
    for number, own in zip(placings.numbers, placings.rows, strict=True):
        against = bars[own] @ bars[own[0]] < 0
        if len(own) < 2 or not against.any():
            continue
        rows = ends[own[against] if against.sum() <= len(own) / 2 else own[~against]].ravel()
        why = say(
            "{at_lines}: balls 1 and 2 of measurement {number} are exchanged against its other repeats. "
            "The length does not show it; what was recorded beside each ball (approach, temperatures) "
            "may be exchanged too",
            at_lines=at_lines(points, rows),
            number=number,
        )
        found.append(finding("swapped", points, rows, why))
    return found
