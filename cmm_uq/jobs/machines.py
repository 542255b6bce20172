"""The machine that a job describes, by its chain or its joints, and recorded coordinates as those of its artefact."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from cmm_uq.base.arm import Arm, rows_of_screws
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import AXES, Floats, Machine, Points
from cmm_uq.base.rotary import NORMALS, RotaryAxis, RotaryMachine
from cmm_uq.base.units import MICROMETRE
from cmm_uq.jobs.columns import COORDINATES, REQUIRED, SENSORS
from cmm_uq.jobs.tables.machine import MachineFacts, stated_axes
from cmm_uq.jobs.tables.rotary_axes import RotaryAxisFacts, parts_of_chain
from cmm_uq.maths.geometry.feature import nearest_rotations

_FINEST = 9  # decimals of a number that is looked at as printed
_ROUNDING = 1e-6  # of a reading, °
_FARTHEST = 1.01  # of the reach, from which on a place is beyond it


def machine_of(facts: MachineFacts) -> Machine:
    """Of three carriages, or with rotary axes too; or an arm of joints."""
    if facts.is_arm:
        return _arm(facts)
    travel = np.array([getattr(facts.travel_mm, axis) or [np.nan, np.nan] for axis in AXES], dtype=np.float64)
    carriages, head, tables = parts_of_chain(facts.chain)
    every = (facts.name, carriages, travel, np.array(facts.origin_mm, dtype=np.float64))
    if not head + tables:
        return Machine(*every, read_by=stated_axes(facts.axes))
    stated: dict[str, RotaryAxisFacts] = {each.name: each for each in facts.rotary}
    stated = {tables: facts.table, **stated}
    return RotaryMachine(
        *every, read_by=stated_axes(facts.axes), stylus_mm=np.array(facts.head.stylus_mm or [0.0, 0.0, 0.0]),
        rotary=tuple(
            _rotary(name, stated.get(name, RotaryAxisFacts()), head=i >= len(tables)) for i, name in enumerate(tables + head)
        ),
        tip_on_every_carriage=bool(head), recorded_in_machine=facts.table.coordinates == "machine",
        normals_in_machine=facts.table.normals == "machine", recorded_at_ram=facts.head.coordinates == "carriages",
    )  # fmt: skip


def _rotary(name: str, facts: RotaryAxisFacts, *, head: bool) -> RotaryAxis:
    axis = None if facts.axis_mm is None else np.array(facts.axis_mm, dtype=np.float64)
    turns = np.array(facts.travel_deg or [np.nan, np.nan], dtype=np.float64)
    return RotaryAxis(name.lower(), axis, turns, clockwise=facts.turns == "clockwise", head=head)


def in_coordinates(points: Points, facts: MachineFacts, where: str) -> Points:
    """A recording at the coordinates of what was measured; what does not go with its machine's rotary axes is refused."""
    machine = points.machine
    if not isinstance(machine, RotaryMachine):
        return points
    columns = dict(points.columns)
    for axis in machine.rotary:
        (low, high), read = axis.travel_deg, columns.get(axis.column, np.zeros(len(points)))
        beyond = (read < low - _ROUNDING) | (read > high + _ROUNDING)
        if axis.column in columns and beyond.any():
            row, what = int(np.argmax(beyond)), "head" if axis.head else "table"
            said = f"{axis.column} = {read[row]:g} lies outside the travel of the {what}, {low:g} to {high:g} °"
            key = "[machine.table]" if len(machine.rotary) == 1 and not axis.head else "[[machine.rotary]]"
            raise CmmUqError(said, where=f"{where} line {points.lines[row]}", fix=f"Mend it, or travel_deg in {key}")
    if all(name in columns for name in NORMALS) and any(np.any(columns.get(t.column, 0.0)) for t in machine.tables):
        if facts.table.normals is None:
            said = "has normals of probed points, which do not say with a turned table whether they turned with it"
            fix = 'Say it, normals = "table" or "machine" in [machine.table]; or leave nx, ny, nz out'
            raise CmmUqError(said, where=where, fix=fix)
        columns |= machine.normals(columns, back=True)
    if machine.head:
        tips = np.broadcast_to(machine.tip(columns), points.xyz.shape)
        columns |= {f"tip_{a}_mm": tip for a, tip in zip(AXES, tips.T, strict=True)}
    xyz = machine.from_recorded(points.xyz, columns)
    if any(name in columns for name in SENSORS):
        read = np.column_stack([columns.pop(name, np.zeros(len(xyz))) for name in SENSORS])
        xyz = xyz + machine.turned_back(MICROMETRE * read[:, :, None], columns)[:, :, 0]
    return replace(points, xyz=xyz, columns=columns)


def _arm(facts: MachineFacts) -> Arm:
    joints, up = facts.joint, np.array(facts.arm.up, dtype=np.float64)
    tool, revolute = np.array(facts.arm.tool_mm), np.array([joint.type == "revolute" for joint in joints], dtype=bool)
    geometry: dict[str, Any] = {"rows": np.array([joint.row for joint in joints]).reshape(-1, 5), "tool_mm": tool}
    if facts.arm.home:
        home = np.vstack([np.array(facts.arm.home)[:3], [0.0, 0.0, 0.0, 1.0]])
        home[:3, :3] = nearest_rotations(home[None, :3, :3])[0]
        directions, through = (np.array([getattr(joint, of) for joint in joints]) for of in ("unit", "through"))
        geometry = rows_of_screws(directions, through, revolute, home)
        geometry["tool_mm"] = geometry["tool_mm"] + tool
    return Arm(
        facts.name,
        origin_mm=np.array(facts.origin_mm),
        reach_mm=facts.arm.reach_mm or np.nan,
        **geometry,
        by_screws=bool(facts.arm.home),
        modified=facts.arm.convention == "modified",
        revolute=revolute,
        sense=np.array([-1.0 if joint.reversed else 1.0 for joint in joints]),
        up=up / np.linalg.norm(up),
        limits=np.array([joint.travel or [np.nan, np.nan] for joint in joints]).reshape(-1, 2),
    )


