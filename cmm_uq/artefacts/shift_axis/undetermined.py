"""What shifts cannot tell: errors of the machine that the artefact's own dimensions imitate.

A function with a period that divides every shift is the same in all placings, so it looks like an artefact of other
dimensions. Between places that no chain of shifts joins, the error may differ by any amount; only smoothness decides there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cmm_uq.artefacts.shift_axis.series import ShiftedSeries
from cmm_uq.base.points import Floats

_ALIKE = 0.05
"""Shifts whose rest is below this part of the smallest are multiples of each other, as far as smooth functions can see."""


@dataclass(frozen=True, eq=False)
class Undetermined:
    """What the readings by themselves leave free.

    Parameters
    ----------
    period : mm; functions of this period, and of a half, a third, … of it, show in no reading.
    patterns : (m, k) basis of the errors at the positions read that change no reading, beyond a constant and, unless the
        scale is known, a slope; orthonormal.
    """

    period: float
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
    return Undetermined(common_period(series.shifts), basis[:, sizes > _ALIKE])


def common_period(shifts: Floats) -> float:
    """Largest length, mm, of which every shift is a multiple (Euclid's algorithm on lengths that are not exact)."""
    found = 0.0
    smallest = float(np.diff(np.sort(shifts)).min())
    for shift in np.abs(shifts - shifts[0])[1:]:
        one, other = found, float(shift)
        while other > _ALIKE * smallest:
            rest = one % other
            one, other = other, min(rest, other - rest)
        found = one
    return found
