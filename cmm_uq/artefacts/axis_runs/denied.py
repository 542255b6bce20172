"""Readings of runs that deny each other: another sign, another unit, another direction than those beside them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from cmm_uq.artefacts.axis_runs.run import ACROSS, CIRCLE, SQUARE, STRAIGHTEDGE, TURNING, Run, vectors
from cmm_uq.base.points import AXES, Floats, Ints, Points
from cmm_uq.base.units import ARCSECOND
from cmm_uq.machine.model.recorded import refuse

_SAME_MM = 1e-6
_OPPOSITE = 16.0  # how much nearer a repeat is to the others with its sign changed, in squares, to be one turned over
_COMMON, _SLOPE = 8, 1e-6 / ARCSECOND  # targets by which two runs of one line are compared; 1 µm/m in ″


def refuse_denied(points: Points, runs: tuple[Run, ...], readings: Floats, where: str | None) -> None:
    """Refuse what other readings (n,), mm, of a recording deny."""
    for run in runs:
        if (rows := turned_over(run, readings[run.rows], points.repeat[run.rows])) is not None:
            wrong = np.isin(np.arange(len(points)), run.rows[rows])
            both = len(rows) == np.sum(points.repeat[run.rows] == points.repeat[run.rows][rows[0]])
            repeat = f"repeat {points.repeat[run.rows][rows[0]]}" + ("" if both else ", in one direction,")
            problem = f"{repeat} of measurement {run.measurement} reads as the others do with the other sign"
            refuse(points, wrong, where, problem, "Turn its readings over, or leave it out")
    if found := read_otherwise(points, runs, readings):
        number, other, what = found
        problem = f"measurement {number} reads the line of measurement {other} {what}"
        refuse(points, points.measurement == number, where, problem, "Mend the one that is wrong, or leave it out")
    if (row := approached_otherwise(points, runs)) is not None:
        point = f"point {points.point[row]} of measurement {points.measurement[row]}"
        problem = f"{point} is approached the other way in repeat {points.repeat[row]}"
        only = np.arange(len(points)) == row
        refuse(points, only, where, problem, "Mend approach_x …, or number it as another point")


def turned_over(run: Run, readings: Floats, repeat: Ints) -> Ints | None:
    """Rows of a repeat, or of one direction of it, whose readings (k,) are those of the others with the other sign.

    Noise and drift do not look so: the mean of the others is no larger than how they scatter makes it.
    """
    where = np.column_stack([np.round(run.positions / _SAME_MM), run.directions])
    index = np.unique(where, axis=0, return_inverse=True)[1].ravel()
    for own, beside in _apart(run, repeat):
        count = np.bincount(index[beside], minlength=index.max() + 1)
        rows = own[count[index[own]] > 0]
        others = (np.bincount(index[beside], readings[beside], index.max() + 1) / np.maximum(count, 1))[index]
        if len(rows) < 2:
            continue
        one, mean = readings[rows] - readings[rows].mean(), others[rows] - others[rows].mean()
        if np.sum((one - mean) ** 2) <= _OPPOSITE * np.sum((one + mean) ** 2):
            continue
        noise, targets = float(np.sum((readings - others)[beside] ** 2)), len(np.unique(index[beside]))
        square = noise / max(len(beside) - targets, 1) / np.mean(count[index[rows]])  # of a mean of others
        if np.mean(mean**2) > _OPPOSITE * square:
            return rows
    return None


def _apart(run: Run, repeat: Ints) -> Iterator[tuple[Ints, Ints]]:
    """Rows of each repeat, then of each direction of each, and those of two others or more."""
    whole = np.zeros(len(repeat))
    for way in (whole, run.directions) if len(np.unique(run.directions)) > 1 else (whole,):
        for side in np.unique(way):
            numbers = np.unique(repeat[way == side])
            for one in numbers if len(numbers) > 2 else ():
                yield np.flatnonzero((way == side) & (repeat == one)), np.flatnonzero((way == side) & (repeat != one))


def approached_otherwise(points: Points, runs: tuple[Run, ...]) -> int | None:
    """Row of a point that another repeat, of both directions too, approaches the other way; ``None`` where there is none."""
    for run in runs:
        first: dict[int, float] = {}
        for one in np.unique(points.repeat[run.rows]):
            own = np.flatnonzero(points.repeat[run.rows] == one)
            for i in own if len(np.unique(run.directions[own])) > 1 else ():
                if run.directions[i] * first.setdefault(int(points.point[run.rows[i]]), run.directions[i]) < 0:
                    return int(run.rows[i])
    return None


def read_otherwise(points: Points, runs: tuple[Run, ...], readings: Floats) -> tuple[int, int, str] | None:
    """Two measurements of one line of which the later reads as the first does with the other sign, or in another unit.

    Of eight targets in common at least; readings against a straightedge or a square may differ so.
    """
    names = tuple(f"tip_{a}_mm" for a in AXES)
    against = np.any([points.columns.get(name, np.zeros(len(points))) != 0 for name in (STRAIGHTEDGE, SQUARE)], axis=0)
    first: dict[tuple[float, ...], tuple[Run, dict[tuple[float, float], float]]] = {}
    for run in runs:
        if run.kind == CIRCLE or run.table or against[run.rows].any():
            continue
        beside = points.xyz[run.rows[0]] - (points.xyz[run.rows[0]] @ run.travel) * run.travel
        line = np.concatenate([run.travel, run.sense, beside, vectors(points, names)[run.rows[0]]])
        key = (run.kind == TURNING, *(np.round(line, 2) + 0.0).tolist())
        at: dict[tuple[float, float], list[float]] = {}
        for target, way, value in zip(run.positions + run.start, run.directions, readings[run.rows], strict=True):
            at.setdefault((round(float(target), 2), float(way)), []).append(float(value))
        means = {where: float(np.mean(each)) for where, each in at.items()}
        other, those = first.setdefault(key, (run, means))
        common = sorted(set(means) & set(those))
        if other is run or len(common) < _COMMON:
            continue
        own, before = (np.array([each[where] for where in common]) for each in (means, those))
        free = np.vander([target for target, _ in common], 2 if run.kind == ACROSS else 1)
        own, before = (each - free @ np.linalg.lstsq(free, each, rcond=None)[0] for each in (own, before))
        words = {-1.0: "with the other sign"}
        if run.kind == TURNING:
            words |= {
                1 / _SLOPE: "4.85 times as large, as µm/m are",
                _SLOPE: "0.206 times as large, as ″ against µm/m are",
            }
        for factor, what in words.items():
            if np.sum((own - before) ** 2) > _OPPOSITE * np.sum((own - factor * before) ** 2):
                return run.measurement, other.measurement, what
    return None
