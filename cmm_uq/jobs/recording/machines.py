"""The machine that a job describes, by its chain, and its recorded coordinates as those of its artefact."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import AXES, Machine, Points
from cmm_uq.base.rotary import Turntable
from cmm_uq.jobs.arms import arm
from cmm_uq.jobs.tables.machine import MachineFacts, stated_axes

_ROUNDING = 1e-6  # of a reading, °


def machine_of(facts: MachineFacts) -> Machine:
    """Of three carriages, or with a rotary table too; or an arm of joints."""
    if facts.joint:
        return arm(facts.name, facts.joint, facts.arm)
    travel = np.array([getattr(facts.travel_mm, axis) or [np.nan, np.nan] for axis in AXES], dtype=np.float64)
    origin = np.array(facts.origin_mm, dtype=np.float64)
    carriages, _, letter = facts.chain.partition("|")
    cartesian = Machine(facts.name, carriages, travel, origin, read_by=stated_axes(facts.axes))
    return _with_table(cartesian, facts, letter.lower()) if letter else cartesian


def _with_table(machine: Machine, facts: MachineFacts, letter: str) -> Turntable:
    table = facts.table
    return Turntable(
        machine.name,
        machine.chain,
        machine.travel_mm,
        machine.origin_mm,
        read_by=machine.read_by,
        letter=letter,
        axis_mm=None if table.axis_mm is None else np.array(table.axis_mm, dtype=np.float64),
        travel_deg=np.array(table.travel_deg or [np.nan, np.nan], dtype=np.float64),
        clockwise=table.turns == "clockwise",
        recorded_in_machine=table.coordinates == "machine",
    )


def in_coordinates(points: Points, where: str) -> Points:
    """A recording at the coordinates of what was measured; what does not go with its machine's rotary table is refused."""
    machine = points.machine
    if not isinstance(machine, Turntable) or machine.column not in points.columns:
        return points
    read, (low, high) = points.columns[machine.column], machine.travel_deg
    beyond = (read < low - _ROUNDING) | (read > high + _ROUNDING)
    if beyond.any():
        row = int(np.argmax(beyond))
        raise CmmUqError(
            f"{machine.column} = {read[row]:g} lies outside the travel of the table, {low:g} to {high:g} °",
            where=f"{where} line {points.lines[row]}",
            fix="Mend it, or travel_deg in [machine.table]",
        )
    if np.any(read) and any(f"n{axis}" in points.columns for axis in AXES):
        raise CmmUqError(
            "has normals of probed points, which do not say with a turned table whether they turned with it",
            where=where,
            fix=f"Leave nx, ny, nz out, or measure with the table at 0 and leave {machine.column} out",
        )
    return replace(points, xyz=machine.from_recorded(points.xyz, points.columns))
