"""The estimated curve as an error map, which compensates the machine's readings."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from cmm_uq.physics.error_map import AxisErrors, ErrorMap, write_error_map
from cmm_uq.points import AXES, Floats, Machine
from cmm_uq.selfcalibration.curve import Curve
from cmm_uq.units import MICROMETRE

_DECIMALS = 3
"""Of the table's µm."""


def correction_table(axis: str, curve: Curve, machine: Machine) -> ErrorMap:
    """Error map with the curve as displacement of one carriage along itself; everything else zero.

    It reaches over the machine's travel where that is known; beyond what was read it holds the last value, uncalibrated.

    Parameters
    ----------
    axis : x, y or z.
    curve : true = indicated + e at scale readings.
    machine : whose travel the table must cover.
    """
    carriages = [_carriage(machine.travel_mm[i], curve if a == axis else None, i) for i, a in enumerate(AXES)]
    x, y, z = carriages
    return ErrorMap((x, y, z))


def table_text(table: ErrorMap) -> bytes:
    """The table as the CSV that ``[machine] error_map`` names."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "map.csv"
        write_error_map(table, path)
        return path.read_bytes()


def _carriage(travel: Floats, curve: Curve | None, column: int) -> AxisErrors:
    low, high = (float(v) for v in travel)
    if curve is None:
        ends = np.array([-1e4, 1e4]) if np.isnan(low) else np.array([low, high])
        return AxisErrors(ends, np.zeros((2, 6)))
    position, error = curve.position, np.round(curve.error / MICROMETRE, _DECIMALS) * MICROMETRE
    if not np.isnan(low) and low < position[0]:
        position, error = np.r_[low, position], np.r_[error[0], error]
    if not np.isnan(high) and high > position[-1]:
        position, error = np.r_[position, high], np.r_[error, error[-1]]
    errors = np.zeros((len(position), 6))
    errors[:, column] = error
    return AxisErrors(position, errors)
