"""A new job of an artefact that is shifted along an axis, or of a plate that is shifted and turned in a plane."""

from __future__ import annotations

import numpy as np

from cmm_uq.base.points import AXES, Machine, Points
from cmm_uq.jobs.beginning import Beginning

SIDE, PITCH = 3, 150.0
"""Balls along a side of the plate, and their distance, mm."""

PLACINGS = ((0.0, 0.0, 0.0), (150.0, 0.0, 0.0), (0.0, 150.0, 0.0), (0.0, 0.0, 90.0))
"""Shift of the plate's middle along x and y, mm, and turn, °: enough to part the plate from the machine."""

AXIS = Beginning(
    title="Self-calibration of an axis by shifting an uncalibrated gauge",
    numbering="One measurement is one series, at one shift; its points are those of the gauge.",
    artefact={
        "name": "Step gauge, uncalibrated but for its length",
        "axis": "x",
        "shifts_mm": [0.0, 20.0, 50.0],
        "u_shift_um": 100.0,
        "known": {"from": 1, "to": 21, "length_mm": 400.0, "u_um": 0.5},
    },
    effects=(),
    plan={"repeats": 3},
)


def placed_plate(machine: Machine) -> Points:
    """A square plate of balls about the middle of the plane xy, in every placing."""
    steps = PITCH * (np.arange(SIDE) - 0.5 * (SIDE - 1))
    balls = np.column_stack([part.ravel() for part in np.meshgrid(steps, steps)])
    middle = np.array([np.mean(machine.travel(axis)) for axis in AXES]) - machine.origin_mm
    parts = []
    for dx, dy, degrees in PLACINGS:
        c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
        flat = balls @ np.array([[c, s], [-s, c]]) + [dx - 25.0, dy - 25.0]
        parts.append(np.column_stack([flat, np.zeros(len(flat))]) + middle)
    count, n = len(balls), len(balls) * len(PLACINGS)
    return Points(
        np.vstack(parts),
        np.repeat(np.arange(1, len(PLACINGS) + 1), count),
        np.tile(np.arange(1, count + 1), len(PLACINGS)),
        np.ones(n, dtype=np.int64),
        machine,
    )


PLANE = Beginning(
    title="Self-calibration of a plane by shifting and turning an uncalibrated plate",
    numbering="One measurement is one placing of the plate; its points are the balls.",
    artefact={
        "name": "Ball plate, uncalibrated but for its diagonal",
        "plane": "xy",
        "known": {"from": 1, "to": SIDE**2, "length_mm": round(PITCH * (SIDE - 1) * 2**0.5, 4), "u_um": 0.5},
    },
    effects=(),
    points=placed_plate,
)
