"""Readings of one artefact in several placings along an axis, and what shifts cannot tell.

A function with a period that divides every shift is the same in all placings, so it looks like an artefact of other
dimensions. Between places that no chain of shifts joins, the error may differ by any amount; only smoothness decides there.
"""

from __future__ import annotations

from functools import cached_property
from itertools import pairwise

import numpy as np

from cmm_uq.artefacts.shift.smooth import Scatter
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import AXES, Floats, Ints, Points
from cmm_uq.base.units import HOUR
from cmm_uq.base.values import dataclass

_ALIKE = 1e-3  # shifts nearer to each other than this are the same, mm
_LATER = 0.01  # root of the sum of squares of the times between repeats, h, from which on they show a drift
# part of the artefact's length by which a placing may differ from its nominal shift, at most and at least 1 mm
_MISPLACED = 0.1


@dataclass(frozen=True)
class RepeatedDrift:
    """Drift as repeats of the same reading at different times show it."""

    rate: float  # mm per hour
    noise_scale: float  # its standard uncertainty over that of one ordinary reading, per hour


@dataclass(frozen=True, eq=False)
class ShiftedSeries:
    """Means over repeats, one row a reading."""

    axis: str  # that was read
    reading: Floats  # (n,) scale readings, mm
    series: Ints  # series, point: (n,) index of the placing, and of the artefact's point
    point: Ints
    noise_scale: Floats  # (n,) standard uncertainty of each mean over that of one ordinary reading
    time: Floats | None  # (n,) s; ``None`` where it was not recorded
    # shifts, u_shift: (s,) nominal shift of each placing and the standard uncertainty of each against the first, mm
    shifts: Floats
    u_shift: float
    cosine: Floats  # (s,) of the angle between artefact and axis in each placing, from the other two coordinates
    numbers: Ints  # (p,) of the artefact's points, as recorded
    scatter: Scatter | None  # of repeats about their means and their drift; ``None`` without repeats
    drift: RepeatedDrift | None = None  # from repeats at different times; ``None`` where there are none

    @property
    def span(self) -> tuple[float, float]:
        """Lowest and highest reading, mm."""
        return float(self.reading.min()), float(self.reading.max())

    @cached_property
    def positions(self) -> Floats:
        """Where the axis was read, mm: readings nearer to each other than a tenth of the usual pitch are one place."""
        ordered = np.sort(self.reading)
        starts = np.flatnonzero(np.diff(ordered, prepend=-np.inf) > 0.1 * self.pitch)
        return np.asarray(np.add.reduceat(ordered, starts) / np.diff([*starts, len(ordered)]))

    @cached_property
    def pitch(self) -> float:
        """Median distance of neighbouring points, mm."""
        return float(np.median(np.abs(np.diff(self.reading[self.series == 0]))))

    @cached_property
    def pair(self) -> tuple[Floats, Floats] | None:
        """Readings a and b (n,) of two complete series, for the integrations; ``None`` where there are more, or gaps."""
        a, b = self.series == 0, self.series == 1
        if len(self.shifts) != 2 or a.sum() != len(self.numbers) or b.sum() != len(self.numbers):
            return None
        return self.reading[a], self.reading[b]


def shifted_series(points: Points, axis: str, shifts: Floats, u_shift: float, where: str = "") -> ShiftedSeries:
    """Series from a recording: ``measurement`` numbers the placings, ``point`` the artefact's points."""
    placings = np.unique(points.measurement)
    _check_shifts(shifts, placings)
    means = means_over_repeats(points, where)
    along = AXES.index(axis)
    reading = means.readings[:, along]
    numbers, point = np.unique(means.point, return_inverse=True)
    series = np.searchsorted(placings, means.measurement)
    _check_order(reading, series, placings, means.point, means.line, where)
    _check_common(series, point, numbers, placings, where)
    _check_places(reading, series, point, shifts, placings, where)
    scatter, drift = _repeats(points, means, axis)
    return ShiftedSeries(
        axis, reading, series.astype(np.int64), point.astype(np.int64), means.noise_scale, means.time, shifts, u_shift,
        _cosines(means.readings, series, along), numbers, scatter, drift,
    )  # fmt: skip


def _repeats(points: Points, means: Means, axis: str) -> tuple[Scatter | None, RepeatedDrift | None]:
    """What repeats tell of the repeatability, and of a drift between them."""
    left = (points.readings[axis] - means.readings[means.of, AXES.index(axis)]) / means.ratio
    drift = None
    if means.time is not None:
        later = (points.columns["time_s"] - means.time[means.of]) / means.ratio
        if drift := _drift(left, later):
            left = left - drift.rate * later / HOUR
    dof = len(points) - len(means.point) - (drift is not None)
    return Scatter(float(left @ left), dof) if dof else None, drift


