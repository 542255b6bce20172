"""The estimated curves as an error map, which compensates the machine's readings."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from cmm_uq.artefacts.shift_axis.curve import Curve
from cmm_uq.base.points import AXES, Floats, Machine
from cmm_uq.base.units import ARCSECOND, MICROMETRE
from cmm_uq.machine.physics.error_map import AxisErrors, ErrorMap, error_map_csv

_DECIMALS = 3  # of the table's µm and ″


def correction_table(axis: str, curve: Curve, machine: Machine) -> ErrorMap:
    """Error map with the curve as displacement of one carriage along itself; everything else zero.

    It reaches over the machine's travel where that is known; beyond what was read it holds the last value, uncalibrated.
    """
    column = AXES.index(axis)
    errors = np.zeros((len(curve.position), 6))
    errors[:, column] = curve.error
    return error_map_of({column: (curve.position, errors)}, machine)


def error_map_of(found: Mapping[int, tuple[Floats, Floats]], machine: Machine) -> ErrorMap:
    """Error map of positions and errors (m, 6) of some carriages, rounded as in a table; everything else zero."""
    x, y, z = (_carriage(machine.travel_mm[a], found.get(a)) for a in range(3))
    return ErrorMap((x, y, z))


def table_text(table: ErrorMap) -> bytes:
    """The table as the CSV that ``[machine] error_map`` names."""
    return error_map_csv(table).encode()


def _carriage(travel: Floats, found: tuple[Floats, Floats] | None) -> AxisErrors:
    low, high = (float(v) for v in travel)
    if found is None:
        ends = np.array([-1e4, 1e4]) if np.isnan(low) else np.array([low, high])
        return AxisErrors(ends, np.zeros((2, 6)))
    unit = np.repeat([MICROMETRE, ARCSECOND], 3)
    position, errors = found[0], np.round(found[1] / unit, _DECIMALS) * unit
    if not np.isnan(low) and low < position[0]:
        position, errors = np.r_[low, position], np.vstack([errors[:1], errors])
    if not np.isnan(high) and high > position[-1]:
        position, errors = np.r_[position, high], np.vstack([errors, errors[-1:]])
    return AxisErrors(position, errors)
