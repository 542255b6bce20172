"""Columns of error maps that repeat the figures of another map: they were measured once.

Two runs of an interferometer differ by their noise. A column that is another map's to the last digit, but for a constant, for
a few readings, or for having been rounded further, is that column again, whatever temperature stands above it.
"""

from __future__ import annotations

import numpy as np

from cmm_uq.base.points import Floats

_LAST_DIGIT = 1e-9  # mm

_MOST = 0.8
"""Part of the readings that are the same to the last digit, from which on a column is another one with a few changed."""

_FEWEST, _VALUES = 6, 4  # same readings, and different values among them, without which that is coincidence
_DIGITS = range(5)  # after the point, in the column's unit
_EXACT = 1e-6  # of the last digit


def copies(values: Floats, unit: float) -> list[tuple[int, ...]]:
    """Groups of maps (indices into ``values``, ascending) that give one column with the same figures.

    ``values`` (k, p) of one error in k maps, mm; a map that is zero throughout is in no group; ``unit`` size of the
    column's unit in ``values``.
    """
    groups: list[list[int]] = []
    for k in range(len(values)):
        if not np.any(values[k]):
            continue
        group = next((group for group in groups if any(_same(values[j], values[k], unit) for j in group)), None)
        if group is None:
            groups.append([k])
        else:
            group.append(k)
    return [tuple(group) for group in groups if len(group) > 1]


def _same(one: Floats, other: Floats, unit: float) -> bool:
    apart = one - other
    if np.ptp(apart) <= _LAST_DIGIT:
        return True
    same = np.abs(apart - np.median(apart)) <= _LAST_DIGIT
    if same.mean() >= _MOST and _no_coincidence(one[same]):
        return True
    coarse, fine = sorted((one, other), key=lambda course: _digits(course, unit))
    digits = _digits(coarse, unit)
    rounded = np.abs(coarse - fine) <= (0.5 + _EXACT) * 10.0**-digits * unit
    return digits < _digits(fine, unit) and bool(rounded.all()) and _no_coincidence(coarse)


def _no_coincidence(readings: Floats) -> bool:
    return len(readings) >= _FEWEST and len(np.unique(np.round(readings, 9))) >= _VALUES


def _digits(course: Floats, unit: float) -> int:
    figures = course / unit
    enough = (n for n in _DIGITS if np.all(np.abs(figures * 10**n - np.round(figures * 10**n)) < _EXACT * 10**n))
    return next(enough, _DIGITS.stop)