def required_columns(machine: Machine, header: Collection[str]) -> Sequence[str]:
    """Columns that a recording must have; coordinates of an arm follow from what its joints read, and may be left out."""
    if not isinstance(machine, Arm) or not machine.joints:
        return REQUIRED
    recorded = COORDINATES if any(name in header for name in COORDINATES) else ()
    return (*(name for name in REQUIRED if name not in COORDINATES), *recorded, *machine.columns_of_joints)


def coordinates(machine: Machine, table: Mapping[str, Floats], lines: Sequence[int], name: str) -> Floats:
    """Coordinates (n, 3), mm, of a recording: as recorded, or by the joints of an arm."""
    if not isinstance(machine, Arm):
        return np.column_stack([table[column] for column in COORDINATES])
    found = (
        by_joints(machine, table, lines, name)
        if machine.joints
        else np.column_stack([table[column] for column in COORDINATES])
    )
    away = np.linalg.norm(found + machine.origin_mm, axis=1)
    if np.any(beyond := away > _FARTHEST * machine.reach_mm):  # no reach is stated: none
        row = int(np.argmax(beyond))
        said = f"lies {away[row]:.0f} mm from the base, beyond the reach of the arm, {machine.reach_mm:g} mm"
        fix = "Mend it, or reach_mm in [machine.arm] or origin_mm in [machine]"
        raise CmmUqError(said, where=f"{name} line {lines[row]}", fix=fix)
    return found


def by_joints(machine: Arm, table: Mapping[str, Floats], lines: Sequence[int], name: str) -> Floats:
    """Coordinates (n, 3), mm, by what the joints read. Others, and readings beyond a joint's travel, are refused.

    Recorded coordinates and readings may be rounded as their digits show.
    """
    if missing := [column for column in machine.columns_of_joints if column not in table]:
        raise CmmUqError(f"no column {missing[0]!r}", where=name, fix="Record what each joint reads")
    read = np.column_stack([table[column] for column in machine.columns_of_joints])
    beyond = (read < machine.limits[:, 0] - 1e-6) | (read > machine.limits[:, 1] + 1e-6)
    if beyond.any():
        row, joint = np.argwhere(beyond)[0]
        low, high = machine.limits[joint]
        said = f"{read[row, joint]:g} lies outside the travel of the joint, {low:g} to {high:g}"
        at = f"{name} line {lines[row]}, column {machine.columns_of_joints[joint]}"
        raise CmmUqError(said, where=at, fix="Mend it, or travel in [[machine.joint]]")
    pose = machine.posed(table)
    xyz = np.asarray(pose.tool - machine.origin_mm)
    if COORDINATES[0] in table:
        recorded = np.column_stack([table[column] for column in COORDINATES])
        turns, shifts = _step(read[:, machine.revolute]), _step(read[:, ~machine.revolute])
        reach = 1.0 + float(np.linalg.norm(pose.tool[:, None, None] - pose.origins, axis=3).max(initial=0.0))
        off = np.linalg.norm(recorded - xyz, axis=1)
        rounded = reach * np.radians(turns) * machine.revolute.sum() + shifts * (~machine.revolute).sum()
        if np.any(off > _step(recorded) + 0.5 * float(rounded)):
            row = int(np.argmax(off))
            said = f"x_mm, y_mm, z_mm lie {off[row]:.4g} mm from where [[machine.joint]] has the tool at these readings"
            fix = (
                "Mend rows, convention, reversed or tool_mm; or leave the coordinates out: they follow from the joints"
            )
            raise CmmUqError(said, where=f"{name} line {lines[row]}", fix=fix)
    return xyz


def _step(values: Floats) -> float:
    """The last decimal that numbers are printed with."""
    decimals = (d for d in range(_FINEST) if np.allclose(values, np.round(values, d), rtol=0, atol=10.0 ** (-d - 4)))
    return 10.0 ** -next(decimals, _FINEST)


def strange_column(machine: Machine, column: str, header: Collection[str]) -> tuple[str, str] | None:
    """What is wrong with a column that reads as one of an axis, and is none that the machine has; and what to do."""
    found = _OF_AXIS.fullmatch(column)
    arm = isinstance(machine, Arm)
    own = (
        machine.columns_of_joints
        if isinstance(machine, Arm)
        else [f"{one}_deg" for one in machine.axes if one not in AXES]
    )
    if found is None or column in own:
        return None
    same = next((name for name in own if name.startswith(f"{found[1]}_")), None)
    if same is not None and same not in header:
        unit = "degrees" if same.endswith("deg") else "mm"
        return f"the column {column!r} is of the axis that reads {same!r}", f"Give it in {unit} as {same}"
    if arm and column[0] == "q" and same is None:
        count = len(own)
        return (
            f"the column {column!r} is of joint {found[1][1:]}, and the arm has {count}",
            "Give its [[machine.joint]], or leave it out",
        )
    return None


_OF_AXIS = re.compile(r"([abc]|q[1-9]\d?)(?:_(?:deg|rad|mrad|mm|m|angle))?", re.IGNORECASE)
