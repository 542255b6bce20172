"""The estimated curves as an error map, which compensates the machine's readings."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from cmm_uq.artefacts.shift_axis.curve import Curve
from cmm_uq.artefacts.shift_plate.plane import PlaneEstimate
from cmm_uq.base.points import AXES, Floats, Machine
from cmm_uq.base.units import ARCSECOND, MICROMETRE
from cmm_uq.machine.physics.effects.rigid_body import SQUARENESS
from cmm_uq.machine.physics.error_map import AxisErrors, ErrorMap, write_error_map
from cmm_uq.machine.physics.kinematics import carried_offset

_DECIMALS = 3  # of the table's µm and ″


def correction_table(axis: str, curve: Curve, machine: Machine) -> ErrorMap:
    """Error map with the curve as displacement of one carriage along itself; everything else zero.

    It reaches over the machine's travel where that is known; beyond what was read it holds the last value, uncalibrated.
    """
    column = AXES.index(axis)
    errors = np.zeros((len(curve.position), 6))
    errors[:, column] = curve.error
    return _error_map({column: (curve.position, errors)}, machine)


def plane_correction_table(estimate: PlaneEstimate, machine: Machine) -> ErrorMap:
    """Error map of the two carriages of a plane; the squareness stands in it as a slope of the second axis' straightness.

    A map counts levers from the scales' zero, the estimate from the middle of what was read: the difference goes into the
    displacements. Scales that the placings leave open are left as they are.
    """
    found: dict[int, tuple[Floats, Floats]] = {}
    axes, normal = estimate.plate.axes, 3 - sum(estimate.plate.axes)
    for which, axis in enumerate(axes):
        x = estimate.positions[which]
        errors = np.zeros((len(x), 6))
        errors[:, axis] = estimate.linearity[which].error
        errors[:, axes[1 - which]] = estimate.straightness[which].error
        if axis in estimate.rotations:
            turn = estimate.rotations[axis].error
            arm = carried_offset(AXES[axis], estimate.plate.middle[None], chain=machine.chain)[0, list(axes)]
            errors[:, axes[0]] += arm[1] * turn
            errors[:, axes[1]] -= arm[0] * turn
            errors[:, 3 + normal] = turn
        found[axis] = x, errors
    if SQUARENESS[estimate.plate.plane].name not in estimate.free.names:
        y, errors = found[axes[1]]
        errors[:, axes[0]] -= estimate.squareness.mean() * (y - y[0])
    return _error_map(found, machine)


def table_text(table: ErrorMap) -> bytes:
    """The table as the CSV that ``[machine] error_map`` names."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "map.csv"
        write_error_map(table, path)
        return path.read_bytes()


def _error_map(found: dict[int, tuple[Floats, Floats]], machine: Machine) -> ErrorMap:
    x, y, z = (_carriage(machine.travel_mm[a], found.get(a)) for a in range(3))
    return ErrorMap((x, y, z))


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