def _drift(left: Floats, later: Floats) -> RepeatedDrift | None:
    """From deviations of repeats, and how much later each was read, s, both over the noise of the reading."""
    hours = later / HOUR
    squares = float(hours @ hours)
    # repeats one right after the other say nothing of a drift
    return RepeatedDrift(float(hours @ left) / squares, squares**-0.5) if squares > _LATER**2 else None


def _check_shifts(shifts: Floats, placings: Ints) -> None:
    where = "job.toml [artefact] shifts_mm"
    if len(placings) < 2:
        raise CmmUqError("the artefact was read in one placing only", where=where,
                         fix="Shift it by about the pitch of its points and read it again")  # fmt: skip
    if len(shifts) != len(placings):
        raise CmmUqError(f"{len(shifts)} shifts for {len(placings)} series", where=where,
                         fix="Give one shift a series, 0.0 for the first")  # fmt: skip
    for one, other in pairwise(np.argsort(shifts).tolist()):
        if shifts[other] - shifts[one] < _ALIKE:
            i, j = sorted((int(one), int(other)))
            raise CmmUqError(
                f"series {placings[i]} and {placings[j]} have the same shift, {shifts[i]:g} mm: a shift of zero against "
                "each other shows nothing of the machine",
                where=where,
                fix=f"Shift series {placings[j]} by about the pitch of the points; the same place read again is a repeat",
            )


def _check_order(reading: Floats, series: Ints, placings: Ints, number: Ints, lines: Ints, where: str) -> None:
    """Every series must run the same way along the axis as the first."""
    way = 0.0
    for s, placing in enumerate(placings):
        rows = np.flatnonzero(series == s)
        steps = np.diff(reading[rows])
        way = way or float(np.sign(reading[rows[-1]] - reading[rows[0]]))
        bad = np.flatnonzero(np.sign(steps) != way)
        if bad.size:
            row = rows[bad[0] + 1]
            raise CmmUqError(
                f"series {placing}, point {number[row]} reads {reading[row]:g} mm, out of order after "
                f"{reading[row - 1]:g} mm",
                where=f"{where} line {lines[row]}" if lines[row] else where or None,
                fix="Number the points along the artefact, in every series the same way, or read this placing again",
            )


def _check_common(series: Ints, point: Ints, numbers: Ints, placings: Ints, where: str) -> None:
    """A point that was read in one placing only says nothing; with two series both must have the same length."""
    alone, counts = np.flatnonzero(np.bincount(point) < 2), np.bincount(series)
    if alone.size:
        number, there = numbers[alone[0]], placings[series[point == alone[0]][0]]
        problem = (
            f"point {number} is read in series {there} only (the series have {', '.join(map(str, counts))} points)"
        )
        fix = f"Read point {number} in another series as well, or leave it out of series {there}"
        raise CmmUqError(problem, where=where or None, fix=fix)
    if counts.min() < 2:
        problem, fix = "has fewer than two points", "Read more points in this placing, or leave it out"
        raise CmmUqError(f"series {placings[np.argmin(counts)]} {problem}", where=where or None, fix=fix)


def _check_places(reading: Floats, series: Ints, point: Ints, shifts: Floats, placings: Ints, where: str) -> None:
    """Each placing must stand where its shift says, and read part of a range that another reads too."""
    each = [reading[series == s] for s in range(len(placings))]
    lowest, highest = (np.array([end(readings) for readings in each]) for end in (np.min, np.max))
    length = float(np.ptp(reading - shifts[series]))
    for s, placing in enumerate(placings):
        others = np.arange(len(placings)) != s
        if not np.any((lowest[others] < highest[s]) & (highest[others] > lowest[s])):
            raise CmmUqError(
                f"series {placing}, shifted by {shifts[s]:g} mm, reads no range that another series reads: nothing is "
                "read twice", where=where or None,
                fix=f"Shift it by less than the {highest[s] - lowest[s]:g} mm it covers, best by the pitch of its points",
            )  # fmt: skip
    first = dict(zip(point[series == 0].tolist(), each[0].tolist(), strict=True))
    for s, placing in enumerate(placings[1:], 1):
        read = zip(point[series == s].tolist(), each[s].tolist(), strict=True)
        moved = [r - first[p] for p, r in read if p in first]
        nominal = shifts[s] - shifts[0]
        if moved and abs(np.mean(moved) - nominal) > max(1.0, min(_MISPLACED * length, 0.5 * abs(nominal))):
            problem = f"series {placing} is shifted by {np.mean(moved):.4g} mm against the first, not by {nominal:g} mm"
            fix = f"Write {shifts[0] + np.mean(moved):.4g}, or mend the recording"
            raise CmmUqError(problem, where="job.toml [artefact] shifts_mm", fix=fix)


def _cosines(means: Floats, series: Ints, along: int) -> Floats:
    """Cosine of the angle between artefact and axis in every placing, from straight lines through the other coordinates."""
    found = np.ones(series.max() + 1)
    across = [i for i in range(3) if i != along]
    for s in range(len(found)):
        rows = series == s
        x = means[rows, along] - means[rows, along].mean()
        slopes = x @ means[rows][:, across] / (x @ x)
        found[s] = 1 / np.sqrt(1 + slopes @ slopes)
    return found


# shifts whose rest is below this part of the smallest are multiples of each other, as far as smooth functions can see
_MULTIPLE = 0.05


@dataclass(frozen=True, eq=False)
class Undetermined:
    """What the readings by themselves leave free."""

    period: float  # mm; functions of this period, and of a half, a third, … of it, show in no reading
    # (m, k) basis of the errors at the positions read that change no reading, beyond a constant and, unless the
    # scale is known, a slope; orthonormal
    patterns: Floats


def undetermined(series: ShiftedSeries, *, scale_known: bool) -> Undetermined:
    """Null space of the readings without any assumption of smoothness.

    Errors at the m positions read, the artefact's points and (unless known) the shifts are free; what is left free of the
    errors, when all readings are met, is the null space.
    """
    positions = series.positions
    place = np.abs(series.reading[:, None] - positions).argmin(axis=1)
    rows = np.arange(len(place))
    errors = np.zeros((len(place), len(positions)))
    errors[rows, place] = 1.0
    others = np.zeros((len(place), len(series.numbers) + len(series.shifts) - 1))
    others[rows, series.point] = 1.0
    if series.u_shift > 0:
        moved = series.series > 0
        others[rows[moved], len(series.numbers) + series.series[moved] - 1] = 1.0
    left, sizes, _ = np.linalg.svd(others)
    rest = left[:, int((sizes > 1e-9).sum()) :]
    _, sizes, right = np.linalg.svd(rest.T @ errors)
    free = right[int((sizes > 1e-9).sum()) :].T
    trivial = [np.ones(len(positions))]
    if series.u_shift > 0 or not scale_known:
        trivial.append(positions - positions.mean())
    known, _ = np.linalg.qr(np.column_stack(trivial))
    free = free - known @ (known.T @ free)
    basis, sizes, _ = np.linalg.svd(free, full_matrices=False)
    # pitches and shifts a little off their nominals leave of the slope itself no more than their own relative error
    return Undetermined(common_period(series.shifts), basis[:, sizes > _MULTIPLE])


def common_period(shifts: Floats) -> float:
    """Largest length, mm, of which every shift is a multiple (Euclid's algorithm on lengths that are not exact)."""
    found = 0.0
    smallest = float(np.diff(np.sort(shifts)).min())
    for shift in np.abs(shifts - shifts[0])[1:]:
        one, other = found, float(shift)
        while other > _MULTIPLE * smallest:
            rest = one % other
            one, other = other, min(rest, other - rest)
        found = one
    return found


NOISE_RATIO = "noise_ratio"  # optional column: standard uncertainty of this reading over that of an ordinary one


@dataclass(frozen=True, eq=False)
class Means:
    """One row a (measurement, point), in this order."""

    measurement: Ints  # measurement, point: (m,) as recorded
    point: Ints
    readings: Floats  # (m, 3) scale readings of x, y, z, mm, weighted by the noise of each repeat
    noise_scale: Floats  # (m,) standard uncertainty of each mean over that of one ordinary reading
    time: Floats | None  # (m,) s; ``None`` where it was not recorded
    line: Ints  # (m,) of the first repeat in its file; 0 where there is none
    of: Ints  # (n,) row that each recorded point went into
    ratio: Floats  # (n,) noise of each recorded point over an ordinary one's


def means_over_repeats(points: Points, where: str = "") -> Means:
    ratio = points.columns.get(NOISE_RATIO, np.ones(len(points)))
    if (ratio <= 0).any():
        problem = "noise_ratio must be positive"
        raise CmmUqError(problem, where=where, fix="1 is an ordinary reading, 2 one twice as noisy")
    keys, first, of = np.unique(
        np.column_stack([points.measurement, points.point]), axis=0, return_index=True, return_inverse=True
    )
    of = of.ravel()
    weight = 1 / ratio**2
    total = np.bincount(of, weight)
    readings = np.column_stack([np.bincount(of, weight * x) / total for x in points.carriages.T])
    time = points.columns.get("time_s")
    line = points.lines[first] if len(points.lines) else np.zeros(len(keys), dtype=np.int64)
    return Means(
        keys[:, 0], keys[:, 1], readings, 1 / np.sqrt(total),
        None if time is None else np.asarray(np.bincount(of, weight * time) / total), line, of, ratio,
    )  # fmt: skip
